"""Axes of ocean files: degrees, depths and times, as they should be."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array
from ...base.errors import InputError
from ...base.settings import require
from ..frame import wrapped
from .names import WORDS, Names, standard_name
from .units import in_metres

MOST_POINTS = 100_000_000
"""Places of a curved grid that are looked at."""


def degrees(name: str, variable: Any, kind: str) -> tuple[Array, bool]:
    """The axis rising, without a last point that repeats the first, and whether it was turned."""
    broken = f"the {WORDS[kind]} `{variable.name}` in {name}"
    require(variable.size <= MOST_POINTS, f"{broken} claims {variable.size:,} points; cut the file")
    axis = np.asarray(variable.values, dtype=np.float64).ravel()
    require(bool(np.isfinite(axis).all()), f"{broken} has missing values")
    if str(variable.attrs.get("units", "")).strip().lower() in ("radian", "radians", "rad"):
        axis = np.degrees(axis)
    turned = axis.size > 1 and bool(np.median(np.diff(axis)) < 0)
    axis = axis[::-1] if turned else axis
    if kind == "lon":
        axis = axis[0] + (axis - axis[0]) % 360
        # a cyclic point rounds to either side of the full circle
        cyclic = axis.size > 2 and bool(axis[-1] < axis[1] - 1e-3 * abs(axis[1] - axis[0]))
        axis = axis[:-1] if cyclic else axis
    else:
        require(bool((np.abs(axis) <= 90.001).all()), f"{broken} reaches beyond 90 degrees")
    require(bool((np.diff(axis) > 0).all()), f"{broken} does not rise or fall steadily")
    return axis, turned


def places(name: str, lon: Any, lat: Any) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Longitude and latitude (ny, nx) of every point, and where the file has none of its own.

    Models that drop tiles of land leave zeros or fills there: such points get places that continue those
    around, so that a grid stays a grid.
    """
    size = lon.size
    require(size <= MOST_POINTS, f"the longitude `{lon.name}` in {name} claims {size:,} points; cut the file")
    at_lon, at_lat = (np.array(one.values, dtype=np.float64) for one in (lon, lat))
    if str(lon.attrs.get("units", "")).strip().lower() in ("radian", "radians", "rad"):
        at_lon, at_lat = np.degrees(at_lon), np.degrees(at_lat)
    none = ~(np.isfinite(at_lon) & np.isfinite(at_lat)) | (np.abs(at_lat) > 90.001) | (np.abs(at_lon) > 1080)
    still = (at_lon == 0) & (at_lat == 0)
    none |= still if still.sum() > 1 else False
    require(
        float(none.mean()) < 0.9,
        f"the places `{lon.name}` and `{lat.name}` in {name} are missing, or no degrees, nearly everywhere",
    )
    if none.any():
        middle = float(at_lon[~none][0])
        at_lon = _continued(np.where(none, np.nan, wrapped(at_lon, middle)))
        at_lat = np.clip(_continued(np.where(none, np.nan, at_lat)), -90, 90)
    return at_lon, at_lat, none


def _continued(values: Array) -> Array:
    """NaN replaced along rows, then along columns: straight between known values and beyond them."""
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


def depths(name: str, variable: Any, said: Names) -> tuple[Array, bool, str]:
    """Depths downward, rising; whether turned; what was taken for what."""
    axis = np.atleast_1d(np.asarray(variable.values, dtype=np.float64)).ravel()
    broken = f"the depth `{variable.name}` in {name}"
    require(bool(np.isfinite(axis).all()), f"{broken} has missing values")
    units = str(variable.attrs.get("units", "")).strip().lower()
    factor = in_metres(units)
    if factor is None:
        raise InputError(f"{broken} is in {units!r}, not in metres: convert it first")
    below, above = bool((axis <= 0).all()), bool((axis >= 0).all())
    require(
        below or above,
        f"{broken} runs from {axis.min():g} to {axis.max():g}, on both sides of the surface",
    )
    claim = said.positive or str(variable.attrs.get("positive", "")).strip().lower()
    if claim not in ("up", "down"):
        claim = "up" if standard_name(variable).startswith(("height", "altitude")) else ""
    sense = "up" if not above else "down" if not below else claim or "down"
    # heights above the seabed look so, too: the sign alone must not decide
    require(
        claim in ("", sense),
        f"{broken} is said to be positive {claim}, but runs from {axis[0]:g} to {axis[-1]:g}: "
        f'if these are depths under the surface, name `positive` = "{sense}" in `names`',
    )
    axis = np.abs(axis) * factor
    turned = axis.size > 1 and bool(axis[0] > axis[-1])
    axis = axis[::-1] if turned else axis
    require(bool((np.diff(axis) > 0).all()), f"{broken} does not rise or fall steadily")
    return axis, turned, f"{variable.name}, positive {sense}"


def times(name: str, data: Any, of: str) -> tuple[NDArray[np.datetime64] | None, tuple[str, ...]]:
    """UTC, or None for a single time that does not say when; notes."""
    import xarray

    variable = data[of]
    broken = f"the time `{of}` in {name}"
    if " since " not in str(variable.attrs.get("units", "")):
        require(
            variable.size == 1,
            f'{broken} has no unit such as "hours since 1950-01-01", so {variable.size} times are unknown',
        )
        return None, (f"`{of}` does not say when it is",)
    require(bool(np.isfinite(variable.values).all()), f"{broken} has missing values")
    try:
        values = np.atleast_1d(xarray.decode_cf(data[[of]].drop_encoding())[of].values).ravel()
    except Exception as error:
        # what an impossible unit makes the libraries raise is not written down anywhere
        raise InputError(
            f"{broken} cannot be read: units {variable.attrs.get('units')!r}, calendar "
            f"{variable.attrs.get('calendar', 'standard')!r} ({str(error).splitlines()[0]})"
        ) from None
    notes: tuple[str, ...] = ()
    if values.dtype.kind == "O":
        calendar = str(variable.attrs.get("calendar", "standard"))
        try:
            # by its label: 1 March stays 1 March, whatever February was
            values = np.array([np.datetime64(one.isoformat(), "us") for one in values])
        except ValueError:
            raise InputError(f"{broken} has dates of the calendar {calendar!r} that do not exist") from None
        notes = (f"times of the calendar {calendar!r} keep their dates",)
    rounded = (values.astype("datetime64[us]") + np.timedelta64(500, "us")).astype("datetime64[ms]")
    return rounded, notes
