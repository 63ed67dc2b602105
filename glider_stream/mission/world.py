"""The world of a mission: the true current, and the forecast that a pilot has instead."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import map_coordinates

from ..base.arrays import Array
from ..base.settings import require
from ..kernels import flow as kernel
from ..kernels.flow import currents, velocities
from ..roadmap.problem import Problem
from ..water.inspect import divergence_ratio, flow_sha256, is_steady
from ..water.ocean.flow import grid_flow, slots
from ..water.ocean.vertical import with_rise
from ..water.sampled import sample_flow
from .error_field import OnMesh, error_field
from .settings import ForecastError, Mission

POINTS = 4096
"""The rms of a current is taken over so many random points of the domain's water."""
PER_LENGTH = 6.0
"""An error is put on a grid with so many points in each of its lengths; see `World.off`."""
PER_PERIOD = 48
"""A forecast of a current with a period is on a grid with so many times in each period."""
MOST_POINTS = 30_000_000
"""The largest grid of a forecast; it takes 0.5 GB."""
FITTED = 33
"""The map of an ocean grid is read at so many points along each side to find the places of the grid's points."""
ROUNDED_UP = 1 + 1e-12
"""A bound of the speed is larger than every value by more than rounding errors."""


@dataclass(frozen=True)
class World:
    """Two problems that differ in nothing but the current: what is `true`, and what the pilot plans with.

    `error` and `speed` [m/s]: the rms of their difference, and of the true current, over the domain's water and
    the time of a run. `off` [m/s]: the rms difference between the forecast and the exact sum that it stands for,
    by its grid. `divergence`: the ratio of its rms divergence to its rms vorticity.
    """

    true: Problem
    forecast: Problem
    error: float
    speed: float
    off: float
    divergence: float

    def __str__(self) -> str:
        share = self.error / self.speed if self.speed else math.inf
        return (
            f"the forecast differs from the true current by {self.error:.3g} m/s rms, {share:.0%} of its "
            f"{self.speed:.3g} m/s; its grid adds {self.off:.2g} m/s; "
            f"divergence {self.divergence:.2g} of vorticity"
        )


def seeds_of(mission: Mission, number: int) -> tuple[np.random.SeedSequence, np.random.SeedSequence]:
    """Return the seeds of a run: of its forecast's error, and of its vehicle. They depend on nothing else."""
    error, vehicle = np.random.SeedSequence(mission.random.seed, spawn_key=(number,)).spawn(2)
    return error, vehicle


def waters_sha256(waters: Sequence[Problem]) -> str:
    """Return the SHA-256 of the currents and the terrain of some problems, one after another."""
    read = [part for water in waters for part in (water.evaluator.flow, water.evaluator.terrain)]
    return " ".join(flow_sha256(part) for part in read)


class Worlds:
    """The worlds of all runs of a mission; the true current is the same in all of them."""

    def __init__(self, mission: Mission) -> None:
        """Read the water, and check that it is known for the time of a run."""
        self.mission = mission
        self.true = (mission.truth or mission.scenario).problem()
        forecast = mission.scenario.problem() if mission.truth is not None else self.true
        for name, problem in (("true current", self.true), ("forecast", forecast)):
            check_known(problem, mission, name)
        check_ends(self.true)
        self._sample = _points(self.true, mission.arrival.longest)
        self._speed = _rms(self._read(self.true.evaluator.flow))
        self._fixed = None if mission.truth is None else self._made(forecast, 0.0)

    def world(self, number: int) -> World:
        """Return the world of a run."""
        settings = self.mission.forecast_error
        if self._fixed is not None:
            return self._fixed
        assert settings is not None
        if settings.rms_share == 0.0:
            return self._made(self.true, 0.0)
        field = error_field(settings, np.random.default_rng(seeds_of(self.mission, number)[0]))
        longest, true = self.mission.arrival.longest, self._read(self.true.evaluator.flow)
        field = field._replace(scale=settings.rms_share * self._speed / _rms(field.at(*self._sample)))
        # a coarse grid smooths the error; what the planner reads must have the size that was asked for
        first = _rms(self._read(with_error(self.true, field, settings, longest)) - true)
        field = field._replace(scale=field.scale * settings.rms_share * self._speed / first)
        flow = with_error(self.true, field, settings, longest)
        exact = true + field.at(*self._sample)
        evaluator = replace(self.true.evaluator, flow=flow)
        return self._made(replace(self.true, evaluator=evaluator), _rms(self._read(flow) - exact))

    @cached_property
    def sha256(self) -> str:
        """The digest of what is read from files: the true current, and the forecast if it has its own files."""
        return waters_sha256([self.true] if self._fixed is None else [self.true, self._fixed.forecast])

    def _read(self, flow: kernel.Flow) -> Array:
        return np.asarray(velocities(flow, *self._sample))

    def _made(self, forecast: Problem, off: float) -> World:
        flow, true, lo, hi = forecast.evaluator.flow, self.true, self.true.lo, self.true.hi
        error = _rms(self._read(flow) - self._read(true.evaluator.flow))
        sides = (float(lo[0]), float(hi[0])), (float(lo[1]), float(hi[1])), (float(lo[2]), float(hi[2]))
        return World(true, forecast, error, self._speed, off, divergence_ratio(flow, *sides, true.departure))


def check_known(problem: Problem, mission: Mission, name: str) -> None:
    """Raise InputError unless a current, `name` in words, is known for the time of a run."""
    known, until = problem.evaluator.flow.extent, problem.departure + mission.arrival.longest
    cure = "shorten `arrival.longest_hours`, or leave earlier"
    why = f"a run may last until {until:g} s, and the {name} is known until {known.t_hi:g} s; {cure}"
    require(until <= known.t_hi, why)


def check_ends(problem: Problem) -> None:
    """Raise InputError unless a mission's scenario names a start and a goal, both at the surface."""
    for name in ("start", "goal"):
        point = getattr(problem, name)
        why = f"a mission needs `query.{name}` in its scenario; add it"
        require(point is not None, why)
        assert point is not None
        problem.check_point(point, name)
        up = float(point[2]) == 0.0
        require(up, f"a mission begins and ends at the surface; got a {name} at a depth of {-point[2]:g} m")


def rms_speed(problem: Problem, longest: float) -> float:
    """Return the rms speed [m/s] of a problem's current over its water and a time `longest` [s]."""
    return _rms(np.asarray(velocities(problem.evaluator.flow, *_points(problem, longest))))


def _points(problem: Problem, longest: float) -> tuple[Array, Array, Array, Array]:
    """Return random points of the domain's water x, y, z [m], each with a time of a run t [s]: (n,) each."""
    random = np.random.default_rng(0)
    points = problem.lo + random.random((POINTS, 3)) * (problem.hi - problem.lo)
    times = problem.departure + random.random(POINTS) * longest
    wet = problem.evaluator.allowed(points, problem.departure)
    require(bool(wet.any()), "the domain holds no open water; move it off the land")
    x, y, z = (np.ascontiguousarray(column) for column in points[wet].T)
    return x, y, z, times[wet]


def _rms(current: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(current**2, axis=-1))))


def with_error(true: Problem, field: OnMesh, settings: ForecastError, longest: float) -> kernel.Flow:
    """Return the true current with an error, on a grid that the kernels read like any other flow.

    If the true current is on a grid, it stays on that grid; a formula is put on one that is fine enough for the
    error and for the current. A vertical part has no error.
    """
    flow = true.evaluator.flow
    times = _times(flow, settings, true.departure, longest)
    if isinstance(flow, kernel.Grid | kernel.RisingGrid) and times.size == 1:
        x, y, z = _axes(flow)
        mesh = np.meshgrid(x, y, indexing="ij")
        error = field.on_mesh(mesh[0].ravel(), mesh[1].ravel(), z, times)
        return _regridded(flow, _added(flow.values, error))
    if isinstance(flow, kernel.OceanGrid | kernel.RisingOceanGrid):
        return _ocean_with_error(flow, field, times)
    if isinstance(flow, kernel.Grid | kernel.RisingGrid):
        x, y, z = _axes(flow)
    else:
        x, y, z = _fitting_axes(true, settings)
        if times.size == 1:
            spacing = float(x[1] - x[0]), float(y[1] - y[0]), float(np.diff(z).max())
            on_grid = sample_flow(flow, spacing, (x[0], x[-1]), (y[0], y[-1]), (z[0], z[-1]))
            known = replace(true, evaluator=replace(true.evaluator, flow=on_grid))
            return with_error(known, field, settings, longest)
    _check_size(times.size * x.size * y.size * z.size)
    mesh = np.meshgrid(x, y, indexing="ij")
    error = field.on_mesh(mesh[0].ravel(), mesh[1].ravel(), z, times)
    points = [a.ravel() for a in np.meshgrid(times, z, x, y, indexing="ij")]
    current = velocities(flow, points[2], points[3], points[1], points[0])
    total = (current.reshape(error.shape) + error).reshape(times.size, z.size, x.size, y.size, 2)
    u, v = np.moveaxis(total, -1, 0).transpose(0, 1, 2, 4, 3)
    level = grid_flow(x, y, z, u, v, times)[0]
    if not kernel.rises(flow):
        return level
    w = currents(flow, points[2], points[3], points[1], points[0])[:, 2].reshape(*total.shape[:-1], 1)
    return with_rise(level, np.concatenate([total, w, np.zeros_like(w)], axis=-1), level.levels)


def _added(values: Array, error: Array) -> Array:
    """Return a grid's values (..., 2 or 4) [m/s] with an error of u and v added."""
    with_it = values.copy()
    with_it[..., :2] += error.reshape(*values.shape[:-1], 2)
    return with_it


def _times(flow: kernel.Flow, settings: ForecastError, departure: float, longest: float) -> Array:
    """Return the times [s] of a forecast's grid; only one if it is steady."""
    if is_steady(flow) and isinstance(settings.time_s, str):
        return np.array([departure])
    steps = [longest]
    if not isinstance(settings.time_s, str):
        steps.append(settings.time_s / PER_LENGTH)
    moves = isinstance(flow, kernel.Rolls) and not is_steady(flow)
    period = kernel.cycle(flow) if moves else None if is_steady(flow) else getattr(flow, "period", None)
    if period is not None:
        steps.append(period / PER_PERIOD)
    count = max(2, math.ceil(longest / min(steps)) + 1)
    times = np.linspace(departure, departure + longest, count)
    if isinstance(flow, kernel.OceanGrid | kernel.RisingOceanGrid) and not is_steady(flow):
        inside = (flow.times > departure) & (flow.times < departure + longest)
        times = np.unique(np.concatenate([times, flow.times[inside]]))
    return times


def _axes(flow: kernel.Grid | kernel.RisingGrid) -> tuple[Array, Array, Array]:
    """Return the x, y and z [m] of a grid's points."""
    known, (levels, nx, ny, _) = flow.extent, flow.values.shape
    z = flow.z_first + np.arange(levels) / flow.per_z
    return np.linspace(known.x_lo, known.x_hi, nx), np.linspace(known.y_lo, known.y_hi, ny), z


def _fitting_axes(true: Problem, settings: ForecastError) -> tuple[Array, Array, Array]:
    """Return the x, y and z [m] of a grid that is fine enough for a current given by a formula and for its error.

    It reaches so far beyond the domain that no leg between two nodes leaves it.
    """
    evaluator, known = true.evaluator, true.evaluator.flow.extent
    horizon = evaluator.integration.dt * evaluator.integration.steps
    stray = 0.5 * (float(evaluator.polar.best_horizontal.max()) + known.max_speed) * horizon
    finest = min(settings.length_m, known.length_scale) / PER_LENGTH
    sides = (known.x_lo, known.x_hi), (known.y_lo, known.y_hi)
    x, y = (
        _axis(max(true.lo[n] - stray, side[0]), min(true.hi[n] + stray, side[1]), finest)
        for n, side in enumerate(sides)
    )
    deep = math.inf if isinstance(settings.depth_m, str) else settings.depth_m / PER_LENGTH
    if isinstance(evaluator.flow, kernel.Vortices):
        deep = min(deep, float(evaluator.flow.thickness.min()) / PER_LENGTH)
    if kernel.rises(evaluator.flow):
        deep = min(deep, known.length_scale / PER_LENGTH)
    return x, y, _axis(float(true.lo[2]), 0.0, deep)


def _axis(low: float, high: float, step: float) -> Array:
    return np.linspace(low, high, max(2, math.ceil((high - low) / step) + 1))


def _check_size(points: int) -> None:
    cure = "make `arrival.longest_hours` shorter, `forecast_error.length_m` longer, or the domain smaller"
    why = f"the forecast's grid would have {points:,} points, more than {MOST_POINTS:,}; {cure}"
    require(points <= MOST_POINTS, why)


def _regridded(flow: kernel.Grid | kernel.RisingGrid, values: Array) -> kernel.Flow:
    """Return a grid with other values, and the bounds of speed that belong to them."""
    level_speed = np.hypot(values[..., 0], values[..., 1]).max(axis=(1, 2))
    known = flow.extent._replace(max_speed=float(level_speed.max()))
    if isinstance(flow, kernel.RisingGrid):
        return flow._replace(values=np.ascontiguousarray(values), extent=known)
    carry = np.cumsum((level_speed[1:] + level_speed[:-1]) / 2 / flow.per_z)
    return flow._replace(
        values=np.ascontiguousarray(values),
        level_speed=level_speed,
        level_carry=np.concatenate([[0.0], carry]),
        extent=known,
    )


def _ocean_with_error(
    flow: kernel.OceanGrid | kernel.RisingOceanGrid, field: OnMesh, times: Array
) -> kernel.Flow:
    """Return an ocean grid with an error on its own points, at some times [s]."""
    _check_size(times.size * flow.values[0, ..., 0].size)
    x, y = _grid_places(flow)
    error = field.on_mesh(x.ravel(), y.ravel(), flow.levels, times)
    values = _added(_at_times(flow, times), error)
    known = flow.extent._replace(max_speed=float(np.hypot(values[..., 0], values[..., 1]).max()) * ROUNDED_UP)
    if times.size == 1:
        values = np.repeat(values, flow.times.size, axis=0)
        return flow._replace(values=np.ascontiguousarray(values), extent=known)
    slot, per_t = slots(times)
    return flow._replace(
        values=np.ascontiguousarray(values),
        times=times,
        time_slot=slot,
        slots_per_t=per_t,
        extent=known._replace(t_lo=float(times[0]), t_hi=float(times[-1])),
    )


def _at_times(flow: kernel.OceanGrid | kernel.RisingOceanGrid, times: Array) -> Array:
    """Return the values (times, levels, ni, nj, 2 or 4) of an ocean grid, linear between its times [s]."""
    at = np.clip(times, flow.times[0], flow.times[-1])
    below = np.clip(np.searchsorted(flow.times, at, side="right") - 1, 0, flow.times.size - 2)
    share = ((at - flow.times[below]) / np.diff(flow.times)[below])[:, None, None, None, None]
    return np.asarray((1 - share) * flow.values[below] + share * flow.values[below + 1])


def _grid_places(flow: kernel.OceanGrid | kernel.RisingOceanGrid) -> tuple[Array, Array]:
    """Return the places x, y (ni, nj) [m] of an ocean grid's points.

    The grid's map gives the indices of a place; a cubic that is fitted to it gives the place of the indices. An
    error may be a little off its place, since nothing but its correlation matters there.
    """
    known, (ni, nj) = flow.extent, flow.values.shape[2:4]
    mx, my = flow.index_map.shape[:2]
    at = np.meshgrid(np.linspace(0, mx - 1, FITTED), np.linspace(0, my - 1, FITTED), indexing="ij")
    i, j = (
        map_coordinates(flow.index_map[..., n], at, order=1).ravel() / (size - 1)
        for n, size in enumerate((ni, nj))
    )
    x, y = known.x_lo + at[0].ravel() / flow.per_x, known.y_lo + at[1].ravel() / flow.per_y
    fitted = np.linalg.lstsq(_cubic(i, j), np.column_stack([x, y]), rcond=None)[0]
    share_i, share_j = np.meshgrid(np.linspace(0, 1, ni), np.linspace(0, 1, nj), indexing="ij")
    places = _cubic(share_i.ravel(), share_j.ravel()) @ fitted
    return places[:, 0].reshape(ni, nj), places[:, 1].reshape(ni, nj)


def _cubic(i: Array, j: Array) -> Array:
    return np.column_stack([i**a * j**b for a in range(4) for b in range(4 - a)])
