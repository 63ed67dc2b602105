"""Yos along a route that may hold its depth: where they turn, and where along the route their legs end.

The legs of the yos are exact glides. Of each stop several places along the route are tried, and the quickest
chain of glides through one place of each stop is taken.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array
from .free import FreePolisher
from .polish import Chain, Polisher

ROOMY = 1.15
"""A leg rises or sinks by this many times the least change of depth, so that polishing has room."""
STEPS_A_YO = 4
"""A yo's leg is followed in this many steps to find where it turns."""
LONGEST = 1.5
"""No leg is longer than this many pieces of the route; longer ones are cut."""
PLACES = np.linspace(-0.75, 0.75, 7)
"""The places that are tried for a stop, in shares of a middling leg, ahead of its likely place."""


class _Track(NamedTuple):
    """A route that may hold its depth: times (n + 1,) [s] since its begin, stops (n + 1, 3) and drift (n, 2)."""

    clock: Array
    stops: Array
    drift: Array

    def at(self, when: Array) -> Array:
        """Return x, y (..., 2) [m] at some times."""
        return np.stack([np.interp(when, self.clock, self.stops[:, n]) for n in range(2)], axis=-1)

    def drift_at(self, when: Array) -> Array:
        """Return the drift (..., 2) [m/s] at some times."""
        middle = 0.5 * (self.clock[1:] + self.clock[:-1])
        return np.stack([np.interp(when, middle, self.drift[:, n]) for n in range(2)], axis=-1)


def with_yos(polisher: Polisher, free: FreePolisher, chain: Chain, height: float) -> Chain | None:
    """Return a route with yos of about a height [m] along a free one, not polished; None if none can be flown."""
    clock = np.concatenate([[0.0], np.cumsum(chain.glides.time)])
    track = _Track(clock, chain.stops, free.air.drift(chain.stops[:-1], chain.stops[1:], chain.glides))
    made = (_flown(polisher, track, *turns) for turns in _turns(polisher, track, height))
    return min((route for route in made if route is not None), key=lambda route: route.cost, default=None)


def _turns(polisher: Polisher, track: _Track, height: float) -> Iterator[tuple[Array, Array]]:
    """Yield times (m + 1,) [s] and heights (m + 1,) [m] of stops: yos that begin with a dive, or with a climb.

    A yo turns where it is half its height away from the route's depth.
    """
    lowest, highest = float(polisher.problem.lo[2]), min(0.0, float(polisher.problem.hi[2]))
    polar, least = polisher.problem.evaluator.polar, ROOMY * polisher.least_rise
    speed = np.abs(polisher.air.sinking(polar.best_angle, np.array([False, True]))).tolist()
    (begins, ends), lasts = track.stops[[0, -1], 2].tolist(), float(track.clock[-1])
    step = height / STEPS_A_YO / max(speed)
    times = np.arange(0.0, lasts - step, step)
    middle = np.clip(np.interp(times, track.clock, track.stops[:, 2]), lowest + height / 2, highest - height / 2)
    rate = np.diff(np.interp(np.append(times, lasts), track.clock, track.stops[:, 2])) / step
    for climbs in (False, True):
        if not lowest <= begins + (2 * climbs - 1) * least <= highest:
            continue
        at, turns = begins, [(0.0, begins)]
        for now, here, follows in zip(times.tolist(), middle.tolist(), rate.tolist(), strict=True):
            way = 1.0 if climbs else -1.0
            at = min(max(at + way * max(speed[climbs], way * follows) * step, lowest), highest)
            past = way * (at - here) >= height / 2 or at in (lowest, highest)
            if past and abs(at - turns[-1][1]) >= least:
                turns.append((now + step, at))
                climbs = not climbs
        # the last turn leaves room for a leg to the end, in the other direction
        while len(turns) > 1:
            if (turns[-1][1] - turns[-2][1]) * (ends - turns[-1][1]) < 0 and abs(ends - turns[-1][1]) >= least:
                break
            turns.pop()
        if abs(ends - turns[-1][1]) >= least:
            yield _cut(np.array([*turns, (lasts, ends)]), LONGEST * lasts / (len(track.clock) - 1), least)


def _cut(turns: Array, longest: float, least: float) -> tuple[Array, Array]:
    """Return turns (n, 2), times and heights, with stops between: no leg longer [s] or lower [m] than asked."""
    time, rise = np.diff(turns[:, 0]), np.abs(np.diff(turns[:, 1]))
    counts = np.maximum(np.minimum(np.ceil(time / longest), np.floor(rise / least)), 1).astype(np.int64)
    place = np.concatenate([[0.0], np.cumsum(np.repeat(1 / counts, counts))])
    when, height = (np.interp(place, np.arange(len(turns)), turns[:, n]) for n in range(2))
    height[-1] = turns[-1, 1]
    return when, height


def _flown(polisher: Polisher, track: _Track, likely: Array, height: Array) -> Chain | None:
    """Return the quickest route through one place of each stop; None if none can be flown.

    `likely` (n + 1,) [s] and `height` (n + 1,) [m] are the stops' times along the track, and their heights.
    """
    air, count, many = polisher.air, len(likely) - 1, len(PLACES)
    when = np.clip(likely[:, None] + float(np.median(np.diff(likely))) * PLACES, 0.0, track.clock[-1])
    when[0], when[-1] = 0.0, track.clock[-1]
    place = np.concatenate([track.at(when), np.repeat(height[:, None, None], many, axis=1)], axis=-1)
    place[0], place[-1] = track.stops[0], track.stops[-1]
    # all glides from each place of a stop to each of the next
    first, second = (numbers.ravel() for numbers in np.indices((many, many)))
    begin, end = place[:-1, first].reshape(-1, 3), place[1:, second].reshape(-1, 3)
    left, right = when[:-1, first].ravel(), when[1:, second].ravel()
    time, rise = np.maximum(right - left, 1.0), end[:, 2] - begin[:, 2]
    through = (end - begin)[:, :2] / time[:, None] - track.drift_at(0.5 * (left + right))
    angle = np.clip(np.arctan2(np.abs(rise) / time, np.hypot(*through.T)), *air.limits(begin, end))
    departs = polisher.problem.departure + (np.zeros_like(left) if polisher.frozen else left)
    legs = air.glide(begin, end, angle, np.arctan2(through[:, 1], through[:, 0]), departs)
    cost = np.where(legs.exact, legs.time, np.inf).reshape(count, many, many)
    total, before = np.zeros(many), np.zeros((count, many), np.int64)
    for n in range(count):
        sums = total[:, None] + cost[n]
        before[n], total = sums.argmin(axis=0), sums.min(axis=0)
    if not np.isfinite(total[0]):
        return None
    chosen = np.zeros(count + 1, np.int64)
    for n in range(count, 0, -1):
        chosen[n - 1] = before[n - 1, chosen[n]]
    row = (np.arange(count) * many + chosen[:-1]) * many + chosen[1:]
    return polisher.chain(place[np.arange(count + 1), chosen], legs.angle[row], legs.heading[row])
