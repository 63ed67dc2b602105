"""Calibration: the drag, or the buoyancy, of a vehicle from dives that it flew."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .glider import PRESETS, Glider, Seaglider, SteadyGlide
from .settings import require
from .toml import to_toml

Array = NDArray[np.float64]

COLUMNS = {
    "vertical": ("vertical_speed", "vertical_speed_mps", "mean_abs_vert_speed_mps", "vert_speed", "w", "w_mps"),
    "horizontal": ("horizontal_speed", "horizontal_speed_mps", "mean_horz_speed_mps", "horz_speed", "u", "u_mps"),
    "pitch": ("pitch", "pitch_deg", "mean_pitch", "mean_pitch_deg"),
    "glide_angle": ("glide_angle", "glide_angle_deg", "gamma", "gamma_deg"),
    "buoyancy": ("buoyancy", "buoyancy_cc", "vbd_cc", "net_volume_cc"),
}
"""What a column may be called: speeds through water [m/s], angles [degrees], buoyancy off neutral [cc]."""
MOST_TEXT, MOST_DIVES = 20_000_000, 20_000
CONFIDENCE = 0.99
"""The share of dives that the uncertainty shown is to hold."""
STEEP = (80.0, 85.0)
"""Any vehicle glides as steeply: a range of angles that no fit can leave."""
SCALE = "drag_0"


@dataclass(frozen=True)
class Dives:
    """What was recorded (n,): vertical and horizontal speed [m/s], glide angle and pitch [rad], buoyancy [cc].

    NaN where there is none; all as magnitudes. `took`: which column was taken for what.
    """

    vertical: Array
    horizontal: Array
    glide_angle: Array
    pitch: Array
    buoyancy: Array
    took: dict[str, str]


@dataclass(frozen=True)
class Parameter:
    """A fitted value, its standard error, and the preset's."""

    value: float
    error: float
    before: float


@dataclass(frozen=True)
class Calibration:
    """A fitted `glider`; `parameters` by name; what was `held`; residuals (n,) [m/s] and what they may be.

    `vertical_within`, `horizontal_within` [m/s]: within these of the model a further dive lies, CONFIDENCE of
    them.
    """

    glider: Glider
    parameters: dict[str, Parameter]
    held: str
    dives: Dives
    vertical_off: Array
    horizontal_off: Array
    vertical_within: float
    horizontal_within: float

    def table(self) -> str:
        """The [glider] section of a scenario."""
        kinds = {SteadyGlide: "steady-glide", Seaglider: "seaglider"}
        values = {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(self.glider).items()}
        return to_toml({"glider": {"model": kinds[type(self.glider)], **values}})

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        return {
            "dives": int(self.dives.vertical.size),
            "took": self.dives.took,
            "parameters": {name: asdict(one) for name, one in self.parameters.items()},
            "held": self.held,
            "vertical_scatter_mps": _scatter(self.vertical_off, len(self.parameters)),
            "horizontal_scatter_mps": _scatter(self.horizontal_off, len(self.parameters)),
            "vertical_within_mps": self.vertical_within,
            "horizontal_within_mps": self.horizontal_within,
            "confidence": CONFIDENCE,
            "glider": {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self.glider).items()},
        }

    def __str__(self) -> str:
        columns = ", ".join(f"{name} of column {column}" for name, column in self.dives.took.items())
        lines = [f"{self.dives.vertical.size} dives: {columns}"]
        for name, one in self.parameters.items():
            lines.append(f"  {name:<12} {one.value:.5g} +- {one.error:.2g} (the preset has {one.before:.5g})")
        lines.append(f"  held         {self.held}")
        for name, off, within in (
            ("vertical", self.vertical_off, self.vertical_within),
            ("horizontal", self.horizontal_off, self.horizontal_within),
        ):
            scatter = _scatter(off, len(self.parameters))
            lines.append(
                f"  {name:<12} off by {scatter:.4f} m/s (one standard deviation), "
                f"{CONFIDENCE:.0%} of dives within {within:.4f} m/s; the worst {np.abs(off).max():.4f} m/s"
            )
        return "\n".join([*lines, f"  {self.glider}"])


def _scatter(off: Array, fitted: int) -> float:
    return float(np.sqrt((off**2).sum() / max(off.size - fitted, 1)))


def read_dives(file: str | Path, columns: Mapping[str, str] | None = None) -> Dives:
    """Dives out of a CSV file with a header; `columns` names those that are called otherwise.

    InputError where it lacks what a fit needs, or a value is none; the row is named.
    """
    path = Path(file)
    require(path.is_file(), f"the file of dives {path} does not exist")
    size = path.stat().st_size
    require(size <= MOST_TEXT, f"{path.name} holds {size:,} bytes, more than {MOST_TEXT:,}; cut it")
    try:
        rows = list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig"))))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path.name} cannot be read as CSV: {error}; save it as such") from None
    require(
        0 < len(rows) <= MOST_DIVES, f"{path.name} must hold from 1 to {MOST_DIVES:,} dives; got {len(rows):,}"
    )
    header = [name for name in rows[0] if name is not None]
    said = dict(columns or {})
    for name in said:
        require(name in COLUMNS, f"`{name}` is no column that is known; choose from: {', '.join(COLUMNS)}")
    found: dict[str, str] = {}
    for name, usual in COLUMNS.items():
        here = [column for column in header if column.strip().lower() in usual]
        column = said.get(name, here[0] if here else None)
        if column is not None:
            require(column in header, f"{path.name} has no column `{column}`; it has: {', '.join(header)}")
            found[name] = column
    require(
        "vertical" in found, f"{path.name} has no column of vertical speeds; name it, out of: {', '.join(header)}"
    )
    angled = {"horizontal", "pitch", "glide_angle"} & set(found)
    require(
        bool(angled), f"{path.name} has neither horizontal speed nor pitch nor glide angle: {', '.join(header)}"
    )
    values = {name: _numbers(path.name, rows, column) for name, column in found.items()}
    none = np.full(len(rows), np.nan)
    vertical, horizontal = values["vertical"], values.get("horizontal", none)
    angle = np.radians(values["glide_angle"]) if "glide_angle" in values else np.arctan2(vertical, horizontal)
    pitch = np.radians(values["pitch"]) if "pitch" in values else none
    return Dives(vertical, horizontal, angle, pitch, values.get("buoyancy", none), found)


def _numbers(name: str, rows: Sequence[Mapping[str, str]], column: str) -> Array:
    values = []
    for n, row in enumerate(rows, 2):
        try:
            value = abs(float(row[column]))
        except (TypeError, ValueError):
            value = math.nan
        require(
            math.isfinite(value) and value < 1e6, f"line {n} of {name}: {column} = {row[column]!r} is no number"
        )
        require(value > 0, f"line {n} of {name}: {column} is 0, which no dive has; leave that dive out")
        values.append(value)
    return np.array(values)


def _with(base: Glider, values: Mapping[str, Any], volume: float) -> Glider:
    """The base glider with other coefficients, a volume [cc] off neutral in either phase."""
    if isinstance(base, Seaglider):
        return replace(base, **values, dive_volume=volume, climb_volume=volume, angles=STEEP)
    assert isinstance(base, SteadyGlide)
    mass = volume * 1e-6 * DENSITY
    return replace(base, **values, offset=mass, ballast_max=2 * mass, angles=STEEP)


DENSITY = 1025.0
"""Of sea water [kg/m^3], to make a mass of a volume."""


def _own_volume(base: Glider) -> float:
    """How far off neutral the preset is [cc]."""
    if isinstance(base, Seaglider):
        return base.dive_volume
    assert isinstance(base, SteadyGlide)
    return base.offset / DENSITY * 1e6


def _predicted(base: Glider, values: Mapping[str, float], volumes: Array, dives: Dives) -> tuple[Array, Array]:
    """Vertical and horizontal speed [m/s] of each dive, at its glide angle, or at that of its pitch."""
    vertical, horizontal = np.empty_like(volumes), np.empty_like(volumes)
    for volume in np.unique(volumes):
        here = volumes == volume
        glider = _with(base, values, float(volume))
        angle = dives.glide_angle[here]
        if np.isnan(angle).any():
            angle = _of_pitch(glider, dives.pitch[here])
        speed = np.nan_to_num(glider.speed(-angle))
        vertical[here], horizontal[here] = speed * np.sin(angle), speed * np.cos(angle)
    return vertical, horizontal


def _of_pitch(glider: Glider, pitch: Array) -> Array:
    """Glide angles [rad] whose pitch, gamma + alpha, is as steep as given: a table, read backward.

    Near the limit of a steady glide alpha grows, and the pitch with it: the steeper of the two is flown.
    """
    low = float(np.abs(glider.feasible_limits()).max()) + 1e-6
    angle = np.linspace(low, math.radians(89.0), 4000)
    nose = np.abs(-angle + glider.angle_of_attack(-angle))
    flattest = int(nose.argmin())
    return np.interp(pitch, nose[flattest:], angle[flattest:])


def calibrate(dives: Dives, preset: str = "seaglider") -> Calibration:
    """Fit a preset to dives by least squares of their vertical (and horizontal) speeds.

    With the buoyancy of each dive the parasite drag is fitted; without, only its ratio to the buoyancy can
    be, and the buoyancy is, the drag held. Standard errors come from the Jacobian and the scatter.
    """
    from scipy.optimize import least_squares
    from scipy.stats import t as student

    known = preset in ("seaglider", "slocum")
    require(known, f"`preset` = {preset!r} cannot be calibrated; choose from: seaglider, slocum")
    base = PRESETS[preset]
    drag = "drag" if isinstance(base, Seaglider) else SCALE
    by_buoyancy = bool(np.isfinite(dives.buoyancy).all())
    name = drag if by_buoyancy else "buoyancy"
    before = float(getattr(base, drag)) if by_buoyancy else _own_volume(base)
    need = 3
    count = dives.vertical.size
    require(count >= need, f"a calibration needs {need} dives or more; got {count}")
    across = bool(np.isfinite(dives.horizontal).all())

    def predicted(ratio: float) -> tuple[Array, Array]:
        values = {drag: before * ratio} if by_buoyancy else {}
        volumes = dives.buoyancy if by_buoyancy else np.full(count, before * ratio)
        return _predicted(base, values, volumes, dives)

    def residuals(log_ratio: Array) -> Array:
        vertical, horizontal = predicted(math.exp(float(log_ratio[0])))
        parts = [vertical - dives.vertical, *([horizontal - dives.horizontal] if across else [])]
        return np.concatenate(parts)

    fit = least_squares(residuals, np.zeros(1), bounds=(-4.0, 4.0), x_scale=0.1)
    ratio = math.exp(float(fit.x[0]))
    require(
        abs(float(fit.x[0])) < 3.99, f"no {name} within a factor of 50 of the preset's fits; look at the units"
    )
    vertical, horizontal = predicted(ratio)
    off_vertical = vertical - dives.vertical
    off_horizontal = horizontal - dives.horizontal if across else np.zeros(count)
    variance = float((fit.fun**2).sum()) / max(count - 1, 1)
    slope = float((np.asarray(fit.jac) ** 2).sum())
    error = math.sqrt(variance / slope) * before * ratio if slope > 0 else math.inf
    wide = float(student.ppf(0.5 + CONFIDENCE / 2, count - 1)) * math.sqrt(1 + 1 / count)
    volume = float(np.mean(dives.buoyancy)) if by_buoyancy else before * ratio
    fitted = _with(base, {drag: before * ratio} if by_buoyancy else {}, volume)
    lowest = math.degrees(float(np.abs(fitted.feasible_limits()).max()))
    low = max(base.angles[0], math.ceil(lowest + 0.5))
    held = f"the induced drag and the lift of {preset}"
    if not by_buoyancy:
        held = f"all drag and lift of {preset}: speeds and angles tell only the ratio of buoyancy to drag"
    glider = replace(
        fitted,
        angles=(low, base.angles[1]),
        name=f"{preset}, calibrated",
        note=f"{name} fitted to {count} dives: {before * ratio:.5g} +- {error:.2g}; held: {held}",
    )
    return Calibration(
        glider=glider,
        parameters={name: Parameter(before * ratio, error, before)},
        held=held,
        dives=dives,
        vertical_off=off_vertical,
        horizontal_off=off_horizontal,
        vertical_within=wide * _scatter(off_vertical, 1),
        horizontal_within=wide * _scatter(off_horizontal, 1),
    )
