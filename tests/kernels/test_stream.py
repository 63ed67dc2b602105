"""The stream value: antisymmetric, path-independent in the plane, closed forms, adaptive quadrature."""

import math

import numpy as np
import pytest
from helpers import reference

from glider_stream.kernels.stream import stream_value
from glider_stream.water.analytic import Uniform


def pairs(count, seed, heights=(-250.0, 0.0)):
    rng = np.random.default_rng(seed)
    lo, hi = np.array([-300.0, -300.0, heights[0]]), np.array([300.0, 300.0, heights[1]])
    return [tuple(map(tuple, lo + (hi - lo) * pair)) for pair in rng.random((count, 2, 3))]


def psi(flow, x, y):
    """The stream function of vortices that are the same at all depths."""
    rows = zip(flow.x, flow.y, flow.radius, flow.speed, strict=True)
    return sum(s * r * math.exp(0.5 - ((x - a) ** 2 + (y - b) ** 2) / (2 * r * r)) for a, b, r, s in rows)


def test_antisymmetric(vortices):
    for p, q in pairs(200, seed=0):
        there, back = (stream_value(vortices, reference.pair_of(*ends)) for ends in ((p, q), (q, p)))
        assert there == pytest.approx(-back, rel=1e-12, abs=1e-12)
        assert there != 0


def test_zero_around_a_triangle_in_the_plane(planar):
    for p, q in pairs(100, seed=1):
        r = (q[1] / 2, -p[0], -70.0)
        sides = [stream_value(planar, reference.pair_of(a, b, 0.0)) for a, b in ((p, q), (q, r), (r, p))]
        assert abs(sum(sides)) < 1e-6 * max(map(abs, sides))


def test_difference_of_the_stream_function_in_the_plane(planar):
    for p, q in pairs(200, seed=2):
        expected = psi(planar, *q[:2]) - psi(planar, *p[:2])
        assert stream_value(planar, reference.pair_of(p, q, 0.0)) == pytest.approx(expected, rel=1e-6, abs=1e-7)


def test_depends_on_the_depths_where_the_flow_does(vortices, planar):
    (x, y, _), (x_q, y_q, _) = (-100.0, 30.0, 0.0), (80.0, 120.0, 0.0)
    same = [stream_value(planar, reference.pair_of((x, y, z), (x_q, y_q, -100.0))) for z in (0.0, -200.0)]
    other = [stream_value(vortices, reference.pair_of((x, y, z), (x_q, y_q, -100.0))) for z in (0.0, -200.0)]
    assert same[0] == same[1]
    assert abs(other[0] - other[1]) > 1.0


def test_closed_form_in_uniform_flow():
    flow = Uniform(0.7, -0.4).kernel((-250.0, 0.0))
    for p, q in pairs(100, seed=3):
        expected = 0.7 * (q[1] - p[1]) + 0.4 * (q[0] - p[0])
        assert stream_value(flow, reference.pair_of(p, q, 0.0)) == pytest.approx(expected, rel=1e-13, abs=1e-12)


def test_is_the_adaptive_quadrature(vortices):
    for p, q in pairs(30, seed=4):
        assert stream_value(vortices, reference.pair_of(p, q, 0.0)) == pytest.approx(
            reference.stream_value(vortices, p, q), rel=1e-6, abs=1e-7
        )


def test_follows_the_time_of_departure(gyre):
    p, q = (-200.0, 30.0, -10.0), (150.0, 120.0, -90.0)
    values = [stream_value(gyre, reference.pair_of(p, q, t)) for t in (0.0, 175.0, 525.0)]
    expected = [reference.stream_value(gyre, p, q, t) for t in (0.0, 175.0, 525.0)]
    np.testing.assert_allclose(values, expected, rtol=1e-6)
    assert np.ptp(values) > 5.0


def test_nothing_crosses_a_pair_that_is_a_point(vortices):
    assert stream_value(vortices, reference.pair_of((10.0, 20.0, -50.0), (10.0, 20.0, -150.0))) == 0.0
