"""Rules of surfacing, against every path there is."""

import itertools

import numpy as np
import pytest
from helpers.roadmaps import random_roadmap
from helpers.small import command, roadmap, scenario_file, strict_json

from glider_stream.base.errors import InputError
from glider_stream.scenario import read_scenario
from glider_stream.search.layered import SurfacingPlanner
from glider_stream.search.path import SURFACE
from glider_stream.search.query import Planner
from glider_stream.search.surfacing import BINS, LEAST_HOURS, Surfacing


def keeps(rule, legs, slack=0.0):
    """Whether legs (z at the end, glide angle, time) keep a rule; `slack` is rounding that a leg may lose [s]."""
    yos, hours, climbing = 0, 0.0, False
    for z, angle, time in legs:
        yos, climbing = yos + (angle > 0 and not climbing), angle > 0
        hours += (time + slack) / 3600
        if rule.most_yos is not None and yos > rule.most_yos:
            return False
        if rule.most_hours is not None and hours > rule.most_hours:
            return False
        if z >= -SURFACE:
            yos, hours, climbing = 0, 0.0, False
    return True


def best_by_hand(road, start, goal, rule, slack=0.0):
    """The least time of all walks of up to eight legs that keep the rule."""
    best = np.inf
    stack = [(start, 0.0, [])]
    while stack:
        node, time, legs = stack.pop()
        if node == goal:
            best = min(best, time)
            continue
        if len(legs) == 7:
            continue
        for n in range(road.indptr[node], road.indptr[node + 1]):
            there = int(road.target[n])
            on = [*legs, (road.position[there, 2], road.glide_angle[n], road.time[n])]
            if time + road.time[n] < best and keeps(rule, on, slack):
                stack.append((there, time + road.time[n], on))
    return best


RULES = [Surfacing(1), Surfacing(2), Surfacing(None, 0.12), Surfacing(None, 0.25), Surfacing(1, 0.2)]


@pytest.mark.parametrize(("seed", "rule"), list(itertools.product(range(4), RULES)))
def test_no_path_that_keeps_the_rule_is_faster(tmp_path, monkeypatch, seed, rule):
    road = random_roadmap(seed, nodes=6)
    road.position[[0, -1], 2] = 0.0
    monkeypatch.setattr("glider_stream.search.query.check_unchanged", lambda *_: None)
    problem = read_scenario(scenario_file(tmp_path)).problem()
    ends = road.position[0], road.position[-1]
    found = SurfacingPlanner(road, problem, rule).query(*ends)
    legs = [(leg.end[2], leg.glide_angle, leg.duration) for leg in found.legs]
    assert keeps(rule, legs)
    slack = 0.0 if rule.most_hours is None else 3600 * rule.most_hours / BINS
    least, safe = best_by_hand(road, 0, 5, rule), best_by_hand(road, 0, 5, rule, slack)
    time = found.travel_time
    assert least - 1e-9 <= time <= safe + 1e-9
    assert time >= Planner(road, problem).query(*ends).travel_time - 1e-9


def test_from_the_command_line(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    command(capsys, "build", "small.toml", "-o", "road.h5")
    free = strict_json(command(capsys, "query", "road.h5", "--goal=160,-160,0", "--json").out)
    bound = strict_json(command(capsys, "query", "road.h5", "--goal=160,-160,0", "--most-yos", "1", "--json").out)
    assert bound["travel_time_s"] >= free["travel_time_s"]
    legs = [(leg["to"][2], leg["glide_angle_rad"], leg["duration_s"]) for leg in bound["legs"]]
    assert keeps(Surfacing(1), legs)
    # ends that are no nodes are attached by legs of their own
    assert (
        command(capsys, "query", "road.h5", "--start=-140,120,0", "--goal=130,-90,0", "--most-hours", "2").code
        == 0
    )
    deep = command(capsys, "query", "road.h5", "--start=-140,120,-60", "--most-hours", "2")
    assert (deep.code, "has its start at the surface; got a depth of 60 m" in deep.err) == (2, True)
    assert command(capsys, "query", "road.h5", "--most-hours", "0.001").code == 1
    assert "`most_yos` must be from 1" in command(capsys, "query", "road.h5", "--most-yos", "0").err
    command(capsys, "build", "small.toml", "-o", "ruled.h5", "--set", "query.most_yos=1")
    ruled = strict_json(command(capsys, "query", "ruled.h5", "--goal=160,-160,0", "--json").out)
    assert ruled["travel_time_s"] == bound["travel_time_s"]


def test_an_unusable_rule_is_refused(tmp_path):
    road = roadmap()
    problem = read_scenario(scenario_file(tmp_path)).problem()
    loose = SurfacingPlanner(road, problem, Surfacing(50)).query()
    assert loose.travel_time == Planner(road, problem).query().travel_time
    hours = [{"most_hours": value} for value in (0.0, -1.0, 1e-300, 5e-324, 1e300, float("nan"), float("inf"))]
    for wrong in ({"most_yos": 0}, {"most_yos": 101}, *hours):
        with pytest.raises(InputError, match="`most_"):
            Surfacing(**wrong)


def test_the_least_hours_are_kept(capsys, tmp_path, monkeypatch):
    """A leg that is longer by any factor is no leg of a route with that rule."""
    rule = Surfacing(most_hours=LEAST_HOURS)
    time = np.array([1.0, 3.6, 4.0, 1e9, 1e300])
    assert (rule.steps(0, np.zeros(5), time)[1] <= BINS).tolist() == [True, True, False, False, False]
    problem = read_scenario(scenario_file(tmp_path)).problem()
    assert not SurfacingPlanner(roadmap(), problem, rule).query().found
    monkeypatch.chdir(tmp_path)
    for key in ("1e-300", "1e300"):
        said = command(capsys, "build", "small.toml", "-o", "x.h5", "--set", f"query.most_hours={key}")
        query = command(capsys, "query", "x.h5") if said.code == 0 else said
        assert (query.code, "`most_hours` must be from 0.001 to 277,778 h" in query.err) == (2, True)
