"""Queries: against brute force, in any number, with legs that chain."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from helpers.small import SCENARIO, TOLERANCE, K, distance, roadmap, scenario_file, strict_json

from glider_stream import planner
from glider_stream.base.errors import InputError, InputWarning
from glider_stream.kernels.edges import Status
from glider_stream.pilot.export import EXPORTS, Options
from glider_stream.pilot.route_files import read_drawn
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import read_scenario, scenario_from_text
from glider_stream.search.path import load_path, load_plan, shortened
from glider_stream.search.query import Planner

START, GOAL = (-190.0, 190.0, 0.0), (160.0, -160.0, 0.0)
PAIRS = [
    (START, GOAL),
    (GOAL, START),
    (START, (0.0, 0.0, -75.0)),
    ((0.0, 80.0, 0.0), (123.0, -99.0, -120.0)),
    ((-30.0, 20.0, -50.0), GOAL),
    ((-30.0, 20.0, -50.0), (100.0, 20.0, -10.0)),
    ((-30.0, 20.0, -50.0), (100.0, 120.0, -50.0)),
    ((190.0, -150.0, -149.0), (-150.0, -120.0, -3.0)),
    ((0.0, 0.0, 0.0), (1.0, 20.0, -40.0)),
]
PATH_KEYS = {"found", "travel_time_s", "cost", "legs", "lower_bound", "origin"}
LEG_KEYS = {"from", "to", "glide_angle_rad", "heading_rad", "speed_mps", "depart_s", "duration_s", "miss_m"}
LEG_KEYS |= {"trajectory"}


@pytest.fixture(scope="module")
def problem():
    return scenario_from_text(roadmap().provenance.scenario).problem()


@pytest.fixture(scope="module")
def router(problem):
    return Planner(roadmap(), problem)


def nearest(position, point):
    """The K nearest nodes at other depths, of equally near ones the first; the plain way."""
    others = [n for n in range(len(position)) if position[n][2] != point[2]]
    others.sort(key=lambda n: (np.linalg.norm(position[n] - point), n))
    return others[:K]


def brute_force(problem, start, goal):
    """Cost [s] by relaxing every edge until nothing changes."""
    road = roadmap()
    edges = [
        (source, int(road.target[n]), float(road.cost[n]))
        for source in range(len(road.position))
        for n in range(road.indptr[source], road.indptr[source + 1])
    ]
    points = [*map(tuple, road.position), "start", "goal"]
    ends = {"start": start, "goal": goal}
    at = {name: [n for n, point in enumerate(points) if point == end] for name, end in ends.items()}

    def leg(a, b):
        edge = problem.evaluator.connect_pair(a, b)
        return edge.cost if edge.status == Status.CONNECTED else np.inf

    first, last = len(points) - 2, len(points) - 1
    if at["start"]:
        edges += [(first, n, 0.0) for n in at["start"]]
    else:
        edges += [(first, n, leg(start, points[n])) for n in nearest(road.position, np.array(start))]
    if at["goal"]:
        edges += [(n, last, 0.0) for n in at["goal"]]
    else:
        edges += [(n, last, leg(points[n], goal)) for n in nearest(road.position, np.array(goal))]
    if not (at["start"] and at["goal"]):
        edges.append((first, last, leg(start, goal)))
    source, target, cost = (np.array(column) for column in zip(*edges, strict=True))
    best = np.full(len(points), np.inf)
    best[first] = 0.0
    while True:
        relaxed = best.copy()
        np.minimum.at(relaxed, target, best[source] + cost)
        if (relaxed == best).all():
            return best[last]
        best = relaxed


def test_the_reference_knows_the_roadmaps_neighbours():
    road = roadmap()
    for source in range(0, len(road.position), 7):
        row = road.target[road.indptr[source] : road.indptr[source + 1]]
        assert set(row) <= set(nearest(road.position, road.position[source]))


@pytest.mark.parametrize(("start", "goal"), PAIRS)
def test_the_cost_is_that_of_brute_force(problem, router, start, goal):
    path = router.query(start, goal)
    assert path.cost == pytest.approx(brute_force(problem, start, goal), rel=1e-12)
    assert path.found


@pytest.mark.parametrize(("start", "goal"), PAIRS)
def test_legs_chain_and_times_add_up(router, start, goal):
    path = router.query(start, goal)
    assert tuple(path.legs[0].start) == start
    assert tuple(path.legs[-1].end) == goal
    for leg, following in itertools.pairwise(path.legs):
        assert (leg.end == following.start).all()
        assert following.depart == leg.depart + leg.duration
    assert path.legs[0].depart == 0
    assert path.travel_time == pytest.approx(sum(leg.duration for leg in path.legs), rel=1e-14)
    assert path.travel_time == pytest.approx(path.cost, rel=1e-12)
    assert path.trajectory[0, 0] == 0
    assert (np.diff(path.trajectory[:, 0]) >= 0).all()


@pytest.mark.parametrize(("start", "goal"), PAIRS)
def test_trajectories_end_within_the_tolerance(router, start, goal):
    for leg in router.query(start, goal).legs:
        rows = leg.trajectory
        assert rows.shape[1] == 4
        assert (np.diff(rows[:, 0]) > 0).all()
        assert tuple(rows[0, 1:]) == tuple(leg.start)
        assert rows[0, 0] == leg.depart
        assert rows[-1, 0] == pytest.approx(leg.depart + leg.duration, rel=1e-12)
        # the kernel's closest approach lies on a chord of dt, the last row on a step that ends there
        assert distance(rows[-1, 1:], leg.end) == pytest.approx(leg.miss, abs=0.05)
        assert 0 <= leg.miss < TOLERANCE
        climbs = np.diff(rows[:, 3]) / np.diff(rows[:, 0])
        assert climbs == pytest.approx(leg.speed * np.sin(leg.glide_angle), rel=1e-6)


def test_many_goals_from_one_search_and_a_table_are_the_single_queries(router, monkeypatch):
    starts, goals = ([pair[n] for pair in PAIRS] for n in range(2))
    single = [[router.query(start, goal) for goal in goals] for start in starts]
    searches = []
    search = Planner._search
    monkeypatch.setattr(
        Planner, "_search", lambda self, start, *more: searches.append(start) or search(self, start, *more)
    )
    for start, paths in zip(starts, single, strict=True):
        assert [path.as_dict() for path in router.queries(start, goals)] == [path.as_dict() for path in paths]
    table = router.table(starts, goals)
    assert len(searches) == 2 * len(starts)
    assert table.tolist() == [[path.cost for path in paths] for paths in single]
    assert planner.table(roadmap(), starts[:2], goals[:3]).tolist() == table[:2, :3].tolist()
    assert planner.table(roadmap(), [], goals).shape == (0, len(goals))
    assert planner.table(roadmap(), starts, []).shape == (len(starts), 0)


def test_the_leg_from_end_to_end_is_tried(problem, router):
    start, goal = (-30.0, 20.0, -50.0), (-20.0, 55.0, -20.0)
    direct = problem.evaluator.connect_pair(start, goal)
    assert direct.status == Status.CONNECTED
    path = router.query(start, goal)
    assert len(path.legs) == 1
    assert path.cost == direct.cost
    assert path.cost == brute_force(problem, start, goal)


@pytest.mark.parametrize("place", [START, (0.0, 0.0, -75.0), (12.0, 34.0, -56.0)])
def test_a_start_at_the_goal_needs_no_leg(router, place):
    path = router.query(place, place)
    assert (path.found, path.cost, path.travel_time, path.legs) == (True, 0, 0, ())
    assert strict_json(EXPORTS[".json"](path, "path.json", Options())["path.json"]) == {
        "found": True,
        "travel_time_s": 0,
        "cost": 0,
        "legs": [],
    }
    assert "0 legs, 0 s" in str(path)


def test_a_goal_that_is_a_node_twice_is_reached_at_either(problem):
    """The grid has a node where the scenario's goal lies; the k nearest may hold but the first."""
    road = roadmap()
    twins = np.flatnonzero((road.position == GOAL).all(axis=1))
    assert len(twins) == 2
    for lost in twins:
        keep = road.target != lost
        rows = np.repeat(np.arange(len(road.position)), np.diff(road.indptr))[keep]
        indptr = np.searchsorted(rows, np.arange(len(road.position) + 1))
        names = ("target", "time", "cost", "glide_angle", "heading", "speed", "miss")
        thinned = replace(road, indptr=indptr, **{name: getattr(road, name)[keep] for name in names})
        path = Planner(thinned, problem).query(START, GOAL)
        assert path.found
        assert tuple(path.legs[-1].end) == GOAL


def test_queries_leave_the_roadmap_as_it_is(problem):
    road = roadmap()
    names = ("position", "indptr", "target", "time", "cost", "glide_angle", "heading", "speed", "miss")
    before = {name: getattr(road, name).copy() for name in names}
    router = Planner(road, problem)
    random = np.random.default_rng(4)
    first = router.query(*PAIRS[5])
    found = 0
    for _ in range(25):
        start, goal = random.uniform((-200, -200, -150), (200, 200, 0), (2, 3))
        found += router.query(start, goal).found
    again = router.query(*PAIRS[5])
    assert found > 15
    assert first.as_dict() == again.as_dict()
    for name in names:
        assert getattr(road, name).tobytes() == before[name].tobytes()


def test_a_file_answers_many_queries_unchanged(tmp_path):
    file = tmp_path / "small.h5"
    write_roadmap(roadmap(), file)
    before, when = file.read_bytes(), file.stat().st_mtime_ns
    for start, goal in PAIRS[:4]:
        of_file, in_memory = (planner.query(road, start, goal).as_dict() for road in (file, roadmap()))
        assert {**of_file, "origin": None} == {**in_memory, "origin": None}
    assert file.read_bytes() == before
    assert file.stat().st_mtime_ns == when


def test_the_path_file_has_the_keys_of_the_design(tmp_path):
    file = tmp_path / "path.json"
    path = planner.query(roadmap(), outputs=[file])
    table = strict_json(file.read_text())
    assert set(table) == PATH_KEYS
    assert table["found"] is True
    assert table["travel_time_s"] == path.travel_time
    assert len(table["legs"]) == len(path.legs) > 1
    for leg in table["legs"]:
        assert set(leg) == LEG_KEYS
        assert len(leg["from"]) == len(leg["to"]) == 3
        assert all(len(row) == 4 for row in leg["trajectory"])


def test_a_path_file_comes_back(tmp_path):
    file = tmp_path / "path.json"
    path = planner.query(roadmap(), outputs=[file])
    read = load_path(file)
    assert read.as_dict() == path.as_dict()
    assert (read.start == path.start).all()
    assert (read.goal == path.goal).all()


def test_a_long_route_is_shown_by_its_ends():
    lines = [f"  leg {n}" for n in range(40)]
    assert shortened(lines[:25]) == lines[:25]
    assert shortened(lines) == [*lines[:10], "  ... 25 more legs, in --json and in the file of -o", *lines[-5:]]


def test_a_path_file_without_its_origin_is_an_assumption(tmp_path):
    file = tmp_path / "path.json"
    table = json.loads(json.dumps(planner.query(roadmap()).as_dict()))
    file.write_text(json.dumps({name: value for name, value in table.items() if name != "origin"}))
    with pytest.warns(
        InputWarning, match=r"no `origin`, .* taken as metres from the origin of the scenario here"
    ):
        assert load_plan(file).origin is None
    (note,) = read_drawn(file).notes
    assert "taken as metres from the origin" in note


def test_no_path_is_an_answer(tmp_path):
    far = read_scenario(scenario_file(tmp_path), ["integration.steps=1", "integration.tolerance=0.001"])
    road = planner.build(far)
    assert road.target.size == 0
    file = tmp_path / "path.json"
    path = planner.query(road, outputs=[file])
    assert not path.found
    assert path.legs == ()
    assert path.trajectory.shape == (0, 4)
    table = strict_json(file.read_text())
    assert (table["found"], table["travel_time_s"], table["cost"], table["legs"]) == (False, None, None, [])
    assert table["why"] == path.why
    assert table["why_not"]["cause"] == "spacing"
    assert not planner.query(road, (1, 2, -3), (100, 20, -30)).found


def test_a_changed_flow_or_glider_is_refused(problem):
    def changed(old, new):
        return scenario_from_text(SCENARIO.replace(old, new)).problem().evaluator

    faster = replace(problem.evaluator, flow=changed("speed = 0.4", "speed = 0.5").flow)
    slower = replace(problem.evaluator, polar=changed('"paper"', '"slocum"').polar)
    for name, evaluator in (("flow", faster), ("glider", slower)):
        with pytest.raises(InputError, match=f"the {name} has changed .*; build the roadmap again"):
            Planner(roadmap(), replace(problem, evaluator=evaluator))


def test_a_departure_shifts_no_clock(tmp_path):
    """In a steady flow a path that departs later is the same path; its clock begins at 0."""
    early = planner.query(roadmap(), *PAIRS[5])
    late = read_scenario(scenario_file(tmp_path), ["query.departure=3600"])
    path = planner.query(replace_scenario(roadmap(), late.text), *PAIRS[5])
    assert path.trajectory[:, 0] == pytest.approx(early.trajectory[:, 0], abs=1e-9)
    assert path.travel_time == early.travel_time


def replace_scenario(road, text):
    return replace(road, provenance=replace(road.provenance, scenario=text))


def test_an_end_that_is_not_named_is_asked_for(tmp_path):
    file = scenario_file(tmp_path, (SCENARIO[SCENARIO.index("[query]") :], ""))
    router = Planner(roadmap(), read_scenario(file).problem())
    with pytest.raises(InputError, match="names no goal; give one with --goal"):
        router.query(START)
    with pytest.raises(InputError, match="three numbers X,Y,Z"):
        router.query((1.0, 2.0), GOAL)
