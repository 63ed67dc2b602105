"""Least times: a bound below the time of any way between two places, from the flow's greatest speeds.

Along a direction d a glider gets on no faster than Vh + M, with Vh its best horizontal speed and M the greatest
current along d on the line across d that it is passing. So the time from a to b is at least the integral of
ds / (Vh + M(s)) between their places on d: a difference of two potentials, one for each direction. The depth
bounds it likewise: |dz| over the greatest vertical speed. A difference of potentials obeys the triangle
inequality, so the remaining time that it gives never falls faster along a leg than the clock runs.
"""

import math

import numpy as np
from scipy.ndimage import map_coordinates, maximum_filter

from ..base.arrays import Array, Index
from ..kernels import flow as kernel
from ..kernels.control import CLIMB, DIVE, Polar, vertical_speed
from ..roadmap.problem import Problem
from ..vehicle.cost import Cost
from ..water.inspect import is_steady

DIRECTIONS = 16
CELLS = 64
"""Along the longer side of the water in which the greatest currents are looked for."""
STEADY, PERIODIC = (25, 1), (5, 24)
"""Heights and times at which a flow is read that is given by a formula: steady, and with a period."""
SLOWEST = 1e-6
"""A line across which no glider gets on takes so long [m/s]."""
SPARE = 0.02
"""What may lie between the points at which a formula is read, in greatest speeds of the flow."""


def fastest_sink(polar: Polar) -> float:
    """The greatest vertical speed of any glide [m/s]."""
    return max(float(vertical_speed(polar, way, polar.steepest[way])) for way in (DIVE, CLIMB))


class GreatestSpeeds:
    """How fast a glider gets on at the most, along each direction and in depth, in a flow from some time on."""

    def __init__(self, problem: Problem, position: Array, since: float) -> None:
        """Look at the water in which gliders may pass between nodes (n, 3) [m], from `since` [s] on."""
        flow, polar = problem.evaluator.flow, problem.evaluator.polar
        self.through = float(polar.best_horizontal.max())
        self.sink = fastest_sink(polar)
        angle = np.arange(DIRECTIONS) * (2 * math.pi / DIRECTIONS)
        self.directions = np.stack([np.cos(angle), np.sin(angle)])
        low, high = _box(flow, problem, position)
        size = float((high - low).max()) / CELLS
        nx, ny = (max(1, math.ceil(side / size)) for side in high - low)
        x, y = low[0] + (np.arange(nx) + 0.5) * size, low[1] + (np.arange(ny) + 0.5) * size
        fastest = greatest(flow, x, y, size, (float(problem.lo[2]), 0.0), since, self.directions)
        self.scales = [
            self._scale(x[:, None] * d[0] + y[None, :] * d[1], fastest[n], size)
            for n, d in enumerate(self.directions.T)
        ]

    def _scale(self, at: Array, fastest: Array, size: float) -> tuple[Array, Array]:
        """Places [m] on a direction, and the least time [s] from the first of them; cells lie `at` (nx, ny)."""
        first = float(np.min(at)) - 2 * size
        strip = ((at - first) / size).astype(np.int64)
        speed = np.full(int(strip.max()) + 3, -np.inf)
        np.maximum.at(speed, strip.ravel(), fastest.ravel())
        # a cell is up to 1.42 strips wide: what is known of a strip holds for those beside it
        rate = np.maximum(self.through + maximum_filter(speed, 3), SLOWEST)
        time: Array = np.concatenate([[0.0], np.cumsum(size / rate)])
        edges: Array = first + size * np.arange(speed.size + 1.0)
        return edges, time

    def potentials(self, places: Array) -> Array:
        """Of places (n, 3) [m], for each direction (n, directions) [s]; beyond the water no time passes."""
        along = places[:, :2] @ self.directions
        return np.stack([np.interp(along[:, n], *scale) for n, scale in enumerate(self.scales)], axis=1)


def least_cost(speeds: GreatestSpeeds, start: Array, goal: Array, cost: Cost) -> float:
    """A bound below the cost of every route between two points (3,) [m]: its turns are not counted."""
    left = LeastTimes(speeds, np.stack([start, goal])).remaining(np.array([1]), cost)[1]
    return float(left[0])


class LeastTimes:
    """Bounds below the times between places (n, 3) [m]."""

    def __init__(self, speeds: GreatestSpeeds, places: Array) -> None:
        """Of some places, whatever the way between them."""
        self.sink, self.height = speeds.sink, places[:, 2].copy()
        self.potential = speeds.potentials(places)

    def between(self, place: int) -> Array:
        """From one of the places to each (n,) [s]."""
        ahead = (self.potential - self.potential[place]).max(axis=1)
        return np.asarray(np.maximum(ahead, np.abs(self.height - self.height[place]) / self.sink))

    def remaining(self, goals: Index, cost: Cost) -> tuple[Array, Array]:
        """From each of the places to the nearest of some: (n,) [s], and in the cost's unit, without turns."""
        left = np.full(self.height.size, np.inf)
        for goal in goals:
            ahead = (self.potential[goal] - self.potential).max(axis=1)
            left = np.minimum(left, np.maximum(ahead, np.abs(self.height - self.height[goal]) / self.sink))
        per_second, per_leg = cost.kernel()
        cost_left = per_second * left + per_leg
        cost_left[goals] = 0.0
        return left, cost_left


def _box(flow: kernel.Flow, problem: Problem, position: Array) -> tuple[Array, Array]:
    """The water [m] in which gliders may pass: no leg strays further from its ends than half its reach."""
    evaluator = problem.evaluator
    horizon = evaluator.integration.dt * evaluator.integration.steps
    stray = 0.5 * (float(evaluator.polar.best_horizontal.max()) + flow.extent.max_speed) * horizon
    low = np.maximum(position[:, :2].min(axis=0) - stray, [flow.extent.x_lo, flow.extent.y_lo])
    high = np.minimum(position[:, :2].max(axis=0) + stray, [flow.extent.x_hi, flow.extent.y_hi])
    return low, np.maximum(high, low + 1.0)


def greatest(
    flow: kernel.Flow, x: Array, y: Array, size: float, z: tuple[float, float], since: float, directions: Array
) -> Array:
    """The greatest current (directions, nx, ny) [m/s] along `directions` (2, n), from a time on, in each cell.

    Cells of a `size` [m] about x, y; all heights of `z` [m].
    """
    if isinstance(flow, kernel.OceanGrid):
        return _of_grid(flow, x, y, size, z, since, directions)
    period = 0.0 if is_steady(flow) else getattr(flow, "period", None)
    if period is None:  # no set of moments tells all
        return np.full((directions.shape[1], x.size, y.size), flow.extent.max_speed)
    heights, moments = PERIODIC if period else STEADY
    finer = (np.concatenate([side - size / 4, side + size / 4]) for side in (x, y))
    fine_x, fine_y = (np.sort(side) for side in finer)
    found = np.full((directions.shape[1], fine_x.size, fine_y.size), -np.inf)
    px, py = (np.ascontiguousarray(a.ravel()) for a in np.meshgrid(fine_x, fine_y, indexing="ij"))
    for t in since + period * np.arange(moments) / moments:
        for height in np.linspace(*z, heights):
            uv = kernel.velocities(flow, px, py, np.full(px.size, height), np.full(px.size, t))
            found = np.maximum(found, (uv @ directions).T.reshape(found.shape))
    cells = found.reshape(directions.shape[1], x.size, 2, y.size, 2).max(axis=(2, 4))
    spread: Array = maximum_filter(cells, (1, 3, 3)) + SPARE * flow.extent.max_speed
    return np.minimum(spread, flow.extent.max_speed)


def _of_grid(
    flow: kernel.OceanGrid,
    x: Array,
    y: Array,
    size: float,
    z: tuple[float, float],
    since: float,
    directions: Array,
) -> Array:
    """Exact: what is interpolated lies between the grid's values, so the greatest of those in reach counts."""
    first = max(int(np.searchsorted(flow.times, since, side="right")) - 1, 0)
    low = max(int(np.searchsorted(flow.levels, z[0], side="right")) - 1, 0)
    high = int(np.searchsorted(flow.levels, z[1], side="left")) + 1
    known = np.full((directions.shape[1], *flow.values.shape[2:4]), -np.inf)
    for moment in flow.values[first:, low:high]:
        for level in moment:
            known = np.maximum(known, np.moveaxis(level @ directions, -1, 0))
    near = _indices(flow, x, y)
    # how many indices a cell spans: their map is smooth
    moved = _indices(flow, x + size, y), _indices(flow, x, y + size)
    span = max(float(np.abs(there - near).max()) for there in moved)
    width = 2 * (math.ceil(span) + 1) + 1
    wide: Array = maximum_filter(known, (1, width, width))
    i, j = (np.clip(np.round(near[n]).astype(np.int64), 0, flow.values.shape[2 + n] - 1) for n in range(2))
    return np.minimum(wide[:, i, j], flow.extent.max_speed)


def _indices(flow: kernel.OceanGrid, x: Array, y: Array) -> Array:
    """Fractional grid indices (2, nx, ny) at places [m], held at the rim."""
    at = np.meshgrid((x - flow.extent.x_lo) * flow.per_x, (y - flow.extent.y_lo) * flow.per_y, indexing="ij")
    return np.stack([map_coordinates(flow.index_map[..., n], at, order=1, mode="nearest") for n in range(2)])
