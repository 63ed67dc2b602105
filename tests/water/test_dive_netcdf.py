"""NetCDF files of gliders: Seaglider, IOOS profiles, Slocum and pyglider time series."""

import numpy as np
import pytest
import xarray as xr

from glider_stream.base.errors import InputError
from glider_stream.water.mapping.observation_files import read_dives

NOON = 1_732_104_000.0  # 2024-11-20T12:00Z


def saved(folder, data, name="dive.nc"):
    data.to_netcdf(folder / name, engine="h5netcdf")
    return folder / name


def seaglider(qc=b"1", **changes):
    values = {
        "depth_avg_curr_east": ((), 0.093, {"units": "m/s"}),
        "depth_avg_curr_north": ((), 0.175, {"units": "m/s"}),
        "depth_avg_curr_error": ((), 0.0135, {"units": "m/s"}),
        "depth_avg_curr_qc": ((), qc),
        "log_gps_lat": ("gps_info", [-43.05, -43.0711, -43.0667]),
        "log_gps_lon": ("gps_info", [8.5, 8.49028, 8.46013]),
        "log_gps_time": (
            "gps_info",
            NOON + np.array([-900.0, 0.0, 4856.0]),
            {"units": "seconds since 1970-1-1 00:00:00"},
        ),
        "ctd_depth": ("sg_data_point", [1.0, 500.0, np.nan, 1010.4, 3.0], {"units": "meters"}),
    }
    return xr.Dataset(values | changes)


def test_a_seaglider_dive(tmp_path):
    found = read_dives(saved(tmp_path, seaglider()))
    assert found.count == 1
    assert (found.lon[0], found.lat_end[0]) == (8.49028, -43.0667)
    assert str(found.start[0]) == "2024-11-20T12:00:00.000"
    assert (found.end - found.start)[0] == np.timedelta64(4_856_000, "ms")
    assert (found.bottom[0], found.east[0], found.north[0], found.error[0]) == (1010.4, 0.093, 0.175, 0.0135)


def test_a_bad_flag_and_a_strange_unit(tmp_path):
    with pytest.raises(InputError, match=r"dive\.nc holds no good current \(`depth_avg_curr_east`\)"):
        read_dives(saved(tmp_path, seaglider(qc=b"4")))
    slow = seaglider(depth_avg_curr_east=((), 9.3, {"units": "cm/s"}))
    assert read_dives(saved(tmp_path, slow)).east[0] == pytest.approx(0.093)
    wrong = seaglider(depth_avg_curr_east=((), 9.3, {"units": "degC"}))
    with pytest.raises(
        InputError, match=r"`depth_avg_curr_east` in dive\.nc is in 'degC', which is not a known unit"
    ):
        read_dives(saved(tmp_path, wrong))


def profile(n, u=0.1, when=NOON, flag=1):
    since = "seconds since 1970-01-01T00:00:00Z"
    data = xr.Dataset(
        {
            "u": ((), u, {"units": "m s-1"}),
            "v": ((), -0.2, {"units": "m s-1"}),
            "u_qc": ((), np.int8(flag)),
            "time_uv": ((), when, {"units": since}),
            "lat_uv": ((), 40.0 + 0.1 * n, {"units": "degrees_north"}),
            "lon_uv": ((), -70.0, {"units": "degrees_east"}),
            "depth": ("time", [2.0, 150.0 + n, 80.0]),
        },
        {"time": ("time", when + np.array([0.0, 1.0, 2.0]), {"units": since})},
    )
    for name in ("u", "v", "lat_uv", "lon_uv"):
        data[name].encoding["_FillValue"] = -999.0
    return data


def test_ioos_profiles_of_one_dive_count_once(tmp_path):
    files = [
        saved(tmp_path, profile(0), "a.nc"),
        saved(tmp_path, profile(0), "b.nc"),  # the climb of the same dive
        saved(tmp_path, profile(3, when=NOON + 7200), "c.nc"),
    ]
    found = read_dives(files)
    assert found.count == 2
    assert found.bottom.tolist() == [150.0, 153.0]
    assert (found.lat_end == found.lat).all()
    assert "a.nc does not say where dives start and end: each is taken to stay at lat_uv, lon_uv" in found.notes
    for bad in (profile(0, u=np.nan), profile(0, flag=4)):
        with pytest.raises(InputError, match="holds no good current"):
            read_dives(saved(tmp_path, bad))


def slocum(names=("m_final_water_vx", "m_final_water_vy"), filled=False):
    """Three dives with a surfacing of five samples after each; the third ends before its current is reported."""
    depth, report, clock = [0.5] * 5, [np.nan] * 5, list(np.arange(5) * 20.0)
    for dive in range(3):
        down = np.concatenate([np.linspace(5, 100 + dive, 20), np.linspace(95, 5, 20)])
        depth += [*down, *[0.4] * 5]
        clock += list(clock[-1] + 30.0 * np.arange(1, 41)) + list(clock[-1] + 1200 + 60.0 * np.arange(1, 6))
        report += [np.nan] * 42 + [0.1 * (dive + 1) if dive < 2 else np.nan] + [np.nan] * 2
    clock, report = NOON + np.array(clock), np.array(report)
    if filled:
        known = np.isfinite(report)
        report = np.interp(clock, clock[known], report[known])
    share = np.arange(clock.size) / clock.size
    return xr.Dataset(
        {
            names[0]: ("time", report, {"units": "m s-1"}),
            names[1]: ("time", -report, {"units": "m s-1"}),
            "depth": ("time", depth, {"units": "m"}),
            "longitude": ("time", -125.0 + 0.1 * share),
            "latitude": ("time", 48.0 + 0.05 * share),
        },
        {"time": ("time", clock, {"units": "seconds since 1970-01-01"})},
    )


@pytest.mark.parametrize(
    "names", [("m_final_water_vx", "m_final_water_vy"), ("water_velocity_eastward", "water_velocity_northward")]
)
@pytest.mark.parametrize("filled", [False, True])
def test_a_slocum_series(tmp_path, names, filled):
    found = read_dives(saved(tmp_path, slocum(names, filled)))
    assert found.east[:2] == pytest.approx([0.1, 0.2], abs=0.01 if filled else 1e-12)
    assert found.north == pytest.approx(-found.east)
    assert found.bottom[:2].tolist() == [100.0, 101.0]
    assert (found.start < found.end).all()
    assert (found.end[:1] <= found.start[1:2]).all()
    # the third dive ends before its report; a program that fills gaps has repeated the second's there
    assert found.count == 2
    assert found.notes == ("1 dives of dive.nc are left out: no new current is reported at their end",)


def test_files_that_cannot_be_used(tmp_path):
    series = slocum()
    packed = series.assign(latitude=series.latitude * 100 + 30)
    for data, sentence in (
        (xr.Dataset({"temperature": ("time", [1.0])}), "holds no current averaged over a dive"),
        (packed, "holds degrees and minutes in one number"),
        (series.drop_vars("depth"), "holds no depth"),
        (series.assign(depth=np.nan * series.depth), r"`depth` in dive\.nc is missing everywhere"),
        (seaglider(log_gps_lon=("gps_info", [8.5, np.nan, 8.4])), "a dive has no longitude in degrees"),
        (series.assign(depth=0 * series.depth + 50.0), "holds no dive from the surface"),
        (seaglider().isel(gps_info=slice(2)), "must hold three fixes"),
        (profile(0).drop_vars("time_uv"), "is one number, and neither log_gps_lat nor time_uv says where"),
    ):
        with pytest.raises(InputError, match=sentence):
            read_dives(saved(tmp_path, data))
    with pytest.raises(InputError, match="columns are named for CSV files"):
        read_dives(saved(tmp_path, series), {"east": "u"})
    (tmp_path / "text.nc").write_text("no")
    with pytest.raises(InputError, match="is not a NetCDF file"):
        read_dives(tmp_path / "text.nc")
