"""The local frame against geodesics, round trips and the date line."""

import math
import sys

import numpy as np
import pytest

from glider_stream.base.errors import InputError
from glider_stream.water.frame import LocalFrame, eastward, wrapped

pyproj = pytest.importorskip("pyproj")
GEOD = pyproj.Geod(ellps="WGS84")
CENTIMETRE = 0.01


@pytest.mark.parametrize(
    ("lon", "lat"), [(18.0, 38.0), (180.0, -45.0), (-125.0, 0.0), (10.0, 70.0), (359.0, -70.0)]
)
def test_round_trip_over_a_thousand_kilometres(lon, lat):
    frame = LocalFrame(lon, lat)
    x, y = np.meshgrid(np.linspace(-5e5, 5e5, 21), np.linspace(-5e5, 5e5, 21))
    back_x, back_y = frame.to_local(*frame.to_lonlat(x, y))
    assert np.hypot(back_x - x, back_y - y).max() < CENTIMETRE


def test_the_centre_is_the_origin_and_metres_are_metres():
    frame = LocalFrame(18.0, 38.0)
    x, y = frame.to_local(18.0, 38.0)
    assert (float(x), float(y)) == pytest.approx((0, 0), abs=1e-6)
    for bearing in range(0, 360, 30):
        lon, lat, _ = GEOD.fwd(18.0, 38.0, bearing, 1000)
        x, y = frame.to_local(lon, lat)
        assert math.hypot(x, y) == pytest.approx(1000, abs=CENTIMETRE)
        assert math.degrees(math.atan2(x, y)) % 360 == pytest.approx(bearing, abs=1e-3)


@pytest.mark.parametrize("lat", [70.0, -70.0])
@pytest.mark.parametrize("bearing", [0, 45, 90, 200])
def test_east_north_vectors_turn_into_the_frame(lat, bearing):
    frame, lon = LocalFrame(10.0, lat), 17.0
    ahead_lon, ahead_lat, _ = GEOD.fwd(lon, lat, bearing, 10)
    (x0, x1), (y0, y1) = frame.to_local([lon, ahead_lon], [lat, ahead_lat])
    turn = float(frame.convergence(lon, lat))
    east, north = math.sin(math.radians(bearing)), math.cos(math.radians(bearing))
    u = east * math.cos(turn) - north * math.sin(turn)
    v = east * math.sin(turn) + north * math.cos(turn)
    length = math.hypot(x1 - x0, y1 - y0)
    assert ((x1 - x0) / length, (y1 - y0) / length) == pytest.approx((u, v), abs=1e-5)
    # seven degrees of longitude turn north by about seven sines of the latitude
    assert math.degrees(turn) == pytest.approx(7 * math.sin(math.radians(lat)), rel=0.01)


def test_longitudes_count_modulo_360_across_the_date_line():
    frame = LocalFrame.over((179.0, -179.0), (-46.0, -44.0))
    assert (frame.lon, frame.lat) == (180.0, -45.0)
    assert frame.to_local(-179.5, -45.0)[0] == pytest.approx(float(frame.to_local(180.5, -45.0)[0]), abs=1e-6)
    assert frame.to_local(-179.5, -45.0)[0] > 0 > frame.to_local(179.5, -45.0)[0]
    lon, _ = frame.to_lonlat([-1e5, 1e5], [0, 0])
    assert lon[0] < 180 < lon[1]


def test_ranges_of_longitude_rise():
    assert eastward((179.0, -179.0)) == (179.0, 181.0)
    assert eastward((10.0, 20.0)) == (10.0, 20.0)
    assert wrapped([350.0, -10.0, 10.0], 0.0).tolist() == [-10, -10, 10]


def test_scale_error_is_that_of_geodesics():
    frame = LocalFrame(0.0, 60.0)
    assert frame.scale_error((0.0, 0.0), (60.0, 60.0)) == pytest.approx(0, abs=1e-9)
    error = frame.scale_error((0.0, 0.0), (60.0, 64.5))
    lon, lat, _ = GEOD.fwd(0.0, 64.5, 90, 10)
    (x0, x1), (y0, y1) = frame.to_local([0.0, lon], [64.5, lat])
    assert error == pytest.approx(math.hypot(x1 - x0, y1 - y0) / 10 - 1, rel=1e-3)
    assert error == pytest.approx((5e5 / 2 / 6.371e6) ** 2, rel=0.02)


def test_conformal():
    frame = LocalFrame(0.0, 60.0)
    ends = [GEOD.fwd(6.0, 62.0, bearing, 10)[:2] for bearing in (30, 120)]
    x, y = frame.to_local([6.0, ends[0][0], ends[1][0]], [62.0, ends[0][1], ends[1][1]])
    one, other = np.array([x[1] - x[0], y[1] - y[0]]), np.array([x[2] - x[0], y[2] - y[0]])
    assert np.linalg.norm(one) == pytest.approx(np.linalg.norm(other), rel=1e-5)
    assert one @ other / (one @ one) == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize(("lon", "lat"), [(0.0, 91.0), (math.nan, 0.0), (0.0, math.nan)])
def test_no_place_no_frame(lon, lat):
    with pytest.raises(InputError, match="frame's l"):
        LocalFrame(lon, lat)


def test_without_pyproj_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(InputError, match=r"pip install glider-stream\[ocean\]"):
        LocalFrame(1.2345, 6.789).to_local(1.0, 6.0)


@pytest.mark.parametrize("lat", [0.0, 70.0, -45.0])
@pytest.mark.parametrize("lon", [10.0, 180.0])
@pytest.mark.parametrize("width", [10e3, 100e3, 1000e3])
def test_round_trips_and_velocities_in_domains_of_all_sizes(lon, lat, width):
    """To a centimetre; and the frame's velocity against geodesics, within the error that the frame reports."""
    half = width / 2
    dlat, dlon = half / 111e3, half / 111e3 / math.cos(math.radians(lat))
    frame = LocalFrame.over((lon - dlon, lon + dlon), (lat - dlat, lat + dlat))
    error = frame.scale_error((lon - dlon, lon + dlon), (lat - dlat, lat + dlat))
    rng = np.random.default_rng(7)
    lons, lats = lon + rng.uniform(-dlon, dlon, 200), lat + rng.uniform(-dlat, dlat, 200)
    x, y = frame.to_local(lons, lats)
    back = frame.to_lonlat(x, y)
    assert GEOD.inv(lons, lats, *back)[2].max() < CENTIMETRE
    bearing, far = rng.uniform(0, 360, 200), 100.0
    ahead = GEOD.fwd(lons, lats, bearing, np.full(200, far))[:2]
    moved = np.stack(frame.to_local(*ahead)) - [x, y]
    turn = frame.convergence(lons, lats)
    east, north = np.sin(np.radians(bearing)), np.cos(np.radians(bearing))
    told = far * np.stack(
        [east * np.cos(turn) - north * np.sin(turn), east * np.sin(turn) + north * np.cos(turn)]
    )
    off = np.hypot(*(moved - told)) / far
    assert off.max() <= error * 1.01 + 2e-5  # a chord of 100 m bends by as much
    assert error < 0.01
