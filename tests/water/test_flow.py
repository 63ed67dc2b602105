"""Flows: closed forms, stream functions, bounds; grids; Python against compiled."""

import itertools
import math
import os
import pickle
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
from scipy.special import erf

from glider_stream.kernels.flow import Extent, Grid, Level, contains, cycle, mean_velocity, velocities, velocity
from glider_stream.scenario import read_scenario
from glider_stream.water.analytic import (
    DoubleGyre,
    Jet,
    Rankine,
    SingleGyre,
    TidalJet,
    Uniform,
    Vortex,
    Vortices,
)
from glider_stream.water.inspect import divergence_ratio, is_steady
from glider_stream.water.sampled import sample_flow

HEIGHTS = (-250.0, 0.0)
KINDS = ("uniform", "vortices", "gyre", "rankine", "jet", "tidal", "moving", "grid", "ocean")


def scattered(flow, count, seed=0, reach=220.0):
    """Points (x, y, z, t) inside a flow's box."""
    rng = np.random.default_rng(seed)
    spans = (
        (max(flow.extent.x_lo, -reach), min(flow.extent.x_hi, reach)),
        (max(flow.extent.y_lo, -reach), min(flow.extent.y_hi, reach)),
        HEIGHTS,
        (max(flow.extent.t_lo, 0.0), min(flow.extent.t_hi, 3000.0)),
    )
    return tuple(lo + (hi - lo) * rng.random(count) for lo, hi in spans)


# the stream functions, written down independently; u = d psi/dy, v = -d psi/dx


def psi_uniform(flow, x, y, z, t):
    return flow.u * y - flow.v * x


def psi_vortices(flow, x, y, z, t):
    rows = zip(flow.x, flow.y, flow.radius, flow.speed, flow.depth, flow.thickness, strict=True)
    return sum(
        s * r * math.sqrt(math.e) * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * r * r) - ((-z - d) / h) ** 2)
        for a, b, r, s, d, h in rows
    )


def psi_gyre(flow, x, y, z, t):
    across, along = (y - flow.y_origin) / flow.length, (x - flow.x_origin) / flow.length
    swing = flow.epsilon * np.sin(2 * np.pi / flow.period * t)
    f = swing * along**2 + (1 - 2 * swing) * along
    return -flow.amplitude * flow.length * np.sin(np.pi * f) * np.sin(np.pi * across)


def psi_rankine(flow, x, y, z, t):
    r = np.hypot(x - flow.x, y - flow.y)
    inside = -flow.speed * r**2 / (2 * flow.radius)
    outside = -flow.speed * flow.radius * (0.5 + np.log(np.maximum(r, flow.radius) / flow.radius))
    return np.where(r <= flow.radius, inside, outside)


def psi_jet(flow, x, y, z, t):
    return flow.speed * np.clip(y - flow.y, -flow.width / 2, flow.width / 2)


def psi_tidal(flow, x, y, z, t):
    half = flow.width / 2
    now = flow.speed * np.cos(2 * np.pi * (t - flow.peak) / flow.period)
    return now * half * math.sqrt(math.pi) / 2 * erf((y - flow.y) / half)


def psi_moving(flow, x, y, z, t):
    return sum(
        psi_vortices(flow._replace(**{name: getattr(flow, name)[n : n + 1] for name in VORTEX}),
                     x - t * flow.drift_x[n], y - t * flow.drift_y[n], z, t)
        for n in range(flow.x.size)
    )  # fmt: skip


VORTEX = ("x", "y", "radius", "speed", "depth", "thickness")
STREAM_FUNCTIONS = {
    "uniform": psi_uniform,
    "vortices": psi_vortices,
    "gyre": psi_gyre,
    "rankine": psi_rankine,
    "jet": psi_jet,
    "tidal": psi_tidal,
    "moving": psi_moving,
}


@pytest.mark.parametrize("kind", STREAM_FUNCTIONS)
def test_flow_is_the_curl_of_its_stream_function(flows, kind):
    flow, psi, h = flows[kind], STREAM_FUNCTIONS[kind], 0.01
    x, y, z, t = scattered(flow, 2000)
    if kind == "jet":  # its sides are steps
        keep = np.abs(np.abs(y - flow.y) - flow.width / 2) > 2 * h
        x, y, z, t = x[keep], y[keep], z[keep], t[keep]
    uv = velocities(flow, x, y, z, t)
    u = (psi(flow, x, y + h, z, t) - psi(flow, x, y - h, z, t)) / (2 * h)
    v = -(psi(flow, x + h, y, z, t) - psi(flow, x - h, y, z, t)) / (2 * h)
    np.testing.assert_allclose(uv, np.stack([u, v], axis=-1), rtol=0, atol=3e-6 if kind == "rankine" else 1e-7)


@pytest.mark.parametrize("kind", STREAM_FUNCTIONS)
def test_flow_has_no_divergence(flows, kind):
    flow, h = flows[kind], 0.01
    x, y, z, t = scattered(flow, 2000, seed=1)
    by_x = (velocities(flow, x + h, y, z, t) - velocities(flow, x - h, y, z, t))[:, 0] / (2 * h)
    by_y = (velocities(flow, x, y + h, z, t) - velocities(flow, x, y - h, z, t))[:, 1] / (2 * h)
    scale = flow.extent.max_speed / min(flow.extent.length_scale, 1000.0)
    off_the_rim = (
        np.abs(np.hypot(x - flow.x, y - flow.y) - flow.radius) > 2 * h if kind == "rankine" else slice(None)
    )
    assert np.abs(by_x + by_y)[off_the_rim].max() < 1e-6 * scale


def test_divergence_ratio_tells_a_grid_from_its_source(vortices, sampled):
    box = (-200.0, 200.0), (-200.0, 200.0), HEIGHTS
    assert divergence_ratio(vortices, *box) < 1e-6
    assert 1e-3 < divergence_ratio(sampled, *box) < 0.2


def test_uniform_flow_is_the_same_everywhere(flows):
    uv = velocities(flows["uniform"], *scattered(flows["uniform"], 100))
    assert (uv == (0.3, -0.2)).all()
    assert flows["uniform"].extent.max_speed == math.hypot(0.3, 0.2)


@pytest.mark.parametrize("speed", [0.8, -0.8])
def test_vortex_peaks_at_its_radius_and_depth(speed):
    flow = Vortices((Vortex(20.0, -10.0, 75.0, speed, 50.0, 60.0),)).kernel(HEIGHTS)
    r = np.linspace(0.0, 400.0, 4001)
    tangential = velocities(flow, 20.0 + r, np.full_like(r, -10.0), np.full_like(r, -50.0), np.zeros_like(r))[
        :, 1
    ]
    assert r[np.argmax(np.abs(tangential))] == pytest.approx(75.0)
    assert tangential[750] == pytest.approx(speed, rel=1e-14)
    assert velocity(flow, 95.0, -10.0, -110.0, 0.0)[1] == pytest.approx(speed / math.e, rel=1e-14)
    assert velocity(flow, 20.0, -10.0, -50.0, 0.0) == (0.0, 0.0)
    assert flow.extent.max_speed == pytest.approx(abs(speed), rel=1e-9)


def test_rankine_vortex_is_continuous_at_its_rim_and_solid_within(flows):
    flow, angle = flows["rankine"], np.linspace(0, 2 * np.pi, 37)

    def tangential(r):
        x, y = flow.x + r * np.cos(angle), flow.y + r * np.sin(angle)
        uv = velocities(flow, x, y, np.zeros(37), np.zeros(37))
        assert np.abs(uv[:, 0] * np.cos(angle) + uv[:, 1] * np.sin(angle)).max() < 1e-15
        return -uv[:, 0] * np.sin(angle) + uv[:, 1] * np.cos(angle)

    np.testing.assert_allclose(tangential(flow.radius), flow.speed, rtol=1e-13)
    np.testing.assert_allclose(tangential(flow.radius - 1e-9), tangential(flow.radius + 1e-9), rtol=1e-10)
    np.testing.assert_allclose(tangential(30.0), flow.speed * 30.0 / flow.radius, rtol=1e-13)
    np.testing.assert_allclose(tangential(270.0), flow.speed / 3, rtol=1e-13)


def test_jet_ends_at_its_sides(flows):
    flow = flows["jet"]
    rows = {y: velocity(flow, 5.0, y, -10.0, 0.0) for y in (-30.1, -29.9, 30.0, 89.9, 90.1)}
    assert list(rows.values()) == [(0.0, 0.0), (0.8, 0.0), (0.8, 0.0), (0.8, 0.0), (0.0, 0.0)]


PUBLISHED = DoubleGyre(amplitude=0.1, length=1.0, epsilon=0.25, period=10.0)
"""Shadden, Lekien, Marsden 2005, Physica D 212, section 6: A = 0.1, omega = 2 pi / 10, epsilon = 0.25."""


def test_double_gyre_has_the_published_values():
    flow = PUBLISHED.kernel((-1.0, 0.0))
    rng = np.random.default_rng(3)
    x, y, t = 2 * rng.random(500), rng.random(500), 20 * rng.random(500)
    a = 0.25 * np.sin(2 * np.pi / 10 * t)
    b = 1 - 2 * a
    f, f_x = a * x**2 + b * x, 2 * a * x + b
    expected = np.stack(
        [
            -np.pi * 0.1 * np.sin(np.pi * f) * np.cos(np.pi * y),
            np.pi * 0.1 * np.cos(np.pi * f) * np.sin(np.pi * y) * f_x,
        ],
        axis=-1,
    )
    np.testing.assert_allclose(velocities(flow, x, y, np.zeros(500), t), expected, rtol=0, atol=1e-15)
    # by hand: t = 0 on the left wall, and between the gyres
    assert velocity(flow, 0.0, 0.5, 0.0, 0.0) == pytest.approx((0.0, 0.1 * math.pi), abs=1e-16)
    assert velocity(flow, 1.0, 0.5, 0.0, 0.0) == pytest.approx((0.0, -0.1 * math.pi), abs=1e-16)
    # at a quarter period f = 1 where x^2 / 4 + x / 2 = 1: the wall between the gyres is at sqrt(5) - 1
    wall = math.sqrt(5) - 1
    assert max(abs(velocity(flow, wall, across, 0.0, 2.5)[0]) for across in (0.1, 0.3, 0.7)) < 1e-15
    assert (flow.extent.x_lo, flow.extent.x_hi, flow.extent.y_lo, flow.extent.y_hi) == (0.0, 2.0, 0.0, 1.0)


def test_no_flow_crosses_the_walls_of_a_gyre(gyre):
    known = gyre.extent
    for share, t in itertools.product(np.linspace(0, 1, 9), (0.0, 175.0, 400.0)):
        x = known.x_lo + share * (known.x_hi - known.x_lo)
        y = known.y_lo + share * (known.y_hi - known.y_lo)
        through = [velocity(gyre, wall, y, 0.0, t)[0] for wall in (known.x_lo, known.x_hi)]
        through += [velocity(gyre, x, wall, 0.0, t)[1] for wall in (known.y_lo, known.y_hi)]
        assert np.abs(through).max() < 1e-15


def test_single_gyre_is_half_of_the_steady_double_one():
    single = SingleGyre(amplitude=0.3, length=100.0).kernel(HEIGHTS)
    double = DoubleGyre(amplitude=0.3, length=100.0, epsilon=0.0, period=7.0).kernel(HEIGHTS)
    assert (single.extent.x_hi, double.extent.x_hi, single.extent.y_hi) == (100.0, 200.0, 100.0)
    assert velocity(single, 30.0, 40.0, -5.0, 11.0) == velocity(double, 30.0, 40.0, -5.0, 3.0)
    assert single.extent.max_speed == pytest.approx(0.3 * math.pi)


def test_the_tide_turns():
    flow = TidalJet(0.0, 200.0, 0.9, 3600.0, peak=600.0).kernel(HEIGHTS)
    now = [velocity(flow, 5.0, 0.0, -10.0, t)[0] for t in (600.0, 1500.0, 2400.0, 4200.0)]
    assert now == pytest.approx([0.9, 0.0, -0.9, 0.9], abs=1e-12)
    assert velocity(flow, 5.0, 100.0, -10.0, 600.0) == pytest.approx((0.9 / math.e, 0.0))


def test_moving_vortices_are_vortices_that_have_moved(flows):
    flow, t = flows["moving"], 1234.0
    x, y, z, _ = scattered(flow, 500, seed=12)
    still = Vortices(
        tuple(
            Vortex(*map(float, row))
            for row in zip(
                flow.x + t * flow.drift_x, flow.y + t * flow.drift_y, *(getattr(flow, n) for n in VORTEX[2:]),
                strict=True,
            )
        )
    ).kernel(HEIGHTS)  # fmt: skip
    now, then = np.full(500, t), np.zeros(500)
    np.testing.assert_allclose(velocities(flow, x, y, z, now), velocities(still, x, y, z, then), atol=1e-14)


def test_vortices_that_may_meet_have_the_sum_of_their_speeds_as_bound():
    away, towards = (Vortex(x, 0.0, 50.0, 0.5, drift=(d, 0.0)) for x, d in ((-300.0, 0.1), (300.0, -0.1)))
    flow = Vortices((away, towards)).kernel(HEIGHTS)
    assert flow.extent.max_speed == pytest.approx(1.0)
    # side by side at 3,000 s: a point between them meets almost all of both
    opposed = Vortices((away, Vortex(300.0, 100.0, 50.0, -0.5, drift=(-0.1, 0.0)))).kernel(HEIGHTS)
    assert abs(velocity(opposed, 0.0, 50.0, 0.0, 3000.0)[0]) == pytest.approx(1.0)
    assert opposed.extent.max_speed >= 1.0


def test_each_flow_says_whether_it_changes_and_after_what_time_it_repeats(flows):
    changing = {kind: cycle(flow) for kind, flow in flows.items() if not is_steady(flow)}
    assert changing == {"gyre": 700.0, "tidal": 900.0, "moving": math.inf, "ocean": math.inf}
    for t in (0.0, 333.0):
        for kind in ("gyre", "tidal"):
            before, after = (
                velocity(flows[kind], 5.0, 20.0, -10.0, t + n * cycle(flows[kind])) for n in range(2)
            )
            assert before == pytest.approx(after, abs=1e-12)
    still = DoubleGyre(amplitude=0.3, length=100.0, epsilon=0.0, period=7.0).kernel(HEIGHTS)
    assert cycle(still) == 0.0


def test_a_flow_that_changes_may_be_known_for_some_time_alone():
    flow = TidalJet(0.0, 200.0, 0.9, 3600.0, times=(0.0, 7200.0)).kernel(HEIGHTS)
    assert contains(flow, 0.0, 0.0, 7200.0)
    assert not contains(flow, 0.0, 0.0, 7200.1)
    assert (flow.extent.t_lo, flow.extent.t_hi) == (0.0, 7200.0)


# bounds


@pytest.mark.parametrize("kind", KINDS)
def test_max_speed_bounds_every_flow(flows, kind):
    flow = flows[kind]
    uv = velocities(flow, *scattered(flow, 100_000, seed=4))
    fastest = np.hypot(uv[:, 0], uv[:, 1]).max()
    assert fastest <= flow.extent.max_speed
    assert flow.extent.max_speed <= {"vortices": 2.0, "moving": 2.0, "gyre": 1.6}.get(kind, 1.3) * fastest


@pytest.mark.parametrize("seed", range(8))
def test_max_speed_of_vortices_is_a_bound_at_most_twice_too_high(seed):
    rng = np.random.default_rng(seed)
    rows = zip(
        *rng.uniform(-400, 400, (2, 12)),
        rng.uniform(40, 140, 12),
        rng.choice([-1, 1], 12) * rng.uniform(0.2, 1.2, 12),
        rng.uniform(0, 300, 12),
        rng.uniform(60, 400, 12),
        strict=True,
    )
    flow = Vortices(tuple(Vortex(*(float(value) for value in row)) for row in rows)).kernel((-300.0, 0.0))
    lo, hi = np.array([-700.0, -700.0, -300.0]), np.array([700.0, 700.0, 0.0])
    x, y, z = (lo + (hi - lo) * rng.random((100_000, 3))).T.copy()
    uv = velocities(flow, x, y, z, np.zeros(x.size))
    fastest = np.hypot(uv[:, 0], uv[:, 1]).max()
    assert fastest <= flow.extent.max_speed <= 2 * fastest


def test_max_speed_knows_the_depths_of_interest():
    deep = Vortices((Vortex(0.0, 0.0, 50.0, 1.0, 150.0, 50.0),))
    assert deep.kernel((-50.0, 0.0)).extent.max_speed == pytest.approx(math.exp(-1), rel=1e-9)
    assert deep.kernel((-100.0, 0.0)).extent.max_speed == pytest.approx(1.0, rel=1e-9)


def test_the_papers_box_is_as_fast_as_the_paper_says():
    flow = read_scenario("seed-box").flow.kernel((-300.0, 0.0))
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-600, 600, (2, 400_000))
    uv = velocities(flow, x, y, rng.uniform(-300, 0, x.size), np.zeros(x.size))
    fastest = np.hypot(uv[:, 0], uv[:, 1]).max()
    assert fastest == pytest.approx(1.9, abs=0.03)
    assert fastest <= flow.extent.max_speed <= 2 * fastest


# grids


def multilinear(x, y, z):
    return (
        (0.2 + 1e-3 * x) * (1 - 2e-3 * y) * (0.5 + 1e-3 * z),
        (0.1 - 5e-4 * x) * (0.3 + 1e-3 * y) * (1 + 2e-3 * z),
    )


def test_grid_reproduces_a_trilinear_field_exactly():
    x, y, z = np.linspace(-100, 140, 7), np.linspace(-50, 250, 11), np.linspace(-250, 0, 5)
    zz, xx, yy = np.meshgrid(z, x, y, indexing="ij")
    values = np.stack(multilinear(xx, yy, zz), axis=-1)
    extent = Extent(-100.0, 140.0, -50.0, 250.0, -math.inf, math.inf, max_speed=1.0, length_scale=40.0)
    unused = np.zeros(len(values))
    flow = Grid(values, unused, unused, 1 / 40, 1 / 30, -250.0, 1 / 62.5, extent)
    rng = np.random.default_rng(6)
    px, py, pz = rng.uniform(-100, 140, 1000), rng.uniform(-50, 250, 1000), rng.uniform(-250, 0, 1000)
    # the corners too: the last cell's upper ends
    px[:3], py[:3], pz[:3] = (140.0, -100.0, 140.0), (250.0, -50.0, -50.0), (0.0, -250.0, 0.0)
    expected = np.stack(multilinear(px, py, pz), axis=-1)
    np.testing.assert_allclose(velocities(flow, px, py, pz, np.zeros(1000)), expected, rtol=0, atol=1e-14)
    # held beyond its levels
    assert velocity(flow, 10.0, 20.0, 9.0, 0.0) == velocity(flow, 10.0, 20.0, 0.0, 0.0)


def test_ocean_grid_reproduces_a_multilinear_field_on_uneven_levels_and_times(ocean_of):
    flow = ocean_of(
        lambda i, j, z, t: (multilinear(i, j, z)[0] * (1 + t / 500), multilinear(i, j, z)[1] - t / 2000)
    )
    rng = np.random.default_rng(7)
    x, y = rng.uniform(-200, 200, (2, 2000))
    z, t = rng.uniform(-260, -10, 2000), rng.uniform(0, 1000, 2000)
    z[:6], t[:6] = (-260, -150, -60, -10, -10, -150), (0, 700, 1000, 1000, 0, 700)
    u, v = multilinear(x / 50 + 4, y / 40 + 5, z)
    expected = np.stack([u * (1 + t / 500), v - t / 2000], axis=-1)
    np.testing.assert_allclose(velocities(flow, x, y, z, t), expected, rtol=0, atol=1e-13)


def test_sampling_converges_at_second_order(vortices):
    box = ((-200.0, 200.0), (-200.0, 200.0), (-240.0, 0.0))
    rng = np.random.default_rng(8)
    x, y = rng.uniform(-200, 200, (2, 4000))
    z = rng.uniform(-240, 0, 4000)
    truth = velocities(vortices, x, y, z, np.zeros(4000))
    errors = []
    for step in (40.0, 20.0, 10.0):
        grid = sample_flow(vortices, (step, step, step), *box)
        assert grid.values.shape == (240 / step + 1, 400 / step + 1, 400 / step + 1, 2)
        errors.append(np.sqrt(np.mean((velocities(grid, x, y, z, np.zeros(4000)) - truth) ** 2)))
    orders = [math.log2(coarse / fine) for coarse, fine in itertools.pairwise(errors)]
    assert all(1.8 < order < 2.2 for order in orders), orders


# every kind


def test_flow_is_known_in_its_box_and_span_alone(flows):
    for kind, flow in flows.items():
        known = flow.extent
        x, y, t = 0.5 * (max(known.x_lo, -9) + min(known.x_hi, 9)), 0.0, 100.0
        assert contains(flow, x, y, t), kind
        if math.isfinite(known.x_lo):
            assert contains(flow, known.x_lo, known.y_hi, t), kind
            outside = [(known.x_lo - 0.1, y), (known.x_hi + 0.1, y), (x, known.y_lo - 0.1), (x, known.y_hi + 0.1)]
            assert not any(contains(flow, *place, t) for place in outside), kind
        if math.isfinite(known.t_lo):
            assert not contains(flow, x, y, known.t_lo - 1.0), kind
            assert not contains(flow, x, y, known.t_hi + 1.0), kind
    assert Counter(math.isfinite(flow.extent.x_lo) for flow in flows.values()) == {True: 3, False: 6}


def test_extent_of_an_analytic_flow_is_what_the_scenario_says():
    flow = Uniform(0.1, 0.0, x=(-5.0, 5.0)).kernel(HEIGHTS)
    assert flow.extent[:4] == (-5.0, 5.0, -math.inf, math.inf)
    assert contains(flow, 5.0, 1e9, 0.0)
    assert not contains(flow, 5.001, 0.0, 0.0)


def test_there_is_a_flow_here_for_every_kind_of_the_kernels(flows):
    assert {type(flow) for flow in flows.values()} == set(Level.__args__)


@pytest.mark.parametrize("kind", KINDS)
def test_velocity_from_python_is_velocity_in_kernels(flows, kind):
    flow = flows[kind]
    points = scattered(flow, 200, seed=9)
    python = [velocity(flow, *(float(value) for value in point)) for point in zip(*points, strict=True)]
    np.testing.assert_allclose(velocities(flow, *points), python, rtol=1e-12, atol=1e-15)


def test_mean_flow_is_the_mean_of_two_depths(vortices):
    x, y, low, high = 30.0, 40.0, -180.0, -20.0
    mean = np.mean([velocity(vortices, x, y, z, 0.0) for z in (low, high)], axis=0)
    np.testing.assert_allclose(mean_velocity(vortices, x, y, low, high, 0.0), mean, rtol=1e-13)
    assert np.abs(np.subtract(mean, velocity(vortices, x, y, (low + high) / 2, 0.0))).max() > 0.01


UNCOMPILED = """
import pickle, sys
import numba
from glider_stream.kernels.flow import velocities
assert numba.config.DISABLE_JIT
with open(sys.argv[1], "rb") as file:
    flows, points, evaluator, batch = pickle.load(file)
answers = [velocities(flow, *points[kind]) for kind, flow in flows.items()]
with open(sys.argv[2], "wb") as file:
    pickle.dump((answers, evaluator.connect(*batch)), file)
"""


def test_compiled_kernels_give_the_numbers_of_python(flows, evaluator, sampled, tmp_path):
    points = {kind: scattered(flow, 50, seed=10) for kind, flow in flows.items()}
    rng = np.random.default_rng(11)
    position = np.column_stack([rng.uniform(-60, 60, (6, 2)), [0.0, -90.0, -40.0, -60.0, 0.0, -30.0]])
    position[4, :2] = position[0, :2]
    batch = (
        position,
        0.0,
        np.arange(6),
        np.arange(0, 31, 5),
        [q for p in range(6) for q in range(6) if q != p],
    )
    judge = evaluator(sampled, candidates=6, steps=60, tolerance=15.0)
    asked, answered = tmp_path / "asked", tmp_path / "answered"
    asked.write_bytes(pickle.dumps((flows, points, judge, batch)))
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", UNCOMPILED, asked, answered], env=environment, check=True)
    python_uv, python_edges = pickle.loads(answered.read_bytes())
    for (kind, flow), expected in zip(flows.items(), python_uv, strict=True):
        np.testing.assert_allclose(velocities(flow, *points[kind]), expected, rtol=1e-12, atol=1e-15)
    compiled = judge.connect(*batch)
    assert (compiled[:, 0] == 0).sum() >= 4
    np.testing.assert_allclose(compiled, python_edges, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Rankine(0.0, 0.0, 0.0, 1.0), "`flow.radius` must be above 0; got 0"),
        (lambda: Jet(0.0, -3.0, 1.0), "`flow.width` must be above 0; got -3"),
        (lambda: TidalJet(0.0, 9.0, 1.0, 0.0), "`flow.period` must be above 0; got 0"),
        (lambda: TidalJet(0.0, 0.0, 1.0, 9.0), "`flow.width` must be above 0; got 0"),
        (lambda: Uniform(0.1, 0.0, times=(0.0, 9.0)).kernel(HEIGHTS), "`flow.times` is for a flow that changes"),
        (lambda: TidalJet(0.0, 9.0, 1.0, 9.0, times=(5.0, 5.0)), r"`flow.times` must rise; got \[5, 5\]"),
        (lambda: Vortices(()), "at least one vortex"),
        (lambda: Vortex(0.0, 0.0, 10.0, 1.0, 0.0, 0.0), "`flow.vortex.thickness` must be above 0"),
        (lambda: DoubleGyre(amplitude=1.0, length=1.0, epsilon=0.5, period=1.0), r"`flow.epsilon`.*got 0.5"),
        (lambda: Uniform(0.0, 0.0, x=(2.0, 1.0)), r"`flow.x` must rise; got \[2, 1\]"),
        (lambda: Uniform(0.0, 0.0, sampled=(1.0, 0.0, 1.0)), "`flow.sampled` must be above 0"),
        (lambda: sample_flow(PUBLISHED.kernel(HEIGHTS), (1, 1, 1), (0, 1), (0, 1), (-1, 0)), "steady"),
        (
            lambda: sample_flow(Uniform(0.0, 0.0).kernel(HEIGHTS), (0.1, 0.1, 0.1), (0, 1e3), (0, 1e3), (-9, 0)),
            "widen",
        ),
    ],
)
def test_unusable_flows_are_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
