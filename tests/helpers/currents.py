"""Small current files: a current that is linear in everything, written as real files write it."""

import numpy as np

LON, LAT = np.arange(20.0, 21.01, 0.1), np.arange(60.0, 61.01, 0.1)
DEPTH = np.array([0.5, 10.0, 30.0, 50.0, 70.0, 100.0])
DOMAIN = (20.35, 20.65), (60.35, 60.65)
EAST = {"standard_name": "eastward_sea_water_velocity", "units": "m s-1"}
NORTH = {"standard_name": "northward_sea_water_velocity", "units": "m s-1"}


def current(lon, lat, depth=0.0, hours=0.0):
    """Toward east and north [m/s]; nowhere 0 in the box of these files."""
    u = 0.3 + 0.1 * (lon - 20.5) - 0.1 * (lat - 60.5) - 0.001 * depth + 0.004 * hours
    v = -0.2 + 0.1 * (lon - 20.5) + 0.1 * (lat - 60.5) + 0.0005 * depth - 0.003 * hours
    return u, v


def dataset(lon=LON, lat=LAT, depth=DEPTH, hours=None, names=("uo", "vo")):
    """The current on axes (time, depth, lat, lon), of which time and depth may be None."""
    import xarray as xr

    axes = {"time": hours, "depth": depth, "lat": lat, "lon": lon}
    axes = {name: np.asarray(axis, float) for name, axis in axes.items() if axis is not None}
    at = dict(zip(axes, np.meshgrid(*axes.values(), indexing="ij"), strict=True))
    parts = current(at["lon"], at["lat"], at.get("depth", 0.0), at.get("time", 0.0))
    attrs = {
        "time": {"units": "hours since 2024-11-20 00:00:00", "standard_name": "time"},
        "depth": {"units": "m", "positive": "down", "standard_name": "depth"},
        "lat": {"units": "degrees_north"},
        "lon": {"units": "degrees_east"},
    }
    return xr.Dataset(
        {
            name: (tuple(axes), part, dict(words))
            for name, part, words in zip(names, parts, (EAST, NORTH), strict=True)
        },
        {name: (name, axis, attrs[name]) for name, axis in axes.items()},
    )


def both(data, change):
    """The same change to both components."""
    data = data.copy(deep=True)
    for name in [name for name in data.data_vars if name in ("uo", "vo", "u", "v")]:
        data[name] = change(data[name]).assign_attrs(data[name].attrs)
    return data


def written(folder, data, name="currents.nc", **more):
    """A NetCDF file without fills but those that the data declare."""
    for variable in data.variables.values():
        variable.encoding.setdefault("_FillValue", None)
    data.to_netcdf(folder / name, engine="h5netcdf", **more)
    return folder / name
