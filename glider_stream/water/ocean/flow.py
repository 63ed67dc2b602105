"""Makes what the kernels read from currents on a grid: an `OceanGrid` and the `Seabed` below it."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import Array, Bools
from ...base.checks import Range
from ...base.errors import InputError
from ...base.settings import require
from ...kernels.flow import Extent, OceanGrid, velocities
from ...kernels.terrain import Seabed, allowed
from ..frame import MAX_SCALE_ERROR, LocalFrame
from .file import OceanFile, Times, parse_time
from .grid import EVEN, Grid, IndexMap, gaps, index_map, span, unbroken
from .ladder import ladder_of
from .levels import no_such_levels

READ_BEYOND = 2
"""This many cells are kept around a domain, since paths may leave it a little."""
HALO = 2
"""This many further cells fill the dry cells of the margin: values must not depend on the domain's ends."""
DEPTH_SLACK = 0.01
"""The deepest level also holds this far [m] below itself, because depths in files are rounded."""


def levels_for(name: str, axis: Array | None, depth: Range, top: float = 0.0) -> slice:
    """Return the levels that a domain's depths [m] need; the first level if there is no axis.

    InputError if the domain is deeper than the last level or begins above `top` [m], where the first level begins
    to hold.
    """
    if axis is None:
        return slice(0, 1)
    refusal = no_such_levels(name, axis, depth, top)
    if refusal is not None:
        raise refusal
    if axis.size == 1:
        return slice(0, 1)
    needed = span(axis, depth, 0)
    return slice(needed.start, needed.stop + 1)


def slots(points: Array) -> tuple[NDArray[np.uintp], float]:
    """Return a table from even slots to the cells of uneven points, and the number of slots per unit."""
    per_unit = 1 / float(np.diff(points).min())
    count = int(np.ceil((points[-1] - points[0]) * per_unit)) + 1
    starts = points[0] + np.arange(count) / per_unit
    below = np.searchsorted(points, starts, side="right") - 1
    return np.clip(below, 0, points.size - 2).astype(np.uintp), per_unit


def filled(values: Array) -> Array:
    """Return values (levels, ni, nj, 2) without NaN: from wet neighbours, else the level above, else 0.

    Levels go downward. Interpolation beside a coast reads these cells, and zeros there would slow open water. The
    terrain keeps gliders out of them.
    """
    values = values.copy()
    for _ in range(HALO):
        dry = np.isnan(values[..., 0])
        if not dry.any():
            return values
        ni, nj = dry.shape[1:]
        known = np.pad(~dry, ((0, 0), (1, 1), (1, 1))).astype(np.float64)
        held = np.pad(np.where(dry[..., None], 0.0, values), ((0, 0), (1, 1), (1, 1), (0, 0)))
        around = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
        count = sum(known[:, i : i + ni, j : j + nj] for i, j in around)
        total = sum(held[:, i : i + ni, j : j + nj] for i, j in around)
        reach = dry & (np.asarray(count) > 0)
        values[reach] = np.asarray(total)[reach] / np.asarray(count)[reach][:, None]
    for k in range(1, len(values)):
        values[k] = np.where(np.isnan(values[k]), values[k - 1], values[k])
    return np.nan_to_num(values)


def data_end(depth: Array) -> float:
    """Return the depth [m] to which the last level holds if its column has data there: half a level further."""
    return max(2 * float(depth[0]), 1.0) if depth.size == 1 else float(depth[-1] + (depth[-1] - depth[-2]) / 2)


def closed_below(wet: Bools, depth: Array, lower: Array, seabed: Array) -> Array:
    """Return the height [m] below which columns of `wet` (nz, ...) levels have no data.

    0 where the top level is dry, -inf where the data go on to the `seabed` [m, downward]. `lower` [m]: the depth
    down to which each level holds.
    """
    count = np.cumprod(wet, axis=0).sum(axis=0)
    following = np.append(depth, np.inf)[count]
    last = np.append(lower[:-1], max(float(lower[-1]), data_end(depth)))[np.maximum(count, 1) - 1]
    to_seabed = (count < len(wet)) & (following > seabed)
    return np.where(count == 0, 0.0, np.where(to_seabed, -np.inf, -(last + DEPTH_SLACK * (count < len(wet)))))


def _assemble(
    values: Array,
    levels: Array,
    times: Array | None,
    at: IndexMap,
    ground: Array,
    closed: Array,
    spacing: float,
    clearance: float,
) -> tuple[OceanGrid, Seabed]:
    """Return the flow and the seabed from values (times, levels, ni, nj, 2) without NaN; levels rise.

    A single level or time is doubled. `ground` (ni, nj): height of the seabed [m], -inf where unknown. `closed`
    (ni, nj): height [m] below which there are no data.
    """
    span = (-np.inf, np.inf) if times is None else (float(times[0]), float(times[-1]))
    if times is None:
        times, values = np.array([0.0, 1.0]), np.repeat(values, 2, axis=0)
    if levels.size == 1:
        levels, values = levels[0] + np.array([-1.0, 0.0]), np.repeat(values, 2, axis=1)
    level_slot, slots_per_z = slots(levels)
    time_slot, slots_per_t = slots(times)
    flow = OceanGrid(
        values=np.ascontiguousarray(values),
        levels=levels,
        level_slot=level_slot,
        slots_per_z=slots_per_z,
        times=times,
        time_slot=time_slot,
        slots_per_t=slots_per_t,
        index_map=at.index_map,
        per_x=at.per_x,
        per_y=at.per_y,
        ladder=ladder_of(values, levels, None if np.isinf(span[0]) else times, spacing),
        extent=Extent(
            *(at.x_lo, at.x_hi, at.y_lo, at.y_hi),
            *span,
            # every read value is a weighted mean of nodes
            max_speed=float(np.sqrt((values**2).sum(axis=-1).max())) * (1 + 1e-12),
            length_scale=spacing,
        ),
    )
    bottom, ground = (np.ascontiguousarray(part) for part in (np.maximum(ground, closed), ground))
    return flow, Seabed(bottom, clearance, at.index_map, at.per_x, at.per_y, at.x_lo, at.y_lo, ground)


def _seconds(file: OceanFile, epoch: str | np.datetime64 | None) -> tuple[slice, Array | None]:
    """Return which times a plan that starts at the epoch can read, and these times in seconds from the epoch."""
    if isinstance(epoch, str):
        epoch = parse_time(epoch, "`flow.epoch`")
    if file.times is None or file.steady:
        return slice(0, 1), None
    require(
        epoch is not None,
        f"`flow.epoch` is missing: {file.name} changes with time, {file.time_range}; say when t = 0 is",
    )
    assert epoch is not None
    when = f"`flow.epoch` = {epoch.astype('datetime64[s]')}Z"
    within = bool(file.times[0] <= epoch <= file.times[-1])
    require(within, f"{when} lies outside the times of {file.name}, {file.time_range}; choose one of these")
    seconds = (file.times - epoch) / np.timedelta64(1, "s")
    run, gap = unbroken_times(file.times, epoch)
    require(
        bool(seconds[run.start] <= 0 <= seconds[run.stop - 1]) and run.stop - run.start > 1,
        f"{when} lies in a gap of {file.name}: {gap}; choose another time",
    )
    first = min(int(np.searchsorted(seconds[: run.stop], 0, side="right")) - 1, run.stop - 2)
    return slice(first, run.stop), seconds[first : run.stop]


def unbroken_times(times: Times, when: np.datetime64) -> tuple[slice, str]:
    """Return the run of times without gaps that holds a moment, or the nearest run, and a text on the gaps."""
    since = (times - times[0]) / np.timedelta64(1, "s")
    breaks = np.flatnonzero(gaps(since))
    listed = " and ".join(
        f"{times[n].astype('datetime64[s]')}Z to {times[n + 1].astype('datetime64[s]')}Z" for n in breaks
    )
    run, _ = unbroken(since, float((when - times[0]) / np.timedelta64(1, "s")))
    return run, f"no data from {listed}"


def _build(
    file: OceanFile,
    frame: LocalFrame,
    lon: Range,
    lat: Range,
    depth: Range,
    epoch: str | np.datetime64 | None,
    margin: int = READ_BEYOND,
) -> tuple[OceanGrid, Seabed, Grid]:
    during, seconds = _seconds(file, epoch)
    cut = file.grid.cut(file.name, lon, lat, frame.lon, READ_BEYOND + HALO)
    levels = levels_for(file.name, None if file.surface else file.depth, depth, file.top)
    depths = file.depth[levels]
    lons, lats = (part.T for part in cut.grid.mesh())
    turn = frame.convergence(lons, lats)
    cos, sin = np.cos(turn), np.sin(turn)

    # once the dry cells are filled the halo is dropped; at the file's edge there is no halo
    kept = cut.grid.cut(file.name, lon, lat, frame.lon, margin)
    kept_i, kept_j = slice(int(kept.columns[0]), int(kept.columns[-1]) + 1), kept.rows
    count = file.u[during].shape[0]
    values = np.empty((count, depths.size, kept.grid.shape[1], kept.grid.shape[0], 2))
    wet = np.ones((file.depth.size, *lons.shape), dtype=bool)
    for n in range(count):
        here = np.s_[during.start + n, :, cut.rows, :]
        east_north = [
            part[here][..., cut.columns].transpose(0, 2, 1).astype(np.float64) for part in (file.u, file.v)
        ]
        wet &= np.isfinite(east_north[0])
        u, v = (part[levels] for part in east_north)
        turned = np.stack([u * cos - v * sin, u * sin + v * cos], axis=-1)
        values[n] = filled(turned)[::-1, kept_i, kept_j]
    kept_wet = wet[:, kept_i, kept_j]
    depth_of = file.seabed[cut.rows][:, cut.columns].T[kept_i, kept_j]
    ground = np.where(depth_of > 0, -(depth_of + DEPTH_SLACK), 0.0)
    if file.surface:
        closed = np.where(kept_wet[0], -np.inf, 0.0)
    else:
        closed = closed_below(kept_wet, file.depth, file.lower, depth_of)
    along, across = kept.grid.cell_sizes()
    flow, seabed = _assemble(
        values,
        -depths[::-1],
        seconds,
        index_map(frame, kept.grid),
        ground,
        closed,
        float(min(along.min(), across.min())),
        0.0,
    )
    return flow, seabed, kept.grid


def ocean_flow(
    file: OceanFile, frame: LocalFrame, lon: Range, lat: Range, depth: Range, epoch: str | None = None
) -> tuple[OceanGrid, Seabed]:
    """Return the flow and the seabed of a domain, with a margin of two cells.

    `lon`, `lat` [degrees], `depth` [m]. t = 0 is at `epoch` (ISO 8601, UTC), which a file with several times
    needs. The bottom at a place is the bottom of the nearest column: `OceanFile.seabed`, or where its data end.
    The current of the top level is held above it; a file without depths is held at all depths.
    """
    return ocean_grounds(file, frame, lon, lat, depth, epoch)[:2]


def ocean_grounds(
    file: OceanFile, frame: LocalFrame, lon: Range, lat: Range, depth: Range, epoch: str | None = None
) -> tuple[OceanGrid, Seabed, Grid]:
    """Return the flow and the seabed of a domain (see `ocean_flow`), and their part of the file's grid."""
    require(0 <= depth[0] <= depth[1], f"the domain's depth must rise from 0 or below; got {list(depth)}")
    flow, seabed, grid = _build(file, frame, lon, lat, depth, epoch)
    error = frame.scale_error(lon, lat)
    require(
        error <= MAX_SCALE_ERROR,
        f"the domain is too wide for a flat frame, whose lengths would be wrong by {100 * error:.1f} %; make the "
        "domain smaller",
    )
    open_somewhere = bool((seabed.bottom < -depth[0]).any())
    require(
        open_somewhere,
        f"the domain holds no water in {file.name}: every column is land, or has no data; move the domain",
    )
    return flow, seabed, grid


def sample(
    file: OceanFile, lon: float, lat: float, depth: float | None = None, time: str | None = None
) -> tuple[float, float] | None:
    """Return the current (u_east, v_north) [m/s] that the planner reads, or None without water or data.

    Without `depth` [m] it is the surface's. `time` (ISO 8601, UTC) is needed if the file holds several times.
    """
    depth = 0.0 if depth is None else float(depth)
    require(bool(np.isfinite([lon, lat, depth]).all()), f"a point must be numbers; got {lon}, {lat}, {depth}")
    require(abs(lat) <= 90, f"a latitude must be within [-90, 90] degrees; got {lat:g}")
    require(depth >= 0, f"a depth counts downward from the surface, 0 or more; got {depth:g}")
    when = None if time is None else parse_time(time, "a point's time")
    if not file.steady:
        assert file.times is not None
        require(when is not None, f"{file.name} holds several times, {file.time_range}: give each point its time")
        assert when is not None
        if not file.times[0] <= when <= file.times[-1]:
            return None
        run, _ = unbroken_times(file.times, when)
        if not file.times[run.start] <= when <= file.times[run.stop - 1]:
            return None
        first = int(np.searchsorted(file.times, when, side="right")) - 1
        during = slice(first, first + (1 if file.times[first] == when else 2))
        # a gap at another time does not matter here
        file = replace(file, times=file.times[during], u=file.u[during], v=file.v[during])
    place = file.grid.nearest_place(lon, lat)
    if place is None:
        return None
    at_lon, at_lat = place
    if not file.surface:
        if not file.top - DEPTH_SLACK <= depth <= file.depth[-1] + DEPTH_SLACK:
            return None
        depth = min(max(depth, file.top), float(file.depth[-1]))
    frame = LocalFrame(at_lon, at_lat)
    flow, seabed, _ = _build(file, frame, (at_lon, at_lon), (at_lat, at_lat), (depth, depth), when, margin=0)
    x, y = (float(part) for part in frame.to_local(at_lon, at_lat))
    if not allowed(seabed, x, y, -depth):
        return None
    zero = np.zeros(1)
    u, v = velocities(flow, zero + x, zero + y, zero - depth, zero)[0]
    turn = float(frame.convergence(at_lon, at_lat))
    return float(u * np.cos(turn) + v * np.sin(turn)), float(v * np.cos(turn) - u * np.sin(turn))


def _rising(axis: Any, what: str, even: bool) -> tuple[Array, int]:
    """Return the rising axis, and -1 if it had to be reversed, else 1."""
    axis = np.atleast_1d(np.asarray(axis, dtype=np.float64))
    require(axis.ndim == 1 and bool(np.isfinite(axis).all()), f"`{what}` must be a line of numbers")
    turn = -1 if axis.size > 1 and axis[0] > axis[-1] else 1
    steps = np.diff(axis[::turn])
    require(bool((steps > 0).all()), f"`{what}` must rise or fall steadily; got {axis.size} values that do not")
    if even:
        require(axis.size > 1, f"`{what}` must hold at least two values; got {axis.size}")
        require(float(np.ptp(steps)) <= EVEN * float(steps.mean()), f"`{what}` must be evenly spaced")
    return axis[::turn], turn


def grid_flow(
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike,
    u: ArrayLike,
    v: ArrayLike,
    t: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    clearance: float = 0.0,
) -> tuple[OceanGrid, Seabed]:
    """Return flow and seabed from arrays on an even metric grid: x (nx), y (ny), z (nz) [m, upward], t (nt) [s].

    u, v [m/s] have the shape (nt, nz, ny, nx), or (nz, ny, nx) if steady. There is no water where they are NaN or
    where `mask` (ny, nx) or (nz, ny, nx) is True. The bottom is the deepest level with water; if that is the last
    level, data end half a level below it. A single level is held at all depths, and then the water has no bottom.
    """
    (x, turn_x), (y, turn_y), (z, turn_z) = (
        _rising(x, "x", True),
        _rising(y, "y", True),
        _rising(z, "z", False),
    )
    times = None if t is None else _rising(t, "t", False)[0]
    shape = (1 if times is None else times.size, z.size, y.size, x.size)
    parts = []
    for name, part in (("u", u), ("v", v)):
        part = np.asarray(part, dtype=np.float64)
        part = part[None] if part.ndim == 3 else part
        require(part.shape == shape, f"`{name}` must have the shape (times, z, y, x) = {shape}; got {part.shape}")
        parts.append(part)
    values = np.stack(parts, axis=-1)
    require(not np.isinf(values).any(), "`u` and `v` must be finite, or NaN where there is no water; got inf")
    if mask is not None:
        try:
            dry = np.broadcast_to(np.asarray(mask, dtype=bool), shape[1:])
        except ValueError:
            raise InputError(f"`mask` must have the shape {shape[1:]}; got {np.shape(mask)}") from None
        values = np.where(dry[None, ..., None], np.nan, values)
    values = np.where(np.isnan(values).any(axis=-1, keepdims=True), np.nan, values)
    # (times, z, y, x, 2) -> (times, levels downward, ni, nj, 2)
    values = values[:, ::turn_z, ::turn_y, ::turn_x][:, ::-1].transpose(0, 1, 3, 2, 4)
    if times is not None and np.asarray(t).ravel()[0] > times[0]:
        values = values[::-1]
    wet = np.isfinite(values[..., 0]).all(axis=0)
    require(bool(wet[0].any()), "the grid holds no water: `u` and `v` are NaN or masked in every column")
    levels = -z[::-1]
    count = np.cumprod(wet, axis=0).sum(axis=0)
    deepest = np.append(levels, np.inf)[np.where(count == len(wet), len(wet), count - 1)]
    ground = np.where(count > 0, -deepest, 0.0)
    closed = np.where(wet[0], -np.inf, 0.0) if z.size == 1 else closed_below(wet, levels, levels, deepest)
    corner = np.array([[[0, 0], [0, y.size - 1]], [[x.size - 1, 0], [x.size - 1, y.size - 1]]], dtype=np.float64)
    width, height = float(x[-1] - x[0]), float(y[-1] - y[0])
    box = (float(x[0]), float(x[-1]), float(y[0]), float(y[-1]))
    at = IndexMap(corner, 1 / width, 1 / height, *box, error=0.0)
    full = np.stack([filled(step)[::-1] for step in values])
    spacing = min(width / (x.size - 1), height / (y.size - 1))
    moments = None if times is None or times.size == 1 else times
    return _assemble(full, z, moments, at, ground, closed, spacing, clearance)
