"""Depth-averaged currents of dives: closed forms, their errors by many draws, real dives and a real track."""

import csv
import math

import numpy as np
import pytest
from helpers.files import DATA, real
from helpers.small import command, strict_json

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.pilot.dive_files import displacement
from glider_stream.vehicle.averaged_current import (
    SensorErrors,
    averaged_current,
    dead_reckoned,
    horizontal_speed,
)
from glider_stream.water.frame import LocalFrame

HEAD = "t_start,lon_start,lat_start,t_end,lon_end,lat_end"


def dives(folder, head, *rows):
    """A file of dives."""
    file = folder / "dives.csv"
    file.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return file


def test_the_current_is_what_water_at_rest_does_not_explain():
    found = averaged_current(np.array([1000.0, -500.0]), np.array([400.0, 100.0]), 5000.0)
    assert found.current.tolist() == pytest.approx([0.12, -0.12])
    drifted = averaged_current(
        np.array([1000.0, -500.0]), np.array([400.0, 100.0]), 5000.0, surface=600.0, drift=np.array([0.5, 0.0])
    )
    assert drifted.current.tolist() == pytest.approx([0.06, -0.12])
    # without a known drift the surface moves as the current that is asked for
    unknown = averaged_current(np.array([1000.0, -500.0]), np.array([400.0, 100.0]), 4400.0, surface=600.0)
    assert unknown.current.tolist() == pytest.approx([0.12, -0.12])


def test_errors_are_those_of_many_draws():
    rng = np.random.default_rng(3)
    errors = SensorErrors(fix=40.0, speed=0.06, heading=math.radians(4.0), drift=0.2)
    through, over, drift, below, surface = (
        np.array([3000.0, -1500.0]),
        np.array([3500.0, -900.0]),
        0.1,
        9000.0,
        500.0,
    )
    known = {"surface": surface, "drift": np.array([drift, drift]), "errors": errors}
    found = averaged_current(over, through, below, **known)
    draws = []
    for _ in range(4000):
        share, turn = 1 + errors.speed * rng.standard_normal(), errors.heading * rng.standard_normal()
        c, s = math.cos(turn), math.sin(turn)
        flown = share * np.array([through[0] * c - through[1] * s, through[0] * s + through[1] * c])
        fixes = errors.fix * (rng.standard_normal(2) - rng.standard_normal(2))
        there = known | {"drift": known["drift"] + errors.drift * rng.standard_normal(2)}
        draws.append(averaged_current(over + fixes, flown, below, **there).current)
    assert np.std(draws, axis=0) == pytest.approx(found.error, rel=0.05)


def test_dead_reckoning_of_a_circle_and_of_a_line():
    time = np.linspace(0.0, 6000.0, 601)
    around = dead_reckoned(time, 2 * np.pi * time / 6000.0, np.full(601, 0.3))
    assert np.abs(around).max() < 1e-9
    east = dead_reckoned(time, np.full(601, np.pi / 2), np.full(601, 0.3))
    assert east == pytest.approx([1800.0, 0.0])


def test_the_speed_of_a_glide_and_no_speed_in_a_turn():
    pitch = np.radians([-20.0, 20.0, 20.0, 1.0])
    speed = horizontal_speed(np.array([-0.2, 0.2, -0.2, 0.2]), pitch, math.radians(3.0))
    assert speed[:2] == pytest.approx(0.2 / math.tan(math.radians(23.0)))
    assert np.isnan(speed[2:]).all()


@pytest.mark.parametrize("middle", [(18.5, 38.0), (179.999, -43.0), (-0.001, 70.0)])
def test_all_ways_to_say_the_way_through_water_agree(tmp_path, middle):
    lon, lat = middle
    frame = LocalFrame(lon, lat)
    (east,), (north,) = frame.to_lonlat([1500.0], [2200.0])
    (reckoned_lon,), (reckoned_lat,) = frame.to_lonlat([600.0], [2500.0])
    fixes = "2024-11-20T12:00", lon, lat, "2024-11-20T13:30Z", (east + 180) % 360 - 180, north
    bearing, speed = math.degrees(math.atan2(600.0, 2500.0)), math.hypot(600.0, 2500.0) / 5400
    for names, values in (
        ("east,north", (600.0, 2500.0)),
        ("dr_lon,dr_lat", ((reckoned_lon + 180) % 360 - 180, reckoned_lat)),
        ("heading,horizontal", (bearing - 7.0, speed)),
    ):
        file = dives(tmp_path, f"{HEAD},{names}", (*fixes, *values))
        (dive,) = planner.currents(file, declination=7.0).dives
        assert dive.averaged.current == pytest.approx([900 / 5400, -300 / 5400], abs=2e-4), names


@real
def test_real_dives_with_their_way_through_water(tmp_path):
    """The file holds no heading: the recorded current gives the way through water, as a dead-reckoned place.

    So this checks times, places, signs and the reading, to what a vehicle's rounded degrees allow; not the speed.
    """
    rows = list(csv.DictReader((DATA / "seaglider_sg542_saz_dac.csv").read_text().splitlines()))
    made = []
    for row in rows:
        start, end = ((float(row[f"lon_{side}"]), float(row[f"lat_{side}"])) for side in ("start", "end"))
        seconds = float(row["t_end_unix"]) - float(row["t_start_unix"])
        recorded = np.array([float(row["dac_east_mps"]), float(row["dac_north_mps"])])
        east, north = displacement(start, end) - recorded * seconds
        frame = LocalFrame(*start)
        (lon,), (lat,) = frame.to_lonlat([east], [north])
        made.append((*row.values(), round(lon, 4), round(lat, 4)))
        # a recorded mean speed is no shorter than the way it leads, since headings vary
        assert math.hypot(east, north) / seconds < float(row["mean_horz_speed_mps"])
    found = planner.currents(dives(tmp_path, ",".join([*rows[0], "dr_lon", "dr_lat"]), *made))
    off = [dive.as_dict()["off_the_recorded_mps"] for dive in found.dives]
    assert len(off) == 14
    assert max(off) < 0.002


@real
def test_a_real_track_has_currents_that_last_from_dive_to_dive():
    found = planner.currents(DATA / "seaexplorer_track_dfo-eva035-20190721.nc", declination=16.5)
    currents = np.array([dive.averaged.current for dive in found.dives])
    errors = np.array([dive.averaged.error for dive in found.dives])
    assert len(currents) == 12
    assert (np.hypot(*currents.T) < 0.4).all()
    assert (errors[1:] < 0.035).all()
    # the vehicle turned by 110 degrees after the sixth dive; the current did not
    assert np.abs(currents[6] - currents[5]).max() < 0.1
    magnetic = planner.currents(DATA / "seaexplorer_track_dfo-eva035-20190721.nc")
    turned = np.array([dive.averaged.current for dive in magnetic.dives])
    assert np.abs(turned[6] - turned[5]).max() > 0.2


FIXES = "2024-11-20T12:00", 18.5, 38.0, "2024-11-20T13:30", 18.51, 38.02


@pytest.mark.parametrize(
    ("head", "row", "said"),
    [
        (HEAD, FIXES, "does not say the way through water"),
        (f"{HEAD},heading", (*FIXES, 90), "`horizontal` is missing"),
        (f"{HEAD},east,north", (*FIXES, 100, "x"), "north = 'x' is not a number"),
        (f"{HEAD},east,north", (*FIXES[:3], "2024-11-20T11:30", *FIXES[4:], 1, 2), "not after its begin"),
        (f"{HEAD},east,north", (0, *FIXES[1:], 1, 2), "give each dive its fixes"),
        (f"{HEAD},east,north", (FIXES[0], 18.5, 138.0, *FIXES[3:], 1, 2), "no such angle"),
        (f"{HEAD},east,north", ("noon", *FIXES[1:], 1, 2), "neither seconds since 1970"),
        (f"{HEAD},east,north", (*FIXES, 4e7, 0), "check them and the times"),
        (f"{HEAD.replace('t_end', 'stop')},east,north", (*FIXES, 1, 2), "no column `t_end`"),
    ],
)
def test_dives_that_say_too_little_are_refused(tmp_path, head, row, said):
    with pytest.raises(InputError, match=said):
        planner.currents(dives(tmp_path, head, row))


@real
def test_the_command_and_its_files(tmp_path, capsys):
    said = command(capsys, "currents", DATA / "seaglider_sg542_saz_dac.csv")
    assert (said.code, "`heading` is missing" in said.err) == (2, True)
    file = dives(tmp_path, f"dive,{HEAD},east,north,dac_east,dac_north", ("a", *FIXES, 500, 1800, 0.07, 0.08))
    said = command(capsys, "currents", file, "-o", tmp_path / "out.csv", "--json")
    (dive,) = strict_json(said.out)["dives"]
    (row,) = csv.DictReader((tmp_path / "out.csv").read_text().splitlines())
    assert float(row["east_mps"]) == dive["east_mps"]
    assert dive["time"] == "2024-11-20T12:45:00Z"
    assert command(capsys, "currents", file, "-o", tmp_path / "out.txt").code == 2
    assert "+-" in command(capsys, "currents", file).out
