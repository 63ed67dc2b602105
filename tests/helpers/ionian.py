"""A current file as Copernicus Marine serves it, made here: what the documents' commands read."""

import numpy as np


def write_ionian(file):
    """Currents about the shipped `ionian`: sea along its route alone, so that a roadmap of it is small."""
    import xarray as xr

    lon, lat = np.linspace(17.5, 19.5, 25), np.linspace(37.0, 39.0, 25)
    depth = np.array([0.5, 50.0, 200.0, 600.0, 1000.0])
    z, y, x = np.meshgrid(depth, lat, lon, indexing="ij")
    # the straight line from (18.3, 38.1) to (18.75, 37.75), and some 20 km to either side of it
    off = np.abs((x - 18.3) * 0.35 + (y - 38.1) * 0.45) / np.hypot(0.35, 0.45)
    sea = off < 0.2
    fade = np.exp(-z / 400.0)
    dims = ("time", "depth", "latitude", "longitude")
    values = {
        "uo": (0.1 * fade, "eastward_sea_water_velocity"),
        "vo": (-0.1 * fade * np.cos(3.0 * x), "northward_sea_water_velocity"),
    }
    data = {
        name: (dims, np.where(sea, value, np.nan)[None], {"standard_name": standard, "units": "m s-1"})
        for name, (value, standard) in values.items()
    }
    axes = {
        "time": ("time", np.array(["2024-11-20T12:00:00"], "datetime64[ns]")),
        "depth": ("depth", depth, {"units": "m", "positive": "down", "standard_name": "depth"}),
        "latitude": ("latitude", lat, {"units": "degrees_north", "standard_name": "latitude"}),
        "longitude": ("longitude", lon, {"units": "degrees_east", "standard_name": "longitude"}),
    }
    xr.Dataset(data, axes).to_netcdf(file, engine="h5netcdf")
