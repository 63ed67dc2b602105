"""Drift by OceanTracker: its reader of Copernicus files, Runge-Kutta 4, no dispersion."""

import tempfile
from pathlib import Path

import xarray as xr
from harness import JOB, answer, starts, timed
from oceantracker.main import OceanTracker

lon, lat, depth = starts()


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
    tracker.add_class("reader", input_dir=str(Path(JOB["twice"]).parent), file_mask=Path(JOB["twice"]).name)
    tracker.add_class(
        "release_groups", name="all", class_name="PointRelease", pulse_size=1,
        points=list(zip(lon, lat, -depth, strict=True)),
    )  # fmt: skip
    case = tracker.run()
    tracks = xr.open_dataset(case["output_files"]["tracks_writer"][0])
    return tracks["x"].values[-1].T[:2]


ends, seconds = timed(drift)
answer("oceantracker", seconds, ends=ends)
