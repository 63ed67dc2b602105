"""Windows: against the vehicle's flight by another integrator, across the date line, as files."""

import csv
import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers.reference import flown
from helpers.routes import FRAME, STOPS, route
from helpers.small import command, roadmap, strict_json

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.pilot.export import export_path
from glider_stream.pilot.windows import windows
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import scenario_from_text
from glider_stream.search.query import Planner
from glider_stream.water.frame import LocalFrame

ACROSS = LocalFrame(lon=180.0, lat=-20.0)
SAGITTA = 0.3
"""How far [m] a leg bends away from the chord of a step, here."""


@pytest.fixture(scope="module")
def search():
    return Planner(roadmap(), scenario_from_text(roadmap().provenance.scenario).problem())


def test_each_box_is_what_the_vehicle_flies_through_and_no_more(search):
    path = search.query()
    moments = []
    for leg in path.legs:
        times = np.linspace(0.0, leg.duration, 400)
        moments.append(np.column_stack([leg.depart + times, flown(search.problem.evaluator.flow, leg, times)]))
    t, x, y, z = np.concatenate(moments).T
    boxes = list(windows(path, 0.03))
    assert len(boxes) == np.ceil(path.travel_time / 108)
    for box in boxes:
        inside = (t >= box.start) & (t <= box.end)
        for column, low, high in (
            (x, box.west, box.east),
            (y, box.south, box.north),
            (np.maximum(-z, 0), box.shallowest, box.deepest),
        ):
            # tight to what a vehicle goes between two of the moments that were looked at
            assert -SAGITTA <= column[inside].min() - low <= 0.6
            assert -SAGITTA <= high - column[inside].max() <= 0.6


@pytest.mark.parametrize("frame", [FRAME, ACROSS, LocalFrame(lon=-179.995, lat=40.0)])
def test_polygons_hold_the_track_on_either_side_of_the_date_line(tmp_path, frame):
    shapely = pytest.importorskip("shapely")
    path = route(frame=frame, stops=[[-3000.0, 0.0, 0.0], [-500.0, 300.0, -50.0], [3000.0, 900.0, 0.0]])
    export_path(path, tmp_path / "a.windows.geojson", window_hours=0.2)
    features = strict_json((tmp_path / "a.windows.geojson").read_text())["features"]
    areas = [shapely.geometry.shape(feature["geometry"]) for feature in features]
    assert all(area.is_valid and area.area > 0 for area in areas)
    assert all(-180 <= bound <= 180 for area in areas for bound in area.bounds[::2])
    # no box is wider than the route, some 6 km
    assert all(
        e - w < 0.1 for area in areas for w, _, e, _ in [part.bounds for part in getattr(area, "geoms", [area])]
    )
    assert any(area.geom_type == "MultiPolygon" for area in areas) == (frame is not FRAME)
    rows = path.trajectory
    for t, lon, lat in zip(rows[:, 0], *np.concatenate([leg.track for leg in path.legs]).T, strict=True):
        place = shapely.Point((lon + 180) % 360 - 180, lat)
        held = [area.covers(place) for area in areas]
        assert held[min(int(t // 720), len(areas) - 1)]


def test_a_vehicle_that_goes_straight_down_has_a_window_with_an_inside(tmp_path):
    shapely = pytest.importorskip("shapely")
    export_path(route(stops=[[0.0, 0.0, 0.0], [0.0, 0.0, -200.0]]), tmp_path / "a.windows.geojson")
    [feature] = json.loads((tmp_path / "a.windows.geojson").read_text())["features"]
    area = shapely.geometry.shape(feature["geometry"])
    assert area.is_valid
    assert 0 < area.area < 1e-9


def test_no_vehicle_leaves_the_water(search):
    path = search.query()
    legs = tuple(replace(leg, trajectory=leg.trajectory + np.array([0, 0, 0, 3.0])) for leg in path.legs)
    [box] = windows(replace(path, legs=legs))
    assert box.shallowest == 0
    assert box.deepest == pytest.approx(-path.trajectory[:, 3].min() - 3)


def test_windows_as_a_table(tmp_path):
    export_path(route(frame=ACROSS), tmp_path / "a.windows.csv", window_hours=0.5)
    rows = list(csv.DictReader((tmp_path / "a.windows.csv").read_text().splitlines()))
    assert [row["from"] for row in rows] == ["2024-11-20T12:00:00Z", "2024-11-20T12:30:00Z"]
    assert [row["to"] for row in rows] == ["2024-11-20T12:30:00Z", "2024-11-20T12:50:00Z"]
    lon, lat = ACROSS.to_lonlat(np.array([0.0, 1620.0]), np.array([0.0, 620.0]))
    assert float(rows[0]["east"]) == pytest.approx((lon[1] + 180) % 360 - 180, abs=3e-6)
    assert float(rows[0]["north"]) == pytest.approx(lat[1], abs=3e-6)
    assert [row["depth_max"] for row in rows] == ["200.0", "150.0"]
    export_path(route(frame=LocalFrame(lon=179.999, lat=0.0)), tmp_path / "b.windows.csv")
    [row] = csv.DictReader((tmp_path / "b.windows.csv").read_text().splitlines())
    assert float(row["west"]) > 179 > -179 > float(row["east"])


def test_windows_in_metres_from_the_command_line(tmp_path, capsys):
    write_roadmap(roadmap(), tmp_path / "road.h5")
    out = tmp_path / "a.windows.csv"
    said = command(capsys, "query", tmp_path / "road.h5", "-o", out, "--window-hours", "0.05")
    assert said.code == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    path = planner.query(roadmap())
    assert len(rows) == np.ceil(path.travel_time / 180)
    assert all(a["to"] == b["from"] for a, b in pairwise(rows))
    assert float(rows[0]["x_min"]) == pytest.approx(path.trajectory[:, 1].min(), abs=1e-6)
    refused = command(capsys, "query", tmp_path / "road.h5", "-o", tmp_path / "a.windows.geojson")
    assert (refused.code, "needs longitude and latitude" in refused.err) == (2, True)
    mixed = command(capsys, "query", tmp_path / "road.h5", "--trade-off", "--window-hours", "3")
    assert (mixed.code, "--window-hours" in mixed.err) == (2, True)


@pytest.mark.parametrize("hours", [0.0, -1.0, float("nan"), float("inf"), 1e-12])
def test_unusable_windows_are_refused(hours):
    with pytest.raises(InputError, match=r"got 0|got -1|got nan|got inf|1e-12 h are more than 100,000"):
        list(windows(route(stops=STOPS), hours))
