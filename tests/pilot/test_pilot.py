"""What pilots ask of a route: windows, the card, fewer legs, a score; and its files in others' readers."""

import json
import math
from dataclasses import replace
from datetime import timedelta
from itertools import pairwise

import numpy as np
import pytest
from helpers.routes import DEPARTS, FRAME, STOPS, route
from helpers.small import command, roadmap, scenario_file, strict_json
from scipy.integrate import solve_ivp

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.kernels.edges import Edge, Status
from glider_stream.kernels.flow import velocity
from glider_stream.pilot.card import card
from glider_stream.pilot.export import export_path
from glider_stream.pilot.route_files import read_drawn
from glider_stream.pilot.score import REASONS
from glider_stream.pilot.windows import windows
from glider_stream.scenario import scenario_from_text
from glider_stream.search.query import Planner
from glider_stream.search.thin import thin
from glider_stream.water.frame import LocalFrame

gpxpy, kml, shapely = (pytest.importorskip(name) for name in ("gpxpy", "fastkml.kml", "shapely"))


@pytest.fixture(scope="module")
def search():
    return Planner(roadmap(), scenario_from_text(roadmap().provenance.scenario).problem())


# windows


@pytest.mark.parametrize("frame", [FRAME, LocalFrame(180.0, 5.0), LocalFrame(-179.999, -60.0)])
@pytest.mark.parametrize("hours", [0.1, 0.35, 12.0])
def test_the_vehicle_is_in_its_window(frame, hours):
    path = route(frame=frame)
    boxes = list(windows(path, hours))
    assert len(boxes) == math.ceil(3000 / (3600 * hours))
    assert boxes[0].start == 0.0
    assert boxes[-1].end == 3000.0
    assert all(a.end == b.start for a, b in pairwise(boxes))
    track = np.concatenate([leg.track for leg in path.legs])
    rows = path.trajectory
    for t in np.linspace(0, 3000, 301):
        lon, lat, z = (
            np.interp(t, rows[:, 0], v)
            for v in ((track[:, 0] - track[0, 0] + 180) % 360, track[:, 1], rows[:, 3])
        )
        lon += track[0, 0] - 180
        [box] = [box for box in boxes if box.start <= t <= box.end][:1]
        assert box.west - 1e-9 <= lon <= box.east + 1e-9
        assert box.south - 1e-9 <= lat <= box.north + 1e-9
        assert box.shallowest - 1e-6 <= -z <= box.deepest + 1e-6
    assert all(box.east - box.west < 0.1 for box in boxes)


def test_windows_as_geojson(tmp_path):
    export_path(route(), tmp_path / "route.windows.geojson")
    features = json.loads((tmp_path / "route.windows.geojson").read_text())["features"]
    area = shapely.geometry.shape(features[0]["geometry"])
    assert area.is_valid
    for leg in route().legs:
        assert all(area.buffer(1e-6).contains(shapely.Point(place)) for place in leg.track)
    assert features[0]["properties"]["from"] == DEPARTS.strftime("%Y-%m-%dT%H:%M:%SZ")
    with pytest.raises(InputError, match="more than 0 h; got 0"):
        list(windows(route(), 0.0))


# the card


def test_the_card_adds_up(search):
    path = search.query()
    said = card(path, search.problem)
    assert said.whole.duration == pytest.approx(path.travel_time)
    for leg, row in zip(path.legs, said.legs, strict=True):
        way = leg.trajectory[-1, 1:3] - leg.trajectory[0, 1:3]
        far = np.hypot(*way)
        glide = leg.speed * math.cos(leg.glide_angle)
        through = np.array([glide * math.cos(leg.heading), glide * math.sin(leg.heading)])
        # over ground is through water and the mean current, along the way and across it
        assert row.over_ground * leg.duration == pytest.approx(far)
        assert through @ way / far + row.along == pytest.approx(row.over_ground, abs=0.01)
        assert through @ [-way[1], way[0]] / far + row.across == pytest.approx(0, abs=0.01)
        speeds = [np.hypot(*velocity(search.problem.evaluator.flow, *at[1:], at[0])) for at in leg.trajectory]
        assert row.fastest == pytest.approx(max(speeds))
        assert not row.outrun
    gained = math.dist(path.start[:2], path.goal[:2])
    assert said.whole.toward_goal * path.travel_time / 86.4 == pytest.approx(gained, abs=15)
    assert "all" in str(said)


def test_where_the_water_outruns_the_vehicle(search):
    polar = search.problem.evaluator.polar._replace(best_horizontal=np.full(2, 0.05))
    problem = replace(search.problem, evaluator=replace(search.problem.evaluator, polar=polar))
    said = card(search.query(), problem)
    assert said.whole.outrun
    assert "it cannot hold station on legs" in str(said)


# thinning


def test_thinned_legs_are_flown_again(search):
    goal = np.array([150.0, 150.0, -140.0])
    path = search.query([-180.0, -150.0, -10.0], goal)
    assert len(path.legs) >= 2
    assert thin(path, 0.0, search.connect, search.fly).travel_time == path.travel_time
    fewer = thin(path, 1e4, search.connect, search.fly)
    assert fewer.found
    flow = search.problem.evaluator.flow
    for leg in fewer.legs:
        along, up = leg.speed * math.cos(leg.glide_angle), leg.speed * math.sin(leg.glide_angle)

        def motion(t, at, leg=leg, along=along, up=up):
            u, v = velocity(flow, *at, 0.0)
            return [u + along * math.cos(leg.heading), v + along * math.sin(leg.heading), up]

        there = solve_ivp(motion, (0, leg.duration), leg.start, method="DOP853", rtol=1e-8, atol=1e-6).y[:, -1]
        assert np.linalg.norm(there - leg.end) < 8.2  # the scenario's tolerance
    assert all(a.end.tolist() == b.start.tolist() for a, b in pairwise(fewer.legs))


def test_thinning_keeps_what_no_glide_joins():
    path = route()
    none = Edge(int(Status.NO_HIT), *[math.nan] * 6)
    flown = []
    thin(path, 1e9, lambda a, b, since: none, lambda hops: flown.extend(hops) or path)
    assert [hop[1].tolist() for hop in flown] == list(STOPS[1:])
    flown.clear()
    good = Edge(int(Status.CONNECTED), 10.0, 10.0, -0.4, 0.0, 0.4, 0.0)
    asked = []
    thin(path, 1e9, lambda a, b, since: asked.append((a, b)) or good, lambda hops: flown.extend(hops) or path)
    assert len(flown) == 1
    flown.clear()
    thin(path, 50.0, lambda a, b, since: good, lambda hops: flown.extend(hops) or path)
    assert len(flown) == 3  # the stops lie far from the lines
    with pytest.raises(InputError, match="0 m or more"):
        thin(path, -1.0, lambda a, b, since: good, lambda hops: path)


# scoring


def test_a_drawn_route(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    command(capsys, "build", "small.toml", "-o", "road.h5")
    path = planner.query("road.h5", outputs=["path.json"])
    said = strict_json(command(capsys, "score", "road.h5", "path.json", "--json").out)
    assert said["flyable"]
    assert len(said["legs"]) == len(path.legs)
    assert said["travel_time_s"] <= path.travel_time * 1.02
    first = ",".join(f"{value:.9g}" for value in path.legs[0].end)
    (tmp_path / "far.csv").write_text(f"x,y,z\n-190,190,0\n{first}\n190,-190,{path.legs[0].end[2] - 2}\n")
    failed = command(capsys, "score", "road.h5", "far.csv")
    assert failed.code == 1
    assert "leg 2 of 2 fails: " in failed.err
    (tmp_path / "flat.csv").write_text("x,y,z\n-190,190,0\n160,-160,0\n")
    flat = strict_json(command(capsys, "score", "road.h5", "flat.csv", "--json").out)
    assert flat["travel_time_s"] == pytest.approx(path.travel_time)
    assert flat["legs"][0]["glides"] == len(path.legs)
    (tmp_path / "out.csv").write_text("x,y,z\n-190,190,0\n99999,0,-75\n")
    outside = command(capsys, "score", "road.h5", "out.csv")
    assert (outside.code, "`point 2` = [99999, 0, -75] lies outside" in outside.err) == (2, True)
    assert set(REASONS) == set(Status) - {Status.CONNECTED}


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "a,b\n1,2\n3,4\n", "its columns are a, b"),
        ("a.csv", "lon,lat\n1,2\n", "from 2 to 10,000 points; got 1"),
        ("a.csv", "lon,lat\n1,2\n3,x\n", "point 2 of a.csv must be three finite numbers"),
        ("a.csv", "lon,lat\n1,2\n3,nan\n", "point 2 of a.csv must be three finite numbers"),
        ("a.geojson", '{"type": "Polygon", "coordinates": []}', "holds a Polygon"),
        ("a.geojson", "[" * 100_000, "cannot be read"),
        ("a.kml", "<kml>", "cannot be read"),
        ("a.gpx", '<!DOCTYPE x [<!ENTITY a "aaaa">]><gpx>&a;</gpx>', "declares a document type"),
        ("a.gpx", "<gpx/>", "no route point"),
        ("a.txt", "", "must end in one of"),
    ],
)
def test_files_without_a_route_are_refused(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=words):
        read_drawn(tmp_path / name)


# others' readers


@pytest.mark.parametrize("frame", [FRAME, LocalFrame(180.0, 5.0), LocalFrame(-0.005, 51.0)])
def test_exports_in_others_readers(tmp_path, frame):
    path = route(frame=frame)
    ends = [np.array(stop) for stop in STOPS[1:]]

    def check(places, stops):
        lon, lat, z = np.array(places, float).T
        assert (np.abs(lon) <= 180).all()
        x, y = frame.to_local(lon, lat)
        assert np.abs(np.stack([x, y, z], axis=-1) - np.array(stops)).max() < 1.0

    for form in (".geojson", ".kml", ".gpx"):
        export_path(path, tmp_path / f"route{form}")
    shapes = [
        shapely.geometry.shape(f["geometry"])
        for f in json.loads((tmp_path / "route.geojson").read_text())["features"]
    ]
    check([one.coords[0] for one in shapes if one.geom_type == "Point"], ends)
    check([shapes[0].coords[0], shapes[0].coords[-1]], [STOPS[0], STOPS[-1]])
    parsed = gpxpy.parse((tmp_path / "route.gpx").read_text())
    [own] = parsed.routes
    check([(one.longitude, one.latitude, one.elevation) for one in own.points], STOPS)
    assert [one.time for one in own.points] == [DEPARTS + timedelta(seconds=1000 * n) for n in range(4)]
    assert len(parsed.tracks[0].segments[0].points) == 13
    document = kml.KML.parse(tmp_path / "route.kml").features[0]
    marks = [mark for mark in document.features if mark.geometry.geom_type == "Point"]
    check([mark.geometry.coords[0] for mark in marks], ends)
    assert [mark.times.timestamp.dt for mark in marks] == [
        DEPARTS + timedelta(seconds=1000 * n) for n in (1, 2, 3)
    ]
