"""Replanning from a fix: the new plan, the old list flown on, until when it is good; refusals."""

import json
import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from helpers.ionian import write_ionian
from helpers.small import SCENARIO, command, roadmap, strict_json
from scipy.integrate import solve_ivp

import glider_stream
from glider_stream import planner
from glider_stream.base.errors import InputError, InputWarning
from glider_stream.kernels.flow import velocity
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import scenario_from_text
from glider_stream.search.flown_on import flown_on, next_leg
from glider_stream.search.path import load_path, placed


def end_of(flow, leg, begins):
    """Where a leg that begins at a time [s] ends (3,) [m], by scipy's DOP853."""
    along = leg.speed * math.cos(leg.glide_angle)
    through = along * math.cos(leg.heading), along * math.sin(leg.heading)

    def rate(t, at):
        u, v = velocity(flow, *at, t)
        return [u + through[0], v + through[1], leg.speed * math.sin(leg.glide_angle)]

    times = begins, begins + leg.duration
    return solve_ivp(rate, times, leg.start, "DOP853", rtol=1e-9, atol=1e-7, max_step=60.0).y[:, -1]


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A folder with the small roadmap and a plan of it."""
    folder = tmp_path_factory.mktemp("replan")
    (folder / "small.toml").write_text(SCENARIO)
    write_roadmap(roadmap(), folder / "small.h5")
    glider_stream.open(folder / "small.h5").query(outputs=[folder / "plan.json"])
    return folder


@pytest.fixture(scope="module")
def road(small):
    return glider_stream.open(small / "small.h5")


def test_a_plan_says_what_it_was_made_with(small, road):
    origin = load_path(small / "plan.json").origin
    assert origin.roadmap == str(small / "small.h5")
    assert origin.scenario == road.scenario.text
    assert (origin.nodes_only, origin.departure, origin.most_yos, origin.most_hours) == (False, 0.0, None, None)


def test_at_the_start_nothing_changes(small, road):
    old = load_path(small / "plan.json")
    answer = road.replan(small / "plan.json", old.start[:2], 0.0)
    assert answer.new.travel_time == pytest.approx(old.travel_time, abs=1e-6)
    assert abs(answer.later) < 1e-6
    assert answer.off == pytest.approx(0, abs=1e-6)
    assert (answer.flown.first, len(answer.flown.path.legs)) == (1, len(old.legs))
    # the streamline's legs end within the tolerance of their stops, so the old list ends near the goal
    assert answer.flown.miss < 8.0 * (len(old.legs) + 1)


def test_the_old_list_flown_on_is_the_flight_of_its_trims(small, road):
    old = placed(load_path(small / "plan.json"), road.problem)
    place, problem = np.array([-180.0, 150.0, 0.0]), road.problem
    found = flown_on(old, 0.0, place, problem)
    here, clock = place, 0.0
    for leg, again in zip(old.legs, found.path.legs, strict=True):
        climb = leg.speed * math.sin(leg.glide_angle)
        duration = (leg.end[2] - here[2]) / climb
        assert again.duration == pytest.approx(duration)
        end = end_of(problem.evaluator.flow, again, clock)
        assert math.dist(end, again.end) < 0.05
        assert math.dist(here, again.start) == 0
        here, clock = again.end, clock + duration
    assert found.miss == pytest.approx(math.dist(here[:2], old.goal[:2]))


def test_an_exact_list_is_good_to_its_end_and_a_list_for_elsewhere_is_not():
    exact = SCENARIO.replace('method = "streamline"\ncandidates = 24', 'method = "flow-map"')
    road = glider_stream.open(planner.build(scenario_from_text(exact)))
    path = road.query()
    answer = road.replan(path, (-190.0, 190.0), 0.0)
    assert answer.good.whole
    assert answer.good.extra == pytest.approx(0, abs=1e-4)
    assert answer.flown.miss < 1.0
    # a plan that begins far from where the vehicle is
    answer = road.replan(path, (0.0, 0.0), 0.0)
    assert not answer.good.whole
    assert answer.good.last.since == 0
    assert "bring the new one now" in str(answer)


def test_the_next_leg_is_the_nearest_in_time_and_at_the_surface(small):
    old = load_path(small / "plan.json")
    begins = [leg.depart for leg in old.legs]
    height = [leg.start[2] for leg in old.legs]
    assert next_leg(old, 0.0) == 0
    assert next_leg(old, old.travel_time + 1e6) == len(old.legs)
    inner = [n for n in range(len(begins)) if height[n] == 0 and n]
    for n in inner:
        assert next_leg(old, begins[n] + 30.0) == n


def test_arrived_or_over(small, road):
    answer = road.replan(small / "plan.json", (160.0, -158.0), 450.0)
    assert answer.arrived
    assert answer.new.found
    assert not answer.new.legs
    assert "has arrived" in str(answer)
    answer = road.replan(small / "plan.json", (60.0, -60.0), 5000.0)
    assert not answer.arrived
    assert answer.new.found
    assert "it is over" in str(answer)
    assert answer.as_dict()["old_list"]["next_leg"] is None


def test_a_measured_current_is_compared_and_not_applied(small, road):
    old = load_path(small / "plan.json")
    assert [n for n, leg in enumerate(old.legs, 1) if leg.end[2] == 0] == [len(old.legs)]
    # it comes up at the plan's end, beside the goal
    fix, when = old.goal[:2] + np.array([-60.0, 40.0]), old.travel_time
    plain = road.replan(old, fix, when)
    assert plain.new.legs
    rows = old.trajectory
    along = [leg.duration * leg.speed * math.cos(leg.glide_angle) for leg in old.legs]
    headings = np.array([leg.heading for leg in old.legs])
    through = np.array([along @ np.cos(headings), along @ np.sin(headings)])
    # what the vehicle's own reckoning would measure along this plan
    mean = (rows[-1, 1:3] - rows[0, 1:3] - through) / when
    answer = road.replan(old, fix, when, dac=tuple(mean))
    assert answer.current.forecast == pytest.approx(mean, abs=0.06)
    assert answer.new.as_dict() == plain.new.as_dict()
    strong = road.replan(old, fix, when, dac=(mean[0] + 0.3, mean[1])).current
    assert strong.difference == pytest.approx([0.3, 0.0], abs=0.06)
    assert strong.beyond
    assert "more than 5%" in str(strong)
    with pytest.raises(InputError, match="no dive of the plan ends by the fix"):
        road.replan(old, old.start[:2], 0.0, dac=(0.1, 0.1))


def without_origin(file, folder):
    table = json.loads(file.read_text())
    del table["origin"]
    old = folder / "old.json"
    old.write_text(json.dumps(table))
    return old


def changed(file, folder, **origin):
    table = json.loads(file.read_text())
    table["origin"] |= origin
    new = folder / "changed.json"
    new.write_text(json.dumps(table))
    return new


@pytest.mark.filterwarnings("always::glider_stream.base.errors.InputWarning")  # a plan without its origin
def test_the_command(small, capsys, tmp_path):
    said = command(
        capsys, "replan", small / "plan.json", "--fix", "-60,60,200", "--json", "-o", tmp_path / "next.json"
    )
    assert said.code == 0, said.err
    answer = strict_json(said.out)
    assert answer["plan"] == strict_json((tmp_path / "next.json").read_text())
    assert answer["fix"]["since_departure_s"] == 200
    # the next plan can be planned anew in turn
    said = command(capsys, "replan", tmp_path / "next.json", "--fix", "0,0,260")
    assert said.code == 0, said.err
    assert "old list" in said.out
    # a file of an earlier version needs its roadmap or scenario
    old = without_origin(small / "plan.json", tmp_path)
    said = command(capsys, "replan", old, "--fix", "-60,60,200")
    assert (said.code, "--roadmap" in said.err) == (2, True)
    assert command(capsys, "replan", old, "--fix", "-60,60,200", "--roadmap", small / "small.h5").code == 0
    # a roadmap that is gone: the scenario's nodes, and a warning
    gone = changed(small / "plan.json", tmp_path, roadmap=str(tmp_path / "gone.h5"))
    with warnings.catch_warnings():
        warnings.simplefilter("always", InputWarning)
        said = command(capsys, "replan", gone, "--fix", "-60,60,200")
    assert (said.code, "is not there" in said.err) == (0, True)


REFUSED = {
    "-60,60": "is not a fix",
    "a,60,200": "is not a fix",
    "-60,60,": "is not a fix",
    "-60,60,noon": "must be seconds or a time",
    "-60,60,2024-11-20T12:00": "the flow has no calendar",
    "-60,60,-5": "before the plan's departure",
    "-60,nan,200": "finite",
    "900,0,200": "outside the domain",
}


@pytest.mark.parametrize("fix", REFUSED)
def test_fixes_that_are_refused(small, capsys, fix):
    said = command(capsys, "replan", small / "plan.json", f"--fix={fix}")
    assert said.code == 2
    assert REFUSED[fix] in said.err
    assert said.err.count("\n") == 1


@pytest.mark.filterwarnings("always::glider_stream.base.errors.InputWarning")  # a plan without its origin
def test_a_plan_of_another_scenario_is_refused(small, road, tmp_path, capsys):
    plan = small / "plan.json"
    old = without_origin(plan, tmp_path)
    fix = "--fix", "-60,60,200"
    for change, why in (
        ("glider.preset=slocum", "another vehicle's"),
        ("domain.z=[-40.0,0.0]", "below the depths"),
        ("flow.x=[-900.0,900.0]", None),
    ):
        run = "replan", old, *fix, "--scenario", small / "small.toml", "--set", change
        said = command(capsys, *run)
        assert (said.code == 0) if why is None else (said.code == 2 and why in said.err), said.err
    turned = SCENARIO.replace("speed = 0.4", "speed = -0.4")
    (tmp_path / "turned.toml").write_text(turned)
    said = command(capsys, "replan", old, *fix, "--scenario", tmp_path / "turned.toml")
    assert (said.code, "another scenario's" in said.err) == (2, True)
    wider = SCENARIO.replace("x = [-200.0, 200.0]", "x = [-210.0, 200.0]")
    (tmp_path / "wider.toml").write_text(wider)
    said = command(capsys, "replan", plan, *fix, "--scenario", tmp_path / "wider.toml")
    assert (said.code, "another [domain]" in said.err) == (2, True)
    said = command(capsys, "replan", plan, *fix, "--currents", tmp_path / "a.nc")
    assert (said.code, "for a flow from a file" in said.err) == (2, True)
    with pytest.raises(InputError, match="holds no leg"):
        road.replan(replace(road.query(), legs=()), (0, 0), 0.0)


@pytest.mark.slow
def test_a_steady_current_of_a_file_then_a_newer_forecast(tmp_path, capsys, monkeypatch):
    import xarray as xr

    monkeypatch.chdir(tmp_path)
    write_ionian("currents.nc")
    with xr.open_dataset("currents.nc") as file:
        now = file.load()
    now.time.encoding.clear()
    later = now.assign_coords(time=now.time + np.timedelta64(36, "h"))
    xr.concat([now, 0.8 * later.uo.to_dataset().assign(vo=later.vo)], "time").to_netcdf(
        "newer.nc", engine="h5netcdf"
    )
    here = [
        "flow.file=currents.nc",
        "flow.epoch=2024-11-20T12:00",
        "domain.lon=[18.25,18.5]",
        "sampling.per_leg=0.5",
    ]
    ends = ["domain.lat=[37.9,38.12]", "query.start=[18.3,38.08,0]", "query.goal=[18.38,38.0,0]"]
    sets = [word for change in (*here, *ends) for word in ("--set", change)]
    assert command(capsys, "build", "ionian", *sets, "-o", "io.h5").code == 0
    assert command(capsys, "query", "io.h5", "-o", "plan.json").code == 0
    fix = "--fix=18.32,38.05,2024-11-20T16:00Z"
    said = command(capsys, "replan", "plan.json", fix, "-o", "goto_l10.ma", "-o", "next.json")
    assert said.code == 0, said.err
    assert (tmp_path / "goto_l10.ma").is_file()
    assert "2024-11-20 16:00Z" in said.out
    said = command(capsys, "replan", "plan.json", fix, "--currents", "newer.nc", "-o", "newer.json")
    assert said.code == 0, said.err
    newer = load_path("newer.json")
    assert newer.departure == 0.0
    assert newer.origin.nodes_only
    assert "newer.nc" in newer.origin.scenario
    # flown in the newer forecast, with the clock running, it arrives
    problem = glider_stream.opened.open_plan(newer).problem
    for leg in newer.legs:
        assert math.dist(end_of(problem.evaluator.flow, leg, leg.depart), leg.end) < 1.0
    # and it is planned anew in turn, from what it says itself
    said = command(capsys, "replan", "newer.json", "--fix=18.34,38.03,2024-11-20T19:00")
    assert said.code == 0, said.err
    for bad, why in (
        ("38.05,18.32,2024-11-20T16:00", "swapped"),
        ("17.0,38.0,2024-11-20T16:00", "outside the domain"),
        ("18.32,38.05,2024-11-20T10:00", "before the plan's departure"),
    ):
        said = command(capsys, "replan", "plan.json", f"--fix={bad}")
        assert (said.code, why in said.err) == (2, True), said.err
    said = command(capsys, "replan", "newer.json", "--fix=18.32,38.05,2024-11-22T16:00")
    assert (said.code, "outside the times of the currents" in said.err) == (2, True), said.err


def test_replan_keeps_the_rule_of_surfacing(road):
    rule = glider_stream.Surfacing(most_yos=1)
    path = road.query(surfacing=rule)
    answer = road.replan(path, (-60.0, 60.0), 200.0)
    assert rule.holds(answer.new)
    assert answer.new.origin.most_yos == 1


def test_the_planner_takes_a_file(small):
    answer = planner.replan(small / "plan.json", (-60.0, 60.0), 200.0)
    assert answer.new.found
