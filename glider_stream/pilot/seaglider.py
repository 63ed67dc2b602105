"""Seaglider's `targets` file, in which each waypoint names the next: writes it, reads it, finds its faults."""

import math
import re
from typing import NamedTuple

from ..base.settings import require
from ..search.path import Path
from ..water.frame import wrapped
from .route_columns import NotARoute
from .waypoints import degrees_and_minutes, from_degrees_and_minutes, plain_number, waypoints

RADIUS = 200.0
"""A target counts as reached at this distance [m], unless the pilot gives another."""
MOST_TARGETS = 999
NEEDED = ("lat", "lon", "radius", "goto")
OPTIONAL = {"escape": None, "depth": (-2000.0, 2000.0), "finish": (-1.0, 360.0), "timeout": (0.0, 365.0)}
"""Other keys of a target and their ranges: metres of a contour, degrees, days."""


def targets(path: Path, name: str, radius: float = RADIUS) -> dict[str, str]:
    """Return a route as a targets file; the vehicle stays at the last target."""
    require(0 < radius < math.inf, f"the arrival radius of a target must be above 0 m; got {radius:g}")
    places = waypoints(path)
    most = f"{len(places)} targets are more than the {MOST_TARGETS} that a file may hold; plan fewer surfacings"
    require(len(places) <= MOST_TARGETS, most)
    names = [f"WP{n:03}" for n in range(1, len(places) + 1)]
    lines = [
        f"{here} lat={degrees_and_minutes(at.lat)} lon={degrees_and_minutes(float(wrapped(at.lon, 0.0)))} "
        f"radius={radius:g} goto={after}"
        for here, after, at in zip(names, [*names[1:], names[-1]], places, strict=True)
    ]
    return {name: "\n".join(["/ a route of glider-stream", f"/ {_depths(path)}", *lines]) + "\n"}


def _depths(path: Path) -> str:
    """Return what the plan says of depths, which a targets file cannot hold."""
    deepest = max(-float(z) for leg in path.legs for z in (leg.start[2], leg.end[2]))
    clearance = "a clearance that it does not tell" if path.origin is None else f"{path.origin.clearance:g} m"
    return (
        f"this file holds no depth: the plan dives to {deepest:g} m ($D_TGT) and keeps {clearance} above the "
        "seabed ($ALTIM_BOTTOM_TURN_MARGIN)"
    )


class Target(NamedTuple):
    """A line of a targets file: its number, the target's name, and its values by key."""

    line: int
    name: str
    values: dict[str, str]


def read_targets(text: str) -> tuple[list[Target], list[str]]:
    """Return the targets of a file and the faults of its lines; comments begin with a slash."""
    found, faults = [], list[str]()
    for n, line in enumerate(text.splitlines(), 1):
        if not line.isascii():
            faults.append(f"line {n} has a character outside ASCII: {line.strip()!r}")
        if line.startswith("/") or not line.strip():
            continue
        if line != line.strip():
            faults.append(f"line {n} begins or ends with a blank")
        # public files have blanks after an equals sign
        name, *parts = re.sub(r"\s*=\s*", "=", line.strip()).split()
        values = dict(part.split("=", 1) for part in parts if "=" in part)
        if len(values) < len(parts) or "=" in name:
            faults.append(f"line {n} must be a name and key=value, each key once: {line.strip()!r}")
        found.append(Target(n, name, values))
    return found, faults


def target_faults(text: str) -> list[str]:
    """Return the faults of a targets file, one sentence each; no fault if it can be flown."""
    found, faults = read_targets(text)
    names = [target.name for target in found]
    if not found:
        faults.append("there is no target")
    for target in found:
        where, values = f"target {target.name} in line {target.line}", target.values
        if names.count(target.name) > 1 and names.index(target.name) < found.index(target):
            faults.append(f"{where} is given twice")
        if not re.fullmatch(r"\w+", target.name):
            faults.append(f"{where} must have a name of letters and numbers")
        for key in NEEDED:
            if key not in values:
                faults.append(f"{where} has no {key}")
        for key in values:
            if key not in (*NEEDED, *OPTIONAL):
                faults.append(f"{where} has the unknown key {key}; check its spelling")
        for key in ("goto", "escape"):
            if key in values and values[key] not in names:
                faults.append(f"{where} has {key}={values[key]}, but that target does not exist")
        for key, most in (("lat", 90.0), ("lon", 180.0)):
            faults += _angle_fault(where, key, values.get(key), most)
        for key, bounds in {"radius": (1e-3, 1e6), **OPTIONAL}.items():
            if bounds is not None and key in values and not _within(values[key], *bounds):
                faults.append(f"{where} has {key}={values[key]}; it must be from {bounds[0]:g} to {bounds[1]:g}")
    return faults


def _within(text: str, least: float, most: float) -> bool:
    try:
        return least <= plain_number(text) <= most
    except ValueError:
        return False


def _angle_fault(where: str, key: str, text: str | None, most: float) -> list[str]:
    """Return the faults of an angle in degrees and minutes."""
    if text is None:
        return []
    try:
        angle = from_degrees_and_minutes(text)
    except ValueError as error:
        return [f"{where} has {key}={text}; it must be degrees and minutes, (D)DDMM.m: {error}"]
    return [] if abs(angle) <= most else [f"{where} has {key}={text}, {angle:g} degrees; at most {most:g}"]


def target_points(text: str) -> tuple[list[tuple[float, float, float]], list[str]]:
    """Return the targets in flown order as lon, lat [degrees], depth 0 [m], and notes on what is open.

    NotARoute if the vehicle would not fly them.
    """
    faults = target_faults(text)
    if faults:
        raise NotARoute(f"{faults[0]}; `glider-stream lint` shows all its faults")
    found, _ = read_targets(text)
    by_name = {target.name: target for target in found}
    way: list[str] = []
    name = found[0].name
    while name not in way:
        way.append(name)
        name = by_name[name].values["goto"]
    notes = [f"the targets begin with {way[0]}, the first of the file; the vehicle may be sent to another"]
    left = [target.name for target in found if target.name not in way]
    if left:
        notes.append(f"no goto leads from {way[0]} to {', '.join(left)}; they are not part of the route")
    if name != way[-1]:
        notes.append(f"the targets are flown again and again, from {name}; they are read once")
    places = [[from_degrees_and_minutes(by_name[target].values[key]) for key in ("lon", "lat")] for target in way]
    return [(lon, lat, 0.0) for lon, lat in places], notes
