"""Legs in a file's grid: what makes them fast changes no bit of them."""

import math

import numpy as np
import pytest

from glider_stream.kernels.edges import STATUS, Status
from glider_stream.kernels.terrain import Seabed
from glider_stream.roadmap.evaluator import Evaluator
from glider_stream.roadmap.steering import FlowMapMethod, IntegrationSettings

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
