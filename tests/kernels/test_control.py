"""Controls: the plane, the line on it, the lowest-speed test, the surface, the glide polar's helpers."""

import math

import numpy as np
import pytest
from helpers.reference import pair_of

from glider_stream.kernels.control import (
    CLIMB,
    DIVE,
    NO_CONTROL,
    Streamline,
    Surface,
    angle_of_horizontal_speed,
    angle_of_vertical_speed,
    candidate_controls,
    control_plane,
    control_towards,
    direction_of,
    heading_on_line,
    horizontal_speed,
    vertical_speed,
)
from glider_stream.kernels.flow import mean_velocity
from glider_stream.kernels.place import Pair
from glider_stream.water.analytic import Uniform

SLOWEST = 0.1


def pairs(count, seed, reach=250.0):
    """Pairs of places, dives and climbs."""
    rng = np.random.default_rng(seed)
    lo, hi = np.array([-reach, -reach, -250.0]), np.array([reach, reach, 0.0])
    return [pair_of(*(lo + (hi - lo) * pair)) for pair in rng.random((count, 2, 3))]


def candidates(steering, flow, polar, pair, slowest=SLOWEST):
    """Rows (angle's magnitude, heading), or the code where there are none."""
    controls = np.full((steering.candidates, 2), np.nan)
    count = candidate_controls(steering, flow, polar, pair, slowest, controls)
    return count if count < 1 else controls[:count]


def faster(vortices, times):
    """Vortices so many times as fast."""
    extent = vortices.extent._replace(max_speed=times * vortices.extent.max_speed)
    return vortices._replace(speed=times * vortices.speed, extent=extent)


def off_plane(plane, u, v):
    """How far (u, v) is from the plane, in shares of its own size."""
    return abs(plane.a * u + plane.b * v + plane.c) / (math.hypot(plane.a, plane.b) * math.hypot(u, v))


# the plane


def test_plane_is_that_of_the_pair(vortices):
    pair = pair_of((-90.0, 40.0, -20.0), (60.0, 100.0, -120.0))
    plane = control_plane(vortices, pair)
    assert (plane.a, plane.b) == (60.0, -150.0)
    assert plane.lowest == abs(plane.c) / math.hypot(60.0, 150.0)


def test_plane_holds_the_velocities_that_cancel_the_mean_flow_across_the_line(vortices):
    # a velocity that cancels a uniform cross flow: psi_c + (u dy - v dx) = 0
    for pair in pairs(50, seed=0):
        plane = control_plane(vortices, pair)
        back = control_plane(vortices, Pair(pair.goal, pair.start))
        np.testing.assert_allclose(
            [back.a, back.b, back.c], [-plane.a, -plane.b, -plane.c], rtol=1e-12, atol=1e-9
        )
        assert back.lowest == pytest.approx(plane.lowest, rel=1e-12)


def test_every_control_on_the_line_is_on_the_plane_and_on_the_circle(vortices, glide):
    seen = 0
    for pair in pairs(300, seed=1):
        plane = control_plane(vortices, pair)
        for angle in np.linspace(glide.shallowest[0], glide.steepest[0], 7):
            horizontal = horizontal_speed(glide, direction_of(pair), angle)
            if horizontal <= plane.lowest * (1 + 1e-9):
                continue
            headings = [heading_on_line(plane, horizontal, branch) for branch in (1.0, -1.0)]
            for heading in headings:
                control = control_towards(glide, direction_of(pair), angle, heading)
                assert off_plane(plane, control.u, control.v) < 1e-12
                assert control.u**2 + control.v**2 == pytest.approx(horizontal**2, rel=1e-12)
                seen += 1
            assert headings[0] != headings[1]
    assert seen > 1000


def test_the_papers_printed_signs_leave_the_plane(vortices, glide):
    off = []
    for pair in pairs(100, seed=2):
        plane = control_plane(vortices, pair)
        r, vh = plane.a**2 + plane.b**2, glide.best_horizontal[0]
        if plane.lowest > 0.9 * vh:
            continue
        s = math.sqrt(r * vh**2 - plane.c**2)
        for branch in (1.0, -1.0):
            u = (-plane.a * plane.c + branch * plane.b * s) / r
            printed_v = (-plane.b * plane.c + branch * plane.a * s) / r
            left = plane.a * u + plane.b * printed_v + plane.c
            assert left == pytest.approx(branch * 2 * plane.a * plane.b * s / r, rel=1e-9, abs=1e-9)
            off.append(abs(left) / (math.sqrt(r) * vh))
            # ours, at the same speed
            heading = heading_on_line(plane, vh, branch)
            assert (vh * math.cos(heading), vh * math.sin(heading)) == pytest.approx(
                (u, (-plane.b * plane.c - branch * plane.a * s) / r), rel=1e-9, abs=1e-12
            )
    assert np.median(off) > 0.1


def test_straight_above_the_control_cancels_the_mean_flow(planar, vortices, glide):
    steepest = horizontal_speed(glide, DIVE, glide.steepest[0])
    cancelled = 0
    for flow in (vortices, planar):
        for x in np.linspace(-200.0, 200.0, 161):
            pair = pair_of((x, 40.0, 0.0), (x, 40.0, -100.0))
            plane = control_plane(flow, pair)
            mean = mean_velocity(flow, x, 40.0, 0.0, -100.0, 0.0)
            assert (plane.a, plane.b, plane.c) == (0.0, 0.0, 0.0)
            assert (-plane.u, -plane.v) == mean
            assert plane.lowest == pytest.approx(math.hypot(*mean), rel=1e-14)
            found = candidates(Streamline(16), flow, glide, pair)
            if plane.lowest > glide.best_horizontal[DIVE]:
                assert found == NO_CONTROL
                continue
            control = control_towards(glide, DIVE, *found[0])
            assert math.cos(control.heading - math.atan2(-mean[1], -mean[0])) == pytest.approx(1.0, abs=1e-12)
            if plane.lowest > steepest:
                np.testing.assert_allclose((control.u, control.v), np.negative(mean), rtol=0, atol=1e-12)
                cancelled += 1
    assert cancelled >= 5


# the lowest-speed test


def test_lowest_speed_test_is_the_brute_force_over_glide_angle_and_heading(vortices, glide):
    angles = np.linspace(glide.shallowest[0], glide.steepest[0], 200)
    headings = np.linspace(-math.pi, math.pi, 721)
    verdicts = []
    strong = faster(vortices, 2.5)
    for pair in pairs(300, seed=3):
        direction = direction_of(pair)
        plane = control_plane(strong, pair)
        if abs(plane.lowest / glide.best_horizontal[direction] - 1) < 1e-3:
            continue
        along = np.array([horizontal_speed(glide, direction, angle) for angle in angles])[:, None]
        off = plane.a * along * np.cos(headings) + plane.b * along * np.sin(headings) + plane.c
        possible = bool(((off.min(axis=1) <= 0) & (off.max(axis=1) >= 0)).any())
        for steering in (Streamline(1), Streamline(16)):
            found = candidates(steering, strong, glide, pair, slowest=0.0)
            assert (isinstance(found, int) and found == NO_CONTROL) == (not possible)
        verdicts.append(possible)
    assert 30 < verdicts.count(False) < len(verdicts) - 30


# candidates


@pytest.mark.parametrize("count", [1, 2, 16, 17, 54])
def test_line_candidates_are_counted_even_in_angle_and_on_the_plane(vortices, glide, count):
    seen = 0
    for pair in pairs(60, seed=4):
        found = candidates(Streamline(count), vortices, glide, pair)
        if isinstance(found, int):
            continue
        seen += 1
        assert len(found) == count
        plane, direction = control_plane(vortices, pair), direction_of(pair)
        for angle, heading in found:
            control = control_towards(glide, direction, angle, heading)
            assert off_plane(plane, control.u, control.v) < 1e-7  # S loses half its digits where it vanishes
            assert abs(control.w) >= SLOWEST
            assert glide.shallowest[0] <= angle <= glide.steepest[0]
            assert math.copysign(1, control.w) == (1 if direction == CLIMB else -1)
        # steepest first, the two branches of each angle together, even steps
        assert (found[:-1:2, 0] == found[1::2, 0])[: count // 2].all()
        np.testing.assert_allclose(np.diff(found[::2, 0], 2), 0, atol=1e-12)
        assert (np.diff(found[::2, 0]) < 0).all()
    assert seen > 20


def test_line_candidates_span_the_whole_feasible_range(vortices, glide):
    for pair in pairs(12, seed=5):
        found = candidates(Streamline(100), vortices, glide, pair)
        if isinstance(found, int):
            continue
        direction, lowest = direction_of(pair), control_plane(vortices, pair).lowest
        angles = np.linspace(glide.shallowest[0], glide.steepest[0], 4001)
        able = [
            horizontal_speed(glide, direction, angle) >= lowest
            and vertical_speed(glide, direction, angle) >= SLOWEST
            for angle in angles
        ]
        span = angles[able]
        assert found[0, 0] == pytest.approx(span[-1], abs=np.ptp(span) / 75 + 1e-3)
        assert found[-1, 0] == pytest.approx(span[0], abs=np.ptp(span) / 75 + 1e-3)


def test_no_candidate_where_the_depth_cannot_be_reached(glide):
    # the plane asks for more than the horizontal speed of the steepest glide
    lowest = 0.5 * (horizontal_speed(glide, DIVE, glide.steepest[0]) + glide.best_horizontal[DIVE])
    flow = Uniform(0.0, lowest).kernel((-250.0, 0.0))
    pair = pair_of((0.0, 0.0, 0.0), (100.0, 0.0, -100.0))
    steep = angle_of_horizontal_speed(glide, DIVE, lowest, glide.steepest[0])
    fastest = vertical_speed(glide, DIVE, steep)
    assert steep < glide.steepest[DIVE]
    assert len(candidates(Streamline(4), flow, glide, pair, 0.999 * fastest)) == 4
    assert candidates(Streamline(4), flow, glide, pair, 1.001 * fastest) == 0


@pytest.mark.parametrize("count", [16, 54, 100, 400])
def test_surface_candidates_are_even_in_both(vortices, glide, count):
    found = candidates(Surface(count), vortices, glide, pair_of((0.0, 0.0, 0.0), (50.0, 60.0, -100.0)))
    assert len(found) == count
    angle = (found[:, 0] - glide.shallowest[0]) / (glide.steepest[0] - glide.shallowest[0])
    turn = (found[:, 1] + math.pi) / (2 * math.pi)
    assert ((angle > 0) & (angle < 1) & (turn >= 0) & (turn < 1)).all()
    assert (np.diff(angle) < 0).all()
    for shares in (np.histogram(angle, 4, (0, 1))[0], np.histogram(turn, 4, (0, 1))[0]):
        assert np.abs(shares - count / 4).max() <= 2
    assert np.abs(np.histogram2d(angle, turn, 2, [(0, 1), (0, 1)])[0] - count / 4).max() <= 2


def test_surface_candidates_do_not_depend_on_the_pair(vortices, planar, glide):
    first = candidates(Surface(20), vortices, glide, pair_of((0.0, 0.0, 0.0), (50.0, 60.0, -100.0)))
    other = candidates(Surface(20), planar, glide, pair_of((9.0, 5.0, -10.0), (-50.0, 60.0, -60.0)), slowest=0.0)
    assert (first == other).all()


# the glide polar


@pytest.mark.parametrize("direction", [DIVE, CLIMB])
def test_control_towards_has_the_speed_and_the_signs_of_its_angle(glide, direction):
    angle, heading = 0.5, 2.5
    c = control_towards(glide, direction, angle, heading)
    assert math.hypot(c.u, c.v, c.w) == pytest.approx(c.speed, rel=1e-14)
    assert math.hypot(c.u, c.v) == pytest.approx(horizontal_speed(glide, direction, angle), rel=1e-14)
    assert abs(c.w) == pytest.approx(vertical_speed(glide, direction, angle), rel=1e-14)
    assert math.copysign(1.0, c.w) == math.copysign(1.0, c.glide_angle) == (1.0 if direction == CLIMB else -1.0)
    assert math.atan2(c.v, c.u) == pytest.approx(heading, rel=1e-14)
    assert (abs(c.glide_angle), c.heading) == (angle, heading)


@pytest.mark.parametrize("direction", [DIVE, CLIMB])
def test_angle_of_vertical_speed_inverts_it(glide, direction):
    low, high = (vertical_speed(glide, direction, end[direction]) for end in (glide.shallowest, glide.steepest))
    for speed in np.linspace(low, high, 23):
        angle = angle_of_vertical_speed(glide, direction, speed)
        assert vertical_speed(glide, direction, angle) == pytest.approx(speed, rel=1e-12)
        assert vertical_speed(glide, direction, angle) >= speed
    assert angle_of_vertical_speed(glide, direction, 0.5 * low) == glide.shallowest[direction]
    assert math.isnan(angle_of_vertical_speed(glide, direction, 1.001 * high))


@pytest.mark.parametrize("direction", [DIVE, CLIMB])
def test_angle_of_horizontal_speed_inverts_it_on_either_side_of_the_fastest(glide, direction):
    best = glide.best_angle[direction]
    for outer in (glide.shallowest[direction], glide.steepest[direction]):
        slow = horizontal_speed(glide, direction, outer)
        for speed in np.linspace(slow, glide.best_horizontal[direction] * (1 - 1e-6), 23)[1:]:
            angle = angle_of_horizontal_speed(glide, direction, speed, outer)
            assert min(outer, best) <= angle <= max(outer, best)
            assert horizontal_speed(glide, direction, angle) == pytest.approx(speed, rel=1e-9)
        assert angle_of_horizontal_speed(glide, direction, 0.9 * slow, outer) == outer
