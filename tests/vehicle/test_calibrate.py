"""Calibration: coefficients found again in dives made from the balance of forces; real dives."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from helpers.files import DATA, real
from helpers.small import SCENARIO, command, strict_json
from scipy.optimize import brentq

from glider_stream.base.errors import InputError
from glider_stream.scenario import scenario_from_text
from glider_stream.vehicle.calibration.calibrate import calibrate
from glider_stream.vehicle.calibration.dives import MOST_DIVES, read_dives
from glider_stream.vehicle.calibration.result import CONFIDENCE
from glider_stream.vehicle.polar import polar
from glider_stream.vehicle.presets import glider_from_table

CSV = DATA / "seaglider_sg542_saz_dac.csv"
SPEEDS = ("vertical_speed", "horizontal_speed")


def slocum(alpha, mass, drag_0=7.68, drag_alpha2=537.2229, lift_alpha=385.7546):
    """V [m/s] and gamma [rad] out of the angle of attack: tan(gamma) = D / L needs no solving then."""
    drag, lift = drag_0 + drag_alpha2 * alpha**2, lift_alpha * alpha
    gamma = np.arctan2(drag, lift)
    return np.sqrt(mass * 9.81 * np.sin(gamma) / drag), gamma


def seaglider(alpha, volume, drag=0.011220184, induced_drag=5.7e-6, lift=0.003548134):
    """The same; the dynamic pressure whose forces together are the net weight."""
    degrees = math.degrees(alpha)

    def forces(q):
        area = 1.8**2 * q
        return area * (drag * q**-0.25 + induced_drag * degrees**2), area * lift * degrees

    q = brentq(lambda q: math.hypot(*forces(q)) - 1027.5e-6 * volume * 9.82, 1e-3, 1e5, xtol=1e-12)
    return math.sqrt(2 * q / 1027.5), math.atan2(*forces(q))


def dives(folder, columns, seed, fly, noise=1.0, count=40, attack=(1.5, 3.5), volumes=(210.0, 210.0)):
    """Made dives as CSV: each instrument errs, by 5 mm/s or half a degree."""
    rng = np.random.default_rng(seed)
    alpha, volume = np.radians(rng.uniform(*attack, count)), rng.uniform(*volumes, count)
    speed, gamma = np.array([fly(*one) for one in zip(alpha, volume, strict=True)]).T
    every = {
        "vertical_speed": speed * np.sin(gamma) + noise * 0.005 * rng.standard_normal(count),
        "horizontal_speed": speed * np.cos(gamma) + noise * 0.005 * rng.standard_normal(count),
        "pitch_deg": np.degrees(gamma - alpha) + noise * 0.5 * rng.standard_normal(count),
        "glide_angle_deg": np.degrees(gamma) + noise * 0.5 * rng.standard_normal(count),
        "buoyancy_cc": volume,
        "net_mass_kg": volume * 1.024e-3,
    }
    rows = zip(*(every[name] for name in columns), strict=True)
    text = "\n".join([",".join(columns), *(",".join(f"{value:.9g}" for value in row) for row in rows)])
    (folder / "dives.csv").write_text(text + "\n")
    return read_dives(folder / "dives.csv")


def check_errors(away):
    """Errors in standard errors, of many draws: as a normal variate's."""
    away = np.array(away)
    assert (np.abs(away) < 3).mean() > 0.95
    assert np.abs(away).max() < 4.5
    assert 0.6 < np.sqrt((away**2).mean()) < 1.5


@pytest.mark.slow
@pytest.mark.parametrize(
    "columns", [SPEEDS, ("vertical_speed", "glide_angle_deg"), ("vertical_speed", "pitch_deg")]
)
def test_the_buoyancy_is_found_again(tmp_path, columns):
    away = []
    for seed in range(20):
        found = calibrate(dives(tmp_path, columns, seed, seaglider))
        one = found.parameters["buoyancy"]
        assert (one.before, one.unit) == (150.0, "cc")
        away.append((one.value - 210.0) / one.error)
        assert "only its ratio to the buoyancy is determined" in found.held["drag"]
        assert {"lift", "drag_exponent"} < set(found.held)
    check_errors(away)
    exact = calibrate(dives(tmp_path, columns, 1, seaglider, noise=0.0))
    assert exact.parameters["buoyancy"].value == pytest.approx(210.0, rel=1e-5)
    assert exact.glider.dive_volume == exact.glider.climb_volume
    assert exact.glider.dive_volume == pytest.approx(exact.parameters["buoyancy"].value, rel=1e-12)


@pytest.mark.slow
def test_drag_induced_drag_and_lift_are_found_again_where_pitch_and_buoyancy_are_told(tmp_path):
    truth = {"drag_0": 10.0, "drag_alpha2": 400.0, "lift_alpha": 450.0}
    away = {name: [] for name in truth}
    for seed in range(20):
        made = dives(
            tmp_path,
            (*SPEEDS, "pitch_deg", "net_mass_kg"),
            seed,
            lambda alpha, volume: slocum(alpha, volume * 1.024e-3, **truth),
            attack=(1.8, 6.0),
            volumes=(150.0, 300.0),
        )
        found = calibrate(made, "slocum")
        assert set(found.held) <= {"lift_0", "drag_alpha2"}
        for name, one in found.parameters.items():
            away[name].append((one.value - truth[name]) / one.error)
            assert one.error < 0.3 * one.value
    assert len(away["lift_alpha"]) == len(away["drag_0"]) == 20
    assert len(away["drag_alpha2"]) > 10
    check_errors([one for some in away.values() for one in some])


def test_the_seagliders_coefficients_are_found_exactly_where_nothing_errs(tmp_path):
    truth = {"drag": 0.016, "induced_drag": 8e-6, "lift": 0.0045}
    columns = (*SPEEDS, "pitch_deg", "buoyancy_cc")
    made = dives(
        tmp_path, columns, 0, lambda *one: seaglider(*one, **truth), noise=0.0, count=12, volumes=(100.0, 300.0)
    )
    found = calibrate(made)
    assert set(found.held) == {"drag_exponent"}
    for name, value in truth.items():
        assert found.parameters[name].value == pytest.approx(value, rel=1e-3)
        assert getattr(found.glider, name) == found.parameters[name].value
    assert found.glider.dive_volume == pytest.approx(made.buoyancy.mean(), rel=1e-12)


def test_twice_the_forces_are_the_same_dives(tmp_path):
    """What the output says of ratios is so: nothing recorded tells drag and buoyancy apart."""
    double = {"drag_0": 15.36, "drag_alpha2": 1074.4458, "lift_alpha": 771.5092}
    one = dives(tmp_path, SPEEDS, 3, lambda a, volume: slocum(a, volume * 1.024e-3), attack=(2, 5))
    two = dives(tmp_path, SPEEDS, 3, lambda a, volume: slocum(a, volume * 2.048e-3, **double), attack=(2, 5))
    fits = [calibrate(made, "slocum") for made in (one, two)]
    assert fits[0].parameters["buoyancy"].value == pytest.approx(fits[1].parameters["buoyancy"].value, rel=1e-6)
    assert fits[0].parameters["buoyancy"].value == pytest.approx(210, rel=0.05)


@pytest.mark.parametrize("told", ["phase", "pitch_deg", "vertical_speed"])
def test_dives_and_climbs_have_their_own_buoyancy(tmp_path, told):
    rng, lines = np.random.default_rng(0), ["phase,vertical_speed,horizontal_speed,pitch_deg"]
    for n in range(40):
        phase, sign, volume = (("Dive ", -1, 230.0), ("climb", 1, 180.0))[n % 2]
        alpha = math.radians(rng.uniform(1.5, 3.5))
        speed, gamma = seaglider(alpha, volume)
        down = sign * speed * math.sin(gamma) if told == "vertical_speed" else speed * math.sin(gamma)
        pitch = (sign if told != "vertical_speed" else 1) * math.degrees(gamma - alpha)
        lines.append(f"{phase},{down:.9g},{speed * math.cos(gamma):.9g},{pitch:.9g}")
    text = "\n".join(lines) + "\n"
    (tmp_path / "dives.csv").write_text(text if told == "phase" else text.replace("phase,", "segment,", 1))
    made = read_dives(tmp_path / "dives.csv")
    assert made.took["phase"].startswith(told)
    found = calibrate(made)
    for phase, volume in (("dive", 230.0), ("climb", 180.0)):
        assert found.parameters[f"{phase}_buoyancy"].value == pytest.approx(volume, rel=1e-3)
        assert getattr(found.glider, f"{phase}_volume") == pytest.approx(volume, rel=1e-3)


def recorded():
    table = np.genfromtxt(CSV, delimiter=",", names=True)
    return table["mean_horz_speed_mps"], table["mean_abs_vert_speed_mps"]


@real
@pytest.mark.parametrize("preset", ["seaglider", "slocum"])
def test_real_dives_lie_within_the_uncertainty_shown(preset):
    found = calibrate(read_dives(CSV), preset)
    across, down = recorded()
    assert across.size == 14
    angle = -np.arctan2(down, across)
    speed = found.glider.speed(angle)
    off_vertical, off_horizontal = speed * np.sin(-angle) - down, speed * np.cos(angle) - across
    assert (np.abs(off_vertical) <= found.vertical_within).mean() >= CONFIDENCE
    assert (np.abs(off_horizontal) <= found.horizontal_within).mean() >= CONFIDENCE
    assert found.vertical_within < 0.06
    assert found.horizontal_within < 0.1
    # on the average, far closer
    assert abs(off_vertical.mean()) < 0.005
    assert abs(off_horizontal.mean()) < 0.01
    # the kernels' table reaches every dive
    low, high = (np.degrees(one[0]) for one in (polar(found.glider).shallowest, polar(found.glider).steepest))
    assert low <= np.degrees(-angle).min()
    assert np.degrees(-angle).max() <= high


@pytest.mark.slow
@real
def test_a_real_dive_lies_within_what_the_others_say_of_it(tmp_path):
    header, *rows = CSV.read_text().splitlines()
    across, down = recorded()
    inside = []
    for n in range(14):
        (tmp_path / "others.csv").write_text("\n".join([header, *rows[:n], *rows[n + 1 :]]))
        found = calibrate(read_dives(tmp_path / "others.csv"))
        angle = math.atan2(down[n], across[n])
        speed = float(found.glider.speed(-angle))
        inside.append(abs(speed * math.sin(angle) - down[n]) <= found.vertical_within)
        inside.append(abs(speed * math.cos(angle) - across[n]) <= found.horizontal_within)
    assert sum(inside) >= 27  # of 28; the 99 % would miss one in four times


@real
def test_the_command_writes_a_glider_that_scenarios_take(capsys, tmp_path):
    said = command(capsys, "calibrate", CSV, "-o", tmp_path / "glider.toml")
    assert said.code == 0
    assert "14 dives, vertical = mean_abs_vert_speed_mps, horizontal = mean_horz_speed_mps" in said.out
    assert "phases are not known" in said.out
    assert "not used       dive, t_start_unix" in said.out
    assert "buoyancy       141.02 +- 5.7 cc" in said.out
    text = (tmp_path / "glider.toml").read_text()
    glider = glider_from_table(tomllib.loads(text)["glider"])
    told = strict_json(command(capsys, "calibrate", CSV, "--json").out)
    assert glider.dive_volume == pytest.approx(told["parameters"]["buoyancy"]["value"], rel=1e-12)
    assert told["dives"] == 14
    assert told["parameters"]["buoyancy"]["error"] == pytest.approx(5.7, abs=0.05)
    scenario = scenario_from_text(SCENARIO.replace('[glider]\npreset = "paper"\n', text))
    assert scenario.problem().evaluator.polar.speed.tobytes() == polar(glider).speed.tobytes()


def test_dives_too_flat_for_the_vehicle_and_far_off_are_named(tmp_path):
    made = dives(tmp_path, SPEEDS, 0, lambda a, volume: slocum(a, volume * 1.024e-3), attack=(2, 5))
    found = calibrate(replace(made, vertical=np.where(np.arange(40) == 3, 0.03, made.vertical)), "slocum")
    assert found.flat == (5,)
    assert "too flat       line 5:" in str(found)
    steep = dives(tmp_path, SPEEDS, 0, seaglider)
    odd = replace(steep, vertical=steep.vertical * np.where(np.arange(40) == 7, 1.5, 1.0))
    assert calibrate(odd).outlying == (9,)
    assert "far off        line 9:" in str(calibrate(odd))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must hold a header and one line"),
        ("w,u\n\n,\n", "must hold a header and one line"),
        ("a,b\n1,2\n", "no column of vertical speeds; name it by `vertical`; it has: a, b"),
        ("w,a\n0.1,2\n", "must have a horizontal speed, a pitch or a glide angle; name one; it has: w, a"),
        ("w,u\n0.1,0.2\n", "at least 3 dives; got 1"),
        ("w,u\n0.1,x\n", "line 2 of dives.csv: u = 'x' is not a number"),
        ("w,u\n\n0.1,nan\n", "line 3 of dives.csv: u = 'nan' must lie between 0 and 10"),
        ("w;u\n0,1;0.2\n", "line 2 of dives.csv: w = '0,1' is not a number"),
        ("w,u\n0.1,0.2\n0.0,0.2\n", "line 3 of dives.csv: w = '0.0' is 0, which no dive has"),
        ("w,u\n0.1,-0.2\n", "u = '-0.2' must lie between 0 and 10"),
        ("w,u\n0.1\n", "line 2 of dives.csv has 1 cells, but the header has 2"),
        ("w,u,u\n0.1,0.2,0.2\n", "more than one column `u`"),
        ("w,u,vertical_speed\n0.1,0.2,0.1\n", "more than one column for `vertical`: w, vertical_speed"),
        ("vertical,horizontal,w\n0.1,0.2,0.1\n", "more than one column for `vertical`: vertical, w"),
        ("w,pitch\n0.1,95\n", "pitch = '95' must lie between -90 and 90"),
        ("w,pitch\n-0.1,20\n-0.1,-20\n", "line 2 of dives.csv: w = -0.1 is below 0 in a climb as in a dive"),
        ("w,u,phase\n-0.1,0.2,dive\n0.1,0.2,dive\n", "line 3 of dives.csv: w = 0.1 has another sign"),
        ("w,u,phase\n0.1,0.2,loiter\n", "phase = 'loiter' is not a phase; choose from: dive, down, climb, up"),
        ("w,u,buoyancy_cc,net_mass\n0.1,0.2,150,0.15\n", "a buoyancy in cc and one in kg; leave one out"),
        ("w,u\n" + "0.1,0.2\n" * (MOST_DIVES + 1), "at most 5,000 dives"),
        ("w,u\n" + "9,9\n" * 3, "no buoyancy within a factor of 33 of the preset's fits w, u"),
        ('w,u\n0.1,"' + "0" * 200_000 + '"\n', "cannot be read as CSV: field larger"),
    ],
)
def test_files_without_dives_are_refused(tmp_path, text, words):
    (tmp_path / "dives.csv").write_text(text)
    with pytest.raises(InputError, match=words) as error:
        calibrate(read_dives(tmp_path / "dives.csv"))
    assert "\n" not in str(error.value)


def test_columns_with_other_names(tmp_path, capsys):
    dives(tmp_path, SPEEDS, 0, seaglider)
    path = tmp_path / "dives.csv"
    assert "choose from: seaglider, slocum" in command(capsys, "calibrate", path, "--preset", "paper").err
    path.write_text(path.read_text().replace("vertical_speed", "sink").replace(",", ";"))
    assert command(capsys, "calibrate", path).code == 2
    said = command(capsys, "calibrate", path, "--column", "vertical=sink")
    assert said.code == 0
    assert "vertical = sink" in said.out
    refused = command(capsys, "calibrate", path, "--column", "vertical=none")
    assert refused.code == 2
    assert "no column `none`; it has: sink, horizontal_speed" in refused.err
    assert "`depth` is not known; choose from" in command(capsys, "calibrate", path, "--column", "depth=sink").err
    path.write_bytes(b"w,u\n\xff,1\n")
    assert "cannot be read as CSV" in command(capsys, "calibrate", path).err
    assert "does not exist" in command(capsys, "calibrate", tmp_path / "none.csv").err
