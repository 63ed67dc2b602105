"""The baselines, where what they do is known."""

import math

import pytest

from glider_stream.evaluation.baselines import best_glide, depth_averaged, drift, straight
from glider_stream.scenario import read_scenario


def across(x, y, *overrides):
    """A problem in a uniform current along x, the goal at (x, y)."""
    points = [f"query.goal=[{x},{y},0.0]", "flow.v=0.0"]
    return read_scenario("uniform-current", [*points, *overrides]).problem()


def ends(problem):
    return problem, problem.start, problem.goal


def test_straight_with_the_current_is_the_sum_of_both_speeds():
    problem = across(400.0, 0.0)
    assert straight(*ends(problem)) == pytest.approx((400.0 - 10.0) / (0.9 + 0.5), abs=2.0)


def test_straight_against_a_faster_current_never_arrives():
    assert straight(*ends(across(-90.0, 0.0, "flow.u=1.0"))) == math.inf


def test_drift_arrives_downstream_alone():
    assert drift(*ends(across(400.0, 0.0))) == pytest.approx(390.0 / 0.5, abs=3.0)
    assert drift(*ends(across(400.0, 100.0))) == math.inf


def test_depth_averaged_holds_the_line_in_a_uniform_current():
    problem = across(0.0, 250.0)
    fastest = 250.0 / math.sqrt(best_glide(problem)[0] ** 2 - 0.5**2)
    assert fastest * 0.95 <= depth_averaged(*ends(problem)) <= fastest * 1.15


def test_depth_averaged_has_no_plan_against_a_faster_current():
    assert depth_averaged(*ends(across(-90.0, 0.0, "flow.u=1.0"))) == math.inf


def test_depth_averaged_is_faster_past_a_vortex_than_straight():
    problem = read_scenario("rankine").problem()
    assert depth_averaged(*ends(problem)) < 0.8 * straight(*ends(problem)) < math.inf
