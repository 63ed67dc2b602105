"""Baselines that a planner must beat: straight to the goal, drift, a search in depth-averaged currents."""

import math

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ..base.arrays import Array
from ..kernels.cache import entry_point
from ..kernels.flow import contains, velocities
from ..kernels.motion import rk4_step
from ..kernels.place import Place, Velocity
from ..roadmap.problem import Problem
from ..water.inspect import require_level

CELLS, DEPTHS, REACH = 48, 8, 3
"""Settings of the depth-averaged search.

CELLS: cells along the longer side; DEPTHS: depths of the mean; REACH: the most cells to a neighbour.
"""
LONGEST = 40
"""A baseline that has not arrived after this many horizons of a leg does not arrive."""


@entry_point()
def follow(flow, point, stops, speed, sink, floor, ceiling, t, dt, latest, near, within):  # type: ignore[no-untyped-def]
    """Return the time when a yo that heads for its next stop is `within` [m] of the last; inf if never.

    It starts at `point` (3,) [m] at t [s] and may be at any depth. `stops` (n, 2) [m]: all but the last are
    passed when `near` [m]. `speed` and `sink` are through water [m/s].
    """
    x, y, z = point
    now, n, w = 0.0, 0, -sink
    while now < latest:
        away = math.hypot(stops[n, 0] - x, stops[n, 1] - y)
        if away < (within if n == stops.shape[0] - 1 else near):
            n += 1
            if n == stops.shape[0]:
                return now
            continue
        if not contains(flow, x, y, t + now):
            return math.inf
        if z <= floor or z >= ceiling:
            w = sink if z <= floor else -sink
        u, v = speed * (stops[n, 0] - x) / away, speed * (stops[n, 1] - y) / away
        x, y = rk4_step(flow, Place(x, y, z, t + now), Velocity(u, v, w), dt)
        z = min(max(z + w * dt, floor), ceiling)
        now += dt
    return math.inf


def _flown(problem: Problem, start: Array, stops: Array, speed: float, sink: float, near: float = 0.0) -> float:
    evaluator = problem.evaluator
    require_level(evaluator.flow, "a baseline's yo")
    integration = evaluator.integration
    latest, within = LONGEST * integration.dt * integration.steps, 2 * integration.tolerance
    depths = float(problem.lo[2]), float(problem.hi[2])
    step = integration.dt / 5
    point, places = (np.require(values, np.float64, ["C", "W"]) for values in (start, stops))
    return float(
        follow(evaluator.flow, point, places, speed, sink, *depths, problem.departure, step, latest, near, within)
    )


def best_glide(problem: Problem) -> tuple[float, float]:
    """Return the greatest horizontal speed of the glide polar and the vertical speed there [m/s]."""
    table = problem.evaluator.polar
    speed = float(table.best_horizontal[0])
    return speed, speed * math.tan(float(table.best_angle[0]))


def straight(problem: Problem, start: Array, goal: Array) -> float:
    """Return the travel time [s] of a yo at best glide that heads for the goal; inf if it never arrives."""
    return _flown(problem, start, goal[None, :2], *best_glide(problem))


def drift(problem: Problem, start: Array, goal: Array) -> float:
    """Return the time [s] in which the current at the start's depth carries a float to the goal; inf if never."""
    return _flown(problem, start, goal[None, :2], 0.0, 0.0)


def depth_averaged(problem: Problem, start: Array, goal: Array) -> float:
    """Return the travel time [s] of a yo along the fastest path in depth-averaged currents.

    The plan is the best path on a grid over the domain, between cells up to REACH apart, at the greatest
    horizontal speed; Dijkstra's search finds the same path as A*. The yo flies in the full currents and heads for
    the plan's points one by one. inf if there is no plan or the yo does not arrive.
    """
    lo, hi = problem.lo, problem.hi
    step = float((hi - lo)[:2].max()) / CELLS
    x, y = (np.arange(lo[m] + step / 2, hi[m], step) for m in range(2))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    places = np.vstack([grid, start[:2], goal[:2]])
    speed = best_glide(problem)[0]
    current = np.mean([_currents(problem, places, z) for z in np.linspace(lo[2], hi[2], DEPTHS)], axis=0)
    inside = problem.evaluator.allowed(np.insert(places, 2, hi[2], axis=1), problem.departure)
    near = np.hypot(*(places[:, None] - places[None]).T) <= (REACH + 0.5) * step
    source, target = np.nonzero(near & inside & inside[:, None] & ~np.eye(len(places), dtype=bool))
    away = places[target] - places[source]
    length = np.hypot(*away.T)
    apart = length > 0
    source, target, away, length = source[apart], target[apart], away[apart], length[apart]
    along = away / length[:, None]
    water = 0.5 * (current[source] + current[target])
    across = water[:, 0] * along[:, 1] - water[:, 1] * along[:, 0]
    over_ground = np.sum(water * along, axis=1) + np.sqrt(np.maximum(speed**2 - across**2, 0.0))
    flyable = (np.abs(across) < speed) & (over_ground > 1e-3)
    cost = length[flyable] / over_ground[flyable]
    graph = csr_array((cost, (source[flyable], target[flyable])), shape=(len(places), len(places)))
    distance, before = dijkstra(graph, directed=True, indices=[len(grid)], return_predecessors=True)
    distance, before = distance[0], before[0]
    if not math.isfinite(distance[-1]):
        return math.inf
    way = [len(places) - 1]
    while before[way[-1]] != len(grid):
        way.append(int(before[way[-1]]))
    return _flown(problem, start, places[way[::-1]], *best_glide(problem), near=2 * step)


def _currents(problem: Problem, places: Array, z: float) -> Array:
    x, y = np.ascontiguousarray(places.T)
    flow = problem.evaluator.flow
    result: Array = velocities(flow, x, y, np.full(x.size, z), np.full(x.size, problem.departure))
    return result


BASELINES = {"straight": straight, "drift": drift, "depth-averaged": depth_averaged}
