"""The linter: faults as they stand in public mission files, ours without any, and the command."""

import math
from dataclasses import replace

import pytest
from helpers.routes import route
from helpers.small import command, strict_json

from glider_stream.base.errors import InputError
from glider_stream.pilot.lint import lint
from glider_stream.pilot.seaglider import targets
from glider_stream.pilot.slocum import goto_list, mission_files, yo
from glider_stream.pilot.slocum_files import goto_faults, yo_faults
from glider_stream.pilot.waypoints import Waypoint

DEEP = [[0.0, 0.0, -1.0], [600.0, 0.0, -199.97], [1200.0, 0.0, -40.0], [1800.0, 0.0, -180.0]]
YO = yo(route(stops=DEEP))
LIST = goto_list([Waypoint(-74.19, 39.45), Waypoint(-73.9, 39.3)])
TARGETS = targets(route(), "targets")["targets"]


# what we write


@pytest.mark.parametrize(
    "stops",
    [DEEP, [[0.0, 0.0, 0.0], [600.0, 0.0, -999.96], [900.0, 0.0, 0.0]], [[0, 0, -25.32], [600.0, 0.0, -90.0]]],
)
def test_ours_have_no_faults_and_never_dive_below_the_plan(stops):
    text = yo(route(stops=stops))
    assert yo_faults(text) == []
    values = dict(line.split("b_arg: ")[1].split()[:2] for line in text.splitlines() if "b_arg: " in line)
    deep, shallow = float(values["d_target_depth(m)"]), float(values["c_target_depth(m)"])
    heights = [stop[2] for stop in stops]
    assert -min(heights) - 0.1 < deep <= -min(heights)
    assert shallow == pytest.approx(max(3.0, -max(heights)), abs=0.1)
    assert 3 <= shallow < deep <= 1000
    for name in ("d_pitch_value(X)", "c_pitch_value(X)", "start_when(enum)", "end_action(enum)"):
        assert name in values
    assert float(values["d_pitch_value(X)"]) < 0 < float(values["c_pitch_value(X)"])


def test_the_least_depth_is_said_where_the_plan_goes_above_it():
    assert "c_target_depth(m) 3   # the plan has 1, 3 is the least" in YO
    assert "# the plan" not in yo(route(stops=[[0, 0, -25.0], [600.0, 0.0, -90.0]]))


@pytest.mark.parametrize(
    ("stops", "words"),
    [
        ([[0, 0, 0], [900.0, 0.0, -1200.0]], "dives to 1200 m, but a Slocum's yo ends at 1000 m"),
        ([[0, 0, 0], [900.0, 0.0, -2.5]], "stays between 0 and 2.5 m"),
    ],
)
def test_what_no_yo_can_fly_is_refused(stops, words):
    with pytest.raises(InputError, match=words):
        yo(route(stops=stops))


# faults that stand in public files


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("c_target_depth(m) 3 ", "c_target_depth(m) 0 ", "c_target_depth must be from 3 to 1000; got 0"),
        ("d_target_depth(m) 199.9", "d_target_depth(m) 2000", "d_target_depth must be from 3 to 1000; got 2000"),
        ("c_target_depth(m) 3 ", "c_target_depth(m) 250 ", "c_target_depth is 250; it must be less than"),
        (
            "d_pitch_value(X)",
            "d_pitch_value(rad)",
            r"d_pitch_value has the unit rad; write d_pitch_value(X)",
        ),
        ("d_pitch_value(X) -0.4000", "d_pitch_value(X) 0.4000", "d_pitch_value is 0.4; it must be below 0"),
        (
            "c_pitch_value(X) 0.4000",
            "c_pitch_value(X) 26",
            "c_pitch_value is 26, but its unit is radians: 26 degrees are 0.4538",
        ),
        ("c_pitch_value(X) 0.4000", "c_pitch_value(X) ??", "c_pitch_value must be one number; got '??'"),
        ("start_when(enum) 2", "start_when(enum) 13", "start_when must be one of 0, 1, 2, 4; got 13"),
        ("d_target_depth", "target_depth", "target_depth is not known as an argument of yo"),
        ("d_use_pitch(enum) 3", "d_use_pitch(enum) 2.5", "d_use_pitch must be one of"),
        ("to_do(nodim) -1", "to_do(nodim) 0", "num_half_cycles_to_do must not be 0"),
        ("c_use_pitch(enum) 3", "d_use_pitch(enum) 3", "d_use_pitch is given twice"),
        ("<end:b_arg>", "", "must stand between <start:b_arg> and <end:b_arg>"),
        ("# glide", "glide", "line 2 is neither an argument nor a waypoint"),
        ("glide angles", "glide angles of 26°", "line 2 has a character outside ASCII"),
        ("behavior_name=yo", "behavior_name=drift_at_depth", "the first line must be behavior_name=yo"),
    ],
)
def test_faults_of_yo_files(old, new, said):
    assert old in YO
    faults = yo_faults(YO.replace(old, new, 1))
    assert any(said in fault for fault in faults), faults


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("behavior_name=yo", "# a comment first\n\nbehavior_name=Yo "),
        ("d_pitch_value(X) -0.4000", "d_pitch_value(x) -.4"),
        ("\tb_arg: d_use_pitch", "    b_arg:  d_stop_when_hover_for(s) 60\n\tb_arg:\td_use_pitch"),
        (
            "d_use_pitch(enum) 3         # servo\n\tb_arg: d_pitch_value(X) -0.4000",
            "d_use_pitch(enum) 1\nb_arg: d_pitch_value(X) 0.2",
        ),
        ("c_target_depth(m) 3 ", "c_target_depth(m) 3.5 "),
    ],
)
def test_what_public_yo_files_may_say(old, new):
    assert old in YO
    assert yo_faults(YO.replace(old, new, 1)) == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("num_waypoints(nodim) 2", "num_waypoints(enum) 2", "num_waypoints has the unit enum"),
        ("\tb_arg: num_waypoints(nodim) 2\n", "", "num_waypoints is not given, but there are 2 rows"),
        (
            "wpt(enum) 0 ",
            "wpt(enum) -07300.0    3850.2 ",
            "initial_wpt must be one number; got '-07300.0    3850.2'",
        ),
        ("wpt(enum) 0 ", "wpt(enum) 2 ", "initial_wpt is 2, but the last of 2 waypoints has the number 1"),
        ("wpt(enum) 0 ", "wpt(enum) -2 ", "initial_wpt is -2, the closest: an ordered route begins at 0"),
        ("run(nodim) -2", "run(nodim) -3", "num_legs_to_run must be from -2; got -3"),
        ("dist(m) 500", "dist(m) 5", "list_when_wpt_dist must be from 10; got 5"),
        ("-7354.0000\t3918.0000", "7354.0000\t3918.0000", "km from the waypoint before it; check its signs"),
        ("list_stop_when", "stop_when", "stop_when is not known as an argument of goto_list"),
        ("<start:waypoints>", "<start:waypoints>\n7412", "the row '7412' is not a longitude and a latitude"),
    ],
)
def test_faults_of_goto_lists(old, new, said):
    assert goto_faults(LIST) == []
    assert old in LIST
    faults = goto_faults(LIST.replace(old, new, 1))
    assert any(said in fault for fault in faults), faults


def test_a_list_that_is_flown_for_ever_may_begin_with_the_closest():
    assert (
        goto_faults(LIST.replace("wpt(enum) 0 ", "wpt(enum) -2 ").replace("run(nodim) -2", "run(nodim) -1")) == []
    )


def test_how_many_waypoints_a_list_may_hold_is_the_installations(tmp_path, capsys):
    many = goto_list([Waypoint(-74 + n / 10, 39.0) for n in range(8)])
    assert goto_faults(many) == []
    assert goto_faults(many, 7) == ["8 waypoints are more than 7"]
    (tmp_path / "goto_l10.ma").write_text(many)
    assert command(capsys, "lint", tmp_path / "goto_l10.ma", "--waypoints", 7).code == 1


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("goto=WP002\n", "goto=WP003\n", "target WP001 in line 3 has goto=WP003, but that target does not exist"),
        ("radius=200 goto=WP002\nWP002", "radius=200 goto=WP002 \nWP002", "line 3 begins or ends with a blank"),
        ("radius=200", "radius=0", "has radius=0; it must be from 0.001"),
        (" radius=200", "", "target WP001 in line 3 has no radius"),
        ("radius=200", "radius=200 speed=3", "has the unknown key speed"),
        ("lat=3800", "lat=3870", "has lat=3870"),
        ("lat=3800", "lat=9800", "98.0063 degrees; at most 90"),
        ("WP002 lat", "WP001 lat", "target WP001 in line 4 is given twice"),
        ("WP001 lat", "WP-1 lat", "must have a name of letters and numbers"),
        ("/ a route", "/ a 26° route", "outside ASCII"),
        ("radius=200", "radius=200 escape=HOME", "has escape=HOME, but that target does not exist"),
        ("radius=200", "radius=200 finish=400", "has finish=400; it must be from -1 to 360"),
        ("radius=200", "radius 200", "must be a name and key=value"),
    ],
)
def test_faults_of_targets(tmp_path, old, new, said):
    file = tmp_path / "targets"
    file.write_text(TARGETS)
    assert lint(file).faults == ()
    assert old in TARGETS, TARGETS
    file.write_text(TARGETS.replace(old, new, 1), encoding="utf-8")
    assert any(said in fault for fault in lint(file).faults), lint(file).faults


def test_what_public_targets_may_say(tmp_path):
    text = "/ Puget Sound\nTARGET_A lat= 4807.0 lon=-12223.0 radius=200 goto=B2 timeout=2\n\n"
    (tmp_path / "targets").write_text(
        text + "B2 lon=-12224 lat=4808.0 goto=TARGET_A escape=B2 depth=-100 radius=2e2\n"
    )
    assert lint(tmp_path / "targets").faults == ()


# the command


def test_the_command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in {**mission_files(route(), "goto_l10.ma"), "targets": TARGETS}.items():
        (tmp_path / name).write_text(text)
    names = "goto_l10.ma", "yo10.ma", "targets"
    said = command(capsys, "lint", *names)
    assert (said.code, said.err) == (0, "")
    kinds = "goto_l10.ma: goto list", "yo10.ma: yo", "targets: targets"
    assert said.out.splitlines() == [f"{kind}, no faults" for kind in kinds]
    (tmp_path / "yo10.ma").write_text(YO.replace("d_pitch_value(X)", "d_pitch_value(rad)"))
    said = command(capsys, "lint", *names)
    assert said.code == 1
    assert "yo10.ma: d_pitch_value has the unit rad" in said.out
    table = strict_json(command(capsys, "lint", *names, "--json").out)
    assert [one["kind"] for one in table] == ["goto list", "yo", "targets"]
    assert [len(one["faults"]) for one in table] == [0, 1, 0]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot be read: no such file"),
        (
            b"behavior_name=surface\n<start:b_arg>\n<end:b_arg>\n",
            "holds the behavior 'surface'; give a goto list",
        ),
        (b"lon,lat\n1,2\n", "holds neither a behavior_name nor targets"),
        (b"\x89HDF\0\0", "is not a text"),
        (b"a" * 1_000_001, "holds more than 1,000,000 bytes"),
    ],
)
def test_a_file_that_cannot_be_linted_is_exit_code_2(tmp_path, capsys, content, words):
    file = tmp_path / "some.ma"
    if content is not None:
        file.write_bytes(content)
    said = command(capsys, "lint", file)
    assert (said.code, said.out) == (2, "")
    assert words in said.err


def test_the_median_trim_is_written():
    path = route(stops=DEEP)
    steep = replace(path, legs=tuple(replace(leg, glide_angle=1.5 * leg.glide_angle) for leg in path.legs))
    assert "d_pitch_value(X) -0.6000" in yo(steep)
    assert math.degrees(0.6) == pytest.approx(34.4, abs=0.03)
    assert "dives -34.4 to -34.4" in yo(steep)
