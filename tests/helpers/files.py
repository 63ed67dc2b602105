"""Real ocean files, where they are at hand."""

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("GLIDER_STREAM_TEST_DATA") or Path(__file__).parents[3] / "shared" / "data")

real = pytest.mark.skipif(
    not (DATA / "expected_points.csv").is_file(),
    reason="no real ocean files: set GLIDER_STREAM_TEST_DATA to the folder that holds them",
)

IONIAN = DATA / "cmems_glo12_ionian_20241120T12_3d.nc"

GALICIA = DATA / "cmems_glo12_galicia_8day_4d.nc"

WASHINGTON = DATA / "hycom_rtofs_washington_surface_3hourly.nc"
