"""Axes of ocean files: checks degrees and depths and brings them into one form."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array, Index
from ...base.errors import InputError
from ...base.settings import require
from ..frame import wrapped
from .grid import gaps
from .names import WORDS, Names, standard_name, units_of
from .units import in_metres

MOST_POINTS = 100_000_000
"""A grid may have at most this many points."""
MOST_ALIKE = 4
"""So many points of a grid that is folded or closed around the globe may lie at one place."""


def degrees(name: str, variable: Any, kind: str) -> tuple[Array, Index]:
    """Return a rising axis with each longitude once, and the indices of its values in the file."""
    subject = f"the {WORDS[kind]} `{variable.name}` in {name}"
    require(variable.size <= MOST_POINTS, f"{subject} claims {variable.size:,} points; cut the file")
    axis = np.asarray(variable.values, dtype=np.float64).ravel()
    require(
        bool(np.isfinite(axis).all()),
        f"{subject} has missing values; mend them, or set another `{kind}` in `names`",
    )
    order = np.arange(axis.size)
    axis = _signed(subject, variable, np.degrees(axis) if _is_radian(variable) else axis)
    if axis.size > 1 and bool(np.median(np.diff(axis)) < 0):
        axis, order = axis[::-1], order[::-1]
    if kind == "lon":
        axis, order = _once_around(axis, order)
    else:
        furthest = float(np.abs(axis).max(initial=0.0))
        cure = "mend it, or set another `lat` in `names`"
        require(furthest <= 90.001, f"{subject} reaches {furthest:g} degrees, beyond a pole; {cure}")
    cure = f"sort the file, or set another `{kind}` in `names`"
    require(bool((np.diff(axis) > 0).all()), f"{subject} does not rise or fall steadily; {cure}")
    return axis, order


WESTERN = {"lon": "west", "lat": "south"}
"""Where a coordinate may count to, against the convention."""


def _is_radian(variable: Any) -> bool:
    return units_of(variable).lower() in ("radian", "radians", "rad")


def told(variable: Any, kind: str) -> str:
    """The name of a longitude or latitude, and that it counts the other way, where it does."""
    turned = f", counted toward {WESTERN[kind]}: its sign is turned"
    return f"{variable.name}{turned if _is_turned(variable) else ''}"


def _is_turned(variable: Any) -> bool:
    """Whether a coordinate says that it counts toward west or south."""
    # a small s at the end is a plural
    return re.match(r"degrees?_?([Ww]est|[Ss]outh|W|S)$", units_of(variable)) is not None


def _signed(subject: str, variable: Any, values: Array) -> Array:
    """Degrees toward east or north; InputError where a sign contradicts the unit."""
    if not _is_turned(variable):
        return values
    units = units_of(variable)
    right = "degrees_east" if re.search(r"([Ww]est|W)$", units) else "degrees_north"
    require(
        not bool((values < 0).any()),
        f"{subject} is in {units!r} and goes down to {np.nanmin(values, initial=0.0):g}: if it counts toward the "
        f"other side, set its unit to {right!r}",
    )
    return np.asarray(-values)


def _same_for_both(at_lon: Array, at_lat: Array) -> NDArray[np.bool_]:
    """Points that hold one number for longitude and latitude, as several others do: a mark, and no place."""
    same = at_lon == at_lat
    marks, counts = np.unique(at_lon[same], return_counts=True)
    return np.asarray(same & np.isin(at_lon, marks[(counts > MOST_ALIKE) | ((marks == 0) & (counts > 1))]))


def _once_around(axis: Array, order: Index) -> tuple[Array, Index]:
    """Return longitudes that rise, without repeated values, and their indices; the seam is at the widest gap."""
    if axis.size < 3:
        return axis[0] + (axis - axis[0]) % 360, order
    # an axis that rises from end to end may span more than the circle; any other is read modulo 360
    rises = bool((np.diff(axis) > 0).all())
    axis = axis if rises else axis[0] + (axis - axis[0]) % 360
    # a repeated first point may round to either side of the full circle
    slack = 1e-3 * abs(axis[1] - axis[0])
    before = np.concatenate([[-np.inf], np.maximum.accumulate(axis)[:-1]])
    kept = (axis > before) & (axis < axis[0] + 360 - slack)
    away = np.abs((axis[~kept][:, None] - axis[kept] + 180) % 360 - 180).min(axis=1, initial=360.0)
    if (away > 0.01 * abs(axis[1] - axis[0])).any():
        # these values repeat no other value: the caller will find that the axis does not rise
        return axis, order
    axis, order = axis[kept], order[kept]
    steps = np.diff(axis)
    widest = int(steps.argmax()) if steps.size else 0
    if gaps(axis).any() and steps[widest] > axis[0] + 360 - axis[-1]:
        # a region about the date line whose longitudes were sorted from -180 to 180
        order = np.roll(order, -(widest + 1))
        axis = np.concatenate([axis[widest + 1 :], axis[: widest + 1] + 360])
    return axis, order


def places(name: str, lon: Any, lat: Any) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return longitude and latitude (ny, nx) of every point, and where the file gives no position.

    Models that leave out tiles of land write zeros or fill values there. Such points get positions that continue
    those around them, so that the grid stays regular.
    """
    size = lon.size
    require(size <= MOST_POINTS, f"the longitude `{lon.name}` in {name} claims {size:,} points; cut the file")
    at_lon, at_lat = (np.array(variable.values, dtype=np.float64) for variable in (lon, lat))
    if _is_radian(lon):
        at_lon, at_lat = np.degrees(at_lon), np.degrees(at_lat)
    missing = ~(np.isfinite(at_lon) & np.isfinite(at_lat)) | (np.abs(at_lat) > 90.001) | (np.abs(at_lon) > 1080)
    missing |= _same_for_both(at_lon, at_lat)
    for variable, values, kind in ((lon, at_lon, "longitude"), (lat, at_lat, "latitude")):
        values[~missing] = _signed(f"the {kind} `{variable.name}` in {name}", variable, values[~missing])
    require(
        float(missing.mean()) < 0.9,
        f"the places `{lon.name}` and `{lat.name}` in {name} are missing, or are not degrees, nearly everywhere; "
        "name other `lon` and `lat` in `names`",
    )
    if missing.any():
        middle = float(at_lon[~missing][0])
        at_lon = _continued(np.where(missing, np.nan, wrapped(at_lon, middle)))
        at_lat = np.clip(_continued(np.where(missing, np.nan, at_lat)), -90, 90)
    return at_lon, at_lat, missing


def _continued(values: Array) -> Array:
    """Replace NaN along rows, then along columns, by straight lines between known values and beyond them."""
    for axis in (1, 0):
        values = np.moveaxis(values, axis, -1)
        for row in values:
            known = np.flatnonzero(np.isfinite(row))
            if known.size < 2 or known.size == row.size:
                continue
            every = np.arange(row.size)
            filled = np.interp(every, known, row[known])
            first, last = known[:2], known[-2:]
            before, after = every < known[0], every > known[-1]
            filled[before] += (every[before] - first[0]) * np.diff(row[first])[0] / np.diff(first)[0]
            filled[after] += (every[after] - last[1]) * np.diff(row[last])[0] / np.diff(last)[0]
            row[:] = filled
        values = np.moveaxis(values, -1, axis)
    return values


def depths(name: str, variable: Any, names: Names) -> tuple[Array, Index, float, str]:
    """Return rising depths [m, downward], their indices in the file, the metres in its unit, and a text."""
    axis = np.atleast_1d(np.asarray(variable.values, dtype=np.float64)).ravel()
    subject = f"the depth `{variable.name}` in {name}"
    require(
        bool(np.isfinite(axis).all()),
        f"{subject} has missing values; mend them, or set another `depth` in `names`",
    )
    units = units_of(variable).lower()
    factor = in_metres(units)
    if factor is None:
        raise InputError(f"{subject} is in {units!r}, not in metres: convert it first")
    below, above = bool((axis <= 0).all()), bool((axis >= 0).all())
    require(
        below or above,
        f"{subject} runs from {axis.min():g} to {axis.max():g}, on both sides of the surface; mend it, or set "
        "another `depth` in `names`",
    )
    claim = names.positive or str(variable.attrs.get("positive", "")).strip().lower()
    if claim not in ("up", "down"):
        claim = "up" if standard_name(variable).startswith(("height", "altitude")) else ""
    sense = "up" if not above else "down" if not below else claim or "down"
    # heights above the seabed have the same signs, so the sign alone must not decide
    require(
        claim in ("", sense),
        f"{subject} is declared positive {claim}, but runs from {axis[0]:g} to {axis[-1]:g}: "
        f'if these are depths under the surface, set `positive` = "{sense}" in `names`',
    )
    axis, order = np.abs(axis) * factor, np.arange(axis.size)
    if axis.size > 1 and bool(axis[0] > axis[-1]):
        axis, order = axis[::-1], order[::-1]
    cure = "sort the file, or set another `depth` in `names`"
    require(bool((np.diff(axis) > 0).all()), f"{subject} does not rise or fall steadily; {cure}")
    return axis, order, factor, f"{variable.name}, positive {sense}"
