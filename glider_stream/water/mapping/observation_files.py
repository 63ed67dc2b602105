"""Reads what gliders and drifters measured: CSV, and the NetCDF of Seaglider, Slocum, pyglider and IOOS."""

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array
from ...base.errors import InputError
from ...base.settings import require
from ...base.table import find_columns, read_table
from ..ocean.file import Times, parse_time
from ..ocean.names import SINCE, units_of
from ..ocean.opening import opened
from ..ocean.units import in_metres_per_second
from .measured import Dives, Drifters, Points

MOST_ROWS = 200_000
ERROR = 0.02
"""The standard deviation [m/s] of a measurement that states none; what is beyond is fitted as noise."""
SURFACED = 3.0
"""A glider shallower than this [m] is at the surface."""
SHALLOWEST = 5.0
"""A dive that stays above this depth [m] is not one."""
BAD = {"3", "4", "9"}
"""Quality flags of values that are suspect, bad or missing."""
DIVE_COLUMNS = {
    "lon": ("lon", "longitude", "lon_start", "start_lon", "longitude_start"),
    "lat": ("lat", "latitude", "lat_start", "start_lat", "latitude_start"),
    "lon_end": ("lon_end", "end_lon", "longitude_end"),
    "lat_end": ("lat_end", "end_lat", "latitude_end"),
    "start": ("start", "time", "t_start", "time_start", "start_time", "t_start_unix"),
    "end": ("end", "t_end", "time_end", "end_time", "t_end_unix"),
    "bottom": ("bottom", "max_depth", "max_depth_m", "depth", "depth_max", "depth_m"),
    "east": (
        "dac_east",
        "dac_east_mps",
        "east_mps",
        "u",
        "dac_u",
        "depth_avg_curr_east",
        "depth_average_current_east",
    ),
    "north": (
        "dac_north",
        "dac_north_mps",
        "north_mps",
        "v",
        "dac_v",
        "depth_avg_curr_north",
        "depth_average_current_north",
    ),
    "error": ("error", "dac_error", "dac_error_mps", "depth_avg_curr_error", "error_east_mps"),
}
POINT_COLUMNS = {
    "lon": ("lon", "longitude"),
    "lat": ("lat", "latitude"),
    "depth": ("depth", "depth_m"),
    "time": ("time", "date", "t_unix"),
    "east": ("u", "east", "u_east", "uo", "u_mps", "east_mps"),
    "north": ("v", "north", "v_north", "vo", "v_mps", "north_mps"),
    "error": ("error", "error_mps"),
}
DRIFTER_COLUMNS = {
    "drifter": ("drifter", "id", "drifter_id", "platform", "buoy"),
    **{name: POINT_COLUMNS[name] for name in ("lon", "lat", "depth", "time", "error")},
}
IN_NETCDF = [
    ("depth_avg_curr_east", "depth_avg_curr_north"),
    ("depth_average_current_east", "depth_average_current_north"),
    ("water_velocity_eastward", "water_velocity_northward"),
    ("m_final_water_vx", "m_final_water_vy"),
    ("m_water_vx", "m_water_vy"),
    ("u", "v"),
]
"""Names of the current averaged over a dive."""


def read_dives(files: str | Path | Sequence[str | Path], columns: Mapping[str, str] | None = None) -> Dives:
    """Return the dives of CSV or NetCDF files; `columns` names a CSV file's columns that have other names.

    A CSV file needs the columns of DIVE_COLUMNS, but for an end (the start is taken) and an error (then ERROR).
    A dive without a current, or with a bad quality flag, is left out, and a note says so.
    """
    paths = [Path(files)] if isinstance(files, (str, Path)) else [Path(path) for path in files]
    require(len(paths) > 0, "a correction needs at least one file of dives; got none")
    parts = [_dives_of(path, columns or {}) for path in paths]
    notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
    names = ("lon", "lat", "lon_end", "lat_end", "start", "end", "bottom", "east", "north", "error")
    joined: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    # the profiles of one dive repeat its current
    same = joined["lon"], joined["lat"], joined["start"].astype(np.float64), joined["east"], joined["north"]
    rows = np.stack(same, axis=-1)
    _, once = np.unique(rows, axis=0, return_index=True)
    once = np.sort(once)
    return Dives(**{name: values[once] for name, values in joined.items()}, yos=1, notes=notes)


def _dives_of(path: Path, columns: Mapping[str, str]) -> Dives:
    if path.suffix.lower() in (".csv", ".txt", ".tsv"):
        return _dives_in_table(path, columns)
    require(not columns, f"columns are named for CSV files; {path.name} is not one: leave them out")
    with opened(path) as data:
        return _dives_in_netcdf(path.name, data)


def _dives_in_table(path: Path, columns: Mapping[str, str]) -> Dives:
    table = _Columns(path, "the file of dives", "dive", DIVE_COLUMNS, columns)
    lon, lat = table.numbers("lon"), table.numbers("lat")
    start = table.times("start")
    moved = "lon_end" in table.found and "lat_end" in table.found
    notes = () if moved else (f"{path.name} does not say where dives end: each is taken to stay where it starts",)
    return Dives(
        lon,
        lat,
        table.numbers("lon_end") if moved else lon,
        table.numbers("lat_end") if moved else lat,
        start,
        table.times("end") if "end" in table.found else start,
        table.numbers("bottom"),
        table.numbers("east"),
        table.numbers("north"),
        table.numbers("error", ERROR),
        notes=notes,
    )


def read_points(file: str | Path, columns: Mapping[str, str] | None = None) -> Points:
    """Return the currents at points of a CSV file with the columns of POINT_COLUMNS; depth and time may lack."""
    table = _Columns(Path(file), "the file of points", "point", POINT_COLUMNS, columns or {})
    return Points(
        table.numbers("lon"),
        table.numbers("lat"),
        table.numbers("depth", 0.0),
        table.times("time") if "time" in table.found else None,
        table.numbers("east"),
        table.numbers("north"),
        table.numbers("error", ERROR),
    )


def read_drifters(file: str | Path, columns: Mapping[str, str] | None = None) -> Drifters:
    """Return the displacements of the drifters in a CSV file with the columns of DRIFTER_COLUMNS."""
    table = _Columns(Path(file), "the file of drifters", "fix", DRIFTER_COLUMNS, columns or {})
    at = table.numbers("lon"), table.numbers("lat"), table.times("time")
    names = table.cells("drifter") if "drifter" in table.found else ["one"] * at[0].size
    return Drifters.from_fixes(names, *at, table.numbers("depth", 0.0), table.numbers("error", ERROR))


class _Columns:
    """The columns of a CSV file of measurements."""

    def __init__(
        self,
        path: Path,
        what: str,
        row: str,
        usual: Mapping[str, Sequence[str]],
        given: Mapping[str, str],
    ) -> None:
        self.name, self.usual = path.name, usual
        self.header, self.rows = read_table(path, what, row, MOST_ROWS)
        self.found = find_columns(path.name, self.header, usual, given)

    def cells(self, what: str) -> list[str]:
        """Return the texts of a column; InputError without it."""
        require(
            what in self.found,
            f"{self.name} has no column for `{what}`, such as {' or '.join(self.usual[what][:2])}; name it, "
            f"or add it; it has: {', '.join(self.header)}",
        )
        at = self.header.index(self.found[what])
        return [row[at] for _, row in self.rows]

    def numbers(self, what: str, otherwise: float | None = None) -> Array:
        """Return the numbers of a column, or `otherwise` without it."""
        if what not in self.found and otherwise is not None:
            return np.full(len(self.rows), otherwise)
        values = np.empty(len(self.rows))
        for n, ((line, _), cell) in enumerate(zip(self.rows, self.cells(what), strict=True)):
            try:
                values[n] = float(cell)
            except ValueError:
                values[n] = np.nan
            fits = bool(np.isfinite(values[n]))
            where = f"line {line} of {self.name}: {self.found[what]} = {cell[:40]!r}"
            require(fits, f"{where} is not a number; mend it, or leave that line out")
        return values

    def times(self, what: str) -> Times:
        """Return the times of a column: ISO 8601 in UTC, or seconds since 1970."""
        found: list[Any] = []
        for (line, _), cell in zip(self.rows, self.cells(what), strict=True):
            where = f"line {line} of {self.name}: {self.found[what]}"
            if re.fullmatch(r"\d{9,10}(\.\d*)?(e\+?\d+)?", cell.strip(), re.IGNORECASE):
                found.append(np.datetime64(round(float(cell) * 1000), "ms"))
            else:
                found.append(parse_time(cell, where))
        return np.array(found, dtype="datetime64[ms]")


def _dives_in_netcdf(name: str, data: Any) -> Dives:
    """Return the dives of a file of a glider; InputError if it holds no current averaged over dives."""
    pair = next((pair for pair in IN_NETCDF if all(part in data.variables for part in pair)), None)
    if pair is None:
        known = ", ".join(" and ".join(pair) for pair in IN_NETCDF)
        raise InputError(
            f"{name} holds no current averaged over a dive (known: {known}): give a file that does, or a CSV file"
        )
    east, north = (_speeds(name, data, part) for part in pair)
    if "log_gps_lat" in data.variables:
        return _seaglider(name, data, pair, east, north)
    if "time_uv" in data.variables:
        return _profiles(name, data, pair, east, north)
    along = data[pair[0]].dims
    require(
        len(along) == 1 and east.size > 1,
        f"`{pair[0]}` in {name} is one number, and neither log_gps_lat nor time_uv says where: give a CSV file",
    )
    return _series(name, data, pair, east, north)


def _speeds(name: str, data: Any, which: str) -> Array:
    """Return a current [m/s], NaN where it is missing."""
    units = units_of(data[which])
    factor = in_metres_per_second(units) if units else 1.0
    require(
        factor is not None, f"`{which}` in {name} is in {units!r}, which is not a known unit of speed: give m/s"
    )
    assert factor is not None
    values = np.atleast_1d(np.asarray(data[which].values, dtype=np.float64)).ravel() * factor
    return np.where(np.abs(values) < 50.0, values, np.nan)


def _flagged(data: Any, which: Sequence[str], size: int) -> NDArray[np.bool_]:
    """Return where a quality flag beside one of some variables says that it is bad."""
    bad = np.zeros(size, dtype=bool)
    for name in which:
        if name not in data.variables:
            continue
        flags = np.atleast_1d(data[name].values).ravel()
        if flags.size == size:
            texts = [
                flag.decode("ascii", "replace") if isinstance(flag, bytes) else str(flag).removesuffix(".0")
                for flag in flags.tolist()
            ]
            bad |= np.array([text.strip() in BAD for text in texts])
    return bad


def _clock(name: str, data: Any, which: str) -> Times:
    """Return times; without a unit they are seconds since 1970."""
    variable = data[which]
    values = np.atleast_1d(np.asarray(variable.values)).ravel()
    if values.dtype.kind == "M":
        return values.astype("datetime64[ms]")
    units = units_of(variable)
    values = values.astype(np.float64)
    good = np.isfinite(values) & (np.abs(values) < 1e12)
    found = np.full(values.size, np.datetime64("NaT"), dtype="datetime64[ms]")
    if SINCE.search(units):
        import xarray

        bare = xarray.Dataset({"time": ("n", values[good], {"units": units})})
        found[good] = xarray.decode_cf(bare)["time"].values.astype("datetime64[ms]")
        return found
    require(
        units.lower() in ("", "s", "sec", "second", "seconds", "timestamp"),
        f"`{which}` in {name} has the unit {units!r}, which is not a time: write seconds since 1970-01-01",
    )
    found[good] = np.round(values[good] * 1000).astype("datetime64[ms]")
    return found


def _first_of(name: str, data: Any, which: Sequence[str], what: str) -> Array:
    found = next((part for part in which if part in data.variables), None)
    if found is None:
        raise InputError(f"{name} holds no {what} ({', '.join(which)}); add it, or give a CSV file")
    values = np.atleast_1d(np.asarray(data[found].values, dtype=np.float64)).ravel()
    values = np.where(np.abs(values) < 1e5, values, np.nan)
    require(bool(np.isfinite(values).any()), f"`{found}` in {name} is missing everywhere; give a CSV file")
    return values


def _left_out(name: str, good: NDArray[np.bool_], why: str) -> tuple[str, ...]:
    return () if good.all() else (f"{int((~good).sum())} of {good.size} dives of {name} are left out: {why}",)


def _seaglider(name: str, data: Any, pair: tuple[str, str], east: Array, north: Array) -> Dives:
    """Return the dive of a file of the Seaglider basestation: from its second fix to its third."""
    lon, lat = (_first_of(name, data, (f"log_gps_{part}",), "fix") for part in ("lon", "lat"))
    time = _clock(name, data, "log_gps_time")
    require(
        lon.size == lat.size == time.size == 3 and east.size == 1,
        f"{name} must hold three fixes (before, at the start, at the end of the dive); got {lon.size}",
    )
    depth = _first_of(name, data, ("ctd_depth", "depth", "eng_depth_m"), "depth")
    error = np.full(1, ERROR)
    if "depth_avg_curr_error" in data.variables:
        stated = _speeds(name, data, "depth_avg_curr_error")
        error = np.where(np.isfinite(stated) & (stated > 0), stated, ERROR)
    good = np.isfinite(east) & np.isfinite(north) & ~_flagged(data, ("depth_avg_curr_qc",), 1)
    require(bool(good[0]), f"{name} holds no good current (`{pair[0]}`); leave it out")
    ends = (lon[1:2], lat[1:2], lon[2:3], lat[2:3], time[1:2], time[2:3])
    return Dives(*ends, np.array([np.nanmax(depth)]), east, north, error)


def _profiles(name: str, data: Any, pair: tuple[str, str], east: Array, north: Array) -> Dives:
    """Return the dives of IOOS profiles, each with its place and time, and the depth of the nearest samples."""
    lon, lat = (_first_of(name, data, (f"{part}_uv",), "place") for part in ("lon", "lat"))
    when = _clock(name, data, "time_uv")
    require(
        lon.size == lat.size == when.size == east.size,
        f"`{pair[0]}`, lat_uv, lon_uv and time_uv in {name} must be equally long; got {east.size}, {lat.size}, "
        f"{lon.size}, {when.size}",
    )
    depth = _first_of(name, data, ("depth", "pressure"), "depth")
    good = np.isfinite(east) & np.isfinite(north) & np.isfinite(lon) & np.isfinite(lat) & ~np.isnat(when)
    good &= ~_flagged(data, (f"{pair[0]}_qc", f"{pair[1]}_qc"), east.size)
    require(bool(good.any()), f"{name} holds no good current (`{pair[0]}`); leave it out")
    bottom = np.full(east.size, np.nanmax(depth))
    if east.size > 1:
        samples = _clock(name, data, "time")
        require(samples.size == depth.size, f"`depth` in {name} must have one value for each `time`")
        held = np.isfinite(depth) & ~np.isnat(samples)
        order = np.argsort(when[good])
        centres = when[good][order].astype(np.float64)
        edges = (centres[1:] + centres[:-1]) / 2
        group = np.searchsorted(edges, samples[held].astype(np.float64))
        deepest = np.array([depth[held][group == n].max(initial=0.0) for n in range(centres.size)])
        bottom[np.flatnonzero(good)[order]] = deepest
    good &= bottom > SHALLOWEST
    notes: tuple[str, ...] = (
        f"{name} does not say where dives start and end: each is taken to stay at lat_uv, lon_uv",
    )
    notes += _left_out(name, good, "no good current, or no depth")
    require(bool(good.any()), f"{name} holds no dive deeper than {SHALLOWEST:g} m; leave it out")
    at = (lon[good], lat[good], lon[good], lat[good], when[good], when[good])
    error = np.full(int(good.sum()), ERROR)
    return Dives(*at, bottom[good], east[good], north[good], error, notes=notes)


def _series(name: str, data: Any, pair: tuple[str, str], east: Array, north: Array) -> Dives:
    """Return the dives of a time series (Slocum, pyglider), each from one surfacing to the next.

    A vehicle reports the current of a dive when it is back at the surface: it is the last report before the next
    dive begins. Programs that fill gaps repeat an old report, so one that repeats the report before, to the last
    digit, is none.
    """
    clock = next((part for part in ("time", "m_present_time") if part in data.variables), None)
    if clock is None:
        raise InputError(f"{name} holds no time (time, m_present_time); add it, or give a CSV file")
    time = _clock(name, data, clock)
    lon = _first_of(name, data, ("longitude", "lon", "m_lon", "m_gps_lon"), "longitude")
    lat = _first_of(name, data, ("latitude", "lat", "m_lat", "m_gps_lat"), "latitude")
    depth = _first_of(name, data, ("depth", "m_depth"), "depth")
    require(
        time.size == lon.size == lat.size == depth.size == east.size,
        f"time, longitude, latitude, depth and `{pair[0]}` in {name} must be equally long",
    )
    require(
        bool(np.nanmax(np.abs(lat), initial=0) <= 90 and np.nanmax(np.abs(lon), initial=0) <= 360),
        f"{name} holds degrees and minutes in one number (such as -7411.587): convert them to degrees",
    )
    up, rows = _surfacings(depth, time)
    found: list[tuple[int, int, int, float]] = []
    missing = 0
    for (_, start), (end, last) in pairwise(up):
        bottom = float(np.nanmax(depth[rows[start] : rows[end] + 1]))
        if not bottom > SHALLOWEST:
            continue
        reports = np.arange(rows[end], rows[last] + 1)
        reports = reports[np.isfinite(east[reports]) & np.isfinite(north[reports])]
        fixes = [_nearest(np.isfinite(lon) & np.isfinite(lat), rows[row]) for row in (start, end)]
        last_report = int(reports[-1]) if reports.size else -1
        before = found[-1][2] if found else -1
        fresh = before < 0 or (east[last_report], north[last_report]) != (east[before], north[before])
        if reports.size and fresh and not np.isnat(time[fixes]).any():
            found.append((fixes[0], fixes[1], last_report, bottom))
        else:
            missing += 1
    require(
        len(found) > 0,
        f"{name} holds no dive from the surface (above {SURFACED:g} m) to the surface with a report of "
        f"`{pair[0]}` at its end; give a CSV file of dives",
    )
    first, second, report = (np.array([row[n] for row in found], dtype=np.int64) for n in range(3))
    notes = (
        (f"{missing} dives of {name} are left out: no new current is reported at their end",) if missing else ()
    )
    ends = (lon[first], lat[first], lon[second], lat[second], time[first], time[second])
    bottoms = np.array([row[3] for row in found])
    error = np.full(len(found), ERROR)
    return Dives(*ends, bottoms, east[report], north[report], error, notes=notes)


def _surfacings(depth: Array, time: Times) -> tuple[list[tuple[int, int]], NDArray[np.int64]]:
    """Return the first and last sample of each stay at the surface, as numbers of the samples that have a depth.

    Also returns the rows of these samples.
    """
    rows = np.flatnonzero(np.isfinite(depth) & ~np.isnat(time))
    shallow = np.concatenate([[False], depth[rows] < SURFACED, [False]])
    edges = np.flatnonzero(np.diff(shallow.astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)], rows


def _nearest(good: NDArray[np.bool_], row: int) -> int:
    """Return the row with good values that is nearest to one."""
    rows = np.flatnonzero(good)
    return int(rows[np.abs(rows - row).argmin()])
