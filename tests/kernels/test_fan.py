from itertools import pairwise

import numpy as np
import pytest
from helpers import reference
from helpers.small import scenario_file

from glider_stream import planner
from glider_stream.base.threads import threads
from glider_stream.evaluation import brute_force
from glider_stream.kernels.edges import Edge
from glider_stream.roadmap.neighbours import as_csr
from glider_stream.roadmap.steering import FlowMapMethod, StreamlineMethod
from glider_stream.water.sampled import sample_flow

CONNECTED, TIME, ANGLE, HEADING, SPEED, MISS = 0, 1, 3, 4, 5, 6


@pytest.fixture(scope="module")
def judge(evaluator, vortices):
    wide = sample_flow(vortices, (15.0, 15.0, 12.5), (-700.0, 700.0), (-700.0, 700.0), (-250.0, 0.0))
    return evaluator(wide, lambda candidates: FlowMapMethod())


@pytest.fixture(scope="module")
def position():
    rng = np.random.default_rng(11)
    spread = rng.uniform(-250, 250, (120, 2))
    return np.column_stack([spread, rng.choice([0.0, -60.0, -120.0], 120)])


def found(judge, position, source):
    indptr, target, rows = judge.reach(position, 0.0, np.array(source), 0)
    return np.repeat(source, np.diff(indptr)), target, rows


@pytest.mark.parametrize("on_levels", [True, False], ids=["nodes on levels", "nodes at any depth"])
def test_finds_what_brute_force_finds(judge, position, on_levels):
    if not on_levels:
        position = position + [0.0, 0.0, -1.0] * np.random.default_rng(2).uniform(0, 60, (120, 1))
    source, target = np.array([3, 60, 99]), np.arange(120)
    ends = position, source, target, 0.0
    true = brute_force.fastest_legs(judge.flow, judge.polar, *ends, 48, 96, 5.0, 625.0)
    legs = np.full(true.shape, np.inf)
    for n, k, row in zip(*found(judge, position, source), strict=True):
        if row[0] == CONNECTED:
            legs[np.flatnonzero(source == n)[0], k] = row[TIME]
    exists = np.isfinite(true) | np.isfinite(legs)
    assert exists.sum() > 30
    assert np.isfinite(legs[exists]).mean() >= 0.98
    both = np.isfinite(true) & np.isfinite(legs)
    assert (legs[both] <= true[both] + 1.0).mean() >= 0.99


@pytest.mark.slow
def test_legs_end_at_their_targets(judge, position):
    for n, k, row in list(zip(*found(judge, position, [0, 1]), strict=True))[::7]:
        if row[0] == CONNECTED:
            along = row[SPEED] * np.cos(row[ANGLE])
            c = along * np.cos(row[HEADING]), along * np.sin(row[HEADING]), row[SPEED] * np.sin(row[ANGLE])
            end = reference.replay(judge.flow, position[n], c, row[TIME])(row[TIME])
            assert np.linalg.norm(end - position[k]) < 0.5  # RK4 steps over the kinks of a grid
            assert row[MISS] <= 0.01


def test_a_fan_flown_backward_finds_the_legs_to_a_point(judge, position):
    goal = np.array([40.0, -30.0, -120.0])
    nodes, rows = judge.reach_point(position, goal, 0.0, True)
    back = {int(n): row[TIME] for n, row in zip(nodes, rows, strict=True) if row[0] == CONNECTED}
    places = np.vstack([position, goal])
    source, target, rows = found(judge, places, np.arange(120))
    forth = {
        int(n): row[TIME]
        for n, k, row in zip(source, target, rows, strict=True)
        if k == 120 and row[0] == CONNECTED
    }
    assert len(forth) > 20
    assert len(back.keys() & forth.keys()) >= 0.97 * len(back.keys() | forth.keys())
    assert np.mean([abs(back[n] - forth[n]) < 1.0 for n in back.keys() & forth.keys()]) >= 0.97


def test_limit_keeps_the_fastest(judge, position):
    indptr, _, rows = judge.reach(position, 0.0, np.arange(10), 0)
    few, _, kept = judge.reach(position, 0.0, np.arange(10), 5)
    for n in range(10):
        for up in (False, True):
            row, short = rows[indptr[n] : indptr[n + 1]], kept[few[n] : few[n + 1]]
            row, short = (a[(a[:, 0] == CONNECTED) & ((a[:, ANGLE] > 0) == up)] for a in (row, short))
            # another fan, the same legs: they land within the same centimetre
            np.testing.assert_allclose(np.sort(short[:, TIME]), np.sort(row[:, TIME])[:5], atol=0.05)


def test_threads_change_no_bit(judge, position):
    with threads(1):
        one = judge.reach(position, 0.0, np.arange(120), 0)
    with threads(2):
        two = judge.reach(position, 0.0, np.arange(120), 0)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_refined_line_meets_its_targets(evaluator, judge, position):
    source, targets = np.arange(20), [np.flatnonzero(position[:, 2] != position[n, 2])[::-1] for n in range(20)]
    asked = source, *as_csr(targets)
    plain, refined, exact = (
        one.connect(position, 0.0, *asked)
        for one in (
            evaluator(judge.flow, StreamlineMethod),
            evaluator(judge.flow, lambda candidates: StreamlineMethod(candidates, refine=True)),
            judge,
        )
    )
    there = refined[:, CONNECTED] == 0
    assert there.sum() > 2 * (plain[:, CONNECTED] == 0).sum()
    assert (refined[there, MISS] <= 0.01).all()
    # it knows a part of what there is, and nothing else
    assert (exact[there, CONNECTED] == 0).mean() >= 0.99
    both = there & (exact[:, CONNECTED] == 0)
    assert (exact[both, TIME] <= refined[both, TIME] + 0.1).mean() >= 0.99
    assert 0.7 < both.sum() / (exact[:, CONNECTED] == 0).sum() < 1.0


def test_fans_start_when_their_node_is_left(evaluator, gyre):
    judge = evaluator(gyre, lambda candidates: FlowMapMethod())
    rng = np.random.default_rng(8)
    places = np.column_stack(
        [rng.uniform(-300, 300, 30), rng.uniform(-150, 150, 30), -100.0 * (np.arange(30) % 2)]
    )
    pairs = np.arange(4), np.arange(5) * 30, np.tile(np.arange(30), 4)
    ends = {}
    for departure in (0.0, 230.0):
        rows = judge.connect(places, departure, *pairs)
        ends[departure] = rows
        for n in np.flatnonzero(rows[:, 0] == CONNECTED)[::9]:
            along = rows[n, SPEED] * np.cos(rows[n, ANGLE])
            c = (
                along * np.cos(rows[n, HEADING]),
                along * np.sin(rows[n, HEADING]),
                rows[n, SPEED] * np.sin(rows[n, ANGLE]),
            )
            end = reference.replay(gyre, places[n // 30], c, rows[n, TIME], departure)(rows[n, TIME])
            assert np.linalg.norm(end - places[pairs[2][n]]) < 0.1
    assert not np.allclose(ends[0.0][:, TIME], ends[230.0][:, TIME], equal_nan=True)


def test_a_node_straight_below_is_a_target_like_any_other(judge):
    x, y = (side.ravel() for side in np.meshgrid(*2 * [np.linspace(-250, 250, 16)]))
    top, count = np.zeros(x.size), x.size
    places = np.vstack([np.column_stack([x, y, top]), np.column_stack([x, y, top - 60.0])])
    rows = judge.connect(places, 0.0, np.arange(count), np.arange(count + 1), np.arange(count, 2 * count))
    there = np.flatnonzero(rows[:, 0] == CONNECTED)
    assert there.size > 3
    for n in there:
        path = judge.trace(places[n], Edge(CONNECTED, *rows[n, 1:]), 0.0)
        np.testing.assert_allclose(path[-1, 1:], places[count + n], atol=0.01)


def test_legs_of_a_route_meet(tmp_path):
    scenario = scenario_file(tmp_path, ('method = "streamline"\ncandidates = 24', 'method = "flow-map"'))
    path = planner.query(planner.build(scenario))
    assert len(path.legs) > 1
    for leg, following in pairwise([*path.legs, None]):
        assert leg.miss <= 0.01
        assert np.linalg.norm(leg.trajectory[-1, 1:] - leg.end) <= 0.01
        if following is not None:
            np.testing.assert_array_equal(following.trajectory[0, 1:], leg.end)
            assert following.trajectory[0, 0] == pytest.approx(leg.trajectory[-1, 0])
