"""Route files, read back by others' readers: places, times, bearings; Slocum's and Seaglider's rules."""

import csv
import json
import math
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from helpers.routes import STOPS, assert_places, route

from glider_stream.base.errors import InputError
from glider_stream.pilot.export import ANYWHERE, EXPORTS, export_path
from glider_stream.pilot.seaglider import target_faults
from glider_stream.pilot.slocum import goto_list, mission_files
from glider_stream.pilot.slocum_files import goto_faults as lint
from glider_stream.pilot.slocum_files import read_mission_file, yo_faults
from glider_stream.pilot.waypoints import Waypoint, degrees_and_minutes, from_degrees_and_minutes, waypoints
from glider_stream.search.path import FROZEN, Origin
from glider_stream.water.frame import LocalFrame


def test_geojson(tmp_path):
    file = tmp_path / "route.geojson"
    export_path(route(), file)
    features = json.loads(file.read_text())["features"]
    assert [one["geometry"]["type"] for one in features] == ["LineString"] + 3 * ["Point"]
    line = features[0]["geometry"]["coordinates"]
    assert len(line) == 1 + 3 * 4
    assert_places(line[::4])
    assert_places([one["geometry"]["coordinates"] for one in features[1:]], STOPS[1:])
    assert features[2]["properties"]["eta"] == "2024-11-20T12:33:20Z"


def test_kml(tmp_path):
    file = tmp_path / "route.kml"
    export_path(route(), file)
    names = {"k": "http://www.opengis.net/kml/2.2"}
    root = ElementTree.parse(file).getroot()
    line = root.find(".//k:LineString/k:coordinates", names).text.split()
    assert_places([place.split(",") for place in line][::4])
    points = root.findall(".//k:Point/k:coordinates", names)
    assert_places([point.text.split(",") for point in points], STOPS[1:])
    assert root.find(".//k:TimeStamp/k:when", names).text == "2024-11-20T12:16:40Z"


def test_gpx(tmp_path):
    file = tmp_path / "route.gpx"
    export_path(route(), file)
    names = {"g": "http://www.topografix.com/GPX/1/1"}
    root = ElementTree.parse(file).getroot()

    def places(tag):
        return [
            (one.get("lon"), one.get("lat"), one.find("g:ele", names).text)
            for one in root.iterfind(f".//g:{tag}", names)
        ]

    assert_places(places("rtept"))
    assert_places(places("trkpt")[::4])


def test_csv_says_how_legs_are_flown(tmp_path):
    file = tmp_path / "route.csv"
    export_path(route(), file)
    rows = list(csv.DictReader(file.read_text().splitlines()))
    assert [row["depth_max"] for row in rows] == ["200.0", "200.0", "150.0"]
    along = 0.4 * math.cos(0.4)
    over_ground = math.hypot(900, 300) / 1000
    assert float(rows[0]["speed_over_ground"]) == pytest.approx(over_ground, abs=1e-4)
    current = math.hypot(float(rows[0]["current_u"]), float(rows[0]["current_v"]))
    assert current == pytest.approx(over_ground - along, abs=1e-3)
    assert float(rows[0]["heading"]) == pytest.approx(90 - math.degrees(math.atan2(300, 900)), abs=0.01)
    local = replace(route(), lonlat=None, legs=tuple(replace(leg, lonlat=None) for leg in route().legs))
    export_path(local, file)
    assert next(csv.DictReader(file.read_text().splitlines()))["x"] == "900.0"


def test_a_bearing_is_that_of_a_geodesic():
    from pyproj import Geod

    frame = LocalFrame(lon=10.0, lat=70.0)
    x, y = 150e3, 80e3
    lon, lat = frame.to_lonlat(np.array([x, x + 100]), np.array([y, y + 50]))
    true = Geod(ellps="WGS84").inv(lon[0], lat[0], lon[1], lat[1])[0] % 360
    leg = replace(route().legs[0], heading=math.atan2(50, 100), north=float(frame.convergence(lon[0], lat[0])))
    assert leg.compass == pytest.approx(true, abs=0.01)


@pytest.mark.parametrize(
    ("degrees", "packed"),
    [
        (-(74 + 11.587 / 60), "-7411.5870"),
        (39 + 27.437 / 60, "3927.4370"),
        (-0.5, "-30.0000"),
        (12.9999999999, "1300.0000"),
        (-179.9999999, "-18000.0000"),
        (0.0, "0.0000"),
        (-1e-9, "0.0000"),
        (5 + 59.99994 / 60, "559.9999"),
    ],
)
def test_degrees_and_minutes(degrees, packed):
    assert degrees_and_minutes(degrees) == packed
    assert from_degrees_and_minutes(packed) == pytest.approx(degrees, abs=1e-6)


@pytest.mark.parametrize("text", ["7460.0000", "-18100.0", "north", "", "74_11.5"])
def test_texts_that_are_not_degrees_and_minutes(text):
    with pytest.raises(ValueError, match=r".*"):
        from_degrees_and_minutes(text)


def test_waypoints_are_where_the_route_surfaces():
    places = waypoints(route())
    assert len(places) == 2
    assert_places([(at.lon, at.lat, 0.0) for at in places], [[*stop[:2], 0.0] for stop in STOPS[2:]])


def test_slocum_files_follow_the_rules(tmp_path):
    export_path(route(), tmp_path / "goto_l10.ma")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["goto_l10.ma", "yo10.ma"]
    text = (tmp_path / "goto_l10.ma").read_bytes()
    assert text.isascii()
    assert lint(text.decode()) == []
    rows = text.decode().split("<start:waypoints>\n")[1].split("\n<end")[0].split("\n")
    lon, lat = zip(*(map(from_degrees_and_minutes, row.split("\t")) for row in rows), strict=True)
    assert_places(list(zip(lon, lat, [0, 0], strict=True)), [[*stop[:2], 0.0] for stop in STOPS[2:]])
    yo = (tmp_path / "yo10.ma").read_text()
    assert "d_target_depth(m) 200\n" in yo
    assert "d_pitch_value(X) -0.4000\n" in yo


def with_clearance(clearance):
    """The route, planned with this clearance above the seabed [m]; None for a plan that does not tell it."""
    if clearance is None:
        return route()
    return replace(route(), origin=Origin(f"[terrain]\nclearance = {clearance}\n"))


@pytest.mark.parametrize(
    ("clearance", "height", "said"),
    [
        (50.0, 50.0, None),
        (7.25, 7.25, None),
        (2.0, 5.0, None),
        (100.0, 100.0, None),
        (150.0, 100.0, "clearance of 150 m"),
        (None, 5.0, "does not tell its clearance"),
    ],
)
def test_the_yo_turns_at_the_plans_clearance_or_says_that_it_does_not(tmp_path, clearance, height, said):
    notes = []
    export_path(with_clearance(clearance), tmp_path / "goto_l10.ma", notes.append, arrival_radius=100.0)
    text = (tmp_path / "yo10.ma").read_text()
    assert yo_faults(text) == []
    values = {one.name: float(one.value) for one in read_mission_file(text).arguments}
    assert values["d_target_altitude"] == height
    assert [note for note in notes if said is None or said not in note] == []
    assert len(notes) == (0 if said is None else 1)


def test_a_plan_whose_yos_are_not_alike_is_told(tmp_path):
    # the first yo turns at 200 m; then down to 200 m again, but up to 120 m only
    legs = list(route().legs)
    turn = next(n for n in range(len(legs) - 1) if legs[n].glide_angle > 0 and legs[n + 1].glide_angle < 0)
    end = np.array([*legs[turn].end[:2], -120.0])
    legs[turn : turn + 2] = replace(legs[turn], end=end), replace(legs[turn + 1], start=end)
    notes = []
    export_path(replace(with_clearance(50.0), legs=tuple(legs)), tmp_path / "goto_l10.ma", notes.append)
    told = "turns of the plan (1 of them) lie up to 117 m from those of yo10.ma"
    assert any(told in note for note in notes)


def test_targets_say_which_depths_they_cannot_hold(tmp_path):
    export_path(with_clearance(50.0), tmp_path / "targets")
    text = (tmp_path / "targets").read_text()
    assert target_faults(text) == []
    assert "dives to 200 m ($D_TGT) and keeps 50 m above the seabed" in text


@pytest.mark.parametrize("name", ["goto_l10.ma", "targets"])
def test_waypoints_within_the_radius_of_each_other_are_told(tmp_path, name):
    # the route surfaces at (1800, 700), and its goal lies 728 m from there
    for radius, count in ((727.0, 0), (729.0, 1)):
        notes = []
        export_path(with_clearance(50.0), tmp_path / name, notes.append, arrival_radius=radius)
        assert sum("within the arrival radius" in note for note in notes) == count


def test_many_waypoints_take_several_lists():
    stops = [[100.0 * n, 0.0, 0.0 if n % 2 == 0 else -50.0] for n in range(41)]
    files = mission_files(route(stops=stops), "goto_l05.ma")
    assert list(files) == ["goto_l05.ma", "goto_l06.ma", "goto_l07.ma", "yo05.ma"]
    assert [files[name].count("\t") - 6 for name in list(files)[:3]] == [8, 8, 4]
    assert all(lint(files[name]) == [] for name in list(files)[:3])


def test_across_the_date_line(tmp_path):
    frame = LocalFrame(lon=180.0, lat=-20.0)
    stops = [[-2000.0, 0.0, 0.0], [0.0, 0.0, -50.0], [2000.0, 0.0, 0.0]]
    text = mission_files(route(frame, stops), "goto_l10.ma")["goto_l10.ma"]
    row = text.split("<start:waypoints>\n")[1].split("\n")[0]
    lon = from_degrees_and_minutes(row.split("\t")[0])
    assert -180 <= lon < -179.97
    export_path(route(frame, stops), tmp_path / "route.geojson")
    line = json.loads((tmp_path / "route.geojson").read_text())["features"][0]["geometry"]["coordinates"]
    assert all(-180 <= place[0] < 180 for place in line)


GOOD = goto_list([Waypoint(-74.19, 39.45), Waypoint(-73.9, 39.3)])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("num_waypoints(nodim) 2", "num_waypoints(nodim) 3", "num_waypoints is 3"),
        ("-7411.4000\t3927.0000", "3927.0000\t-11411.4000", "latitude"),
        ("-7411.4000", "-74°11.4", "ASCII"),
        ("-7411.4000", "# -7411.4000", "num_waypoints is 2, but there are 1"),
        ("initial_wpt(enum) 0", "initial_wpt(enum) -7411.4", "initial_wpt"),
        ("num_legs_to_run(nodim) -2", "num_legs_to_run(nodim) 0", "num_legs_to_run"),
        ("-7411.4000", "-7461.4000", "61.4"),
        ("<end:waypoints>", "", "between"),
        ("behavior_name=goto_list", "behavior_name=yo", "first line"),
    ],
)
def test_the_linter_sees_faults(old, new, said):
    assert lint(GOOD) == []
    assert old in GOOD
    faults = lint(GOOD.replace(old, new))
    assert any(said in fault for fault in faults), faults


def test_seaglider_targets(tmp_path):
    export_path(route(), tmp_path / "targets")
    lines = (tmp_path / "targets").read_text().splitlines()
    assert lines[0].startswith("/")
    assert not any(line.endswith(" ") for line in lines)
    rows = {
        line.split()[0]: dict(part.split("=") for part in line.split()[1:])
        for line in lines
        if not line.startswith("/")
    }
    assert all(row["goto"] in rows for row in rows.values())
    assert rows["WP002"]["goto"] == "WP002"
    lon, lat = (from_degrees_and_minutes(rows["WP001"][name]) for name in ("lon", "lat"))
    assert_places([(lon, lat, 0.0)], [[*STOPS[2][:2], 0.0]])


@pytest.mark.parametrize("form", [form for form in EXPORTS if form not in ANYWHERE])
def test_what_needs_a_place_on_the_globe_says_so(tmp_path, form):
    name = "goto_l10.ma" if form == ".ma" else form if form == "targets" else f"route{form}"
    with pytest.raises(InputError, match="longitude and latitude"):
        export_path(replace(route(), lonlat=None), tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("form", EXPORTS)
def test_only_json_says_that_there_is_no_path(tmp_path, form):
    name = "goto_l10.ma" if form == ".ma" else form if form == "targets" else f"route{form}"
    none = replace(route(), cost=math.inf, legs=())
    assert len(export_path(none, tmp_path / name)) == (form == ".json")
    assert len(list(tmp_path.iterdir())) == (form == ".json")


def test_a_goto_list_has_its_vehicles_name(tmp_path):
    with pytest.raises(InputError, match=r"goto_lNN\.ma.*route\.ma"):
        export_path(route(), tmp_path / "route.ma")


def test_every_file_of_a_frozen_route_says_so(tmp_path):
    still = replace(route(), departure=0.0, frozen=True)
    forms = "a.json a.csv a.windows.csv a.geojson a.windows.geojson a.kml a.gpx targets"
    for form in forms.split():
        written = export_path(still, tmp_path / form)
        told = [file.read_text(encoding="utf-8") for file in written]
        if form == "a.json":
            assert json.loads(told[0])["frozen"] is True
        else:
            assert all(FROZEN in text for text in told), form
        if form.endswith("csv"):
            rows = list(csv.DictReader(told[0].splitlines()))
            assert {row["note"] for row in rows} == {FROZEN}
        export_path(replace(still, frozen=False), tmp_path / form)
        assert FROZEN not in (tmp_path / form).read_text(encoding="utf-8")
    for file in export_path(still, tmp_path / "goto_l20.ma"):
        assert FROZEN in file.read_text(encoding="ascii")
        if file.name.startswith("goto"):
            assert lint(file.read_text(encoding="ascii")) == []
