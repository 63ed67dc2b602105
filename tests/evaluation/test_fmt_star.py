"""FMT*: the march beside Dijkstra's search, the radius of the paper, routes beside closed forms."""

import math
from importlib.metadata import version
from importlib.util import find_spec

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from glider_stream.base.errors import InputError
from glider_stream.evaluation.baselines import best_glide
from glider_stream.evaluation.fmt_star import ETA, fmt_radius, fmt_star, marched
from glider_stream.scenario import read_scenario

COUNT, RADIUS = 120, 0.3
MIDDLE, DISK, ENDS = np.array([0.5, 0.5]), 0.25, np.array([[0.1, 0.1], [0.9, 0.9]])
OUT = 0.4 * math.sqrt(2.0)
AROUND = 2.0 * math.sqrt(OUT**2 - DISK**2) + DISK * (math.pi - 2.0 * math.acos(DISK / OUT))
"""The shortest way around the disk: two tangents and an arc."""


def plane(seed):
    """Random places of a unit square, their neighbours, and a steering along straight lines."""
    places = np.random.default_rng(seed).random((COUNT, 2))
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    near = [np.flatnonzero((row <= RADIUS) & (row > 0)) for row in apart]

    def steer(sources, leaves, rows):
        return np.concatenate([[], *(apart[source, row] for source, row in zip(sources, rows, strict=True))])

    return apart, near, steer


def test_without_obstacles_a_march_is_never_faster_than_dijkstra_and_seldom_slower():
    ratios = []
    for seed in range(10):
        apart, near, steer = plane(seed)
        arrival, _, _ = marched(near, steer, 0, COUNT - 1)
        least = dijkstra(np.where(apart <= RADIUS, apart, 0.0), indices=0)[COUNT - 1]
        ratios.append(arrival[-1] / least)
    assert min(ratios) >= 1.0 - 1e-12
    assert np.median(ratios) == pytest.approx(1.0)
    assert max(ratios) < 1.05


def test_each_pair_is_steered_once_at_most_and_parents_lead_to_the_start():
    _, near, steer = plane(3)
    asked = []

    def counting(sources, leaves, rows):
        asked.extend((source, int(x)) for source, row in zip(sources, rows, strict=True) for x in row)
        return steer(sources, leaves, rows)

    arrival, parent, steered = marched(near, counting, 0, COUNT - 1)
    assert len(asked) == len(set(asked)) == steered
    node = COUNT - 1
    while parent[node] >= 0:
        assert arrival[parent[node]] < arrival[node]
        node = parent[node]
    assert node == 0


def test_a_goal_beyond_a_gap_is_not_reached():
    near = [np.array([1]), np.array([0]), np.array([], int)]
    arrival, _, _ = marched(near, lambda sources, leaves, rows: np.ones(sum(map(len, rows))), 0, 2)
    assert arrival[2] == math.inf


def clear(a, b):
    """Whether the segments from a (2,) to b (n, 2) leave out a disk in the middle of the unit square."""
    along = b - a
    share = np.clip(((MIDDLE - a) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.hypot(*(a + share[:, None] * along - MIDDLE).T) > DISK


def around_the_disk(seed):
    """The length of the way by FMT* from corner to corner, around the disk."""
    drawn = np.random.default_rng(seed).random((440, 2))
    free = drawn[np.hypot(*(drawn - MIDDLE).T) > DISK][:300]
    places = np.vstack([free, ENDS])
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    radius = fmt_radius(300, 1.0 - math.pi * DISK**2, 2)
    near = [np.flatnonzero((row <= radius) & (row > 0)) for row in apart]

    def steer(sources, leaves, rows):
        pairs = zip(sources, rows, strict=True)
        legs = [np.where(clear(places[a], places[row]), apart[a, row], math.inf) for a, row in pairs]
        return np.concatenate([[], *legs])

    return marched(near, steer, 300, 301)[0][-1]


def test_ways_around_a_disk_are_little_longer_than_the_shortest():
    lengths = np.array([around_the_disk(seed) for seed in range(3)])
    assert (lengths >= AROUND).all()
    assert np.median(lengths) < 1.12 * AROUND


def test_ways_around_a_disk_are_as_long_as_those_of_ompl():
    if find_spec("ompl") is None:
        pytest.skip("OMPL is not installed")
    if version("ompl").startswith("1."):
        pytest.skip("Python ends with a segmentation fault where OMPL 1.7.0 was loaded; 2.0.1 is well")
    from ompl import base
    from ompl.geometric import FMT

    theirs = []
    for _ in range(5):
        space, bounds = base.RealVectorStateSpace(2), base.RealVectorBounds(2)
        for n in range(2):
            bounds.setLow(n, 0.0)
            bounds.setHigh(n, 1.0)
        space.setBounds(bounds)
        info = base.SpaceInformation(space)
        info.setStateValidityChecker(lambda at: math.hypot(at[0] - 0.5, at[1] - 0.5) > DISK)
        info.setup()
        ends = space.allocState(), space.allocState()
        for state, end in zip(ends, ENDS, strict=True):
            state[0], state[1] = end.tolist()
        asked = base.ProblemDefinition(info)
        asked.setStartAndGoalStates(*ends)
        planner = FMT(info)
        planner.setNumSamples(300)
        planner.setNearestK(False)
        planner.setProblemDefinition(asked)
        planner.setup()
        planner.solve(base.plannerNonTerminatingCondition())
        theirs.append(asked.getSolutionPath().length())
    ours = [around_the_disk(seed) for seed in range(5)]
    assert np.median(ours) == pytest.approx(np.median(theirs), rel=0.03)


def test_the_radius_is_that_of_theorem_4_1():
    unit_ball = 4 / 3 * math.pi
    expected = (
        (1 + ETA) * 2 * (1 / 3) ** (1 / 3) * (8e6 / unit_ball) ** (1 / 3) * (math.log(500) / 500) ** (1 / 3)
    )
    assert fmt_radius(500, 8e6) == pytest.approx(expected)


def test_a_route_in_a_uniform_current_takes_the_closed_form_or_more():
    problem = read_scenario("uniform-current", ["flow.v=0.0", "query.goal=[400.0,0.0,0.0]"]).problem()
    found = fmt_star(problem, 60)
    least = 400.0 / (best_glide(problem)[0] + 0.5)
    assert least < found.travel_time < 1.5 * least
    assert found.points[0] == pytest.approx(problem.start)
    assert found.points[-1] == pytest.approx(problem.goal)


def test_fewer_than_two_samples_are_refused():
    with pytest.raises(InputError, match="got 1"):
        fmt_star(read_scenario("uniform-current").problem(), 1)
