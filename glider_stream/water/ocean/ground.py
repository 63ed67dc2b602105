"""The model's own depth: reads how deep the sea is from a current file or from a file beside it."""

import re
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.errors import InputError
from ..frame import wrapped
from .axes import places
from .grid import Grid
from .names import Catalogue, listing, standard_name, units_of
from .part import Field
from .units import in_metres

STANDARD = re.compile(r"^(model_)?sea_floor_depth|depth_below_(geoid|sea_surface|mean_sea_level)|^model_depth")
SHORT = re.compile(
    r"^(deptho|h|hh|ht|hu|hv|topog|bathy(metry|_metry|meter)?|model_?depth|bottom_?depth|depth|depth_?c|htot|hbot)$",
    re.I,
)
"""Names of the depth of a model's sea. `mbathy` is not among them: it counts levels."""
DEEPEST = 12_000.0
"""No sea is as deep as this [m]; such a number is a fill value."""
NEARBY = 1.0
"""Positions are used up to this far around a grid [degrees]."""


def places_of(at: Catalogue, variable: Any) -> tuple[Array, Array] | None:
    """Return longitude and latitude of each point of a two-dimensional field, in its order in memory."""
    try:
        found = at.places(variable, "u")
    except InputError:
        return None
    if found is not None:
        lon, lat = (at.data[name].squeeze().transpose(*variable.dims) for name in found)
        degrees = places(at.name, lon, lat)
        return degrees[0].ravel(), degrees[1].ravel()
    hits = [at.axis_of(variable, dim) for dim in map(str, variable.dims)]
    kinds = [hit[0] if hit else "" for hit in hits]
    if sorted(kinds) != ["lat", "lon"]:
        return None
    axes = {hit[0]: np.asarray(at.data[hit[1]].values, np.float64) for hit in hits if hit}
    lat, lon = np.meshgrid(axes["lat"], axes["lon"], indexing="ij")
    if kinds[0] == "lon":
        lat, lon = lat.T, lon.T
    return lon.ravel(), lat.ravel()


def model_depth(at: Catalogue, grid: Grid, dims: tuple[str, str] | None) -> Field | None:
    """Return the model's depth [m, downward] about a grid, NaN on land; None if no variable holds it.

    `dims`: the dimensions of the component. If several variables fit, those along `dims` come first.
    """
    if at.names.bottom == "none":
        return None
    named = at.names.bottom
    names = [named] if named is not None and named in at.data.variables else _candidates(at)
    aligned = [name for name in names if dims and set(dims) <= set(map(str, at.data[name].dims))]
    for name in aligned or names:
        variable = at.data[name].squeeze()
        where = places_of(at, variable)
        factor = in_metres(units_of(variable))
        if where is None or factor is None or variable.ndim != 2:
            continue
        near = _near(grid, *where)
        values = np.asarray(variable.values, np.float64).ravel()[near] * factor
        values = np.where(np.abs(values) < DEEPEST, values, np.nan)
        return Field(name, where[0][near], where[1][near], _downward(at, name, values))
    if at.names.bottom is not None and at.names.bottom in at.data.variables:
        raise InputError(
            f"`{at.names.bottom}` in {at.name} is not a depth [m] on a grid of longitude and latitude; set "
            f'`bottom` to "none" or another of: {listing(at.data.variables)}'
        )
    return None


def _candidates(at: Catalogue) -> list[str]:
    fields = [
        name
        for name in map(str, at.data.variables)
        if at.data[name].ndim >= 2 and at.data[name].squeeze().ndim == 2 and at.data[name].dtype.kind in "fiu"
    ]
    standard = [name for name in fields if STANDARD.search(standard_name(at.data[name]))]
    return standard or [name for name in fields if SHORT.match(name) and not standard_name(at.data[name])]


def _near(grid: Grid, lon: Array, lat: Array) -> Any:
    """Return which positions lie near a grid."""
    (west, east), (south, north) = grid.bounds
    middle, half = (west + east) / 2, (east - west) / 2 + NEARBY
    return (np.abs(wrapped(lon, middle) - middle) <= half) & (lat >= south - NEARBY) & (lat <= north + NEARBY)


def _downward(at: Catalogue, name: str, values: Array) -> Array:
    """Return depths downward, NaN where there is no sea, for either direction of the file's values."""
    known = values[np.isfinite(values) & (values != 0)]
    up = known.size > 0 and bool((known < 0).mean() > 0.5)
    claim = str(at.data[name].attrs.get("positive", "")).strip().lower()
    values = -values if claim == "up" or (claim != "down" and up) else values
    return np.where(values > 0, values, np.nan)
