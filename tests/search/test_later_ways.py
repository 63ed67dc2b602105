"""Ways that come to a node later than at the soonest: followed by default where nodes are few, else told of."""

import json
import math
import re
from dataclasses import replace

import pytest

from glider_stream.base.threads import threads
from glider_stream.roadmap.builder import node_positions
from glider_stream.scenario import read_scenario
from glider_stream.search import time_dependent
from glider_stream.search.time_dependent import ClockPlanner

pytestmark = pytest.mark.slow

FEW = ["flow.period=900.0", "sampling.shape=[4, 2, 3]", "query.goal=[1000.0, 500.0, -250.0]"]
ENERGY = ["cost.kind=energy", "cost.preset=slocum", "cost.hotel=0.9"]
TOLD = "who comes to a node later may still arrive earlier"


def clock(*sets):
    problem = read_scenario("swinging-gyre", [*FEW, *sets]).problem()
    return ClockPlanner(problem, node_positions(problem))


@pytest.mark.parametrize("sets", [(), ENERGY])
def test_a_later_way_that_is_twice_as_good_is_found_by_default(sets, monkeypatch):
    planner = clock(*sets)
    path = planner.query()
    in_bins = ClockPlanner(replace(planner.problem, bins=10.0), planner.position).query()
    assert path.cost == pytest.approx(in_bins.cost)
    assert path.travel_time < 1100.0
    assert path.notes == ()
    # without the second look: nearly twice as long, and that is told
    monkeypatch.setattr(time_dependent, "LATER_FANS", 0)
    first = planner.query()
    assert first.travel_time > 1.8 * path.travel_time
    assert TOLD in first.notes[0]


def test_where_ways_are_too_many_a_note_says_so_with_a_bound(monkeypatch):
    monkeypatch.setattr(time_dependent, "LATER_FANS", 4)
    path = clock().query()
    assert TOLD in path.notes[0]
    nodes, later = (int(part) for part in re.findall(r"(\d+) nodes .* (\d+) later ways", path.notes[0])[0])
    assert 0 < nodes <= 26
    assert 4 <= later < 30
    # what the note says to do helps
    width = float(path.notes[0].split("query.bins = ")[1].split()[0])
    assert ClockPlanner(replace(clock().problem, bins=width), clock().position).query().cost <= path.cost
    assert json.loads(json.dumps(path.as_dict()))["notes"] == list(path.notes)


def test_the_second_look_gives_the_same_bits_for_any_number_of_threads():
    told = []
    for count in (1, 2):
        with threads(count):
            told.append(json.dumps(clock().query().as_dict()))
    assert told[0] == told[1]


def test_no_second_look_where_it_has_no_sense():
    """In a steady flow the first way to each node is the best; with bins that a user gives, those alone count."""
    for sets in (["flow.epsilon=0.0"], ["query.bins=40.0"]):
        assert clock(*sets).query().notes == ()


def test_a_front_without_bins_says_what_it_is():
    for sets, whole in (([], False), (["query.bins=40.0"], True), (["flow.epsilon=0.0"], True)):
        front = clock(*ENERGY, *sets).front()
        assert math.isfinite(front.paths[0].cost)
        assert front.whole is front.as_dict()["whole"] is whole
        assert ("the whole front" in str(front)) is whole
