"""Numbers in drawn routes: known by name and unit, or refused by name; none is dropped."""

import json

import pytest

from glider_stream.base.errors import InputError
from glider_stream.pilot.route_files import read_drawn

DEEP = ((18.4, 38.0, 0.0), (18.5, 38.1, 200.0))


def read(folder, name, text):
    (folder / name).write_text(text, encoding="utf-8")
    return read_drawn(folder / name)


@pytest.mark.parametrize(
    ("header", "deep"),
    [
        ("lon,lat,Depth (m)", "200"),
        ("Longitude (deg),Latitude [degrees_north],depth [km]", "0.2"),
        ("LON,LAT,depth_m", "200"),
        ("lng,lat,depth (ft)", "656.16797900262"),
        ("lon,lat,altitude", "-200"),
        ("lon,lat,Elevation (m)", "-200"),
        ("long (°E),lat (°N),depth(metres)", "200"),
    ],
)
def test_names_and_units_are_understood(tmp_path, header, deep):
    drawn = read(tmp_path, "a.csv", f"{header}\n18.4,38,0\n18.5,38.1,{deep}\n")
    assert drawn.geographic
    assert drawn.places[1] == pytest.approx(DEEP[1], rel=1e-9)
    assert drawn.places[0] == DEEP[0]


@pytest.mark.parametrize(
    ("header", "deep", "z"),
    [
        ("x,y,z", "-20", -20.0),
        ("X (km),y,depth", "20", -20.0),
        ("x,y_m,altitude (m)", "-20", -20.0),
        ("x,y", "", 0.0),
    ],
)
def test_in_metres_heights_count_upward_and_depths_downward(tmp_path, header, deep, z):
    text = f"{header}\n0,0{',0' * bool(deep)}\n1,2{',' * bool(deep)}{deep}\n"
    drawn = read(tmp_path, "a.csv", text)
    assert not drawn.geographic
    assert drawn.places[1] == pytest.approx((1000.0 if "km" in header else 1.0, 2.0, z))


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("lon,lat,max_depth", "its column 'max_depth' holds numbers of unknown meaning"),
        ("lon,lat,target depth (m)", "'target depth .m.' holds numbers"),
        ("lon,lat,z", "column 'z' may count up or down"),
        ("lon,lat,pressure", "'pressure' holds numbers"),
        ("lon,lat,depth (dbar)", "the unit of its column 'depth .dbar.' is not known; give it in m, km"),
        ("lon (rad),lat,depth", "the unit of its column 'lon .rad.' is not known; give it in degrees"),
        ("lon,longitude,lat", "'lon' and 'longitude' mean the same"),
        ("depth,lat,lon,altitude", "'depth' and 'altitude' mean the same"),
        ("lon,lat,x,y", "columns for lon, lat and for x, y"),
    ],
)
def test_what_is_not_known_is_refused_by_name(tmp_path, header, words):
    row = ",".join(["1"] * len(header.split(",")))
    with pytest.raises(InputError, match=words) as refused:
        read(tmp_path, "a.csv", f"{header}\n{row}\n{row}\n")
    assert str(refused.value).startswith("a.csv cannot be read as a route: ")


def test_columns_that_give_no_position_are_ignored(tmp_path):
    text = "id,name,lon,lat,ETA,Speed (kn),remark\n1,a,18.4,38,0,0.5,\n2,b,18.5,38.1,3600,0.5,deep\n"
    assert read(tmp_path, "a.csv", text).places == ((18.4, 38.0, 0.0), (18.5, 38.1, 0.0))


def collection(*features):
    return json.dumps({
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "geometry": {"type": kind, "coordinates": at}, "properties": told}
            for kind, at, told in features
        ],
    })  # fmt: skip


@pytest.mark.parametrize(
    "told", [{"depth": 200}, {"Depth (m)": "200"}, {"altitude": -200, "id": 7}, {"depth": 0.2e3, "name": "3"}]
)
def test_properties_of_points_say_their_depth(tmp_path, told):
    text = collection(("Point", [18.4, 38], {"depth": 0}), ("Point", [18.5, 38.1, 0], told))
    assert read(tmp_path, "a.geojson", text).places == DEEP
    again = collection(("Point", [18.4, 38], {}), ("Point", [18.5, 38.1, -200], told))
    assert read(tmp_path, "a.geojson", again).places == DEEP


@pytest.mark.parametrize(
    ("features", "words"),
    [
        ([("Point", [1, 2], {"max_depth": 5}), ("Point", [1, 3], {})], "property 'max_depth' holds numbers"),
        ([("Point", [1, 2], {"z": 5}), ("Point", [1, 3], {})], "property 'z' may count up or down"),
        (
            [("Point", [1, 2, -7], {"depth": 5}), ("Point", [1, 3], {})],
            "altitude of -7 m and properties that say -5 m",
        ),
        ([("LineString", [[1, 2], [1, 3]], {"depth": 5})], "its line has a property 'depth', one for all"),
        ([("LineString", [[1, 2], [1, 3]], {"depth": [5, 6]})], "its line has a property 'depth'"),
        (
            [("Point", [1, 2], {"depth": "5 m"}), ("Point", [1, 3], {})],
            "property 'depth' is '5 m', which is not a number",
        ),
        ([("Point", [1, 2], {"dive": "5 m"}), ("Point", [1, 3], {})], "property 'dive' holds numbers"),
        ([("LineString", [[1, 2], [1, 3]], {"dive": 5})], "property 'dive' holds numbers"),
    ],
)
def test_properties_that_nobody_knows_are_refused(tmp_path, features, words):
    with pytest.raises(InputError, match=words):
        read(tmp_path, "a.geojson", collection(*features))
