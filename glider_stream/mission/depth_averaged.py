"""A plan on a map: the fastest way through the depth-averaged forecast, as pilots plan without glide angles."""

import heapq
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Index
from ..kernels.flow import velocities
from ..kernels.terrain import allowed
from ..roadmap.problem import Problem
from ..water.inspect import is_steady

CELLS, DEPTHS, TIMES = 40, 8, 48
"""Cells along the longer side of the domain; depths of the mean; times between which the current is linear."""
NEAR = tuple((i, j) for i in range(-3, 4) for j in range(-3, 4) if math.gcd(i, j) == 1)
"""The cells to which a cell leads: 32 directions."""
SLOWEST = 1e-3
"""A way over ground that is slower than this [m/s] leads nowhere."""
LOOKED_AT = 3
"""The seabed is looked at in so many places of a way between two cells."""


@dataclass(frozen=True)
class Chart:
    """Places (n, 2) [m] of a map, and the mean current (times, n, 2) [m/s] that a yo meets there.

    `indptr`, `target` and `away` (m, 2) [m]: the ways from each place to others, as CSR.
    """

    places: Array
    times: Array
    current: Array
    indptr: Index
    target: Index
    away: Array

    def fastest(self, start: Array, goal: Array, t: float, speed: float) -> Array | None:
        """Return the fastest way (n, 2) [m] from a start to a goal (2,) [m] that leaves at t [s], or None.

        A* with the clock running: the current of a way is the mean of its ends', at the time at which it begins.
        The rest takes at least its length at the speed through water and the greatest current.
        """
        begin, end = (int(np.argmin(np.hypot(*(self.places - point).T))) for point in (start, goal))
        most = speed + float(np.hypot(self.current[..., 0], self.current[..., 1]).max())
        left = np.hypot(*(self.places - self.places[end]).T) / most
        time = np.full(len(self.places), math.inf)
        before = np.full(len(self.places), -1)
        done = np.zeros(len(self.places), bool)
        time[begin] = t
        queue = [(t + float(left[begin]), begin)]
        while queue:
            here = heapq.heappop(queue)[1]
            if here == end:
                return self._way(before, begin, end, goal)
            if done[here]:
                continue
            done[here] = True
            ways = slice(int(self.indptr[here]), int(self.indptr[here + 1]))
            to = self.target[ways]
            then = time[here] + self._durations(here, ways, float(time[here]), speed)
            better = then < time[to]
            time[to[better]], before[to[better]] = then[better], here
            for there in to[better]:
                heapq.heappush(queue, (float(time[there] + left[there]), int(there)))
        return None

    def _durations(self, here: int, ways: slice, t: float, speed: float) -> Array:
        away = self.away[ways]
        length = np.hypot(away[:, 0], away[:, 1])
        current = 0.5 * (self._at(t, here) + self._at(t, self.target[ways]))
        east, north = away.T / length
        across = current[:, 1] * east - current[:, 0] * north
        with np.errstate(invalid="ignore"):
            over = current[:, 0] * east + current[:, 1] * north + np.sqrt(speed**2 - across**2)
        return np.where(over > SLOWEST, length / np.maximum(over, SLOWEST), math.inf)

    def _at(self, t: float, which: "int | Index") -> Array:
        if self.times.size == 1:
            return np.asarray(self.current[0, which])
        place = float(np.clip((t - self.times[0]) / (self.times[1] - self.times[0]), 0.0, self.times.size - 1.0))
        below = min(int(place), self.times.size - 2)
        share = place - below
        return np.asarray((1 - share) * self.current[below, which] + share * self.current[below + 1, which])

    def _way(self, before: Index, begin: int, end: int, goal: Array) -> Array:
        way = [end]
        while way[-1] != begin:
            way.append(int(before[way[-1]]))
        # the vehicle is in the first cell already
        return np.vstack([self.places[way[-2:0:-1]], goal])


def chart_of(problem: Problem, depth: float, longest: float) -> Chart:
    """Return the chart of a problem's water for yos down to a `depth` [m], for a time `longest` [s]."""
    lo, hi = problem.lo, problem.hi
    size = float((hi - lo)[:2].max()) / CELLS
    count = [max(1, round(float(side / size))) for side in (hi - lo)[:2]]
    x, y = (lo[n] + (np.arange(count[n]) + 0.5) / count[n] * (hi - lo)[n] for n in range(2))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    steady = is_steady(problem.evaluator.flow)
    times = problem.departure + (np.zeros(1) if steady else np.linspace(0.0, longest, TIMES))
    current = np.array([_mean(problem, places, depth, float(t)) for t in times])
    wet = _wet(problem, places)
    source, target = _pairs(count[0], count[1], wet)
    away = places[target] - places[source]
    clear = np.ones(source.size, bool)
    for n in range(1, LOOKED_AT + 1):
        clear &= _wet(problem, places[source] + n / (LOOKED_AT + 1) * away)
    source, target, away = source[clear], target[clear], away[clear]
    order = np.argsort(source, kind="stable")
    indptr = np.concatenate([[0], np.cumsum(np.bincount(source, minlength=len(places)))])
    return Chart(places, times, current, indptr, target[order], away[order])


def _pairs(nx: int, ny: int, wet: NDArray[np.bool_]) -> tuple[Index, Index]:
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))
    source, target = [], []
    for di, dj in NEAR:
        inside = (i + di >= 0) & (i + di < nx) & (j + dj >= 0) & (j + dj < ny)
        here = np.flatnonzero(inside & wet)
        there = (i[here] + di) * ny + j[here] + dj
        source.append(here[wet[there]])
        target.append(there[wet[there]])
    return np.concatenate(source), np.concatenate(target)


def _mean(problem: Problem, places: Array, depth: float, t: float) -> Array:
    """Return the mean current (n, 2) [m/s] over the depths of a yo, which spends the same time at each."""
    x, y = np.ascontiguousarray(places.T)
    heights = -depth * (np.arange(DEPTHS) + 0.5) / DEPTHS
    total = np.zeros((len(places), 2))
    for z in heights:
        total += velocities(problem.evaluator.flow, x, y, np.full(x.size, z), np.full(x.size, t))
    return total / DEPTHS


def _wet(problem: Problem, places: Array) -> NDArray[np.bool_]:
    """Return a mask of the places (n, 2) [m] where a vehicle may begin a dive."""
    terrain = problem.evaluator.terrain
    return np.array([allowed(terrain, float(x), float(y), 0.0) for x, y in places], dtype=bool)
