"""Reads what vehicles know of their dives: a CSV file with a line for each dive, or a NetCDF file of a track."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..base.table import find_columns, read_table
from ..vehicle.averaged_current import dead_reckoned, horizontal_speed
from ..vehicle.calibration.dives import MOST_DIVES
from ..water.frame import LocalFrame
from ..water.ocean.opening import opened

COLUMNS: dict[str, tuple[str, ...]] = {
    "dive": ("dive", "number", "dive_number"),
    "t_start": ("t_start", "t_start_unix", "time_start", "start_time"),
    "lat_start": ("lat_start", "start_lat"),
    "lon_start": ("lon_start", "start_lon"),
    "t_end": ("t_end", "t_end_unix", "time_end", "end_time"),
    "lat_end": ("lat_end", "end_lat"),
    "lon_end": ("lon_end", "end_lon"),
    "lat_reckoned": ("lat_reckoned", "lat_dead_reckoned", "dr_lat"),
    "lon_reckoned": ("lon_reckoned", "lon_dead_reckoned", "dr_lon"),
    "east": ("east", "east_m", "through_water_east_m"),
    "north": ("north", "north_m", "through_water_north_m"),
    "heading": ("heading", "heading_deg", "mean_heading", "mean_heading_deg"),
    "horizontal": ("horizontal", "horizontal_speed", "horizontal_speed_mps", "mean_horz_speed_mps", "horz_speed"),
    "max_depth": ("max_depth", "max_depth_m", "bottom"),
    "surface": ("surface", "surface_s"),
    "drift_east": ("drift_east", "surf_east_mps", "surface_east_mps"),
    "drift_north": ("drift_north", "surf_north_mps", "surface_north_mps"),
    "recorded_east": ("dac_east", "dac_east_mps", "depth_avg_curr_east"),
    "recorded_north": ("dac_north", "dac_north_mps", "depth_avg_curr_north"),
}
"""The usual names of the columns of dives: see `DiveRecord`."""
NEEDED = ("t_start", "lat_start", "lon_start", "t_end", "lat_end", "lon_end")
WAYS = (("east", "north"), ("lon_reckoned", "lat_reckoned"), ("heading", "horizontal"))
"""The pairs of columns of which one must tell the way through water."""
TRACK = ("time", "latitude", "longitude", "depth", "heading", "pitch")
SHALLOW, DEEP = 5.0, 20.0
"""In a track, a dive is where the vehicle is deeper than the first [m], if it gets deeper than the second."""
GLIDING = 0.5
"""In a track, at least this share of the samples of a dive must be a steady glide, for a speed to be known."""
LONGEST_DIVE = 30 * 86_400.0
"""No dive lasts longer [s]; if two fixes do, some fixes between them are missing."""
EARTH = {"lat": 90.0, "lon": 540.0}


@dataclass(frozen=True)
class DiveRecord:
    """A dive between two fixes, as its vehicle knows it.

    `start`, `end` (lon, lat) [degrees] at the times `began`, `ended` [s since 1970, UTC]; `over_ground` and
    `through_water` (2,) [m] east and north; `surface` [s] of that time at the surface, with the current `drift`
    (2,) [m/s] there, or None if that is unknown; `recorded`: the depth-averaged current (2,) [m/s] that the file
    holds; `modelled`: the speed through water comes from depth and pitch; `max_depth` [m], or None if unknown.
    """

    name: str
    began: float
    ended: float
    start: tuple[float, float]
    end: tuple[float, float]
    over_ground: Array
    through_water: Array
    surface: float = 0.0
    drift: Array | None = None
    recorded: Array | None = None
    modelled: bool = False
    max_depth: float | None = None


def displacement(start: tuple[float, float], end: tuple[float, float]) -> Array:
    """Return the way (2,) [m], east and north, between two places (lon, lat) [degrees]."""
    east = (end[0] - start[0] + 180) % 360 - 180
    frame = LocalFrame(start[0] + east / 2, (start[1] + end[1]) / 2)
    x, y = frame.to_local(np.array([start[0], end[0]]), np.array([start[1], end[1]]))
    return np.array([x[1] - x[0], y[1] - y[0]])


def read_dive_records(
    file: str | Path, columns: Mapping[str, str] | None = None, *, declination: float = 0.0, attack: float = 3.0
) -> list[DiveRecord]:
    """Return the dives of a CSV file, or of a track: a NetCDF file with time, place, depth, heading and pitch.

    `columns` names columns of a CSV file, or variables of a track, that have other names. `declination` [degrees]
    is added to headings, where the compass points to magnetic north; `attack` [degrees] is the angle of attack,
    by which a track's path is steeper than its pitch. InputError if the file does not hold what is needed.
    """
    require(abs(declination) <= 180, f"the declination must be within 180 degrees of 0; got {declination:g}")
    require(0 <= attack < 30, f"the angle of attack must be from 0 to 30 degrees; got {attack:g}")
    path = Path(file)
    if path.suffix.lower() in (".nc", ".nc4", ".cdf"):
        return _track_dives(path, columns or {}, declination, attack)
    header, rows = read_table(path, "the file of dives", "dive", MOST_DIVES)
    found = find_columns(path.name, header, COLUMNS, columns or {})
    listed = f"; it has: {', '.join(header)}"
    for what in NEEDED:
        require(what in found, f"{path.name} has no column `{what}`; name it by --column {what}=COLUMN{listed}")
    way = next((pair for pair in WAYS if set(pair) <= set(found)), None)
    half = [what for pair in WAYS for what in pair if what not in found and set(pair) & set(found)]
    lacks = f"`{half[0]}` is missing" if half else "none of them is there"
    choices = ", or ".join(" and ".join(f"`{what}`" for what in pair) for pair in WAYS)
    require(
        way is not None,
        f"{path.name} does not say the way through water, and {lacks}: it needs {choices}; "
        f"name a column by --column WHAT=COLUMN{listed}",
    )
    assert way is not None
    at = {what: header.index(column) for what, column in found.items()}
    return [
        _dive(f"line {line} of {path.name}", {what: row[n].strip() for what, n in at.items()}, way, declination)
        for line, row in rows
    ]


def _dive(where: str, row: Mapping[str, str], way: Sequence[str], declination: float) -> DiveRecord:
    """Return the dive of a line, whose way through water stands in the columns `way`."""

    def number(what: str) -> float:
        try:
            value = float(row[what])
        except ValueError:
            value = math.nan
        require(math.isfinite(value), f"{where}: {what} = {row[what][:40]!r} is not a number; mend it")
        most = EARTH.get(what[:3])
        fits = most is None or abs(value) <= most
        require(fits, f"{where}: {what} = {value:g} is no such angle in degrees; mend it")
        return value

    def pair(*names: str) -> Array | None:
        return np.array([number(name) for name in names]) if all(row.get(name) for name in names) else None

    began, ended = (_moment(row[what], f"{where}: {what}") for what in ("t_start", "t_end"))
    check_times(began, ended, where)
    start, end = ((number(f"lon_{side}"), number(f"lat_{side}")) for side in ("start", "end"))
    if way == ("east", "north"):
        through = np.array([number("east"), number("north")])
    elif way == ("heading", "horizontal"):
        bearing, speed = math.radians(number("heading") + declination), number("horizontal")
        below = ended - began - (number("surface") if row.get("surface") else 0.0)
        through = speed * below * np.array([math.sin(bearing), math.cos(bearing)])
    else:
        through = displacement(start, (number("lon_reckoned"), number("lat_reckoned")))
    return DiveRecord(
        name=row.get("dive", "") or where.split(" of ")[0],
        began=began,
        ended=ended,
        start=start,
        end=end,
        over_ground=displacement(start, end),
        through_water=through,
        surface=number("surface") if row.get("surface") else 0.0,
        drift=pair("drift_east", "drift_north") if row.get("surface") else None,
        recorded=pair("recorded_east", "recorded_north"),
        max_depth=number("max_depth") if row.get("max_depth") else None,
    )


def check_times(began: float, ended: float, where: str) -> None:
    """Raise InputError unless a dive [s] ends after it begins, and within a time that a vehicle can be below."""
    require(ended > began, f"{where} ends at {ended:.0f} s, not after its begin at {began:.0f} s; mend the times")
    long = ended - began <= LONGEST_DIVE
    require(
        long, f"{where} lasts {(ended - began) / 86_400:.0f} days; give each dive its fixes, in seconds or dates"
    )


def _moment(text: str, where: str) -> float:
    """Return a time [s since 1970, UTC] from seconds or a date."""
    try:
        value = float(text)
    except ValueError:
        try:
            date = datetime.fromisoformat(text)
            value = (date.replace(tzinfo=UTC) if date.tzinfo is None else date).timestamp()
        except (ValueError, OverflowError):
            value = math.nan
    known = math.isfinite(value)
    require(
        known,
        f"{where} = {text[:40]!r} is neither seconds since 1970 nor a date such as 2024-11-20T12:00; mend it",
    )
    return value


def _track_dives(path: Path, columns: Mapping[str, str], declination: float, attack: float) -> list[DiveRecord]:
    """Return the dives of a track: the stretches below SHALLOW, each between the samples before and after it."""
    time, lat, lon, depth, heading, pitch = _track(path, columns)
    under = np.concatenate([[False], depth > SHALLOW, [False]])
    first, last = (np.flatnonzero(np.diff(under.astype(int)) == way) for way in (1, -1))
    dives: list[DiveRecord] = []
    for a, b in zip(first, last, strict=True):
        # a dive needs a fix before it and one after it
        if a == 0 or b == time.size or depth[a:b].max() < DEEP:
            continue
        some = slice(a - 1, b + 1)
        speed = horizontal_speed(
            -np.gradient(depth[some], time[some]), np.radians(pitch[some]), math.radians(attack)
        )
        known = np.isfinite(speed)
        if known.mean() < GLIDING:
            continue
        speed = np.interp(time[some], time[some][known], speed[known])
        start, end = (float(lon[a - 1]), float(lat[a - 1])), (float(lon[b]), float(lat[b]))
        check_times(time[a - 1], time[b], f"dive {len(dives) + 1} of {path.name}")
        dives.append(
            DiveRecord(
                name=str(len(dives) + 1),
                began=float(time[a - 1]),
                ended=float(time[b]),
                start=start,
                end=end,
                over_ground=displacement(start, end),
                through_water=dead_reckoned(time[some], np.radians(heading[some] + declination), speed),
                modelled=True,
                max_depth=float(depth[a:b].max()),
            )
        )
    require(
        len(dives) > 0,
        f"{path.name} holds no whole dive: from a place above {SHALLOW:g} m to below {DEEP:g} m and up again, "
        "with pitch and depth of a glide; give a longer track",
    )
    return dives


def _track(path: Path, columns: Mapping[str, str]) -> list[Array]:
    """Return time [s since 1970], lat, lon [degrees], depth [m], heading and pitch [degrees] of a track, (n,)
    each."""
    for what in columns:
        require(what in TRACK, f"`{what}` is not known; choose from: {', '.join(TRACK)}")
    values = []
    with opened(path) as data:
        for what in TRACK:
            name = columns.get(what, what)
            held = ", ".join(map(str, list(data.variables)[:40]))
            require(
                name in data.variables,
                f"{path.name} has no `{name}`; name it by --column {what}=NAME; it has: {held}",
            )
            variable: Any = data[name]
            units = str(variable.attrs.get("units", "")).lower()
            _check_units(path.name, name, what, units)
            line = np.asarray(variable.values, np.float64)
            require(
                line.ndim == 1, f"`{name}` in {path.name} has {line.ndim} dimensions; a track has one, of samples"
            )
            values.append(line * (180 / math.pi) if units.startswith("rad") else line)
    sizes = {value.size for value in values}
    require(
        len(sizes) == 1, f"the variables of {path.name} have different lengths, {sorted(sizes)}; give one track"
    )
    whole = np.isfinite(np.stack(values)).all(axis=0)
    times = values[0][whole]
    rises = bool((np.diff(times) > 0).all())
    require(rises, f"the times of {path.name} do not rise; sort the samples, and leave out those given twice")
    return [value[whole] for value in values]


def _check_units(name: str, variable: str, what: str, units: str) -> None:
    """Raise InputError if a variable of a track has units that it is not read in."""
    known = {"time": ("seconds since 1970-01-01",), "depth": ("m", "meter", "metre")}.get(what, ("deg", "rad"))
    fits = (
        not units or any(units.startswith(unit) for unit in known) if what != "time" else units.startswith(known)
    )
    require(fits, f"`{variable}` in {name} has the units {units!r}; write it in: {' or '.join(known)}")
