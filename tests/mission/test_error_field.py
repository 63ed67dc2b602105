"""The error of a forecast: its size, its scales, no divergence; the forecast that it makes of a true current."""

import numpy as np
import pytest
from helpers.missions import mission, runner

from glider_stream.kernels.flow import velocities
from glider_stream.mission.error_field import error_field
from glider_stream.mission.settings import ForecastError
from glider_stream.mission.world import Worlds, with_error
from glider_stream.water.inspect import divergence_ratio

SETTINGS = ForecastError(rms_share=0.3, length_m=100.0, depth_m=80.0, time_s=900.0)


@pytest.fixture(scope="module")
def field():
    return error_field(SETTINGS, np.random.default_rng(5))


def some_points(count, spans=(500.0, 500.0, 200.0, 3000.0)):
    return [span * (np.random.default_rng(n).random(count) - 0.5) for n, span in enumerate(spans)]


def test_an_error_has_no_divergence(field):
    x, y, z, t = some_points(200)
    step = 0.01
    by_x = (field.at(x + step, y, z, t) - field.at(x - step, y, z, t))[:, 0] / (2 * step)
    by_y = (field.at(x, y + step, z, t) - field.at(x, y - step, z, t))[:, 1] / (2 * step)
    assert np.abs(by_x).max() > 1e-5
    assert np.abs(by_x + by_y).max() < 1e-6 * np.abs(by_x).max()


def test_a_mesh_has_the_same_values(field):
    x, y, _, _ = some_points(7)
    z, t = np.array([-150.0, -20.0, 0.0]), np.array([0.0, 500.0])
    mesh = field.on_mesh(x, y, z, t)
    for n, when in enumerate(t):
        for k, height in enumerate(z):
            single = field.at(x, y, np.full(7, height), np.full(7, when))
            assert mesh[n, k] == pytest.approx(single, abs=1e-12)


@pytest.mark.parametrize(("axis", "scale"), [(0, 100.0), (1, 100.0), (2, 80.0), (3, 900.0)])
def test_the_error_loses_its_memory_over_its_scales(axis, scale):
    """The current of many random errors, along one axis and at its scale apart: exp(-1/2) of the variance.

    Across a horizontal distance the current along that distance keeps the correlation of the stream function.
    """
    together = apart = 0.0
    here = [np.zeros(1) for _ in range(4)]
    there = [np.full(1, scale if n == axis else 0.0) for n in range(4)]
    part = 1 if axis == 1 else 0
    for seed in range(600):
        one = error_field(SETTINGS, np.random.default_rng(seed))
        a, b = one.at(*here)[0, part], one.at(*there)[0, part]
        together, apart = together + a * a, apart + a * b
    assert apart / together == pytest.approx(np.exp(-0.5), abs=0.1)


def test_the_forecast_errs_by_what_was_asked(tmp_path_factory):
    worlds = runner(tmp_path_factory.getbasetemp()).worlds
    world = worlds.world(3)
    assert world.error == pytest.approx(0.3 * world.speed, rel=1e-9)
    assert world.off < 0.1 * world.error
    assert world.divergence < 0.1
    flow = world.forecast.evaluator.flow
    assert flow.extent.max_speed >= np.hypot(*np.moveaxis(flow.values, -1, 0)).max()
    again = worlds.world(3).forecast.evaluator.flow
    other = worlds.world(4).forecast.evaluator.flow
    assert np.array_equal(flow.values, again.values)
    assert not np.array_equal(flow.values, other.values)


def test_nothing_but_the_current_differs(tmp_path_factory):
    world = runner(tmp_path_factory.getbasetemp()).worlds.world(0)
    true, forecast = world.true.evaluator, world.forecast.evaluator
    assert forecast.terrain is true.terrain
    assert forecast.polar is true.polar
    assert world.forecast.goal is world.true.goal


def test_an_error_on_an_ocean_grid_stands_at_the_points_of_the_grid(tmp_path, ocean_of, field):
    """The grid of `ocean_of`: i = x / 50 + 4 and j = y / 40 + 5."""
    worlds = Worlds(mission(tmp_path))
    ocean = ocean_of(lambda i, j, z, t: (0.2 * np.sin(i / 3 + t / 900), 0.1 * np.cos(j / 4)))
    evaluator = worlds.true.evaluator.__class__(**{**vars(worlds.true.evaluator), "flow": ocean})
    true = worlds.true.__class__(**{**vars(worlds.true), "evaluator": evaluator})
    flow = with_error(true, field, SETTINGS, 900.0)
    assert {0.0, 700.0, 900.0} <= set(flow.times.tolist())
    i, j = np.meshgrid(np.arange(1.0, 8.0), np.arange(1.0, 10.0), indexing="ij")
    x, y = 50 * (i.ravel() - 4), 40 * (j.ravel() - 5)
    at = x, y, np.full(x.size, -60.0), np.full(x.size, 700.0)
    assert velocities(flow, *at) == pytest.approx(velocities(ocean, *at) + field.at(*at), abs=1e-9)


def test_a_formula_that_changes_is_sampled_finely_enough(tmp_path, gyre, field):
    worlds = Worlds(mission(tmp_path))
    evaluator = worlds.true.evaluator.__class__(**{**vars(worlds.true.evaluator), "flow": gyre})
    true = worlds.true.__class__(**{**vars(worlds.true), "evaluator": evaluator})
    scaled = field._replace(scale=2.0)
    flow = with_error(true, scaled, SETTINGS, 1400.0)
    x, y, z, t = some_points(500, (380.0, 380.0, 0.0, 0.0))
    z, t = z - 75.0, t + np.linspace(0.0, 1400.0, 500)
    exact = velocities(gyre, x, y, z, t) + scaled.at(x, y, z, t)
    off = velocities(flow, x, y, z, t) - exact
    assert np.sqrt((off**2).sum(axis=1).mean()) < 0.02 * np.sqrt((exact**2).sum(axis=1).mean())
    assert divergence_ratio(flow, (-190.0, 190.0), (-190.0, 190.0), (-140.0, -10.0), 300.0) < 0.1
