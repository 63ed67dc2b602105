"""VF-RRT: how directions lean on the current, how the gain adapts, routes that a roadmap's legs confirm."""

import math

import numpy as np
import pytest

from glider_stream.base.errors import InputError
from glider_stream.evaluation.vector_field_rrt import Gain, leaning, vf_rrt
from glider_stream.scenario import read_scenario


def unit(angle):
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def test_without_a_gain_the_way_is_the_drawn_one_and_with_a_great_one_the_current():
    drawn, carried = unit(2.0), unit(0.5)
    assert leaning(drawn, carried, 0.0) == pytest.approx(drawn)
    assert leaning(drawn, carried, 1e-6) == pytest.approx(drawn, abs=1e-5)
    assert leaning(drawn, carried, 1e4) == pytest.approx(carried, abs=0.02)
    assert leaning(carried, carried, 1.0) == pytest.approx(carried)


@pytest.mark.parametrize("gain", [0.3, 2.0])
def test_efforts_of_uniform_draws_have_the_density_of_the_paper(gain):
    # of directions that are uniform on a sphere, |drawn - carried|^2 / 4 is uniform on [0, 1]
    random = np.random.default_rng(1).normal(size=(4000, 3))
    drawn = random / np.linalg.norm(random, axis=1)[:, None]
    ways = np.array([leaning(one, unit(0.0), gain) for one in drawn])
    assert np.linalg.norm(ways, axis=1) == pytest.approx(np.ones(4000))
    efforts = np.sort(1.0 - ways[:, 0])
    law = np.expm1(-gain * efforts) / np.expm1(-2.0 * gain)
    assert np.abs(law - (np.arange(4000) + 0.5) / 4000).max() < 1.36 / math.sqrt(4000)


def test_the_gain_rises_while_all_draws_are_useful_and_falls_while_none_is():
    gain = Gain(every=4)
    for useful in (True,) * 4:
        gain.tell(useful)
    assert gain.value == pytest.approx(1.7)
    for useful in (False,) * 4:
        gain.tell(useful)
    assert gain.value == pytest.approx(1.7 * 0.7)


def test_a_route_is_made_of_legs_that_connect():
    problem = read_scenario("uniform-current", ["flow.v=0.0", "query.goal=[400.0,0.0,0.0]"]).problem()
    found = vf_rrt(problem, 120.0, 500, seed=1)
    legs = zip(found.points[:-1], found.points[1:], strict=True)
    assert found.points[0] == pytest.approx(problem.start)
    assert found.points[-1] == pytest.approx(problem.goal)
    assert found.travel_time == pytest.approx(sum(problem.evaluator.connect_pair(*leg).time for leg in legs))


def test_no_route_against_a_faster_current():
    problem = read_scenario("uniform-current", ["flow.u=2.0", "query.goal=[-90.0,0.0,0.0]"]).problem()
    assert vf_rrt(problem, 100.0, 50).travel_time == math.inf


def test_a_step_of_no_length_is_refused():
    with pytest.raises(InputError, match="got 0"):
        vf_rrt(read_scenario("uniform-current").problem(), 0.0)
