"""The changes of a route that polishing cannot make by small steps: cut and join legs, add and remove yos."""

import math
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Array, Index
from ..water.sampled import level_part
from .free import FreePolisher
from .polish import Chain, Effort, Polisher
from .yos import with_yos

CUT_PAYS = 1e-3
"""Cutting each leg of a route in two must gain this share of its cost, because pilots prefer few legs."""
JOIN_COSTS = 1e-4
"""A stop under water that is not a turn is removed if that raises the cost by a smaller share than this."""
MOST_CUTS = 2
"""All legs are cut in two at most this many times."""
MOST_LEGS = 400
"""A route with more legs is not cut and keeps its number of yos, because each try takes seconds."""
MOST_COUNTS = 12
"""At most this many numbers of yos are tried."""
MOST_SINGLE = 24
"""A route with more legs gets no small yos; its number of yos is found for the whole route."""
TRIAL = Effort(moves=6)
"""How long a route is polished that is only tried."""
ROUGH = Effort(moves=15, enough=1e-4, barriers=1)
"""How long a route is polished that is changed afterwards."""
PIECES = 16
"""A route that may hold its depth has about this many legs; with more the search ends in worse places."""
HEIGHTS = (1.3, 1.5, 1.8, 2.5)
"""Small yos are this many times as high as the least change of depth; the later ones are for routes that cannot
be flown with the first."""
YO_PAYS = 1e-3
"""A yo must gain this share of the cost."""
PAYS = 1e-5
"""Another number of yos must gain this share of the cost."""


def improve(polisher: Polisher, chain: Chain) -> Chain:
    """Return the polished route, with as many yos and cuts as pay; it never costs more than the old one."""
    if polisher.single_yos and len(chain.glides.time) <= MOST_SINGLE:
        chain = polisher.polish(chain, ROUGH)
        more = _with_small_yos(polisher, chain)
        if more is not None:
            return more
    best = polisher.polish(chain)
    if len(best.glides.time) > MOST_LEGS:
        return best
    best = _best_count(polisher, best)
    for _ in range(MOST_CUTS):
        if 2 * len(best.glides.time) > MOST_LEGS:
            break
        cut = _cut(polisher, best)
        if cut is None or cut.cost > (1 - CUT_PAYS) * best.cost:
            break
        best = polisher.polish(cut)
    return _joined(polisher, best)


def _with_small_yos(polisher: Polisher, chain: Chain) -> Chain | None:
    """Return the polished route with small yos along the best way of a glider that may hold its depth.

    None if there is none, or if it does not gain YO_PAYS for each yo more. A glider that holds its depth does so
    against water that rises too, hardly slower; so the way is found without the vertical part of a grid.
    """
    problem = polisher.problem
    level = level_part(problem.evaluator.flow)
    if level is None:
        return None
    problem = replace(problem, evaluator=replace(problem.evaluator, flow=level))
    free = FreePolisher(problem, frozen=polisher.frozen)
    way = free.from_route(polisher, chain, max(PIECES, len(chain.glides.time)))
    if way is None:
        return None
    way = free.best(way)
    for height in HEIGHTS:
        found = with_yos(polisher, free, way, height * polisher.least_rise)
        if found is not None:
            found = _joined(polisher, polisher.polish(found, ROUGH))
            yos = (len(turns(found.stops)) - len(turns(chain.stops))) / 2
            pays = found.cost < (1 - YO_PAYS * max(yos, 0.0)) * chain.cost
            return found if pays else None
    return None


def _best_count(polisher: Polisher, chain: Chain) -> Chain:
    """Return the route with the best number of yos; the search begins at a likely number, with steps of one."""
    if len(turns(chain.stops)) < len(chain.stops) - 2:
        return chain  # some stops are not turns, so its legs are cut already
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
            now, other = tried[at], route(at + way)
            assert now is not None
            if other is None or other.cost > (1 - PAYS) * now.cost:
                break
            at += way
    found = tried[at]
    return chain if found is None else polisher.polish(found)


def _likely_legs(polisher: Polisher, chain: Chain) -> float:
    """Return the number of legs of the route if each leg were as steep as the fastest glide in still water."""
    polar = polisher.problem.evaluator.polar
    climbs = np.diff(chain.stops[:, 2]) > 0
    fastest = np.abs(polisher.air.sinking(polar.best_angle[climbs.astype(np.intp)], climbs))
    return float((chain.glides.time * fastest).sum() / np.abs(np.diff(chain.stops[:, 2])).mean())


def turns(stops: Array) -> Index:
    """Return the numbers of the inner stops at which a dive becomes a climb, or a climb becomes a dive."""
    climbs = np.diff(stops[:, 2]) > 0
    return np.asarray(1 + np.flatnonzero(climbs[1:] != climbs[:-1]), np.int64)


@dataclass(frozen=True)
class _Track:
    """A route as functions of the time [s] since it began."""

    clock: Array
    stops: Array
    middle: Array
    current: Array

    @classmethod
    def of(cls, polisher: Polisher, chain: Chain) -> "_Track":
        """Make the track of a route; the current is the part of a leg's way that its glide does not explain."""
        glides, way = chain.glides, np.diff(chain.stops[:, :2], axis=0)
        climbs = np.diff(chain.stops[:, 2]) > 0
        along = polisher.air.speed(glides.angle, climbs) * np.cos(glides.angle)
        through = along[:, None] * np.stack([np.cos(glides.heading), np.sin(glides.heading)], axis=1)
        clock = np.concatenate([[0.0], np.cumsum(glides.time)])
        return cls(clock, chain.stops, 0.5 * (clock[1:] + clock[:-1]), way / glides.time[:, None] - through)

    def places(self, at: Array) -> Array:
        """Return x, y (n, 2) [m] at times (n,) [s]."""
        return np.stack([np.interp(at, self.clock, self.stops[:, n]) for n in range(2)], axis=1)

    def carried(self, at: Array) -> Array:
        """Return the mean current (n, 2) [m/s] of the legs around times (n,) [s]."""
        return np.stack([np.interp(at, self.middle, self.current[:, n]) for n in range(2)], axis=1)


def _respaced(polisher: Polisher, chain: Chain, legs: int) -> Chain | None:
    """Return the route with another number of legs, polished; None if it cannot be flown.

    The legs begin with equal times along the old track. Tops and bottoms keep the depths of the old ones nearby.
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
    return None if found is None else polisher.polish(found, TRIAL)


def _cut(polisher: Polisher, chain: Chain) -> Chain | None:
    """Return the polished route after each leg was cut at the middle of its path; None if it cannot be flown."""
    glides, count = chain.glides, len(chain.glides.time)
    stops = np.empty((2 * count + 1, 3))
    stops[::2] = chain.stops
    stops[1::2] = polisher.air.along(chain.stops[:-1], chain.stops[1:], glides, 0.5)
    found = polisher.chain(stops, np.repeat(glides.angle, 2), np.repeat(glides.heading, 2))
    return None if found is None else polisher.polish(found, TRIAL)


def _joined(polisher: Polisher, chain: Chain) -> Chain:
    """Return the route without the stops that are not turns and gain almost nothing."""
    stop = 1
    while stop < len(chain.stops) - 1:
        rise = np.diff(chain.stops[stop - 1 : stop + 2, 2])
        if rise[0] * rise[1] > 0 and not polisher.stays(chain.stops[stop]):
            glides = chain.glides
            angle, heading = np.delete(glides.angle, stop), np.delete(glides.heading, stop)
            before, after = glides.heading[stop - 1], glides.heading[stop]
            heading[stop - 1] = before + 0.5 * math.remainder(after - before, math.tau)
            angle[stop - 1] = 0.5 * (glides.angle[stop - 1] + glides.angle[stop])
            fewer = polisher.chain(np.delete(chain.stops, stop, axis=0), angle, heading)
            if fewer is not None and fewer.cost < (1 + JOIN_COSTS) * chain.cost:
                chain = fewer
                continue
        stop += 1
    return polisher.polish(chain)
