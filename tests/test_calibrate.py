"""Calibration: known coefficients out of made dives, real dives within the uncertainty shown."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from small import command, strict_json
from test_ocean import DATA, real

from glider_stream.calibrate import CONFIDENCE, calibrate, read_dives
from glider_stream.errors import InputError
from glider_stream.glider import PRESETS, glider_from_table

CSV = DATA / "seaglider_sg542_saz_dac.csv"


def dives(folder, glider, seed, columns, noise=0.01, count=40, volumes=None):
    """Dives of a glider, steep and flat, with some noise: written as CSV."""
    rng = np.random.default_rng(seed)
    angle = np.radians(rng.uniform(22, 44, count))
    volume = np.full(count, math.nan) if volumes is None else rng.uniform(*volumes, count)
    speed = np.empty(count)
    for n in range(count):
        own = glider if volumes is None else replace(glider, dive_volume=volume[n], climb_volume=volume[n])
        speed[n] = float(own.speed(-angle[n]))
    speed *= 1 + noise * rng.standard_normal(count)
    pitch = angle - np.abs(glider.angle_of_attack(-angle))
    every = {
        "vertical_speed": speed * np.sin(angle),
        "horizontal_speed": speed * np.cos(angle),
        "pitch_deg": np.degrees(pitch),
        "glide_angle_deg": np.degrees(angle),
        "buoyancy_cc": volume,
    }
    rows = zip(*(every[name] for name in columns), strict=True)
    text = "\n".join([",".join(columns), *(",".join(f"{value:.9g}" for value in row) for row in rows)])
    (folder / "dives.csv").write_text(text + "\n")
    return folder / "dives.csv"


SPEEDS = ("vertical_speed", "horizontal_speed")


@pytest.mark.parametrize(
    "columns", [SPEEDS, ("vertical_speed", "glide_angle_deg"), ("vertical_speed", "pitch_deg")]
)
def test_the_buoyancy_is_found_again(tmp_path, columns):
    truth = replace(PRESETS["seaglider"], dive_volume=210.0, climb_volume=210.0)
    away = []
    for seed in range(20):
        found = calibrate(read_dives(dives(tmp_path, truth, seed, columns)))
        one = found.parameters["buoyancy"]
        away.append((one.value - 210.0) / one.error)
        assert one.before == 150.0
    assert np.abs(away).max() < 4
    assert 0.4 < np.std(away) < 2.0  # the errors are neither too small nor too large
    exact = calibrate(read_dives(dives(tmp_path, truth, 1, columns, noise=0.0)))
    assert exact.parameters["buoyancy"].value == pytest.approx(210.0, rel=2e-3)


@pytest.mark.parametrize("pitch", [False, True])
def test_the_drag_is_found_again_where_the_buoyancy_is_known(tmp_path, pitch):
    truth = replace(PRESETS["seaglider"], drag=0.016)
    columns = ("vertical_speed", "pitch_deg" if pitch else "horizontal_speed", "buoyancy_cc")
    # pitch of one volume: the angle of attack hardly changes with it
    path = dives(tmp_path, truth, 3, columns, volumes=(150.0, 150.0 + 1e-9) if pitch else (100.0, 300.0))
    found = calibrate(read_dives(path))
    assert found.parameters["drag"].value == pytest.approx(0.016, rel=0.03)
    assert "induced drag" in found.held


@real
def test_real_dives_lie_within_the_uncertainty_shown():
    found = calibrate(read_dives(CSV))
    glider = found.glider
    recorded = np.genfromtxt(CSV, delimiter=",", names=True)
    across, down = recorded["mean_horz_speed_mps"], recorded["mean_abs_vert_speed_mps"]
    assert across.size == 14
    angle = -np.arctan2(down, across)
    speed = glider.speed(angle)
    assert (np.abs(speed * np.sin(-angle) - down) <= found.vertical_within).mean() >= CONFIDENCE
    assert (np.abs(speed * np.cos(angle) - across) <= found.horizontal_within).mean() >= CONFIDENCE
    assert found.vertical_within < 0.06
    assert found.horizontal_within < 0.1
    # on the average, far closer
    assert abs((speed * np.sin(-angle)).mean() - down.mean()) < 0.005
    assert abs((speed * np.cos(angle)).mean() - across.mean()) < 0.01


@real
def test_the_command_writes_a_glider_that_scenarios_take(capsys, tmp_path):
    said = command(capsys, "calibrate", CSV, "-o", tmp_path / "glider.toml")
    assert said.code == 0
    assert "buoyancy" in said.out
    glider = glider_from_table(tomllib.loads((tmp_path / "glider.toml").read_text())["glider"])
    told = strict_json(command(capsys, "calibrate", CSV, "--json").out)
    assert glider.dive_volume == told["parameters"]["buoyancy"]["value"]
    assert told["dives"] == 14
    for preset in ("slocum", "seaglider"):
        assert command(capsys, "calibrate", CSV, "--preset", preset).code == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "from 1 to"),
        ("a,b\n1,2\n", "no column of vertical speeds; name it, out of: a, b"),
        ("w\n0.1\n", "neither horizontal speed nor pitch nor glide angle"),
        ("w,u\n0.1,0.2\n", "3 dives or more; got 1"),
        ("w,u\n0.1,x\n", "line 2 of dives.csv: u = 'x' is no number"),
        ("w,u\n0.1,0.2\n0.0,0.2\n", "line 3 of dives.csv: w is 0"),
        ("w,u\n0.1\n", "u = None"),
        ("w,u\n" + "100,200\n" * 3, "no buoyancy within a factor of 50"),
    ],
)
def test_dives_that_are_none(tmp_path, text, words):
    (tmp_path / "dives.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        calibrate(read_dives(tmp_path / "dives.csv"))


def test_columns_by_another_name(tmp_path, capsys):
    path = dives(tmp_path, PRESETS["seaglider"], 0, SPEEDS)
    assert "choose from: seaglider, slocum" in command(capsys, "calibrate", path, "--preset", "paper").err
    path.write_text(path.read_text().replace("vertical_speed", "sink"))
    assert command(capsys, "calibrate", path).code == 2
    assert command(capsys, "calibrate", path, "--column", "vertical=sink").code == 0
    assert "no column `none`" in command(capsys, "calibrate", path, "--column", "vertical=none").err
    assert "`depth` is no column" in command(capsys, "calibrate", path, "--column", "depth=sink").err
