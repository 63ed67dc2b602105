"""Slocum mission files: goto lists of waypoints, the yo between them, and a linter for either's traps.

A waypoint carries no depth and a yo one envelope, so a plan with a trim for each leg is not fully expressible
here; a vehicle with `u_use_current_correction` steers for itself, by waypoints, not by our headings.
"""

import math
import re

import numpy as np

from ..base.settings import require
from ..search.path import Path
from ..water.frame import wrapped
from .waypoints import Waypoint, degrees_and_minutes, from_degrees_and_minutes, waypoints

MOST_WAYPOINTS = 8
"""Waypoints that a goto list may hold."""
WITHIN = 500
"""A waypoint counts as reached this near [m]."""
NAME = re.compile(r"goto_l(\d\d)\.ma")


def list_number(name: str) -> int:
    """The NN of goto_lNN.ma; InputError where the name is another."""
    fits = NAME.fullmatch(name)
    require(fits is not None, f"a Slocum goto list must be called goto_lNN.ma, NN two digits; got {name}")
    assert fits is not None
    return int(fits[1])


def mission_files(path: Path, name: str, most: int = MOST_WAYPOINTS) -> dict[str, str]:
    """A route as numbered goto lists of `most` waypoints each, the first called `name`, and one yo file."""
    places, first = waypoints(path), list_number(name)
    parts = [places[n : n + most] for n in range(0, len(places), most)]
    last = first + len(parts) - 1
    require(last <= 99, f"{len(places)} waypoints need the lists {first} to {last}, past 99; begin lower")
    lists = {f"goto_l{first + n:02}.ma": goto_list(part) for n, part in enumerate(parts)}
    return lists | {f"yo{first:02}.ma": yo(path)}


def goto_list(places: list[Waypoint]) -> str:
    """The text of a goto list: longitude first, degrees and minutes packed; flown once, in order."""
    rows = [f"{degrees_and_minutes(float(wrapped(at.lon, 0.0)))}\t{degrees_and_minutes(at.lat)}" for at in places]
    return "\n".join([
        "behavior_name=goto_list",
        "<start:b_arg>",
        "\tb_arg: num_legs_to_run(nodim) -2   # once",
        "\tb_arg: start_when(enum) 0          # immediately",
        "\tb_arg: list_stop_when(enum) 7      # within list_when_wpt_dist of the waypoint",
        f"\tb_arg: list_when_wpt_dist(m) {WITHIN}",
        "\tb_arg: initial_wpt(enum) 0         # the first",
        f"\tb_arg: num_waypoints(nodim) {len(places)}",
        "<end:b_arg>",
        "<start:waypoints>",
        *rows,
        "<end:waypoints>",
    ]) + "\n"  # fmt: skip


def yo(path: Path) -> str:
    """The text of a yo file: the envelope of the route's legs."""
    depth = [-float(z) for leg in path.legs for z in (leg.start[2], leg.end[2])]
    dives = [leg.glide_angle for leg in path.legs if leg.glide_angle < 0] or [-math.radians(26)]
    climbs = [leg.glide_angle for leg in path.legs if leg.glide_angle > 0] or [-dives[0]]
    return "\n".join([
        "behavior_name=yo",
        f"# glide angles of the plan: dives {_range(dives)}, climbs {_range(climbs)} degrees; medians below",
        "# pitch is the glide angle less the angle of attack, some 3 degrees: trim it in the water",
        "<start:b_arg>",
        "\tb_arg: start_when(enum) 2          # pitch idle",
        "\tb_arg: num_half_cycles_to_do(nodim) -1",
        f"\tb_arg: d_target_depth(m) {max(depth):.0f}",
        "\tb_arg: d_use_pitch(enum) 3         # servo",
        f"\tb_arg: d_pitch_value(rad) {float(np.median(dives)):.4f}",
        f"\tb_arg: c_target_depth(m) {min(depth):.0f}",
        "\tb_arg: c_use_pitch(enum) 3         # servo",
        f"\tb_arg: c_pitch_value(rad) {float(np.median(climbs)):.4f}",
        "<end:b_arg>",
    ]) + "\n"  # fmt: skip


def _range(angles: list[float]) -> str:
    low, high = (math.degrees(angle) for angle in (min(angles), max(angles)))
    return f"{low:.1f} to {high:.1f}"


def lint(text: str) -> list[str]:
    """What is wrong with a goto list, a sentence each; none where it can be flown."""
    faults = []
    lines = text.splitlines()
    for n, line in enumerate(lines, 1):
        if not line.isascii():
            faults.append(f"line {n} has a character outside ASCII: {line.strip()!r}")
    if not lines or lines[0].split("#")[0].strip() != "behavior_name=goto_list":
        faults.append("the first line must be behavior_name=goto_list")
    code = [line.split("#")[0].strip() for line in lines]
    arguments = dict(re.findall(r"b_arg:\s*(\w+)\(\w+\)\s+(\S+)", "\n".join(code)))
    try:
        rows = [row for row in code[code.index("<start:waypoints>") + 1 : code.index("<end:waypoints>")] if row]
    except ValueError:
        return [*faults, "the waypoints must stand between <start:waypoints> and <end:waypoints>"]
    said = arguments.get("num_waypoints")
    if said != str(len(rows)):
        faults.append(f"num_waypoints is {said}, and there are {len(rows)} rows")
    if len(rows) > MOST_WAYPOINTS:
        faults.append(f"{len(rows)} waypoints are more than {MOST_WAYPOINTS}")
    if arguments.get("num_legs_to_run") == "0":
        faults.append("num_legs_to_run must not be 0")
    if arguments.get("initial_wpt", "0") not in ("0", "-1", "-2", *map(str, range(len(rows)))):
        faults.append(f"initial_wpt is {arguments['initial_wpt']}, no waypoint's number")
    if arguments.get("initial_wpt") == "-2" and len(rows) > 1:
        faults.append("initial_wpt is -2, the closest: an ordered route begins at 0")
    for row in rows:
        faults += _row_faults(row)
    return faults


def _row_faults(row: str) -> list[str]:
    try:
        _, lat = (from_degrees_and_minutes(part) for part in row.split())
    except ValueError as error:
        return [f"the row {row!r} is no longitude and latitude, DDDMM.mmmm DDMM.mmmm: {error}"]
    if abs(lat) > 90:
        return [f"the row {row!r} has a latitude of {lat:g}; the longitude stands first"]
    return []
