"""Seabed, land and keep-out: nothing is flown over that the files themselves, read at every 10 m, close."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from helpers.files import DATA, real
from helpers.small import command
from scipy.interpolate import RegularGridInterpolator

from glider_stream.base.errors import InputError
from glider_stream.kernels.edges import Edge, Status
from glider_stream.kernels.terrain import allowed
from glider_stream.plot.water import sample_water
from glider_stream.roadmap.builder import build_roadmap, node_positions
from glider_stream.scenario import read_scenario
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean.bathymetry import read_bathymetry
from glider_stream.water.terrain import TerrainSettings, raster_terrain, read_polygons

xr = pytest.importorskip("xarray")
shapely = pytest.importorskip("shapely")
pyproj = pytest.importorskip("pyproj")

GEBCO = DATA / "gebco2020_oresund_bathymetry.nc"
LON, LAT = np.arange(11.9, 13.11, 0.01), np.arange(55.4, 56.11, 0.008)
DOMAIN = (12.2, 12.8), (55.6, 55.9)
FRAME = LocalFrame.over(*DOMAIN)
BOX = np.array([-15e3, -12e3]), np.array([15e3, 12e3])


def height(lon, lat):
    """A bottom with an island, and shoals."""
    island = 60 * np.exp(-(((lon - 12.45) / 0.05) ** 2) - ((lat - 55.75) / 0.03) ** 2)
    return -45 + 15 * np.sin(40 * lon) * np.cos(55 * lat) + island


def chart(name="elevation", sign=1.0, **attrs):
    lon, lat = np.meshgrid(LON, LAT)
    return xr.Dataset(
        {name: (("lat", "lon"), sign * height(lon, lat), {"units": "m", **attrs})},
        {"lat": ("lat", LAT, {"units": "degrees_north"}), "lon": ("lon", LON, {"units": "degrees_east"})},
    )


def written(folder, data, name="chart.nc"):
    data.to_netcdf(folder / name, engine="h5netcdf")
    return folder / name


WAYS = {
    "GEBCO": chart,
    "ETOPO": lambda: chart("z"),
    "a depth": lambda: chart("deptho", -1.0, standard_name="sea_floor_depth_below_geoid"),
    "in km": lambda: chart("topo", 0.001, units="km"),
    "positive said": lambda: chart("bottom", -1.0, positive="down", standard_name="sea_floor_depth"),
    "from the north": lambda: chart().isel(lat=slice(None, None, -1)),
    "lon, lat": lambda: chart().transpose("lon", "lat"),
    "longitudes far east": lambda: chart().assign_coords(lon=("lon", LON + 360, {"units": "degrees_east"})),
    "whole metres": lambda: chart().round().astype("int16"),
    "one time": lambda: chart().expand_dims("time"),
}


@pytest.mark.parametrize("way", WAYS)
def test_charts_in_many_ways(tmp_path, way):
    bottom = read_bathymetry(written(tmp_path, WAYS[way]()), FRAME, *DOMAIN)
    lon, lat = bottom.grid.mesh()
    assert bottom.height == pytest.approx(height(lon % 360, lat), abs=0.51 if way == "whole metres" else 1e-3)
    assert lon.min() % 360 < 12.2
    assert lon.max() % 360 > 12.8


@pytest.mark.parametrize(
    ("make", "names", "words"),
    [
        (lambda: chart("bottom"), {}, "no bathymetry with a known name; set `variable` to one of: bottom"),
        (lambda: chart("bottom"), {"variable": "bottom"}, "up or down: set `positive`"),
        (lambda: chart("elevation", -1.0) * 0 + 5, {}, "is never below 0, so there is no sea"),
        (lambda: chart("deptho", 1.0) * 0 - 5, {}, "is a depth, but it is never above 0"),
        (lambda: xr.merge([chart("z"), chart("topo")]), {}, "2 bathymetries, z, topo"),
        (lambda: chart(units="fathoms"), {}, "fathoms"),
        (lambda: chart().isel(lon=slice(0, 50)), {}, "lies partly outside chart.nc"),
        (lambda: chart().isel(lon=0), {}, "no bathymetry"),
        (chart, {"variable": "x"}, "holds no variable `x`"),
        (chart, {"positive": "left"}, '"up" or "down"'),
    ],
)
def test_charts_that_are_refused(tmp_path, make, names, words):
    with pytest.raises(InputError, match=words):
        read_bathymetry(written(tmp_path, make()), FRAME, *DOMAIN, **names)


def square(lon, lat, half=0.03):
    ring = [
        [lon - half, lat - half],
        [lon + half, lat - half],
        [lon + half, lat + half],
        [lon - half, lat + half],
    ]
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}


def zones(folder, *geometries, name="zones.geojson"):
    features = [{"type": "Feature", "properties": {}, "geometry": one} for one in geometries]
    (folder / name).write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return str(folder / name)


def places(count, seed=0):
    rng = np.random.default_rng(seed)
    x, y = (rng.uniform(BOX[0][n], BOX[1][n], count) for n in range(2))
    return x, y, -rng.uniform(0, 70, count), *FRAME.to_lonlat(x, y)


def test_what_is_open_is_open_by_the_files_themselves(tmp_path):
    path, area = written(tmp_path, chart()), shapely.geometry.shape(square(12.6, 55.8))
    keep_out = (zones(tmp_path, square(12.6, 55.8)),)
    asked = TerrainSettings(str(path), clearance=6.0, max_depth=48.0, land_distance=900.0, keep_out=keep_out)
    seabed, words = raster_terrain(asked, FRAME, *BOX, [read_bathymetry(path, FRAME, *DOMAIN, 2e4)])
    assert "clearance 6 m" in words
    x, y, z, lon, lat = places(40_000)
    open_here = sample_water(seabed, x, y, z)
    data = chart().elevation
    between = RegularGridInterpolator((LAT, LON), data.values)(np.stack([lat, lon], axis=-1))
    nearest = data.sel(lat=xr.DataArray(lat), lon=xr.DataArray(lon), method="nearest").values
    inside = shapely.contains_xy(area, lon, lat)
    land_lon, land_lat = (part[data.values >= 0] for part in np.meshgrid(LON, LAT))
    to_land = np.min(
        [
            pyproj.Geod(ellps="WGS84").inv(lon, lat, 0 * lon + a, 0 * lat + b)[2]
            for a, b in zip(land_lon, land_lat, strict=True)
        ],
        axis=0,
    )
    for bottom in (between, nearest):
        assert (z[open_here] >= bottom[open_here] + 6.0).all()
    assert (z[open_here] >= -48.0).all()
    assert not inside[open_here].any()
    assert (to_land[open_here] > 900.0).all()
    # and not much more is closed than must be
    must = (z >= between + 8) & (z >= -48) & (to_land > 2200)
    must &= ~shapely.contains_xy(area.buffer(0.01), lon, lat)
    assert open_here[must].mean() > 0.8
    assert 0.1 < open_here.mean() < 0.9


def test_polygons_across_the_date_line_and_holes(tmp_path):
    frame = LocalFrame(180.0, 0.0)
    hole = square(179.9, 0.0, 0.2)
    hole["coordinates"].append(square(179.9, 0.0, 0.05)["coordinates"][0][::-1])
    east, west = square(180.5, 0.0, 0.1), square(-179.5, 0.5, 0.1)
    found = shapely.union_all(read_polygons(zones(tmp_path, hole, east, west), frame))
    for lon, lat, closed in (
        (179.75, 0.0, True),
        (-179.95, 0.0, True),
        (179.9, 0.0, False),
        (-179.5, 0.0, True),
        (180.5, 0.5, True),
        (179.5, 0.0, False),
        (-179.5, 0.3, False),
    ):
        x, y = frame.to_local(lon, lat)
        assert shapely.contains_xy(found, float(x), float(y)) == closed, (lon, lat)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "is not a GeoJSON"),
        ("[1]", "is not a GeoJSON"),
        ('{"type": "Polygon"}', "is not a GeoJSON"),
        ('{"type": "FeatureCollection", "features": []}', "holds no polygon"),
        ('{"type": "Point", "coordinates": [1, 2]}', "holds a Point"),
        ('{"type": "Polygon", "coordinates": [[[1000, 2], [1001, 2], [1001, 3], [1000, 2]]]}', "not in degrees"),
        ('{"type": "Polygon", "coordinates": []}', "empty"),
        ("[" * 100_000, "is not a GeoJSON"),
    ],
)
def test_files_without_polygons_are_refused(tmp_path, text, words):
    (tmp_path / "bad.geojson").write_text(text)
    with pytest.raises(InputError, match=words) as refusal:
        read_polygons(tmp_path / "bad.geojson", FRAME)
    assert "bad.geojson" in str(refusal.value)


CURRENT = {"uo": 0.15, "vo": -0.1}
EVEN = """\
kind = "uniform"
u = 0.15
v = -0.1
"""
SCENARIO = f"""\
[flow]
{EVEN}
[terrain]
bathymetry = "chart.nc"
clearance = 3.0
keep_out = ["zones.geojson"]

[glider]
preset = "paper"

[domain]
lon = [12.49, 12.53]
lat = [55.76, 55.79]
depth = [0.0, 40.0]

[sampling]
kind = "halton"
count = 1500
seed = 3

[neighbours]
kind = "nearest"
k = 60

[steering]
method = "flow-map"

[integration]
dt = 10.0
steps = 60
tolerance = 5.0

[cost]
kind = "time"
"""


def in_a_file(folder):
    """The scenario with its even current in a file: the kernels of files are compiled for other tests, too."""
    everywhere = ("depth", "lat", "lon"), np.ones((2, LAT.size, LON.size))
    even = {name: (everywhere[0], speed * everywhere[1], {"units": "m/s"}) for name, speed in CURRENT.items()}
    depth = {"depth": ("depth", [0.0, 60.0], {"units": "m", "positive": "down"})}
    written(folder, chart().assign(even).assign_coords(depth).drop_vars("elevation"), "even.nc")
    (folder / "sound.toml").write_text(SCENARIO.replace(EVEN, 'kind = "netcdf"\nfile = "even.nc"\n'))


def ways_of_all_legs(problem, road, spacing=10.0):
    """All stored legs' places, at most `spacing` metres apart: (n, 3) [m]."""
    source = np.repeat(np.arange(len(road.position)), np.diff(road.indptr))
    rows = []
    for n in range(road.target.size):
        edge = Edge(
            0, road.time[n], road.cost[n], road.glide_angle[n], road.heading[n], road.speed[n], road.miss[n]
        )
        track = problem.evaluator.trace(road.position[source[n]], edge, problem.departure)[:, 1:]
        gaps = np.ceil(np.linalg.norm(np.diff(track, axis=0), axis=1) / spacing).astype(int)
        at = np.concatenate([k + np.arange(max(c, 1)) / max(c, 1) for k, c in enumerate(gaps)])
        below = at.astype(int)
        share = (at - below)[:, None]
        rows.append(track[below] * (1 - share) + track[below + 1] * share)
    return np.concatenate(rows)


@pytest.mark.slow
def test_no_leg_touches_what_the_files_close(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, chart())
    zone = square(12.515, 55.775, 0.003)
    zones(tmp_path, zone)
    in_a_file(tmp_path)
    problem = read_scenario("sound.toml").problem()
    road = build_roadmap(problem)
    assert road.target.size > 2000
    assert road.counts[Status.BLOCKED.name.lower()] > 20
    at = ways_of_all_legs(problem, road)
    lon, lat = problem.to_lonlat(at).T
    data = chart().elevation
    nearest = data.sel(lat=xr.DataArray(lat), lon=xr.DataArray(lon), method="nearest").values
    between = RegularGridInterpolator((LAT, LON), data.values, bounds_error=False)(np.stack([lat, lon], axis=-1))
    for bottom in (nearest, between):
        assert (bottom < 0).all()
        assert (at[:, 2] >= bottom + 3.0).all()
    assert not shapely.contains_xy(shapely.geometry.shape(zone), lon, lat).any()
    # the same legs without terrain would have touched
    free = build_roadmap(read_scenario("sound.toml", ["terrain.clearance=0.0", "terrain.keep_out=[]"]).problem())
    assert free.target.size > road.target.size


def test_a_scenario_speaks_of_its_terrain(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, chart())
    zones(tmp_path, square(12.55, 55.8))
    in_a_file(tmp_path)
    small = ("--set", "sampling.count=40", "--set", "neighbours.k=5")
    said = command(capsys, "build", "sound.toml", "-o", "road.h5", *small)
    assert said.code == 0
    for words in ("elevation of chart.nc, positive up", "keep-out polygons of zones.geojson", "clearance 3 m"):
        assert words in said.out
    for sets, words in {
        "terrain.clearance=-1.0": "`terrain.clearance` must be at least 0 m; got -1",
        "terrain.max_depth=0.0": "`terrain.max_depth`",
        "terrain.depth=3.0": "terrain.depth",
        "terrain.bathymetry=none.nc": "none.nc does not exist",
        "terrain.keep_out=none.geojson": "none.geojson does not exist",
    }.items():
        refused = command(capsys, "build", "sound.toml", "-o", "no.h5", *small, "--set", sets)
        assert (refused.code, words in refused.err) == (2, True), refused.err
    flat = SCENARIO.replace(
        "lon = [12.49, 12.53]\nlat = [55.76, 55.79]\ndepth", "x = [0.0, 900.0]\ny = [0.0, 900.0]\nz"
    )
    flat = flat.replace("z = [0.0, 40.0]", "z = [-40.0, 0.0]")
    Path("flat.toml").write_text(flat)
    refused = command(capsys, "build", "flat.toml", "-o", "no.h5", *small)
    assert (refused.code, "[terrain] needs a domain in `lon`, `lat`" in refused.err) == (2, True)
    start, end = flat.index("bathymetry"), flat.index("[glider]")
    Path("flat.toml").write_text(flat[:start] + "max_depth = 20.0\n\n" + flat[end:])
    assert node_positions(read_scenario("flat.toml").problem())[:, 2].min() > -20.0


@real
def test_the_real_chart_of_a_sound():
    bottom = read_bathymetry(GEBCO, FRAME, (12.21, 12.8), (55.6, 55.9))
    raw = xr.open_dataset(GEBCO).elevation
    lon, lat = bottom.grid.mesh()
    assert (bottom.height == raw.sel(lat=lat[:, 0], lon=lon[0], method="nearest").values).all()
    seabed, _ = raster_terrain(TerrainSettings(str(GEBCO)), FRAME, *BOX, [bottom])
    x, y, z, lon, lat = (part[places(20_000)[3] > 12.22] for part in places(20_000))
    open_here = sample_water(seabed, x, y, z)
    nearest = raw.sel(lat=xr.DataArray(lat), lon=xr.DataArray(lon), method="nearest").values
    assert (z[open_here] >= nearest[open_here]).all()
    assert open_here[(z >= nearest + 10)].mean() > 0.6
    copenhagen, strait = ((float(part) for part in FRAME.to_local(*at)) for at in ((12.45, 55.7), (12.69, 55.88)))
    assert not allowed(seabed, *copenhagen, -1.0)
    assert allowed(seabed, *strait, -5.0)
    assert math.isfinite(seabed.bottom.max())
