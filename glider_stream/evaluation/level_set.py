"""The least time that any route can take: the front of a glider that may turn at every instant.

A route holds a glide until it turns; a glider whose glide angle and heading may change at every instant is never
slower. The set that such a glider can have reached is a front: V_t + max over the controls of f . grad V = 0
moves it, with f the current and the speed through water (Osher and Sethian 1988; WENO5, local Lax-Friedrichs, TVD
Runge-Kutta 3). In three dimensions glide angles lie on the polar or between two of its points. In two, for long
routes of equal yos, the glider moves at its best horizontal speed in the mean current of the depths of a yo: that
is what yos meet from one surfacing to the next, and an estimate, since a current varies along a yo. Where it does
not vary with depth, or where the front may take the current of any depth at any time, it is a bound.

- Start. The front does not begin at a point, which no grid shows, but at the set that a glider needs tau [s] to
  cross in still water. V is that time, as sqrt(tau^2 + SOFT^2) - SOFT with SOFT = tau: it moves alike, and has no
  tip. Near the start the current is c, and off by m [m/s] at the most. So after s = tau / (1 + m / Vh) a glider
  from the start is still within tau of the place to which c alone has carried it. There the front begins, at s.
- Surface and floor. The field goes on beyond both as its mirror image: a path there, folded back, dives where it
  climbed. Gliders may so hold their depth there.
- Sides. Nothing comes in through the sides of the box. Land is not entered.

So all errors but the scheme's own, and in two dimensions the mean's, put the value below the optimum. The
difference between two grids estimates the scheme's.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from ..base.arrays import Array
from ..base.clock import span
from ..base.settings import require
from ..kernels.flow import currents, rises, velocities
from ..roadmap.nodes import YoSampler
from ..roadmap.problem import Problem
from ..water.inspect import is_steady

CELLS = 4.0
"""The front begins at a set of so many cells of the finer grid around the start."""
NEAR, PARTS = 1.25, 5
"""The current near the start is read within NEAR times tau of a glider that drifts, at PARTS times."""
COURANT = 0.6
SLOPES = 512
HEIGHTS = 25
"""Heights at which the mean current of a yo, or the current of any depth, is read."""
EVEN = 1e-9
"""A current that differs by less than this [m/s] from one depth to another does not vary with depth."""
LONG = 10.0
"""A route of so many legs at the fastest glide is long: it is bounded in two dimensions."""
NODES = {2: 101, 3: 61}
"""Nodes along the longest side of the finer grid."""
FEWEST = 21
STILL = "FROZEN: the front meets the current of the departure, so this holds for no route with the clock running"
LATEST = 3.0
"""The search ends at so many times of the straight way in still water."""


@dataclass(frozen=True)
class Bound:
    """The least `time` [s] from start to goal on the finer grid, its `error` [s] the difference to the coarser.

    `dimensions`, 2 or 3; `spacing` [m] of the finer grid along each. `frozen`: the front moves in the current of
    the departure, though the flow changes. `sound`: the current is that of all depths, no mean of several.
    `early` [s]: by how much the time may be below the optimum, since the front begins at a set around one end.
    """

    time: float
    error: float
    dimensions: int
    spacing: tuple[float, ...]
    frozen: bool = False
    sound: bool = True
    early: float = 0.0

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
            "early_s": self.early if math.isfinite(self.early) else None,
            "kind": "bound" if self.sound else "estimate",
            **({"frozen": True} if self.frozen else {}),
        }

    def __str__(self) -> str:
        grid = " x ".join(f"{step:,.0f}" for step in self.spacing)
        early = f"by up to {self.early:,.0f} s" if math.isfinite(self.early) else "by an unknown time"
        found = (
            f"{span(self.time)} on a grid of {grid} m, {early} too early, since it begins at a set around one "
            f"end; two grids differ by {self.error:,.0f} s" + (f"; {STILL}" if self.frozen else "")
        )
        if self.sound:
            return f"no route takes less than {span(self.least)}: a level set in all depths arrives after {found}"
        return (
            f"an estimate of the least time, {span(self.least)}, no bound: a level set in the mean current of a "
            f"yo's depths arrives after {found}. A route that stays in some of the depths may take less; "
            "--any-depth gives a bound"
        )


@dataclass(frozen=True)
class Progress:
    """How far the front is on grid `number` of two, of a `shape`: at `done` [s] of about `total` [s]."""

    done: float
    total: float
    number: int
    shape: tuple[int, ...]

    def __str__(self) -> str:
        grid = " x ".join(map(str, self.shape))
        return (
            f"grid {self.number} of 2, {grid} nodes: the front at {self.done:,.0f} s of about {self.total:,.0f} s"
        )


class Waters:
    """What a level set reads of a problem: the flow, two ends, the box [m], and the polar's hull.

    `support` (SLOPES + 1,) is the greatest (1 - a) Vh + a w [m/s] for a from 0 to 1; `fastest`, `steepest`: the
    greatest Vh, w. With `any_depth`, in two dimensions, the front has the currents of all depths to choose from.
    """

    def __init__(self, problem: Problem, dimensions: int, any_depth: bool = False) -> None:
        """InputError where the scenario names no start and goal, or the box has no end."""
        self.any_depth = any_depth and dimensions == 2
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
        """Current (u, v) [m/s] at points (n, 2 or 3), `since` [s] after departure; a mean where at has no z.

        In a flow with a vertical part (u, v, w).
        """
        if self.steady:
            since = 0.0
        x, y = (np.ascontiguousarray(at[:, n]) for n in range(2))
        when = np.full(len(at), self.departure + since)
        if at.shape[1] == 3 and rises(self.flow):
            return np.asarray(currents(self.flow, x, y, np.ascontiguousarray(at[:, 2]), when))
        if at.shape[1] == 3:
            return np.asarray(velocities(self.flow, x, y, np.ascontiguousarray(at[:, 2]), when))
        total = np.zeros((len(at), 2))
        low, high = self.depths
        for n in range(HEIGHTS):
            z = np.full(len(at), low + (n + 0.5) / HEIGHTS * (high - low))
            total += velocities(self.flow, x, y, z, when)
        return total / HEIGHTS

    def choices(self, at: Array, since: float) -> Array:
        """Currents (depths, n, 2 or 3) [m/s] to choose from at points (n, 2 or 3); one, unless `any_depth`."""
        if not self.any_depth:
            return self.current(at, since)[None]
        when = np.full(len(at), self.departure + (0.0 if self.steady else since))
        x, y = (np.ascontiguousarray(at[:, n]) for n in range(2))
        low, high = self.depths
        heights = np.linspace(low, high, HEIGHTS)
        return np.array([velocities(self.flow, x, y, np.full(len(at), z), when) for z in heights])

    def varies(self, at: Array, since: float) -> bool:
        """Whether the current at points (n, 2) varies with depth."""
        known = Waters(self.problem, 2, any_depth=True).choices(at, since)
        return bool((np.ptp(known, axis=0) > EVEN).any())

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


class Front:
    """One run on one grid, from the start, or in a steady flow from the end in the weaker current."""

    def __init__(self, waters: Waters, nodes: int, tau: float) -> None:
        """With so many nodes along the longest side; the front begins as the set within `tau` [s]."""
        self.waters, self.tau = waters, tau
        span_of = waters.hi - waters.lo
        self.shape = tuple(max(9, 1 + round(float(side / span_of.max()) * (nodes - 1))) for side in span_of)
        if len(span_of) == 3:  # depth matters as much as x and y, though the box is flat
            self.shape = (*self.shape[:2], max(self.shape[2], 1 + (nodes - 1) // 2))
        self.axes = [np.linspace(a, b, n) for a, b, n in zip(waters.lo, waters.hi, self.shape, strict=True)]
        self.step = np.array([axis[1] - axis[0] for axis in self.axes])
        grid = np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1)
        self.nodes = grid.reshape(-1, len(self.shape))
        leaves = [self._leaves(end, sign) for end, sign in zip(waters.ends, (1.0, -1.0), strict=True)]
        self.backward = waters.steady and leaves[1][0] > leaves[0][0]
        self.far = waters.ends[0 if self.backward else 1]
        self.began, self.source = leaves[1 if self.backward else 0]
        self.water = ~waters.land(self.nodes).reshape(self.shape)

    def _leaves(self, end: Array, sign: float) -> tuple[float, Array]:
        """Return when the front begins [s], and the place to which the current has carried `end` by then.

        `sign` is -1 where the front moves against the current, from the goal.
        """
        waters, across = self.waters, np.zeros(end.size)
        first = waters.current(end[None], 0.0)[0]
        across[: first.size] = first
        seen = []
        for share in np.linspace(0.0, 1.0, PARTS):
            away = self.nodes - end - sign * share * self.tau * across
            near = self.nodes[waters.still_water_time(away) <= NEAR * self.tau]
            found = waters.choices(np.vstack([near, end]), share * self.tau)
            seen.append(found.reshape(-1, found.shape[2]))
        known = np.vstack(seen)
        carried = 0.5 * (known.min(axis=0) + known.max(axis=0))
        off = float(np.hypot(*(known - carried)[:, :2].T).max()) / waters.fastest
        if (
            carried.size == 3
        ):  # in seconds of still water a second: a glider sinks more slowly than it moves across
            off = float(waters.still_water_time(known - carried).max())
        began = self.tau / (1.0 + off)
        place = end.copy()
        place[: carried.size] += sign * began * carried
        return began, place

    @property
    def early(self) -> float:
        """By how much [s] the arrival may be too early, since the front begins at a set and not at a point.

        After tau / (1 + m / Vh) a glider from the start is still within the set; after tau / (1 - m / Vh) it can
        be anywhere in it. inf if the current near the start differs by more than the glider's speed.
        """
        off = self.tau / self.began - 1.0
        return self.tau / (1.0 - off) - self.began if off < 1 else math.inf

    def arrival(self, progress: Callable[[float, float], None] = lambda now, left: None) -> float:
        """When the far end is reached [s], as the module says; inf where that is never.

        `progress` is told after each step where the front is and what is about left [s].
        """
        waters, tau = self.waters, self.waters.still_water_time(self.nodes - self.source).reshape(self.shape)
        values, now = np.hypot(tau, self.tau) - self.tau, self.began
        latest = LATEST * float(waters.still_water_time((waters.ends[1] - waters.ends[0])[None])[0])
        current = self._current(now)
        most = [waters.fastest, waters.fastest, waters.steepest][: len(self.shape)]
        left = math.inf
        while now < latest:
            if not waters.steady:
                current = self._current(now)
            speeds = [most[n] + np.abs(part).max(axis=0) for n, part in enumerate(current)]
            rate = sum(float(speed.max()) / step for speed, step in zip(speeds, self.step, strict=True))
            ahead = COURANT / rate
            values = self._moved(values, ahead, current, speeds)
            now, before, left = now + ahead, left, self._left(values)
            if left <= self.tau:
                touched = now - ahead * (self.tau - left) / max(before - left, 1e-12)
                progress(touched, 0.0)
                return float(touched)
            progress(now, left)
        return math.inf

    def _current(self, since: float) -> list[Array]:
        """The currents to choose from along each dimension at the nodes, (depths, *shape).

        They are against the flow where the front comes from the goal.
        """
        sign = -1.0 if self.backward else 1.0
        found = sign * self.waters.choices(self.nodes, since)
        parts = [found[:, :, n].reshape(-1, *self.shape) for n in range(found.shape[2])]
        return parts if len(self.shape) == len(parts) else [*parts, np.zeros((1, *self.shape))]

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
        if current[0].shape[0] > 1:
            flux = flux + np.max(sum(part * slope for part, slope in zip(current, middle, strict=True)), axis=0)
        for n, (left, right) in enumerate(sides):
            along = 0.0 if current[0].shape[0] > 1 else current[n][0] * middle[n]
            flux = flux + along - 0.5 * speeds[n] * (right - left)
        return np.asarray(flux)

    def _left(self, values: Array) -> float:
        """tau [s] at the far end; 0 once V has sunk below its least value."""
        place = [[(c - axis[0]) / step] for c, axis, step in zip(self.far, self.axes, self.step, strict=True)]
        first = [min(max(int(p[0]) - 4, 0), max(n - 10, 0)) for p, n in zip(place, self.shape, strict=True)]
        patch = values[tuple(slice(f, f + 10) for f in first)]
        at = [[p[0] - f] for p, f in zip(place, first, strict=True)]
        value = float(map_coordinates(patch, at, order=3, mode="mirror")[0])
        return math.sqrt(max((max(value, -self.tau) + self.tau) ** 2 - self.tau**2, 0.0))


def _one_sided(values: Array, axis: int, step: float, mirror: bool) -> tuple[Array, Array]:
    """Slopes from the left and from the right, by WENO5 (Jiang and Peng 2000)."""
    along = np.moveaxis(values, axis, -1)
    before, after = along[..., 3:0:-1], along[..., -2:-5:-1]
    if not mirror:  # higher beyond the side than on it, so that no front comes in
        before = along[..., :1] + np.abs(along[..., :1] - before)
        after = along[..., -1:] + np.abs(along[..., -1:] - after)
    padded = np.concatenate([before, along, after], axis=-1)
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


def _tell(
    progress: Callable[[Progress], None], number: int, shape: tuple[int, ...], now: float, left: float
) -> None:
    progress(Progress(now, now + left, number, shape))


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
    progress: Callable[[Progress], None] = lambda progress: None,
    any_depth: bool = False,
) -> Bound:
    """The least time from start to goal, by two grids, the finer with `nodes` along its longest side.

    With `any_depth`, in two dimensions, the front takes the current of whichever depth is best. `progress` is
    told of every step.

    InputError where the front does not reach the goal: land, the sides or the current are in the way.
    """
    size = dimensions_of(problem) if dimensions is None else dimensions
    require(size in (2, 3), f"`dimensions` must be 2 or 3; got {dimensions}")
    flat = "a bound in 2 dimensions knows no vertical current, and this flow has one; give 3 dimensions"
    require(size == 3 or not rises(problem.evaluator.flow), flat)
    finest = NODES[size] if nodes is None else nodes
    require(finest >= FEWEST, f"`nodes` must be at least {FEWEST}; got {nodes}")
    require(
        not any_depth or size == 2, f"any depth is for 2 dimensions; got {size}, which know all depths; set 2"
    )
    waters = Waters(problem, size, any_depth)
    tau = CELLS * float((waters.hi - waters.lo).max()) / (finest - 1) / waters.fastest
    found = []
    for number, count in enumerate((1 + (finest - 1) // 2, finest), 1):
        front = Front(waters, count, tau)
        told = partial(_tell, progress, number, front.shape)
        found.append(front.arrival(told))
    cure = "take a wider domain, or more nodes"
    require(math.isfinite(found[-1]), f"no front reaches the goal in {LATEST:g} times the straight way; {cure}")
    error = abs(found[1] - found[0]) if math.isfinite(found[0]) else found[1]
    still = problem.frozen and not is_steady(waters.flow)
    sound = size == 3 or any_depth or not waters.varies(front.nodes, 0.0)
    return Bound(found[1], error, size, tuple(float(step) for step in front.step), still, sound, front.early)
