"""Small waters and gliders that several tests share: few kinds of flow, so that few kernels are compiled."""

import math
import os
import tempfile
from pathlib import Path

import numpy as np
import pytest
from helpers import forecasts

from glider_stream.kernels.flow import NO_LADDER, Extent, OceanGrid
from glider_stream.kernels.terrain import OpenWater, Seabed
from glider_stream.roadmap.builder import warm_up
from glider_stream.roadmap.evaluator import Evaluator
from glider_stream.roadmap.steering import IntegrationSettings, StreamlineMethod
from glider_stream.scenario import read_scenario
from glider_stream.vehicle.polar import polar
from glider_stream.vehicle.presets import PRESETS
from glider_stream.water.analytic import DoubleGyre, Jet, Rankine, TidalJet, Uniform, Vortex, Vortices
from glider_stream.water.sampled import sample_flow

MANY_TESTS = 1000
COMPILED_BY = {
    "gw0": [("seed-box", ["steering.method=flow-map"]), ("a.toml", [])],
    "gw1": [("seed-box", ["steering.refine=true"]), ("swinging-gyre", ["steering.method=flow-map"])],
}
"""What each of two processes compiles before all tests; else both would compile the same kernels. `a.toml` is
the scenario of a current file, made here."""


def pytest_collection_finish(session):
    mine = COMPILED_BY.get(os.environ.get("PYTEST_XDIST_WORKER"), ())
    if len(session.items) < MANY_TESTS or not mine:
        return
    with tempfile.TemporaryDirectory() as folder:
        forecasts.write(Path(folder) / "a.nc")
        (Path(folder) / "a.toml").write_text(forecasts.SCENARIO)
        for scenario, overrides in mine:
            here = Path(folder) / scenario
            warm_up(read_scenario(here if here.exists() else scenario, overrides).problem())


HEIGHTS = (-250.0, 0.0)
FIVE = (
    # x, y, radius, speed, depth, thickness
    (-120.0, 60.0, 110.0, 0.7, 40.0, 150.0),
    (100.0, 140.0, 90.0, -0.9, 120.0, 120.0),
    (60.0, -150.0, 140.0, 0.8, 200.0, 200.0),
    (-180.0, -140.0, 80.0, -0.6, 10.0, 90.0),
    (220.0, 20.0, 100.0, 0.5, 80.0, 300.0),
)


DRIFT = (0.05, -0.03)


@pytest.fixture(scope="session")
def glide():
    """The glide polar of the paper's glider."""
    return polar(PRESETS["paper"])


@pytest.fixture(scope="session")
def vortices():
    """Five vortices, each at its own depth."""
    return Vortices(tuple(Vortex(*row) for row in FIVE)).kernel(HEIGHTS)


@pytest.fixture(scope="session")
def planar():
    """The same five at all depths: the horizontal plane of the paper's predecessor."""
    return Vortices(tuple(Vortex(*row[:4]) for row in FIVE)).kernel(HEIGHTS)


@pytest.fixture(scope="session")
def sampled(vortices):
    """The five vortices on a grid so small that paths leave it."""
    return sample_flow(vortices, (15.0, 15.0, 12.5), (-230.0, 230.0), (-230.0, 230.0), HEIGHTS)


@pytest.fixture(scope="session")
def gyre():
    """A double gyre that swings as fast as a glider crosses it."""
    return DoubleGyre(amplitude=0.2, length=450.0, epsilon=0.25, period=700.0, origin=(-450.0, -225.0)).kernel(
        HEIGHTS
    )


def _slots(points):
    per_unit = 1.0 / np.diff(points).min()
    starts = points[0] + np.arange(math.ceil((points[-1] - points[0]) * per_unit)) / per_unit
    return (np.searchsorted(points, starts, side="right") - 1).astype(np.uintp), float(per_unit)


@pytest.fixture(scope="session")
def ocean_of():
    """Build an OceanGrid from a field(i, j, z, t) -> (u, v), i = x / 50 + 4 and j = y / 40 + 5."""
    levels, times = np.array([-260.0, -150.0, -60.0, -10.0]), np.array([0.0, 700.0, 1000.0])
    level_slot, slots_per_z = _slots(levels)
    time_slot, slots_per_t = _slots(times)

    def build(field):
        t, z, i, j = np.meshgrid(times, levels, np.arange(9.0), np.arange(11.0), indexing="ij")
        values = np.stack(field(i, j, z, t), axis=-1)
        corners = np.stack(np.meshgrid([0.0, 4.0, 8.0], [0.0, 5.0, 10.0], indexing="ij"), axis=-1)
        return OceanGrid(
            values=values,
            levels=levels,
            level_slot=level_slot,
            slots_per_z=slots_per_z,
            times=times,
            time_slot=time_slot,
            slots_per_t=slots_per_t,
            index_map=corners,
            per_x=1 / 200.0,
            per_y=1 / 200.0,
            ladder=NO_LADDER,
            extent=Extent(
                *(-200.0, 200.0, -200.0, 200.0),
                *(0.0, 1000.0),
                max_speed=float(np.hypot(values[..., 0], values[..., 1]).max()),
                length_scale=50.0,
            ),
        )

    return build


@pytest.fixture(scope="session")
def deep_sea():
    """A seabed that closes nothing: with it a flow of `ocean_of` needs no other kernels than a real file."""
    bottom, ends = np.full((2, 2), -1e4), np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], indexing="ij"), axis=-1)
    return Seabed(bottom, 0.0, ends, 1 / 1e4, 1 / 1e4, -5e3, -5e3, bottom)


@pytest.fixture(scope="session")
def flows(vortices, sampled, gyre, ocean_of):
    """One flow of every kind that the kernels know."""
    return {
        "uniform": Uniform(0.3, -0.2).kernel(HEIGHTS),
        "vortices": vortices,
        "gyre": gyre,
        "rankine": Rankine(10.0, -20.0, 90.0, -0.6).kernel(HEIGHTS),
        "jet": Jet(30.0, 120.0, 0.8).kernel(HEIGHTS),
        "tidal": TidalJet(30.0, 120.0, 0.8, 900.0, 250.0).kernel(HEIGHTS),
        "moving": Vortices(tuple(Vortex(*row, drift=DRIFT) for row in FIVE[:3])).kernel(HEIGHTS),
        "grid": sampled,
        "ocean": ocean_of(lambda i, j, z, t: (0.1 * np.sin(i + j + t / 400), 0.1 * np.cos(i - j + z / 100))),
    }


@pytest.fixture(scope="session")
def evaluator(glide):
    """Build an Evaluator: the paper's 125 steps of 5 s, 5 m; open water; 16 controls on the line."""

    def build(flow, method=StreamlineMethod, candidates=16, terrain=None, dt=5.0, steps=125, tolerance=5.0):
        return Evaluator(
            flow,
            OpenWater(-math.inf) if terrain is None else terrain,
            glide,
            method(candidates),
            IntegrationSettings(dt, steps, tolerance),
        )

    return build
