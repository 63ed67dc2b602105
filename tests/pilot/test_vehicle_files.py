"""Vehicles' files on their way out and back: lists that an earlier route left, options, lists scored."""

import math
from dataclasses import replace

import pytest
from helpers.routes import route
from helpers.small import SCENARIO, command, strict_json

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.pilot.export import export_path
from glider_stream.pilot.route_files import read_drawn
from glider_stream.pilot.slocum import goto_list
from glider_stream.pilot.waypoints import Waypoint
from glider_stream.roadmap.store import write_roadmap
from glider_stream.search.surfacing import Surfacing

CLEARANCE = "yo10.ma has d_target_altitude 5 m: the plan does not tell its clearance, put yours here"


def surfacings(count):
    """A route that comes up so many times."""
    return route(stops=[[600.0 * n, 0.0, -50.0 * (n % 2)] for n in range(2 * count + 1)])


def names(folder):
    return sorted(file.name for file in folder.iterdir())


# lists of an earlier route


def test_lists_of_an_earlier_longer_route_are_removed_and_that_is_said(tmp_path):
    export_path(surfacings(20), tmp_path / "goto_l10.ma")
    assert names(tmp_path) == ["goto_l10.ma", "goto_l11.ma", "goto_l12.ma", "yo10.ma"]
    said = []
    export_path(surfacings(3), tmp_path / "goto_l10.ma", said.append)
    assert names(tmp_path) == ["goto_l10.ma", "yo10.ma"]
    assert said == [
        CLEARANCE,
        *(
            f"removed {tmp_path / name}, which was left by an earlier, longer route"
            for name in ("goto_l11.ma", "goto_l12.ma")
        ),
    ]


def test_what_a_pilot_wrote_or_changed_stays(tmp_path):
    export_path(surfacings(20), tmp_path / "goto_l10.ma", most_waypoints=5)
    changed = tmp_path / "goto_l12.ma"
    changed.write_text(changed.read_text().replace("wpt_dist(m) 500", "wpt_dist(m) 700 # wide"))
    own = tmp_path / "goto_l14.ma"
    own.write_text(goto_list([Waypoint(1.0, 2.0)]).replace("# written by glider-stream", "# by"))
    said = []
    export_path(surfacings(3), tmp_path / "goto_l10.ma", said.append)
    assert names(tmp_path) == ["goto_l10.ma", "goto_l12.ma", "goto_l14.ma", "yo10.ma"]
    assert len(said) == 4
    assert f"{changed} belongs to an earlier route and was changed by hand, so it stays" in said[2]


def test_frozen_lists_of_an_earlier_route_are_removed_too(tmp_path):
    export_path(replace(surfacings(20), frozen=True), tmp_path / "goto_l10.ma")
    export_path(surfacings(3), tmp_path / "goto_l10.ma")
    assert names(tmp_path) == ["goto_l10.ma", "yo10.ma"]


def test_a_first_waypoint_within_the_radius_of_the_start_is_told(tmp_path):
    said = []
    export_path(surfacings(1), tmp_path / "targets", said.append, arrival_radius=1201.0)  # it lies 1200 m away
    assert len(said) == 1
    assert "1 of the 1 waypoints lies within the arrival radius of 1201 m" in said[0]


def test_lists_of_another_route_stay(tmp_path):
    export_path(surfacings(3), tmp_path / "goto_l11.ma")
    said = []
    export_path(surfacings(3), tmp_path / "goto_l10.ma", said.append)
    assert names(tmp_path) == ["goto_l10.ma", "goto_l11.ma", "yo10.ma", "yo11.ma"]
    assert said == [CLEARANCE]


# options


def test_waypoints_and_radius_are_options(tmp_path):
    export_path(surfacings(20), tmp_path / "goto_l05.ma", most_waypoints=7, arrival_radius=1500.0)
    lists = [tmp_path / f"goto_l{n:02}.ma" for n in (5, 6, 7)]
    for count, file in zip((7, 7, 6), lists, strict=True):
        assert f"num_waypoints(nodim) {count}\n" in file.read_text()
    assert all("list_when_wpt_dist(m) 1500\n" in file.read_text() for file in lists)
    export_path(surfacings(2), tmp_path / "targets", arrival_radius=350.0)
    assert "radius=350 " in (tmp_path / "targets").read_text()


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("goto_l10.ma", {"most_waypoints": 0}, "from 1 to 99 waypoints; got 0"),
        ("goto_l10.ma", {"arrival_radius": 5.0}, "at least 10 m; got 5"),
        ("goto_l10.ma", {"arrival_radius": math.nan}, "at least 10 m; got nan"),
        ("targets", {"arrival_radius": 0.0}, "above 0 m; got 0"),
        ("targets", {"arrival_radius": math.inf}, "above 0 m; got inf"),
    ],
)
def test_options_out_of_bounds(tmp_path, name, options, words):
    with pytest.raises(InputError, match=words):
        export_path(surfacings(2), tmp_path / name, **options)
    assert names(tmp_path) == []


# read and scored


@pytest.fixture(scope="module")
def geographic(tmp_path_factory):
    """A geographic roadmap on disk, and a path in it that surfaces on its way."""
    box, degrees = SCENARIO.index("[domain]"), "lon = [18.498, 18.502]\nlat = [37.998, 38.002]\n"
    text = (
        SCENARIO[:box] + f"[domain]\n{degrees}depth = [0.0, 150.0]\n\n" + SCENARIO[SCENARIO.index("[sampling]") :]
    )
    folder = tmp_path_factory.mktemp("geographic")
    (folder / "small.toml").write_text(text[: text.index("[query]")])
    road = planner.build(folder / "small.toml")
    write_roadmap(road, folder / "road.h5")
    path = planner.query(road, (18.4985, 38.0015, 0.0), (18.5015, 37.9985, 0.0), surfacing=Surfacing(most_yos=1))
    assert path.found
    return folder / "road.h5", path


START = "--start=18.4985,38.0015,0"


@pytest.mark.parametrize("name", ["goto_l10.ma", "targets"])
def test_a_list_of_ours_is_scored(geographic, tmp_path, capsys, name):
    road, path = geographic
    export_path(path, tmp_path / name)
    waypoints = read_drawn(tmp_path / name).places
    said = command(capsys, "score", road, tmp_path / name, START, "--json")
    table = strict_json(said.out)
    assert (said.code, table["flyable"]) == (0, True)
    assert len(table["legs"]) == len(waypoints)
    assert table["legs"][0]["from"] == pytest.approx(path.start.tolist(), abs=0.2)
    assert table["legs"][-1]["to"] == pytest.approx([*path.goal[:2], 0.0], abs=0.2)
    if len(waypoints) == 1:
        refused = command(capsys, "score", road, tmp_path / name)
        assert (refused.code, "holds one point; give the vehicle's position with --start" in refused.err) == (
            2,
            True,
        )
    else:
        told = command(capsys, "score", road, tmp_path / name)
        assert (
            "note: the way to its first point is not scored; give the vehicle's position with --start" in told.out
        )


def test_several_files_are_one_route(geographic, tmp_path, capsys):
    road, path = geographic
    export_path(path, tmp_path / "goto_l10.ma", most_waypoints=1)
    lists = sorted(tmp_path.glob("goto_l*.ma"))
    table = strict_json(command(capsys, "score", road, *lists, START, "--json").out)
    assert len(table["legs"]) == len(lists)


def rewritten(folder, old, new, count=3):
    text = goto_list([Waypoint(18.5, 38.0 + n / 100) for n in range(count)])
    assert old in text
    (folder / "goto_l10.ma").write_text(text.replace(old, new, 1))
    return folder / "goto_l10.ma"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("num_waypoints(nodim) 3", "num_waypoints(nodim) 2", "num_waypoints is not 3"),
        ("1830.0000\t3800.0000", "1830.0000\t9800.0000", "a latitude of 98; write the longitude first"),
        ("goto_list", "yo", "the behavior 'yo', but a route is a goto_list"),
        ("behavior_name=goto_list", "", "no behavior_name"),
    ],
)
def test_a_list_that_is_not_flown_as_it_stands_is_not_scored(tmp_path, old, new, words):
    with pytest.raises(InputError, match=words):
        read_drawn(rewritten(tmp_path, old, new))


def test_what_a_list_leaves_open_is_said(tmp_path):
    drawn = read_drawn(rewritten(tmp_path, "initial_wpt(enum) 0 ", "initial_wpt(enum) -2 "))
    assert "the closest to the vehicle" in drawn.notes[0]
    assert len(drawn.places) == 3
    assert len(read_drawn(rewritten(tmp_path, "initial_wpt(enum) 0 ", "initial_wpt(enum) 1 ")).places) == 2
    drawn = read_drawn(rewritten(tmp_path, "run(nodim) -2", "run(nodim) -1"))
    assert drawn.notes == ("the goto list is flown again and again; it is read once",)


def test_targets_are_followed_by_their_names(tmp_path):
    text = (
        "A lat=3800.0 lon=1830.0 radius=200 goto=C\nB lat=3801.0 lon=1830.0 radius=200 goto=B\n"
        "C lat=3802.0 lon=1830.0 radius=200 goto=A\n"
    )
    (tmp_path / "targets").write_text(text)
    drawn = read_drawn(tmp_path / "targets")
    assert [place[1] for place in drawn.places] == pytest.approx([38.0, 38 + 2 / 60])
    assert "no goto leads from A to B" in drawn.notes[1]
    assert "flown again and again, from A" in drawn.notes[2]
    (tmp_path / "targets").write_text(text.replace("goto=C", "goto=D"))
    with pytest.raises(InputError, match="that target does not exist; `glider-stream lint` shows all"):
        read_drawn(tmp_path / "targets")


# nothing to write


@pytest.mark.parametrize(
    "name", ["a.kml", "a.gpx", "a.geojson", "a.csv", "goto_l10.ma", "targets", "a.windows.csv"]
)
def test_start_that_is_the_goal_is_refused_before_anything_is_written(geographic, tmp_path, name):
    road, _ = geographic
    place = (18.5, 38.0, 0.0)
    with pytest.raises(InputError, match=f"its start is its goal; there is nothing to write into .*{name}"):
        planner.query(road, place, place, [tmp_path / "path.json", tmp_path / name])
    assert names(tmp_path) == []
    assert planner.query(road, place, place, [tmp_path / "path.json"]).found
    assert names(tmp_path) == ["path.json"]


def test_what_is_not_written_without_a_path_is_said(tmp_path):
    (tmp_path / "route.kml").write_text("old")
    said = []
    none = replace(surfacings(2), cost=math.inf, legs=())
    assert export_path(none, tmp_path / "route.kml", said.append) == []
    assert export_path(none, tmp_path / "route.gpx", said.append) == []
    assert "is not written, because no path was found; the file of that name is of an earlier query" in said[0]
    assert said[1].endswith("is not written, because no path was found")
