"""Times, names, gaps, flags and formats as real files have them: right values, or a sentence with the cure."""

import gzip
import warnings
import zipfile

import numpy as np
import pytest
from helpers.currents import DOMAIN, LAT, LON, both, current, dataset, written
from helpers.small import command

from glider_stream.base.errors import InputError
from glider_stream.water.describe import describe
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import component, ocean_flow, read_currents, sample
from glider_stream.water.ocean.grid import CurvedGrid, gaps
from glider_stream.water.ocean.units import in_metres_per_second

pytestmark = pytest.mark.slow

xr = pytest.importorskip("xarray")

HOURS = np.array([0.0, 24.0, 48.0])
START = np.datetime64("2024-11-20T00:00")


def at_hours(file, hours, lon=20.5, lat=60.5, depth=20.0):
    return sample(file, lon, lat, depth, str(START + np.timedelta64(round(60 * hours), "m")))


def means(shift, bounds=True, methods="time: mean", **attrs):
    """Daily means of a current that is linear in time, so that of the middle, stamped `shift` hours before it."""
    data = dataset(hours=HOURS + 12.0).assign_attrs(attrs)
    data = data.assign_coords(time=("time", HOURS + 12.0 - shift, data.time.attrs))
    for name in ("uo", "vo"):
        data[name].attrs["cell_methods"] = methods
    if bounds:
        data.time.attrs["bounds"] = "time_bnds"
        data["time_bnds"] = (("time", "nv"), np.stack([HOURS, HOURS + 24.0], axis=-1))
    return data


@pytest.mark.parametrize("shift", [12.0, 0.0, -12.0])
def test_means_stand_at_the_middle_of_their_bounds(tmp_path, shift):
    file = read_currents(written(tmp_path, means(shift)))
    assert at_hours(file, 18.0) == pytest.approx(current(20.5, 60.5, 20.0, 18.0), abs=1e-3)
    assert "time_bnds" in file.took["stamps"]
    assert any("from the middle" in note for note in file.notes) == (shift != 0.0)


def test_what_says_mean_without_bounds_is_noted_and_can_be_told(tmp_path):
    path = written(tmp_path, means(12.0, bounds=False))
    assert any("says 'mean' over time, and gives no bounds" in note for note in read_currents(path).notes)
    told = read_currents(path, {"stamps": "start"})
    assert at_hours(told, 18.0) == pytest.approx(current(20.5, 60.5, 20.0, 18.0), abs=1e-3)
    late = read_currents(written(tmp_path, means(-12.0, bounds=False), "late.nc"), {"stamps": "end"})
    assert at_hours(late, 18.0) == pytest.approx(current(20.5, 60.5, 20.0, 18.0), abs=1e-3)
    for title in ("Daily mean fields of the Ionian", "cmems_mod_glo_phy-cur_anfc_0.083deg_P1D-m"):
        file = read_currents(written(tmp_path, means(12.0, False, "area: mean", title=title), "title.nc"))
        assert any("gives no bounds" in note for note in file.notes), title
        assert "means" in file.took["stamps"]
    plain = read_currents(written(tmp_path, dataset(hours=HOURS), "plain.nc"))
    assert plain.took["stamps"] == "instants: nothing says that they are means"
    point = read_currents(written(tmp_path, means(12.0, True, "time: point"), "point.nc"))
    assert point.times[0] == START
    assert point.took["stamps"] == "instants, as `cell_methods` says"


def test_no_time_is_bridged_that_the_file_lacks(tmp_path):
    hours = np.append(np.arange(0.0, 12.0), np.arange(100.0, 110.0))
    file = read_currents(written(tmp_path, dataset(hours=hours)))
    assert at_hours(file, 105.5) == pytest.approx(current(20.5, 60.5, 20.0, 105.5), abs=1e-3)
    assert at_hours(file, 50.0) is None
    frame = LocalFrame.over(*DOMAIN)
    flow, _ = ocean_flow(file, frame, *DOMAIN, (0.0, 50.0), "2024-11-20T02:00")
    assert flow.extent.t_hi == 9 * 3600.0
    with pytest.raises(InputError, match=r"lies in a gap of currents.nc: no data from 2024-11-20T11:00:00Z"):
        ocean_flow(file, frame, *DOMAIN, (0.0, 50.0), "2024-11-22T00:00")


def test_gaps_in_axes():
    assert gaps(np.append(np.arange(-180, -174.9, 0.1), np.arange(175, 179.95, 0.1))).sum() == 1
    assert gaps(np.concatenate([np.arange(0, 5, 0.1), [7.0], np.arange(9, 12, 0.1)])).sum() == 2
    for even in (
        np.arange(5.0),
        np.cumsum(1.25 ** np.arange(30)),
        np.append(np.arange(120.0), np.arange(120.0, 240, 6)),
    ):
        assert not gaps(even).any()


def test_a_part_about_the_date_line_that_was_sorted_is_whole_there_and_nowhere_else(tmp_path):
    lon = np.append(np.arange(-180.0, -174.9, 0.5), np.arange(175.0, 179.9, 0.5))
    data = both(dataset(lon=lon % 360, depth=None), lambda one: one / 100)
    data = data.assign_coords(lon=("lon", lon, data.lon.attrs))
    file = read_currents(written(tmp_path, data))
    for east in (179.75, 180.25):
        expected = np.array(current(east, 60.5)) / 100
        assert sample(file, east, 60.5, 0.0) == pytest.approx(expected, abs=1e-4)
    for nowhere in (0.0, 90.0, -170.0):
        assert sample(file, nowhere, 60.5, 0.0) is None
    with pytest.raises(InputError, match="longitude -1 to 1 lies partly outside"):
        read_currents(tmp_path / "currents.nc", lon=(-1.0, 1.0), lat=(60.2, 60.8), depth=(0.0, 0.0))
    part = read_currents(tmp_path / "currents.nc", lon=(179.5, -179.5), lat=(60.2, 60.8), depth=(0.0, 0.0))
    assert sample(part, 180.25, 60.5, 0.0) == pytest.approx(expected, abs=1e-4)
    assert describe(tmp_path / "currents.nc").as_dict()["lon"] == [175.0, 185.0]


def test_a_gap_within_the_axes_holds_no_data(tmp_path):
    whole = dataset(lon=np.arange(20.0, 24.01, 0.1), lat=np.arange(58.0, 62.01, 0.1), depth=None)
    cut = whole.sel(lon=(whole.lon < 21.05) | (whole.lon > 22.95), lat=(whole.lat < 59.05) | (whole.lat > 60.95))
    path = written(tmp_path, cut)
    for lon, lat in ((20.5, 58.5), (23.5, 61.5), (20.5, 61.5)):
        assert sample(read_currents(path), lon, lat, 0.0) == pytest.approx(current(lon, lat), abs=1e-3)
    for lon, lat in ((22.0, 58.5), (20.5, 60.0), (22.0, 60.0)):
        assert sample(read_currents(path), lon, lat, 0.0) is None
    with pytest.raises(InputError, match="with no data from 21 to 23"):
        read_currents(path, lon=(20.5, 23.5), lat=(58.2, 58.8), depth=(0.0, 0.0))


def curved(rows, columns):
    """A grid whose rows leave the parallels, 0.1 degrees a cell."""
    j, i = np.meshgrid(rows, columns, indexing="ij")
    return 20.0 + 0.1 * i + 0.01 * j, 60.0 + 0.1 * j - 0.01 * i


def curved_file(folder, rows, columns):
    lon, lat = curved(rows, columns)
    u, v = current(lon, lat)
    attrs = dataset().uo.attrs, dataset().vo.attrs
    data = xr.Dataset(
        {"uo": (("y", "x"), u, attrs[0]), "vo": (("y", "x"), v, attrs[1])},
        {
            "lon": (("y", "x"), lon, {"units": "degrees_east"}),
            "lat": (("y", "x"), lat, {"units": "degrees_north"}),
        },
    )
    return written(folder, data)


def test_every_part_of_a_curved_grid_can_be_planned_in(tmp_path):
    path = curved_file(tmp_path, np.arange(20.0), np.arange(24.0))
    for j, i in ((1.0, 1.0), (17.5, 3.0), (17.5, 21.5), (2.0, 21.5), (10.0, 12.0)):
        lon, lat = (float(part[0, 0]) for part in curved([j], [i]))
        domain = (lon - 0.03, lon + 0.03), (lat - 0.03, lat + 0.03)
        file = read_currents(path, lon=domain[0], lat=domain[1], depth=(0.0, 0.0))
        assert sample(file, lon, lat, 0.0) == pytest.approx(current(lon, lat), abs=1e-3), (j, i)


def test_a_gap_between_the_columns_of_a_curved_grid(tmp_path):
    columns = np.append(np.arange(10.0), np.arange(60.0, 70.0))
    file = read_currents(curved_file(tmp_path, np.arange(12.0), columns))
    assert isinstance(file.grid, CurvedGrid)
    inside, between = ((float(part[0, 0]) for part in curved([6.0], [i])) for i in (65.5, 30.0))
    assert sample(file, *inside, 0.0) is not None
    assert sample(file, *between, 0.0) is None
    lon, lat = (float(part[0, 0]) for part in curved([6.0], [30.0]))
    with pytest.raises(InputError, match="lies across a gap between the rows or columns"):
        file.grid.cut("x.nc", (lon - 0.1, lon + 0.1), (lat - 0.1, lat + 0.1), lon, 2)


def with_attrs(data, **attrs):
    for name, words in attrs.items():
        data[name].attrs |= words
    return data


CONTRADICTIONS = {
    "u that is y": lambda: with_attrs(
        dataset(names=("u", "v")),
        u={"standard_name": "sea_water_y_velocity"},
        v={"standard_name": "sea_water_x_velocity"},
    ),
    "uo that is northward": lambda: with_attrs(
        dataset(),
        uo={"standard_name": "northward_sea_water_velocity"},
        vo={"standard_name": "eastward_sea_water_velocity"},
    ),
    "v alone": lambda: (
        with_attrs(dataset(names=("u", "water_v")), water_v={"standard_name": "sea_water_x_velocity"})
        .drop_vars("u")
        .assign(other=lambda d: d.water_v.assign_attrs(standard_name="sea_water_y_velocity"))
    ),
}


@pytest.mark.parametrize("case", CONTRADICTIONS)
def test_names_that_contradict_each_other_are_refused(tmp_path, case):
    path = written(tmp_path, CONTRADICTIONS[case]())
    with pytest.raises(InputError, match=r"contradicts itself: its standard name .* set `u` and `v` in `names`"):
        read_currents(path)
    if "alone" not in case:
        u = "uo" if "uo" in case else "u"
        names = {"u": u, "v": "v" + u[1:], "rotate": "none"}
        assert sample(read_currents(path, names), 20.5, 60.5, 20.0) == pytest.approx(
            current(20.5, 60.5, 20.0), abs=1e-3
        )


DOUBTS = {
    "tides alone": (lambda d: with_attrs(d, uo={"long_name": "Eastward tidal velocity"}), "is tides alone"),
    "an anomaly": (lambda d: with_attrs(d, uo={"long_name": "eastward velocity anomaly"}), "is an anomaly"),
    "too slow": (lambda d: both(d, lambda one: one * 1e-4), "nowhere above"),
    "too fast": (lambda d: both(d, lambda one: one * 20), "as fast as"),
    "a flag without meanings": (
        lambda d: d.assign(QCflag=(("lat", "lon"), np.ones((LAT.size, LON.size), np.int8))),
        "`QCflag` beside the currents does not say what its numbers mean",
    ),
}


@pytest.mark.parametrize("case", DOUBTS)
def test_doubts_are_noted(tmp_path, case):
    change, words = DOUBTS[case]
    notes = read_currents(written(tmp_path, change(dataset()))).notes
    assert any(words in note for note in notes), notes
    plain = read_currents(written(tmp_path, dataset(), "plain.nc")).notes
    assert not any(words in note for note in plain)


def test_a_scale_factor_left_over_on_floats_is_noted(tmp_path):
    packing = {name: {"dtype": "float32", "scale_factor": 1e-3} for name in ("uo", "vo")}
    data = both(dataset(), lambda one: one * 1e-3)
    notes = read_currents(written(tmp_path, data, encoding=packing)).notes
    assert any("`scale_factor` 0.001 was applied to data that are not integers" in note for note in notes)


@pytest.mark.parametrize("how", ["values", "masks"])
def test_values_that_flags_call_bad_are_no_data(tmp_path, how):
    flag = np.ones((LAT.size, LON.size), np.int8)
    flag[:, 7:] = 4
    meanings = {
        "values": {
            "flag_values": np.arange(1, 5, dtype=np.int8),
            "flag_meanings": "good probably_good not_evaluated bad",
        },
        "masks": {"flag_masks": np.array([1, 4], np.int8), "flag_meanings": "checked failed_test"},
    }
    data = dataset().assign(QCflag=(("lat", "lon"), flag, meanings[how]))
    file = read_currents(written(tmp_path, data))
    assert sample(file, 20.5, 60.5, 20.0) == pytest.approx(current(20.5, 60.5, 20.0), abs=1e-3)
    assert sample(file, 20.9, 60.5, 20.0) is None
    assert any("no data by `QCflag`" in note for note in file.notes)
    assert sample(read_currents(tmp_path / "currents.nc", {"quality": "none"}), 20.9, 60.5, 20.0) is not None


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("m s^{-1}", 1.0),
        ("m·s-1", 1.0),
        ("m s⁻¹", 1.0),
        ("km/h", 1 / 3.6),
        ("km h-1", 1 / 3.6),
        ("cm s-1", 0.01),
        ("m.s**-1", 1.0),
        ("meter/sec", 1.0),
        ("mm/s", 1e-3),
        ("knots", 1852 / 3600),
        ("m", None),
        ("m s", None),
        ("degC", None),
    ],
)
def test_units_of_speed(unit, factor):
    assert in_metres_per_second(unit) == (factor if factor is None else pytest.approx(factor))


def croco():
    """CROCO's attributes: names with the points, levels as attributes of the file, a time without an origin."""
    levels = 20
    s = (np.arange(levels) + 0.5) / levels - 1
    c = (1 - np.cosh(4 * s)) / (np.cosh(4.0) - 1)
    z = 200.0 * (10 * s + 200.0 * c) / 210.0
    lon, lat = np.meshgrid(LON, LAT)
    dims = ("time", "s_rho", "eta_rho", "xi_rho")
    parts = []
    for n, letter in enumerate("xy"):
        values = np.broadcast_to(np.array(current(lon, lat, -z[:, None, None])[n]), (2, levels, *lon.shape))
        where = f"sea_water_{letter}_velocity_at_{'uv'[n]}_location"
        parts.append((dims, values, {"units": "meter second-1", "standard_name": where}))
    return xr.Dataset(
        {
            "u": parts[0],
            "v": parts[1],
            "h": (("eta_rho", "xi_rho"), np.full(lon.shape, 200.0), {"units": "meter"}),
            "lon_rho": (("eta_rho", "xi_rho"), lon, {"units": "degree_east"}),
            "lat_rho": (("eta_rho", "xi_rho"), lat, {"units": "degree_north"}),
        },
        {"time": ("time", [3600.0, 7200.0], {"units": "second"})},
        {"sc_r": s, "Cs_r": c, "hc": 10.0, "VertCoordType": "NEW"},
    )


def test_croco_with_its_attributes(tmp_path):
    path = written(tmp_path, croco())
    with pytest.raises(InputError, match="set `origin` in `names`, the date from which they count"):
        read_currents(path)
    file = read_currents(path, {"origin": "2024-11-20T00:00"})
    assert file.times[0] == np.datetime64("2024-11-20T01:00")
    assert sample(file, 20.5, 60.5, 50.0, "2024-11-20T01:30") == pytest.approx(
        current(20.5, 60.5, 50.0), abs=5e-3
    )


def moved(data, name, **attrs):
    data[name].attrs = attrs
    return data


SOUND = {
    "Unit for units on time": lambda: moved(
        dataset(hours=[0.0, 3.0]), "time", Unit="hours since 2024-11-20 00:00:00"
    ),
    "a scalar that cannot be decoded": lambda: dataset(hours=[0.0, 3.0]).assign_coords(
        tau=((), 0.0, {"units": "hours since analysis", "time_origin": "x"})
    ),
    "level faces without centres": lambda: (
        dataset(hours=[0.0, 3.0], depth=[5.0, 15.0, 25.0, 35.0])
        .drop_vars("depth")
        .assign(w_dep=("w", np.array([0.0, 10.0, 20.0, 30.0, 40.0]), {"units": "m"}))
    ),
    "a run of lead times": lambda: (
        dataset(hours=[0.0, 3.0])
        .rename(time="step")
        .assign_coords(
            step=("step", [0.0, 3.0], {"units": "hours", "standard_name": "forecast_period"}),
            reference_time=(
                (),
                0.0,
                {"units": "hours since 2024-11-20", "standard_name": "forecast_reference_time"},
            ),
        )
    ),
    "two-dimensional valid times": lambda: (
        dataset(hours=[0.0, 3.0])
        .rename(time="lead")
        .expand_dims(run=[0.0])
        .assign_coords(
            lead=("lead", [0.0, 3.0], {"units": "hours", "standard_name": "forecast_period"}),
            run=("run", [0.0], {"units": "hours since 2024-11-20", "standard_name": "forecast_reference_time"}),
            valid_time=(
                ("run", "lead"),
                [[0.0, 3.0]],
                {"units": "hours since 2024-11-20", "standard_name": "time"},
            ),
        )
    ),
}


@pytest.mark.parametrize("case", SOUND)
def test_sound_files_are_read(tmp_path, case):
    file = read_currents(written(tmp_path, SOUND[case]()))
    assert at_hours(file, 1.5) == pytest.approx(current(20.5, 60.5, 20.0, 1.5), abs=1e-3)


def test_one_of_several_runs_and_members(tmp_path):
    early, late = dataset(hours=[0.0, 3.0]), both(dataset(hours=[12.0, 15.0]), lambda one: one)
    late = late.assign_coords(time=early.time)
    runs = xr.concat([early, late], "run").rename(time="lead")
    runs = runs.assign_coords(
        lead=("lead", [0.0, 3.0], {"units": "hours", "standard_name": "forecast_period"}),
        run=("run", [0.0, 12.0], {"units": "hours since 2024-11-20", "standard_name": "forecast_reference_time"}),
    )
    path = written(tmp_path, runs)
    with pytest.raises(
        InputError, match=r"holds 2 runs of a forecast along `run`, 2024-11-20T00:00:00Z to .* `run`"
    ):
        read_currents(path)
    for said in (1, "2024-11-20T12:00"):
        file = read_currents(path, {"run": said})
        assert at_hours(file, 13.5) == pytest.approx(current(20.5, 60.5, 20.0, 13.5), abs=1e-3)
    members = xr.concat([dataset(), both(dataset(), lambda one: 2 * one)], "number").assign_coords(number=[4, 7])
    path = written(tmp_path, members, "members.nc")
    with pytest.raises(InputError, match="2 members along `number`, 4 to 7: set `member`"):
        read_currents(path)
    u, v = current(20.5, 60.5, 20.0)
    assert sample(read_currents(path, {"member": 7}), 20.5, 60.5, 20.0) == pytest.approx((2 * u, 2 * v), abs=1e-3)
    with pytest.raises(InputError, match="holds no member 1"):
        read_currents(path, {"member": 1})


def test_longitudes_that_go_round_more_than_once(tmp_path):
    lon = np.arange(20.0, 420.1, 1.0)
    u = np.sin(np.radians(lon)) * np.ones((LAT.size, 1))
    data = xr.Dataset(
        {"u": (("lat", "lon"), u, {"units": "m/s"}), "v": (("lat", "lon"), 0.1 + 0 * u, {"units": "m/s"})},
        {"lat": ("lat", LAT), "lon": ("lon", lon)},
    )
    file = read_currents(written(tmp_path, data))
    for east in (10.5, 19.5, 20.5, 200.5, 359.5):
        assert sample(file, east, 60.5, 0.0) == pytest.approx((np.sin(np.radians(east)), 0.1), abs=1e-3)


def test_a_group_of_a_file(tmp_path):
    data = dataset()
    data.drop_vars(["lat", "lon", "depth"]).to_netcdf(tmp_path / "g.nc", engine="h5netcdf", group="model/ocean")
    data[["lat", "lon"]].to_netcdf(tmp_path / "g.nc", engine="h5netcdf", mode="a", group="model")
    data[["depth"]].to_netcdf(tmp_path / "g.nc", engine="h5netcdf", mode="a")
    assert sample(read_currents(tmp_path / "g.nc"), 20.5, 60.5, 20.0) == pytest.approx(
        current(20.5, 60.5, 20.0), abs=1e-3
    )
    both(data, lambda one: one / 2).to_netcdf(tmp_path / "g.nc", engine="h5netcdf", mode="a", group="other")
    with pytest.raises(InputError, match="grids in 2 groups, model/ocean, other: set `group`"):
        read_currents(tmp_path / "g.nc")
    u, v = current(20.5, 60.5, 20.0)
    assert sample(read_currents(tmp_path / "g.nc", {"group": "other"}), 20.5, 60.5, 20.0) == pytest.approx(
        (u / 2, v / 2), abs=1e-3
    )
    with pytest.raises(InputError, match="holds no group `sea`"):
        read_currents(tmp_path / "g.nc", {"group": "sea"})


def test_files_of_one_step_without_time(tmp_path):
    steps = [written(tmp_path, dataset(hours=[h]).isel(time=0, drop=True), f"{h:g}.nc") for h in (0.0, 6.0, 12.0)]
    with pytest.raises(InputError, match=r"set `origin` .the date of the first. and `step`"):
        read_currents(steps)
    file = read_currents(steps, {"origin": "2024-11-20T00:00", "step": 6})
    assert at_hours(file, 9.0) == pytest.approx(current(20.5, 60.5, 20.0, 9.0), abs=1e-3)
    with pytest.raises(InputError, match="set `origin`"):
        read_currents(steps, {"step": 6})


def test_zarr_without_consolidated_metadata_warns_of_nothing(tmp_path):
    pytest.importorskip("zarr")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dataset().to_zarr(tmp_path / "currents.zarr", consolidated=False)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        file = read_currents(tmp_path / "currents.zarr")
    assert not found, [str(one.message) for one in found]
    assert sample(file, 20.5, 60.5, 20.0) == pytest.approx(current(20.5, 60.5, 20.0), abs=1e-3)


@pytest.mark.parametrize("key", ["u", "lon", "lat", "depth", "time", "mask", "bottom", "quality"])
def test_a_name_that_no_file_holds_is_an_error(tmp_path, key):
    path = written(tmp_path, dataset(hours=[0.0, 1.0]))
    names = {key: "nosuch"} | ({"v": "vo"} if key == "u" else {})
    with pytest.raises(
        InputError, match=f"currents.nc holds no variable `nosuch`, which `{key}` names; it holds: "
    ):
        read_currents(path, names)


def test_a_name_that_is_not_a_coordinate_of_the_current_is_an_error(tmp_path):
    data = dataset().assign(other=("other", np.arange(3.0)))
    with pytest.raises(
        InputError, match=r"`depth` = 'other' is not a coordinate of `uo` in currents.nc, which has 'depth"
    ):
        read_currents(written(tmp_path, data), {"depth": "other"})


def test_one_level_is_held_at_all_depths_by_the_users_word(tmp_path):
    path = written(tmp_path, dataset(depth=[0.5]))
    with pytest.raises(InputError, match='set `hold` = "all" in `names` to hold its one level at all depths'):
        read_currents(path, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 300.0))
    file = read_currents(path, {"hold": "all"}, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 300.0))
    assert sample(file, 20.5, 60.5, 250.0) == pytest.approx(current(20.5, 60.5, 0.5), abs=1e-3)
    assert "held at all depths, as you say" in file.took["levels"]
    with pytest.raises(InputError, match="is for files of one level"):
        read_currents(written(tmp_path, dataset(), "many.nc"), {"hold": "all"})


OTHERS = {
    "currents.grib2": (b"GRIB\0\0\0\2" + bytes(100), "cdo -f nc4 copy"),
    "chart.tif": (b"II*\0" + bytes(100), "gdal_translate"),
    "currents.nc.gz": (gzip.compress(b"CDF"), "gunzip"),
    "chart.asc": (b"ncols 3\nnrows 3\n", "gdal_translate"),
    "scan.hdf": (b"\x0e\x03\x13\x01" + bytes(100), "h4tonccf"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_formats_name_the_tool_that_converts_them(tmp_path, name):
    content, words = OTHERS[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_currents(tmp_path / name)
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        archive.writestr("a.nc", "CDF")
    with pytest.raises(InputError, match="unzip"):
        read_currents(tmp_path / "all.zip")


def test_an_error_of_our_own_is_not_reported_as_damage(tmp_path, capsys, monkeypatch):
    """Exit code 3, one line, and the trace where it is asked for; a truncated file is still exit code 2."""
    path = written(tmp_path, dataset())
    with monkeypatch.context() as patched:
        patched.setattr(component, "signs_of", lambda *_: np.zeros(3).reshape(2, 2))
        told = command(capsys, "describe", path)
        assert told.code == 3
        assert "this is an error of the program, not of your input: ValueError: cannot reshape" in told.err
        assert "damaged" not in told.err
        assert len(told.err.splitlines()) == 1
        patched.setenv("GLIDER_STREAM_TRACE", "1")
        with pytest.raises(ValueError, match="cannot reshape"):
            command(capsys, "describe", path)
    (tmp_path / "half.nc").write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match="truncated or damaged"):
        read_currents(tmp_path / "half.nc")


@pytest.mark.parametrize(
    ("unit", "metres"), [("m", 1.0), ("km", 1e3), ("100 km", 1e5), ("100  km", 1e5), ("feet", None)]
)
def test_the_unit_of_a_plane(tmp_path, unit, metres):
    """An Arctic forecast counts its plane in units of 100 km."""
    pyproj = pytest.importorskip("pyproj")
    plane = pyproj.Proj("+proj=stere +lat_0=90 +lat_ts=90 +lon_0=-45 +R=6378273")
    x, y = (at + 1e4 * np.arange(-6.0, 7.0) for at in plane(20.5, 60.5))
    lon, lat = plane(*np.meshgrid(x, y), inverse=True)
    turn = -np.radians(plane.get_factors(lon, lat).meridian_convergence)
    u, v = current(lon, lat)
    parts = u * np.cos(turn) + v * np.sin(turn), v * np.cos(turn) - u * np.sin(turn)
    mapping = {
        "grid_mapping_name": "polar_stereographic",
        "latitude_of_projection_origin": 90.0,
        "straight_vertical_longitude_from_pole": -45.0,
        "standard_parallel": 90.0,
        "earth_radius": 6378273.0,
        "false_easting": 0.0,
        "false_northing": 0.0,
    }
    words = {"units": "m s-1", "grid_mapping": "plane"}
    data = xr.Dataset(
        {
            name: (("y", "x"), part, words | {"standard_name": f"sea_water_{axis}_velocity"})
            for name, part, axis in zip(("vxo", "vyo"), parts, "xy", strict=True)
        }
        | {"plane": ((), 0, mapping)},
        {
            name: (name, at / (metres or 1.0), {"units": unit, "standard_name": f"projection_{name}_coordinate"})
            for name, at in (("x", x), ("y", y))
        },
    )
    path = written(tmp_path, data)
    if metres is None:
        with pytest.raises(
            InputError, match=r"`x` in currents.nc is in 'feet', which is not a known unit of length"
        ):
            read_currents(path)
    else:
        assert sample(read_currents(path), 20.5, 60.5, 0.0) == pytest.approx(current(20.5, 60.5), abs=1e-3)
