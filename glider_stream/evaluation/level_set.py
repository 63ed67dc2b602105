"""The least time that any route can take: the front of a glider that may turn at every instant.

A route holds a glide until it turns; a glider whose glide angle and heading may change at every instant is never
slower. The set that such a glider can have reached is a front: V_t + max over the controls of f . grad V = 0
moves it, with f the current and the speed through water (Osher and Sethian 1988; WENO5, local Lax-Friedrichs, TVD
Runge-Kutta 3). In three dimensions glide angles lie on the polar or between two of its points. In two, for long
routes of equal yos, the glider moves at its best horizontal speed in the mean current of the depths of a yo: that
is what yos meet from one surfacing to the next, and an estimate, since a current varies along a yo.

- Start. On a finer grid around the start V(., 0) is the time tau [s] that a glider in still water needs from
  the start, as sqrt(tau^2 + TAU^2) - TAU: it moves alike, and has no tip. A glider from the start itself needs
  tau / (1 + m / Vh) or more to get out of the set within tau = TAU, with m the greatest current there; after
  that the front tells when each place near the start is reached. The grid of all water goes on from these times:
  V(goal, t) tells the set of places that a glider has reached when it begins and from which it is at the goal
  at t.
- Surface and floor. The field goes on beyond both as its mirror image: a path there, folded back, dives where it
  climbed. Gliders may so hold their depth there.
- Sides. Nothing comes in through the sides of the box. Land is not entered.

So all errors but the scheme's own, and in two dimensions the mean's, put the value below the optimum. The
difference between two grids estimates the scheme's.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from ..base.arrays import Array, Bools
from ..base.clock import span
from ..base.settings import require
from ..kernels.flow import velocities
from ..roadmap.nodes import YoSampler
from ..roadmap.problem import Problem
from ..water.inspect import is_steady

CELLS = 4.0
"""The front begins at a set of so many cells of the grid around the start."""
BEGIN_FINER = 3
"""The grid on which the front begins is so many times finer."""
SURE = 0.6
"""The other grid goes on from where the front was after this share of its time on the finer one."""
WIDE = 7.0
"""It reaches so many cells of the other grid to each side of the start."""
AROUND = 21
"""The currents around an end are read at so many places along each dimension."""
COURANT = 0.6
SLOPES = 512
HEIGHTS = 25
"""Heights at which the mean current of a yo is read."""
LONG = 10.0
"""A route of so many legs at the fastest glide is long: it is bounded in two dimensions."""
NODES = {2: 101, 3: 61}
"""Nodes along the longest side of the finer grid."""
FEWEST = 21
LATEST = 3.0
"""The search ends at so many times of the straight way in still water."""


@dataclass(frozen=True)
class Bound:
    """The least `time` [s] from start to goal on the finer grid, its `error` [s] the difference to the coarser.

    `dimensions`, 2 or 3; `spacing` [m] of the finer grid along each; `wall_s` is not part of the answer.
    """

    time: float
    error: float
    dimensions: int
    spacing: tuple[float, ...]

    @property
    def least(self) -> float:
        """The time less its error [s]."""
        return self.time - self.error

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "time_s": self.time,
            "error_s": self.error,
            "least_s": self.least,
            "dimensions": self.dimensions,
            "spacing_m": list(self.spacing),
            "kind": "estimate" if self.dimensions == 2 else "bound",
        }

    def __str__(self) -> str:
        where = "in the mean current of a yo's depths, an estimate" if self.dimensions == 2 else "in all depths"
        grid = " x ".join(f"{step:,.0f}" for step in self.spacing)
        return (
            f"no route takes less than {span(self.least)}: a level set {where}, arrives after "
            f"{span(self.time)} on a grid of {grid} m; two grids differ by {self.error:,.0f} s"
        )


class Waters:
    """What a level set reads of a problem: the flow, two ends, the box [m], and the polar's hull.

    `support` (SLOPES + 1,) is the greatest (1 - a) Vh + a w [m/s] for a from 0 to 1; `fastest`, `steepest`: the
    greatest Vh, w.
    """

    def __init__(self, problem: Problem, dimensions: int) -> None:
        """InputError where the scenario names no start and goal, or the box has no end."""
        require(problem.start is not None, "the scenario has no [query]: it names the start and the goal; add it")
        assert problem.start is not None
        assert problem.goal is not None
        evaluator = problem.evaluator
        self.problem, self.flow, self.departure = problem, evaluator.flow, problem.departure
        self.steady = is_steady(self.flow) or problem.frozen
        extent = self.flow.extent
        wide = np.array([[extent.x_lo, extent.y_lo], [extent.x_hi, extent.y_hi]])
        box = np.array([problem.lo[:2], problem.hi[:2]], float)
        stray = 0.2 * float((box[1] - box[0]).max())
        lo, hi = np.maximum(wide[0], box[0] - stray), np.minimum(wide[1], box[1] + stray)
        depths = problem.lo[2], min(0.0, float(problem.hi[2]))
        self.depths = _yo_depths(problem) if dimensions == 2 else depths
        self.lo = lo if dimensions == 2 else np.append(lo, depths[0])
        self.hi = hi if dimensions == 2 else np.append(hi, depths[1])
        self.ends = tuple(np.array(end[:dimensions], float) for end in (problem.start, problem.goal))
        share = np.linspace(0.0, 1.0, SLOPES + 1)
        hulls = [_hull(evaluator.polar, way, share) for way in range(2)]
        self.support = np.maximum(*(hull for hull, _, _ in hulls))
        self.fastest = max(level for _, level, _ in hulls)
        self.steepest = max(sink for _, _, sink in hulls)

    def current(self, at: Array, since: float) -> Array:
        """Current (u, v) [m/s] at points (n, 2 or 3), `since` [s] after departure; a mean where at has no z."""
        if self.steady:
            since = 0.0
        x, y = (np.ascontiguousarray(at[:, n]) for n in range(2))
        when = np.full(len(at), self.departure + since)
        if at.shape[1] == 3:
            return np.asarray(velocities(self.flow, x, y, np.ascontiguousarray(at[:, 2]), when))
        total = np.zeros((len(at), 2))
        low, high = self.depths
        for n in range(HEIGHTS):
            z = np.full(len(at), low + (n + 0.5) / HEIGHTS * (high - low))
            total += velocities(self.flow, x, y, z, when)
        return total / HEIGHTS

    def land(self, at: Array) -> NDArray[np.bool_]:
        """Which points (n, 2 or 3) no glider can be at."""
        places = at if at.shape[1] == 3 else np.column_stack([at, np.zeros(len(at))])
        return ~self.problem.evaluator.allowed(places, self.departure)

    def still_water_time(self, away: Array) -> Array:
        """Time [s] over distances (n, 2 or 3) [m] in still water."""
        across = np.hypot(away[..., 0], away[..., 1])
        if away.shape[-1] == 2:
            return np.asarray(across / self.fastest)
        along, result = np.abs(away[..., 2]), np.zeros_like(across)
        for a, support in zip(np.linspace(0.0, 1.0, SLOPES + 1), self.support, strict=True):
            result = np.maximum(result, ((1 - a) * across + a * along) / support)
        return result

    def reach(self, slopes: list[Array]) -> Array:
        """The greatest speed through water against slopes of V, one array for each dimension."""
        across = np.hypot(slopes[0], slopes[1])
        if len(slopes) == 2:
            return np.asarray(self.fastest * across)
        along = np.abs(slopes[2])
        size = across + along
        at = SLOPES * along / np.maximum(size, 1e-20)
        below = np.minimum(at.astype(np.int64), SLOPES - 1)
        low, high = self.support[below], self.support[below + 1]
        return np.asarray(size * (low + (at - below) * (high - low)))


def _yo_depths(problem: Problem) -> tuple[float, float]:
    """Between which heights [m] yos turn."""
    if isinstance(problem.sampler, YoSampler):
        return -max(problem.sampler.depths), -min(problem.sampler.depths)
    return float(problem.lo[2]), min(0.0, float(problem.hi[2]))


def _hull(polar: Any, way: int, share: Array) -> tuple[Array, float, float]:
    """The support of a polar's dive or climb, its greatest Vh and w [m/s]."""
    knots = np.linspace(polar.shallowest[way], polar.steepest[way], polar.speed.shape[1])
    angle = np.linspace(knots[0], knots[-1], 20_001)
    speed = np.interp(angle, knots, polar.speed[way])
    level, sink = speed * np.cos(angle), speed * np.sin(angle)
    # convex in the share: the table, linear between, errs towards faster
    support = np.array([((1 - a) * level + a * sink).max() for a in share])
    return support, float(level.max()), float(sink.max())


class _Grid:
    """Even nodes of a box from `lo` to `hi` [m], `shape` of them along each dimension, that move a front."""

    def __init__(self, waters: Waters, lo: Array, hi: Array, shape: tuple[int, ...], backward: bool) -> None:
        """With `backward` the front comes from the goal, against the current."""
        self.waters, self.shape, self.backward = waters, shape, backward
        self.axes = [np.linspace(a, b, n) for a, b, n in zip(lo, hi, shape, strict=True)]
        self.step = np.array([axis[1] - axis[0] for axis in self.axes])
        self.nodes = np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1).reshape(-1, len(shape))
        self.water = ~waters.land(self.nodes).reshape(shape)

    def still_water_time(self, source: Array) -> Array:
        """Time [s] from a point to each node in still water."""
        return self.waters.still_water_time(self.nodes - source).reshape(self.shape)

    def moving(self, values: Array, since: float) -> Iterator[tuple[float, float, Array]]:
        """Yield the time [s] after each step, the step's length [s] and the values of the front then."""
        waters, current = self.waters, self._current(since)
        most = [waters.fastest, waters.fastest, waters.steepest][: len(self.shape)]
        while True:
            if not waters.steady:
                current = self._current(since)
            speeds = [most[n] + np.abs(part) for n, part in enumerate(current)]
            rate = sum(float(speed.max()) / step for speed, step in zip(speeds, self.step, strict=True))
            values = self._moved(values, COURANT / rate, current, speeds)
            since += COURANT / rate
            yield since, COURANT / rate, values

    def _current(self, since: float) -> list[Array]:
        """The current along each dimension at the nodes; against it where the front comes from the goal."""
        sign = -1.0 if self.backward else 1.0
        u, v = sign * self.waters.current(self.nodes, since).T
        parts = [u.reshape(self.shape), v.reshape(self.shape)]
        return parts if len(self.shape) == 2 else [*parts, np.zeros(self.shape)]

    def _moved(self, values: Array, ahead: float, current: list[Array], speeds: list[Array]) -> Array:
        """The values a step later, by three stages (Shu and Osher 1988)."""

        def stage(at: Array) -> Array:
            return at - ahead * np.where(self.water, self._change(at, current, speeds), 0.0)

        first = stage(values)
        second = 0.75 * values + 0.25 * stage(first)
        return np.asarray(values / 3 + 2 / 3 * stage(second))

    def _change(self, values: Array, current: list[Array], speeds: list[Array]) -> Array:
        sides = [_one_sided(values, n, float(self.step[n]), mirror=n == 2) for n in range(values.ndim)]
        middle = [0.5 * (left + right) for left, right in sides]
        flux = self.waters.reach(middle)
        for n, (left, right) in enumerate(sides):
            flux = flux + current[n] * middle[n] - 0.5 * speeds[n] * (right - left)
        return np.asarray(flux)

    def rim(self) -> Bools:
        """A mask of the nodes at sides of the box that are not sides of the water."""
        mask = np.zeros(self.shape, np.bool_)
        for n, axis in enumerate(self.axes):
            along = np.moveaxis(mask, n, 0)
            along[0] |= axis[0] > self.waters.lo[n]
            along[-1] |= axis[-1] < self.waters.hi[n]
        return mask


class Front:
    """One run on one grid, from the start, or in a steady flow from the end in the weaker current."""

    def __init__(self, waters: Waters, nodes: int, tau: float) -> None:
        """With so many nodes along the longest side; the front begins within `tau` [s]."""
        self.waters, self.tau = waters, tau
        span_of = waters.hi - waters.lo
        shape = tuple(max(9, 1 + round(float(side / span_of.max()) * (nodes - 1))) for side in span_of)
        if len(span_of) == 3:  # depth matters as much as x and y, though the box is flat
            shape = (*shape[:2], max(shape[2], 1 + (nodes - 1) // 2))
        slower = [self._quickening(end) for end in waters.ends]
        backward = waters.steady and slower[1] < slower[0]
        self.grid = _Grid(waters, waters.lo, waters.hi, shape, backward)
        self.source, self.far = waters.ends[::-1] if backward else waters.ends
        self.quickening = slower[1] if backward else slower[0]

    def _quickening(self, end: Array) -> float:
        """1 + m / Vh, m the greatest current within tau of an end."""
        waters = self.waters
        reach = 1.5 * self.tau * np.array([waters.fastest, waters.fastest, waters.steepest][: len(end)])
        near = np.stack(np.meshgrid(*(np.linspace(-r, r, AROUND) for r in reach), indexing="ij"), axis=-1)
        near = near.reshape(-1, len(end))
        points = end + near[waters.still_water_time(near) <= 1.5 * self.tau]
        points = np.clip(np.vstack([points, end]), waters.lo, waters.hi)
        return 1.0 + float(np.hypot(*waters.current(points, 0.0).T).max()) / waters.fastest

    def arrival(self) -> float:
        """When the far end is reached [s], as the module says; inf where that is never."""
        latest = LATEST * float(self.waters.still_water_time((self.far - self.source)[None])[0])
        reached, within = self._begun()
        values = np.hypot(reached, within) - within
        left = math.inf
        for now, ahead, moved in self.grid.moving(values, within):
            before, left = left, self._left(moved, within)
            if left <= within:
                return float(now - ahead * (within - left) / max(before - left, 1e-12))
            if now >= latest:
                return math.inf
        raise AssertionError("the front moves without end")

    def _begun(self) -> tuple[Array, float]:
        """When a glider from the source can be at each node [s], right up to the second value [s]; beyond, later.

        A front on a finer grid around the source tells, until it has come so far that this grid can follow it.
        """
        waters, wide = self.waters, WIDE * self.grid.step
        lo, hi = np.maximum(self.source - wide, waters.lo), np.minimum(self.source + wide, waters.hi)
        shape = tuple(1 + max(8, math.ceil(n)) for n in BEGIN_FINER * (hi - lo) / self.grid.step)
        fine = _Grid(waters, lo, hi, shape, self.grid.backward)
        tau, rim, edge = fine.still_water_time(self.source), fine.rim(), (math.sqrt(2.0) - 1.0) * self.tau
        values, now = np.hypot(tau, self.tau) - self.tau, 0.0
        begins = self.tau / self.quickening
        reached = np.where(tau <= self.tau, tau / self.quickening, math.inf)
        for after, ahead, moved in fine.moving(values, 0.0):
            if (moved[rim] <= edge).any() or (moved <= edge).all():
                break
            new = (moved <= edge) & ~np.isfinite(reached)
            share = (values[new] - edge) / np.maximum(values[new] - moved[new], 1e-12)
            reached[new] = begins + now + ahead * share
            values, now = moved, after
        beyond = np.sqrt(np.maximum((values + self.tau) ** 2 - self.tau**2, 0.0)) - self.tau
        reached = np.where(np.isfinite(reached), reached, begins + now + beyond)
        inside = np.clip(self.grid.nodes, lo, hi)
        read = map_coordinates(reached, ((inside - lo) / fine.step).T, order=1, mode="nearest")
        away = waters.still_water_time(self.grid.nodes - inside)
        return (read + away).reshape(self.grid.shape), SURE * (begins + now)

    def _left(self, values: Array, within: float) -> float:
        """tau [s] at the far end; 0 once V has sunk below its least value."""
        grid = self.grid
        place = [[(c - axis[0]) / step] for c, axis, step in zip(self.far, grid.axes, grid.step, strict=True)]
        first = [min(max(int(p[0]) - 4, 0), max(n - 10, 0)) for p, n in zip(place, grid.shape, strict=True)]
        patch = values[tuple(slice(f, f + 10) for f in first)]
        at = [[p[0] - f] for p, f in zip(place, first, strict=True)]
        value = float(map_coordinates(patch, at, order=3, mode="mirror")[0])
        return math.sqrt(max((max(value, -within) + within) ** 2 - within**2, 0.0))


def _one_sided(values: Array, axis: int, step: float, mirror: bool) -> tuple[Array, Array]:
    """Slopes from the left and from the right, by WENO5 (Jiang and Peng 2000)."""
    along = np.moveaxis(values, axis, -1)
    width = [(0, 0)] * (along.ndim - 1) + [(3, 3)]
    padded = np.pad(along, width, mode="reflect") if mirror else np.pad(
        along, width, mode="reflect", reflect_type="odd"
    )  # fmt: skip
    rises = np.diff(padded, axis=-1) / step
    count = along.shape[-1]
    part = [rises[..., n : n + count] for n in range(6)]
    left, right = _weno(*part[:5]), _weno(*part[:0:-1])
    return np.moveaxis(left, -1, axis), np.moveaxis(right, -1, axis)


def _weno(a: Array, b: Array, c: Array, d: Array, e: Array) -> Array:
    """The fifth-order slope of five rises, smooth ones weighing most."""
    smooth = (
        13 / 12 * (a - 2 * b + c) ** 2 + 0.25 * (a - 4 * b + 3 * c) ** 2,
        13 / 12 * (b - 2 * c + d) ** 2 + 0.25 * (b - d) ** 2,
        13 / 12 * (c - 2 * d + e) ** 2 + 0.25 * (3 * c - 4 * d + e) ** 2,
    )
    tiny = 1e-6 * np.maximum.reduce([a * a, b * b, c * c, d * d, e * e]) + 1e-99
    weight = [share / (tiny + one) ** 2 for share, one in zip((0.1, 0.6, 0.3), smooth, strict=True)]
    parts = (2 * a - 7 * b + 11 * c) / 6, (-b + 5 * c + 2 * d) / 6, (2 * c + 5 * d - e) / 6
    return np.asarray(sum(w * part for w, part in zip(weight, parts, strict=True)) / sum(weight))


def dimensions_of(problem: Problem) -> int:
    """2 where a route at the fastest glide would have many legs, else 3."""
    if problem.start is None or problem.goal is None:
        return 3
    low, high = _yo_depths(problem)
    leg = (high - low) / math.tan(float(problem.evaluator.polar.best_angle.max()))
    return 2 if math.dist(problem.start[:2], problem.goal[:2]) > LONG * leg else 3


def bound(
    problem: Problem,
    dimensions: int | None = None,
    nodes: int | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> Bound:
    """The least time from start to goal, by two grids, the finer with `nodes` along its longest side.

    InputError where the front does not reach the goal: land, the sides or the current are in the way.
    """
    size = dimensions_of(problem) if dimensions is None else dimensions
    require(size in (2, 3), f"`dimensions` must be 2 or 3; got {dimensions}")
    finest = NODES[size] if nodes is None else nodes
    require(finest >= FEWEST, f"`nodes` must be at least {FEWEST}; got {nodes}")
    waters = Waters(problem, size)
    tau = CELLS / BEGIN_FINER * float((waters.hi - waters.lo).max()) / (finest - 1) / waters.fastest
    found = []
    for count in (1 + (finest - 1) // 2, finest):
        front = Front(waters, count, tau)
        found.append(front.arrival())
        progress(f"a grid of {' x '.join(map(str, front.grid.shape))}: {found[-1]:,.0f} s")
    cure = "take a wider domain, or more nodes"
    require(math.isfinite(found[-1]), f"no front reaches the goal in {LATEST:g} times the straight way; {cure}")
    error = abs(found[1] - found[0]) if math.isfinite(found[0]) else found[1]
    return Bound(found[1], error, size, tuple(float(step) for step in front.grid.step))
