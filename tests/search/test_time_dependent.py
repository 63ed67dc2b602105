"""The clock runs: routes flown from end to end in flows that change; nothing found is better; when to leave."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.small import command, strict_json
from scipy.integrate import solve_ivp

from glider_stream.base.errors import InputError
from glider_stream.base.threads import threads
from glider_stream.kernels.flow import velocity
from glider_stream.opened import open_scenario
from glider_stream.pilot.export import export_path
from glider_stream.roadmap.builder import build_roadmap, node_positions
from glider_stream.scenario import read_scenario
from glider_stream.search.answer import planner_of
from glider_stream.search.least_time import GreatestSpeeds, LeastTimes
from glider_stream.search.path import FROZEN, hops_of, load_path
from glider_stream.search.query import Planner
from glider_stream.search.surfacing import Surfacing
from glider_stream.search.thin import thin
from glider_stream.search.time_dependent import ClockPlanner
from glider_stream.water.ocean.flow import slots

pytestmark = pytest.mark.slow

GYRE = ["flow.period=900.0", "sampling.shape=[8, 4, 3]"]
FEW = ["flow.period=900.0", "sampling.shape=[5, 3, 3]"]
FLOWS = {
    "reachable": GYRE,
    "limited": [*GYRE, "neighbours.limit=12"],
    "nearest": [*GYRE, "neighbours.kind=nearest", "neighbours.k=40"],
    "radius": [*GYRE, "neighbours.kind=radius", "neighbours.radius=420.0"],
    "all": [*GYRE, "neighbours.kind=all"],
    "streamline": [
        *GYRE,
        "neighbours.kind=nearest",
        "neighbours.k=30",
        "steering.method=streamline",
        "steering.candidates=24",
        "steering.refine=true",
    ],
}
ENERGY = [*GYRE, "cost.kind=energy", "cost.preset=slocum", "cost.hotel=0.9"]


def clock(sets, **how):
    problem = read_scenario("swinging-gyre", sets).problem()
    return ClockPlanner(problem, node_positions(problem), **how)


@pytest.fixture(scope="module")
def gyre():
    return clock(GYRE)


def flown(flow, path):
    """Where a path file's trims and times lead, one after the other, by DOP853 in the flow as it changes."""
    at, places = np.array(path["legs"][0]["from"]), []
    for leg in path["legs"]:
        glide, heading, speed = leg["glide_angle_rad"], leg["heading_rad"], leg["speed_mps"]
        along = speed * math.cos(glide)
        through = np.array([along * math.cos(heading), along * math.sin(heading), speed * math.sin(glide)])
        begins = path["departure_s"] + leg["depart_s"]

        def rate(t, here, through=through):
            return through + np.array([*velocity(flow, *map(float, here), float(t)), 0.0])

        span = begins, begins + leg["duration_s"]
        at = solve_ivp(rate, span, at, "DOP853", rtol=1e-9, atol=1e-7, max_step=20.0).y[:, -1]
        places.append(at)
    return np.array(places)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.wide] * (name in ("streamline", "radius"))) for name in FLOWS]
)
def test_what_is_exported_flies_from_end_to_end(name, tmp_path):
    planner = clock([*FLOWS[name], "query.departure=200.0"])
    for ends in [(None, None), ((150.0, 700.0, -40.0), (1500.0, 250.0, -210.0))]:
        path = planner.query(*ends)
        assert path.found
        assert len(path.legs) > 2
        export_path(path, tmp_path / "path.json")
        told = json.loads((tmp_path / "path.json").read_text())
        assert (told["departure_s"], told["frozen"]) == (200.0, False)
        places = flown(planner.problem.evaluator.flow, told)
        off = np.linalg.norm(places - [leg["to"] for leg in told["legs"]], axis=1)
        assert off.max() < 0.1
        assert load_path(tmp_path / "path.json").departure == 200.0
        # the same legs as if each met the current of the departure do not
        still = clock(FLOWS[name], frozen=True).query(*ends)
        frozen = still.as_dict() | {"departure_s": 0.0}
        assert np.linalg.norm(flown(planner.problem.evaluator.flow, frozen)[-1] - still.goal) > 5.0


def earliest(planner, start):
    """When each node is reached, by the plainest label-setting search, node by node."""
    legs, nodes = planner.problem.legs(planner.position), len(planner.position)
    time, open_ = np.full(nodes, np.inf), np.ones(nodes, bool)
    time[start] = planner.problem.departure
    while np.isfinite(time[open_]).any():
        node = int(np.argmin(np.where(open_, time, np.inf)))
        open_[node] = False
        found = legs.of(np.array([node]), time[node : node + 1])
        connected = found.outcomes[:, 0] == 0
        arrives = time[node] + found.outcomes[connected, 1]
        np.minimum.at(time, found.target[connected], arrives)
    return time - planner.problem.departure


def test_it_finds_what_the_plainest_search_finds(gyre):
    nodes = len(gyre.position)
    plain = earliest(gyre, nodes - 2)
    assert gyre.arrivals() == pytest.approx(plain, abs=0.05)
    path = gyre.query()
    assert path.travel_time == pytest.approx(plain[-1], abs=0.05)
    assert 0 < path.expanded < 1
    goals = [gyre.position[-1], (1500.0, 250.0, -210.0), gyre.position[-2]]
    row = gyre.table([gyre.position[-2]], goals)[0]
    assert row[0] == pytest.approx(path.travel_time, abs=0.05)
    assert row[1] == pytest.approx(gyre.query(None, goals[1]).travel_time, abs=0.05)
    assert row[2] == 0.0


def test_no_leg_is_faster_than_the_bound():
    """The bound of the remaining time is below every leg there is, and never falls faster than the clock runs."""
    for name in ("swinging-gyre", "seed-box"):
        sets = ["sampling.shape=[6, 6, 3]"] if name != "swinging-gyre" else GYRE
        problem = read_scenario(name, sets).problem()
        position = node_positions(problem)
        least = LeastTimes(GreatestSpeeds(problem, position, problem.departure), position)
        nodes = np.arange(len(position))
        for since in (0.0, 137.0, 410.0):
            legs = problem.legs(position).of(nodes, np.full(nodes.size, problem.departure + since))
            source = np.repeat(nodes, np.diff(legs.indptr))
            connected = legs.outcomes[:, 0] == 0
            bound = np.array([least.between(int(n)) for n in nodes])[source, legs.target]
            assert (bound[connected] <= legs.outcomes[connected, 1] + 1e-6).all()


def test_threads_change_no_bit(gyre):
    said = []
    for count in (1, 2):
        with threads(count):
            fresh = ClockPlanner(gyre.problem, gyre.position)
            said.append(json.dumps(fresh.query().as_dict()))
            said.append(fresh.arrivals().tobytes())
    assert said[:2] == said[2:]


def test_a_steady_flow_has_the_routes_of_its_roadmap():
    scenario = read_scenario("seed-box", ["sampling.shape=[6, 6, 3]", "steering.method=flow-map"])
    problem = scenario.problem()
    road = build_roadmap(problem)
    planner = planner_of(problem, road, Surfacing())
    assert type(planner) is Planner
    path, planned = planner.query(), open_scenario(scenario).query()
    assert path.found
    assert planned.travel_time == pytest.approx(path.travel_time, abs=0.05)
    assert "departure_s" not in path.as_dict()
    assert path.as_dict() == open_scenario(scenario).planner().fly(hops_of(path)).as_dict()


def test_a_roadmap_gives_its_nodes_and_frozen_its_legs(gyre):
    problem = replace(gyre.problem, frozen=True)
    road = build_roadmap(problem)
    moving, still = planner_of(gyre.problem, road, Surfacing()), planner_of(problem, road, Surfacing())
    assert json.dumps(moving.query().as_dict()) == json.dumps(gyre.query().as_dict())
    path = still.query()
    assert path.frozen
    assert path.as_dict()["frozen"] is True
    assert FROZEN in str(path)
    alone = ClockPlanner(problem, gyre.position, frozen=True).query()
    assert alone.frozen
    assert alone.travel_time == pytest.approx(path.travel_time, abs=0.05)


def brute_front(planner, most):
    """Time and energy of every way of up to `most` legs from start to goal, each leg at its own time."""
    legs, cost = planner.problem.legs(planner.position), planner.problem.evaluator.cost
    start, goal = len(planner.position) - 2, len(planner.position) - 1
    found, waiting = [], [(start, 0.0, 0.0, True, 0)]
    while waiting:
        node, time, energy, dived, count = waiting.pop()
        if node == goal:
            found.append((time, energy))
            continue
        if count == most:
            continue
        out = legs.of(np.array([node]), np.array([planner.problem.departure + time]))
        for target, row in zip(out.target, out.outcomes, strict=True):
            if row[0] == 0:
                climbs = row[3] > 0
                turn = float(cost.inflection(planner.position[node, 2])) if climbs and dived else 0.0
                waiting.append((int(target), time + row[1], energy + row[2] + turn, not climbs, count + 1))
    return np.array(found)


@pytest.mark.parametrize("flow", ["query.bins=10.0", "flow.epsilon=0.0"])
def test_the_front_of_time_and_energy_is_exact(flow):
    """Exact in a steady flow; in one that changes with bins of time, where few nodes join now and then."""
    sets = [*ENERGY, "sampling.shape=[4, 2, 3]", "query.goal=[1000.0, 500.0, -250.0]", flow]
    planner = clock(sets)
    every = brute_front(planner, 4)
    front = planner.front()
    points = np.array([(path.travel_time, path.cost) for path in front.paths])
    assert (np.diff(points[:, 0]) > 0).all()
    assert (np.diff(points[:, 1]) < 0).all()
    # no way is better than the front in both, and short ways of the front are among them
    for time, energy in every:
        assert ((points[:, 0] <= time + 0.05) & (points[:, 1] <= energy + 0.05)).any()
    for path in front.paths:
        if len(path.legs) <= 4:
            assert np.hypot(every[:, 0] - path.travel_time, every[:, 1] - path.cost).min() < 0.1
    assert planner.query().cost == pytest.approx(points[-1, 1])
    for bound in (points[0, 1], points[-1, 1], points[:, 1].mean()):
        assert planner.within(None, None, float(bound)).travel_time == pytest.approx(
            points[points[:, 1] <= bound, 0].min()
        )
    none = planner.within(None, None, 1.0)
    assert not none.found
    assert "the least that one takes is" in none.why


def test_rules_of_surfacing_hold_with_the_clock_running(gyre):
    ends = gyre.position[-2], gyre.position[-1]
    free = gyre.query(*ends)
    for rule in (Surfacing(1), Surfacing(None, 0.2), Surfacing(2, 0.25)):
        bound = ClockPlanner(gyre.problem, gyre.position, rule)
        path = bound.query(*ends)
        assert path.found
        assert rule.holds(path)
        assert path.travel_time >= free.travel_time - 1e-6
        end = flown(gyre.problem.evaluator.flow, path.as_dict())[-1]
        assert np.linalg.norm(end - path.goal) < 0.1
    with pytest.raises(InputError, match="at the surface; got a depth of 50 m"):
        ClockPlanner(gyre.problem, gyre.position, Surfacing(1)).query((300.0, 300.0, -50.0))


def test_fewer_legs_are_found_at_their_own_times(gyre):
    path = gyre.query((1654.0, 533.0, 0.0), (639.0, 438.0, 0.0))
    fewer = thin(path, 1e4, gyre.connect, gyre.fly)
    assert len(fewer.legs) < len(path.legs)
    places = flown(gyre.problem.evaluator.flow, fewer.as_dict())
    assert np.linalg.norm(places - [leg.end for leg in fewer.legs], axis=1).max() < 0.1


@pytest.mark.wide
def test_when_to_leave(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    opened = open_scenario("swinging-gyre", FEW)
    found = opened.when_to_leave((0.0, 300.0), every=150.0, figure="leave.png")
    assert [path.departure for path in found.paths] == [0.0, 150.0, 300.0]
    assert found.best.travel_time == min(path.travel_time for path in found.paths)
    for path in found.paths[1:3]:
        again = clock([*FEW, f"query.departure={path.departure}"]).query()
        assert again.travel_time == pytest.approx(path.travel_time, abs=0.05)
        assert np.linalg.norm(flown(opened.problem.evaluator.flow, path.as_dict())[-1] - path.goal) < 0.1
    by = found.paths[2].departure + found.paths[2].travel_time + 1.0
    late = opened.when_to_leave((0.0, 300.0), every=150.0, arrive_by=by)
    assert late.latest.departure == 300.0
    assert late.latest.departure + late.latest.travel_time <= by
    sets = [part for one in FEW for part in ("--set", one)]
    asked = "--depart-between", "0", "300", "--every", "150", "--json"
    asked = command(capsys, "plan", "swinging-gyre", *sets, *asked)
    rows = strict_json(asked.out)
    assert [row["departure_s"] for row in rows["departures"]] == [0.0, 150.0, 300.0]
    assert rows["best"]["travel_time_s"] == pytest.approx(found.best.travel_time, abs=0.05)
    none = command(capsys, "plan", "swinging-gyre", *sets, "--arrive-by", "60", "--every", "60")
    assert none.code == 1
    assert "none of these arrives in time" in none.err
    for wrong, words in (
        (("--depart-between", "0", "soon"), "must be seconds or a time"),
        (("--depart-between", "9", "1"), "must not lie after the last"),
        (("--every", "5"), "need --depart-between"),
        (("--arrive-by", "2024-01-01", "--thin", "5"), "leave|set query.departure"),
        (("--arrive-by", "2024-01-01T00:00"), "has no calendar"),
    ):
        refused = command(capsys, "plan", "swinging-gyre", *sets, *wrong)
        assert refused.code == 2
        assert refused.out == ""
        assert re.search(words, refused.err)


def test_plan_from_the_command_line(tmp_path, capsys, monkeypatch, gyre):
    monkeypatch.chdir(tmp_path)
    sets = [part for one in GYRE for part in ("--set", one)]
    said = strict_json(command(capsys, "plan", "swinging-gyre", *sets, "-o", "path.json", "--json").out)
    assert said["travel_time_s"] == gyre.query().travel_time
    assert strict_json((tmp_path / "path.json").read_text()) == said
    card = command(capsys, "plan", "swinging-gyre", *sets, "--card").out
    assert "over ground" in card
    still = command(capsys, "plan", "swinging-gyre", *sets, "--set", "query.frozen=true")
    assert FROZEN in still.out


def test_no_route_goes_beyond_the_last_current(ocean_of, deep_sea):
    """Where the forecast ends before any way gets there, that is said; nothing is extrapolated."""
    problem = read_scenario("swinging-gyre", [*GYRE, "query.start=[-150.0,-150.0,0.0]"]).problem()
    flow = ocean_of(lambda i, j, z, t: (0.05 + 0 * i, 0.02 * np.sin(t / 300) + 0 * i))
    changed = replace(problem.evaluator, flow=flow, terrain=deep_sea)
    start, goal = np.array([-150.0, -150.0, 0.0]), np.array([150.0, 150.0, 0.0])
    lo, hi = np.array([-180.0, -180.0, -200.0]), np.array([180.0, 180.0, 0.0])
    axes = np.linspace(-160, 160, 5), np.linspace(-160, 160, 5), np.array([-200.0, -100.0, 0.0])
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    slow = replace(problem, evaluator=changed, start=start, goal=goal, lo=lo, hi=hi, departure=0.0)
    path = ClockPlanner(slow, nodes).query()
    assert path.found
    assert path.travel_time < 1000.0
    late = ClockPlanner(replace(slow, departure=1000.0 - path.travel_time + 30.0), nodes).query()
    assert not late.found
    assert "the currents' times end at 1,000 s" in late.why
    with pytest.raises(InputError, match="lies outside the times of the flow"):
        ClockPlanner(slow, nodes).leaving(2000.0).query()


@pytest.fixture(scope="module")
def strait(ocean_of, deep_sea):
    """A current against the way until 1,050 s, then with it; a glider can hold its place, but not wait."""
    times = np.array([0.0, 1050.0, 1070.0, 4000.0])
    flow = ocean_of(lambda i, j, z, t: (0 * i, 0 * i))
    along = np.array([-0.8, -0.8, 1.6, 1.6])[:, None, None, None]
    u = np.broadcast_to(along, (4, *flow.values.shape[1:4]))
    table, per_unit = slots(times)
    extent = flow.extent._replace(x_lo=-200.0, t_hi=4000.0, max_speed=1.6)
    flow = flow._replace(
        values=np.ascontiguousarray(np.stack([u, 0 * u], axis=-1)),
        times=times,
        time_slot=table,
        slots_per_t=per_unit,
        extent=extent,
    )
    problem = read_scenario("swinging-gyre", [*GYRE, "neighbours.kind=all"]).problem()
    start, goal = np.array([-195.0, 0.0, 0.0]), np.array([195.0, 0.0, 0.0])
    there = replace(problem.evaluator, flow=flow, terrain=deep_sea)
    box = np.array([-200.0, -50.0, -100.0]), np.array([200.0, 50.0, 0.0])
    nodes = np.array([[-195.0, 0.0, -100.0], [195.0, 0.0, -100.0], start, goal])
    return replace(problem, evaluator=there, start=start, goal=goal, lo=box[0], hi=box[1]), nodes


def test_a_detour_is_the_only_way_to_wait(strait):
    """Currents are not first in, first out: who comes to the strait later arrives earlier, or at all."""
    problem, nodes = strait
    planner = ClockPlanner(problem, nodes)
    below, beyond = nodes[0], nodes[3]
    begins = planner.connect(nodes[2], below).time
    assert planner.connect(below, beyond, begins).status != 0
    assert planner.connect(below, beyond, begins + 600.0).status == 0
    # one label a node: each is come to once, too early
    assert not np.isfinite(planner.arrivals()[3])
    for bins in (None, 30.0, 120.0):
        path = ClockPlanner(replace(problem, bins=bins), nodes).query()
        assert path.found
        ends = [tuple(leg.end) for leg in path.legs]
        assert ends.count(tuple(below)) > 1
        assert np.linalg.norm(flown(problem.evaluator.flow, path.as_dict())[-1] - beyond) < 0.1
