"""The vertical part of currents from files: from a variable of the file, or from continuity."""

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array, Bools
from ...base.settings import require
from ...kernels.flow import OceanGrid, RisingOceanGrid
from ...kernels.terrain import Seabed
from ..frame import LocalFrame
from .flow import slots
from .grid import Grid

CONTINUITY = "continuity"
"""The word with which a user asks for it, in place of a variable's name."""
APART = 0.2
"""Points of two grids are the same if they are no further apart than this share of a cell."""
CLOSE = 0.05
"""Levels of u and of w that are no further apart than this [m] are the same; tables of levels stay small."""
FEWEST = 100
"""Columns that must end within the levels before their bottoms tell of an error."""


def by_continuity(
    flow: OceanGrid, seabed: Seabed, frame: LocalFrame, grid: Grid, name: str
) -> tuple[RisingOceanGrid, str]:
    """Return the flow with w from the divergence of u and v, from the surface down, and a text on it.

    dw/dz = -(du/dx + dv/dy), w = 0 at z = 0. u and v count as 0 in dry cells, so that nothing crosses a coast.
    Between two levels u and v are linear, so at the levels the integral is exact. InputError for a single level.
    """
    require(
        seabed.bottom.size > 0 and bool(np.ptp(flow.levels) > 1.0),
        f'`flow.vertical` = "{CONTINUITY}" needs the currents of two levels or more; {name} has one',
    )
    place = _places(frame, grid)
    wet = flow.levels[:, None, None] >= seabed.bottom
    w = _risen(flow, place, wet)
    off = _risen_on_half(flow, place, wet) - w[:, :, ::2, ::2]
    inner = wet[:, ::2, ::2][:, 1:-1, 1:-1]
    rough = _rms(off[:, :, 1:-1, 1:-1], inner)
    values = np.concatenate([flow.values, w[..., None], np.zeros((*w.shape, 1))], axis=-1)
    text = (
        f"vertical current by continuity from the surface down, rms {_rms(w, wet):.2g} m/s, at most "
        f"{float(np.abs(w).max()):.2g} m/s; on half the points it differs by rms {rough:.2g} m/s"
        + _told_bottom(flow, place, seabed, w)
    )
    return with_rise(flow, values, flow.levels), text


def by_variable(
    flow: OceanGrid, upward: tuple[OceanGrid, Seabed, Grid], way: float, frame: LocalFrame, grid: Grid, name: str
) -> tuple[RisingOceanGrid, str]:
    """Return the flow with a file's own w, on the levels of both, and a text on it.

    `upward` holds w in place of east and north, turned as these are; `way` is -1 where it counts downward.
    InputError unless w lies on the times and points of the currents, perhaps on more points.
    """
    lifted, data, its_grid = upward
    require(
        np.array_equal(flow.times, lifted.times),
        f"`flow.vertical` = {name!r} is given at other times than the currents; {_CURE}",
    )
    part = _same_points(_places(frame, grid), _places(frame, its_grid), name)
    lon, lat = (axis.T for axis in its_grid.mesh())
    turn = frame.convergence(lon, lat)
    w = way * (lifted.values[..., 0] * np.cos(turn) + lifted.values[..., 1] * np.sin(turn))[:, :, *part]
    levels = _both(flow.levels, lifted.levels)
    across, up = on_levels(flow.values, flow.levels, levels), on_levels(w[..., None], lifted.levels, levels)
    values = np.concatenate([across, up, np.zeros_like(up)], axis=-1)
    told = f"vertical current `{name}`, at most {float(np.abs(w).max()):.2g} m/s"
    lacks = int((data.bottom[part] >= 0.0).sum())
    told += f"; {lacks} of {w[0, 0].size} columns hold none, and take their neighbours'" if lacks else ""
    return with_rise(flow, values, levels), told


_CURE = f'bring them onto one grid first, or choose "{CONTINUITY}"'


def _same_points(mine: Array, its: Array, name: str) -> tuple[slice, slice]:
    """Return where the points (ni, nj, 2) [m] lie among others; InputError if they are not among them."""
    first = np.linalg.norm(its - mine[0, 0], axis=-1)
    i, j = np.unravel_index(int(first.argmin()), first.shape)
    part = slice(int(i), int(i) + mine.shape[0]), slice(int(j), int(j) + mine.shape[1])
    cell = min(float(np.linalg.norm(np.diff(mine, axis=axis), axis=-1).min()) for axis in (0, 1))
    require(
        its[part].shape == mine.shape,
        f"`flow.vertical` = {name!r} lies on other points than the currents, or on fewer; {_CURE}",
    )
    far = float(np.linalg.norm(its[part] - mine, axis=-1).max())
    require(far <= APART * cell, f"`flow.vertical` = {name!r} lies {far:,.0f} m beside the currents; {_CURE}")
    return part


def _both(mine: Array, its: Array) -> Array:
    """Return rising levels [m] with those of both; two that are nearly the same are one."""
    off = np.abs(its[:, None] - mine).min(axis=1)
    return np.union1d(mine, its[off > CLOSE])


def on_levels(values: Array, levels: Array, at: Array) -> Array:
    """Return values (times, levels, ...) at heights `at` (n,) [m]: linear between rising levels, held beyond."""
    held = np.clip(at, levels[0], levels[-1])
    below = np.clip(np.searchsorted(levels, held, side="right") - 1, 0, levels.size - 2)
    share = ((held - levels[below]) / (levels[below + 1] - levels[below]))[:, None, None, None]
    return np.asarray((1 - share) * values[:, below] + share * values[:, below + 1])


def with_rise(flow: OceanGrid, values: Array, levels: Array) -> RisingOceanGrid:
    """Return a flow with a vertical part, of values (times, levels, ni, nj, 4) [m/s]."""
    level_slot, slots_per_z = slots(levels)
    new = {"values": np.ascontiguousarray(values), "levels": levels, "level_slot": level_slot}
    rise = float(np.abs(values[..., 2]).max()) * (1 + 1e-12)
    kept = flow._asdict()
    del kept["ladder"]
    return RisingOceanGrid(**kept | new | {"slots_per_z": slots_per_z, "max_rise": rise})


def _places(frame: LocalFrame, grid: Grid) -> Array:
    """Return the points of a grid in the frame, (ni, nj, 2) [m]."""
    lon, lat = (part.T for part in grid.mesh())
    return np.stack(frame.to_local(lon, lat), axis=-1)


def divergence(values: Array, place: Array) -> Array:
    """Return du/dx + dv/dy [1/s] of values (..., ni, nj, 2) [m/s] on a grid of any shape (ni, nj, 2) [m].

    div = (d(u y_j - v x_j)/di + d(v x_i - u y_i)/dj) / (x_i y_j - x_j y_i), central differences.
    """
    (x_i, y_i), (x_j, y_j) = (np.moveaxis(np.gradient(place, axis=n), -1, 0) for n in range(2))
    u, v = values[..., 0], values[..., 1]
    along = np.gradient(u * y_j - v * x_j, axis=-2)
    across = np.gradient(v * x_i - u * y_i, axis=-1)
    return np.asarray((along + across) / (x_i * y_j - x_j * y_i))


def _risen(flow: OceanGrid, place: Array, wet: Bools) -> Array:
    """Return w (times, levels, ni, nj) [m/s], 0 in dry cells; `wet` (levels, ni, nj)."""
    spread = divergence(np.where(wet[None, ..., None], flow.values, 0.0), place)
    w, levels = np.zeros_like(spread), flow.levels
    top = levels.size - 1
    w[:, top] = spread[:, top] * max(-levels[top], 0.0)
    for k in range(top - 1, -1, -1):
        w[:, k] = w[:, k + 1] + 0.5 * (spread[:, k] + spread[:, k + 1]) * (levels[k + 1] - levels[k])
    return np.where(wet, w, 0.0)


def _risen_on_half(flow: OceanGrid, place: Array, wet: Bools) -> Array:
    """Return the same from every other point."""
    half = flow._replace(values=flow.values[:, :, ::2, ::2])
    return _risen(half, place[::2, ::2], wet[:, ::2, ::2])


def _rms(values: Array, where: NDArray[np.bool_]) -> float:
    """Return the root mean square over the cells (levels, ni, nj) that are marked; NaN without any."""
    chosen = values[:, where]
    return float(np.sqrt((chosen**2).mean())) if chosen.size else float("nan")


def _told_bottom(flow: OceanGrid, place: Array, seabed: Seabed, w: Array) -> str:
    """Return what w misses at the seabed, where water follows the slope: w = u . grad bottom."""
    ends = np.isfinite(seabed.ground) & (seabed.ground < 0.0) & (seabed.ground > flow.levels[0])
    if ends.sum() < FEWEST:
        return ""
    level = np.clip(np.searchsorted(flow.levels, seabed.bottom), 0, flow.levels.size - 1)
    i, j = np.nonzero(ends)
    lowest = level[i, j]
    (x_i, y_i), (x_j, y_j) = (np.moveaxis(np.gradient(place, axis=n), -1, 0) for n in range(2))
    ground = np.where(np.isfinite(seabed.ground), np.minimum(seabed.ground, 0.0), flow.levels[0])
    by_i, by_j = np.gradient(ground)
    area = x_i * y_j - x_j * y_i
    slope_x, slope_y = (by_i * y_j - by_j * y_i) / area, (by_j * x_i - by_i * x_j) / area
    u, v = flow.values[:, lowest, i, j, 0], flow.values[:, lowest, i, j, 1]
    off = w[:, lowest, i, j] - u * slope_x[i, j] - v * slope_y[i, j]
    missed = float(np.sqrt((off**2).mean()))
    return f"; at {ends.sum():,} bottoms it misses the flow along the slope by rms {missed:.2g} m/s"
