"""Recorded dives from a CSV file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array
from ...base.errors import InputError
from ...base.settings import require
from ...base.table import find_columns, read_table

COLUMNS = {
    "vertical": (
        "vertical",
        "vertical_speed",
        "vertical_speed_mps",
        "mean_abs_vert_speed_mps",
        "vert_speed",
        "w",
        "w_mps",
    ),
    "horizontal": (
        "horizontal",
        "horizontal_speed",
        "horizontal_speed_mps",
        "mean_horz_speed_mps",
        "horz_speed",
        "u",
        "u_mps",
    ),
    "pitch": ("pitch", "pitch_deg", "mean_pitch", "mean_pitch_deg"),
    "glide_angle": ("glide_angle", "glide_angle_deg", "gamma", "gamma_deg"),
    "buoyancy": ("buoyancy", "buoyancy_cc", "vbd_cc", "net_volume_cc"),
    "net_mass": ("net_mass", "net_mass_kg", "buoyancy_kg"),
    "phase": ("phase",),
}
"""The names of columns: speeds through water [m/s], angles [degrees], buoyancy off neutral [cc] or [kg]."""
MOST_DIVES = 5_000
LARGEST = 1e6
LIMITS = {
    **{"vertical": (-10.0, 10.0), "horizontal": (0.0, 10.0)},
    **{"pitch": (-90.0, 90.0), "glide_angle": (-90.0, 90.0)},
}
"""The limits of recorded values, [m/s] and [degrees]: no glider is faster."""
PHASES = {"dive": True, "down": True, "climb": False, "up": False}


@dataclass(frozen=True)
class Dives:
    """Steady glides (n,), as magnitudes; None if the file does not hold a value.

    `vertical`, `horizontal` speed [m/s]; `glide_angle`, `pitch` [rad]; `buoyancy` off neutral in its `unit`, cc
    or kg; `down`: true for a dive, false for a climb; `line` of the file (n,); `took`: which column was taken for
    what; `unused` columns.
    """

    vertical: Array
    horizontal: Array | None
    glide_angle: Array | None
    pitch: Array | None
    buoyancy: Array | None
    unit: str
    down: NDArray[np.bool_] | None
    line: NDArray[np.int64]
    took: dict[str, str]
    unused: tuple[str, ...]


def read_dives(file: str | Path, columns: Mapping[str, str] | None = None) -> Dives:
    """Return the dives of a CSV file with a header; `columns` names columns that have other names.

    A vertical speed is needed, and a horizontal speed, a glide angle or a pitch. Dives and climbs are separated
    by a column of phases, or by the signs of pitch, glide angle or vertical speed, which are below 0 in a dive.
    InputError if the file lacks a column that a fit needs, or if a value is not a number or has the sign of the
    other phase.
    """
    path = Path(file)
    header, rows = read_table(path, "the file of dives", "dive", MOST_DIVES)
    found = find_columns(path.name, header, COLUMNS, columns or {})
    listed = f"; it has: {', '.join(header)}"
    require("vertical" in found, f"{path.name} has no column of vertical speeds; name it by `vertical`{listed}")
    given = {"horizontal", "pitch", "glide_angle"} & set(found)
    require(bool(given), f"{path.name} must have a horizontal speed, a pitch or a glide angle; name one{listed}")
    twice = "buoyancy" in found and "net_mass" in found
    require(not twice, f"{path.name} has a buoyancy in cc and one in kg; leave one out{listed}")
    if "horizontal" in found:
        # the two speeds give the glide angle
        found.pop("glide_angle", None)
    line = np.array([number for number, _ in rows], np.int64)
    at = {column: n for n, column in enumerate(header)}
    cells = {what: [row[at[column]] for _, row in rows] for what, column in found.items()}
    values = {}
    for what, column in found.items():
        if what != "phase":
            low, high = LIMITS.get(what, (-LARGEST, LARGEST))
            values[what] = _numbers(path.name, line, cells[what], column, low, high)
    down = None
    if "phase" in found:
        down = _phases(path.name, line, cells["phase"], found["phase"])
    else:
        for what in ("pitch", "glide_angle", "vertical"):
            if what in values and (values[what] > 0).any() and (values[what] < 0).any():
                down = values[what] < 0
                found["phase"] = f"{found[what]}, below 0 in a dive"
                break
    for what, speeds in values.items():
        _check_signs(path.name, line, speeds, None if what == "horizontal" else down, found[what])
        values[what] = np.abs(speeds)
    for what in ("pitch", "glide_angle"):
        if what in values:
            values[what] = np.radians(values[what])
    return Dives(
        vertical=values["vertical"],
        horizontal=values.get("horizontal"),
        glide_angle=values.get("glide_angle"),
        pitch=values.get("pitch"),
        buoyancy=values.get("buoyancy", values.get("net_mass")),
        unit="kg" if "net_mass" in found else "cc",
        down=down,
        line=line,
        took=found,
        unused=tuple(column for column in header if column not in found.values()),
    )


def _numbers(
    name: str, line: NDArray[np.int64], cells: Sequence[str], column: str, low: float, high: float
) -> Array:
    values = np.empty(len(cells))
    for n, (number, cell) in enumerate(zip(line, cells, strict=True)):
        where = f"line {number} of {name}: {column} = {cell[:40]!r}"
        try:
            value = float(cell)
        except ValueError:
            raise InputError(f"{where} is not a number; mend it, or leave that dive out") from None
        require(low < value < high, f"{where} must lie between {low:g} and {high:g}; mend it")
        require(value != 0, f"{where} is 0, which no dive has; leave that dive out")
        values[n] = value
    return values


def _phases(name: str, line: NDArray[np.int64], cells: Sequence[str], column: str) -> NDArray[np.bool_]:
    for number, cell in zip(line, cells, strict=True):
        known = cell.strip().lower() in PHASES
        where = f"line {number} of {name}: {column} = {cell[:40]!r}"
        require(known, f"{where} is not a phase; choose from: {', '.join(PHASES)}")
    return np.array([PHASES[cell.strip().lower()] for cell in cells])


def _check_signs(
    name: str, line: NDArray[np.int64], values: Array, down: NDArray[np.bool_] | None, column: str
) -> None:
    """Raise InputError if a value has the sign of the other phase.

    Values may be magnitudes or signed. In both cases a phase has one sign; a value with the other sign is a
    mistake.
    """
    for part in [np.full(values.size, True)] if down is None else [down, ~down]:
        odd = part & (np.sign(values) != np.sign(values[part][:1].sum()))
        if odd.any():
            number, value = line[odd][0], values[odd][0]
            where = f"line {number} of {name}: {column} = {value:g}"
            raise InputError(f"{where} has another sign than the dives of its phase before it; mend it")
    if down is not None and 0 < down.sum() < down.size and (values < 0).all():
        where = f"line {line[~down][0]} of {name}: {column} = {values[~down][0]:g}"
        raise InputError(f"{where} is below 0 in a climb as in a dive; mend its sign, or the phase")
