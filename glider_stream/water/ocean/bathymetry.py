"""Bathymetry files: the height of the bottom, from GEBCO, ETOPO, a model's depths, or a chart of your own."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import Range
from ...base.errors import InputError
from ...base.settings import require
from ..frame import LocalFrame
from .axes import degrees, places
from .bottom import Bottom
from .grid import Grid, grid_of
from .horizontal import horizontal_of
from .names import Catalogue, Names, listing, standard_name
from .opening import opened
from .units import in_metres

UP_NAMES = re.compile(
    r"^(height_above_(reference_ellipsoid|mean_sea_level|geopotential_datum)|(surface|bedrock|ground_level)_altitude"
    r"|altitude|sea_floor_altitude)"
)
DOWN_NAMES = re.compile(r"sea_floor_depth|^sea_floor_depth_below|depth_below_(geoid|sea_surface|mean_sea_level)")
UP_SHORT = {"elevation", "topo", "z", "altitude", "band1", "height", "elev", "bedrock", "rose"}
DOWN_SHORT = {"deptho", "h", "bathymetry", "bathy", "depth", "bathy_metry", "ht", "hu", "bottom_depth", "topog"}
BEYOND = 12_000.0
"""No land is as high and no sea as deep [m]: a fill."""
LIMIT = 500_000_000
"""The most that the heights of a domain may take in memory [bytes]."""
MARGIN = 3


def read_bathymetry(
    file: str | Path,
    frame: LocalFrame,
    lon: Range,
    lat: Range,
    beyond: float = 0.0,
    variable: str | None = None,
    positive: str | None = None,
) -> Bottom:
    """The bottom in a domain [degrees], and as far `beyond` it [m] as the file goes.

    InputError where it does not hold the domain. `variable` and `positive` ("up", "down") where the file does
    not speak for itself. No data is land.
    """
    path = Path(file)
    require(positive in (None, "up", "down"), f'`positive` must be "up" or "down"; got {positive!r}')
    with opened(path) as data:
        return _read(path.name, data, frame, lon, lat, beyond, variable, positive)


def _pick(name: str, data: Any, variable: str | None) -> Any:
    if variable is not None:
        require(
            variable in data.variables,
            f"{name} holds no variable `{variable}`; it holds: {listing(data.variables)}",
        )
        return data[variable]
    fields = [one for one in data.data_vars.values() if one.squeeze().ndim == 2 and one.dtype.kind in "fiu"]
    fields += [one for one in data.coords.values() if one.squeeze().ndim == 2 and one.dtype.kind in "fiu"]
    for known in (
        lambda one: UP_NAMES.search(standard_name(one)) or DOWN_NAMES.search(standard_name(one)),
        lambda one: str(one.name).lower() in UP_SHORT | DOWN_SHORT,
    ):
        hits = [one for one in fields if known(one)]
        if len(hits) == 1:
            return hits[0]
        require(
            not hits,
            f"{name} holds {len(hits)} bathymetries, {listing(one.name for one in hits)}: name `variable`",
        )
    raise InputError(
        f"{name} holds no bathymetry that can be told by its name; name `variable`, of: {listing(data.data_vars)}"
    )


def _sense(name: str, one: Any, values: Array, positive: str | None) -> str:
    """Whether the values count up or down: the user's word, then the file's, which the sea must not belie."""
    said = positive or str(one.attrs.get("positive", "")).strip().lower()
    if said not in ("up", "down"):
        standard, short = standard_name(one), str(one.name).lower()
        up = UP_NAMES.search(standard) is not None or (not standard and short in UP_SHORT)
        down = DOWN_NAMES.search(standard) is not None or (not standard and short in DOWN_SHORT)
        said = "up" if up and not down else "down" if down and not up else ""
    require(said != "", f"`{one.name}` in {name} does not say whether it counts up or down: name `positive`")
    below, above = bool((values < 0).any()), bool((values > 0).any())
    if positive is None and said == "down" and below and not above:
        raise InputError(
            f'`{one.name}` in {name} is a depth, yet never above 0: name `positive` = "up" if it counts upward'
        )
    if positive is None and said == "up" and not below:
        raise InputError(
            f"`{one.name}` in {name} is a height, yet nowhere below 0, so there is no sea: name `positive` = "
            '"down" if it counts downward'
        )
    return said


def _read(
    name: str,
    data: Any,
    frame: LocalFrame,
    lon: Range,
    lat: Range,
    beyond: float,
    variable: str | None,
    positive: str | None,
) -> Bottom:
    one = _pick(name, data, variable)
    catalogue = Catalogue(name, data, Names())
    rows, lon_of, lat_of = horizontal_of(catalogue, one, "u")
    single = {dim: 0 for dim in map(str, one.dims) if dim not in rows}
    require(
        all(one.sizes[dim] == 1 for dim in single),
        f"`{one.name}` in {name} has dimensions {', '.join(map(str, one.dims))}: a bathymetry has two",
    )
    units = str(one.attrs.get("units", ""))
    factor = in_metres(units)
    if factor is None:
        raise InputError(f"`{one.name}` in {name} is in {units!r}, not in metres: convert it first")
    if lon_of.ndim == 1:
        (at_lon, lon_turned), (at_lat, lat_turned) = degrees(name, lon_of, "lon"), degrees(name, lat_of, "lat")
        require(min(at_lon.size, at_lat.size) > 1, f"`{one.name}` in {name} is no grid of two points or more")
        grid: Grid = grid_of(at_lon, at_lat)
    else:
        lon_turned = lat_turned = False
        grid = grid_of(*places(name, lon_of, lat_of)[:2])
    cell = min(float(size.min()) for size in grid.cell_sizes())
    cut = grid.cut(name, lon, lat, frame.lon, MARGIN + math.ceil(max(beyond, 0.0) / max(cell, 1.0)))
    ny, nx = (one.sizes[dim] for dim in rows)
    size = 8 * cut.grid.shape[0] * cut.grid.shape[1]
    require(size <= LIMIT, f"the bottom of {name} would take {size / 1e9:.1f} GB: narrow the domain")
    j, i = np.arange(ny)[cut.rows], cut.columns
    picked = {rows[0]: ny - 1 - j if lat_turned else j, rows[1]: nx - 1 - i if lon_turned else i, **single}
    values = np.asarray(one.isel(picked).transpose(*rows).values, np.float64) * factor
    values = np.where(np.abs(values) < BEYOND, values, np.nan)
    said = _sense(name, one, values[np.isfinite(values)], positive)
    height = np.nan_to_num(-values if said == "down" else values, nan=0.0)
    return Bottom(cut.grid, height, True, f"{one.name} of {name}, positive {said}")
