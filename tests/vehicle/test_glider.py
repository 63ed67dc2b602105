"""Glider models against published coefficients, closed forms and a field model; polars against models."""

from dataclasses import FrozenInstanceError, replace
from math import cos, radians, sin, sqrt, tan

import numpy as np
import pytest

from glider_stream.base.errors import InputError
from glider_stream.kernels.control import (
    CLIMB,
    DIVE,
    angle_of_horizontal_speed,
    glide_speed,
    horizontal_speed,
    vertical_speed,
)
from glider_stream.vehicle.models import Seaglider, SteadyGlide
from glider_stream.vehicle.polar import POLAR_TOLERANCE, glider_sha256, polar
from glider_stream.vehicle.presets import PRESETS, glider_from_table

PAPER, SLOCUM, SEAGLIDER = PRESETS["paper"], PRESETS["slocum"], PRESETS["seaglider"]
GRAVER = replace(PAPER, offset=0.5, ballast_max=1.0)
COEFFICIENTS = {
    "model": "steady-glide",
    "gravity": 9.81,
    "angles": [15, 45],
    "drag_0": 7.19,
    "drag_alpha2": 386.29,
    "lift_0": -0.36,
    "lift_alpha": 440.99,
    "offset": 0.25,
    "ballast_max": 0.55,
}
ASYMMETRIC = glider_from_table(COEFFICIENTS)
MODELS = {**PRESETS, "asymmetric": ASYMMETRIC}
every_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())


def signed_angles(model, count=41):
    """Dives, then climbs [rad], from just inside the limits to just short of vertical."""
    dive, climb = model.feasible_limits()
    part = np.linspace(1e-3, 0.999, count)
    return np.concatenate([dive - part * (np.pi / 2 + dive), climb + part * (np.pi / 2 - climb)])


# rows of the reference tables


@pytest.mark.parametrize(
    ("gamma", "alpha", "speed"),
    [
        (-10, 5.929175, 0.593542),
        (-20, 2.616274, 0.872819),
        (-30, 1.625365, 1.063072),
        (-35, 1.336153, 1.140321),
        (-45, 0.932569, 1.268162),
    ],
)
def test_graver_rows_in_a_dive_and_mirrored_in_a_climb(gamma, alpha, speed):
    for sign in (1, -1):
        got = np.degrees(GRAVER.angle_of_attack(radians(sign * gamma)))
        assert got == pytest.approx(sign * alpha, abs=6e-7)
        assert GRAVER.speed(radians(sign * gamma)) == pytest.approx(speed, abs=6e-7)


@pytest.mark.parametrize(("gamma", "speed"), [(60, 1.404894), (-60, 1.404894), (90, 1.510429), (-90, 1.510429)])
def test_steep_glides_where_an_unsigned_angle_of_attack_goes_wrong(gamma, speed):
    assert GRAVER.speed(radians(gamma)) == pytest.approx(speed, abs=6e-7)


@pytest.mark.parametrize(
    ("model", "rows"),
    [
        (
            PAPER,
            [
                (20, 0.8409, 0.7901, 0.2876),
                (30, 1.0241, 0.8869, 0.5121),
                (35, 1.0986, 0.8999, 0.6301),
                (45, 1.2217, 0.8639, 0.8639),
            ],
        ),
        (
            SEAGLIDER,
            [
                (20, 0.2564, 0.2409, 0.0877),
                (30, 0.3326, 0.2881, 0.1663),
                (45, 0.4202, 0.2971, 0.2971),
            ],
        ),
        (
            replace(SEAGLIDER, dive_volume=250.0, climb_volume=250.0),
            [(20, 0.3610, 0.3393, 0.3610 * sin(radians(20))), (30, 0.4678, 0.4052, 0.2339)],
        ),
    ],
    ids=["paper", "seaglider 150 cc", "seaglider 250 cc"],
)
@pytest.mark.parametrize("sign", [-1, 1], ids=["dive", "climb"])
def test_speed_horizontal_and_vertical_rows(model, rows, sign):
    for degrees, *expected in rows:
        gamma = sign * radians(degrees)
        speed = model.speed(gamma)
        got = [speed, speed * np.cos(gamma), sign * speed * np.sin(gamma)]
        assert got == pytest.approx(expected, abs=6e-5)


@pytest.mark.parametrize(
    ("coefficients", "limit"),
    [((2.15, 25.0, 132.5), 6.315), ((7.680, 537.22, 385.76), 18.419), ((18.0, 109.0, 306.0), 16.146)],
)
def test_limits_of_the_published_sets(coefficients, limit):
    drag_0, drag_alpha2, lift_alpha = coefficients
    model = replace(
        GRAVER, drag_0=drag_0, drag_alpha2=drag_alpha2, lift_alpha=lift_alpha, angles=(limit + 1, 45.0)
    )
    dive, climb = np.degrees(model.feasible_limits())
    assert -dive == climb == pytest.approx(limit, abs=6e-4)


def test_asymmetric_set():
    assert np.degrees(ASYMMETRIC.feasible_limits()) == pytest.approx([-13.51999, 13.36497], abs=1e-5)
    got = np.degrees(ASYMMETRIC.angle_of_attack(np.radians([-25.0, 25.0])))
    assert got == pytest.approx([2.210261, -2.101314], abs=6e-7)


@pytest.mark.parametrize(
    ("name", "best", "degrees", "speed_error", "angle_error"),
    [
        ("paper", 0.9000, 35.512, 1e-4, 0.01),
        ("slocum", 0.34509, 37.470, 6e-6, 1e-3),
        ("seaglider", 0.3020, 39.4, 6e-5, 0.05),
    ],
)
def test_best_horizontal_speed_of_the_presets(name, best, degrees, speed_error, angle_error):
    table = polar(PRESETS[name])
    assert table.best_horizontal == pytest.approx([best, best], abs=speed_error)
    assert np.degrees(table.best_angle) == pytest.approx([degrees, degrees], abs=angle_error)


def test_the_paper_glider_at_its_best_angle():
    table = polar(PAPER)
    assert glide_speed(table, DIVE, table.best_angle[DIVE]) == pytest.approx(1.1057, abs=6e-5)
    assert vertical_speed(table, DIVE, table.best_angle[DIVE]) == pytest.approx(0.6422, abs=3e-4)
    assert "optimistic" in PAPER.note
    assert "3.6 times" in PAPER.note
    assert 7.680 / PAPER.drag_0 == pytest.approx(3.6, abs=0.05)


# identities


@every_model
def test_the_model_solves_its_own_force_balance(model):
    gamma = signed_angles(model)
    speed, alpha = model.speed(gamma), model.angle_of_attack(gamma)
    if isinstance(model, SteadyGlide):
        drag = (model.drag_0 + model.drag_alpha2 * alpha**2) * speed**2
        lift = (model.lift_0 + model.lift_alpha * alpha) * speed**2
        heavy, light = model.ballast_max - model.offset, -model.offset
    else:
        q, degrees, area = 0.5 * model.density * speed**2, np.degrees(alpha), model.length**2
        drag = area * q * (model.drag * q**model.drag_exponent + model.induced_drag * degrees**2)
        lift = area * q * model.lift * degrees
        heavy, light = model.density * 150e-6, -model.density * 150e-6
    weight = np.where(gamma < 0, heavy, light) * model.gravity
    # drag against the path, lift across it, net weight down
    assert drag == pytest.approx(-weight * np.sin(gamma), rel=1e-11)
    assert lift == pytest.approx(weight * np.cos(gamma), rel=1e-9)
    # the power that drag takes is the power that sinking gives
    assert drag * speed == pytest.approx(np.abs(weight) * np.abs(speed * np.sin(gamma)), rel=1e-11)


@every_model
def test_an_angle_alone_is_solved_as_well_as_among_others(model):
    gamma = signed_angles(model)
    alone = np.array([model.speed(float(x)) for x in gamma])
    assert alone == pytest.approx(model.speed(gamma), rel=1e-12)


def test_the_papers_own_formulas():
    gamma = signed_angles(ASYMMETRIC)
    k_d0, k_d, k_l0, k_l = 7.19, 386.29, -0.36, 440.99
    cot = 1.0 / np.tan(gamma)
    root = np.sqrt(1.0 - 4.0 * k_d / k_l**2 * cot * (k_d0 * cot + k_l0))
    alpha = 0.5 * k_l / k_d * np.tan(gamma) * (-1.0 + root)
    m0 = np.where(gamma < 0, 0.3, -0.25)
    drag, lift = k_d0 + k_d * alpha**2, k_l0 + k_l * alpha
    assert ASYMMETRIC.angle_of_attack(gamma) == pytest.approx(alpha, rel=1e-9, abs=1e-9)
    speed = np.sqrt(m0 * 9.81 / (-drag * np.sin(gamma) + lift * np.cos(gamma)))
    assert ASYMMETRIC.speed(gamma) == pytest.approx(speed, rel=1e-9)


@every_model
def test_speed_is_real_inside_the_limits_and_nan_between_them(model):
    dive, climb = model.feasible_limits()
    assert np.isfinite(model.speed(np.array([dive - 1e-9, climb + 1e-9, -np.pi / 2, np.pi / 2]))).all()
    assert np.isnan(model.speed(np.array([dive + 1e-9, 0.0, climb - 1e-9]))).all()
    assert np.isnan(model.angle_of_attack(np.array([0.0, 0.99 * climb]))).all()
    assert np.isnan(model.speed(np.array([-2.0, 2.0]))).all()


def test_at_the_limit_the_two_angles_of_attack_meet():
    limit = SLOCUM.feasible_limits()[CLIMB]
    # the double root of K_D alpha^2 + K_L tan(gamma) alpha + K_D0
    double = -SLOCUM.lift_alpha * tan(limit) / (2 * SLOCUM.drag_alpha2)
    assert SLOCUM.angle_of_attack(limit + 1e-12) == pytest.approx(double, rel=1e-5)


def test_the_seaglider_without_its_exponent_is_the_steady_glide():
    model = replace(SEAGLIDER, drag_exponent=0.0)
    half = 0.5 * model.density * model.length**2
    mass = model.density * 150e-6
    twin = SteadyGlide(
        angles=model.angles,
        gravity=model.gravity,
        drag_0=half * model.drag,
        drag_alpha2=half * model.induced_drag * np.degrees(1.0) ** 2,
        lift_0=0.0,
        lift_alpha=half * model.lift * np.degrees(1.0),
        offset=mass,
        ballast_max=2 * mass,
    )
    gamma = signed_angles(twin)
    assert model.feasible_limits() == pytest.approx(twin.feasible_limits(), rel=1e-12)
    assert model.speed(gamma) == pytest.approx(twin.speed(gamma), rel=1e-11)
    assert model.angle_of_attack(gamma) == pytest.approx(twin.angle_of_attack(gamma), rel=1e-9)


def test_speed_scales_as_the_root_of_the_net_mass():
    gamma = signed_angles(PAPER)
    heavier = replace(PAPER, offset=4 * PAPER.offset, ballast_max=4 * PAPER.ballast_max)
    assert heavier.speed(gamma) == pytest.approx(2.0 * PAPER.speed(gamma), rel=1e-13)
    deeper = replace(ASYMMETRIC, ballast_max=0.25 + 9 * 0.3)  # the dive alone is nine times heavier
    assert deeper.speed(-0.5) == pytest.approx(3.0 * ASYMMETRIC.speed(-0.5), rel=1e-13)
    assert deeper.speed(0.5) == ASYMMETRIC.speed(0.5)


@pytest.mark.parametrize("name", PRESETS)
def test_speed_rises_with_the_angle_and_climbs_mirror_dives(name):
    model = PRESETS[name]
    climbs = signed_angles(model)[41:]
    assert np.all(np.diff(model.speed(climbs)) > 0)
    assert model.speed(-climbs) == pytest.approx(model.speed(climbs), rel=1e-14)
    assert model.angle_of_attack(-climbs) == pytest.approx(-model.angle_of_attack(climbs), rel=1e-12)


@every_model
def test_signs(model):
    low, high = np.radians(model.angles)
    angles = np.linspace(low, high, 9)
    assert np.all(model.angle_of_attack(-angles) > 0)
    assert np.all(model.angle_of_attack(angles) < 0)
    assert np.all(np.abs(angles + model.angle_of_attack(angles)) < angles)  # pitch is shallower than the path
    assert np.all(model.net_mass(-angles) > 0)
    assert np.all(model.net_mass(angles) < 0)


# an independent model


GLIDERFLIGHT = [  # pitch, gamma [degrees]; U, u, w [m/s]: gliderflight 1.2.1, +250 cc
    (20, 23.2536, 0.32456, 0.29820, 0.12814),
    (26, 28.3647, 0.37257, 0.32784, 0.17700),
    (30, 31.9798, 0.39980, 0.33912, 0.21174),
    (35, 36.6208, 0.42979, 0.34495, 0.25638),
    (45, 46.1264, 0.47908, 0.33204, 0.34536),
]


def agrees_with_slocum(pitch, gamma, speed, along, up):
    """One row, angles in degrees; the package interpolates its angle of attack."""
    angle = radians(gamma)
    got = SLOCUM.speed(angle)
    assert gamma + np.degrees(SLOCUM.angle_of_attack(angle)) == pytest.approx(pitch, rel=5e-4)
    assert [got, got * cos(angle), got * sin(angle)] == pytest.approx([speed, along, up], rel=5e-4)


@pytest.mark.parametrize("row", GLIDERFLIGHT, ids=lambda row: f"pitch {row[0]}")
def test_slocum_agrees_with_the_recorded_gliderflight(row):
    agrees_with_slocum(*row)


@pytest.mark.parametrize(
    ("pitch", "gamma", "speed"), [(26, 28.3645196710, 0.3725769862), (35, 36.6207020710, 0.4297924292)]
)
def test_slocum_agrees_with_gliderflights_exact_roots(pitch, gamma, speed):
    # the preset's coefficients have seven digits
    assert gamma + np.degrees(SLOCUM.angle_of_attack(radians(gamma))) == pytest.approx(pitch, abs=1e-6)
    assert SLOCUM.speed(radians(gamma)) == pytest.approx(speed, rel=1e-7)


def test_slocum_agrees_with_gliderflight_itself():
    package = pytest.importorskip("gliderflight")
    reference = package.SteadyStateGliderModel(rho0=1024)
    reference.define(mg=65.0, Vg=65.0 / 1024, Cd0=0.15)
    pitch = np.array([20.0, 26.0, 30.0, 35.0, 45.0])
    zero = np.zeros(5)
    result = reference.solve(
        {
            "time": np.arange(5.0),
            "pressure": zero,
            "pitch": np.radians(pitch),
            "buoyancy_change": zero + 250.0,
            "density": zero + 1024.0,
            "dhdt": zero,
        }
    )
    gamma = np.degrees(result.pitch + result.alpha)
    for row in zip(pitch, gamma, result.U, result.u, result.w, strict=True):
        agrees_with_slocum(*row)


# the polar


@every_model
def test_polar_is_the_model(model):
    table = polar(model)
    low, high = np.radians(model.angles)
    angles = np.concatenate([[low, high], np.random.default_rng(1).uniform(low, high, 20000)])
    # as crowded as the table's steps at the shallow end, where the model bends most
    angles = np.concatenate([angles, np.linspace(low, low + 0.01, 2000)])
    for row, sign in ((DIVE, -1.0), (CLIMB, 1.0)):
        assert table.shallowest[row] == pytest.approx(low, rel=1e-15)
        assert table.steepest[row] == pytest.approx(high, rel=1e-15)
        got = np.array([glide_speed(table, row, angle) for angle in angles])
        assert np.max(np.abs(got / model.speed(sign * angles) - 1.0)) < POLAR_TOLERANCE
    assert POLAR_TOLERANCE <= 1e-7


@pytest.mark.parametrize(
    "model",
    [*MODELS.values(), replace(PAPER, angles=(40.0, 60.0)), replace(PAPER, angles=(10.0, 20.0))],
    ids=[*MODELS, "best at the shallow end", "best at the steep end"],
)
def test_nothing_in_the_table_is_faster_than_its_best(model):
    table = polar(model)
    for row in (DIVE, CLIMB):
        best, angle = table.best_horizontal[row], table.best_angle[row]
        assert horizontal_speed(table, row, angle) == pytest.approx(best, rel=1e-14)
        for reach, count in ((1.0, 4001), (1e-3, 4001), (1e-7, 1001)):
            near = np.clip(angle + np.linspace(-reach, reach, count), table.shallowest[row], table.steepest[row])
            speeds = np.array([horizontal_speed(table, row, x) for x in near])
            assert speeds.max() <= best
            # one maximum, up to rounding
            assert np.all(np.diff(speeds)[near[1:] <= angle] >= -1e-15)
            assert np.all(np.diff(speeds)[near[:-1] >= angle] <= 1e-15)
        sinking = [vertical_speed(table, row, x) for x in np.linspace(*np.radians(model.angles), 4001)]
        assert np.all(np.diff(sinking) > 0)


def test_best_angle_at_the_end_of_a_range_without_a_maximum_inside():
    assert polar(replace(PAPER, angles=(40.0, 60.0))).best_angle == pytest.approx(radians(40), rel=1e-15)
    assert polar(replace(PAPER, angles=(10.0, 20.0))).best_angle == pytest.approx(radians(20), rel=1e-15)


def test_the_kernels_find_the_angles_of_a_horizontal_speed():
    table = polar(SEAGLIDER)
    for outer in (table.shallowest[DIVE], table.steepest[DIVE]):
        angle = angle_of_horizontal_speed(table, DIVE, 0.3, outer)
        assert horizontal_speed(table, DIVE, angle) == pytest.approx(0.3, rel=1e-12)


def test_the_table_has_the_kernels_layout():
    for array, shape in zip(polar(PAPER), [(2,), (2,), None, (2,), (2,)], strict=True):
        assert array.dtype == np.float64
        assert array.flags.c_contiguous
        assert shape is None or array.shape == shape


def test_two_phases_in_the_polar():
    table = polar(ASYMMETRIC)
    # heavier by 0.3 kg, lighter by 0.25 kg: the dive is the faster, nearly by the root of their ratio
    assert table.best_horizontal[DIVE] / table.best_horizontal[CLIMB] == pytest.approx(sqrt(1.2), rel=0.01)


def test_digest_is_of_the_numbers_alone():
    digest = glider_sha256(polar(PAPER))
    assert len(digest) == 64
    assert digest == glider_sha256(polar(replace(PAPER, name="another name")))
    assert digest != glider_sha256(polar(replace(PAPER, gravity=np.nextafter(9.81, 10))))
    table = polar(ASYMMETRIC)
    swapped = table._replace(speed=table.speed[::-1].copy())
    assert glider_sha256(table) != glider_sha256(swapped)


# tables of a scenario


def test_a_preset_alone_and_with_overrides():
    assert glider_from_table({"preset": "paper"}) is PAPER
    wider = glider_from_table({"preset": "seaglider", "angles": [20, 40], "climb_volume": 200})
    assert wider == replace(
        SEAGLIDER, angles=(20.0, 40.0), climb_volume=200.0, name="seaglider, modified", note=wider.note
    )
    assert wider.note.startswith(SEAGLIDER.note)
    assert "angles, climb_volume" in wider.note
    with pytest.raises(FrozenInstanceError):
        wider.angles = (1.0, 2.0)


def test_the_papers_symbols_are_keys_too():
    symbols = {"K_D0": 7.19, "K_D": 386.29, "K_L0": -0.36, "K_L": 440.99, "off": 0.25, "m_b_max": 0.55}
    table = {"model": "steady-glide", "g": 9.81, "angles": [15, 45], **symbols}
    assert glider_from_table(table) == ASYMMETRIC


def test_the_seaglider_model_from_its_coefficients():
    table = {"a": 0.003548134, "b": 0.011220184, "c": 5.7e-6, "s": -0.25, "rho0": 1027.5, "l": 1.8, "g": 9.82}
    table |= {"model": "seaglider", "angles": [15, 45], "dive_volume": 150, "climb_volume": 150}
    got = glider_from_table(table)
    assert isinstance(got, Seaglider)
    assert got == replace(SEAGLIDER, name=got.name, note=got.note)


def test_one_line_for_people():
    assert str(PAPER) == "paper: 0.900 m/s horizontal at 35.5 degrees, 0.099 to 0.864 m/s vertical"
    both = str(ASYMMETRIC)
    assert "\n" not in both
    assert both.startswith("glider: dive 0.3")
    assert "; climb 0.3" in both


STEADY = {k: v for k, v in COEFFICIENTS.items() if k != "offset"}


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({}, r"`glider.preset` is missing.*paper, slocum, seaglider.*`glider.model`"),
        ({"preset": "spray"}, r"`glider.preset` = 'spray' is not known.*paper, slocum, seaglider"),
        ({"preset": 3}, r"`glider.preset` = 3 is not known"),
        ({"preset": "paper", "drag": 1.0}, r"the key `glider.drag` is not known.*drag_0"),
        ({"preset": "paper", "model": "seaglider"}, r"the key `glider.model` is not known"),
        ({"preset": "paper", "offset": "half"}, r"`glider.offset` must be a finite number; got 'half'"),
        ({"preset": "paper", "angles": 10}, r"`glider.angles` must be a list of 2.*got 10"),
        ({"preset": "paper", "offset": 0.4, "off": 0.4}, r"`glider.offset` is given twice"),
        ({"model": "kite"}, r"`glider.model` = 'kite' is not known.*seaglider, steady-glide"),
        (STEADY, r"`glider.offset` is missing"),
        (STEADY | {"offset": 0}, r"the climb has no speed.*`glider.offset` = 0.0 kg"),
        (STEADY | {"offset": -0.1}, r"the climb has no speed.*-0.1 kg"),
        (STEADY | {"offset": 0.55}, r"the dive has no speed.*`glider.ballast_max` = 0.55 kg"),
        (STEADY | {"offset": 0.25, "drag_0": 0}, r"`glider.drag_0` must be greater than 0; got 0.0"),
        (
            STEADY | {"offset": 0.25, "lift_alpha": -3},
            r"`glider.lift_alpha` must be greater than 0; got -3.0",
        ),
        ({"preset": "paper", "gravity": 0}, r"`glider.gravity` must be greater than 0; got 0.0"),
        ({"preset": "seaglider", "dive_volume": -150}, r"the dive has no speed.*dive_volume.*got -150.0"),
        ({"preset": "seaglider", "climb_volume": 0}, r"the climb has no speed.*climb_volume.*got 0.0"),
        ({"preset": "seaglider", "s": -1}, r"`glider.drag_exponent` must be greater than -1; got -1.0"),
        ({"preset": "paper", "angles": [6.3, 45]}, r"6.3148 degrees, the limit.*got \[6.3, 45.0\]"),
        ({"preset": "slocum", "angles": [10, 45]}, r"18.4190 degrees, the limit.*got \[10.0, 45.0\]"),
        ({"preset": "seaglider", "angles": [5, 45]}, r"6.8946 degrees, the limit"),
        (COEFFICIENTS | {"angles": [13.4, 45]}, r"13.5200 degrees, the limit of a steady dive"),
        (COEFFICIENTS | {"angles": [13.4, 45], "K_L0": 0.36}, r"given twice"),
        (
            COEFFICIENTS | {"angles": [13.4, 45], "lift_0": 0.36},
            r"13.5200 degrees, the limit of a steady climb",
        ),
        ({"preset": "paper", "angles": [45, 10]}, r"must rise.*got \[45.0, 10.0\]"),
        ({"preset": "paper", "angles": [30, 30]}, r"must rise.*got \[30.0, 30.0\]"),
        ({"preset": "paper", "angles": [10, 90]}, r"to below 90; got \[10.0, 90.0\]"),
    ],
)
def test_bad_tables_are_one_sentence_that_names_the_value(table, sentence):
    with pytest.raises(InputError, match=sentence) as error:
        glider_from_table(table)
    assert "\n" not in str(error.value)


def test_a_range_that_begins_all_but_at_the_limit_is_refused():
    limit = np.degrees(PAPER.feasible_limits()[CLIMB])
    with pytest.raises(InputError, match=r"must rise from above 6.3148"):
        replace(PAPER, angles=(limit, 45.0))
    with pytest.raises(InputError, match=r"too near the limit of a steady glide, 6.3148 degrees"):
        polar(replace(PAPER, angles=(limit + 1e-6, 45.0)))


class Bumpy(SteadyGlide):
    """A glider with a made-up speed, for what no published model does."""

    def _glide(self, gamma):
        speed, alpha = super()._glide(gamma)
        return speed * (1.0 + self.lift_0 * np.sin(20.0 * np.abs(gamma))), alpha


def test_a_polar_that_the_kernels_could_not_bisect_is_refused():
    fields = {f: getattr(PAPER, f) for f in PAPER.__dataclass_fields__}
    with pytest.raises(InputError, match=r"horizontal speed must have one maximum.*\[10.0, 45.0\]"):
        polar(Bumpy(**(fields | {"lift_0": 0.05})))
    with pytest.raises(InputError, match=r"vertical speed must rise.*\[10.0, 45.0\]"):
        polar(Bumpy(**(fields | {"lift_0": 0.4})))
