"""Ocean files: real ones against reference samples, generated ones in many conventions, refusals."""

import csv
import json
import math

import numpy as np
import pytest
from helpers.files import DATA, GALICIA, IONIAN, WASHINGTON, real

from glider_stream.base.errors import InputError
from glider_stream.kernels.flow import contains, velocity
from glider_stream.kernels.terrain import allowed
from glider_stream.water.describe import describe
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import (
    Names,
    OceanFlow,
    divergence_ratio,
    grid_flow,
    ocean_flow,
    read_currents,
    sample,
)
from glider_stream.water.ocean.flow import closed_below, data_end, filled, slots
from glider_stream.water.ocean.grid import MAP_ERROR, LonLatGrid, index_map

xr = pytest.importorskip("xarray")
pyproj = pytest.importorskip("pyproj")


LON, LAT, DEPTH = (
    np.arange(20.0, 21.6, 0.1),
    np.arange(60.0, 60.81, 0.05),
    np.array([0.5, 10.0, 30.0, 80.0, 200.0]),
)
HOURS = np.array([0.0, 6.0, 12.0, 24.0])
START = np.datetime64("2023-02-27T00:00:00")
MERCATOR = np.degrees(np.arctan(np.sinh(np.radians(np.arange(75.0, 77.0, 1 / 12)))))
PLACE = (20.63, 60.41, 47.0, "2023-02-27T15:00:00")
TOLERANCE = 1e-3


def current(lon, lat, depth, hours):
    """Linear in everything, so that interpolation is exact."""
    u = 0.3 + 0.2 * (lon - 20.8) - 0.3 * (lat - 60.4) - 0.001 * depth + 0.004 * hours
    v = -0.1 + 0.1 * (lon - 20.8) + 0.4 * (lat - 60.4) + 0.0005 * depth - 0.006 * hours
    return u, v


def dataset(**attrs):
    hours, depth, lat, lon = np.meshgrid(HOURS, DEPTH, LAT, LON, indexing="ij")
    u, v = current(lon, lat, depth, hours)
    dims = ("time", "depth", "lat", "lon")
    return xr.Dataset(
        {
            "uo": (dims, u, {"standard_name": "eastward_sea_water_velocity", "units": "m s-1"}),
            "vo": (dims, v, {"standard_name": "northward_sea_water_velocity", "units": "m s-1"}),
        },
        {
            "time": (
                "time",
                HOURS,
                {"units": f"hours since {str(START).replace('T', ' ')}", "standard_name": "time"},
            ),
            "depth": ("depth", DEPTH, {"units": "m", "positive": "down"}),
            "lat": ("lat", LAT, {"units": "degrees_north"}),
            "lon": ("lon", LON, {"units": "degrees_east"}),
        },
        attrs,
    )


def both(data, change):
    data = data.copy(deep=True)
    for name in ("uo", "vo"):
        data[name] = change(data[name]).assign_attrs(data[name].attrs)
    return data


def written(folder, data, name="currents.nc", engine="h5netcdf", encoding=None):
    for variable in data.variables.values():
        variable.encoding.setdefault("_FillValue", None)
    data.to_netcdf(folder / name, engine=engine, encoding=encoding or {})
    return folder / name


def units(data, text, factor):
    return both(data, lambda one: one / factor).pipe(
        lambda d: d.assign({name: d[name].assign_attrs(units=text) for name in ("uo", "vo")})
    )


def renamed(data, u, v, **attrs):
    data = data.rename(uo=u, vo=v)
    for name in (u, v):
        data[name].attrs = dict(attrs)
    return data


def upward(data, positive):
    data = data.assign_coords(depth=-data.depth)
    data.depth.attrs = {"units": "m"} | ({"positive": "up"} if positive else {})
    return data


def cells(data):
    """Longitudes as indices of another circle."""
    data = data.assign_coords(lon=data.lon - 360)
    data.lon.attrs = {"units": "degrees_east"}
    return data


def bare(data):
    for name in ("lon", "lat", "depth"):
        data[name].attrs = {}
    return renamed(data, "water_u", "water_v").rename(lon="Longitude", lat="Latitude", depth="Depth")


CONVENTIONS = {
    "as CF asks": lambda d: d,
    "dimensions in another order": lambda d: d.transpose("lon", "depth", "time", "lat"),
    "latitude descending": lambda d: d.isel(lat=slice(None, None, -1)),
    "depth from the bottom": lambda d: d.isel(depth=slice(None, None, -1)),
    "depth positive up": lambda d: upward(d, True),
    "depth negative, no word on it": lambda d: upward(d, False),
    "times out of order": lambda d: d.isel(time=[2, 0, 3, 1]),
    "longitudes far west": cells,
    "cm/s": lambda d: units(d, "cm/s", 0.01),
    "centimeter second-1": lambda d: units(d, "centimeter second-1", 0.01),
    "meters per second": lambda d: units(d, "meters per second", 1),
    "knots": lambda d: units(d, "knots", 1852 / 3600),
    "names without attributes": bare,
    "unit in the long name": lambda d: renamed(d, "u", "v", long_name="current (cm/s)").pipe(
        lambda e: e.assign(u=100 * e.u, v=100 * e.v).assign(
            u=(100 * e.u).assign_attrs(e.u.attrs), v=(100 * e.v).assign_attrs(e.v.attrs)
        )
    ),
    "long names": lambda d: d.rename(uo="a", vo="b").assign(
        a=d.uo.assign_attrs(standard_name="", long_name="Eastward current velocity"),
        b=d.vo.assign_attrs(standard_name="", long_name="Northward current velocity"),
    ),
    "an ensemble of one": lambda d: d.expand_dims("member"),
    "a wind in the same file": lambda d: d.rename(uo="water_u", vo="water_v").assign(
        u=d.uo.assign_attrs(standard_name="eastward_wind"),
        v=d.vo.assign_attrs(standard_name="northward_wind"),
    ),
    "the height of a wind": lambda d: d.assign_coords(
        height=((), 10.0, {"standard_name": "height", "positive": "up", "units": "m"})
    ),
    "stale valid range": lambda d: both(d, lambda one: one.assign_attrs(valid_min=0.0, valid_max=0.1)),
}


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_conventions_give_the_same_current(tmp_path, convention, engine):
    file = read_currents(written(tmp_path, CONVENTIONS[convention](dataset()), engine=engine))
    expected = current(*PLACE[:3], 15.0)
    assert sample(file, *PLACE) == pytest.approx(expected, abs=TOLERANCE)
    assert sample(file, PLACE[0] + 360, *PLACE[1:3], "2023-02-27T17:00:00+02:00") == pytest.approx(
        expected, abs=TOLERANCE
    )


def test_packed_integers(tmp_path):
    packing = {"dtype": "int16", "scale_factor": 1e-4, "add_offset": 0.05, "_FillValue": np.int16(-32768)}
    data = both(dataset(), lambda one: one.where(one.lon > 20.25))
    file = read_currents(written(tmp_path, data, encoding={"uo": packing, "vo": packing}))
    assert sample(file, *PLACE) == pytest.approx(current(*PLACE[:3], 15.0), abs=TOLERANCE)
    assert sample(file, 20.1, *PLACE[1:]) is None


@pytest.mark.parametrize("fill", [1e20, 1.2676506e30, 9.96921e36, -9999.0, np.nan, 999.0, -99.0])
@pytest.mark.parametrize("declared", [True, False])
def test_fill_values_are_not_water_and_do_not_spoil_the_coast(tmp_path, fill, declared):
    data = both(dataset(), lambda one: one.where(one.lon > 20.25, fill))
    encoding = {"uo": {"_FillValue": fill}, "vo": {"_FillValue": fill}} if declared else {}
    file = read_currents(written(tmp_path, data, encoding=encoding))
    assert sample(file, 20.2, *PLACE[1:]) is None
    u, v = current(20.3, *PLACE[1:3], 15.0)
    assert sample(file, 20.3, *PLACE[1:]) == pytest.approx((u, v), abs=TOLERANCE)
    # between the coast and the first good column: nearest is wet, and its current is not pulled to zero
    assert sample(file, 20.26, *PLACE[1:]) == pytest.approx((u, v), abs=0.02)


def test_land_written_as_zeros_is_land(tmp_path):
    data = both(dataset(), lambda one: one.where((one.lon > 20.25) & ((one.depth < 100) | (one.lat > 60.5)), 0.0))
    file = read_currents(written(tmp_path, data))
    assert sample(file, 20.1, *PLACE[1:]) is None
    assert sample(file, 20.6, 60.41, 199.0, PLACE[3]) is None
    assert sample(file, *PLACE) == pytest.approx(current(*PLACE[:3], 15.0), abs=TOLERANCE)
    assert any("taken as land" in note for note in file.notes)
    assert any("taken as seabed" in note for note in file.notes)


def test_other_calendars_keep_their_dates(tmp_path):
    data = dataset()
    data.time.attrs |= {"calendar": "noleap", "units": "hours since 2024-02-28 00:00:00"}
    file = read_currents(written(tmp_path, data))
    assert file.times[-1] == np.datetime64("2024-03-01T00:00:00")
    assert any("noleap" in note for note in file.notes)
    assert sample(file, *PLACE[:3], "2024-02-28T12:00:00") == pytest.approx(
        current(*PLACE[:3], 12.0), abs=TOLERANCE
    )


def test_a_longitude_circle_without_a_seam(tmp_path):
    lon = np.arange(0.0, 360.0, 0.5)
    lat = np.arange(-46.0, -43.9, 0.5)
    u, _ = np.meshgrid(np.sin(np.radians(lon)), lat)
    data = xr.Dataset(
        {
            "uo": (("lat", "lon"), u, {"units": "m/s"}),
            "vo": (("lat", "lon"), 0.1 + 0 * u, {"units": "m/s"}),
        },
        {"lat": lat, "lon": lon},
    )
    expected = (math.sin(math.radians(359.75)), 0.1)
    path = written(tmp_path, data)
    assert sample(read_currents(path), -0.25, -45.0) == pytest.approx(expected, abs=TOLERANCE)
    cyclic = xr.concat([data, data.isel(lon=[0]).assign_coords(lon=[360.0])], "lon")
    assert sample(read_currents(written(tmp_path, cyclic, "cyclic.nc")), 359.75, -45.0) == pytest.approx(
        expected, abs=TOLERANCE
    )
    frame = LocalFrame.over((359.0, 1.0), (-45.5, -44.5))
    for file in (read_currents(path), read_currents(path, lon=(359.0, 1.0), lat=(-45.5, -44.5))):
        flow, _ = ocean_flow(file, frame, (359.0, 1.0), (-45.5, -44.5), (0.0, 0.0))
        assert velocity(flow, 0.0, 0.0, 0.0, 0.0) == pytest.approx((0.0, 0.1), abs=TOLERANCE)


def test_a_domain_across_the_date_line(tmp_path):
    data = dataset().assign_coords(lon=np.where(LON + 159.2 >= 180, LON - 200.8, LON + 159.2))
    data.lon.attrs = {"units": "degrees_east"}
    file = read_currents(written(tmp_path, data))
    domain = (179.6, -179.6), (60.2, 60.6)
    frame = LocalFrame.over(*domain)
    flow, seabed = ocean_flow(file, frame, *domain, (0.0, 100.0), "2023-02-27T00:00:00")
    for lon in (179.7, -179.7):
        x, y = (float(part) for part in frame.to_local(lon, 60.4))
        turn = float(frame.convergence(lon, 60.4))
        u, v = velocity(flow, x, y, -47.0, 15 * 3600.0)
        back = (u * math.cos(turn) + v * math.sin(turn), v * math.cos(turn) - u * math.sin(turn))
        assert contains(flow, x, y, 0.0)
        assert allowed(seabed, x, y, -47.0)
        assert back == pytest.approx(current((lon - 159.2) % 360, 60.4, 47.0, 15.0), abs=TOLERANCE)


def test_vectors_point_where_water_goes_at_70_north(tmp_path):
    lon, lat = np.arange(0.0, 20.1, 0.5), np.arange(68.0, 72.1, 0.5)
    ones = np.ones((lat.size, lon.size))
    data = xr.Dataset(
        {
            "uo": (("lat", "lon"), 0.3 * ones, {"units": "m/s"}),
            "vo": (("lat", "lon"), 0.4 * ones, {"units": "m/s"}),
        },
        {"lat": lat, "lon": lon},
    )
    frame = LocalFrame(10.0, 70.0)
    flow, _ = ocean_flow(read_currents(written(tmp_path, data)), frame, (3.0, 17.0), (69.0, 71.0), (0.0, 10.0))
    for place in ((4.0, 70.3), (16.0, 69.2), (10.0, 70.0)):
        x, y = (float(part) for part in frame.to_local(*place))
        u, v = velocity(flow, x, y, 0.0, 0.0)
        ahead = pyproj.Geod(ellps="WGS84").fwd(*place, math.degrees(math.atan2(0.3, 0.4)), 50.0)[:2]
        ahead_x, ahead_y = frame.to_local(*ahead)
        assert math.atan2(v, u) == pytest.approx(math.atan2(ahead_y - y, ahead_x - x), abs=2e-4)
        assert math.hypot(u, v) == pytest.approx(0.5, abs=1e-4)


def test_u_and_v_and_times_in_files_of_their_own(tmp_path):
    data = dataset()
    whole = sample(read_currents(written(tmp_path, data, "all.nc")), *PLACE)
    split = [written(tmp_path, data[[name]], f"{name}.nc") for name in ("vo", "uo")]
    steps = [written(tmp_path, data.isel(time=n), f"{n}.nc") for n in (3, 0, 1, 2)]
    assert sample(read_currents(split), *PLACE) == pytest.approx(whole, abs=1e-6)
    assert sample(read_currents(steps), *PLACE) == pytest.approx(whole, abs=1e-6)
    with pytest.raises(InputError, match="given more than once"):
        read_currents([*steps, steps[0]])
    with pytest.raises(InputError, match="no current toward north"):
        read_currents(split[1])
    other = written(tmp_path, data[["vo"]].assign_coords(lon=LON + 0.05), "shifted.nc")
    with pytest.raises(InputError, match="different points"):
        read_currents([split[1], other])


def test_a_user_may_name_everything(tmp_path):
    data = dataset().rename(uo="p", vo="q", lon="a", lat="b", depth="c", time="d")
    for name in ("p", "q", "a", "b", "c"):
        data[name].attrs = {}
    path = written(tmp_path, data)
    with pytest.raises(InputError, match=r"holds no current .* p, q"):
        read_currents(path)
    names = {"u": "p", "v": "q", "lon": "a", "lat": "b", "depth": "c", "time": "d", "units": "m/s"}
    assert sample(read_currents(path, names), *PLACE) == pytest.approx(current(*PLACE[:3], 15.0), abs=TOLERANCE)
    with pytest.raises(InputError, match="no variable `r`"):
        read_currents(path, names | {"u": "r", "v": "r"})
    with pytest.raises(InputError, match=r"names\.w"):
        read_currents(path, {"w": "p"})


def staggered(data):
    v = data.vo.rename(lon="lon_v").assign_coords(lon_v=LON + 0.05)
    return data.drop_vars("vo").assign(vo=v)


def with_attrs(data, name, **attrs):
    data[name].attrs |= attrs
    return data


def without_attr(data, name, key):
    del data[name].attrs[key]
    return data


REFUSALS = {
    "unit": (lambda d: with_attrs(d, "uo", units="furlong/fortnight"), "furlong/fortnight"),
    "no unit": (lambda d: renamed(d, "u", "v"), "has no unit .* set `units`"),
    "no unit and too fast": (lambda d: renamed(units(d, "", 0.01), "uo", "vo"), "has no unit"),
    "wrong unit": (lambda d: both(d, lambda one: 100 * one), "no ocean current"),
    "half staggered": (staggered, "different points that make no staggered grid"),
    "sigma": (lambda d: with_attrs(d, "depth", standard_name="ocean_s_coordinate_g2"), "no depth of the seabed"),
    "pressure": (lambda d: with_attrs(d, "depth", units="dbar"), "'dbar'"),
    "heights": (lambda d: with_attrs(d, "depth", positive="up"), "positive up"),
    "no depths": (lambda d: d.drop_vars("depth"), "`depth` .* has no coordinate that is known"),
    "no time unit": (lambda d: without_attr(d, "time", "units"), "hours since"),
    "odd time unit": (lambda d: with_attrs(d, "time", units="fortnights since 2000-01-01"), "fortnights"),
    "dates that are none": (
        lambda d: with_attrs(d, "time", units="days since 2023-02-24", calendar="360_day"),
        "360_day",
    ),
    "two members": (lambda d: xr.concat([d, d], "member"), "`member`"),
    "two candidates": (lambda d: d.assign(a=d.uo, b=d.vo).rename(uo="c", vo="d"), "set `u` and `v`"),
    "mooring": (lambda d: d.isel(lon=[0], lat=[0]), "one position"),
    "trajectory": (lambda d: d.assign_attrs(featureType="trajectory"), "trajectory"),
    "mesh": (
        lambda d: d.isel(lon=xr.DataArray(range(5), dims="node"), lat=xr.DataArray(range(5), dims="node")),
        "one dimension, `node`",
    ),
    "empty": (lambda d: both(d, lambda one: one * np.nan), "no current at all"),
    "all still": (lambda d: both(d, lambda one: one * 0), "no current at all"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refused_in_one_sentence(tmp_path, case):
    change, words = REFUSALS[case]
    with pytest.raises(InputError, match=words) as refusal:
        read_currents(written(tmp_path, change(dataset())))
    assert "\n" not in str(refusal.value)
    assert "currents.nc" in str(refusal.value)


def test_a_user_may_overrule(tmp_path):
    expected = pytest.approx(current(*PLACE[:3], 15.0), abs=TOLERANCE)
    for change, names in (
        (lambda d: with_attrs(d, "depth", positive="up"), Names(positive="down")),
        (lambda d: both(d, lambda one: 100 * one), Names(units="cm/s")),
    ):
        assert sample(read_currents(written(tmp_path, change(dataset())), names), *PLACE) == expected


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_broken_files_are_refused(tmp_path, engine):
    good = written(tmp_path, dataset(), engine=engine).read_bytes()
    for name, content in {
        "half.nc": good[: len(good) // 2],
        "text.nc": b"lon,lat\n1,2\n",
        "empty.nc": b"",
    }.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name) as refusal:
            read_currents(tmp_path / name)
        assert "\n" not in str(refusal.value)
    with pytest.raises(InputError, match="does not exist"):
        read_currents(tmp_path / "none.nc")
    with pytest.raises(InputError, match="is a folder"):
        read_currents(tmp_path)


def test_memory_is_bounded_by_the_domain(tmp_path):
    path = written(tmp_path, dataset())
    size = 16 * HOURS.size * DEPTH.size * LAT.size * LON.size
    with pytest.raises(InputError, match="GB"):
        read_currents(path, limit=size - 1)
    assert read_currents(path, limit=size).u.size * 16 == size
    part = read_currents(path, lon=(20.6, 20.7), lat=(60.4, 60.45), depth=(0.0, 20.0), limit=size - 1)
    assert sample(part, 20.63, 60.41, 15.0, PLACE[3]) == pytest.approx(
        current(20.63, 60.41, 15.0, 15.0), abs=TOLERANCE
    )


def test_no_answer_outside(tmp_path):
    file = read_currents(written(tmp_path, dataset()))
    lon, lat, depth, time = PLACE
    assert sample(file, lon, lat, 200.0, time) is not None
    for place in (
        (19.9, lat, depth, time),
        (lon, 60.9, depth, time),
        (lon, lat, 201.0, time),
        (lon, lat, depth, "2023-02-26T00:00:00"),
        (lon, lat, depth, "2023-02-28T00:01:00"),
    ):
        assert sample(file, *place) is None
    # held above the top level
    assert sample(file, lon, lat, 0.0, time) == sample(file, lon, lat, 0.5, time)
    with pytest.raises(InputError, match="2023-02-27T00:00:00Z to 2023-02-28T00:00:00Z"):
        sample(file, lon, lat, depth)
    with pytest.raises(InputError, match="got -10"):
        sample(file, lon, lat, -10.0, time)
    with pytest.raises(InputError, match="'yesterday'"):
        sample(file, lon, lat, depth, "yesterday")


def test_a_gap_in_time_is_a_gap_then_and_there_only(tmp_path):
    data = dataset()
    data.uo[1, :, 8, 6] = np.nan
    file = read_currents(written(tmp_path, data))
    place = float(LON[6]), float(LAT[8]), 10.0
    assert sample(file, *place, "2023-02-27T12:00:00") == pytest.approx(current(*place, 12.0), abs=TOLERANCE)
    assert sample(file, *place, "2023-02-27T06:00:00") is None
    assert any("gaps" in note for note in file.notes)


def test_a_surface_file_is_held_at_all_depths(tmp_path):
    file = read_currents(written(tmp_path, dataset().isel(depth=0, time=0, drop=True)))
    assert file.surface
    assert any("held at all depths" in note for note in file.notes)
    for depth in (None, 0.0, 900.0):
        assert sample(file, 20.63, 60.41, depth) == pytest.approx(current(20.63, 60.41, 0.5, 0.0), abs=TOLERANCE)


DOMAIN = (20.52, 20.98), (60.22, 60.58), (0.0, 150.0)
FRAME = LocalFrame.over(*DOMAIN[:2])


def test_the_flow_of_a_domain(tmp_path):
    file = read_currents(written(tmp_path, dataset()))
    flow, seabed = ocean_flow(file, FRAME, *DOMAIN, "2023-02-27T03:00:00Z")
    assert (flow.extent.t_lo, flow.extent.t_hi) == (-3 * 3600, 21 * 3600)
    assert flow.values.shape[2:4] == (10, 13)
    assert flow.extent.length_scale == pytest.approx(5500, rel=0.02)
    rng = np.random.default_rng(1)
    for lon, lat, depth, hours in rng.uniform((20.4, 60.15, 0.5, 0), (21.1, 60.65, 195, 24), (50, 4)):
        x, y = (float(part) for part in FRAME.to_local(lon, lat))
        u, v = velocity(flow, x, y, -depth, (hours - 3) * 3600)
        turn = float(FRAME.convergence(lon, lat))
        east, north = u * math.cos(turn) + v * math.sin(turn), v * math.cos(turn) - u * math.sin(turn)
        assert (east, north) == pytest.approx(current(lon, lat, depth, hours), abs=1e-4)
        assert math.hypot(u, v) <= flow.extent.max_speed
        assert contains(flow, x, y, 0.0)
        assert allowed(seabed, x, y, -depth)
    x, y = (float(part) for part in FRAME.to_local(20.1, 60.4))
    assert not contains(flow, x, y, 0.0)
    # data hold half a level's spacing beyond the last one: 200 + 60 m
    assert allowed(seabed, 0.0, 0.0, -259.9)
    assert not allowed(seabed, 0.0, 0.0, -260.1)


def test_the_planner_and_the_sample_read_the_same(tmp_path):
    data = both(dataset(), lambda one: one.where((one.lon - 20.8) ** 2 + (one.lat - 60.4) ** 2 > 0.02))
    file = read_currents(written(tmp_path, data))
    flow, seabed = ocean_flow(file, FRAME, *DOMAIN, str(START))
    for lon, lat in np.random.default_rng(2).uniform((20.5, 60.2), (21.0, 60.6), (40, 2)):
        x, y = (float(part) for part in FRAME.to_local(lon, lat))
        here = sample(file, lon, lat, 20.0, "2023-02-27T02:00:00")
        assert (here is not None) == allowed(seabed, x, y, -20.0)
        if here is not None:
            u, v = velocity(flow, x, y, -20.0, 7200.0)
            assert math.hypot(u, v) == pytest.approx(math.hypot(*here), abs=1e-5)


@pytest.mark.parametrize(
    ("domain", "epoch", "words"),
    [
        (DOMAIN, None, "`flow.epoch` is missing.* 2023-02-27T00:00:00Z to 2023-02-28T00:00:00Z"),
        (DOMAIN, "2023-03-01", "`flow.epoch` = 2023-03-01T00:00:00Z lies outside .* 2023-02-27"),
        (DOMAIN, "soon", "'soon'"),
        (((19.0, 21.0), *DOMAIN[1:]), str(START), "longitude 19 to 21 lies partly outside .* 20 to 21.6"),
        (
            (DOMAIN[0], (60.2, 61.0), DOMAIN[2]),
            str(START),
            "latitude 60.2 to 61 lies partly outside .* 60 to 60.8",
        ),
        ((*DOMAIN[:2], (0.0, 300.0)), str(START), "300 m deep.* at 200 m"),
    ],
)
def test_domains_that_the_file_does_not_hold(tmp_path, domain, epoch, words):
    file = read_currents(written(tmp_path, dataset()))
    with pytest.raises(InputError, match=words):
        ocean_flow(file, LocalFrame.over(*domain[:2]), *domain, epoch)


def test_a_single_level_and_a_single_time_are_doubled(tmp_path):
    file = read_currents(written(tmp_path, dataset().isel(depth=[0], time=[0])))
    flow, _ = ocean_flow(file, FRAME, *DOMAIN[:2], (0.0, 0.5))
    assert flow.values.shape[:2] == (2, 2)
    assert (flow.extent.t_lo, flow.extent.t_hi) == (-math.inf, math.inf)
    assert velocity(flow, 0.0, 0.0, -0.3, 1e6) == velocity(flow, 0.0, 0.0, 0.0, -5.0)


def test_the_index_map_is_exact_to_a_metre():
    for lon, lat in (
        (LON, LAT),
        (np.arange(0, 13, 0.5), np.arange(66, 74, 0.25)),
        (LON, MERCATOR),
    ):
        frame = LocalFrame.over((lon[0], lon[-1]), (lat[0], lat[-1]))
        at = index_map(frame, LonLatGrid(lon, lat))
        assert at.error <= MAP_ERROR
        for i, j in np.random.default_rng(3).uniform(0, (lon.size - 1, lat.size - 1), (100, 2)):
            place = np.interp(i, np.arange(lon.size), lon), np.interp(j, np.arange(lat.size), lat)
            x, y = frame.to_local(*place)
            p, q = (x - at.x_lo) * at.per_x, (y - at.y_lo) * at.per_y
            m, n = int(p), int(q)
            a, b = p - m, q - n
            near = at.index_map[m : m + 2, n : n + 2]
            read = (1 - a) * ((1 - b) * near[0, 0] + b * near[0, 1]) + a * ((1 - b) * near[1, 0] + b * near[1, 1])
            back = np.interp(read[0], np.arange(lon.size), lon), np.interp(read[1], np.arange(lat.size), lat)
            assert math.hypot(*(np.array(frame.to_local(*back)) - (x, y))) <= 1.1 * MAP_ERROR


def test_slots_lead_to_the_cell():
    points = np.array([-5000.0, -3000.0, -900.0, -899.5, -20.0, -1.0, -0.5])
    table, per_unit = slots(points)
    for at in np.random.default_rng(4).uniform(points[0], points[-1], 500):
        below = int(table[int((at - points[0]) * per_unit)])
        below += at >= points[below + 1]
        assert points[below] <= at <= points[below + 1]


def test_dry_cells_take_from_wet_neighbours_then_from_above():
    values = np.full((2, 6, 5, 2), np.nan)
    values[0, 0] = (1.0, -1.0)
    full = filled(values)
    assert (full[0, :3] == (1.0, -1.0)).all()
    assert (full[0, 3:] == 0).all()
    assert (full[1] == full[0]).all()
    values[1, 5] = 0.5
    assert (filled(values)[1, 3:] == 0.5).all()


def test_columns_are_closed_where_their_data_end():
    depth, unknown = np.array([1.0, 3.0, 9.0]), np.full(5, np.inf)
    assert data_end(depth) == 12.0
    wet = np.array([[1, 1, 1, 0, 1], [0, 1, 1, 0, 0], [0, 0, 1, 1, 0]], dtype=bool)
    # the deepest level with data, half a level beyond the last, and nothing where the top level is dry
    assert closed_below(wet, depth, depth, unknown) == pytest.approx([-1.01, -3.01, -12.0, 0.0, -1.01])
    # where the seabed lies above the next level, the data go on to it
    seabed = np.array([2.5, 8.9, np.inf, np.inf, 1.0])
    assert closed_below(wet, depth, depth, seabed) == pytest.approx([-np.inf, -np.inf, -12.0, 0.0, -np.inf])


def test_grid_flow_from_arrays():
    x, y, z, t = (
        np.arange(0.0, 1001, 100),
        np.arange(-500.0, 501, 50),
        np.array([0.0, -20.0, -80.0]),
        [0.0, 3600.0],
    )
    tt, zz, yy, xx = np.meshgrid(t, z, y, x, indexing="ij")
    u, v = 1e-3 * xx + 1e-4 * tt + 2e-3 * zz, -2e-3 * yy + 1e-3 * xx
    mask = np.zeros((y.size, x.size), dtype=bool)
    mask[:, 0] = True
    flow, seabed = grid_flow(x, y[::-1], z, u[:, :, ::-1], v[:, :, ::-1], t, mask)
    assert velocity(flow, 333.0, 77.0, -33.0, 1234.0) == pytest.approx((0.333 + 0.1234 - 0.066, -0.154 + 0.333))
    assert not allowed(seabed, 40.0, 0.0, -1.0)
    assert allowed(seabed, 60.0, 0.0, -109.0)
    assert not allowed(seabed, 60.0, 0.0, -111.0)
    assert not contains(flow, 500.0, 0.0, 3601.0)
    steady, _ = grid_flow(x, y, z, u[0], v[0])
    assert velocity(steady, 333.0, 77.0, -33.0, 9.0) == pytest.approx((0.333 - 0.066, -0.154 + 0.333))
    backward, _ = grid_flow(x, y, z, u[::-1], v[::-1], t[::-1])
    assert velocity(backward, 333.0, 77.0, -33.0, 1234.0) == pytest.approx(
        (0.333 + 0.1234 - 0.066, -0.154 + 0.333)
    )
    with pytest.raises(InputError, match=r"`u` must have the shape"):
        grid_flow(x, y, z, u[0, 0], v[0, 0])
    with pytest.raises(InputError, match="evenly"):
        grid_flow(x**2, y, z, u[0], v[0])


def test_divergence_ratio_of_pure_fields(tmp_path):
    lon, lat = np.meshgrid(LON, LAT)
    east = 6.4e6 * np.radians(lon - 20.8) * np.cos(np.radians(60.4))
    north = 6.4e6 * np.radians(lat - 60.4)
    spin, spread = np.stack([-north, east]) * 1e-5, np.stack([east, north]) * 1e-5
    for share, expected in ((0.0, 0.0), (0.5, 0.5)):
        u, v = spin + share * spread
        attrs = {"units": "m/s"}
        data = xr.Dataset(
            {"uo": (("lat", "lon"), u, attrs), "vo": (("lat", "lon"), v, attrs)}, {"lat": LAT, "lon": LON}
        )
        assert divergence_ratio(read_currents(written(tmp_path, data))) == pytest.approx(expected, abs=0.02)


def test_describe_says_what_was_taken_and_read(tmp_path):
    path = written(tmp_path, dataset())
    told = describe([path], at=[PLACE, (30.0, 60.0, 10.0, PLACE[3]), (*PLACE[:2], 5000.0, PLACE[3])])
    table = json.loads(json.dumps(told.as_dict(), allow_nan=False))
    assert table["points"][0] | {"u_east": 0, "v_north": 0} == {
        "lon": 20.63,
        "lat": 60.41,
        "depth": 47.0,
        "time": PLACE[3],
        "u_east": 0,
        "v_north": 0,
    }
    assert (table["points"][0]["u_east"], table["points"][0]["v_north"]) == pytest.approx(
        current(*PLACE[:3], 15.0), abs=TOLERANCE
    )
    assert table["points"][1]["u_east"] is table["points"][1]["v_north"] is None
    assert f"  30, 60, 10 m, {PLACE[3]}: outside the file's extent" in str(told)
    for words in (
        "uo",
        "2023-02-27T00:00:00Z",
        "5 levels",
        "5000 m, 2023-02-27T15:00:00: no water, or no data",
        "m/s east",
        "stream value",
        "flat map",
    ):
        assert words in str(told)
    u, v = (table["points"][0][name] for name in ("u_east", "v_north"))
    first = str(told).splitlines()[1]  # what was asked comes first
    assert first.startswith(f"  20.63, 60.41, 47 m, {PLACE[3]}: {u:+.5f} m/s east, {v:+.5f} m/s north; ")
    speed, toward = float(first.split()[-6]), math.radians(float(first.split()[-2]))
    assert (speed * math.sin(toward), speed * math.cos(toward)) == pytest.approx((u, v), abs=0.01)
    with pytest.raises(InputError, match="2023-02-27T00:00:00Z to 2023-02-28"):
        describe(path, at=[(*PLACE[:3], None)])


def file_words(path):
    """What `describe` says was assumed, as a roadmap keeps it."""
    took = describe(path).as_dict()["took"]
    return {f"{key}: {took[key]}" for key in ("bottom", "land", "levels", "stamps")}


def test_the_scenario_block(tmp_path):
    path = written(tmp_path, dataset())
    flow, bottom, words = OceanFlow((str(path),), epoch=str(START)).waters(FRAME, *DOMAIN)
    x = velocity(flow, 0.0, 0.0, -47.0, 15 * 3600.0)
    assert x == pytest.approx(current(FRAME.lon, FRAME.lat, 47.0, 15.0), abs=TOLERANCE)
    assert bottom.height.shape == bottom.grid.shape
    assert (bottom.height == -260.0).all()
    assert np.isneginf(bottom.ground).all()
    assert "currents.nc" in words
    assert file_words(path) <= set(words.split("; "))


@real
def test_reference_samples_of_real_files():
    files = {}
    with (DATA / "expected_points.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 33
    for row in rows:
        file = files.setdefault(row["file"], None) or read_currents(DATA / row["file"])
        files[row["file"]] = file
        depth = float(row["depth_m"]) if row["depth_m"] else None
        here = sample(file, float(row["lon"]), float(row["lat"]), depth, row["time"])
        if row["abs_tol"] == "masked":
            assert here is None
        else:
            expected = float(row["u_east_mps"]), float(row["v_north_mps"])
            assert here == pytest.approx(expected, abs=float(row["abs_tol"]))


@real
def test_divergence_of_real_files():
    assert 0.05 < divergence_ratio(read_currents(IONIAN)) < 0.3
    assert 0.45 < divergence_ratio(read_currents(WASHINGTON)) < 0.8


@real
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gebco2020_oresund_bathymetry.nc", "elevation"),
        ("seaexplorer_track_dfo-eva035-20190721.nc", "trajectory"),
        ("seaglider_sg542_saz_dac.csv", "not a NetCDF file"),
    ],
)
def test_real_files_that_hold_no_current(name, words):
    with pytest.raises(InputError, match=words):
        read_currents(DATA / name)


@real
def test_a_flow_of_a_real_coast():
    lon, lat, depth = (-9.2, -8.7), (42.1, 42.8), (0.0, 180.0)
    frame = LocalFrame.over(lon, lat)
    flow, seabed = ocean_flow(read_currents(GALICIA), frame, lon, lat, depth, "2025-01-02T06:00")
    assert np.isfinite(flow.values).all()
    assert flow.extent.max_speed < 0.3
    assert 0 < (seabed.bottom == 0).mean() < 0.6
    assert seabed.bottom.min() > -220
