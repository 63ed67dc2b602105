"""A run: with nothing that errs the loop arrives when the plan says; with errors it comes back to the goal."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from helpers.missions import EXACT, MISSION, mission, runner

from glider_stream.base.errors import InputError
from glider_stream.kernels.flow import velocities
from glider_stream.kernels.place import Place
from glider_stream.mission.glide import heading_to
from glider_stream.mission.orders import Waypoints, trims_of, waypoints_of
from glider_stream.mission.pilot import POLICIES
from glider_stream.mission.run import ENDS, Runner
from glider_stream.mission.settings import POLICIES as NAMES
from glider_stream.mission.settings import mission_from_table
from glider_stream.mission.vehicle import Vehicle

WAYPOINTS = {**EXACT, "vehicle.steering": "waypoints"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("mission")


def flown(folder, changes, number=0):
    found = runner(folder, tuple(changes.items())).run(number)
    return {outcome.policy: outcome for outcome in found}


def vehicle_of(folder, changes):
    made = runner(folder, tuple(changes.items()))
    true, settings = made.worlds.true, made.mission
    start = Place(*true.start, true.departure)
    random = np.random.default_rng(3)
    return Vehicle(true, settings.vehicle, settings.pilot.rule, settings.energy, random, start), made


def test_every_policy_has_a_class():
    assert tuple(POLICIES) == NAMES


def test_without_errors_the_loop_arrives_when_the_plan_says(folder):
    found = flown(folder, EXACT)
    for policy in ("open-loop", "replan", "omniscient"):
        outcome = found[policy]
        assert outcome.ended == "arrived"
        assert outcome.time == pytest.approx(outcome.planned, rel=0.01)
        assert outcome.off < 8.0
    assert found["replan"].plans > 1
    assert found["replan"].time <= found["open-loop"].time * (1 + 1e-3)
    assert found["replan"].time == found["omniscient"].time


def test_without_errors_waypoints_arrive_too_and_take_longer(folder):
    found = flown(folder, WAYPOINTS)
    ideal = flown(folder, EXACT)["omniscient"].time
    for policy in ("open-loop", "replan", "straight", "depth-averaged"):
        assert found[policy].ended == "arrived"
        assert ideal * 0.9 < found[policy].time < ideal * 2.5


def test_with_errors_only_replanning_finds_the_goal_again(folder):
    found = [flown(folder, {"forecast_error.rms_share": 0.8}, number) for number in range(3)]
    assert all(run["replan"].arrived for run in found)
    assert not all(run["open-loop"].arrived for run in found)
    assert {outcome.ended for run in found for outcome in run.values()} <= set(ENDS)
    assert any(outcome.failed for run in found for outcome in run.values())


def test_a_run_depends_on_its_number_and_the_seed_alone(folder):
    again = Runner(mission(folder)).run(2)
    for one, other in zip(runner(folder).run(2), again, strict=True):
        assert one.time == other.time
        assert np.array_equal(one.track, other.track)
    assert runner(folder).run(3)[1].time != again[1].time


def test_the_track_is_whole(folder):
    for outcome in runner(folder).run(1):
        assert outcome.track[0].tolist() == [0.0, -190.0, 190.0, 0.0]
        assert (np.diff(outcome.track[:, 0]) >= 0).all()
        assert outcome.track[-1, 0] == pytest.approx(outcome.time)
        steps = np.diff(outcome.track, axis=0)
        assert np.hypot(steps[:, 1], steps[:, 2]).max() < 5.0 * 2.0
        assert outcome.track[:, 3].max() <= 1e-9


def test_a_run_that_is_too_long_ends(folder):
    found = flown(folder, {"arrival.longest_hours": 0.05})
    assert {outcome.ended for outcome in found.values()} == {"out of time"}


def test_a_call_costs_time_and_lets_the_vehicle_drift(folder):
    vehicle, made = vehicle_of(folder, {**EXACT, "vehicle.call_minutes": 2.0})
    vehicle.here = before = Place(-80.0, 60.0, 0.0, 0.0)
    assert vehicle.call() is True
    here = vehicle.here
    assert here.t == pytest.approx(120.0)
    assert here.z == 0.0
    flow = made.worlds.true.evaluator.flow
    middle = [np.array([0.5 * (a + b)]) for a, b in zip(before, here, strict=True)]
    current = velocities(flow, *middle)[0]
    assert (here.x - before.x, here.y - before.y) == pytest.approx(tuple(120.0 * current), abs=2.0)
    assert math.hypot(*current) > 0.05
    assert vehicle.spent == pytest.approx(0.5 * 120.0)
    assert (vehicle.fix.x, vehicle.fix.y) == (here.x, here.y)


def test_a_call_that_fails_brings_no_orders(folder):
    vehicle, _ = vehicle_of(folder, {**EXACT, "vehicle.call_failure": 1.0})
    assert vehicle.call() is False
    found = flown(folder, {**EXACT, "vehicle.call_failure": 1.0})
    assert found["replan"].plans == 1
    assert found["replan"].time == found["open-loop"].time  # the vehicle goes on with its list


def test_the_mean_current_of_a_dive_is_the_fix_less_the_dead_reckoned_way(folder):
    """Without errors it is what carried the vehicle: its way over ground less its way through water."""
    vehicle, made = vehicle_of(folder, WAYPOINTS)
    stops = np.array([[150.0, -150.0]])
    vehicle.dive(Waypoints(stops, np.array([150.0]), np.array([0.6])))
    way = np.sum([np.array([math.cos(p.heading), math.sin(p.heading)]) * p.speed * math.cos(p.glide_angle)
                  * (p.rows[-1, 0] - p.rows[0, 0]) for p in vehicle.phases], axis=0)  # fmt: skip
    moved = np.array(vehicle.here[:2]) - made.worlds.true.start[:2]
    took = vehicle.here.t - made.worlds.true.departure
    assert vehicle.fix.current == pytest.approx(tuple((moved - way) / took), abs=1e-9)
    assert 0.01 < math.hypot(*vehicle.fix.current) < 0.7


def test_a_biased_compass_looks_like_a_current(folder):
    straight, biased = (
        vehicle_of(folder, {**WAYPOINTS, "vehicle.heading_bias_deg": bias})[0] for bias in (0.0, 10.0)
    )
    for vehicle in (straight, biased):
        vehicle.dive(Waypoints(np.array([[150.0, -150.0]]), np.array([150.0]), np.array([0.6])))
    assert math.dist(straight.fix.current, biased.fix.current) > 0.02


def test_the_heading_corrects_for_the_current():
    heading = heading_to(100.0, 0.0, 0.1, 0.2, 0.5)
    assert 0.5 * math.sin(heading) + 0.2 == pytest.approx(0.0, abs=1e-12)
    assert heading_to(100.0, 0.0, 0.0, 0.7, 0.5) == 0.0  # too strong a current: straight for the place


def test_the_yo_of_a_waypoint_stands_for_the_legs_before_it(folder):
    made = runner(folder, tuple(EXACT.items()))
    office = made.office(0)
    path = office.planner.query(made.worlds.true.start, made.worlds.true.goal)
    orders = waypoints_of(path, 0.6)
    assert orders.stops[-1].tolist() == made.worlds.true.goal[:2].tolist()
    assert len(orders.stops) == sum(leg.end[2] >= -10.0 for leg in path.legs)
    assert orders.depth.max() == -min(leg.end[2] for leg in path.legs)
    assert len(trims_of(path).glides) == len(path.legs)


def test_a_vehicle_on_shoals_runs_aground(folder):
    from glider_stream.kernels.terrain import Seabed

    vehicle, made = vehicle_of(folder, WAYPOINTS)
    corner = np.array([[[0.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [1.0, 1.0]]])

    def seabed(height):
        bottom = np.full((2, 2), height)
        return Seabed(bottom, 5.0, corner, 1 / 2000.0, 1 / 2000.0, -1000.0, -1000.0, bottom)

    orders = Waypoints(np.array([[150.0, -150.0]]), np.array([150.0]), np.array([0.6]))
    for height, lost in ((-60.0, ""), (-3.0, "aground"), (0.0, "aground")):
        vehicle, made = vehicle_of(folder, WAYPOINTS)
        true = made.worlds.true
        shoal = replace(true, evaluator=replace(true.evaluator, terrain=seabed(height)))
        vehicle = Vehicle(
            shoal, vehicle.settings, vehicle.rule, vehicle.energy, np.random.default_rng(0), vehicle.here
        )
        vehicle.dive(orders)
        assert vehicle.lost == lost
        deepest = min((phase.rows[:, 3].min() for phase in vehicle.phases), default=0.0)
        assert deepest >= height + 5.0 or deepest == 0.0  # an altimeter turns the dive above the seabed


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"vehicle": {"colour": 1}}, "the key `vehicle.colour` is not known"),
        ({"vehicle": {"call_failure": 1.5}}, "`vehicle.call_failure` must be from 0 to 1"),
        ({"weather": {}}, "the section `weather` of a mission is not known"),
        (
            {"pilot": {"policies": ["replan", "magic"]}},
            "names 'magic', which is not known; choose from: open-loop",
        ),
        ({"pilot": {"policies": []}}, "must name each policy once"),
        ({"truth": {"kind": "uniform", "u": 0.1, "v": 0.0}}, "got both"),
        ({"forecast_error": {"length_m": -1.0}}, "`forecast_error.length_m` must be above 0"),
        ({"forecast_error": {"time_s": "sometimes"}}, 'must be a finite number or "steady"'),
        ({"arrival": {"radius_m": 10.0}}, "must not be above `arrival.radius_m`, 10 m"),
        ({"random": {"seed": -1}}, "`random.seed` must be at least 0"),
        ({"energy": {"preset": "steam"}}, "is not known; choose from: slocum"),
    ],
)
def test_what_is_wrong_is_refused_in_one_sentence(folder, change, sentence):
    table = tomllib.loads(MISSION)
    for section, values in change.items():
        table[section] = {**table.get(section, {}), **values}
    with pytest.raises(InputError) as refused:
        mission_from_table(table, folder / "small-mission.toml")
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("left_out", "sentence"),
    [
        ("forecast_error", "by one of [truth] and [forecast_error]; got neither"),
        ("random", "the section [random] of the mission is missing; add it: the seed"),
    ],
)
def test_a_missing_section_is_named(folder, left_out, sentence):
    table = {name: block for name, block in tomllib.loads(MISSION).items() if name != left_out}
    with pytest.raises(InputError) as refused:
        mission_from_table(table, folder / "small-mission.toml")
    assert sentence in str(refused.value)


def test_another_current_may_be_the_truth(folder):
    """The scenario's current is the forecast then; still water as the truth needs no correction."""
    table = {name: block for name, block in tomllib.loads(MISSION).items() if name != "forecast_error"}
    vortex = {"x": 300.0, "y": 300.0, "radius": 100.0, "speed": 1e-6}
    still = {"kind": "vortices", "x": [-600.0, 600.0], "y": [-600.0, 600.0], "sampled": [50.0, 50.0, 50.0]}
    table["truth"] = {**still, "vortex": [vortex]}
    made = Runner(mission_from_table(table, folder / "small-mission.toml"))
    world = made.worlds.world(0)
    assert world.speed < 1e-5 < 0.05 < world.error
    assert made.worlds.world(1).forecast is world.forecast
    found = {outcome.policy: outcome for outcome in made.run(0)}
    assert found["omniscient"].arrived
    assert found["replan"].arrived
