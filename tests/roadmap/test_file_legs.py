"""Legs in a file's grid: what makes them fast changes no bit of them."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from glider_stream.kernels.edges import GLIDE_ANGLE, SPEED, STATUS, Edge, Status
from glider_stream.kernels.flow import NO_LADDER
from glider_stream.kernels.motion import most_step
from glider_stream.kernels.terrain import Seabed
from glider_stream.roadmap.evaluator import Evaluator
from glider_stream.roadmap.steering import CALM_FAN, FAN, FlowMapMethod, IntegrationSettings, StreamlineMethod
from glider_stream.roadmap.step_error import step_error
from glider_stream.roadmap.verify import replayed_misses
from glider_stream.water.ocean.flow import grid_flow
from glider_stream.water.ocean.ladder import kink_shift

pytestmark = pytest.mark.slow
FINE = 20_000


@pytest.fixture(scope="module")
def steady(ocean_of):
    """A field that does not change: the same three times."""
    return ocean_of(lambda i, j, z, t: (0.3 * np.sin(i + j), 0.2 * np.cos(i - j + z / 100)))


@pytest.fixture(scope="module")
def legs(glide):
    """Find the legs of some nodes to all others, in a flow above a terrain."""
    places = np.random.default_rng(3).uniform([-190, -190, -200], [190, 190, 0], (120, 3))
    places[:, 2] = np.round(places[:, 2] / 50.0) * 50.0

    def found(flow, terrain):
        settings = IntegrationSettings(5.0, 125, 5.0)
        evaluator = Evaluator(flow, terrain, glide, FlowMapMethod(), settings)
        return evaluator.reach(places, 0.0, np.arange(0, 120, 6), 0)

    return found


def test_a_file_of_one_time_has_the_legs_of_one_of_equal_times(steady, deep_sea, legs):
    always = steady.extent._replace(t_lo=-math.inf, t_hi=math.inf)
    once = steady._replace(values=steady.values[:2].copy(), times=steady.times[:2], extent=always)
    for one, thrice in zip(legs(once, deep_sea), legs(steady, deep_sea), strict=True):
        np.testing.assert_array_equal(one, thrice)
        assert len(one) > 20


def test_a_look_at_whole_legs_decides_like_looks_at_their_places(steady, legs):
    # cells so many that no box, not even that of one step, is looked at as a whole
    bottom = np.random.default_rng(5).uniform(-320, -80, (9, 11))
    at = steady.index_map, steady.per_x, steady.per_y, steady.extent.x_lo, steady.extent.y_lo
    fine_map = at[0].copy()
    fine_map[..., 0] = (fine_map[..., 0] + 0.5) * FINE - 0.5
    fine = np.repeat(bottom, FINE, axis=0)
    whole = legs(steady, Seabed(bottom, 10.0, *at, bottom))
    piecewise = legs(steady, Seabed(fine, 10.0, fine_map, *at[1:], fine))
    for one, other in zip(whole, piecewise, strict=True):
        np.testing.assert_array_equal(one, other)
    status = whole[2][:, STATUS]
    assert (status == Status.BLOCKED).sum() > 20
    assert (status == Status.CONNECTED).sum() > 20


@pytest.fixture(scope="module")
def charted():
    """Currents as a file has them: levels 2 m apart at the surface and 90 m below, a jet at 30 m."""
    z = -np.array([0.5, 2.0, 4.0, 7.0, 11.0, 17.0, 26.0, 38.0, 55.0, 80.0, 120.0, 180.0, 260.0, 350.0])
    x = np.linspace(-20e3, 20e3, 9)
    t, zs, ys, xs = np.meshgrid([0.0, 7200.0, 14400.0], z, x, x, indexing="ij")
    jet = 0.1 + 0.4 * np.exp(-((zs + 30) ** 2) / 150)
    u, v = jet * np.sin(ys / 9e3 + t / 9e3), 0.5 * jet * np.cos(xs / 8e3)
    return grid_flow(x, x, z, u, v, np.array([0.0, 7200.0, 14400.0]))[0]


@pytest.fixture(scope="module")
def swum(charted, deep_sea, glide):
    """Legs of 60 nodes at five depths, in steps of 60 s and on the flow's ladder."""
    places = np.random.default_rng(8).uniform([-1500, -1500, 0], [1500, 1500, 1], (60, 3))
    places[:, 2] = np.repeat([0.0, -33.0, -90.0, -200.0, -300.0], 12)
    evaluator = Evaluator(charted, deep_sea, glide, FlowMapMethod(), IntegrationSettings(60.0, 60, 20.0))
    return evaluator, places, evaluator.reach(places, 60.0, np.arange(60), 0)


def test_legs_on_a_ladder_end_where_dop853_ends_within_the_bound(charted, swum):
    evaluator, places, (first, target, values) = swum
    source = np.repeat(np.arange(60), np.diff(first))
    connected = np.flatnonzero(values[:, STATUS] == Status.CONNECTED)
    some = connected[:: connected.size // 100]
    assert some.size >= 100
    legs = values[some, STATUS + 1 :]
    off = replayed_misses(evaluator, 60.0, places, source[some], target[some], legs)
    slowest = np.abs(values[some, SPEED] * np.sin(values[some, GLIDE_ANGLE]))
    kink = kink_shift(charted, most_step(charted, 60.0))
    assert (off <= 0.01 + charted.ladder.shift / slowest + kink).all()
    assert off.max() < 0.15
    even = evaluator.on_even_steps()
    told = step_error(SimpleNamespace(evaluator=evaluator, departure=60.0), places[source[some]], legs)
    assert "which end at levels of the file" in str(told)
    assert told.off < 0.3 < replayed_off(even, places, source[some], target[some], legs)


def test_a_drift_at_a_rung_takes_its_whole_time(charted, swum):
    """Without vertical speed no rung is ever reached, not even that at which the drift begins."""
    still = Edge(Status.CONNECTED, 300.0, 300.0, 0.0, 0.0, 0.0, 0.0)
    for height in (0.0, *charted.levels):
        path = swum[0].trace(np.array([0.0, 0.0, height]), still, 60.0)
        assert path[-1, 0] == 360.0
        assert np.isfinite(path).all()
        assert (path[:, 3] == height).all()


def replayed_off(evaluator, places, source, target, legs):
    """Return how far from their targets legs end at most in an evaluator's own steps [m]."""
    ends = [
        evaluator.trace(places[p], Edge(Status.CONNECTED, *leg), 60.0)[-1, 1:] - places[q]
        for p, q, leg in zip(source, target, legs, strict=True)
    ]
    return np.linalg.norm(ends, axis=1).max()


def test_legs_on_a_ladder_are_the_same_for_any_company(swum):
    evaluator, places, (first, target, values) = swum
    for n in (0, 17, 40):
        _, alone, legs = evaluator.reach(places, 60.0, np.array([n]), 0)
        np.testing.assert_array_equal(alone, target[first[n] : first[n + 1]])
        np.testing.assert_array_equal(legs, values[first[n] : first[n + 1]])


def test_methods_that_count_steps_have_even_ones(charted, deep_sea, glide):
    settings = IntegrationSettings(60.0, 60, 20.0)
    assert Evaluator(charted, deep_sea, glide, StreamlineMethod(8), settings).flow.ladder is NO_LADDER
    assert Evaluator(charted, deep_sea, glide, StreamlineMethod(8, refine=True), settings).flow is charted
    assert Evaluator(charted, deep_sea, glide, FlowMapMethod(), settings).steering.fan == CALM_FAN
    assert Evaluator(charted, deep_sea, glide, FlowMapMethod(FAN), settings).steering.fan == FAN
    assert Evaluator(charted, deep_sea, glide, FlowMapMethod(), replace(settings, dt=6000.0)).steering.fan == FAN
