"""A geographic scenario in currents of one file, which may change in a corner."""

import numpy as np

SCENARIO = """\
[flow]
kind = "netcdf"
file = "a.nc"

[glider]
preset = "slocum"

[domain]
lon = [10.2, 10.6]
lat = [40.2, 40.5]
depth = [0.0, 900.0]

[sampling]
kind = "halton"
count = 500
seed = 1

[neighbours]
kind = "nearest"
k = 12

[steering]
method = "flow-map"

[integration]
dt = 60.0
steps = 120
tolerance = 150.0

[cost]
kind = "time"
"""


def write(name, change=None, dry=None):
    lon, lat = np.arange(10.0, 10.81, 0.01), np.arange(40.0, 40.71, 0.01)
    depth = np.array([0.0, 100.0, 300.0, 1000.0])
    z, y, x = np.meshgrid(depth, lat, lon, indexing="ij")
    u = 0.25 * np.sin(9 * x) * np.cos(7 * y) * np.exp(-z / 400)
    v = 0.2 * np.cos(8 * x + 5 * y) * np.exp(-z / 300)
    if change is not None:
        inside = (x < 10.29) & (y < 40.28) if change < 1 else (x > 10.5) & (y > 40.42)
        u, v = np.where(inside, change * u, u), np.where(inside, change * v, v)
    if dry is not None:
        u = np.where((x > 10.5) & (y > 40.42) & (z > dry), np.nan, u)
    dims = ("depth", "lat", "lon")
    import xarray as xr

    data = xr.Dataset(
        {"uo": (dims, u, {"units": "m/s"}), "vo": (dims, v, {"units": "m/s"})},
        {
            "depth": ("depth", depth, {"units": "m", "positive": "down"}),
            "lat": ("lat", lat, {"units": "degrees_north"}),
            "lon": ("lon", lon, {"units": "degrees_east"}),
        },
    )
    data.to_netcdf(name, engine="h5netcdf")
