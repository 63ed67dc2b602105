"""Bathymetry files: the height of the bottom, from GEBCO, ETOPO, a model's depths, or a chart of your own."""

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Array, Index
from ...base.checks import Range
from ...base.errors import InputError
from ...base.settings import require
from ..frame import LocalFrame
from .axes import degrees, places
from .bottom import Bottom
from .grid import Grid, grid_of
from .horizontal import horizontal_of
from .names import Catalogue, Names, listing, standard_name, units_of
from .opening import opened
from .sentinel import undeclared
from .units import in_metres

UP_NAMES = re.compile(
    r"^(height_above_(reference_ellipsoid|mean_sea_level|geopotential_datum)|(surface|bedrock|ground_level)_altitude"
    r"|altitude|sea_floor_altitude)"
)
DOWN_NAMES = re.compile(r"sea_floor_depth|^sea_floor_depth_below|depth_below_(geoid|sea_surface|mean_sea_level)")
UP_SHORT = {"elevation", "topo", "z", "altitude", "band1", "height", "elev", "bedrock", "rose"}
DOWN_SHORT = {"deptho", "h", "bathymetry", "bathy", "depth", "bathy_metry", "ht", "hu", "bottom_depth", "topog"}
HEIGHT_WORDS = re.compile(r"\b(elevation|height|altitude|topography)\b")
"""Long names of what counts upward."""
LIMIT = 500_000_000
"""The most that the heights of a domain may take in memory [bytes]."""
CHART_BEYOND = 3
"""Cells of a chart kept around a domain."""


@dataclass(frozen=True)
class Chart:
    """What the user says of a bathymetry: its `variable`, whether it counts "up" or "down", and other `names`."""

    variable: str | None = None
    positive: str | None = None
    names: Names = field(default_factory=Names)

    def __post_init__(self) -> None:
        known = self.positive in (None, "up", "down")
        require(known, f'`positive` must be "up" or "down"; got {self.positive!r}')
        fits = {"lon", "lat", "units", "positive", "group"}
        alien = [key for key, value in vars(self.names).items() if value is not None and key not in fits]
        require(
            not alien, f"`terrain.names` knows {', '.join(sorted(fits))}; got {', '.join(alien)}: leave it out"
        )


def read_bathymetry(
    file: str | Path,
    frame: LocalFrame,
    lon: Range,
    lat: Range,
    beyond: float = 0.0,
    variable: str | None = None,
    positive: str | None = None,
    names: Names | None = None,
) -> Bottom:
    """The bottom in a domain [degrees], and as far `beyond` it [m] as the file goes.

    InputError where it does not hold the domain. `variable`, `positive` ("up", "down") and `names` (lon, lat,
    units, group) where the file does not speak for itself. No data is land.
    """
    path, said = Path(file), names or Names()
    asked = Chart(variable, positive or said.positive, said)
    with opened(path, said.group) as data:
        for key, name in said.variables().items():
            require(
                name in data.variables,
                f"{path.name} holds no variable `{name}`, which `{key}` names; "
                f"it holds: {listing(data.variables)}",
            )
        return _read(path.name, data, frame, lon, lat, beyond, asked)


ONLY_BAND = "band_data"
"""What a GeoTIFF's band is called: whether it counts up or down is for the user to say."""


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
    if [one.name for one in fields] == [ONLY_BAND]:
        return fields[0]
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
    told = standard_name(one) or str(one.attrs.get("positive", ""))
    long = str(one.attrs.get("long_name", "")).lower()
    if positive is None and said == "down" and not told and (below or HEIGHT_WORDS.search(long)):
        raise InputError(
            f"`{one.name}` in {name} may be a depth or a height: by its name it counts down, yet "
            + (
                f"its long name is {long!r}"
                if HEIGHT_WORDS.search(long)
                else f"it runs from {values.min():g} to {values.max():g}"
            )
            + ': name `positive`, "up" or "down"'
        )
    if positive is None and said == "up" and not below:
        raise InputError(
            f"`{one.name}` in {name} is a height, yet nowhere below 0, so there is no sea: name `positive` = "
            '"down" if it counts downward'
        )
    return said


def _places(name: str, data: Any, one: Any, said: Names) -> tuple[tuple[str, str], Grid, Index, Index]:
    """The dimensions across and along the rows, the grid, and which rows and columns of the file it has."""
    dims, lon, lat = horizontal_of(Catalogue(name, data, said), one, "u")
    if lon.ndim == 1:
        (at_lon, columns), (at_lat, rows) = degrees(name, lon, "lon"), degrees(name, lat, "lat")
        require(min(at_lon.size, at_lat.size) > 1, f"`{one.name}` in {name} is no grid of two points or more")
        return dims, grid_of(at_lon, at_lat), rows, columns
    grid = grid_of(*places(name, lon, lat)[:2])
    return dims, grid, np.arange(grid.shape[0]), np.arange(grid.shape[1])


def _read(name: str, data: Any, frame: LocalFrame, lon: Range, lat: Range, beyond: float, asked: Chart) -> Bottom:
    one = _pick(name, data, asked.variable)
    dims, grid, rows, columns = _places(name, data, one, asked.names)
    single = {dim: 0 for dim in map(str, one.dims) if dim not in dims}
    require(
        all(one.sizes[dim] == 1 for dim in single),
        f"`{one.name}` in {name} has dimensions {', '.join(map(str, one.dims))}: a bathymetry has two",
    )
    units = asked.names.units or units_of(one)
    factor = in_metres(units)
    if factor is None:
        raise InputError(
            f"`{one.name}` in {name} is in {units!r}, not in metres: convert it, or name `units` in `names`"
        )
    cell = min(float(size.min()) for size in grid.cell_sizes())
    cut = grid.cut(name, lon, lat, frame.lon, CHART_BEYOND + math.ceil(max(beyond, 0.0) / max(cell, 1.0)))
    size = 8 * cut.grid.shape[0] * cut.grid.shape[1]
    require(size <= LIMIT, f"the bottom of {name} would take {size / 1e9:.1f} GB: narrow the domain")
    picked = {dims[0]: rows[cut.rows], dims[1]: columns[cut.columns], **single}
    values = np.asarray(one.isel(picked).transpose(*dims).values, np.float64) * factor
    gone, marks = undeclared(values)
    values = np.where(gone, np.nan, values)
    said = _sense(name, one, values[np.isfinite(values)], asked.positive)
    height = np.nan_to_num(-values if said == "down" else values, nan=0.0)
    words = f"{one.name} of {name}, positive {said}"
    if marks:
        told = ", ".join(f"{mark / factor:g}" for mark in marks)
        words += f", where {told} ({int(gone.sum())} points) is taken as no data"
    if (without := int(np.isnan(values).sum())) > 0:
        words += f", {without} points without data taken as land"
    return Bottom(cut.grid, height, True, words)
