"""Writes currents as CF NetCDF that this package and others read."""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.output import replacing
from ...base.settings import require
from .file import OceanFile
from .grid import LonLatGrid

Values = NDArray[np.float32]
WORDS = {"uo": "eastward", "vo": "northward"}


def write_currents(
    file: OceanFile,
    output: str | Path,
    *,
    deviation: tuple[Values, Values] | None = None,
    members: Sequence[tuple[Values, Values]] = (),
    title: str = "",
    comment: str = "",
) -> None:
    """Write currents: `uo`, `vo` on the file's grid, levels and times, land as missing.

    `deviation`: standard deviations, written beside as `uo_sd` and `vo_sd`. `members`: instead of the file's own
    currents, these along a dimension `member`. All are (nt, nz, ny, nx) [m/s].
    """
    import xarray

    axes, coordinates = _axes(file)
    variables: dict[str, Any] = {}
    for n, (name, toward) in enumerate(WORDS.items()):
        own = file.u if n == 0 else file.v
        attrs = {"standard_name": f"{toward}_sea_water_velocity", "units": "m s-1", "cell_methods": "time: point"}
        values = np.stack([member[n] for member in members]) if members else own
        variables[name] = (("member", *axes) if members else axes, _shaped(file, values), attrs)
        if deviation is not None:
            require(not members, "members need no standard deviation; leave one of them out")
            words = {
                "standard_name": f"{toward}_sea_water_velocity standard_error",
                "long_name": f"standard deviation of `{name}`",
                "units": "m s-1",
            }
            variables[f"{name}_sd"] = (axes, _shaped(file, deviation[n]), words)
            attrs["ancillary_variables"] = f"{name}_sd"
    if members:
        words = {"standard_name": "realization", "units": "1"}
        coordinates["member"] = ("member", np.arange(len(members)), words)
    if file.took.get("bottom", "").startswith("the model's depth"):
        depth = np.where(np.isfinite(file.seabed) & (file.seabed > 0), file.seabed, np.nan)
        words = {"standard_name": "sea_floor_depth_below_geoid", "units": "m"}
        variables["deptho"] = (axes[-2:], depth, words)
    if not file.surface and not np.array_equal(file.lower, file.depth):
        coordinates["depth"][2]["bounds"] = "depth_bnds"
        upper = np.concatenate([[file.top], file.lower[:-1]])
        variables["depth_bnds"] = (("depth", "bound"), np.stack([upper, file.lower], axis=-1), {})
    attrs = {
        "Conventions": "CF-1.11",
        "title": title,
        "comment": comment,
        # no date: the same inputs give the same file
        "history": f"glider-stream {version('glider-stream')}, from {file.name}",
    }
    data = xarray.Dataset(variables, coordinates, attrs)
    for key, variable in data.variables.items():
        missing = key in ("uo", "vo", "uo_sd", "vo_sd", "deptho")
        variable.encoding["_FillValue"] = variable.dtype.type(np.nan) if missing else None
        if missing and variable.ndim > 2:
            variable.encoding |= {"zlib": True, "complevel": 4}
    with replacing(Path(output)) as temporary:
        data.to_netcdf(temporary, engine="h5netcdf")


def _axes(file: OceanFile) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Return the dimensions of currents, and the coordinates."""
    coordinates: dict[str, Any] = {}
    leading: tuple[str, ...] = ()
    if file.times is not None:
        leading += ("time",)
        since = (file.times - np.datetime64("1970-01-01")) / np.timedelta64(1, "ms") / 1000.0
        words = {"standard_name": "time", "units": "seconds since 1970-01-01 00:00:00", "calendar": "standard"}
        coordinates["time"] = ("time", since, words)
    if not file.surface:
        leading += ("depth",)
        words = {"standard_name": "depth", "units": "m", "positive": "down", "axis": "Z"}
        coordinates["depth"] = ("depth", file.depth, words)
    regular = isinstance(file.grid, LonLatGrid)
    horizontal = ("latitude", "longitude") if regular else ("y", "x")
    for name, values, units in (
        ("latitude", file.grid.lat, "degrees_north"),
        ("longitude", file.grid.lon, "degrees_east"),
    ):
        coordinates[name] = (name if regular else horizontal, values, {"standard_name": name, "units": units})
    return (*leading, *horizontal), coordinates


def _shaped(file: OceanFile, values: Values) -> Values:
    """Return values (..., nt, nz, ny, nx) without the dimensions that the file does not have."""
    nt, nz, ny, nx = file.u.shape
    before = values.shape[:-4]
    middle = (nt,) * (file.times is not None) + (nz,) * (not file.surface)
    return np.asarray(values, dtype=np.float32).reshape(*before, *middle, ny, nx)
