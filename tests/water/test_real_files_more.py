"""More of what real files have: right values, or a sentence with the cure."""

import errno
import os

import numpy as np
import pytest
from helpers.currents import LAT, LON, both, current, dataset, written

from glider_stream.base.errors import InputError
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import grib, opening, read_currents, sample
from glider_stream.water.ocean.bathymetry import read_bathymetry

pytestmark = pytest.mark.slow

xr = pytest.importorskip("xarray")

PLACE = (20.45, 60.45, 20.0)
HOURS = np.array([0.0, 6.0, 12.0])
HOLE = (20.72, 60.72, 20.0)


def holed(value, **attrs):
    """A current with a square that holds `value`."""
    data = dataset()
    hole = (data.lon > 20.65) & (data.lon < 20.85) & (data.lat > 60.65) & (data.lat < 60.85)
    data = both(data, lambda one: one.where(~hole, value))
    for name in ("uo", "vo"):
        data[name].attrs |= attrs
    return data


@pytest.mark.parametrize(
    ("zone", "hours"), [("", 0), (" UTC", 0), ("Z", 0), (" +02:00", -2), (" CET", None), (" UTC+2", None)]
)
def test_the_zone_of_the_date_from_which_times_count(tmp_path, zone, hours):
    data = dataset(hours=HOURS)
    data.time.attrs["units"] = f"hours since 2024-11-20 00:00:00{zone}"
    path = written(tmp_path, data)
    if hours is None:
        with pytest.raises(InputError, match="counts from a date in a zone that cannot be told"):
            read_currents(path)
        return
    found = sample(read_currents(path), *PLACE, "2024-11-20T04:00")
    assert found == pytest.approx(current(*PLACE, 4.0 - hours), abs=1e-3)


@pytest.mark.parametrize("attrs", [{"valid_range": [-5.0, 5.0]}, {"valid_min": -5.0}])
def test_what_lies_outside_the_declared_range_is_no_data(tmp_path, attrs):
    file = read_currents(written(tmp_path, holed(-7.0, **attrs)))
    assert sample(file, *HOLE) is None
    assert sample(file, *PLACE) == pytest.approx(current(*PLACE), abs=1e-3)
    assert any("outside the range that it declares, -5 to" in note for note in file.notes)


def test_a_range_narrower_than_that_of_currents_is_that_of_another_file(tmp_path):
    file = read_currents(written(tmp_path, holed(0.5, valid_min=0.0, valid_max=0.4)))
    assert sample(file, *HOLE) == pytest.approx((0.5, 0.5), abs=1e-3)
    assert any("believed, since the range is narrower" in note for note in file.notes)


@pytest.mark.parametrize(
    "attrs",
    [
        {"valid_range": np.array([-9000, 9000], "i2")},
        {"valid_min": -9.0, "valid_max": 9.0},
        {"valid_range": "0 to 5"},
        {"valid_range": [2.0, -2.0]},
    ],
)
def test_a_range_of_packed_data_is_packed_too_or_is_not(tmp_path, attrs):
    data = dataset()
    for name in ("uo", "vo"):
        data[name].attrs |= attrs
        data[name].encoding = {"dtype": "i2", "scale_factor": 0.001, "_FillValue": -32768}
    file = read_currents(written(tmp_path, data))
    assert sample(file, *PLACE) == pytest.approx(current(*PLACE), abs=1e-3)
    assert not any("declares" in note for note in file.notes)


@pytest.mark.parametrize(("unit", "factor"), [("mm/s", 1e3), ("m/day", 86400.0)])
def test_small_units_make_large_numbers(tmp_path, unit, factor):
    data = both(dataset(), lambda one: 5 * factor * one)
    for name in ("uo", "vo"):
        data[name].attrs["units"] = unit
    found = sample(read_currents(written(tmp_path, data)), *PLACE)
    assert found == pytest.approx([5 * part for part in current(*PLACE)], abs=1e-3)


def test_degrees_toward_west_and_south(tmp_path):
    data = dataset().isel(lon=slice(None, None, -1), lat=slice(None, None, -1))
    turned = data.assign_coords(
        lon=("lon", -data.lon.values + 41.0, {"units": "degrees_west", "standard_name": "longitude"}),
        lat=("lat", -data.lat.values + 121.0, {"units": "degrees_south", "standard_name": "latitude"}),
    )
    file = read_currents(written(tmp_path, turned))
    assert sample(file, PLACE[0] - 41.0, PLACE[1] - 121.0, PLACE[2]) == pytest.approx(current(*PLACE), abs=1e-3)
    assert file.took["lon"] == "lon, counted toward west: its sign is turned"
    contrary = data.assign_coords(lon=("lon", -data.lon.values, {"units": "degrees_west"}))
    with pytest.raises(
        InputError, match=r"in 'degrees_west' and goes down to -21: .* set its unit to 'degrees_east'"
    ):
        read_currents(written(tmp_path, contrary, "contrary.nc"))


@pytest.mark.parametrize("mark", [0.0, -1.0, np.nan])
def test_places_that_are_marks(tmp_path, mark):
    """As a model leaves them where it drops tiles of land."""
    data = dataset().rename(lat="y", lon="x")
    lon, lat = np.meshgrid(LON, LAT)
    gone = np.zeros(lon.shape, dtype=bool)
    gone[:4, :3] = True
    data = data.drop_vars(["x", "y"]).assign(
        nav_lon=(("y", "x"), np.where(gone, mark, lon), {"units": "degrees_east"}),
        nav_lat=(("y", "x"), np.where(gone, mark, lat), {"units": "degrees_north"}),
    )
    file = read_currents(
        written(tmp_path, both(data, lambda one: one.where(xr.DataArray(~gone, dims=("y", "x")), 0)))
    )
    assert sample(file, *PLACE) == pytest.approx(current(*PLACE), abs=1e-3)
    assert any(note.startswith("12 points of `nav_lon` have no") for note in file.notes)


def test_what_falls_dry_is_land(tmp_path):
    """The model leaves the last current that it had there."""
    data = dataset()
    dry = ((data.lon > 20.65) & (data.lat > 60.65)).transpose("lat", "lon")
    data["mask_rho"] = xr.ones_like(dry, dtype=float)
    data["wetdry_mask_rho"] = (~dry).astype(float)
    file = read_currents(written(tmp_path, data))
    assert sample(file, *HOLE) is None
    assert sample(file, *PLACE) == pytest.approx(current(*PLACE), abs=1e-3)


@pytest.mark.parametrize("method", ["maximum", "standard_deviation", "range"])
def test_extremes_over_time_are_no_current(tmp_path, method):
    data = dataset(hours=HOURS)
    data.uo.attrs["cell_methods"] = f"area: mean time: {method}"
    with pytest.raises(
        InputError, match=f"`uo` in currents.nc is the {method} over time.* give a file of instants"
    ):
        read_currents(written(tmp_path, data))


def test_an_address_is_no_file():
    with pytest.raises(InputError, match="is an address: download the file"):
        read_currents("https://server.invalid/dodsC/currents.nc")


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ESTALE, os.strerror(errno.ESTALE)),
        OSError(
            "Can't synchronously read data (file read failed: errno = 116, error message = 'Stale file handle')"
        ),
    ],
)
def test_a_disk_that_fails_is_no_damage_of_the_file(tmp_path, error):
    said = str(opening._damaged(tmp_path / "currents.nc", error))
    assert said.startswith(
        "currents.nc cannot be read: stale file handle; look to its disk or network, then give"
    )


def test_zeros_below_the_models_depth_do_not_slow_the_water_above(tmp_path):
    data = both(dataset(), lambda one: one.where(one.depth < 60.0, 0.0))
    data["deptho"] = (("lat", "lon"), np.full((LAT.size, LON.size), 60.0), {"units": "m"})
    file = read_currents(written(tmp_path, data))
    at_level = current(20.5, 60.5, 50.0)
    assert sample(file, 20.5, 60.5, 58.0) == pytest.approx(at_level, abs=1e-3)
    assert sample(file, 20.5, 60.5, 62.0) is None
    calm = read_currents(tmp_path / "currents.nc", {"zeros": "calm"})
    assert sample(calm, 20.5, 60.5, 58.0) == pytest.approx([0.6 * part for part in at_level], abs=1e-3)


def messages(surface, below):
    """What cfgrib makes of GRIB messages, whose parameter it has no name for; by their keys."""
    data = dataset(depth=[0.0, 50.0, 100.0])
    number = {2: "uo", 3: "vo"}

    def opened(path, keys):
        if not keys:
            return xr.Dataset()
        if keys.get("edition") == 1 or keys["parameterNumber"] not in number:
            return xr.Dataset()
        one = data[number[keys["parameterNumber"]]].assign_attrs(units="unknown", standard_name="unknown")
        parts = {
            "oceanSurface": one.isel(depth=0, drop=True).assign_coords(oceanSurface=0.0),
            "depthBelowSea": one.isel(depth=slice(1, None)).rename(depth="depthBelowSea"),
        }
        kinds = [kind for kind, there in (("oceanSurface", surface), ("depthBelowSea", below)) if there]
        if len(kinds) > 1 and "typeOfLevel" not in keys:
            raise ValueError("multiple values for unique key")
        return parts[keys.get("typeOfLevel", kinds[0])].to_dataset(name="unknown")

    return opened


def test_grib_messages_are_told_by_their_numbers(tmp_path, monkeypatch):
    for surface, below in ((True, True), (False, True), (True, False)):
        monkeypatch.setattr(grib, "_opened", messages(surface, below))
        found = grib.open_grib(tmp_path / "currents.grb2")
        file = read_currents(written(tmp_path, found, f"{surface}{below}.nc"))
        deep = below and current(20.45, 60.45, 75.0)
        assert sample(file, 20.45, 60.45, 75.0) == pytest.approx(deep or current(20.45, 60.45), abs=1e-3)
        if surface and below:
            assert sample(file, 20.45, 60.45, 20.0) == pytest.approx(current(20.45, 60.45, 20.0), abs=1e-3)
            assert list(file.depth) == [0.0, 50.0, 100.0]
    monkeypatch.setattr(grib, "_opened", lambda path, keys: xr.Dataset())
    assert not grib.open_grib(tmp_path / "waves.grb2").data_vars


def test_the_only_band_of_a_picture_is_a_chart_once_its_sense_is_told(tmp_path):
    lon, _ = np.meshgrid(LON, LAT)
    chart = xr.Dataset(
        {"band_data": (("band", "lat", "lon"), (-500.0 - 100 * (lon - 20.5))[None])},
        {
            "band": [1],
            "lat": ("lat", LAT, {"units": "degrees_north"}),
            "lon": ("lon", LON, {"units": "degrees_east"}),
        },
    )
    path, frame = written(tmp_path, chart, "chart.nc"), LocalFrame(20.5, 60.5)
    with pytest.raises(InputError, match="does not say whether it counts up or down: set `positive`"):
        read_bathymetry(path, frame, (20.4, 20.6), (60.4, 60.6))
    bottom = read_bathymetry(path, frame, (20.4, 20.6), (60.4, 60.6), positive="up")
    assert bottom.height == pytest.approx(-500.0 - 100 * (bottom.grid.mesh()[0] - 20.5))
