"""The model's own depth: where a current file, or a file beside it, says how deep the sea is."""

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
"""Names of the depth of a model's sea; `mbathy` counts levels and is none."""
DEEPEST = 12_000.0
"""No sea is as deep [m]: a fill."""
NEARBY = 1.0
"""How far around a grid its places are looked at [degrees]."""


def places_of(at: Catalogue, one: Any) -> tuple[Array, Array] | None:
    """Longitude and latitude of each point of a field of two dimensions, as it lies in memory."""
    try:
        found = at.places(one, "u")
    except InputError:
        return None
    if found is not None:
        lon, lat = (at.data[name].squeeze().transpose(*one.dims) for name in found)
        own = places(at.name, lon, lat)
        return own[0].ravel(), own[1].ravel()
    hits = [at.axis_of(one, dim) for dim in map(str, one.dims)]
    kinds = [hit[0] if hit else "" for hit in hits]
    if sorted(kinds) != ["lat", "lon"]:
        return None
    axes = {hit[0]: np.asarray(at.data[hit[1]].values, np.float64) for hit in hits if hit}
    lat, lon = np.meshgrid(axes["lat"], axes["lon"], indexing="ij")
    if kinds[0] == "lon":
        lat, lon = lat.T, lon.T
    return lon.ravel(), lat.ravel()


def model_depth(at: Catalogue, grid: Grid, dims: tuple[str, str] | None) -> Field | None:
    """The model's depth [m, downward] about a grid, NaN on land; None where no variable says it.

    `dims`: of the component, whose own points come first where several variables fit.
    """
    if at.said.bottom == "none":
        return None
    said = at.said.bottom
    names = [said] if said is not None and said in at.data.variables else _candidates(at)
    own = [name for name in names if dims and set(dims) <= set(map(str, at.data[name].dims))]
    for name in own or names:
        one = at.data[name].squeeze()
        where = places_of(at, one)
        factor = in_metres(units_of(one))
        if where is None or factor is None or one.ndim != 2:
            continue
        near = _near(grid, *where)
        values = np.asarray(one.values, np.float64).ravel()[near] * factor
        values = np.where(np.abs(values) < DEEPEST, values, np.nan)
        return Field(name, where[0][near], where[1][near], _downward(at, name, values))
    if at.said.bottom is not None and at.said.bottom in at.data.variables:
        raise InputError(
            f"`{at.said.bottom}` in {at.name} is no depth [m] on a grid of longitude and latitude; name another "
            f'`bottom`, or "none", of: {listing(at.data.variables)}'
        )
    return None


def _candidates(at: Catalogue) -> list[str]:
    fields = [
        name
        for name in map(str, at.data.variables)
        if at.data[name].ndim >= 2 and at.data[name].squeeze().ndim == 2 and at.data[name].dtype.kind in "fiu"
    ]
    told = [name for name in fields if STANDARD.search(standard_name(at.data[name]))]
    return told or [name for name in fields if SHORT.match(name) and not standard_name(at.data[name])]


def _near(grid: Grid, lon: Array, lat: Array) -> Any:
    """Which places lie about a grid."""
    (west, east), (south, north) = grid.bounds
    middle, half = (west + east) / 2, (east - west) / 2 + NEARBY
    return (np.abs(wrapped(lon, middle) - middle) <= half) & (lat >= south - NEARBY) & (lat <= north + NEARBY)


def _downward(at: Catalogue, name: str, values: Array) -> Array:
    """Depths downward, NaN where there is no sea, whichever way the file counts."""
    known = values[np.isfinite(values) & (values != 0)]
    up = known.size > 0 and bool((known < 0).mean() > 0.5)
    claim = str(at.data[name].attrs.get("positive", "")).strip().lower()
    values = -values if claim == "up" or (claim != "down" and up) else values
    return np.where(values > 0, values, np.nan)
