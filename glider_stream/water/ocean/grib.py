"""Currents in GRIB files, by cfgrib: told by their numbers in the tables, for which few centres have names."""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

COMPONENTS = {"u": ("eastward_sea_water_velocity", 2, 49), "v": ("northward_sea_water_velocity", 3, 50)}
"""Standard name; number in GRIB 2's category 1 (currents) of discipline 10 (oceans), and in GRIB 1's table 2."""
DEPTH = {"units": "m", "positive": "down", "standard_name": "depth"}


def open_grib(path: Path) -> Any:
    """The xarray.Dataset of a file's currents `u` and `v`; of all that it holds where there are none."""
    import xarray

    parts = {name: _component(path, name) for name in COMPONENTS}
    found = [part for part in parts.values() if part is not None]
    if len(found) < len(parts):
        return _opened(path, {})
    return xarray.merge(found, compat="override", combine_attrs="override")


def _opened(path: Path, keys: Mapping[str, Any]) -> Any:
    import xarray

    # what an index beside the file says may be of another file
    how = {"indexpath": "", "filter_by_keys": dict(keys)}
    return xarray.open_dataset(path, engine="cfgrib", decode_times=False, cache=False, backend_kwargs=how)


def _component(path: Path, name: str) -> Any | None:
    """One component under its short name, with its unit; None where the file has none."""
    standard, second, first = COMPONENTS[name]
    for keys in (
        {"discipline": 10, "parameterCategory": 1, "parameterNumber": second},
        {"edition": 1, "table2Version": 2, "indicatorOfParameter": first},
    ):
        data = _levels(path, keys)
        if data is None:
            continue
        [own] = data.data_vars
        data = data.rename({own: name})
        if int(data[name].attrs.get("GRIB_uvRelativeToGrid", 0)) == 1:
            standard = {"u": "sea_water_x_velocity", "v": "sea_water_y_velocity"}[name]
        data[name].attrs |= {"units": "m s-1", "standard_name": standard, "long_name": ""}
        return data
    return None


def _levels(path: Path, keys: Mapping[str, Any]) -> Any | None:
    """The only variable of some messages, along its depths: that of the surface is a level of its own kind."""
    import xarray

    every = None
    with contextlib.suppress(ValueError):  # several kinds of levels
        every = _opened(path, keys)
    if every is not None:
        below = every if "depthBelowSea" in every.variables else None
        top = None if below is not None else every
    else:
        below = _opened(path, {**keys, "typeOfLevel": "depthBelowSea"})
        top = _opened(path, {**keys, "typeOfLevel": "oceanSurface"})
    parts = [part for part in (top, below) if part is not None and len(part.data_vars) == 1]
    if not parts:
        return None
    if len(parts) == 2:
        surface = parts[0].drop_vars("oceanSurface", errors="ignore").expand_dims(depthBelowSea=[0.0])
        parts = [xarray.concat([surface, parts[1]], "depthBelowSea")]
    if "depthBelowSea" in parts[0].variables:
        parts[0]["depthBelowSea"].attrs = dict(DEPTH)
    return parts[0]
