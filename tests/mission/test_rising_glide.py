"""A vehicle in water that rises: its time to a depth, the surface above it, when it is lost, its forecast."""

import numpy as np
import pytest
from helpers.small import SCENARIO

from glider_stream.kernels.flow import RisingGrid, RisingOceanGrid, currents
from glider_stream.kernels.place import Place
from glider_stream.kernels.terrain import OpenWater
from glider_stream.mission.error_field import error_field
from glider_stream.mission.glide import Aim, Belief, End, Motion, glided
from glider_stream.mission.settings import ForecastError
from glider_stream.mission.world import with_error
from glider_stream.scenario import read_scenario
from glider_stream.water.analytic import Upwelling

U, V, HEADING = 0.1, 0.2, 0.5
WAVE = """\
[flow]
kind = "internal-wave"
w = 0.2
length = 600.0
depth = 150.0
period = 900.0

"""


def glide(rise, start, depth, w, duration=0.0, speed=0.4):
    """A glide along a heading in a uniform current that rises."""
    flow = Upwelling(U, V, rise).kernel((-300.0, 0.0))
    still, ahead = Belief(0.0, 0.0, speed, 0.0, 0.0), Aim(HEADING, np.empty((0, 2)), 0, 0.0, False)
    motion = Motion(speed, w, 0.0)
    return glided(flow, OpenWater(-np.inf), Place(*start, 40.0), depth, duration, motion, still, ahead, 5.0)


@pytest.mark.parametrize(("rise", "start", "depth", "w"), [(0.05, -10.0, -123.0, -0.3), (-0.1, -90.0, 0.0, 0.25)])
def test_a_glide_ends_at_its_depth_when_the_water_lets_it(rise, start, depth, w):
    flown = glide(rise, (3.0, -4.0, start), depth, w)
    time = (depth - start) / (w + rise)
    assert flown.ended == End.DEPTH
    through = 0.4 * np.array([np.cos(HEADING), np.sin(HEADING)])
    expected = [40.0 + time, 3.0 + (U + through[0]) * time, -4.0 + (V + through[1]) * time, depth]
    np.testing.assert_allclose(flown.rows[-1], expected, rtol=0, atol=1e-6)


def test_nothing_lifts_a_vehicle_out_of_the_water_and_what_carries_it_away_is_said():
    flown = glide(0.35, (0.0, 0.0, -20.0), -100.0, -0.3)
    assert flown.ended == End.CARRIED
    assert flown.rows[-1, 3] == 0.0
    assert flown.rows[:, 3].max() == 0.0
    drifted = glide(0.35, (0.0, 0.0, 0.0), 0.0, 0.0, 60.0, 0.0)
    assert drifted.ended == End.DEPTH
    np.testing.assert_allclose(drifted.rows[-1], [100.0, 6.0, 12.0, 0.0], rtol=0, atol=1e-9)


@pytest.mark.wide
@pytest.mark.parametrize("time", ["steady", 600.0])
def test_a_forecast_errs_in_u_and_v_and_keeps_what_rises(time):
    cells = "flow.kind=convection-cells", "flow.w=0.2", "flow.width=300.0", "flow.depth=300.0"
    true = read_scenario("seed-box", [*cells, "flow.sampled=[60.0,60.0,50.0]"]).problem()
    settings = ForecastError(rms_share=0.3, length_m=400.0, depth_m="all", time_s=time)
    field = error_field(settings, np.random.default_rng(5))._replace(scale=20.0)
    flow = with_error(true, field, settings, 900.0)
    assert type(flow) is (RisingGrid if time == "steady" else RisingOceanGrid)
    at = np.random.default_rng(1).uniform([-400, -400, -280, 0], [400, 400, -20, 900], (50, 4)).T
    x, y, z, t = map(np.ascontiguousarray, at)
    off, error = currents(flow, x, y, z, t) - currents(true.evaluator.flow, x, y, z, t), field.at(x, y, z, t)
    assert np.abs(off[:, 2]).max() < 1e-12
    assert np.abs(off[:, :2] - error).max() < 0.2 * np.abs(error).max()


@pytest.mark.wide
def test_the_forecast_of_a_wave_is_fine_enough_for_the_wave(tmp_path):
    text = SCENARIO[SCENARIO.index("[glider]") :]
    (tmp_path / "wave.toml").write_text(WAVE + text)
    true = read_scenario(tmp_path / "wave.toml").problem()
    settings = ForecastError(rms_share=0.3, length_m=200.0, depth_m="all", time_s="steady")
    field = error_field(settings, np.random.default_rng(5))._replace(scale=0.0)
    flow = with_error(true, field, settings, 900.0)
    assert type(flow) is RisingOceanGrid
    at = np.random.default_rng(1).uniform([-190, -190, -140, 0], [190, 190, -10, 900], (50, 4)).T
    places = [np.ascontiguousarray(one) for one in at]
    assert np.abs(currents(flow, *places) - currents(true.evaluator.flow, *places)).max() < 0.012
