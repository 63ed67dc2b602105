"""Thinning: makes a route of fewer legs; each new leg is flown before it is accepted."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.edges import Edge, Status
from .path import Hop, Path, hops_of

NO_LEG = Edge(int(Status.NO_HIT), *[math.nan] * 6)


def thin(
    path: Path,
    tolerance: float,
    connect: Callable[[Array, Array, float], Edge],
    fly: Callable[[list[Hop]], Path],
    stays: Callable[[Array], bool] = lambda stop: False,
) -> Path:
    """Return a route of fewer legs within `tolerance` [m] of the old one (Ramer 1972, Douglas and Peucker 1973).

    A stretch becomes one leg if all its stops lie within the tolerance of the straight line and `connect` finds
    one glide between its ends. Otherwise it is cut at its farthest stop. `fly` makes the path and flies all its
    legs again, the old ones, too. A stop for which `stays` is true is always kept. With the clock running, every
    leg after a new leg begins at another time, so `connect`, which takes the seconds since departure, finds it
    again.
    """
    require(0 <= tolerance < np.inf, f"a route is thinned to 0 m or more; got {tolerance:g}")
    if not path.legs:
        return path
    old = hops_of(path)
    apart: set[tuple[int, int]] = set()
    while True:
        hops, joined, whole = _joined(path, old, tolerance, connect, stays, apart)
        if whole:
            return replace(fly(hops), unthinned=(len(old), path.travel_time))
        # a glider that arrives at another time may find no next leg: undo the last stretch that became one leg
        apart.add(joined[-1])


def _joined(
    path: Path,
    old: list[Hop],
    tolerance: float,
    connect: Callable[[Array, Array, float], Edge],
    stays: Callable[[Array], bool],
    apart: set[tuple[int, int]],
) -> tuple[list[Hop], list[tuple[int, int]], bool]:
    """Return the legs of a thinned route, the stretches that became one leg, and whether all legs were found.

    Stretches in `apart` do not become one leg.
    """
    stops = [old[0][0], *(end for _, end, _ in old)]
    hops: list[Hop] = []
    joined: list[tuple[int, int]] = []
    clock = 0.0
    # the stretches that wait, the next one last; recursion could exceed Python's stack on long routes
    fixed = [0, *(n for n in range(1, len(old)) if stays(stops[n])), len(old)]
    waiting = list(pairwise(fixed))[::-1]
    while waiting:
        first, last = waiting.pop()
        if last - first == 1:
            edge = old[first][2]
            if path.clock_runs and clock != path.legs[first].depart:
                edge = connect(stops[first], stops[last], clock)
                if edge.status != Status.CONNECTED:
                    return hops, joined, False
        else:
            off = _distances(np.array(stops[first + 1 : last]), stops[first], stops[last])
            near = off.max() <= tolerance and (first, last) not in apart
            edge = connect(stops[first], stops[last], clock) if near else NO_LEG
            if edge.status != Status.CONNECTED:
                # if all stops lie on the line, a cut in the middle leaves the fewest tries
                cut = first + 1 + (int(off.argmax()) if off.max() > 0 else len(off) // 2)
                waiting += [(cut, last), (first, cut)]
                continue
            joined.append((first, last))
        hops.append((stops[first], stops[last], edge))
        clock += edge.time
    return hops, joined, True


def _distances(points: Array, start: Array, end: Array) -> Array:
    """Return the distances (n,) [m] of points (n, 3) from the line between two points."""
    way = end - start
    length = float(way @ way)
    share = np.clip((points - start) @ way / length, 0, 1)[:, None] if length > 0 else np.zeros((len(points), 1))
    return np.asarray(np.linalg.norm(points - (start + share * way), axis=1))
