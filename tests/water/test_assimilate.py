"""Forecasts corrected by measurements, maps without a forecast, their files; the commands."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from helpers.currents import DEPTH, DOMAIN, LAT, LON, dataset, written
from helpers.small import command, strict_json

from glider_stream.base.errors import InputError
from glider_stream.water.frame import LocalFrame
from glider_stream.water.mapping.assimilate import assimilate
from glider_stream.water.mapping.mapped import map_currents
from glider_stream.water.mapping.measured import Dives, Drifters, Points
from glider_stream.water.mapping.observation_files import read_dives
from glider_stream.water.ocean import Names, OceanFlow, read_currents
from glider_stream.water.ocean.writing import write_currents

HOURS = [0.0, 6.0, 12.0]
START = np.datetime64("2024-11-20T00:00", "ms")
HOUR = np.timedelta64(3_600_000, "ms")
SCALES = {"speed": 0.1, "length": 15e3, "depth": 60.0, "noise": 0.01}
DIVES = """\
start,end,lon_start,lat_start,lon_end,lat_end,max_depth_m,dac_east_mps,dac_north_mps
2024-11-20T01:00,2024-11-20T03:00,20.45,60.45,20.48,60.46,90,0.40,-0.15
2024-11-20T03:10,2024-11-20T05:00,20.48,60.46,20.51,60.47,90,0.41,-0.14
1732078800,1732086000,20.51,60.47,20.54,60.48,90,0.42,-0.15
"""


def dives(count=3, east=0.1, north=0.0, start=START, step=0.03):
    """Dives that differ from the forecast of `dataset` by a constant, roughly."""
    n = np.arange(count)
    lon, lat = 20.45 + step * n, 60.45 + step / 3 * n
    begin = start + n * HOUR
    # the mean of the current over 0 to 80 m is that at 40 m
    u = 0.3 + 0.1 * (lon + step / 2 - 20.5) - 0.1 * (lat - 60.5) - 0.04 + 0.004 * (n + 0.5) + east
    v = -0.2 + 0.1 * (lon + step / 2 - 20.5) + 0.1 * (lat - 60.5) + 0.02 - 0.003 * (n + 0.5) + north
    at = (lon, lat, lon + step, lat + step / 3, begin, begin + HOUR)
    return Dives(*at, np.full(count, 80.0), u, v, np.full(count, 0.01))


@pytest.fixture
def forecast(tmp_path):
    return read_currents(written(tmp_path, dataset(hours=HOURS)))


def test_a_correction_is_near_the_dives_alone(forecast):
    found = assimilate(forecast, [dives()], SCALES | {"time": 3e5})
    assert found.before == pytest.approx(0.1, abs=0.02)
    assert found.after < 0.02
    change = found.file.u - forecast.u
    # the nearest point is 4 km away, with a length of 15 km
    assert 0.06 < change[0, 2, 5, 5] < 0.11
    assert abs(change[0, 2, 0, 0]) < 0.03
    east, north = found.deviation()
    assert east.shape == north.shape == forecast.u.shape
    assert east[0, 2, 5, 5] < 0.06 < east[0, 2, 0, 0] < 0.1001
    # an hour or a depth without measurements is known less
    assert east[2, 2, 5, 5] > east[0, 2, 5, 5]
    assert found.file.times is forecast.times
    assert (found.file.depth == forecast.depth).all()


def test_dive_by_dive_is_all_at_once(forecast):
    whole = assimilate(forecast, [dives(4)], SCALES | {"time": 3e5})
    parts = assimilate(forecast, [dives(4).take(np.arange(1))], SCALES | {"time": 3e5})
    for n in range(1, 4):
        parts = parts.updated([dives(4).take(np.array([n]))])
    assert parts.map.at.count == 4
    # the planes of both maps are centred on other dives, some km apart
    assert parts.file.u == pytest.approx(whole.file.u, abs=1e-4)
    assert parts.deviation()[1] == pytest.approx(whole.deviation()[1], abs=1e-4)


def test_what_lies_outside_is_left_out_and_said(forecast):
    late, away = dives(2, start=START + 40 * HOUR), dives(2)
    away = Dives(away.lon + 5, away.lat, away.lon_end + 5, *(getattr(away, n) for n in NAMES[3:]))
    found = assimilate(forecast, [dives(), late, away], SCALES | {"time": 3e5})
    assert found.map.at.count == 3
    assert "2 of 2 measurements lie outside the times of currents.nc, 2024-11-20T00:00:00Z to" in str(found)
    assert "2 of 2 measurements lie outside the area of currents.nc" in str(found)
    with pytest.raises(InputError, match=r"no measurement can be compared with currents\.nc: 2 of 2 .* the area"):
        assimilate(forecast, [away])
    untimed = Points(*(np.array([value]) for value in (20.5, 60.5, 10.0)), None, *np.full((3, 1), 0.1))
    with pytest.raises(InputError, match=r"changes with time, .*: give the time of each measurement"):
        assimilate(forecast, [untimed])
    with pytest.raises(InputError, match="the error of a forecast has no constant current"):
        assimilate(forecast, [dives()], {"mean": 0.1})


NAMES = ("lon", "lat", "lon_end", "lat_end", "start", "end", "bottom", "east", "north", "error")


def test_a_forecast_of_one_level_is_corrected_at_all_depths(tmp_path):
    """Its level is held at all depths, so a dive's mean is a measurement of it."""
    forecast = read_currents(written(tmp_path, dataset(depth=None, hours=HOURS)))
    found = assimilate(forecast, [dives(east=0.14)], {"speed": 0.1, "length": 15e3, "time": 3e5, "noise": 0.01})
    assert found.fit.held["depth"] == "currents.nc has one level, which is held at all depths"
    assert (found.file.u - forecast.u)[0, 0, 5, 5] > 0.07
    given = assimilate(forecast, [dives(east=0.14)], SCALES | {"time": 3e5})
    assert given.fit.scales.depth == 60.0


def test_directions_are_the_earths(tmp_path):
    """A current toward east measured far from the frame's centre corrects the current toward east."""
    lon, lat = np.arange(0.0, 30.1, 1.0), np.arange(65.0, 71.1, 1.0)
    data = dataset(lon=lon, lat=lat, depth=DEPTH)
    for name in ("uo", "vo"):
        data[name] = 0 * data[name] + 0.001
    forecast = read_currents(written(tmp_path, data))
    at = np.array([2.0, 28.0]), np.array([68.0, 68.0])
    many = (np.zeros(2), None, np.full(2, 0.201), np.full(2, 0.001), np.full(2, 0.001))
    points = Points(*at, *many)
    found = assimilate(forecast, [points], {"speed": 0.2, "length": 1e5, "depth": 60.0, "noise": 0.001})
    change = np.stack([found.file.u - forecast.u, found.file.v - forecast.v])[:, 0, 0, 3]
    assert change[0, [2, 28]] == pytest.approx(0.2, abs=0.005)
    assert np.abs(change[1, [2, 28]]).max() < 0.005
    assert found.frame.lon == pytest.approx(15.0)
    # 15 degrees of convergence would turn 0.2 m/s by 0.05 m/s
    assert abs(found.frame.convergence(28.0, 68.0)) > 0.2


def test_the_command_writes_a_file_as_any_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    data = dataset(hours=HOURS)
    dry = (data.lon > 20.85) | ((data.lon > 20.65) & (data.depth > 60))
    written(tmp_path, data.where(~dry), "forecast.nc")
    (tmp_path / "dives.csv").write_text(DIVES)
    given = ["--dives", "dives.csv", "--scale", "length=15000", "--members", 2, "--seed", 4]
    said = command(capsys, "assimilate", "forecast.nc", *given, "-o", "better.nc")
    assert (said.code, said.err) == (0, "wrote better.nc, better-members.nc\n")
    assert "corrected by 3 measurements" in said.out
    assert "  length  held: as you say" in said.out
    before, after = (read_currents(name) for name in ("forecast.nc", "better.nc"))
    assert (np.isnan(after.u) == np.isnan(before.u)).all()
    assert np.nanmax(after.u - before.u) > 0.05
    assert (after.seabed == before.seabed).all()
    assert (after.depth == before.depth).all()
    assert (after.times == before.times).all()
    assert after.took["bottom"] == before.took["bottom"]
    with xr.open_dataset("better.nc", engine="h5netcdf") as held:
        assert held.uo_sd.dims == held.uo.dims == ("time", "depth", "latitude", "longitude")
        assert float(held.uo_sd.min()) < 0.7 * float(held.uo_sd.max())
        assert (np.isnan(held.uo_sd) == np.isnan(held.uo)).all()
        assert held.uo.attrs["ancillary_variables"] == "uo_sd"
    refused = command(capsys, "describe", "better-members.nc")
    assert refused.code == 2
    assert "holds 2 members along `member`, 0 to 1: set `member`" in refused.err
    members = [read_currents("better-members.nc", {"member": n}) for n in range(2)]
    spread = np.nanstd(np.stack([member.u - after.u for member in members]))
    assert 0.01 < spread < 0.3
    said = command(capsys, "assimilate", "forecast.nc", *given, "-o", "again.nc", "--json")
    table = strict_json(said.out)
    assert table["fit"]["scales"]["length"] == 15000
    assert table["rms_after_mps"] < table["rms_before_mps"]
    for name in ("better", "better-members"):
        assert Path(f"{name}.nc").read_bytes() == Path(f"{name.replace('better', 'again')}.nc").read_bytes()
    twice = command(capsys, "assimilate", "better.nc", *given, "-o", "twice.nc")
    assert "better.nc was corrected by measurements already: give no measurement twice" in twice.err


def test_a_map_without_a_forecast(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dives.csv").write_text(DIVES)
    fixes = [f"{n % 2},2024-11-20T0{n // 2}:00,{20.4 + 0.02 * n},{60.4 + 0.05 * (n % 2)}" for n in range(8)]
    (tmp_path / "drifters.csv").write_text("\n".join(["id,time,lon,lat", *fixes]))
    area = ["--lon", 20.3, 20.7, "--lat", 60.3, 60.6, "--spacing", 5000, "--depth", 0, "--depth", 50]
    given = ["map", *area, "--dives", "dives.csv", "--drifters", "drifters.csv", "-o", "map.nc"]
    refused = command(capsys, *given)
    assert refused.code == 2
    assert "the measurements are of 2024-11-20T00:00:00Z to 2024-11-20T07:00:00Z: say for which" in refused.err
    said = command(capsys, *given, "--time", "2024-11-20T03:00")
    assert (said.code, said.err) == (0, "wrote map.nc\n")
    assert said.out.startswith("a map, of 9 measurements")
    found = read_currents("map.nc")
    assert found.u.shape == (1, 2, 8, 6)
    assert found.took["stamps"] == "instants, as `cell_methods` says"
    assert found.u[0, 1, 4, 2] == pytest.approx(0.4, abs=0.15)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ([], "there are no measurements; give files of dives, points or drifters"),
        (["--dives", "dives.csv", "--scale", "length"], "'length' is not NAME=NUMBER, such as length=20000"),
        (["--dives", "dives.csv", "--scale", "width=3"], "the scale `width` is not known; choose from: speed"),
        (["--dives", "dives.csv", "--members", "-1"], "`members` must be 0 or more; got -1"),
        (["--dives", "dives.csv", "--kernel", "cubic"], "`kernel` must be one of matern, gaussian; got 'cubic'"),
        (["--dives", "dives.csv", "--inducing", "0"], "`inducing` must be at least 1; got 0"),
        (["--dives", "dives.csv", "--column", "west=u"], "`west` is not known; choose from: lon, lat"),
        (
            ["--dives", "dives.csv", "--points", "p.csv", "--column", "east=u"],
            "columns can be named for one kind",
        ),
        (
            ["--points", "dives.csv"],
            "dives.csv has no column for `lon`, such as lon or longitude; name it, or add it; it has: ",
        ),
        (["--dives", "forecast.nc"], "forecast.nc holds no current averaged over a dive"),
        (["--dives", "nowhere.csv"], "the file of dives nowhere.csv does not exist"),
    ],
)
def test_the_command_refuses_with_the_cure(tmp_path, monkeypatch, capsys, given, sentence):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, dataset(hours=HOURS), "forecast.nc")
    (tmp_path / "dives.csv").write_text(DIVES)
    said = command(capsys, "assimilate", "forecast.nc", *given, "-o", "better.nc")
    assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert sentence in said.err
    assert not (tmp_path / "better.nc").exists()


def test_drifters_are_displacements():
    time = START + np.arange(4) * HOUR
    lon, lat = np.array([20.0, 20.02, 21.0, 21.02]), np.full(4, 60.0)
    moved = Drifters.from_fixes(["a", "a", "b", "b"], lon, lat, time, np.full(4, 15.0), np.full(4, 0.02))
    assert moved.count == 2
    at = moved.observations(LocalFrame(20.5, 60.0), START)
    speed = np.hypot(at.u, at.v)
    # a degree of longitude at 60 N is some 55.8 km
    assert speed == pytest.approx(0.02 * 55_800 / 3600, rel=0.01)
    assert at.t.min() > 0
    assert at.t.max() < 3 * 3600
    assert (at.depth == 15.0).all()
    steady = moved.observations(LocalFrame(20.5, 60.0), None)
    assert steady.values == pytest.approx(at.values)
    assert not steady.t.any()


def test_maps_are_refused_with_the_cure(tmp_path):
    points = Points(np.array([20.0, 20.1]), np.array([60.0, 60.1]), np.zeros(2), None, *np.full((3, 2), 0.1))
    for arguments, sentence in (
        ({"spacing": 1.0, "depth": np.arange(90.0)}, "the map would have .* points, more than 20,000,000"),
        ({"depth": (50.0, 0.0)}, r"the depths of a map must rise from 0 or below; got \[50.0, 0.0\]"),
        ({"lon": (0.0, 60.0)}, "the map is too wide for a flat frame"),
        ({"times": ("2024-11-20",)}, "`times` need measurements with times"),
    ):
        with pytest.raises(InputError, match=sentence):
            map_currents([points], **{"lon": (20.0, 20.2), "lat": (60.0, 60.2), "spacing": 5e3, **arguments})
    with pytest.raises(InputError, match="some measurements have a time and others do not"):
        map_currents([points, dives()], (20.0, 20.2), (60.0, 60.2), 5e3)


@pytest.mark.parametrize("kind", ["curved", "layers", "surface", "no time"])
def test_what_is_written_is_read_again(tmp_path, kind):
    data = dataset(depth=None if kind == "surface" else DEPTH, hours=None if kind == "no time" else HOURS)
    if kind == "curved":
        lon, lat = np.meshgrid(LON, LAT)
        data = data.rename(lat="y", lon="x").drop_vars(["x", "y"])
        places = {"lon": (("y", "x"), lon + 0.1 * (lat - 60)), "lat": (("y", "x"), lat + 0.02 * (lon - 20))}
        data = data.assign_coords(places)
        data.lon.attrs["units"], data.lat.attrs["units"] = "degrees_east", "degrees_north"
    if kind == "layers":
        edges = np.array([0.0, 5.0, 20.0, 40.0, 60.0, 85.0, 115.0])
        data = data.assign(depth_bnds=(("depth", "bound"), np.stack([edges[:-1], edges[1:]], axis=-1)))
        data.depth.attrs["bounds"] = "depth_bnds"
        bottom = np.where(LON[None] > 20.7, 75.0, 110.0) + 0 * LAT[:, None]
        data["deptho"] = (("lat", "lon"), bottom, {"standard_name": "sea_floor_depth_below_geoid", "units": "m"})
        data = data.where(data.depth < data.deptho).assign(deptho=data.deptho, depth_bnds=data.depth_bnds)
    before = read_currents(written(tmp_path, data))
    write_currents(before, tmp_path / "again.nc", title="again")
    after = read_currents(tmp_path / "again.nc")
    for name in ("u", "v", "depth", "lower", "seabed"):
        assert getattr(after, name) == pytest.approx(getattr(before, name), nan_ok=True), name
    assert (after.top, after.surface) == (before.top, before.surface)
    assert after.grid.mesh()[0] == pytest.approx(before.grid.mesh()[0])
    assert (after.times is None) == (before.times is None)
    assert before.times is None or (after.times == before.times).all()


def test_a_csv_file_of_dives(tmp_path):
    (tmp_path / "dives.csv").write_text(DIVES)
    found = read_dives(tmp_path / "dives.csv")
    assert found.count == 3
    assert str(found.start[2]) == "2024-11-20T05:00:00.000"
    assert found.bottom.tolist() == [90.0] * 3
    assert found.error.tolist() == [0.02] * 3
    assert not found.notes
    odd = DIVES.replace("dac_east_mps", "here").replace("lon_end", "x")
    (tmp_path / "odd.csv").write_text(odd)
    with pytest.raises(InputError, match=r"odd\.csv has no column for `east`, such as dac_east or"):
        read_dives(tmp_path / "odd.csv")
    named = read_dives(tmp_path / "odd.csv", {"east": "here"})
    assert (named.lon_end == named.lon).all()
    assert named.notes == ("odd.csv does not say where dives end: each is taken to stay where it starts",)
    for change, sentence in (
        (("0.41", "nan"), "line 3 of bad.csv: dac_east_mps = 'nan' is not a number"),
        (("0.41", "41"), "a dive has a current of 41 m/s, above 5; give m/s"),
        (("60.46,90", "99.46,90"), "a dive has a latitude beyond a pole"),
        (("1732078800", "tomorrow"), "line 4 of bad.csv: start must be a time such as"),
    ):
        (tmp_path / "bad.csv").write_text(DIVES.replace(*change))
        with pytest.raises(InputError, match=sentence):
            read_dives(tmp_path / "bad.csv")


def test_dives_that_the_command_currents_writes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rows = ["t_start,lon_start,lat_start,t_end,lon_end,lat_end,east,north,max_depth"]
    rows += [f"2024-11-20T0{n}:00,20.5,60.5,2024-11-20T0{n + 1}:00,20.52,60.5,100,50,80" for n in (1, 2)]
    (tmp_path / "flown.csv").write_text("\n".join(rows))
    assert command(capsys, "currents", "flown.csv", "-o", "dac.csv").code == 0
    found = read_dives("dac.csv")
    assert found.bottom.tolist() == [80.0, 80.0]
    # 1.1 km over ground and 0.1 km through water within an hour
    assert found.east == pytest.approx(0.277, abs=0.01)
    assert str(found.start[0]) == "2024-11-20T01:30:00.000"
    assert (found.error > 0).all()


def test_a_plan_reads_the_member_it_names(tmp_path):
    """The scenario's own reader gives the member that it names."""
    forecast = read_currents(written(tmp_path, dataset(hours=HOURS)))
    found = assimilate(forecast, [dives()], SCALES | {"time": 3e5})
    write_currents(found.file, tmp_path / "better.nc", members=[(m.u, m.v) for m in found.members(2)])
    with pytest.raises(InputError, match=r"`flow\.member` = 1 and `flow\.names\.member` = 0 differ"):
        OceanFlow(("x.nc",), member=1, names=Names(member=0))
    frame = LocalFrame.over(*DOMAIN)
    flows = [
        OceanFlow((str(tmp_path / "better.nc"),), "2024-11-20T01:00", member=n).waters(
            frame, *DOMAIN, (0.0, 80.0)
        )
        for n in range(2)
    ]
    members = [read_currents(tmp_path / "better.nc", {"member": n}) for n in range(2)]
    assert "member 1 of 2 along `member`, as you say" in flows[1][2]
    fastest = [flow.extent.max_speed for flow, _, _ in flows]
    assert fastest[0] != fastest[1]
    for speed, member in zip(fastest, members, strict=True):
        assert speed <= np.hypot(member.u, member.v).max() * 1.0001


def test_a_map_of_a_time_far_from_all_measurements_says_so():
    scales = {"length": 10e3, "time": 6 * 3600.0, "speed": 0.1, "noise": 0.01, "mean": 0.1, "depth": np.inf}
    times = [str(START + hours * HOUR) for hours in (1, 48)]
    found = map_currents([dives()], (20.4, 20.6), (60.4, 60.6), 5e3, times=times, scales=scales)
    (note,) = [note for note in found.notes if "hardly anything" in note]
    assert note.startswith(f"the map of {(START + 48 * HOUR).astype('datetime64[s]')}Z")
    assert "1.88 days off, 7.5 times the scale `time`" in note
