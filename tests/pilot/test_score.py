"""Drawn routes: as they are read, as they are flown, and why one cannot be."""

import contextlib
import json
from dataclasses import replace

import numpy as np
import pytest
from helpers.reference import flown
from helpers.routes import FRAME, STOPS, route
from helpers.small import SCENARIO, command, roadmap, strict_json
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from glider_stream import planner
from glider_stream.base.clock import span
from glider_stream.base.errors import InputError
from glider_stream.kernels.edges import Edge, Status
from glider_stream.pilot.export import export_path
from glider_stream.pilot.route_files import FORMS, MOST_TEXT, read_drawn
from glider_stream.pilot.score import REASONS, score
from glider_stream.roadmap.steering import SurfaceMethod
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import scenario_from_text
from glider_stream.search.query import Planner


@pytest.fixture(scope="module")
def search():
    return Planner(roadmap(), scenario_from_text(roadmap().provenance.scenario).problem())


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("score") / "road.h5"
    write_roadmap(roadmap(), path)
    return path


def text(place):
    return ",".join(map(str, place))


LINE = {"type": "LineString", "coordinates": [[18.4, 38.0], [18.5, 38.1, -200], [18.6, 38.0]]}
MARKS = [{"type": "Feature", "geometry": {"type": "Point", "coordinates": [18.4, n]}} for n in (37, 38)]
READ = ((18.4, 38.0, 0.0), (18.5, 38.1, 200.0), (18.6, 38.0, 0.0))
CORNERS = "18.4,38,0 18.5,38.1,-200\n 18.6,38"
ABSOLUTE = "<altitudeMode>absolute</altitudeMode>"
KML = '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{}</Document></kml>'
GPX = '<gpx xmlns="http://www.topografix.com/GPX/1/1">{}</gpx>'
PLACES = '<{0} lon="18.4" lat="38"/><{0} lon="18.5" lat="38.1"><ele>-200</ele></{0}><{0} lon="18.6" lat="38"/>'
OTHERS = {
    "line.geojson": json.dumps(LINE),
    "line.json": json.dumps({"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": LINE}]}),
    # marks beside a line are no part of it
    "marks.geojson": json.dumps(
        {"type": "FeatureCollection", "features": [*MARKS, {"type": "Feature", "geometry": LINE}]}
    ),
    "semicolons.csv": "\ufeffName;LON;Lat;Depth\r\na;18.4;38;0\r\nb;18.5;38.1;200\r\nc;18.6;38;0\r\n",
    "tabs.csv": "longitude\tlatitude\tdepth_m\n18.4\t38\t0\n18.5\t38.1\t200\n18.6\t38\t0\n",
    "line.kml": KML.format(
        f"<Placemark><LineString>{ABSOLUTE}<coordinates>{CORNERS}</coordinates></LineString></Placemark>"
        "<Placemark><Point><coordinates>1,2</coordinates></Point></Placemark>"
    ),
    "points.kml": KML.format(
        "".join(
            f"<Placemark><Point>{ABSOLUTE}<coordinates>{p}</coordinates></Point></Placemark>"
            for p in CORNERS.split()
        )
    ),
    "route.gpx": GPX.format(f"<rte>{PLACES.format('rtept')}</rte>" + '<wpt lon="1" lat="2"/>'),
    "track.gpx": GPX.format(f"<trk><trkseg>{PLACES.format('trkpt')}</trkseg></trk>"),
    "marks.gpx": GPX.format(PLACES.format("wpt")),
}


@pytest.mark.parametrize("name", OTHERS)
def test_what_maps_write(tmp_path, name):
    (tmp_path / name).write_text(OTHERS[name], encoding="utf-8")
    drawn = read_drawn(tmp_path / name)
    assert drawn.geographic
    assert drawn.places == READ


@pytest.mark.parametrize("form", [".geojson", ".kml", ".gpx"])
def test_our_own_exports_come_back_with_their_first_leg(tmp_path, form):
    export_path(route(), tmp_path / f"route{form}")
    lon, lat, depth = np.array(read_drawn(tmp_path / f"route{form}").places).T
    x, y = FRAME.to_local(lon, lat)
    assert np.abs(np.stack([x, y, -depth], axis=-1) - np.array(STOPS)).max() < 1.0


BROKEN = [
    ("a.json", '{"legs": []}', "it holds no leg"),
    ("a.json", '{"legs": [{"from": [1, 2], "to": [3, 4]}]}', "point 1 of a.json must be three finite numbers"),
    ("a.json", '{"legs": [{"from": null, "to": 3}]}', "point 1"),
    ("a.json", "[1, 2]", "is not built like a route file"),
    ("a.json", "7", "is not built like a route file"),
    ("a.geojson", '{"type": "LineString", "coordinates": [[1], [2]]}', "is not built like a route file"),
    ("a.geojson", '{"type": "LineString", "coordinates": [[1' + "0" * 400 + ", 2], [3, 4]]}", "point 1"),
    ("a.geojson", '{"type": "LineString", "coordinates": [[1, 2, 1' + "0" * 400 + "], [3, 4]]}", "is not built"),
    ("a.geojson", '{"type": "LineString", "coordinates": [[NaN, 2], [3, 4]]}', "three finite numbers; got .nan"),
    ("a.geojson", '{"type": "Feature", "geometry": null}', "from 2 to 10,000 points; got 0"),
    ("a.geojson", json.dumps({"type": "FeatureCollection", "features": 2 * [LINE]}), "holds 2 lines"),
    ("a.csv", "lon,lat\n" + "1" * 200_000 + ",2\n1,2\n", "field larger than field limit"),
    ("a.csv", "lon,lat,depth\n1,2,\n1,2,3\n", r"point 1 .* got \(1.0, 2.0, ''\)"),
    ("a.csv", "lon,lat\n1\n1,2\n", "point 1"),
    ("a.csv", "\x00", "columns are none"),
    (
        "a.csv",
        "name,lat,lon,eta,depth_min,depth_max\nWP001,1,2,3,0,50\nWP002,1,2,3,0,50\n",
        "the depths where legs end",
    ),
    ("a.csv", "lon,lat\n" + 10_001 * "1,2\n", "from 2 to 10,000 points; got 10001"),
    ("a.csv", "x" * (MOST_TEXT + 1), "more than the 20,000,000 bytes"),
    ("a.gpx", "<gpx><rte><rtept lat='1'/></rte></gpx>", "is not built like a route file"),
    ("a.gpx", "<gpx creator='glider-stream'/>", "no route point"),
    ("a.gpx", "<a>" * 100_000 + "</a>" * 100_000, "no route point"),
    ("a.kml", "<kml/>", "no line and no points"),
    ("a.kml", "<kml><Point><coordinates>1,2,</coordinates></Point></kml>", "could not convert"),
    ("a.kml", '<!DOCTYPE k SYSTEM "file:///etc/passwd"><kml/>', "declares a document type"),
    ("a.kml", '<!DOCTYPE k [<!ENTITY a "b">]><kml>&a;</kml>', "declares a document type"),
]


@pytest.mark.parametrize(("name", "content", "words"), BROKEN)
def test_a_file_that_is_not_a_route_gives_one_sentence(tmp_path, name, content, words):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=words) as refused:
        read_drawn(tmp_path / name)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 500


def test_a_route_that_is_not_a_text_or_not_a_file(tmp_path):
    (tmp_path / "a.gpx").write_bytes('<?xml version="1.0"?><!DOCTYPE g><gpx/>'.encode("utf-16"))
    with pytest.raises(InputError, match=r"cannot be read as a route: .*utf-8"):
        read_drawn(tmp_path / "a.gpx")
    with pytest.raises(InputError, match="does not exist"):
        read_drawn(tmp_path)


WHOLE = [*OTHERS.items(), ("a.json", '{"legs": [{"from": [1, 2, 3], "to": [3, 4, 5]}]}')]


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    which=st.sampled_from(WHOLE),
    cut=st.integers(0, 400),
    put=st.text(max_size=6) | st.sampled_from(["null", "[", "{}"]),
)
def test_damage_is_read_or_refused(tmp_path, which, cut, put):
    """No text makes the reader raise anything but the one sentence."""
    name, content = which
    at = cut % (len(content) + 1)
    damaged = content[:at] + put + content[at + len(put) :]
    (tmp_path / name).write_bytes(damaged.encode("utf-8", "surrogatepass"))
    with contextlib.suppress(InputError):
        assert len(read_drawn(tmp_path / name).places) >= 2
    assert set(FORMS) == {".csv", ".geojson", ".json", ".kml", ".gpx", ".ma", "targets"}


# flying them


def test_the_score_of_a_planned_route_is_its_time(file, search, tmp_path):
    path = search.query()
    stops = [path.start, *(leg.end for leg in path.legs)]
    (tmp_path / "a.csv").write_text("x,y,z\n" + "".join(f"{text(stop)}\n" for stop in stops))
    said = planner.score(file, tmp_path / "a.csv")
    assert said.flyable
    assert [leg.status for leg in said.legs] == 4 * [Status.CONNECTED]
    assert said.time == pytest.approx(path.travel_time, rel=1e-9)
    assert said.flown is not None
    for leg, stop in zip(said.flown.legs, stops[1:], strict=True):
        end = flown(search.problem.evaluator.flow, leg, [leg.duration])[-1]
        assert np.linalg.norm(end - stop) < 8.1
    assert str(said).count("compass") == 4
    assert str(said).startswith(f"the route takes {path.travel_time:,.0f} s")


def test_points_of_one_depth_are_joined_by_the_roadmap_and_said_to_be(file, search, tmp_path, capsys):
    (tmp_path / "flat.csv").write_text("x,y,z\n-190,190,0\n-100,100,-75\n0,0,-75\n")
    said = command(capsys, "score", file, tmp_path / "flat.csv")
    way = search.query((-100.0, 100.0, -75.0), (0.0, 0.0, -75.0))
    assert said.code == 0
    count = len(way.legs)
    words = f"leg 2: {span(way.travel_time)}, {count} glides of the roadmap: one glide changes depth"
    assert words in said.out
    assert said.out.count("compass") == 1 + count
    table = strict_json(command(capsys, "score", file, tmp_path / "flat.csv", "--json").out)
    assert [leg["status"] for leg in table["legs"]] == ["connected", "same_depth"]
    assert table["legs"][1]["from"] == [-100, 100, -75]


def test_the_first_leg_that_fails_is_named(file, tmp_path, capsys):
    places = ["-190,190,0", "-100,100,-75", "190,-190,-76", "0,0,-10"]
    (tmp_path / "a.csv").write_text("\n".join(["x,y,z", *places]))
    said = command(capsys, "score", file, tmp_path / "a.csv")
    assert (said.code, said.out) == (1, "")
    table = strict_json(command(capsys, "score", file, tmp_path / "a.csv", "--json").out)
    assert table["flyable"] is False
    assert table["travel_time_s"] is None
    assert len(table["legs"]) == 2
    status = Status[table["legs"][1]["status"].upper()]
    assert said.err.startswith(f"leg 2 of 3 fails: {REASONS[status]} (")
    assert table["legs"][1]["why"] == REASONS[status]
    # the glide before it is shown
    assert said.err.count("compass") == 1


@pytest.mark.parametrize("status", list(REASONS))
def test_every_status_has_its_sentence(status):
    none = Edge(int(status), *6 * [float("nan")])
    said = score([np.zeros(3), np.array([1.0, 2.0, -3.0])], lambda a, b, since: none, None, None)
    assert str(said).startswith(f"leg 1 of 1 fails: {REASONS[status]} ({status.name.lower().replace('_', ' ')})")
    assert said.flown is None


def test_a_glide_that_the_method_misses_is_found_by_the_flow_map(search):
    """One control cannot hit; a glide that DOP853 flies there shows that there is one."""
    evaluator = replace(search.problem.evaluator, steering=SurfaceMethod(1))
    poor = Planner(roadmap(), replace(search.problem, evaluator=evaluator))
    start, end = np.array([-100.0, 100.0, -10.0]), np.array([0.0, 0.0, -110.0])
    assert evaluator.connect_pair(start, end).status == Status.NO_HIT
    edge = poor.connect(start, end)
    assert edge.status == Status.CONNECTED
    [leg] = poor.fly([(start, end, edge)]).legs
    assert np.linalg.norm(flown(evaluator.flow, leg, [leg.duration])[-1] - end) < 0.1
    same = poor.connect(start, np.array([60.0, 60.0, -10.0]))
    assert same.status == Status.SAME_DEPTH


def test_degrees_and_metres_are_not_taken_for_each_other(file, tmp_path, capsys):
    (tmp_path / "a.csv").write_text("lon,lat,depth\n18,38,0\n18.1,38,100\n")
    said = command(capsys, "score", file, tmp_path / "a.csv")
    assert said.code == 2
    assert "is in longitude and latitude, and the roadmap is in metres; give x, y, z in a CSV file" in said.err


@pytest.mark.parametrize("form", [".geojson", ".kml", ".gpx", ".json"])
def test_a_planned_route_comes_back_from_the_globe_in_any_form(across, tmp_path, form):
    """Planned across the date line, exported, read and flown: the same legs, to the rounding of the file."""
    road, path = across
    export_path(path, tmp_path / f"route{form}")
    said = planner.score(road, tmp_path / f"route{form}")
    assert said.flyable
    assert [leg.end[2] for leg in said.legs] == pytest.approx([leg.end[2] for leg in path.legs], abs=0.01)
    for leg, planned in zip(said.legs, path.legs, strict=True):
        assert np.linalg.norm(leg.start - planned.start) < 0.05
        assert leg.time == pytest.approx(planned.duration, rel=0.02)


def test_metres_in_a_geographic_roadmap_are_those_of_its_frame(across, tmp_path):
    road, path = across
    stops = [path.start, *(leg.end for leg in path.legs)]
    (tmp_path / "a.csv").write_text("x,y,z\n" + "".join(f"{text(stop)}\n" for stop in stops))
    assert planner.score(road, tmp_path / "a.csv").time == pytest.approx(path.travel_time)


@pytest.fixture(scope="module")
def across(tmp_path_factory):
    """A roadmap across the date line, and a path in it."""
    box, degrees = SCENARIO.index("[domain]"), "lon = [179.998, -179.998]\nlat = [-10.002, -9.998]\n"
    changed = (
        SCENARIO[:box] + f"[domain]\n{degrees}depth = [0.0, 150.0]\n\n" + SCENARIO[SCENARIO.index("[sampling]") :]
    )
    changed = changed[: changed.index("[query]")]
    file = tmp_path_factory.mktemp("across") / "across.toml"
    file.write_text(changed)
    road = planner.build(file)
    path = planner.query(road, (179.9985, -9.9985, 0.0), (-179.9985, -10.0015, 0.0))
    assert len(path.legs) >= 2
    return road, path
