"""Charts and keep-out areas as real files have them: undeclared no-data, the date line, swapped coordinates."""

import json

import numpy as np
import pytest
from helpers.currents import current, dataset, written

from glider_stream.base.errors import InputError, InputWarning
from glider_stream.plot.seabed import sample_bottom
from glider_stream.scenario import read_scenario
from glider_stream.water.describe import LOOK, describe
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import read_currents
from glider_stream.water.ocean.bathymetry import read_bathymetry
from glider_stream.water.ocean.names import Names
from glider_stream.water.ocean.sentinel import undeclared
from glider_stream.water.terrain import TerrainSettings, raster_terrain, read_polygons

xr = pytest.importorskip("xarray")
shapely = pytest.importorskip("shapely")

LON, LAT = np.arange(17.5, 18.501, 0.02), np.arange(37.5, 38.501, 0.02)
DOMAIN = (17.8, 18.2), (37.8, 38.2)
FRAME = LocalFrame.over(*DOMAIN)
HOLE = np.abs(LAT[:, None] - 38.0) + np.abs(LON - 18.0) < 0.1
SLOPE = (
    -1500.0
    - 400.0 * (LAT[:, None] - 38.0)
    + 300.0 * np.sin(9 * LON)
    + 20 * np.cos(70 * LON) * np.cos(90 * LAT[:, None])
)


def chart(folder, values, name="elevation", axes=("lon", "lat"), lon=None, lat=None, file=None, **attrs):
    data = xr.Dataset(
        {name: ((axes[1], axes[0]), values, attrs)},
        {
            axes[0]: (axes[0], LON, {"units": "degrees_east"} if lon is None else lon),
            axes[1]: (axes[1], LAT, {"units": "degrees_north"} if lat is None else lat),
        },
        file,
    )
    return written(folder, data, "chart.nc")


@pytest.mark.parametrize("mark", [-9999.0, -10000.0, -999.0, 9999.0, 32767.0, -32768.0, 999.0, -12345.0, -8000.0])
@pytest.mark.parametrize("sea", ["sloping", "flat", "whole metres"])
def test_no_data_that_is_not_declared_is_land(tmp_path, mark, sea):
    ground = {"sloping": SLOPE, "flat": np.full(SLOPE.shape, -1500.0), "whole metres": np.round(SLOPE)}[sea]
    bottom = read_bathymetry(chart(tmp_path, np.where(HOLE, mark, ground), units="m"), FRAME, *DOMAIN)
    inside = np.isclose(bottom.grid.mesh()[1], 38.0) & np.isclose(bottom.grid.mesh()[0], 18.0)
    assert (bottom.height[inside] >= 0).all()
    assert (bottom.height < -900).sum() > 300
    if abs(mark) != 999.0 or mark < 0:
        assert f"{mark:g} (" in bottom.description.replace(",", "")


@pytest.mark.parametrize("mark", [9999.0, 999.0, 10000.0, -9999.0, 32767.0])
def test_no_data_among_depths_that_count_down(tmp_path, mark):
    path = chart(tmp_path, np.where(HOLE, mark, -SLOPE), "deptho", units="m")
    bottom = read_bathymetry(path, FRAME, *DOMAIN, positive="down")
    inside = np.isclose(bottom.grid.mesh()[1], 38.0) & np.isclose(bottom.grid.mesh()[0], 18.0)
    assert (bottom.height[inside] == 0).all()
    assert f"where {mark:g} (" in bottom.description


@pytest.mark.parametrize(
    "ground",
    [
        SLOPE,
        np.full(SLOPE.shape, -999.0),
        np.where(HOLE, -20.0, -1500.0),  # a bank, in a chart of steps
        np.where(HOLE, -1500.0, -100.0),  # a hole
        np.where(HOLE, -4500.0, -200.0),
        np.round(-1100.0 + 200 * (LON - 18.0) + 0 * LAT[:, None]),  # through -999 without a jump
        -9000.0 - 1500.0 * (LAT[:, None] - 37.5) + 0 * LON,  # a trench, through -9999 and -10000
    ],
)
def test_depths_are_not_taken_for_codes(ground):
    gone, found = undeclared(ground)
    assert not gone.any()
    assert found == []


def test_depths_and_heights_that_cannot_be_told_are_refused(tmp_path):
    land = np.where(HOLE, 50.0, SLOPE)
    for name, attrs in (("depth", {}), ("bathymetry", {"long_name": "elevation relative to sea level"})):
        path = chart(tmp_path, land, name, units="m", **attrs)
        with pytest.raises(InputError, match=r'may be a depth or a height.* set `positive`, "up" or "down"'):
            read_bathymetry(path, FRAME, *DOMAIN)
        bottom = read_bathymetry(path, FRAME, *DOMAIN, positive="up")
        assert bottom.height.min() < -1500


GMT = {
    "long names": {
        "lon": {"long_name": "Longitude", "units": "degrees"},
        "lat": {"long_name": "Latitude", "units": "degrees"},
    },
    "nothing but GMT's mark": {"lon": {}, "lat": {}, "file": {"node_offset": 1}},
}


@pytest.mark.parametrize("way", GMT)
def test_grids_of_gmt(tmp_path, way):
    bottom = read_bathymetry(chart(tmp_path, SLOPE, "z", ("x", "y"), units="m", **GMT[way]), FRAME, *DOMAIN)
    assert bottom.height == pytest.approx(SLOPE[np.ix_(*_cut(bottom))])


def _cut(bottom):
    return np.isin(np.round(LAT, 6), np.round(bottom.grid.lat, 6)), np.isin(
        np.round(LON, 6), np.round(bottom.grid.lon, 6)
    )


def test_a_chart_takes_names(tmp_path):
    path = chart(tmp_path, SLOPE, "z", ("x", "y"), {}, {}, units="m")
    with pytest.raises(InputError, match=r"set `lat` in `names`|name it in `names`|set `lon` in `names`"):
        read_bathymetry(path, FRAME, *DOMAIN)
    bottom = read_bathymetry(path, FRAME, *DOMAIN, names=Names(lon="x", lat="y"))
    assert bottom.height.min() < -1500
    with pytest.raises(InputError, match="holds no variable `nosuch`, which `lon` names"):
        read_bathymetry(path, FRAME, *DOMAIN, names=Names(lon="nosuch", lat="y"))
    with pytest.raises(InputError, match=r"`terrain.names` may hold .*; got mask"):
        read_bathymetry(path, FRAME, *DOMAIN, names=Names(mask="x"))


def ring(west, east, south, north):
    return [[west, south], [east, south], [east, north], [west, north], [west, south]]


def zones(folder, *rings, mark=""):
    shapes = [{"type": "Polygon", "coordinates": [one]} for one in rings]
    features = [{"type": "Feature", "properties": {}, "geometry": one} for one in shapes]
    path = folder / "zones.geojson"
    path.write_text(mark + json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    return str(path)


DATE_LINE = LocalFrame(180.0, -18.0)


@pytest.mark.parametrize(
    "rings",
    [
        [ring(179.9, -179.9, -18.1, -17.9)],
        [ring(-180.1, -179.9, -18.1, -17.9)],
        [ring(179.9, 180.1, -18.1, -17.9)],
        [ring(179.9, 180.0, -18.1, -17.9), ring(-180.0, -179.9, -18.1, -17.9)],
        [ring(179.9, -179.9, -18.1, -17.9)[::-1]],
    ],
)
def test_a_keep_out_across_the_date_line(tmp_path, rings):
    area = shapely.union_all(read_polygons(zones(tmp_path, *rings), DATE_LINE))
    for lon, closed in (
        (179.95, True),
        (-179.95, True),
        (179.8, False),
        (-179.8, False),
        (0.0, False),
        (178.0, False),
    ):
        x, y = (float(part) for part in DATE_LINE.to_local(lon if lon else 150.0, -18.0))
        assert shapely.contains_xy(area, x, y) == closed, lon


def test_a_keep_out_with_a_hole_and_one_around_a_pole(tmp_path):
    table = {
        "type": "Polygon",
        "coordinates": [ring(179.5, -179.5, -18.5, -17.5), ring(-179.9, -179.8, -18.1, -17.9)],
    }
    (tmp_path / "hole.geojson").write_text(json.dumps(table))
    area = shapely.union_all(read_polygons(tmp_path / "hole.geojson", DATE_LINE))
    for lon, closed in ((-179.85, False), (-179.7, True), (179.7, True)):
        assert shapely.contains_xy(area, *(float(part) for part in DATE_LINE.to_local(lon, -18.0))) == closed
    around = [[lon, 80.0] for lon in (0, 100, -160, -60, 0)]
    with pytest.raises(InputError, match="goes around a pole"):
        read_polygons(zones(tmp_path, around), LocalFrame(0.0, 75.0))
    circle = ring(-180.0, 180.0, -60.0, -50.0)  # a belt around the globe stays one
    area = shapely.union_all(read_polygons(zones(tmp_path, circle), LocalFrame(30.0, -55.0)))
    assert area.area > 1e12


BOX = np.array([-15e3, -15e3]), np.array([15e3, 15e3])


def test_keep_out_is_counted_in_the_domain(tmp_path):
    file = zones(tmp_path, ring(17.95, 18.05, 37.95, 38.05), ring(30.0, 31.0, 38.0, 39.0), mark="\ufeff")
    _, words = raster_terrain(TerrainSettings(keep_out=(file,)), FRAME, *BOX, [], BOX)
    assert "keep-out polygons of zones.geojson: 1 of 2 in the domain, 97.5 km2" in words
    swapped = zones(tmp_path, [[y, x] for x, y in ring(17.95, 18.05, 37.95, 38.05)])
    with pytest.warns(InputWarning, match="do not touch the domain: are longitude and latitude swapped"):
        _, words = raster_terrain(TerrainSettings(keep_out=(swapped,)), FRAME, *BOX, [], BOX)
    assert "warning: the keep-out polygons of zones.geojson do not touch the domain" in words
    with pytest.warns(InputWarning, match="do not touch the domain$"):
        raster_terrain(
            TerrainSettings(keep_out=(zones(tmp_path, ring(5.0, 6.0, 50.0, 51.0)),)), FRAME, *BOX, [], BOX
        )


SCENARIO = """\
[flow]
kind = "netcdf"
file = "currents.nc"

[terrain]
bathymetry = "chart.nc"
clearance = {clearance}
keep_out = ["zones.geojson"]

[glider]
preset = "slocum"

[domain]
lon = [17.85, 18.15]
lat = [37.85, 38.15]
depth = [0.0, 150.0]

[sampling]
kind = "grid"
shape = [3, 3, 2]

[neighbours]
kind = "nearest"
k = 4

[steering]
method = "flow-map"

[integration]
dt = 60.0
steps = 60
tolerance = 20.0

[cost]
kind = "time"
"""


@pytest.mark.slow
def test_a_figure_draws_the_ground_and_no_clearance(tmp_path):
    """The chart's own depth, whatever the clearance, the keep-out, and where the levels of the currents end."""
    lon, lat = np.arange(17.5, 18.51, 0.1), np.arange(37.5, 38.51, 0.1)
    written(tmp_path, dataset(lon=lon, lat=lat, depth=[0.0, 50.0, 100.0, 150.0]))
    zones(tmp_path, ring(18.0, 18.05, 38.0, 38.05))
    for depth, clearance in ((400.0, 0.0), (400.0, 100.0), (400.0, 390.0), (3000.0, 100.0)):
        chart(tmp_path, np.full((LAT.size, LON.size), -depth), units="m")
        (tmp_path / "sea.toml").write_text(SCENARIO.format(clearance=clearance))
        problem = read_scenario(tmp_path / "sea.toml").problem()
        terrain = problem.evaluator.terrain
        x, y = np.random.default_rng(1).uniform(-9e3, 9e3, (2, 50))
        assert sample_bottom(terrain, x, y) == pytest.approx(-depth, abs=0.02)
        assert terrain.bottom.min() == pytest.approx(max(-depth + clearance, -175.0), abs=0.02)
        assert (terrain.bottom == 0).sum() > 4


def test_the_end_of_the_levels_is_not_drawn_as_seabed(tmp_path):
    """Where nothing but the end of the levels closes the water, no ground is drawn."""
    lon, lat = np.arange(17.5, 18.51, 0.1), np.arange(37.5, 38.51, 0.1)
    written(tmp_path, dataset(lon=lon, lat=lat, depth=[0.0, 50.0, 100.0, 150.0]))
    text = SCENARIO.format(clearance=100.0).replace('bathymetry = "chart.nc"\n', "")
    (tmp_path / "sea.toml").write_text(text.replace('keep_out = ["zones.geojson"]\n', ""))
    terrain = read_scenario(tmp_path / "sea.toml").problem().evaluator.terrain
    assert np.isneginf(sample_bottom(terrain, [0.0], [0.0])).all()
    assert terrain.bottom.min() == pytest.approx(-175.0)


def test_describe_reads_no_more_of_a_large_file_than_it_needs(tmp_path, monkeypatch):
    monkeypatch.setattr("glider_stream.water.describe.LOOK", 2e4)
    lon, lat = np.arange(17.5, 20.01, 0.1), np.arange(37.5, 38.51, 0.1)
    path = written(tmp_path, dataset(lon=lon, lat=lat))
    assert read_currents(path).u.nbytes * 4 > 2e4
    found = describe(path, [(18.55, 38.05, 20.0, None), (40.0, 38.0, 5.0, None)])
    assert (found.points[0].u_east, found.points[0].v_north) == pytest.approx(
        current(18.55, 38.05, 20.0), abs=1e-3
    )
    assert found.points[1].u_east is None
    assert found.file.u.shape[-1] < lon.size / 2
    assert "only the parts around the given places were read" in found.file.notes[-1]
    monkeypatch.setattr("glider_stream.water.describe.LOOK", LOOK)
    assert describe(path, [(18.55, 38.05, 20.0, None)]).file.u.shape[-1] == lon.size
