"""FMT*, a planner that the paper cites, on this project's legs: what a search that steers only once finds.

Janson, Schmerling, Clark and Pavone, Fast Marching Tree (2015). Every leg leaves when the tree arrives at its
start, so currents may change with time.
"""

import heapq
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Array, Index
from ..base.settings import require
from ..kernels.edges import EDGE_COLUMNS, STATUS, TIME, Status
from ..roadmap.neighbours import Radius, as_csr
from ..roadmap.nodes import SobolSampler
from ..roadmap.problem import Problem

ETA = 0.1
"""The radius is larger by this share than the least one that converges to the optimum (theorem 4.1)."""

Neighbours = Sequence[Index]
Steer = Callable[[list[int], Array, list[Index]], Array]
"""Tells the travel times [s] of legs, inf where none exists: sources, their arrivals [s], targets of each."""


@dataclass(frozen=True)
class Found:
    """A planner's route: travel time [s], inf if none; places (n, 3) [m].

    `size`: the pairs steered, or the nodes of a tree.
    """

    travel_time: float
    points: Array
    size: int


def fmt_radius(samples: int, volume: float, dimensions: int = 3) -> float:
    """Return the radius [m] of `samples` points in a `volume` [m^3]: (1 + ETA) gamma (ln n / n)^(1/d)."""
    unit_ball = math.pi ** (dimensions / 2) / math.gamma(dimensions / 2 + 1)
    gamma = 2 * (volume / (dimensions * unit_ball)) ** (1 / dimensions)
    return float((1 + ETA) * gamma * (math.log(samples) / samples) ** (1 / dimensions))


def marched(near: Neighbours, steer: Steer, start: int, goal: int) -> tuple[Array, Index, int]:
    """Return arrivals (n,) [s], parents (n,) and the number of pairs steered of a fast marching tree.

    `near`: the neighbours of each node. A node joins the tree by the best leg from any open node, as soon as an
    open node near it is the earliest. A node's legs are steered together, once, when it opens.
    """
    count = len(near)
    arrival, best = np.full(count, math.inf), np.full(count, math.inf)
    parent, unvisited = np.full(count, -1, np.int64), np.ones(count, bool)
    arrival[start], unvisited[start] = 0.0, False
    opening, heap, steered = [start], [(0.0, start)], 0
    while heap:
        targets = [near[node][unvisited[near[node]]] for node in opening]
        times = steer(opening, arrival[opening], targets)
        sources = np.repeat(opening, [len(row) for row in targets])
        steered += len(sources)
        for source, target, time in zip(sources, np.concatenate([[], *targets]).astype(int), times, strict=True):
            if arrival[source] + time < best[target]:
                best[target], parent[target] = arrival[source] + time, source
        _, earliest = heapq.heappop(heap)
        if earliest == goal:
            break
        around = near[earliest]
        opening = [int(node) for node in around[unvisited[around] & np.isfinite(best[around])]]
        arrival[opening], unvisited[opening] = best[opening], False
        for node in opening:
            heapq.heappush(heap, (float(arrival[node]), node))
    return arrival, parent, steered


def travel_times(
    problem: Problem, position: Array, sources: list[int], leaves: Array, rows: list[Index]
) -> Array:
    """Return the travel times [s] of legs among places (n, 3) [m], inf where none exists.

    `leaves` (sources,) [s] after the departure; `rows`: the targets of each source.
    """
    departure = np.full(len(position), problem.departure)
    departure[sources] += leaves
    indptr, target = as_csr(rows)
    found = np.empty((0, EDGE_COLUMNS))
    if target.size:
        found = problem.evaluator.connect(position, departure, sources, indptr, target)
    return np.where(found[:, STATUS] == Status.CONNECTED, found[:, TIME], math.inf)


def fmt_star(problem: Problem, samples: int, seed: int = 0) -> Found:
    """Return the route of FMT* from the scenario's start to its goal, on a Sobol sequence of `samples` places."""
    require(samples >= 2, f"`samples` must be at least 2; got {samples}")
    require(problem.start is not None, "the scenario has no [query]: it names the start and the goal; add it")
    free = SobolSampler(samples, seed).nodes(
        problem.lo, problem.hi, lambda points: problem.evaluator.allowed(points, problem.departure)
    )
    position = np.vstack([free, *(np.array([end], float) for end in (problem.start, problem.goal))])
    volume = float(np.prod(problem.hi - problem.lo))
    law = Radius(fmt_radius(samples, volume)).among(position, volume)
    near = [law.of(point) for point in position]
    arrival, parent, steered = marched(
        near,
        lambda sources, leaves, rows: travel_times(problem, position, sources, leaves, rows),
        samples,
        samples + 1,
    )
    way = [samples + 1]
    while parent[way[-1]] >= 0:
        way.append(int(parent[way[-1]]))
    return Found(float(arrival[-1]), position[way[::-1]], steered)
