"""Plans changed by hand, fixes that cannot be, dives that no vehicle makes, outputs over their inputs."""

import json
import math
from dataclasses import replace

import pytest
from helpers.small import SCENARIO, command, roadmap

import glider_stream
from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.opened import open_scenario
from glider_stream.opened.replanning import at_fix
from glider_stream.pilot.currents import dive_currents
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import scenario_from_text
from glider_stream.search.flown_on import check_smooth
from glider_stream.search.path import load_path
from glider_stream.water.mapping.observation_files import read_dives


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    """A plan of the small roadmap, as a table, and its file."""
    folder = tmp_path_factory.mktemp("mended")
    write_roadmap(roadmap(), folder / "small.h5")
    glider_stream.open(folder / "small.h5").query(outputs=[folder / "plan.json"])
    return folder / "plan.json"


def moved(leg, name, by):
    leg[name][0] += by


CHANGES = {
    "trajectory that ends elsewhere": lambda legs: moved(legs[-1], "to", -300.0),
    "begins beside the end of the leg before": lambda legs: legs.pop(1),
    "trajectory that begins elsewhere": lambda legs: moved(legs[0], "from", 50.0),
    "reach its depth": lambda legs: legs[1].update(glide_angle_rad=-legs[1]["glide_angle_rad"]),
    "times that do not fit": lambda legs: legs[2].update(depart_s=legs[2]["depart_s"] + 500.0),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_plan_changed_by_hand_is_refused(plan, tmp_path, what):
    table = json.loads(plan.read_text())
    CHANGES[what](table["legs"])
    (tmp_path / "plan.json").write_text(json.dumps(table))
    with pytest.raises(InputError, match=f"{what}.*so the file was changed"):
        load_path(tmp_path / "plan.json")


def test_a_heading_changed_by_hand_in_any_leg_is_found(plan, tmp_path):
    """By the plan's own currents; and without them, by what two legs meet where one ends and the next begins."""
    table = json.loads(plan.read_text())
    table["legs"][2]["heading_rad"] += 0.7
    (tmp_path / "plan.json").write_text(json.dumps(table))
    changed = load_path(tmp_path / "plan.json")
    with pytest.raises(InputError, match=r"leg 3 of the plan, flown in these currents, ends .* changed by hand"):
        planner.replan(changed, (-60.0, 60.0), 200.0)
    with pytest.raises(InputError, match="legs 2 and 3 of the plan meet currents"):
        check_smooth(changed)
    check_smooth(load_path(plan))


def test_a_current_of_a_dive_is_not_compared_with_a_part_of_the_plans(plan):
    path = load_path(plan)
    # the list ended below, so the vehicle came up by itself
    deep = replace(path, legs=path.legs[:1])
    with pytest.raises(InputError, match=r"is from 0 m to .* m, not from the surface to the surface"):
        planner.replan(deep, (-100.0, 100.0), 2.5 * path.legs[0].duration, dac=(0.1, 0.0))


def test_a_fix_in_seconds_since_1970_and_a_current_in_cm_per_second(plan, capsys):
    said = command(capsys, "replan", plan, "--fix=-60,60,1732111200")
    assert (said.code, "20,048 days after the plan's departure" in said.err) == (2, True)
    said = command(capsys, "replan", plan, "--fix=-60,60,300", "--dac", "8,-6")
    assert (said.code, "at most 5" in said.err) == (2, True)
    for wrong in ((math.nan, 0.0), (0.1,)):
        with pytest.raises(InputError, match="`dac` must be two numbers"):
            planner.replan(plan, (-60.0, 60.0), 300.0, dac=wrong)


def test_a_list_with_nothing_to_fly_is_not_good_to_its_end(plan):
    answer = planner.replan(plan, (-60.0, 60.0), 200.0)
    assert not answer.flown.path.legs
    assert not answer.good.whole
    assert "so it flies none of them; bring the new one now" in str(answer)


FIXES = "t_start,lon_start,lat_start,t_end,lon_end,lat_end"
DIVE = "2024-11-20T12:00,18.30,38.08,2024-11-20T13:30,18.316,{lat}"
WAY = {"heading": "130", "horizontal": "0.3"}
LINES = {
    "above 5": {"lat": "39.066"},
    "horizontal = -0.3 must be from 0 to 5 m/s": {"horizontal": "-0.3"},
    "horizontal = 30 must be": {"horizontal": "30"},
    "heading = 999 must be from -360 to 360 degrees": {"heading": "999"},
    "max_depth = -600 must be from 0": {"max_depth": "-600"},
}


@pytest.mark.parametrize("why", LINES)
def test_dives_that_no_vehicle_makes(tmp_path, why):
    change = dict(LINES[why])
    dive = DIVE.format(lat=change.pop("lat", "38.066"))
    more = WAY | change
    file = tmp_path / "dives.csv"
    file.write_text(f"{FIXES},{','.join(more)}\n{dive},{','.join(more.values())}\n")
    with pytest.raises(InputError, match=why):
        dive_currents(file)


def test_half_a_drift_and_an_output_over_its_input(tmp_path):
    file = tmp_path / "dives.csv"
    text = f"{FIXES},east,north,drift\n{DIVE.format(lat=38.066)},1000,-1100,0.1\n"
    file.write_text(text)
    with pytest.raises(InputError, match="`drift_east` needs a column `drift_north`"):
        dive_currents(file, {"drift_east": "drift"})
    with pytest.raises(InputError, match="which would be lost"):
        planner.currents(file, file)
    assert file.read_text() == text


DIVES = "start,end,lon_start,lat_start,lon_end,lat_end,max_depth,dac_east,dac_north"


def test_maps_do_not_replace_what_they_read(tmp_path):
    dives, link, forecast = tmp_path / "dives.csv", tmp_path / "link.nc", tmp_path / "a-members.nc"
    dives.write_text(f"{DIVES}\n2024-11-20T12:00,2024-11-20T15:00,18.3,38.1,18.34,38.07,900,0.1,0\n")
    forecast.write_text("not read")
    link.symlink_to(forecast)
    for output, members in ((dives, 0), (link, 0), (forecast, 0), (tmp_path / "a.nc", 2)):
        with pytest.raises(InputError, match="which would be lost"):
            planner.assimilate(forecast, output, dives=[dives], members=members)
    with pytest.raises(InputError, match="which would be lost"):
        planner.map_currents((18.0, 18.6), (37.9, 38.2), 5000, dives, dives=[dives])


def test_a_map_is_netcdf(tmp_path):
    with pytest.raises(InputError, match=r"better.csv must end in .nc"):
        planner.assimilate("a.nc", tmp_path / "better.csv", dives=["a.csv"])


def test_dives_too_fast_backward_or_of_one_place_and_two_currents(tmp_path):
    file = tmp_path / "dives.csv"
    line = "2024-11-20T{a},2024-11-20T{b},18.3,38.1,{lon},38.07,900,0.1,{north}"
    for values, why in (
        ({"a": "12:00", "b": "15:30", "lon": 19.34}, "7.2 m/s, faster than any glider"),
        ({"a": "15:30", "b": "12:00", "lon": 18.34}, "ends before"),
    ):
        file.write_text(f"{DIVES}\n{line.format(north=0, **values)}\n")
        with pytest.raises(InputError, match=why):
            read_dives(file)
    lines = [line.format(a="12:00", b="15:30", lon=18.34, north=north) for north in (0.1, -0.1, -0.1)]
    file.write_text("\n".join([DIVES, *lines]))
    assert read_dives(file).north.tolist() == [0.1, -0.1]


def test_currents_that_have_changed_do_not_matter_where_newer_ones_are_named(plan):
    turned = open_scenario(scenario_from_text(SCENARIO.replace("speed = 0.4", "speed = -0.4")))
    old = load_path(plan)
    with pytest.raises(InputError, match="the currents have changed since"):
        at_fix(turned.searches, old, 200.0, renewed=False)
    assert at_fix(turned.searches, old, 200.0, renewed=True)[1] == 200.0
