"""What a replan takes, by the roadmap's forecast and by a newer one: `replan_time.py IONIAN.nc`.

A route of 100 km across the shipped scenario's sea, replanned from a fix 16.7 hours after its departure. The
newer forecast is made of the file: 13 times, 12 hours apart, whose speeds differ by up to 15 %.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import xarray as xr

import glider_stream
from glider_stream import planner

SETS = [
    "flow.epoch=2024-11-20T12:00",
    "domain.lon=[17.9,19.1]",
    "domain.lat=[37.3,38.3]",
    "query.start=[18.1,38.15,0]",
    "query.goal=[18.9,37.5,0]",
]
FIX, WHEN = (18.40, 38.04), "2024-11-21T04:40"
RUNS = 2


def newer(file: Path, output: Path) -> None:
    """Write the newer forecast."""
    with xr.open_dataset(file) as data:
        when = np.datetime64("2024-11-20T12:00") + np.arange(13) * np.timedelta64(12, "h")
        swing = {name: 1 + 0.15 * np.sin((np.arange(13) + late) / 3) for name, late in (("uo", 0), ("vo", 2))}
        parts = {
            name: (("time", *data[name].dims[1:]), (data[name].values * s[:, None, None, None]).astype("f4"))
            for name, s in swing.items()
        }
        axes = {axis: data[axis] for axis in data["uo"].dims[1:]}
        made = xr.Dataset(
            {name: (*part, data[name].attrs) for name, part in parts.items()},
            {"time": when.astype("M8[ns]"), **axes},
        )
    made.to_netcdf(output, engine="h5netcdf")


def main(file: Path, folder: Path) -> None:
    """Print seconds of whole processes and of calls in this one."""
    road, plan, later = (folder / name for name in ("road.h5", "plan.json", "newer.nc"))
    planner.build("ionian", road, overrides=[*SETS, f"flow.file={file.absolute()}"])
    path = planner.query(road, outputs=[plan])
    print(f"{len(path.legs)} legs, {path.travel_time:.0f} s, {len(planner.info(road).position):,} nodes")
    newer(file, later)
    opened = glider_stream.open(road)
    for currents in (None, later):
        named = "the roadmap's forecast" if currents is None else "a newer one"
        more = [] if currents is None else ["--currents", str(currents)]
        fix = f"{FIX[0]},{FIX[1]},{WHEN}"
        command = [sys.executable, "-m", "glider_stream", "replan", str(plan), "--fix", fix, *more]
        for _ in range(RUNS):
            began = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            print(f"{named}, whole process: {time.perf_counter() - began:.2f} s")
        for _ in range(RUNS):
            began = time.perf_counter()
            answer = opened.replan(plan, FIX, WHEN, currents=currents)
            took = time.perf_counter() - began
            print(f"{named}, this process: {took:.2f} s, {answer.new.travel_time:.0f} s to go")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made_for:
        main(Path(sys.argv[1]), Path(made_for))
