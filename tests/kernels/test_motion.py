"""Motion: RK4's order, closed forms, closest approach against dense output, the kept trace."""

import itertools
import math

import numpy as np
import pytest
from helpers import reference
from helpers.reference import pair_of

from glider_stream.kernels.control import DIVE, control_towards
from glider_stream.kernels.motion import Integration, along_segment, arrival_window, closest_approach, traced
from glider_stream.kernels.place import Place, Velocity
from glider_stream.water.analytic import Rankine, Uniform

HEIGHTS = (-250.0, 0.0)
GLIDES = [(0.35, -2.0), (0.45, 0.4), (0.6, 1.9), (0.3, 3.0)]


def test_rk4_converges_at_fourth_order(vortices, gyre):
    start, glide = (-60.0, 30.0, -20.0), (0.3, 0.2, -0.25)
    for flow, t in ((vortices, 0.0), (gyre, 90.0)):
        truth = reference.replay(flow, start, glide, 400.0, t)(400.0)
        errors = []
        for dt in (40.0, 20.0, 10.0, 5.0):
            rows = traced(flow, Place(*start, t), Velocity(*glide), 400.0, dt)
            assert rows.shape == (400 / dt + 1, 4)
            errors.append(math.dist(rows[-1, 1:], truth))
        orders = [math.log2(coarse / fine) for coarse, fine in itertools.pairwise(errors)]
        assert all(3.3 < order < 5.2 for order in orders[1:]), (errors, orders)
        assert errors[-1] < 1e-3


def test_straight_in_uniform_flow():
    flow = Uniform(0.3, -0.2).kernel(HEIGHTS)
    rows = traced(flow, Place(5.0, 6.0, -7.0, 100.0), Velocity(0.4, 0.5, -0.3), 42.0, 5.0)
    since = rows[:, 0] - 100.0
    np.testing.assert_array_equal(since, [*np.arange(0.0, 41.0, 5.0), 42.0])
    expected = np.array([5.0, 6.0, -7.0]) + since[:, None] * np.array([0.7, 0.3, -0.3])
    np.testing.assert_allclose(rows[:, 1:], expected, rtol=1e-13)


def test_a_spiral_in_solid_rotation():
    flow = Rankine(10.0, -20.0, 500.0, 2.0).kernel(HEIGHTS)
    spin, through = 2.0 / 500.0, 0.2 + 0.1j
    rows = traced(flow, Place(60.0, 30.0, 0.0, 0.0), Velocity(through.real, through.imag, -0.3), 600.0, 5.0)
    # with zeta = x + iy from the centre: zeta' = i spin zeta + through
    fixed = -through / (1j * spin)
    zeta = fixed + (50.0 + 50.0j - fixed) * np.exp(1j * spin * rows[:, 0])
    assert np.abs(zeta).max() < 500.0
    assert abs(rows[:, 1] + 1j * rows[:, 2] - (10 - 20j) - zeta).max() < 1e-5
    np.testing.assert_allclose(rows[:, 3], -0.3 * rows[:, 0], rtol=1e-14, atol=1e-12)


def test_trace_of_no_time_is_its_start(vortices):
    rows = traced(vortices, Place(1.0, 2.0, -3.0, 4.0), Velocity(0.1, 0.1, -0.1), 0.0, 5.0)
    np.testing.assert_array_equal(rows, [[4.0, 1.0, 2.0, -3.0]])


@pytest.mark.parametrize(("dt", "close"), [(5.0, 0.05), (1.0, 0.002)])
def test_trace_ends_where_closest_approach_says(vortices, glide, dt, close):
    start = (-60.0, 30.0, -10.0)
    for angle, heading in GLIDES:
        c = control_towards(glide, DIVE, angle, heading)
        end = reference.replay(vortices, start, c[:3], 200.0)(200.0)
        goal = end + np.array([2.0, -1.5, 0.5])
        miss, time = closest_approach(vortices, pair_of(start, goal), c, Integration(dt, int(625 / dt), 5.0))
        rows = traced(vortices, Place(*start, 0.0), c, time, dt)
        assert rows[-1, 0] == time
        assert math.dist(rows[-1, 1:], goal) == pytest.approx(miss, abs=close)
        assert 0.1 < miss < 2.6


def test_closest_approach_is_that_of_the_dense_path(vortices, gyre, glide):
    start, rng = (-60.0, 30.0, -10.0), np.random.default_rng(0)
    for flow, t in ((vortices, 0.0), (gyre, 250.0)):
        for angle, heading in GLIDES:
            c = control_towards(glide, DIVE, angle, heading)
            path = reference.replay(flow, start, c[:3], 300.0, t)
            goal = path(rng.uniform(100, 250)) + rng.uniform(-2, 2, 3)
            miss, time = reference.closest_on(path, goal, 300.0)
            found = closest_approach(flow, pair_of(start, goal, t), c, Integration(5.0, 125, 5.0))
            assert found == pytest.approx((miss, time), abs=0.1)
            assert abs(found[0] - miss) < 0.03
            finer = closest_approach(flow, pair_of(start, goal, t), c, Integration(0.5, 1250, 5.0))
            assert finer == pytest.approx((miss, time), abs=1e-2)


def test_closest_approach_is_taken_along_the_segments():
    # in one step the glider passes the target by 1 m; both ends of the step are further than the tolerance
    flow = Uniform(1.5, 0.0).kernel(HEIGHTS)
    pair = pair_of((0.0, 0.0, 0.0), (15.0, 1.0, -3.75))
    miss, time = closest_approach(flow, pair, Velocity(0.5, 0.0, -0.5), Integration(5.0, 10, 4.0))
    assert (miss, time) == pytest.approx((1.0, 7.5), rel=1e-13)


def test_a_path_that_leaves_the_flow_ends():
    known = Uniform(0.5, 0.0, x=(-50.0, 60.0)).kernel(HEIGHTS)
    everywhere = Uniform(0.5, 0.0).kernel(HEIGHTS)
    pair = pair_of((0.0, 0.0, 0.0), (200.0, 0.0, -100.0))
    leg = pair, Velocity(0.5, 0.0, -0.5), Integration(5.0, 125, 5.0)
    assert closest_approach(everywhere, *leg) == pytest.approx((0.0, 200.0), abs=1e-9)
    assert closest_approach(known, *leg)[0] > 5.0


def test_arrival_window_is_when_the_depth_is_within_the_tolerance():
    assert arrival_window(-0.5, -100.0, 5.0) == (190.0, 210.0)
    assert arrival_window(0.25, 3.0, 5.0) == (0.0, 32.0)


def test_nearest_point_of_a_segment_is_that_of_many():
    rng = np.random.default_rng(1)
    shares = np.linspace(0, 1, 20001)
    for a, b, q in rng.uniform(-10, 10, (100, 3, 3)):
        distances = np.linalg.norm(a + shares[:, None] * (b - a) - q, axis=1)
        share, distance = along_segment(*(Place(*point, 0.0) for point in (a, b, q)))
        assert distance == pytest.approx(distances.min(), abs=1e-5)
        assert distance <= distances.min()
        assert share == pytest.approx(shares[np.argmin(distances)], abs=1e-4)
