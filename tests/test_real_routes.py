"""Routes of a hundred kilometres on real files, and their exports in others' readers."""

import csv
import json
import re
from itertools import pairwise

import numpy as np
import pytest
from helpers.files import IONIAN, WASHINGTON, real

from glider_stream import planner
from glider_stream.pilot.export import export_path
from glider_stream.pilot.slocum_files import goto_faults as lint
from glider_stream.pilot.waypoints import from_degrees_and_minutes, waypoints
from glider_stream.roadmap.verify import verify
from glider_stream.scenario import read_scenario
from glider_stream.search.path import SURFACE

pytestmark = pytest.mark.slow

gpxpy, kml, shapely, pyproj = (
    pytest.importorskip(name) for name in ("gpxpy", "fastkml.kml", "shapely", "pyproj")
)
GEOD = pyproj.Geod(ellps="WGS84")
FORMS = ("route.json", "route.geojson", "route.kml", "route.gpx", "route.csv", "targets", "goto_l20.ma")
# with the clock running the strong coastal current carries the glider south and back: it gets there after 86
# hours, by a search of two minutes (benchmarks/end_to_end.py)
ROUTES = {
    "ionian": [
        f"flow.file={IONIAN}", "domain.lon=[17.9,18.8]", "domain.lat=[37.3,38.3]",
        "sampling.kind=grid", "sampling.shape=[62,88,2]",
        "query.start=[18.0,38.2,0.0]", "query.goal=[18.7,37.42,0.0]",
    ],
    "washington": [
        f"flow.file={WASHINGTON}", "flow.epoch=2024-10-29T00:00:00", "domain.lon=[-125.9,-125.5]",
        "domain.lat=[46.8,47.9]",
        "sampling.kind=grid", "sampling.shape=[26,98,2]", "query.start=[-125.6,46.9,0.0]",
        "query.goal=[-125.6,47.85,0.0]", "query.frozen=true",
    ],
}  # fmt: skip


def near(lon, lat, places):
    """Metres from places (n, 2) to others."""
    places = np.array(places, float)
    return GEOD.inv(lon, lat, places[:, 0], places[:, 1])[2]


@real
@pytest.mark.parametrize("name", ["ionian", pytest.param("washington", marks=pytest.mark.wide)])
def test_a_hundred_kilometres_and_its_files(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    scenario = read_scenario("ionian", ROUTES[name])
    assert GEOD.inv(*scenario.query.start[:2], *scenario.query.goal[:2])[2] > 100_000
    road = planner.build(scenario, "road.h5")
    if name == "washington":
        assert (
            "has no depth: its current is taken as the surface's and held at all depths" in road.provenance.flow
        )
        assert "changes with time, and legs hold for departure at 0 s" in road.provenance.flow
    path = planner.query("road.h5")
    assert path.found
    assert len(path.legs) > 60
    depths = [leg.end[2] for leg in path.legs]
    assert depths[-1] >= -SURFACE
    assert min(depths) == pytest.approx(-600.0)
    # half-yos: dives and climbs in turn, all of it within the polar
    signs = [np.sign(leg.glide_angle) for leg in path.legs]
    assert all(a != b for a, b in pairwise(signs))
    assert verify("road.h5", lambda text: scenario.problem(), 20).holds
    for form in FORMS:
        export_path(path, form)
    lon, lat = np.array([leg.lonlat[1] for leg in path.legs]).T
    lon = (lon + 180) % 360 - 180
    shapes = json.loads((tmp_path / "route.geojson").read_text())["features"]
    points = [shapely.geometry.shape(one["geometry"]).coords[0] for one in shapes[1:]]
    assert near(lon, lat, [point[:2] for point in points]).max() < 1.0
    parsed = gpxpy.parse((tmp_path / "route.gpx").read_text())
    assert near(lon, lat, [(one.longitude, one.latitude) for one in parsed.routes[0].points[1:]]).max() < 1.0
    document = kml.KML.parse(tmp_path / "route.kml").features[0]
    marks = [mark.geometry.coords[0] for mark in document.features if mark.geometry.geom_type == "Point"]
    assert near(lon, lat, [mark[:2] for mark in marks]).max() < 1.0
    rows = list(csv.DictReader((tmp_path / "route.csv").read_text().splitlines()))
    assert near(lon, lat, [(row["lon"], row["lat"]) for row in rows]).max() < 1.0
    if name == "washington":
        assert rows[0]["eta"].startswith("2024-10-29T0")
    assert (tmp_path / "yo20.ma").is_file()
    stops = waypoints(path)
    goto = []
    for file in sorted(tmp_path.glob("goto_l*.ma")):
        text = file.read_text(encoding="ascii")
        assert lint(text) == []
        pairs = re.search(r"<start:waypoints>\n(.*?)<end:waypoints>", text, re.DOTALL).group(1).split()
        goto += [tuple(map(from_degrees_and_minutes, pairs[n : n + 2])) for n in range(0, len(pairs), 2)]
    assert near([at.lon for at in stops], [at.lat for at in stops], goto).max() < 1.0
    lines = (tmp_path / "targets").read_text().splitlines()
    named = [re.search(r"lat=(\S+) lon=(\S+)", line).groups() for line in lines if " goto=" in line]
    found = [(from_degrees_and_minutes(lon), from_degrees_and_minutes(lat)) for lat, lon in named]
    assert near([at.lon for at in stops], [at.lat for at in stops], found).max() < 1.0
