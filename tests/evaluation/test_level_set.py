"""The level set: closed forms from below, in two and three dimensions; its error; what it refuses."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.small import command, roadmap, scenario_file, strict_json

from glider_stream.base.errors import InputError
from glider_stream.evaluation.level_set import NEAR, Bound, Front, Waters, bound, dimensions_of
from glider_stream.scenario import scenario_from_text
from glider_stream.water.analytic import Uniform

pytestmark = pytest.mark.slow

HEIGHTS = (-150.0, 0.0)


@pytest.fixture(scope="module")
def problem():
    """The small scenario made into objects, in an even current."""
    small = scenario_from_text(roadmap().provenance.scenario).problem()
    even = Uniform(0.3, -0.1).kernel(HEIGHTS)
    return replace(small, evaluator=replace(small.evaluator, flow=even))


def exact(problem):
    """The least time in an even current at one depth: |goal - start - current T| = Vh T."""
    current, way = np.array([0.3, -0.1]), (problem.goal - problem.start)[:2]
    fastest = float(problem.evaluator.polar.best_horizontal.max())
    a, b = fastest**2 - current @ current, current @ way
    return (-b + math.sqrt(b * b + a * (way @ way))) / a


@pytest.mark.parametrize(("dimensions", "nodes", "share"), [(2, 51, 0.02), (3, 23, 0.06)])
def test_in_an_even_current_it_is_the_closed_form_from_below(problem, dimensions, nodes, share):
    found = bound(problem, dimensions, nodes)
    best = exact(problem)
    assert found.least <= best
    assert found.time == pytest.approx(best, rel=share)
    assert found.dimensions == dimensions


def test_against_the_current_it_takes_longer(problem):
    there = bound(problem, 2, 41)
    back = bound(replace(problem, start=problem.goal, goal=problem.start), 2, 41)
    assert back.time > 1.3 * there.time


def test_the_front_does_not_enter_land(problem):
    waters = Waters(problem, 2)
    front = Front(waters, 41, 60.0)
    free = front.arrival()
    across = np.abs(front.nodes @ np.array([1.0, -1.0])) < 40.0  # a wall across the way, with a gap far off
    wall = across & (front.nodes[:, 0] < 200.0)
    front.water &= ~wall.reshape(front.shape)
    assert front.arrival() > 1.05 * free


def test_nothing_comes_in_through_the_sides(problem):
    """Where the current is weakest beside the box, a front that went round there would be too early."""
    narrow = Uniform(-0.85, 0.0, y=(-60.0, 60.0)).kernel(HEIGHTS)

    class Shear(Waters):
        def current(self, at, since):
            uv = super().current(at, since)
            return uv * (1.0 - np.minimum(np.abs(at[:, 1]) / 120.0, 1.0))[:, None]

    alone = replace(problem, start=np.array([0.0, 0.0, 0.0]), goal=np.array([150.0, 0.0, 0.0]))
    alone = replace(alone, evaluator=replace(alone.evaluator, flow=narrow))
    waters = Shear(alone, 2)
    sides = Front(waters, 61, 20.0)
    assert (sides.axes[1][0], sides.axes[1][-1]) == (-60.0, 60.0)
    # the best way in a current of y alone: along the side, at a price for each metre east; there and back by the
    # heading that is best at each y for that price
    price = 1.0 / (waters.fastest - 0.425)
    y, heading = np.linspace(0.0, 60.0, 401)[:, None], np.linspace(0.01, math.pi - 0.01, 2001)
    east = waters.fastest * np.cos(heading) - 0.85 * (1.0 - y / 120.0)
    per_metre = ((1.0 - price * east) / (waters.fastest * np.sin(heading))).min(axis=1)
    best = 150.0 * price + 2.0 * 60.0 * per_metre.mean()
    assert 0.98 * best < sides.arrival() <= best


def test_a_strong_current_at_the_start_costs_no_sharpness(problem):
    """The front begins where the current has carried the start, so an even current leaves nothing to guess."""
    waters = Waters(problem, 2)
    for nodes in (31, 61):
        front = Front(waters, nodes, 60.0)
        assert front.began == pytest.approx(60.0)
        assert front.source - waters.ends[0] == pytest.approx(60.0 * np.array([0.3, -0.1]))


def test_long_routes_are_bounded_in_two_dimensions(problem):
    assert dimensions_of(problem) == 3
    far = replace(problem, goal=problem.start + np.array([9000.0, 0.0, 0.0]))
    assert dimensions_of(far) == 2


def test_it_says_what_it_is():
    flat = Bound(3600.0, 36.0, 2, (500.0, 400.0), sound=False)
    deep = Bound(3600.0, 36.0, 3, (50.0, 40.0, 30.0))
    assert flat.as_dict()["kind"] == "estimate"
    assert deep.as_dict()["kind"] == "bound"
    assert flat.least == 3564.0
    assert str(flat).startswith(
        "an estimate of the least time, 3,564 s (0.99 h), no bound: a level set in the mean current"
    )
    assert "50 x 40 x 30 m" in str(deep)
    assert "by up to 12 s too early" in str(replace(deep, early=12.0))
    assert replace(deep, early=math.inf).as_dict()["early_s"] is None


def test_the_set_at_the_start_is_too_early_by_what_the_current_there_differs(problem):
    """The current differs by a fifth of the glider's speed at most, on either side of both ends."""

    class Shear(Waters):
        def current(self, at, since):
            away = np.array([at[:, 0] - end[0] for end in self.ends]) / (NEAR * 60.0 * self.fastest)
            along = np.where(np.abs(away[0]) < np.abs(away[1]), *away)
            return np.stack([0.2 * self.fastest * np.clip(along, -1.0, 1.0), 0.0 * along], axis=1)

    waters = Shear(problem, 2)
    front = Front(waters, 161, 60.0)
    assert front.began == pytest.approx(60.0 / 1.2, rel=0.02)
    assert front.early == pytest.approx(60.0 / 0.8 - 60.0 / 1.2, rel=0.1)
    front.began = 20.0  # the current differs by more than the glider's speed
    assert front.early == math.inf


def test_the_current_of_any_depth_is_a_bound_where_the_mean_is_an_estimate(problem):
    """The small scenario's own current varies with depth; an even one does not, and is bounded in either way."""
    assert bound(problem, 2, 21).sound
    varied = scenario_from_text(roadmap().provenance.scenario).problem()
    mean, any_depth = bound(varied, 2, 31), bound(varied, 2, 31, any_depth=True)
    assert (mean.sound, any_depth.sound) == (False, True)
    assert any_depth.time < mean.time


def test_what_cannot_be_bounded_is_refused(problem):
    for changes, asked, words in (
        ({}, {"dimensions": 4}, "`dimensions` must be 2 or 3; got 4"),
        ({}, {"dimensions": 3, "any_depth": True}, "any depth is for 2 dimensions; got 3"),
        ({}, {"nodes": 5}, "`nodes` must be at least 21; got 5"),
        ({"start": None}, {}, "the scenario has no"),
    ):
        with pytest.raises(InputError, match=words):
            bound(replace(problem, **changes), **asked)
    strong = replace(problem.evaluator, flow=Uniform(1.5, 0.0).kernel(HEIGHTS))
    upstream = replace(problem, evaluator=strong, start=problem.goal, goal=problem.start)
    with pytest.raises(InputError, match="no front reaches the goal"):
        bound(upstream, 2, 21)


def test_the_command_line_bounds(capsys, tmp_path):
    said = command(capsys, "bound", scenario_file(tmp_path), "--nodes", 21, "--json")
    assert said.err.startswith("bound: grid 1 of 2, 11 x 11 x ")
    assert "bound: grid 2 of 2, 21 x 21 x " in said.err
    found = strict_json(said.out)
    assert 0.0 < found["least_s"] <= found["time_s"]
    # no route of the roadmap is quicker
    assert found["least_s"] < 489.0
