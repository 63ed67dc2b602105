"""Why not: each cause on a small roadmap where it is known, the nearest place reached, and what is said of it."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from helpers.small import SCENARIO, command, roadmap, scenario_file, strict_json

from glider_stream import planner
from glider_stream.kernels.edges import Status
from glider_stream.roadmap.problem import Problem
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import read_scenario, scenario_from_text
from glider_stream.search.layered import SurfacingPlanner
from glider_stream.search.query import Planner
from glider_stream.search.surfacing import Surfacing
from glider_stream.search.why_not import Looked, no_edges, outrun, why_not
from glider_stream.water.analytic import Uniform

START, GOAL = (-190.0, 190.0, 0.0), (160.0, -160.0, 0.0)


@pytest.fixture(scope="module")
def problem():
    return scenario_from_text(roadmap().provenance.scenario).problem()


def without(road, kept):
    """A roadmap with some of its edges (edges,) alone."""
    rows = np.repeat(np.arange(len(road.position)), np.diff(road.indptr))[kept]
    names = ("target", "time", "cost", "glide_angle", "heading", "speed", "miss")
    indptr = np.searchsorted(rows, np.arange(len(road.position) + 1))
    return replace(road, indptr=indptr, **{name: getattr(road, name)[kept] for name in names})


def sources(road):
    return np.repeat(np.arange(len(road.position)), np.diff(road.indptr))


def cut(road, lost):
    """A roadmap without the edges that begin or end at nodes (n,)."""
    return without(road, ~(lost[sources(road)] | lost[road.target]))


def changed(folder, *changes):
    return planner.build(read_scenario(scenario_file(folder), list(changes)))


def test_the_nearest_node_is_that_of_a_search_of_our_own(problem):
    """The half beyond the middle is cut off: the nearest place is the best of the other half."""
    road = roadmap()
    beyond = road.position[:, 0] - road.position[:, 1] > 60.0
    poorer = cut(road, beyond)
    search = Planner(poorer, problem)
    path = search.query(START, GOAL)
    assert not path.found
    arrival = search.arrivals(START)
    reached = np.flatnonzero(np.isfinite(arrival))
    distance = np.linalg.norm(road.position[reached] - GOAL, axis=1)
    told = path.why_not
    assert told["nodes_reached"] == reached.size
    assert told["nodes"] == len(road.position)
    assert told["nearest"]["distance_to_goal_m"] == pytest.approx(distance.min())
    best = reached[distance == distance.min()]
    assert told["nearest"]["at"] == road.position[best[0]].tolist()
    assert told["nearest"]["after_s"] == pytest.approx(arrival[best].min())
    assert told["start_left"]
    # the legs are there, the roadmap has lost them
    assert told["cause"] == "not held"
    assert told["legs_onward"]["statuses"]["connected"] > 0
    hours = f"{arrival[best].min() / 3600:.2f} h"
    assert f"{reached.size} of {len(road.position)} nodes are reached" in path.why
    assert f"{distance.min():,.0f} m from it" in path.why
    assert f"after {hours}" in path.why


def test_the_start_that_is_not_left_and_the_goal_that_is_not_entered(problem):
    road = roadmap()
    at_start, at_goal = ((road.position == end).all(axis=1) for end in (START, GOAL))
    path = Planner(without(road, ~at_start[sources(road)]), problem).query(START, GOAL)
    assert (path.why_not["start_left"], path.why.startswith("the start is not left")) == (False, True)
    assert path.why_not["nearest"]["distance_to_goal_m"] == pytest.approx(math.dist(START, GOAL))
    assert "from it, is the start itself" in path.why
    # a goal that no control meets to a nanometre
    evaluator = problem.evaluator
    alone = replace(
        problem, evaluator=replace(evaluator, integration=replace(evaluator.integration, tolerance=1e-9))
    )
    search = Planner(without(road, ~at_goal[road.target]), alone)
    path = search.query(START, GOAL)
    assert path.why_not["start_left"]
    assert not path.why_not["goal_entered"]
    assert path.why.startswith("no leg ends at the goal: of ")
    assert path.why_not["cause"] == "missed"
    assert set(path.why_not["legs_into_goal"]["statuses"]) <= {"no_hit", "current_too_strong"}


def test_nodes_too_far_apart(tmp_path):
    road = changed(tmp_path, "integration.steps=2")
    path = planner.query(road)
    told = path.why_not
    assert told["cause"] == "spacing"
    assert told["spacing_m"]["down"] == 75.0
    problem = scenario_from_text(road.provenance.scenario).problem()
    polar = problem.evaluator.polar
    fastest = max(speed[-1] * math.sin(angle) for speed, angle in zip(polar.speed, polar.steepest, strict=True))
    assert told["reach_m"]["down"] == pytest.approx(10 * fastest)
    across = 10 * (polar.best_horizontal.max() + problem.evaluator.flow.extent.max_speed)
    assert told["reach_m"]["across"] == pytest.approx(across)
    assert told["legs_onward"]["statuses"] == {"too_far": told["legs_onward"]["looked_at"]}
    assert "100% too far or too deep" in path.why
    assert f"75 m in depth, and one glide covers {across:,.0f} m" in path.why
    assert no_edges(road, problem).startswith("the roadmap has no edge: of ")
    assert no_edges(road, problem).endswith("sample more nodes, or give [integration] more steps")
    assert no_edges(roadmap(), problem) == ""


UNIFORM = SCENARIO[SCENARIO.index("[[flow.vortex]]") : SCENARIO.index("[glider]")]


@pytest.mark.parametrize("method", ["streamline", "flow-map"])
def test_a_current_that_outruns_the_glider(tmp_path, method):
    """Eastward at 1.5 m/s where a glider makes 0.9: no way leads west, whatever the method says."""
    file = scenario_file(
        tmp_path,
        ('kind = "vortices"\nx = [-600.0, 600.0]\ny = [-600.0, 600.0]\n', 'kind = "uniform"\nu = 1.5\nv = 0.0\n'),
        (UNIFORM, ""),
        ("[-190.0, 190.0, 0.0]", "[150.0, 0.0, 0.0]"),
        ("[160.0, -160.0, 0.0]", "[-150.0, 0.0, 0.0]"),
    )
    more = ["steering.candidates=24"] if method == "streamline" else []
    road = planner.build(read_scenario(file, [f"steering.method={method}", *more]))
    path = planner.query(road)
    told = path.why_not
    assert not path.found
    assert told["cause"] == "current"
    onward = told["legs_onward"]
    assert onward["current_outruns_share"] >= 0.5
    assert "the current outruns the glider on" in path.why
    assert path.why.endswith("more nodes may find a way round")


def test_the_share_that_the_current_forbids_is_that_of_the_triangle_of_velocities(problem):
    """In a uniform current: a way is impossible where no heading at the best speed makes headway on it."""
    evaluator = replace(problem.evaluator, flow=Uniform(1.2, 0.5).kernel((-150.0, 0.0)))
    best = float(evaluator.polar.best_horizontal.max())
    angles = np.linspace(0, 2 * math.pi, 73)[:-1]
    ends = np.column_stack([100 * np.cos(angles), 100 * np.sin(angles), np.full(72, -75.0)])
    found = outrun(replace(problem, evaluator=evaluator), np.zeros((72, 3)), ends, np.zeros(72))
    headings = np.linspace(0, 2 * math.pi, 20_001)
    ground = np.column_stack([1.2 + best * np.cos(headings), 0.5 + best * np.sin(headings)])
    courses = np.arctan2(ground[:, 1], ground[:, 0])
    can = np.array(
        [np.abs((courses - angle + math.pi) % (2 * math.pi) - math.pi).min() < 1e-3 for angle in angles]
    )
    assert found.tolist() == (~can).tolist()
    assert 0 < found.sum() < 72


def test_outside_the_box_of_nodes(problem):
    road = roadmap()
    beyond = road.position[:, 0] - road.position[:, 1] > 60.0
    goal = np.array([230.0, -160.0, -10.0])
    told = Planner(cut(road, beyond), problem).query(START, goal).why_not
    assert told["outside_box_m"] == {"goal": pytest.approx(30.0)}


def test_with_a_clock_legs_leave_when_their_node_is_reached(problem, monkeypatch):
    """Arrival times are all that it takes of a search; with `clock` they are when its legs leave."""
    road = roadmap()
    arrival = Planner(road, problem).arrivals(START)
    arrival[road.position[:, 0] > 0] = np.inf
    asked = []
    connect = type(problem.evaluator).connect

    def looked(self, position, departure, *rows):
        asked.append(np.array(departure, float))
        return connect(self, position, departure, *rows)

    monkeypatch.setattr(type(problem.evaluator), "connect", looked)
    still = why_not(problem, road.position, arrival, np.array(START), np.array(GOAL))
    assert all((times == problem.departure).all() for times in asked)
    asked.clear()
    moving = why_not(problem, road.position, arrival, np.array(START), np.array(GOAL), clock=True)
    reached = arrival[np.isfinite(arrival)]
    assert asked[0].max() > 0
    assert set(asked[0]) <= {problem.departure, *(problem.departure + reached)}
    # the flow is steady: when a leg leaves changes nothing
    assert moving.as_dict() == still.as_dict()


def test_a_rule_of_surfacings_is_explained_on_the_nodes_themselves(problem):
    search = SurfacingPlanner(roadmap(), problem, Surfacing(most_hours=1e-3))
    path = search.query(START, GOAL)
    assert not path.found
    assert path.why_not["nodes"] == len(roadmap().position)
    assert path.why_not["cause"] == "not held"
    assert "a rule of surfacings forbids them" in path.why


def test_the_time_is_the_days_where_the_departure_is_known(problem):
    known = replace(problem, departs=datetime(2024, 11, 20, 12, tzinfo=UTC))
    road = roadmap()
    search = Planner(cut(road, road.position[:, 0] - road.position[:, 1] > 60.0), known)
    path = search.query(START, GOAL)
    assert path.why_not["nearest"]["time"].startswith("2024-11-20T12:")
    assert "at 2024-11-20 12:" in path.why


def test_in_the_path_file_and_in_json(tmp_path, capsys):
    road = changed(tmp_path, "integration.steps=2")
    write_roadmap(road, tmp_path / "road.h5")
    said = command(capsys, "query", tmp_path / "road.h5", "-o", tmp_path / "path.json", "--json")
    assert said.code == 1
    for table in (strict_json(said.out), strict_json((tmp_path / "path.json").read_text())):
        assert table["found"] is False
        assert table["why_not"]["cause"] == "spacing"
        assert table["why"].startswith("the start is not left")


@pytest.mark.parametrize("status", list(Status))
def test_every_outcome_has_its_words(status):
    looked = Looked({status: 3, Status.NO_HIT: 1} if status != Status.NO_HIT else {status: 4}, 0)
    assert str(looked).startswith("75% " if status != Status.NO_HIT else "100% ")
    assert looked.cause in ("current", "spacing", "missed", "blocked", "outside", "not held", "depth")


def test_nodes_at_one_depth_alone(problem):
    flat = replace(problem, sampler=None)
    assert isinstance(flat, Problem)
    position = roadmap().position.copy()
    position[:, 2] = 0.0
    bare = replace(without(roadmap(), np.zeros(roadmap().target.size, bool)), position=position)
    assert "its nodes lie at one depth" in no_edges(bare, flat)
