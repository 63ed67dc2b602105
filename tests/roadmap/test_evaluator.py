"""Edges: the literal loop, the exactness in the plane, degenerate pairs, threads and batches."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import reference
from helpers.reference import pair_of

from glider_stream.base.errors import InputError
from glider_stream.base.threads import threads
from glider_stream.kernels.connect import connect_nodes
from glider_stream.kernels.control import (
    CLIMB,
    DIVE,
    control_plane,
    control_towards,
    heading_on_line,
    horizontal_speed,
)
from glider_stream.kernels.edges import Status
from glider_stream.kernels.flow import velocity
from glider_stream.kernels.motion import traced
from glider_stream.kernels.place import Place
from glider_stream.kernels.terrain import Seabed, allowed
from glider_stream.roadmap.builder import build_roadmap
from glider_stream.roadmap.neighbours import Nearest
from glider_stream.roadmap.nodes import RandomSampler
from glider_stream.roadmap.problem import Problem
from glider_stream.roadmap.roadmap import EDGE_FIELDS
from glider_stream.roadmap.steering import IntegrationSettings, StreamlineMethod, SurfaceMethod
from glider_stream.search.query import Planner
from glider_stream.water.analytic import Uniform, Vortex, Vortices
from glider_stream.water.sampled import sample_flow

both_methods = pytest.mark.parametrize("method", [StreamlineMethod, SurfaceMethod])
METRES = 1e-9
"""Misses of paths some hundred metres long, in coordinates of some hundred metres."""


def count_statuses(outcomes):
    """How many pairs ended in each status, by its name in lower case."""
    counts = np.bincount(outcomes[:, 0].astype(np.int64), minlength=len(Status))
    return {status.name.lower(): int(counts[status]) for status in Status}


def nodes(count, seed, reach=150.0):
    """Random nodes, half of them on five levels, so that some share their depth."""
    rng = np.random.default_rng(seed)
    position = np.array([-reach, -reach, -200.0]) + np.array([2 * reach, 2 * reach, 200.0]) * rng.random(
        (count, 3)
    )
    position[::2, 2] = -50.0 * rng.integers(0, 5, len(position[::2]))
    return position


def all_pairs(count):
    """source, indptr, target of every node to every other."""
    target = [q for p, q in itertools.product(range(count), repeat=2) if p != q]
    return np.arange(count), np.arange(0, count * (count - 1) + 1, count - 1), np.array(target)


def literal(judge, position, departure, source, indptr, target):
    """The literal loop's answer to what `judge.connect` was asked."""
    return reference.literal_edges(
        judge.flow,
        judge.polar,
        judge.steering.kernel(),
        judge.integration.kernel(),
        position,
        np.broadcast_to(np.asarray(departure, float), len(position)).copy(),
        np.repeat(source, np.diff(indptr)),
        target,
    )


def check_against_literal(judge, position, departure, least):
    """Every pair's answer is the literal loop's."""
    asked = (position, departure, *all_pairs(len(position)))
    fast, slow = judge.connect(*asked), literal(judge, *asked)
    connected = fast[:, 0] == Status.CONNECTED
    assert connected.sum() >= least
    np.testing.assert_array_equal(connected, slow[:, 0] == 1)
    np.testing.assert_allclose(fast[connected, 1:6], slow[connected, 1:6], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(fast[connected, 6], slow[connected, 6], rtol=0, atol=METRES)
    assert np.isnan(fast[~connected, 1:]).all()
    assert sum(count_statuses(fast).values()) == len(fast)
    return fast


# the fast path changes no result


@pytest.mark.wide
@pytest.mark.slow
@both_methods
def test_equals_the_literal_loop_in_vortices(evaluator, vortices, method):
    check_against_literal(evaluator(vortices, method), nodes(60, seed=0), 0.0, least=20)


@pytest.mark.slow
@both_methods
def test_equals_the_literal_loop_in_the_plane(evaluator, planar, method):
    check_against_literal(evaluator(planar, method, candidates=9), nodes(60, seed=1), 0.0, least=20)


@pytest.mark.slow
@both_methods
def test_equals_the_literal_loop_on_a_grid_that_paths_leave(evaluator, sampled, method):
    check_against_literal(
        evaluator(sampled, method, candidates=24), nodes(60, seed=2, reach=225.0), 0.0, least=20
    )


@pytest.mark.slow
def test_equals_the_literal_loop_in_a_flow_that_changes_with_time(evaluator, gyre):
    position = nodes(40, seed=3)
    departure = np.random.default_rng(4).uniform(0, 700, 40)
    judge = evaluator(gyre, SurfaceMethod, candidates=60, tolerance=10.0)
    fast = check_against_literal(judge, position, departure, least=50)
    steady = judge.connect(position, np.zeros(40), *all_pairs(40))
    assert (fast[:, 0] != steady[:, 0]).sum() > 20


@pytest.mark.parametrize(
    ("dt", "steps", "tolerance"),
    [(5.0, 125, 25.0), (5.0, 30, 5.0), (17.0, 40, 8.0), (2.0, 300, 0.5), (60.0, 6, 40.0)],
)
def test_equals_the_literal_loop_whatever_the_steps(evaluator, sampled, dt, steps, tolerance):
    judge = evaluator(sampled, dt=dt, steps=steps, tolerance=tolerance)
    check_against_literal(judge, nodes(36, seed=5), 0.0, least=3)


def test_a_leg_is_what_an_independent_integrator_flies(evaluator, vortices):
    judge, position = evaluator(vortices, candidates=32), nodes(40, seed=6)
    source, indptr, target = all_pairs(40)
    rows = judge.connect(position, 0.0, source, indptr, target)
    connected = np.flatnonzero(rows[:, 0] == Status.CONNECTED)
    for n in connected[:: max(1, len(connected) // 12)]:
        _, time, cost, angle, heading, speed, miss = rows[n]
        start, goal = position[n // 39], position[target[n]]
        along = speed * math.cos(angle)
        through = (along * math.cos(heading), along * math.sin(heading), speed * math.sin(angle))
        path = reference.replay(vortices, start, through, time + 30.0)
        off, when = reference.closest_on(path, goal, time + 30.0)
        assert (off, when) == pytest.approx((miss, time), abs=0.1)
        assert cost == time
        assert math.copysign(1, angle) == math.copysign(1, goal[2] - start[2])
        edge = judge.connect_pair(start, goal)
        assert (edge.time, edge.miss) == (time, miss)
        assert math.dist(judge.trace(start, edge, 0.0)[-1, 1:], goal) == pytest.approx(miss, abs=0.05)


# the plane: one streamline of the total motion leads from p to q


def landing(flow, polar, pair, angle, branch, printed=False):
    """Offset from q at q's depth, along and across the motion; the control on the line, and its path."""
    direction = CLIMB if pair[5] > pair[2] else DIVE
    plane = control_plane(flow, pair_of(pair[:3], pair[3:]))
    horizontal = horizontal_speed(polar, direction, angle)
    heading = heading_on_line(plane, horizontal, branch)
    if printed:  # the paper's same sign on both: v = (-B C + branch A S) / R
        r, u, v = plane.a**2 + plane.b**2, horizontal * math.cos(heading), horizontal * math.sin(heading)
        heading = math.atan2(-2 * plane.b * plane.c / r - v, u)
    c = control_towards(polar, direction, angle, heading)
    rows = traced(flow, Place(*pair[:3], 0.0), c, abs((pair[5] - pair[2]) / c.w), 2.0)
    off = rows[-1, 1:3] - pair[3:5]
    moving = np.add(velocity(flow, *pair[3:], 0.0), (c.u, c.v))
    moving /= np.linalg.norm(moving)
    return float(off @ moving), float(off[1] * moving[0] - off[0] * moving[1]), c, rows


def crossings(flow, polar, pair, near=40.0, **options):
    """Angles between which a path passes q, by branch."""
    direction = CLIMB if pair[5] > pair[2] else DIVE
    lowest = control_plane(flow, pair_of(pair[:3], pair[3:])).lowest
    angles = [
        angle
        for angle in np.linspace(polar.steepest[direction], polar.shallowest[direction] * 1.5, 60)
        if horizontal_speed(polar, direction, angle) > lowest
    ]
    for branch in (1.0, -1.0):
        offs = [landing(flow, polar, pair, angle, branch, **options)[:2] for angle in angles]
        for (low, high), (a, b) in zip(itertools.pairwise(angles), itertools.pairwise(offs), strict=True):
            if a[0] * b[0] < 0 and math.hypot(*a) < near and math.hypot(*b) < near:
                yield branch, low, high


def best_miss(flow, polar, pair, branch, low, high, **options):
    """Bisect the glide angle until the path passes q, neither early nor late; the distance then."""
    early = landing(flow, polar, pair, low, branch, **options)[0] > 0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if (landing(flow, polar, pair, middle, branch, **options)[0] > 0) == early:
            low = middle
        else:
            high = middle
    return math.hypot(*landing(flow, polar, pair, middle, branch, **options)[:2])


def plane_pairs(count):
    rng = np.random.default_rng(7)
    for _ in range(count):
        turn, reach = rng.uniform(0, 2 * math.pi), rng.uniform(80, 220)
        x, y = rng.uniform(-100, 100, 2)
        yield (x, y, -10.0, x + reach * math.cos(turn), y + reach * math.sin(turn), -150.0)


def test_in_the_plane_a_control_on_the_line_reaches_its_goal(planar, glide):
    misses = []
    for pair in plane_pairs(25):
        misses += [best_miss(planar, glide, pair, *found) for found in crossings(planar, glide, pair)]
    assert len(misses) >= 12
    assert max(misses) < 0.5


def test_the_papers_printed_signs_miss_it(planar, glide):
    misses = []
    for pair in plane_pairs(25):
        for found in crossings(planar, glide, pair, near=80.0, printed=True):
            misses.append(best_miss(planar, glide, pair, *found, printed=True))
    assert misses
    assert np.median(misses) > 5.0


def test_in_the_plane_a_path_stays_on_its_streamline(planar, glide):
    def psi(x, y):
        rows = zip(planar.x, planar.y, planar.radius, planar.speed, strict=True)
        return sum(s * r * np.exp(0.5 - ((x - a) ** 2 + (y - b) ** 2) / (2 * r * r)) for a, b, r, s in rows)

    for pair in plane_pairs(10):
        plane = control_plane(planar, pair_of(pair[:3], pair[3:]))
        if plane.lowest > 0.8 * glide.best_horizontal[DIVE]:
            continue
        for branch in (1.0, -1.0):
            *_, c, rows = landing(planar, glide, pair, float(glide.best_angle[DIVE]), branch)
            total = psi(rows[:, 1], rows[:, 2]) + c.u * rows[:, 2] - c.v * rows[:, 1]
            assert np.ptp(total) < 1e-4
            assert psi(*pair[3:5]) + c.u * pair[4] - c.v * pair[3] == pytest.approx(total[0], abs=1e-5)


# degenerate pairs: a defined answer each


def test_equal_depth_gives_no_edge(evaluator, vortices):
    edge = evaluator(vortices).connect_pair([0.0, 0.0, -50.0], [60.0, 0.0, -50.0])
    assert edge.status == Status.SAME_DEPTH
    assert np.isnan(edge[1:]).all()
    assert evaluator(vortices).connect_pair([0.0, 0.0, -50.0], [0.0, 0.0, -50.0]).status == Status.SAME_DEPTH


@both_methods
def test_straight_below_in_a_current_that_the_glider_can_cancel(evaluator, glide, method):
    # as strong as its fastest glide but a little: the angle that cancels it lies within the range
    wanted = 0.5 * (horizontal_speed(glide, DIVE, glide.steepest[0]) + glide.best_horizontal[DIVE])
    flow = Vortices((Vortex(0.0, -20e3, 20e3, wanted),)).kernel((-250.0, 0.0))
    edge = evaluator(flow, method, candidates=400).connect_pair([0.0, 0.0, 0.0], [0.0, 0.0, -100.0])
    assert edge.status == Status.CONNECTED
    assert abs(math.remainder(edge.heading, 2 * math.pi)) < (0.001 if method is StreamlineMethod else 0.1)
    if method is StreamlineMethod:
        assert edge.speed * math.cos(edge.glide_angle) == pytest.approx(wanted, rel=1e-6)
        assert edge.miss < 0.2


def test_straight_below_in_a_current_too_weak_or_too_strong(evaluator):
    for speed, status in ((0.0, Status.NO_HIT), (0.95, Status.CURRENT_TOO_STRONG)):
        flow = Vortices((Vortex(0.0, -20e3, 20e3, speed),)).kernel((-250.0, 0.0))
        assert evaluator(flow).connect_pair([0.0, 0.0, 0.0], [0.0, 0.0, -100.0]).status == status


@pytest.mark.parametrize("candidates", [1, 2, 3])
def test_few_candidates_work(evaluator, vortices, candidates):
    for goal in ([0.0, 0.0, -60.0], [30.0, 40.0, -60.0]):
        edge = evaluator(vortices, candidates=candidates).connect_pair([0.0, 0.0, 0.0], goal)
        assert edge.status in (Status.CONNECTED, Status.NO_HIT)


def test_outside_the_flow(evaluator, sampled, gyre):
    inside, outside = [0.0, 0.0, 0.0], [240.0, 0.0, -60.0]
    for pair in ((inside, outside), (outside, inside), (outside, outside)):
        assert evaluator(sampled).connect_pair(*pair).status == Status.OUTSIDE_FLOW
    known = gyre._replace(extent=gyre.extent._replace(t_lo=0.0, t_hi=900.0))
    reach = evaluator(known, SurfaceMethod, candidates=2000)
    assert reach.connect_pair([0.0, 0.0, 0.0], [60.0, 30.0, -60.0], 0.0).status == Status.CONNECTED
    assert reach.connect_pair([0.0, 0.0, 0.0], [60.0, 30.0, -60.0], 901.0).status == Status.OUTSIDE_FLOW


def test_too_far_down_or_away(evaluator, vortices, glide):
    deepest = 625.0 * float(glide.speed[DIVE, -1] * math.sin(glide.steepest[DIVE]))
    judge = evaluator(vortices)
    assert judge.connect_pair([0.0, 0.0, 0.0], [9.0, 0.0, -1.001 * deepest]).status == Status.TOO_FAR
    assert judge.connect_pair([0.0, 0.0, 0.0], [9.0, 0.0, -0.999 * deepest]).status != Status.TOO_FAR
    reach = 625.0 * (float(glide.best_horizontal[DIVE]) + vortices.extent.max_speed) + 5.0
    assert judge.connect_pair([0.0, 0.0, 0.0], [1.001 * reach, 0.0, -100.0]).status == Status.TOO_FAR


def test_a_current_faster_than_the_glider_everywhere(evaluator):
    flow = sample_flow(
        Uniform(2.0, 0.0).kernel((-250.0, 0.0)),
        (300.0, 300.0, 300.0),
        (-900.0, 900.0),
        (-900.0, 900.0),
        (-250.0, 0.0),
    )
    judge = evaluator(flow, candidates=54, tolerance=20.0)
    across = judge.connect_pair([0.0, 0.0, 0.0], [0.0, 200.0, -100.0])
    upstream = judge.connect_pair([0.0, 0.0, 0.0], [-200.0, 0.0, -100.0])
    downstream = judge.connect_pair([0.0, 0.0, 0.0], [400.0, 30.0, -100.0])
    assert across.status == Status.CURRENT_TOO_STRONG
    assert upstream.status == Status.NO_HIT
    assert downstream.status == Status.CONNECTED
    surface = evaluator(flow, SurfaceMethod, candidates=54, tolerance=20.0)
    assert surface.connect_pair([0.0, 0.0, 0.0], [0.0, 200.0, -100.0]).status == Status.NO_HIT


def test_closed_form_in_uniform_flow(evaluator, sampled, glide):
    # the same current at all samples: straight over ground, so the leg is a triangle of velocities
    extent = sampled.extent._replace(max_speed=0.2 * math.sqrt(2))
    flow = sampled._replace(values=np.full_like(sampled.values, 0.2), extent=extent)
    edge = evaluator(flow, candidates=2000).connect_pair([0.0, 0.0, 0.0], [120.0, -40.0, -100.0])
    assert edge.status == Status.CONNECTED
    along = edge.speed * math.cos(edge.glide_angle)
    over_ground = np.array(
        [
            along * math.cos(edge.heading) + 0.2,
            along * math.sin(edge.heading) + 0.2,
            edge.speed * math.sin(edge.glide_angle),
        ]
    )
    goal = np.array([120.0, -40.0, -100.0])
    assert edge.time == pytest.approx(goal @ over_ground / (over_ground @ over_ground), rel=1e-9)
    assert edge.miss == pytest.approx(np.linalg.norm(over_ground * edge.time - goal), abs=1e-9)


def seabed(bottom):
    """A bottom over [-300, 300]^2 in cells of 30 m around its grid points."""
    ends = np.stack(np.meshgrid([0.0, 20.0], [0.0, 20.0], indexing="ij"), axis=-1)
    x, y = np.meshgrid(np.linspace(-300, 300, 21), np.linspace(-300, 300, 21), indexing="ij")
    height = bottom(x, y) + np.zeros((21, 21))
    return Seabed(height, 5.0, ends, 1 / 600, 1 / 600, -300.0, -300.0, height)


@pytest.mark.slow
def test_land_and_seabed_block(evaluator, vortices):
    position = nodes(40, seed=8)
    asked = (position, 0.0, *all_pairs(40))
    open_water = evaluator(vortices, SurfaceMethod, candidates=60, tolerance=20.0).connect(*asked)
    wide = evaluator(
        vortices, SurfaceMethod, candidates=60, tolerance=20.0, terrain=seabed(lambda x, y: -5000.0)
    ).connect(*asked)
    np.testing.assert_array_equal(wide, open_water)
    ridge = seabed(lambda x, y: np.where(np.abs(x) < 40, -60.0, -5000.0))
    judge = evaluator(vortices, SurfaceMethod, candidates=60, tolerance=20.0, terrain=ridge)
    rows = judge.connect(*asked)
    blocked = rows[:, 0] == Status.BLOCKED
    assert blocked.sum() > 20
    assert (open_water[blocked, 0] == Status.CONNECTED).all()
    assert (rows[:, 0] == Status.CONNECTED).sum() > 20
    # a leg that is left clears the ridge all along; it is no cheaper than without the ridge
    connected = np.flatnonzero(rows[:, 0] == Status.CONNECTED)
    assert (rows[connected, 2] >= open_water[connected, 2]).all()
    for n in connected[::3]:
        start, goal = position[n // 39], position[asked[4][n]]
        path = judge.trace(start, judge.connect_pair(start, goal), 0.0)[:, 1:]
        assert all(
            allowed(ridge, *place) for a, b in itertools.pairwise(path) for place in np.linspace(a, b, 5)[:-1]
        )
    island = evaluator(
        vortices, SurfaceMethod, candidates=60, tolerance=20.0, terrain=seabed(lambda x, y: 3.0)
    ).connect(*asked)
    assert not (island[:, 0] == Status.CONNECTED).any()
    assert ((island[:, 0] == Status.BLOCKED) == (open_water[:, 0] == Status.CONNECTED)).all()
    assert not judge.allowed(np.array([[0.0, 0.0, -56.0]]))[0]
    assert judge.allowed(np.array([[0.0, 0.0, -54.0]]))[0]


def test_nodes_without_neighbours(evaluator, vortices):
    judge = evaluator(vortices)
    assert judge.connect([[0.0, 0.0, 0.0]], np.zeros(1), [0], [0, 0], []).shape == (0, 7)
    assert judge.connect(np.empty((0, 3)), np.zeros(0), [], [0], []).shape == (0, 7)
    one = judge.connect(nodes(3, seed=9), 0.0, [0, 1, 2], [0, 0, 1, 1], [2])
    assert one.shape == (1, 7)
    assert sum(count_statuses(one).values()) == 1


def test_arrays_that_cannot_be_written_compile_nothing_new(evaluator, sampled):
    judge, position = evaluator(sampled), nodes(3, seed=9)
    asked = (position, np.zeros(3), *(np.asarray(one) for one in all_pairs(3)))
    expected = judge.connect(*asked)
    compiled = len(connect_nodes.signatures)
    for array in asked:
        array.setflags(write=False)
    np.testing.assert_array_equal(judge.connect(*asked), expected)
    assert judge.connect(position[:1], 0.0, [0], [0, 0], []).shape == (0, 7)
    assert len(connect_nodes.signatures) == compiled


def test_two_thousand_random_pairs_have_one_status_each(evaluator, sampled):
    rng = np.random.default_rng(10)
    position = nodes(120, seed=11, reach=260.0)
    position[100:110] = position[:10]  # the same place
    position[110:120, :2] = position[10:20, :2]  # straight above or below
    pairs = rng.integers(0, 120, (2000, 2))
    pairs[:20] = np.column_stack([np.arange(20), np.arange(100, 120)])
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    indptr = np.searchsorted(pairs[:, 0], np.arange(121))
    judge = evaluator(sampled, candidates=32, tolerance=10.0)
    rows = judge.connect(position, 0.0, np.arange(120), indptr, pairs[:, 1])
    status = rows[:, 0]
    assert set(status) <= {float(one) for one in Status}
    assert (np.isfinite(rows).all(axis=1) == (status == Status.CONNECTED)).all()
    assert np.isnan(rows[status != Status.CONNECTED, 1:]).all()
    start, goal = position[pairs[:, 0]], position[pairs[:, 1]]
    outside = (np.abs(start[:, :2]) > 230).any(axis=1) | (np.abs(goal[:, :2]) > 230).any(axis=1)
    np.testing.assert_array_equal(status == Status.OUTSIDE_FLOW, outside)
    np.testing.assert_array_equal(status == Status.SAME_DEPTH, ~outside & (start[:, 2] == goal[:, 2]))
    counts = count_statuses(rows)
    assert sum(counts.values()) == 2000
    for name in ("connected", "same_depth", "no_hit", "outside_flow"):
        assert counts[name] > 0
    connected = rows[status == Status.CONNECTED]
    assert (connected[:, 6] < 10.0).all()
    assert ((connected[:, 1] > 0) & (connected[:, 1] <= 625.0)).all()


# what cannot be asked


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: StreamlineMethod(0), "`steering.candidates` must be from 1 to 1,000,000; got 0"),
        (lambda: SurfaceMethod(-1), "`steering.candidates` must be from 1 to 1,000,000; got -1"),
        (lambda: IntegrationSettings(0.0, 1, 1.0), "`integration.dt` must be above 0 s; got 0"),
        (lambda: IntegrationSettings(1.0, 0, 1.0), "`integration.steps` must be at least 1; got 0"),
        (lambda: IntegrationSettings(1.0, 1, 0.0), "`integration.tolerance` must be above 0 m; got 0"),
        (lambda: IntegrationSettings(1.0, 1, math.nan), "`integration.tolerance` must be above 0 m; got nan"),
    ],
)
def test_unusable_settings_are_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (([[0.0, 0.0]], 0.0, [0], [0, 0], []), "`position`"),
        (([[0.0, 0.0, math.nan]], 0.0, [0], [0, 0], []), "`position` must be finite"),
        (([[0.0, 0.0, 0.0]], 0.0, [0], [0, 1], [1]), "`target` must hold node numbers below 1"),
        (([[0.0, 0.0, 0.0]], 0.0, [-1], [0, 1], [0]), "`source` must hold node numbers below 1"),
        (([[0.0, 0.0, 0.0]], 0.0, [0], [0, 2], [0]), "`indptr`"),
        (([[0.0, 0.0, 0.0]], 0.0, [0, 0, 0], [0, 2, 1, 2], [0, 0]), "`indptr`"),
    ],
)
def test_unusable_arrays_are_refused(evaluator, vortices, asked, said):
    with pytest.raises(InputError, match=said):
        evaluator(vortices).connect(*asked)


def test_threads_out_of_range_are_refused():
    with pytest.raises(InputError, match="got 0"), threads(0):
        pass


# the same bits, however it is run


@pytest.fixture
def problem(evaluator, sampled):
    return Problem(
        evaluator=evaluator(sampled, candidates=54),
        sampler=RandomSampler(90, 12),
        law=Nearest(20),
        lo=np.array([-150.0, -150.0, -200.0]),
        hi=np.array([150.0, 150.0, 0.0]),
        departure=0.0,
        start=np.array([-140.0, -140.0, 0.0]),
        goal=np.array([100.0, 120.0, -50.0]),
        scenario="",
        flow_words="",
        glider_words="",
    )


def test_neither_threads_nor_batches_change_a_bit(problem):
    roads = [
        build_roadmap(problem, count, batch_pairs=batch)
        for count, batch in ((1, 10**9), (None, 10**9), (None, 1), (1, 1000), (None, 1000))
    ]
    first = roads[0]
    assert first.target.size > 200
    assert first.evaluated == sum(first.counts.values()) == 92 * 20
    assert first.counts["connected"] == first.target.size == first.indptr[-1]
    for other in roads[1:]:
        assert other.counts == first.counts
        for name in ("position", "indptr", "target", *EDGE_FIELDS):
            assert getattr(other, name).tobytes() == getattr(first, name).tobytes(), name


def test_a_roadmaps_edges_are_those_of_its_pairs_one_by_one(problem):
    road = build_roadmap(problem)
    for node in range(0, 92, 7):
        row = slice(road.indptr[node], road.indptr[node + 1])
        found = []
        for other in problem.legs(road.position).neighbourhood.of(road.position[node]):
            edge = problem.evaluator.connect_pair(road.position[node], road.position[other])
            if edge.status == Status.CONNECTED:
                found.append((other, *edge[1:]))
        expected = np.column_stack([road.target[row], *(getattr(road, name)[row] for name in EDGE_FIELDS)])
        np.testing.assert_array_equal(expected, np.reshape(found, (-1, 7)))


def test_a_path_costs_what_dijkstra_by_hand_says(problem):
    road = build_roadmap(problem)
    cost = reference.dijkstra(road.indptr, road.target, road.cost, 90)
    assert np.isfinite(cost).sum() > 60
    path = Planner(road, problem).query()
    assert path.found
    assert path.cost == pytest.approx(cost[91], rel=1e-12)
    for goal in (5, 17, 33):
        there = Planner(road, replace(problem, goal=road.position[goal])).query()
        assert there.cost == pytest.approx(cost[goal], rel=1e-12)
