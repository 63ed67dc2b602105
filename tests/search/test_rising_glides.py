"""Exact glides between stops in water that rises: they end at their stops, and their slopes are right."""

import numpy as np
import pytest

from glider_stream.kernels.motion import traced
from glider_stream.kernels.place import Place, Velocity
from glider_stream.search.glides import Air, RisingAir, air_of
from glider_stream.water.analytic import Upwelling

STOPS = np.array([[0.0, 0.0, -20.0], [200.0, 260.0, -200.0], [380.0, 340.0, -50.0]])
GUESS = np.array([0.6, 0.5]), np.array([0.7, 0.1])


@pytest.fixture(scope="module")
def air(evaluator):
    flow = Upwelling(0.1, 0.2, 0.02, -8e-4, 30.0, x=(-2000.0, 2000.0)).kernel((-300.0, 0.0))
    return air_of(evaluator(flow))


def test_legs_of_a_route_end_at_their_stops_and_leave_when_the_one_before_arrives(air):
    assert isinstance(air, RisingAir)
    legs = air.glide(STOPS[:-1], STOPS[1:], *GUESS, 40.0)
    assert legs.exact.all()
    assert legs.departs == pytest.approx([40.0, 40.0 + legs.time[0]], abs=1e-6)
    through = air.through(legs.angle, legs.heading, np.diff(STOPS[:, 2]) > 0)
    for n in range(2):
        start = Place(*STOPS[n], legs.departs[n])
        rows = traced(air.evaluator.flow, start, Velocity(*through[n]), legs.time[n], 5.0)
        np.testing.assert_allclose(rows[-1, 1:], STOPS[n + 1], rtol=0, atol=1e-4)


def test_slopes_are_those_of_legs_beside(air):
    legs = air.glide(STOPS[:-1], STOPS[1:], *GUESS, np.array([40.0, 300.0]))
    slopes = air.slopes(STOPS[:-1], STOPS[1:], legs)
    for column in range(7):
        around = []
        for way in (0.5, -0.5):
            ends = np.concatenate([STOPS[:-1], STOPS[1:], legs.departs[:, None]], axis=1)
            ends[:, column] += way
            around.append(air.glide(ends[:, :3], ends[:, 3:6], legs.angle, legs.heading, ends[:, 6]))
        for name in ("time", "angle", "heading"):
            by = getattr(around[0], name) - getattr(around[1], name)
            assert getattr(slopes, name)[:, column] == pytest.approx(by, rel=1e-3, abs=1e-5)


def test_water_that_does_not_rise_has_its_own_legs(evaluator, vortices):
    assert type(air_of(evaluator(vortices))) is Air
