"""Least times: a lower bound of the time of any way between two places, from the greatest speeds of the flow.

Along a direction d a glider moves no faster than Vh + M. Vh is its best horizontal speed. M is the greatest
current along d on the line across d that the glider passes. So the time from a to b is at least the integral of
ds / (Vh + M(s)) between their places on d. This is a difference of two potentials; each direction gives one
bound. The depth gives another bound: |dz| over the greatest vertical speed, the water's with it. A difference of
potentials obeys the triangle inequality, so along a leg the bound of the remaining time never falls faster than
the clock runs.
"""

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..base.arrays import Array, Index
from ..kernels import flow as kernel
from ..kernels.cheapest import Ahead
from ..kernels.control import CLIMB, DIVE, Polar
from ..kernels.cost import CostRates
from ..roadmap.problem import Problem
from ..vehicle.cost import Cost

DIRECTIONS = 16
CELLS = 64
"""The longer side of the water in which the greatest currents are searched has this many cells."""
STEADY, PERIODIC = (25, 1), (5, 24)
"""(Heights, times) at which a flow given by a formula is read: a steady flow, and a flow with a period."""
SLOWEST = 1e-6
"""The least speed [m/s] that the bound assumes across a line that no glider can pass."""
SPARE = 0.02
"""The current between the points at which a formula is read may be higher by this share of the greatest speed."""

BESIDE = 0.02
"""A leg may end a little beside its target. This saves at most this share of its time."""
NOTHING_AHEAD = Ahead(np.empty((2, 0)), np.empty(0), 1.0, np.empty((0, 0)), np.empty(0), 0.0, math.inf, 0.0, 0.0)
"""The bound that says nothing."""


def fastest_sink(polar: Polar, flow: kernel.Flow) -> float:
    """Return the greatest vertical speed over ground of any glide [m/s]."""
    # the kernel `vertical_speed`, called here, would be compiled in each process: 0.4 s
    glide = max(float(polar.speed[way, -1] * math.sin(polar.steepest[way])) for way in (DIVE, CLIMB))
    return glide + kernel.max_rise(flow)


class GreatestSpeeds:
    """The greatest speed of a glider along each direction and in depth, in a flow from some time on."""

    def __init__(self, problem: Problem, position: Array, since: float) -> None:
        """Read the flow where gliders may pass between nodes (n, 3) [m], from the time `since` [s] on."""
        flow, polar = problem.evaluator.flow, problem.evaluator.polar
        self.through = float(polar.best_horizontal.max())
        self.sink = fastest_sink(polar, flow)
        angle = np.arange(DIRECTIONS) * (2 * math.pi / DIRECTIONS)
        self.directions = np.stack([np.cos(angle), np.sin(angle)])
        low, high = _box(flow, problem, position)
        size = float((high - low).max()) / CELLS
        nx, ny = (max(1, math.ceil(side / size)) for side in high - low)
        x, y = low[0] + (np.arange(nx) + 0.5) * size, low[1] + (np.arange(ny) + 0.5) * size
        integration = problem.evaluator.integration
        # water that sinks may carry a glider below the nodes before it climbs
        lowest = float(problem.lo[2]) - kernel.max_rise(flow) * integration.dt * integration.steps
        fastest = greatest(flow, x, y, size, (lowest, 0.0), since, self.directions)
        self.scales = [
            self._scale(x[:, None] * d[0] + y[None, :] * d[1], fastest[n], size)
            for n, d in enumerate(self.directions.T)
        ]

    def _scale(self, at: Array, fastest: Array, size: float) -> tuple[Array, Array]:
        """Return places [m] on a direction, and the least time [s] from the first place to each.

        `at` (nx, ny) [m] are the places of the cells on that direction, `fastest` (nx, ny) [m/s] their currents.
        """
        first = float(np.min(at)) - 2 * size
        strip = ((at - first) / size).astype(np.int64)
        speed = np.full(int(strip.max()) + 3, -np.inf)
        np.maximum.at(speed, strip.ravel(), fastest.ravel())
        # a cell is up to 1.42 strips wide, so the speed of a strip also counts in the strips beside it
        rate = np.maximum(self.through + _with_neighbours(speed, 0), SLOWEST)
        time: Array = np.concatenate([[0.0], np.cumsum(size / rate)])
        edges: Array = first + size * np.arange(speed.size + 1.0)
        return edges, time

    def potentials(self, places: Array) -> Array:
        """Return the potentials (n, directions) [s] of places (n, 3) [m]; outside the water they are constant."""
        along = places[:, :2] @ self.directions
        return np.stack([np.interp(along[:, n], *scale) for n, scale in enumerate(self.scales)], axis=1)

    def ahead(self, goal: Array, rates: CostRates) -> Ahead:
        """Return the bound of the way to a goal (3,) [m], for a search over legs that may end BESIDE targets."""
        firsts = np.array([places[0] for places, _ in self.scales])
        most = max(time.size for _, time in self.scales)
        padded = np.stack([np.pad(time, (0, most - time.size), "edge") for _, time in self.scales])
        size = float(self.scales[0][0][1] - firsts[0])
        goals = self.potentials(goal[None])[0]
        share = 1.0 - BESIDE
        height, per_second = float(goal[2]), share * float(rates.per_second)
        return Ahead(
            self.directions, firsts, size, padded, goals, height, self.sink, per_second, float(rates.per_leg)
        )


def least_cost(speeds: GreatestSpeeds, start: Array, goal: Array, cost: Cost) -> float:
    """Return a lower bound of the cost of every route between two points (3,) [m]; turns are not counted."""
    left = LeastTimes(speeds, np.stack([start, goal])).remaining(np.array([1]), cost)[1]
    return float(left[0])


class LeastTimes:
    """Lower bounds of the times between places (n, 3) [m]."""

    def __init__(self, speeds: GreatestSpeeds, places: Array) -> None:
        """Compute the potentials of the places."""
        self.sink, self.height = speeds.sink, places[:, 2].copy()
        self.potential = speeds.potentials(places)

    def between(self, place: int, others: Index | slice = slice(None)) -> Array:
        """Return a lower bound of the time (n,) [s] from one place to each of `others` (n,)."""
        ahead = (self.potential[others] - self.potential[place]).max(axis=1)
        return np.asarray(np.maximum(ahead, np.abs(self.height[others] - self.height[place]) / self.sink))

    def remaining(self, goals: Index, cost: Cost) -> tuple[Array, Array]:
        """Return lower bounds (n,) from each place to the nearest goal: time [s], and cost without turns."""
        left = np.full(self.height.size, np.inf)
        for goal in goals:
            ahead = (self.potential[goal] - self.potential).max(axis=1)
            left = np.minimum(left, np.maximum(ahead, np.abs(self.height - self.height[goal]) / self.sink))
        per_second, per_leg = cost.kernel()
        cost_left = per_second * left + per_leg
        cost_left[goals] = 0.0
        return left, cost_left


def _box(flow: kernel.Flow, problem: Problem, position: Array) -> tuple[Array, Array]:
    """Return the box [m] in which gliders may pass: a leg stays within half its reach of its ends."""
    evaluator = problem.evaluator
    horizon = evaluator.integration.dt * evaluator.integration.steps
    stray = 0.5 * (float(evaluator.polar.best_horizontal.max()) + flow.extent.max_speed) * horizon
    low = np.maximum(position[:, :2].min(axis=0) - stray, [flow.extent.x_lo, flow.extent.y_lo])
    high = np.minimum(position[:, :2].max(axis=0) + stray, [flow.extent.x_hi, flow.extent.y_hi])
    return low, np.maximum(high, low + 1.0)


def greatest(
    flow: kernel.Flow, x: Array, y: Array, size: float, z: tuple[float, float], since: float, directions: Array
) -> Array:
    """Return the greatest current (directions, nx, ny) [m/s] along `directions` (2, n) in each cell.

    The cells have the middles x, y and the side `size` [m]. All heights within `z` [m] and all times from `since`
    [s] on count.
    """
    if isinstance(flow, (kernel.OceanGrid, kernel.RisingOceanGrid)):
        return _of_grid(flow, x, y, size, z, since, directions)
    period = kernel.cycle(flow)
    if math.isinf(period):  # the flow has neither a period nor a grid, so no set of times is enough
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
    spread: Array = _with_neighbours(_with_neighbours(cells, 1), 2) + SPARE * flow.extent.max_speed
    return np.minimum(spread, flow.extent.max_speed)


def _of_grid(
    flow: kernel.OceanGrid | kernel.RisingOceanGrid,
    x: Array,
    y: Array,
    size: float,
    z: tuple[float, float],
    since: float,
    directions: Array,
) -> Array:
    """Return the same for a grid; it is a true bound, because interpolation stays between the grid's values."""
    from scipy.ndimage import maximum_filter

    first = max(int(np.searchsorted(flow.times, since, side="right")) - 1, 0)
    low = max(int(np.searchsorted(flow.levels, z[0], side="right")) - 1, 0)
    high = int(np.searchsorted(flow.levels, z[1], side="left")) + 1
    known = np.full((directions.shape[1], *flow.values.shape[2:4]), -np.inf)
    for moment in flow.values[first:, low:high]:
        for level in moment:
            known = np.maximum(known, np.moveaxis(level[..., :2] @ directions, -1, 0))
    near = _indices(flow, x, y)
    # the number of indices that a cell spans; the map of indices is smooth
    moved = _indices(flow, x + size, y), _indices(flow, x, y + size)
    span = max(float(np.abs(index - near).max()) for index in moved)
    width = 2 * (math.ceil(span) + 1) + 1
    wide: Array = maximum_filter(known, (1, width, width))
    i, j = (np.clip(np.round(near[n]).astype(np.int64), 0, flow.values.shape[2 + n] - 1) for n in range(2))
    return np.minimum(wide[:, i, j], flow.extent.max_speed)


def _with_neighbours(values: Array, axis: int) -> Array:
    """Return for each value the greatest of it and the one or two beside it along an axis.

    SciPy's `maximum_filter` does the same, but loading its ndimage takes a tenth of a small query, whose flow is
    given by a formula.
    """
    beyond = [(1, 1) if n == axis else (0, 0) for n in range(values.ndim)]
    padded = np.pad(values, beyond, constant_values=-np.inf)
    found: Array = sliding_window_view(padded, 3, axis).max(axis=-1)
    return found


def _indices(flow: kernel.OceanGrid | kernel.RisingOceanGrid, x: Array, y: Array) -> Array:
    """Return fractional grid indices (2, nx, ny) at places [m]; outside the grid they stay at its edge."""
    from scipy.ndimage import map_coordinates

    at = np.meshgrid((x - flow.extent.x_lo) * flow.per_x, (y - flow.extent.y_lo) * flow.per_y, indexing="ij")
    return np.stack([map_coordinates(flow.index_map[..., n], at, order=1, mode="nearest") for n in range(2)])
