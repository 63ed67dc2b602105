"""Joins the parts of one or several files: u and v on one grid, toward true east and north."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array, Bools
from ...base.errors import InputError
from ...base.nearest import tree_of
from ...base.settings import require
from .file import OceanFile, Times
from .grid import Grid, grid_of, unit_vectors
from .land import Evidence, both_still, mark_land
from .levels import Levels, check_hold
from .names import WORDS, Names
from .part import Field, Part
from .stagger import AGREES, collocated, half_a_cell_on, row_angle, same_points, turned

Values = NDArray[np.float32]
LITTLE = math.radians(0.1)
"""A grid that is rotated by less than this [rad] counts as not rotated: 0.5 mm/s in 0.3 m/s."""


def _same(a: NDArray[Any] | None, b: NDArray[Any] | None) -> bool:
    if a is None or b is None:
        return a is b
    if a.shape != b.shape:
        return False
    if a.dtype.kind == "M":
        return bool((a == b).all())
    return bool(np.allclose(a, b, rtol=0, atol=1e-3 * float(np.diff(a).min(initial=1.0))))


def stacked(name: str, parts: list[Part]) -> Part:
    """Return the parts of one component joined in time."""
    first = parts[0]
    for part in parts[1:]:
        same = _same(part.levels.depth, first.levels.depth) and same_points(part.grid.mesh(), first.grid.mesh())
        require(
            same,
            f"{name}: the currents are on different points ({_extent(first.grid)}, and {_extent(part.grid)}); "
            "bring them onto one grid first",
        )
    if len(parts) == 1:
        return first
    known = [part.times for part in parts if part.times is not None]
    require(
        len(known) == len(parts),
        f"{name}: each of several files must hold its time, and at least one does not; if each holds one step, "
        "set `origin` (the date of the first) and `step` (the hours from file to file) in `names`",
    )
    times, values = np.concatenate(known), np.concatenate([part.values for part in parts])
    rank = np.argsort(times, kind="stable")
    notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
    deeper = first.deeper
    for part in parts[1:]:
        if deeper is not None and part.deeper is not None:
            deeper = np.where(np.abs(part.deeper) > np.abs(deeper), part.deeper, deeper)
    return replace(first, times=times[rank], values=values[rank], notes=notes, deeper=deeper)


def joined(paths: list[Path], parts: list[Part], names: Names) -> OceanFile:
    """Return the currents of all parts: in the order of time, u and v on one grid, toward east and north."""
    name = paths[0].name if len(paths) == 1 else f"{paths[0].name} and {len(paths) - 1} more"
    east, north = _east_and_north(name, parts)
    moments = stamped(name, east.times, names)
    levels = _levels_of_both(name, east, north)
    notes = list(dict.fromkeys(note for part in (east, north) for note in part.notes))
    grid, u, v, deeper, more = _together(name, east, north, names)
    notes += more

    missing = np.isnan(u) | np.isnan(v)
    u[missing] = v[missing] = np.nan
    depth = _model_depth(east, north, grid)
    known = None if depth is None else np.isfinite(depth)
    if depth is not None and names.zeros != "calm":
        _clear_under(depth, levels, u, v)
    zeros = both_still(east.zeros, north.zeros)
    found = mark_land(name, u, v, deeper, zeros, known, names.zeros)
    notes += found
    data = np.isfinite(u)
    wet, ever = np.asarray(data.all(axis=0)), np.asarray(data.any(axis=0))
    require(
        bool(ever.any()), f"{name} holds no current at all: every value is missing or zero; give another file"
    )
    if (gaps := int((ever & ~wet).sum())) > 0:
        notes.append(
            f"{100 * gaps / ever.sum():.1f} % of the wet points have gaps in time; plans keep out of these"
        )
    surface = levels.depth is None or check_hold(name, names.hold, levels)
    notes += _held(levels, moments, surface)
    seabed, mismatch = _seabed(ever, deeper, levels, depth, surface)
    notes += mismatch
    merged = {key: what for part in (north, east) for key, what in part.took.items()}
    took = {key: merged[key] for key in ("u", "v", *WORDS) if key in merged}
    took |= _assumed(east, levels, depth, surface, missing, zeros, found)
    return OceanFile(
        name,
        grid,
        np.zeros(1) if levels.depth is None or surface else levels.depth,
        moments,
        u,
        v,
        wet,
        surface,
        took,
        tuple(dict.fromkeys(notes)),
        seabed,
        np.array([np.inf]) if levels.lower is None or surface else levels.lower,
        0.0 if surface else levels.top,
    )


def _east_and_north(name: str, parts: list[Part]) -> tuple[Part, Part]:
    """Return the currents toward east and toward north, each of all its parts; their times are the same."""
    both = []
    for component, toward in (("u", "east"), ("v", "north")):
        matching = [part for part in parts if part.component == component]
        require(len(matching) > 0, f"{name} holds no current toward {toward}; also name the file that does")
        both.append(stacked(name, matching))
    east, north = both
    require(
        _same(east.times, north.times),
        f"{name}: east and north currents are given at different times; give both at the same times",
    )
    return east, north


def _held(levels: Levels, moments: Times | None, surface: bool) -> list[str]:
    """Return notes on currents that are held at all depths, or at all times."""
    notes = []
    if levels.depth is None:
        notes.append("the file has no depth: its current is taken as the surface's and held at all depths")
    elif surface:
        notes.append(f"its one level, at {levels.depth[0]:g} m, is held at all depths, as you say")
    if moments is None or moments.size == 1:
        notes.append("a single time: the current is taken as steady")
    return notes


def _assumed(
    east: Part,
    levels: Levels,
    depth: Array | None,
    surface: bool,
    missing: NDArray[np.bool_],
    zeros: Evidence,
    found: list[str],
) -> dict[str, str]:
    """Return short texts on what was assumed about bottom, land, levels and times."""
    field = east.fields.get("seabed")
    if depth is not None and field is not None:
        bottom = f"the model's depth `{field.name}`"
    elif surface:
        bottom = "unknown: the current of one level is held at all depths"
    else:
        bottom = f"{levels.bottom}, unknown where they go on to the last level"
    ways = []
    if zeros.masked:
        ways.append("a mask of the file")
    if missing.any():
        ways.append("missing values")
    ways += [
        f"zeros ({'land' if 'as land' in note else 'seabed'})"
        for note in found
        if "taken as land" in note or "taken as seabed" in note or "are land, as you say" in note
    ]
    extent = "the surface, held at all depths" if levels.depth is None else levels.extent
    if surface and levels.depth is not None:
        extent = f"{levels.depth[0]:g} m, held at all depths, as you say"
    return {
        "bottom": bottom,
        "land": ", ".join(ways) or "none: every point has data",
        "levels": extent,
        "stamps": east.took.get("stamps", ""),
    }


def stamped(name: str, times: Times | None, names: Names) -> Times | None:
    """Return the times, moved to the middle of their intervals if the user sets `stamps`.

    InputError if a time repeats.
    """
    if times is None or times.size < 2:
        require(
            names.stamps is None or names.stamps == "middle",
            f"`stamps` = {names.stamps!r} needs two times to tell the interval of {name}, which has fewer",
        )
        return times
    again = times[1:][np.diff(times) <= np.timedelta64(0, "ms")]
    require(
        again.size == 0,
        f"{name}: the time {again[:1]} is given more than once; leave out the overlap, or, if "
        "these files are members of an ensemble, name one of them",
    )
    steps = np.diff(times)
    if names.stamps == "start":
        return np.asarray(times + np.append(steps, steps[-1]) // 2)
    if names.stamps == "end":
        return np.asarray(times - np.append(steps[:1], steps) // 2)
    return times


def _levels_of_both(name: str, east: Part, north: Part) -> Levels:
    """Return the levels of both components; InputError if they differ."""
    if _same(east.levels.depth, north.levels.depth):
        return east.levels
    raise InputError(f"{name}: the currents are given at different depths; bring them onto the same levels first")


def _together(
    name: str, east: Part, north: Part, names: Names
) -> tuple[Grid, Values, Values, tuple[Values, Values] | None, list[str]]:
    """Return the grid, u and v toward true east and north, the same for the levels below, and notes."""
    grid, u, v, staggered = _on_one_grid(name, east, north, names)
    notes = ["u and v lie on different points (a C-grid): brought to the cells' centres"] if staggered else []
    u, v, more = _toward_east(name, grid, east, north, u, v, staggered)
    deeper = None
    if east.deeper is not None and north.deeper is not None:
        below = replace(east, values=east.deeper), replace(north, values=north.deeper)
        _, down_u, down_v, _ = _on_one_grid(name, *below, names)
        down_u, down_v, _ = _toward_east(name, grid, *below, down_u, down_v, staggered)
        gone = np.isnan(down_u) | np.isnan(down_v)
        deeper = np.where(gone, np.float32(np.nan), down_u), np.where(gone, np.float32(np.nan), down_v)
    return grid, u, v, deeper, notes + more


def _model_depth(east: Part, north: Part, grid: Grid) -> Array | None:
    """Return the model's own depth (ny, nx) [m, downward] at the grid's points, NaN where it is unknown."""
    first, second = east.fields.get("seabed"), north.fields.get("seabed")
    if first is None:
        return None
    if east.levels.sigma is not None:
        return _seabed_at(first, second, grid)
    return first.least(*grid.mesh())


def _clear_under(depth: Array, levels: Levels, u: Values, v: Values) -> None:
    """NaN, in place, where u, v (nt, nz, ny, nx) are 0 below the depth (ny, nx) [m] that the model has.

    Read between levels, such zeros would slow the water above the seabed.
    """
    if levels.depth is None or levels.sigma is not None:
        return
    still = ((u == 0) & (v == 0)).all(axis=0)
    under = still & (levels.depth[:, None, None] > depth)
    u[:, under] = v[:, under] = np.nan


def _seabed(
    ever: Bools, deeper: tuple[Values, Values] | None, levels: Levels, depth: Array | None, surface: bool
) -> tuple[Array, list[str]]:
    """Return the depth of the seabed (ny, nx) [m], inf where unknown, and notes.

    It is the model's own depth, else the depth of the deepest level with data.
    """
    wet = ever if deeper is None else np.concatenate([ever, np.isfinite(deeper[0][0])])
    count = np.cumprod(wet, axis=0).sum(axis=0)
    if surface or levels.every is None:
        found = np.where(count > 0, np.inf, 0.0)
    else:
        found = np.where(count == len(wet), np.inf, levels.every[np.maximum(count, 1) - 1])
        found = np.where(count > 0, found, 0.0)
    if depth is None:
        return found, []
    if levels.sigma is not None:
        # even a part of the levels says how deep the sea is
        return np.where((count > 0) | (np.isfinite(depth) & ~levels.sigma.whole), depth, 0.0), []
    unlike = (count > 0) & np.isnan(depth)
    notes = []
    if unlike.any():
        notes.append(
            f"{int(unlike.sum())} columns have currents but no depth of the model: bottom by their levels"
        )
    return np.where((count > 0) & np.isfinite(depth), depth, found), notes


def _on_one_grid(name: str, east: Part, north: Part, names: Names) -> tuple[Grid, Values, Values, bool]:
    """Return the grid, u and v at the same points, and whether they were moved there."""
    u_at, v_at = east.grid.mesh(), north.grid.mesh()
    if names.stagger == "nemo":
        require(
            east.grid.shape == north.grid.shape,
            f"{name}: u and v have different shapes, so `stagger` cannot be nemo; leave it out",
        )
        lon, lat, u, v = half_a_cell_on(u_at, east.values, north.values)
        return grid_of(lon, lat), u, v, True
    if same_points(u_at, v_at):
        apart = {"depthu", "depthv"} <= {east.levels.name.lower(), north.levels.name.lower()}
        if apart and names.stagger is None:
            raise InputError(
                f"`{east.variable}`, `{north.variable}` of {name} are of a staggered grid (depthu, depthv), "
                'but at the same longitudes: set `stagger` in `names`, "nemo" if these longitudes are of the '
                "cells' centres, "
                '"none" if u and v were both moved there'
            )
        return east.grid, east.values, north.values, False
    lon, lat, u, v = collocated(name, u_at, v_at, east.values, north.values)
    return grid_of(lon, lat), u, v, True


def _toward_east(
    name: str, grid: Grid, east: Part, north: Part, u: Values, v: Values, staggered: bool
) -> tuple[Values, Values, list[str]]:
    """Return u and v rotated to east and north if they run along the grid, and notes.

    InputError if the file does not say along what they run.
    """
    ways = {east.way, north.way}
    lon, lat = grid.mesh()
    along = staggered or "grid" in ways
    if ways == {"east"} and not staggered:
        return u, v, []
    angle = row_angle(name, lon, lat, east.signs) if along or "unsure" in ways else np.zeros(lon.shape)
    field = east.fields.get("angle") or north.fields.get("angle")
    given = None if field is None else field.at(lon, lat)
    if given is not None and field is not None:
        # the angle on land is often zero and does not matter
        off = np.abs(np.angle(np.exp(1j * (given - angle))))[np.isfinite(u).any(axis=(0, 1))]
        require(
            off.size == 0 or float(np.quantile(off, 0.95)) < AGREES,
            f"`{field.name}` of {name} is not the angle from east to the grid's rows; it differs by up to "
            f"{math.degrees(float(off.max(initial=0))):.0f} degrees: set `rotate` in `names`, "
            '"grid" to follow the rows',
        )
        angle = given
    most = float(np.abs(angle).max())
    if most < LITTLE:
        return u, v, []
    if ways == {"east"} or ("unsure" in ways and not along and given is None):
        raise InputError(
            f"`{east.variable}` and `{north.variable}` of {name} do not say whether they run toward east and "
            f"north or along the grid's rows, which leave east by up to {math.degrees(most):.0f} degrees: "
            'set `rotate` in `names`, "none" or "grid"'
        )
    by = "the grid's own geometry" if given is None or field is None else f"`{field.name}`"
    u, v = turned(u, v, angle)
    return u, v, [f"rotated to true east and north by {by}, by up to {math.degrees(most):.1f} degrees"]


def _seabed_at(first: Field, second: Field | None, grid: Grid) -> Array:
    """Return the model's own depth at the grid's points: the mean of the depths at the components beside them."""
    lon, lat = grid.mesh()
    found = []
    for field in (first, second):
        if field is None:
            continue
        tree = tree_of(unit_vectors(field.lon, field.lat))
        off, near = map(np.asarray, tree.query(unit_vectors(lon, lat).reshape(-1, 3), k=2))
        # the point itself, or the two that it lies between
        exact = off[:, 0] < 0.1 * off[:, 1]
        value = np.where(exact, field.values[near[:, 0]], field.values[near].mean(axis=1))
        found.append(value.reshape(lon.shape))
    return np.asarray(np.nanmean(found, axis=0))


def _extent(grid: Grid) -> str:
    (west, east), (south, north) = grid.bounds
    return f"lon {west:.6g} to {east:.6g}, lat {south:.6g} to {north:.6g}"
