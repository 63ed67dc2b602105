import brute_force
import numpy as np
import pytest
import reference

from glider_stream.edges import FlowMapMethod, StreamlineMethod
from glider_stream.flow import sample_flow
from glider_stream.neighbours import as_csr
from glider_stream.threads import threads

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


def test_finds_what_brute_force_finds(judge, position):
    source, target = np.array([3, 60, 99]), np.arange(120)
    true = brute_force.fastest_legs(judge.flow, judge.polar, position, source, target, 0.0, 48, 96, 5.0, 625.0)
    legs = np.full(true.shape, np.inf)
    for n, k, row in zip(*found(judge, position, source), strict=True):
        if row[0] == CONNECTED and k in target:
            legs[np.flatnonzero(source == n)[0], np.flatnonzero(target == k)[0]] = row[TIME]
    exists = np.isfinite(true) | np.isfinite(legs)
    assert exists.sum() > 30
    assert np.isfinite(legs[exists]).mean() >= 0.98
    both = np.isfinite(true) & np.isfinite(legs)
    assert (legs[both] <= true[both] + 1.0).mean() >= 0.99


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
