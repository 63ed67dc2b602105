"""Drift by OceanTracker: its reader of Copernicus files, Runge-Kutta 4, no dispersion.

Its reader wants the product's file of land and depths. That one is made from the currents' own land mask: `mask`
is where there is a current, `deptho` the depth of the deepest level with water, `deptho_lev` how many have it, -1
on land. The reader is the one that keeps the file's own nodes. What 0.5.3.9 takes by itself makes currents four
times as fast: it divides a sum of four by `isfinite(a) + isfinite(b) + ...`, which NumPy adds to one.
"""

import contextlib
import io
import tempfile
from pathlib import Path

import xarray as xr
from harness import JOB, answer, starts, timed
from oceantracker.main import OceanTracker

READER = "oceantracker.reader.GLORYS_reader.GLORYSreaderSubgrid"
lon, lat, depth = starts()
folder = Path(tempfile.mkdtemp())
data = xr.open_dataset(JOB["twice"]).load()
data.to_netcdf(folder / "currents.nc", engine="h5netcdf")
water = data["uo"].isel(time=0, drop=True).notnull()
land = {"mask": water.astype("int8"), "deptho": data["depth"].where(water).max("depth")}
land["deptho_lev"] = water.sum("depth").where(water.any("depth"), -1).astype("int32")
xr.Dataset(land).to_netcdf(folder / "static.nc", engine="h5netcdf")


def drift():
    tracker = OceanTracker()
    tracker.settings(
        root_output_dir=tempfile.mkdtemp(),
        output_file_base="drift",
        time_step=JOB["step_s"],
        use_dispersion=False,
        screen_output_time_interval=JOB["lasting_s"],
        processors=1,
        max_run_duration=JOB["lasting_s"],
    )
    tracker.add_class("reader", class_name=READER, input_dir=str(folder), file_mask="*.nc")
    tracker.add_class(
        "release_groups", name="all", class_name="PointRelease", pulse_size=1,
        points=list(zip(lon, lat, -depth, strict=True)),
    )  # fmt: skip
    with contextlib.redirect_stdout(io.StringIO()) as said:
        case = tracker.run()
    if case is None:  # it prints why
        raise RuntimeError(next(line for line in said.getvalue().splitlines() if "rror" in line))
    tracks = xr.open_dataset(next(Path(case).parent.glob("tracks*.nc")))
    return tracks["x"].values[-1].T[:2]


ends, seconds = timed(drift)
answer("oceantracker", seconds, ends=ends)
