"""Routes of a glider that may also hold its depth: what very small yos would reach.

A glider that turns often moves, on average, at any vertical speed between its dive's and its climb's, and hardly
slower than its best horizontal speed. With this freedom the time of a leg is a smooth function of its ends, even
if these lie at one depth. So Newton's method finds the best way through the water, whatever the number of yos.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array
from .glides import ANGLE, HEADING, STEPS, Z_END, Air, Glides, Slopes, Z
from .polish import ROOM, Chain, Effort, Polisher

POINTS = 64
"""The polar is read at this many glide angles from its fastest to its steepest, in each direction."""
LONGEST_CHANGE = 0.3
"""A Newton step changes the duration of a leg at most by this share."""
TINY = 1e-6
"""The least duration [s] of a part of a leg."""
MOVES = Effort(moves=8, barriers=1)
"""How long a route is polished before its stops are spread evenly again."""
ROUNDS = 4
"""Its stops are spread so many times, less one. They gather where the first route turned, and there the way of
the route changes slowly."""
SPREADS = (1.0, 0.5, 0.25)
"""If the stops cannot be spread evenly, a share of that is tried."""
SLIGHT = 3e-4
"""No more rounds are made after one that gains a smaller share of the cost."""


@dataclass(frozen=True)
class FreeAir(Air):
    """Computes legs as `Air` does, for a glider that may hold its depth; the control is not the glide angle.

    The `angle` of a leg is here its duration [s]. Its vertical speed is even, its horizontal speed the greatest
    that goes with it.
    """

    steps = np.where(np.arange(7) == ANGLE, 0.02, STEPS)

    @cached_property
    def speeds(self) -> tuple[Array, Array]:
        """The vertical speeds (n,), rising from the steepest dive to the steepest climb, and horizontal ones."""
        polar = self.evaluator.polar
        rows = []
        for way in range(2):
            angle = np.linspace(polar.best_angle[way], polar.steepest[way], POINTS)
            climbs = np.full(POINTS, bool(way))
            rows.append((self.sinking(angle, climbs), self.speed(angle, climbs) * np.cos(angle)))
        (sink, level), (rise, level_up) = rows
        return np.concatenate([sink[::-1], rise]), np.concatenate([level[::-1], level_up])

    def times(self, begin: Array, end: Array, angle: Array) -> Array:
        """Return the durations (n,) [s]."""
        return angle

    def limits(self, begin: Array, end: Array) -> tuple[Array, Array]:
        """Return the least durations (n,) [s]; there is no greatest."""
        rise, (vertical, _) = end[:, 2] - begin[:, 2], self.speeds
        least = rise / np.where(rise > 0, vertical[-1], vertical[0])
        return np.maximum(least, TINY), np.full(len(rise), np.inf)

    def _longest(self, angle: Array) -> Array | float:
        return LONGEST_CHANGE * angle

    def _time_slopes(self, begin: Array, end: Array, glides: Glides, by: tuple[Array, Array, Array]) -> Array:
        return by[0]

    def _flights(self, row: Array) -> tuple[Array, Array]:
        time, heading = row[:, ANGLE], row[:, HEADING]
        vertical = (row[:, Z_END] - row[:, Z]) / time
        level = np.interp(vertical, *self.speeds)
        through = np.empty((len(row), 3))
        through[:, 0], through[:, 1], through[:, 2] = level * np.cos(heading), level * np.sin(heading), vertical
        return through, time

    def along(self, begin: Array, end: Array, glides: Glides, share: float | Array) -> Array:
        """Return the positions (n, 3) [m] of legs after a share of their duration, one for all or (n,)."""
        height = begin[:, 2] + share * (end[:, 2] - begin[:, 2])
        time = np.maximum(glides.angle * share, TINY)
        of = np.column_stack([begin, glides.departs, height, time, glides.heading])
        return np.column_stack([self._ends(of[None])[0], height])

    def drift(self, begin: Array, end: Array, glides: Glides) -> Array:
        """Return the mean current (n, 2) [m/s] of legs: what the glide does not explain of a leg's way."""
        through, time = self._flights(self._rows(begin, end, glides))
        return (end - begin)[:, :2] / time[:, None] - through[:, :2]


@dataclass(frozen=True)
class FreePolisher(Polisher):
    """Improves routes that may hold their depth."""

    @cached_property
    def air(self) -> FreeAir:
        """The object that computes legs."""
        return FreeAir(self.problem.evaluator)

    def from_route(self, polisher: Polisher, chain: Chain, pieces: int, height: float = 1.0) -> Chain | None:
        """Return a route of real glides, cut into about this many pieces, as one that may hold its depth.

        `height`: the share of its heights above and below a line from start to goal.
        """
        time = chain.glides.time
        counts = np.maximum(1, np.round(time / time.sum() * pieces).astype(np.int64))
        part = np.concatenate([np.arange(1, count + 1) / count for count in counts.tolist()])
        begin, end = (np.repeat(stops, counts, axis=0) for stops in (chain.stops[:-1], chain.stops[1:]))
        many = Glides(*(np.repeat(values, counts) for values in chain.glides))
        stops = polisher.air.along(begin, end, many, part)
        stops[part == 1.0] = chain.stops[1:]
        if height != 1.0:
            line = chain.stops[0, 2] + np.cumsum(np.repeat(time / counts, counts)) / time.sum() * (
                chain.stops[-1, 2] - chain.stops[0, 2]
            )
            stops[:, 2] = line + height * (stops[:, 2] - line)
        return self.chain(np.vstack([chain.stops[:1], stops]), np.repeat(time / counts, counts), many.heading)

    def best(self, chain: Chain) -> Chain:
        """Return the polished route."""
        for _ in range(ROUNDS - 1):
            before, chain = chain.cost, self.polish(chain, MOVES)
            spread = self._spread(chain) if before - chain.cost > SLIGHT * chain.cost else None
            if spread is None:
                return chain
            chain = spread
        return self.polish(chain, MOVES)

    def _spread(self, chain: Chain) -> Chain | None:
        """Return the route with stops at more even times; None if that cannot be flown."""
        time, heading = chain.glides.time, np.unwrap(chain.glides.heading)
        clock = np.concatenate([[0.0], np.cumsum(time)])
        for share in SPREADS:
            at = clock + share * (np.linspace(0.0, clock[-1], len(clock)) - clock)
            leg = np.clip(np.searchsorted(clock, at, side="right") - 1, 0, len(time) - 1)
            of = Glides(*(values[leg] for values in chain.glides))
            stops = self.air.along(chain.stops[leg], chain.stops[leg + 1], of, (at - clock[leg]) / time[leg])
            stops[[0, -1]] = chain.stops[[0, -1]]
            middle = 0.5 * (clock[1:] + clock[:-1])
            found = self.chain(stops, np.diff(at), np.interp(0.5 * (at[1:] + at[:-1]), middle, heading))
            if found is not None:
                return found
        return None

    def _flips(self, stops: Array, before: Array) -> NDArray[np.bool_]:
        return np.zeros(len(stops) - 1, np.bool_)

    def _too_long(self, glides: Glides) -> NDArray[np.bool_]:
        return np.zeros(len(glides.time), np.bool_)

    def _room(self, stops: Array, glides: Glides, slopes: Slopes | None) -> tuple[Array, Array]:
        """Return how far legs are from the steepest glide (n, 1), as shares, and the slopes (n, 1, 6) by ends."""
        rise, (vertical, _) = np.diff(stops[:, 2]), self.air.speeds
        depth = float(self.problem.hi[2] - self.problem.lo[2])
        fastest = np.where(rise > 0, vertical[-1], -vertical[0])
        room = (fastest * glides.time - np.abs(rise)) / depth
        by = np.zeros((len(rise), 1, 6))
        if slopes is not None:
            by[:, 0] = slopes.time[:, :6] * fastest[:, None] / depth
            by[:, 0, 2] += np.sign(rise) / depth
            by[:, 0, 5] -= np.sign(rise) / depth
        return np.maximum(room, 0.0)[:, None] + ROOM, by
