"""Bathymetry files: the height of the bottom, from GEBCO, ETOPO, a model's depths, or your own chart."""

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
"""Long names that contain one of these words are heights, which count upward."""
LIMIT = 500_000_000
"""The heights of a domain may take at most this much memory [bytes]."""
CHART_BEYOND = 3
"""This many cells of a chart are kept around a domain."""


@dataclass(frozen=True)
class Chart:
    """Settings for a bathymetry: its `variable`, whether it counts "up" or "down", and other `names`."""

    variable: str | None = None
    positive: str | None = None
    names: Names = field(default_factory=Names)

    def __post_init__(self) -> None:
        known = self.positive in (None, "up", "down")
        require(known, f'`positive` must be "up" or "down"; got {self.positive!r}')
        fits = {"lon", "lat", "units", "positive", "group"}
        unknown = [key for key, value in vars(self.names).items() if value is not None and key not in fits]
        require(
            not unknown,
            f"`terrain.names` may hold {', '.join(sorted(fits))}; got {', '.join(unknown)}: leave it out",
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
    """Return the bottom in a domain [degrees] and up to `beyond` [m] around it, as far as the file goes.

    InputError if the file does not cover the domain. `variable`, `positive` ("up", "down") and `names` (lon, lat,
    units, group) are needed where the file does not give them. Points without data are land.
    """
    path, given = Path(file), names or Names()
    chart = Chart(variable, positive or given.positive, given)
    with opened(path, given.group) as data:
        for key, name in given.variables().items():
            require(
                name in data.variables,
                f"{path.name} holds no variable `{name}`, which `{key}` names; "
                f"it holds: {listing(data.variables)}",
            )
        return _read(path.name, data, frame, lon, lat, beyond, chart)


ONLY_BAND = "band_data"
"""What a GeoTIFF's band is called: whether it counts up or down is for the user to say."""


def _pick(name: str, data: Any, variable: str | None) -> Any:
    if variable is not None:
        require(
            variable in data.variables,
            f"{name} holds no variable `{variable}`; it holds: {listing(data.variables)}",
        )
        return data[variable]
    fields = [
        field for field in data.data_vars.values() if field.squeeze().ndim == 2 and field.dtype.kind in "fiu"
    ]
    fields += [field for field in data.coords.values() if field.squeeze().ndim == 2 and field.dtype.kind in "fiu"]
    for known in (
        lambda field: UP_NAMES.search(standard_name(field)) or DOWN_NAMES.search(standard_name(field)),
        lambda field: str(field.name).lower() in UP_SHORT | DOWN_SHORT,
    ):
        hits = [field for field in fields if known(field)]
        if len(hits) == 1:
            return hits[0]
        require(
            not hits,
            f"{name} holds {len(hits)} bathymetries, {listing(field.name for field in hits)}: set `variable`",
        )
    if [one.name for one in fields] == [ONLY_BAND]:
        return fields[0]
    raise InputError(
        f"{name} holds no bathymetry with a known name; set `variable` to one of: {listing(data.data_vars)}"
    )


def _sense(name: str, variable: Any, values: Array, positive: str | None) -> str:
    """Return "up" or "down": as the user says, else as the file says; InputError if the values contradict it."""
    sense = positive or str(variable.attrs.get("positive", "")).strip().lower()
    if sense not in ("up", "down"):
        standard, short = standard_name(variable), str(variable.name).lower()
        up = UP_NAMES.search(standard) is not None or (not standard and short in UP_SHORT)
        down = DOWN_NAMES.search(standard) is not None or (not standard and short in DOWN_SHORT)
        sense = "up" if up and not down else "down" if down and not up else ""
    require(sense != "", f"`{variable.name}` in {name} does not say whether it counts up or down: set `positive`")
    below, above = bool((values < 0).any()), bool((values > 0).any())
    if positive is None and sense == "down" and below and not above:
        raise InputError(
            f'`{variable.name}` in {name} is a depth, but it is never above 0: set `positive` = "up" if it '
            "counts upward"
        )
    declared = standard_name(variable) or str(variable.attrs.get("positive", ""))
    long = str(variable.attrs.get("long_name", "")).lower()
    if positive is None and sense == "down" and not declared and (below or HEIGHT_WORDS.search(long)):
        raise InputError(
            f"`{variable.name}` in {name} may be a depth or a height: by its name it counts down, but "
            + (
                f"its long name is {long!r}"
                if HEIGHT_WORDS.search(long)
                else f"it runs from {values.min():g} to {values.max():g}"
            )
            + ': set `positive`, "up" or "down"'
        )
    if positive is None and sense == "up" and not below:
        raise InputError(
            f"`{variable.name}` in {name} is a height, but it is never below 0, so there is no sea: set "
            "`positive` = "
            '"down" if it counts downward'
        )
    return sense


def _places(name: str, data: Any, variable: Any, names: Names) -> tuple[tuple[str, str], Grid, Index, Index]:
    """Return the dimensions across and along the rows, the grid, and its rows and columns in the file."""
    dims, lon, lat = horizontal_of(Catalogue(name, data, names), variable, "u")
    if lon.ndim == 1:
        (at_lon, columns), (at_lat, rows) = degrees(name, lon, "lon"), degrees(name, lat, "lat")
        require(
            min(at_lon.size, at_lat.size) > 1,
            f"`{variable.name}` in {name} is not a grid of two points or more in each direction",
        )
        return dims, grid_of(at_lon, at_lat), rows, columns
    grid = grid_of(*places(name, lon, lat)[:2])
    return dims, grid, np.arange(grid.shape[0]), np.arange(grid.shape[1])


def _read(name: str, data: Any, frame: LocalFrame, lon: Range, lat: Range, beyond: float, chart: Chart) -> Bottom:
    variable = _pick(name, data, chart.variable)
    dims, grid, rows, columns = _places(name, data, variable, chart.names)
    single = {dim: 0 for dim in map(str, variable.dims) if dim not in dims}
    require(
        all(variable.sizes[dim] == 1 for dim in single),
        f"`{variable.name}` in {name} has dimensions {', '.join(map(str, variable.dims))}: a bathymetry has two",
    )
    units = chart.names.units or units_of(variable)
    factor = in_metres(units)
    if factor is None:
        raise InputError(
            f"`{variable.name}` in {name} is in {units!r}, not in metres: convert it, or set `units` in `names`"
        )
    cell = min(float(size.min()) for size in grid.cell_sizes())
    cut = grid.cut(name, lon, lat, frame.lon, CHART_BEYOND + math.ceil(max(beyond, 0.0) / max(cell, 1.0)))
    size = 8 * cut.grid.shape[0] * cut.grid.shape[1]
    require(size <= LIMIT, f"the bottom of {name} would take {size / 1e9:.1f} GB: narrow the domain")
    picked = {dims[0]: rows[cut.rows], dims[1]: columns[cut.columns], **single}
    values = np.asarray(variable.isel(picked).transpose(*dims).values, np.float64) * factor
    gone, marks = undeclared(values)
    values = np.where(gone, np.nan, values)
    sense = _sense(name, variable, values[np.isfinite(values)], chart.positive)
    height = np.nan_to_num(-values if sense == "down" else values, nan=0.0)
    description = f"{variable.name} of {name}, positive {sense}"
    if marks:
        listed = ", ".join(f"{mark / factor:g}" for mark in marks)
        description += f", where {listed} ({int(gone.sum())} points) is taken as no data"
    if (without := int(np.isnan(values).sum())) > 0:
        description += f", {without} points without data taken as land"
    return Bottom(cut.grid, height, True, description)
