"""Exact glides between stops in water that rises: they end at their stops, and their slopes are right."""

import numpy as np
import pytest
from helpers.reference import replay_rising

from glider_stream.kernels.motion import traced
from glider_stream.kernels.place import Place, Velocity
from glider_stream.search.glides import Air, RisingAir, air_of
from glider_stream.water.analytic import InternalWave, Upwelling

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


def test_in_a_wave_each_leg_waits_for_those_before_it(evaluator):
    wave = InternalWave(w=0.15, length=400.0, depth=150.0, period=900.0).kernel((-150.0, 0.0))
    air = air_of(evaluator(wave))
    # so near that the last leg is there before the others settle when it leaves
    stops = np.array([[-290, 0, 0], [-1200 / 7, 0, -75], [-600 / 7, 0, 0], [600 / 7, 80, -150], [290, 50, 0]])
    guess = np.array([0.56359, 0.77498, 0.64348, 0.60327]), np.array([0.0, -2e-5, 0.45263, -0.15388])
    legs = air.glide(stops[:-1], stops[1:], *guess, 0.0)
    assert legs.exact.all()
    assert legs.departs == pytest.approx(np.concatenate([[0.0], np.cumsum(legs.time)[:-1]]), abs=1e-6)
    through = air.through(legs.angle, legs.heading, np.diff(stops[:, 2]) > 0)
    for n in range(4):
        *end, duration = replay_rising(wave, (*stops[n], legs.departs[n]), through[n], stops[n + 1, 2], 900.0)
        assert np.linalg.norm(end - stops[n + 1]) < 1e-3
        assert duration == pytest.approx(legs.time[n], abs=1e-3)


def test_water_that_does_not_rise_has_its_own_legs(evaluator, vortices):
    assert type(air_of(evaluator(vortices))) is Air
