"""Refined routes: never worse, the same each time, nodes in open water; the roadmap written anew; the clock."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers.small import command, roadmap, strict_json

import glider_stream
from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.kernels.terrain import OpenWater
from glider_stream.roadmap.builder import build_roadmap, node_positions
from glider_stream.roadmap.neighbours import Reachable
from glider_stream.roadmap.nodes import GridSampler, YoSampler
from glider_stream.roadmap.steering import FlowMapMethod
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import scenario_from_text
from glider_stream.search.query import Planner
from glider_stream.search.refine import Asked, Refiner, refined
from glider_stream.search.time_dependent import ClockPlanner

pytestmark = pytest.mark.slow

NOWHERE_ELSE = (None, None)
TWO_ROUNDS = Asked(within=0.5)


@pytest.fixture(scope="module")
def problem():
    """The small scenario made into objects, its legs exact."""
    small = scenario_from_text(roadmap().provenance.scenario).problem()
    exact = replace(small.evaluator, steering=FlowMapMethod())
    return replace(small, evaluator=exact, law=Reachable(0))


@pytest.fixture(scope="module")
def found():
    """Its route between the nodes, and the same refined."""
    road = glider_stream.open(roadmap())
    return road.query(), road.query(within=0.01)


def test_a_refined_route_is_quicker_and_says_what_each_round_gained(found):
    before, after = found
    assert after.travel_time < before.travel_time
    cost = before.cost
    for one in after.rounds:
        assert one.cost == pytest.approx((1 - one.gain) * cost)
        assert one.nodes > 0
        assert one.edges > 0
        cost = one.cost
    assert after.cost == cost
    assert all(one.gain >= 0.01 for one in after.rounds[1:-1])
    assert after.rounds[-1].gain < 0.01
    spacings = [one.spacing for one in after.rounds]
    assert spacings == sorted(spacings, reverse=True)
    assert [one["travel_time_s"] for one in after.as_dict()["rounds"]] == [
        one.travel_time for one in after.rounds
    ]
    assert f"round {len(after.rounds)}: nodes every " in str(after)
    assert "rounds" not in before.as_dict()


def test_it_is_the_same_each_time(found):
    again = glider_stream.open(roadmap()).query(within=0.01)
    assert again.as_dict() == found[1].as_dict()


def test_with_polish_each_round_is_polished():
    road = glider_stream.open(roadmap())
    polished, both = road.query(polish=True), road.query(polish=True, within=0.05)
    assert both.cost <= polished.cost
    assert both.unpolished is not None
    assert len(both.rounds) == 2


def test_time_ends_it_between_rounds():
    road = glider_stream.open(roadmap())
    assert len(road.query(seconds=1e-6).rounds) == 1


def test_its_legs_join_and_end_where_they_say(found, problem):
    legs = found[1].legs
    for leg, following in pairwise(legs):
        np.testing.assert_array_equal(leg.end, following.start)
    for leg in legs:
        assert math.dist(leg.trajectory[-1, 1:], leg.end) <= problem.evaluator.integration.tolerance
    np.testing.assert_array_equal(legs[0].start, found[0].start)
    np.testing.assert_array_equal(legs[-1].end, found[0].goal)


def test_new_nodes_lie_in_open_water(problem):
    shallow = replace(problem, evaluator=replace(problem.evaluator, terrain=OpenWater(-100.0)))
    road = build_roadmap(shallow)
    searcher = Planner(road, shallow)
    result = refined(searcher, NOWHERE_ELSE, searcher.query(), TWO_ROUNDS)
    for position, _ in result.parts:
        assert position[:, 2].min() >= -100.0
        assert position[:, 2].max() <= 0.0
        assert (position[:, :2] >= shallow.lo[:2]).all()
    assert min(leg.trajectory[:, 3].min() for leg in result.path.legs) >= -100.0 - 1e-6


def test_where_yos_turn_at_two_depths_new_nodes_lie_there_too(problem):
    yos = replace(problem, sampler=YoSampler((0.0, 75.0, 150.0), spacing=80.0))
    road = build_roadmap(yos)
    searcher = Planner(road, yos)
    result = refined(searcher, NOWHERE_ELSE, searcher.query(), TWO_ROUNDS)
    assert set(result.parts[0][0][:, 2]) == {0.0, -75.0, -150.0}


def test_new_nodes_lie_only_where_a_route_may_be_as_quick(problem):
    road = build_roadmap(replace(problem, sampler=GridSampler((12, 12, 2))))
    searcher = Planner(road, problem)
    refiner = Refiner(searcher, problem.start, problem.goal)
    cloud, _ = refiner._first()
    # the sums are exact: at the start, at the goal, and along the best route they are what it costs
    best = searcher.query()
    np.testing.assert_allclose(cloud.sums()[refiner._stops(cloud, best)], best.cost)
    (where, _), *_ = refiner.refine(best, TWO_ROUNDS, lambda line: None).parts
    corner = np.array([problem.hi[0], problem.hi[1]])
    assert np.hypot(*(where[:, :2] - corner).T).min() > 150.0


def test_a_rule_of_surfacing_is_kept():
    road = glider_stream.open(roadmap())
    rule = glider_stream.Surfacing(most_yos=1)
    ends = (-160.0, 160.0, 0.0), (160.0, -160.0, 0.0)
    before = road.query(*ends, surfacing=rule)
    after = road.query(*ends, surfacing=rule, within=0.01)
    assert after.travel_time <= before.travel_time
    assert rule.holds(after)


def test_the_clock_runs_while_a_route_is_refined(problem, gyre):
    swinging = replace(
        problem, evaluator=replace(problem.evaluator, flow=gyre), sampler=GridSampler((6, 6, 2)), departure=100.0
    )
    position = node_positions(swinging)
    searcher = ClockPlanner(swinging, position)
    before = searcher.query()
    result = refined(searcher, NOWHERE_ELSE, before, TWO_ROUNDS)
    after = result.path
    assert after.travel_time < before.travel_time
    assert after.clock_runs
    at, clock = after.start, 0.0
    for leg, (_, _, edge) in zip(after.legs, glider_stream.search.path.hops_of(after), strict=True):
        assert leg.depart == pytest.approx(clock)
        at = swinging.evaluator.trace(at, edge, swinging.departure + clock)[-1, 1:]
        clock += leg.duration
    assert math.dist(at, after.goal) < swinging.evaluator.integration.tolerance
    with pytest.raises(InputError, match="no roadmap to write anew; build"):
        result.whole()


def test_the_roadmap_is_written_anew_and_the_old_one_stays(tmp_path):
    old, new = tmp_path / "old.h5", tmp_path / "new.h5"
    write_roadmap(roadmap(), old)
    bits = old.read_bytes()
    path = planner.query(old, within=0.01, outputs=[new, tmp_path / "path.json"])
    assert old.read_bytes() == bits
    assert (tmp_path / "path.json").exists()
    before, after = planner.info(old), planner.info(new)
    ends = len(before.position) - 2
    np.testing.assert_array_equal(after.position[:ends], before.position[:ends])
    np.testing.assert_array_equal(after.position[-2:], before.position[-2:])
    assert len(after.position) > len(before.position)
    assert after.target.size > before.target.size
    assert planner.query(new).cost <= path.cost
    assert planner.verify(new, sample=50).holds


def test_the_command_line_refines(capsys, tmp_path):
    file = tmp_path / "small.h5"
    write_roadmap(roadmap(), file)
    said = command(capsys, "query", file, "--within", "1%", "--json")
    assert said.err.startswith("round 1: nodes every")
    assert len(strict_json(said.out)["rounds"]) >= 1
    for wrong in ("1", "one%"):
        refused = command(capsys, "query", file, "--within", wrong)
        assert refused.code == 2
        assert f"{wrong!r} is not a percentage, such as 1%" in refused.err
    refused = command(capsys, "query", file, "--within", "1%", "--trade-off")
    assert refused.code == 2


def test_what_cannot_be_refined_is_refused(tmp_path):
    road = glider_stream.open(roadmap())
    for asked, words in (
        ({"within": 1.0}, "share between 0 and 1, such as 0.01; got 1"),
        ({"seconds": 0.0}, "`seconds` must be above 0"),
        ({"within": 0.01, "most_energy": 5.0}, "not refined"),
        ({"outputs": [tmp_path / "new.h5"]}, "add --within or --seconds"),
    ):
        with pytest.raises(InputError, match=words):
            road.query(**asked)


def test_every_query_tells_how_far_from_the_best_it_may_be(found):
    before, after = found
    assert before.least < after.cost
    assert before.as_dict()["lower_bound"]["cost"] == before.least
    assert "estimate_of_further_gain" not in before.as_dict()
    assert after.as_dict()["estimate_of_further_gain"] == after.rounds[-1].gain
    assert "by the greatest currents: this one at most" in str(before)
    assert "--within 1%" in str(before)
    assert str(after).endswith("%, an estimate")
