"""KML as its standard has it, GPX as other tools save it again: which points are the route, and how deep."""

from dataclasses import replace
from xml.etree import ElementTree

import gpxpy
import numpy as np
import pytest
from helpers.routes import FRAME, STOPS, route

from glider_stream.base.errors import InputError
from glider_stream.pilot.export import export_path
from glider_stream.pilot.route_files import read_drawn

LINE = "<LineString>{}<coordinates>18.4,38,{} 18.5,38.1,{}</coordinates></LineString>"


def kml(folder, body):
    (folder / "a.kml").write_text(
        f'<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">{body}</kml>'
    )
    return read_drawn(folder / "a.kml")


def mark(name, at, mode="absolute", data=""):
    point = f"<Point><altitudeMode>{mode}</altitudeMode><coordinates>{at}</coordinates></Point>"
    return f"<Placemark><name>{name}</name>{data}{point}</Placemark>"


@pytest.mark.parametrize("mode", ["", "<altitudeMode>clampToGround</altitudeMode>"])
def test_clamped_altitudes_are_ignored_and_that_is_said(tmp_path, mode):
    drawn = kml(tmp_path, f"<Placemark>{LINE.format(mode, 0, -200)}</Placemark>")
    assert drawn.places == ((18.4, 38.0, 0.0), (18.5, 38.1, 0.0))
    assert "altitude mode is clampToGround" in drawn.notes[0]
    assert kml(tmp_path, f"<Placemark>{LINE.format(mode, 0, 0)}</Placemark>").notes == ()


def test_absolute_altitudes_count(tmp_path):
    drawn = kml(
        tmp_path, f"<Placemark>{LINE.format('<altitudeMode>absolute</altitudeMode>', 0, -200)}</Placemark>"
    )
    assert drawn.places == ((18.4, 38.0, 0.0), (18.5, 38.1, 200.0))
    assert drawn.notes == ()


@pytest.mark.parametrize(
    ("mode", "height"),
    [
        ("<gx:altitudeMode>relativeToSeaFloor</gx:altitudeMode>", 0),
        ("<gx:altitudeMode>relativeToSeaFloor</gx:altitudeMode>", 50),
        ("<gx:altitudeMode>clampToSeaFloor</gx:altitudeMode>", 0),
        ("<altitudeMode>relativeToGround</altitudeMode>", 10),
        ("<altitudeMode>nonsense</altitudeMode>", 0),
    ],
)
def test_altitudes_above_the_seabed_are_refused(tmp_path, mode, height):
    with pytest.raises(InputError, match=r"count from the ground or the seabed .* save them as absolute"):
        kml(tmp_path, f"<Placemark>{LINE.format(mode, 0, height)}</Placemark>")


def test_on_the_sea_the_ground_is_the_surface(tmp_path):
    mode = "<altitudeMode>relativeToGround</altitudeMode>"
    drawn = kml(tmp_path, f"<Placemark>{LINE.format(mode, 0, 0)}</Placemark>")
    assert [place[2] for place in drawn.places] == [0.0, 0.0]


def test_a_track_is_a_line(tmp_path):
    track = (
        "<gx:Track><altitudeMode>absolute</altitudeMode><when>2024-11-20T12:00:00Z</when>"
        "<when>2024-11-20T13:00:00Z</when><gx:coord>18.4 38 0</gx:coord>"
        "<gx:coord>18.5 38.1 -200</gx:coord></gx:Track>"
    )
    places = ((18.4, 38.0, 0.0), (18.5, 38.1, 200.0))
    assert kml(tmp_path, f"<Placemark>{track}</Placemark>").places == places
    several = f"<gx:MultiTrack>{track}</gx:MultiTrack>"
    assert kml(tmp_path, f"<Placemark>{several}</Placemark>").places == places
    with pytest.raises(InputError, match="it holds 2 lines"):
        kml(tmp_path, f"<Placemark><gx:MultiTrack>{2 * track}</gx:MultiTrack></Placemark>")


def test_points_of_other_folders_are_not_part_of_the_route(tmp_path):
    route_points = mark("a", "18.4,38,0") + mark("b", "18.5,38.1,-200")
    ours = f"<Folder><name>route</name>{route_points}</Folder>"
    other = f"<Folder><name>wrecks</name>{mark('wreck', '18.45,38.05,0', 'relativeToSeaFloor')}</Folder>"
    with pytest.raises(InputError, match=r"points lie in 2 folders \('route', 'wrecks'\)"):
        kml(tmp_path, f"<Document>{ours}{other}</Document>")
    line = f"<Placemark>{LINE.format('<altitudeMode>absolute</altitudeMode>', 0, -200)}</Placemark>"
    drawn = kml(tmp_path, f"<Document><Folder>{line}</Folder>{other}</Document>")
    assert drawn.places == ((18.4, 38.0, 0.0), (18.5, 38.1, 200.0))
    assert kml(tmp_path, f"<Document>{ours}</Document>").places == drawn.places


def test_marks_that_were_added_to_our_file_are_not_stops(tmp_path):
    export_path(route(), tmp_path / "ours.kml")
    text = (tmp_path / "ours.kml").read_text()
    places = read_drawn(tmp_path / "ours.kml").places
    added = mark("lighthouse", "18.5,38,40")
    (tmp_path / "more.kml").write_text(text.replace("</Document>", f"{added}<Folder>{added}</Folder></Document>"))
    assert read_drawn(tmp_path / "more.kml").places == places
    # saved again under another name: its marks still lie on its line
    (tmp_path / "again.kml").write_text(text.replace("glider-stream route", "my places"))
    assert read_drawn(tmp_path / "again.kml").places == places
    assert len(places) == len(STOPS)


def test_data_of_a_placemark_say_its_depth(tmp_path):
    data = '<ExtendedData><Data name="depth"><value>200</value></Data></ExtendedData>'
    places = kml(tmp_path, mark("a", "18.4,38") + mark("b", "18.5,38.1", data=data)).places
    assert places[1][2] == 200.0
    with pytest.raises(InputError, match="its data 'depth' is '200 m', which is not a number"):
        kml(tmp_path, mark("a", "18.4,38") + mark("b", "18.5,38.1", data=data.replace("200", "200 m")))
    unknown = data.replace('"depth"', '"dive"')
    with pytest.raises(InputError, match="its data 'dive' holds numbers"):
        kml(tmp_path, mark("a", "18.4,38") + mark("b", "18.5,38.1", data=unknown))


# GPX


def in_frame(places):
    lon, lat, depth = np.array(places).T
    x, y = FRAME.to_local(lon, lat)
    return np.stack([x, y, -depth], axis=-1)


def bent():
    """The route with legs that bend, and miss their ends."""
    path = route()
    legs = []
    for leg in path.legs:
        rows, track = leg.trajectory.copy(), leg.track.copy()
        rows[-1, 3] -= 4.0
        track[2] += [0.001, -0.002]
        track[-1] += [3e-5, 2e-5]
        legs.append(replace(leg, trajectory=rows, track=track))
    return replace(path, legs=tuple(legs))


@pytest.mark.parametrize("kept", ["both", "routes", "tracks"])
@pytest.mark.parametrize("path", [route(), bent()], ids=["straight", "bent"])
def test_our_gpx_saved_again_keeps_every_stop(tmp_path, kept, path):
    file = tmp_path / "route.gpx"
    export_path(path, file)
    parsed = gpxpy.parse(file.read_text())
    parsed.creator = "another tool"
    if kept != "both":
        setattr(parsed, "tracks" if kept == "routes" else "routes", [])
    file.write_text(parsed.to_xml())
    places = read_drawn(file).places
    assert len(places) == len(STOPS)
    assert np.abs(in_frame(places) - np.array(STOPS)).max() < 0.5


def test_a_gpx_of_an_earlier_version_is_read_whole_or_refused(tmp_path):
    """Its route began where the first leg ends; its track alone held the start."""
    file = tmp_path / "route.gpx"
    export_path(route(), file)
    tree = ElementTree.parse(file)
    spaces = {"g": "http://www.topografix.com/GPX/1/1"}
    way = tree.find("g:rte", spaces)
    way.remove(way[0])
    for point in tree.iterfind(".//g:trkpt", spaces):
        for name in point.findall("g:name", spaces):
            point.remove(name)
    tree.write(file)
    assert np.abs(in_frame(read_drawn(file).places) - np.array(STOPS)).max() < 0.5
    tree.getroot().remove(tree.find("g:trk", spaces))
    tree.write(file)
    with pytest.raises(InputError, match="not the start of the route; export the route again"):
        read_drawn(file)


def test_depths_beside_the_elevation(tmp_path):
    point = '<rtept lon="18.5" lat="38.1"><ele>0</ele><extensions><{0}>200</{0}></extensions></rtept>'
    gpx = '<gpx><rte><rtept lon="18.4" lat="38"/>{}</rte></gpx>'
    (tmp_path / "a.gpx").write_text(gpx.format(point.format("depth")))
    assert read_drawn(tmp_path / "a.gpx").places[1][2] == 200.0
    (tmp_path / "a.gpx").write_text(gpx.format(point.format("speed")))
    assert read_drawn(tmp_path / "a.gpx").places[1][2] == 0.0
    (tmp_path / "a.gpx").write_text(gpx.format(point.format("divedepth")))
    with pytest.raises(InputError, match="point's element 'divedepth' holds numbers"):
        read_drawn(tmp_path / "a.gpx")
