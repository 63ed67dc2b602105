"""What polishing cannot do by small steps: legs cut and joined, yos put in and taken out."""

import math
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Array, Index
from .glides import Glides
from .polish import Chain, Polisher

CUT_PAYS = 1e-3
"""Cutting every leg of a route in two must gain such a share of its cost: pilots and vehicles like few legs."""
JOIN_COSTS = 1e-4
"""A stop under water that is no turn is taken out where that costs a smaller share than this."""
MOST_CUTS = 2
"""How often all legs are cut in two at most."""
MOST_LEGS = 400
"""A route of more legs is not cut, and its yos are not counted anew: each try takes seconds."""
MOST_COUNTS = 12
"""Numbers of yos that are tried at most."""
MOST_SINGLE = 24
"""A route of more legs gets no single yos: its number of yos is found for the whole of it."""
MOST_TRIES = 24
"""Single yos that are tried at most."""
TRIAL_MOVES = 6
"""Newton steps for each barrier that a route which is only tried is given."""
YO_PAYS = 1e-3
"""A single yo must gain such a share."""
PAYS = 1e-5
"""Another number of yos must gain such a share."""


def improve(polisher: Polisher, chain: Chain) -> Chain:
    """The route polished, with as many yos and cuts as pay; never one that costs more."""
    best = polisher.polish(chain)
    if len(best.glides.time) > MOST_LEGS:
        return best
    best = _best_count(polisher, best)
    if polisher.single_yos and len(best.glides.time) <= MOST_SINGLE:
        best = _with_more_yos(polisher, best)
    for _ in range(MOST_CUTS):
        if 2 * len(best.glides.time) > MOST_LEGS:
            break
        cut = _cut(polisher, best)
        if cut is None or cut.cost > (1 - CUT_PAYS) * best.cost:
            break
        best = polisher.polish(cut)
    return _joined(polisher, best)


def _with_more_yos(polisher: Polisher, chain: Chain) -> Chain:
    """The route with yos put into single legs, the longest first, as long as one pays."""
    tries = 0
    while tries < MOST_TRIES:
        for leg in np.argsort(-chain.glides.time, kind="stable").tolist():
            tries += 1
            more = _zigzag(polisher, chain, leg)
            if more is not None and more.cost < (1 - YO_PAYS) * chain.cost:
                chain = polisher.polish(more)
                break
            if tries == MOST_TRIES:
                break
        else:
            break
    return chain


def _zigzag(polisher: Polisher, chain: Chain, leg: int) -> Chain | None:
    """The route with a small way back in the middle of a leg, polished; None where that cannot be flown."""
    glides, (begin, end) = chain.glides, chain.stops[leg : leg + 2]
    one = slice(leg, leg + 1)
    of = Glides(*(values[one] for values in glides))
    ahead, back = (
        polisher.air.along(chain.stops[one], chain.stops[leg + 1 : leg + 2], of, share)[0] for share in (0.4, 0.6)
    )
    rise = end[2] - begin[2]
    way_back = math.copysign(max(0.2 * abs(rise), 1.2 * polisher.least_rise), rise)
    ahead[2], back[2] = begin[2] + 0.5 * (rise + way_back), begin[2] + 0.5 * (rise - way_back)
    stops = np.concatenate([chain.stops[: leg + 1], [ahead, back], chain.stops[leg + 1 :]])
    steeper = np.arctan((1 + way_back / rise) / 0.8 * np.tan(glides.angle[leg]))
    lowest, highest = polisher.air.angles(np.diff(stops[:, 2]) > 0)
    angle = np.insert(glides.angle, leg, [steeper, glides.angle[leg]])
    angle[leg + 2] = steeper
    heading = np.insert(glides.heading, leg, [glides.heading[leg]] * 2)
    found = polisher.chain(stops, np.clip(angle, lowest, highest), heading)
    return None if found is None else polisher.polish(found, TRIAL_MOVES)


def _best_count(polisher: Polisher, chain: Chain) -> Chain:
    """The route with the number of yos that costs least, looked for by single yos from the likeliest number."""
    if len(turns(chain.stops)) < len(chain.stops) - 2:
        return chain  # some stops are no turns: its legs are cut already
    tried: dict[int, Chain | None] = {len(chain.glides.time): chain}

    def route(legs: int) -> Chain | None:
        if legs not in tried and len(tried) <= MOST_COUNTS and legs >= 2:
            tried[legs] = _respaced(polisher, chain, legs)
        return tried.get(legs)

    at = len(chain.glides.time)
    likely = at + 2 * round((_likely_legs(polisher, chain) - at) / 2)
    other = route(max(likely, at % 2 + 2))
    if other is not None and other.cost < chain.cost:
        at = likely
    for way in (2, -2):
        while True:
            here, there = tried[at], route(at + way)
            assert here is not None
            if there is None or there.cost > (1 - PAYS) * here.cost:
                break
            at += way
    found = tried[at]
    return chain if found is None else polisher.polish(found)


def _likely_legs(polisher: Polisher, chain: Chain) -> float:
    """How many legs the route would have were each as steep as the fastest glide in still water."""
    polar = polisher.problem.evaluator.polar
    climbs = np.diff(chain.stops[:, 2]) > 0
    fastest = np.abs(polisher.air.sinking(polar.best_angle[climbs.astype(np.intp)], climbs))
    return float((chain.glides.time * fastest).sum() / np.abs(np.diff(chain.stops[:, 2])).mean())


def turns(stops: Array) -> Index:
    """Which stops between start and goal are turns from dive to climb, or back."""
    climbs = np.diff(stops[:, 2]) > 0
    return np.asarray(1 + np.flatnonzero(climbs[1:] != climbs[:-1]), np.int64)


@dataclass(frozen=True)
class _Track:
    """A route as functions of the time since it began [s]."""

    clock: Array
    stops: Array
    middle: Array
    current: Array

    @classmethod
    def of(cls, polisher: Polisher, chain: Chain) -> "_Track":
        """Of a route; the current is what a leg's glide alone does not explain of its way."""
        glides, way = chain.glides, np.diff(chain.stops[:, :2], axis=0)
        climbs = np.diff(chain.stops[:, 2]) > 0
        along = polisher.air.speed(glides.angle, climbs) * np.cos(glides.angle)
        through = along[:, None] * np.stack([np.cos(glides.heading), np.sin(glides.heading)], axis=1)
        clock = np.concatenate([[0.0], np.cumsum(glides.time)])
        return cls(clock, chain.stops, 0.5 * (clock[1:] + clock[:-1]), way / glides.time[:, None] - through)

    def places(self, at: Array) -> Array:
        """x, y [m] at times (n,)."""
        return np.stack([np.interp(at, self.clock, self.stops[:, n]) for n in range(2)], axis=1)

    def carried(self, at: Array) -> Array:
        """The mean current [m/s] of legs about times (n,)."""
        return np.stack([np.interp(at, self.middle, self.current[:, n]) for n in range(2)], axis=1)


def _respaced(polisher: Polisher, chain: Chain, legs: int) -> Chain | None:
    """The route with another number of legs, of even times along its track, polished; None where none flies.

    Tops and bottoms keep the depths that they have thereabouts.
    """
    track, old = _Track.of(polisher, chain), chain.stops
    clock = np.linspace(0.0, track.clock[-1], legs + 1)
    stops = np.column_stack([track.places(clock), np.empty(legs + 1)])
    first = int(old[1, 2] > old[0, 2])
    for parity in range(2):
        # even stops of a route that dives first are its tops
        stops[parity::2, 2] = np.interp(clock[parity::2], track.clock[parity::2], old[parity::2, 2])
    stops[0], stops[-1] = old[0], old[-1]
    rise = np.diff(stops[:, 2])
    alternate = bool(((rise > 0) == ((np.arange(legs) + first) % 2 == 1)).all())
    if not alternate:
        return None
    time = np.diff(clock)
    through = np.diff(stops[:, :2], axis=0) / time[:, None] - track.carried(0.5 * (clock[1:] + clock[:-1]))
    lowest, highest = polisher.air.angles(rise > 0)
    angle = np.clip(np.arctan2(np.abs(rise) / time, np.hypot(*through.T)), lowest, highest)
    found = polisher.chain(stops, angle, np.arctan2(through[:, 1], through[:, 0]))
    return None if found is None else polisher.polish(found, TRIAL_MOVES)


def _cut(polisher: Polisher, chain: Chain) -> Chain | None:
    """The route with every leg cut in the middle, where it passes, and polished."""
    glides, count = chain.glides, len(chain.glides.time)
    stops = np.empty((2 * count + 1, 3))
    stops[::2] = chain.stops
    stops[1::2] = polisher.air.along(chain.stops[:-1], chain.stops[1:], glides, 0.5)
    found = polisher.chain(stops, np.repeat(glides.angle, 2), np.repeat(glides.heading, 2))
    return None if found is None else polisher.polish(found, TRIAL_MOVES)


def _joined(polisher: Polisher, chain: Chain) -> Chain:
    """The route without the stops that are no turns and hardly gain anything."""
    stop = 1
    while stop < len(chain.stops) - 1:
        rise = np.diff(chain.stops[stop - 1 : stop + 2, 2])
        if rise[0] * rise[1] > 0 and not polisher.stays(chain.stops[stop]):
            glides = chain.glides
            angle, heading = np.delete(glides.angle, stop), np.delete(glides.heading, stop)
            one, other = glides.heading[stop - 1], glides.heading[stop]
            heading[stop - 1] = one + 0.5 * math.remainder(other - one, math.tau)
            angle[stop - 1] = 0.5 * (glides.angle[stop - 1] + glides.angle[stop])
            fewer = polisher.chain(np.delete(chain.stops, stop, axis=0), angle, heading)
            if fewer is not None and fewer.cost < (1 + JOIN_COSTS) * chain.cost:
                chain = fewer
                continue
        stop += 1
    return polisher.polish(chain)
