"""Slocum mission files of a route: goto lists of waypoints, and the yo between them.

A waypoint has no depth and a yo has one range of depths, so these files cannot hold a plan with a trim for each
leg. A vehicle with `u_use_current_correction` steers by waypoints, not by our headings.
"""

import math
import re
from itertools import pairwise
from pathlib import Path as File

import numpy as np

from ..base.settings import require
from ..search.path import FROZEN, SURFACE, Path
from ..water.frame import wrapped
from .slocum_files import (
    LEAST_DEPTH,
    LEAST_RADIUS,
    MOST_ALTITUDE,
    MOST_DEPTH,
    MOST_WAYPOINTS,
    read_mission_file,
)
from .waypoints import Waypoint, degrees_and_minutes, from_degrees_and_minutes, waypoints

RADIUS = 500.0
"""A waypoint counts as reached at this distance [m], unless the pilot gives another."""
NAME = re.compile(r"goto_l(\d\d)\.ma")
SERIES = re.compile(r"# written by glider-stream: list (\d+) of the route that begins in (goto_l\d\d\.ma)")
"""The comment that marks our own lists."""
SAME_DEPTH = 10.0
"""Turns of a plan this near to those of the yo file [m] are flown as planned."""
LEAST_ALTITUDE = 5.0
"""The vehicle turns at least this far above the bottom [m], whatever the plan keeps: masterdata's value."""
STEEPEST = math.radians(26.0)
"""The pitch of the dive or climb if the route has no such leg: masterdata's value."""


def list_number(name: str) -> int:
    """Return the NN of goto_lNN.ma; InputError for any other name."""
    fits = NAME.fullmatch(name)
    require(fits is not None, f"a Slocum goto list must be called goto_lNN.ma, NN two digits; got {name}")
    assert fits is not None
    return int(fits[1])


def _list_name(number: int) -> str:
    return f"goto_l{number:02}.ma"


def mission_files(path: Path, name: str, most: int = MOST_WAYPOINTS, radius: float = RADIUS) -> dict[str, str]:
    """Return a route as goto lists of at most `most` waypoints, the first named `name`, and one yo file."""
    require(1 <= most <= 99, f"a goto list must hold from 1 to 99 waypoints; got {most}")
    least = f"the arrival radius of a waypoint must be at least {LEAST_RADIUS:g} m; got {radius:g}"
    require(LEAST_RADIUS <= radius < math.inf, least)
    places, first = waypoints(path), list_number(name)
    parts = [places[n : n + most] for n in range(0, len(places), most)]
    last = first + len(parts) - 1
    require(
        last <= 99,
        f"{len(places)} waypoints need the lists {first} to {last}, but 99 is the last; begin with a lower "
        "number",
    )
    lists = {_list_name(first + n): goto_list(part, radius, n + 1, name) for n, part in enumerate(parts)}
    return lists | {f"yo{first:02}.ma": yo(path)}


def goto_list(places: list[Waypoint], radius: float = RADIUS, part: int = 1, name: str = "goto_l10.ma") -> str:
    """Return the text of a goto list: longitude first, degrees and minutes packed; flown once, in order.

    A comment tells which `part` it is of the route whose first list has the name `name`.
    """
    rows = [f"{degrees_and_minutes(float(wrapped(at.lon, 0.0)))}\t{degrees_and_minutes(at.lat)}" for at in places]
    return "\n".join([
        "behavior_name=goto_list",
        f"# written by glider-stream: list {part} of the route that begins in {name}",
        "<start:b_arg>",
        "\tb_arg: num_legs_to_run(nodim) -2   # once",
        "\tb_arg: start_when(enum) 0          # immediately",
        "\tb_arg: list_stop_when(enum) 7      # within list_when_wpt_dist of the waypoint",
        f"\tb_arg: list_when_wpt_dist(m) {radius:g}",
        "\tb_arg: initial_wpt(enum) 0         # the first",
        f"\tb_arg: num_waypoints(nodim) {len(places)}",
        "<end:b_arg>",
        "<start:waypoints>",
        *rows,
        "<end:waypoints>",
    ]) + "\n"  # fmt: skip


def yo(path: Path) -> str:
    """Return the text of a yo file: the range of depths of the route's legs, within a Slocum's limits.

    It never dives below the plan. InputError if the route is deeper than the vehicle goes, or too shallow for a
    yo.
    """
    depth = [-float(z) for leg in path.legs for z in (leg.start[2], leg.end[2])]
    deep, planned = math.floor(10 * max(depth) + 1e-6) / 10, max(0.0, min(depth))
    shallow = max(LEAST_DEPTH, math.ceil(10 * planned - 1e-6) / 10)
    limit = f"the route dives to {max(depth):g} m, but a Slocum's yo ends at {MOST_DEPTH:g} m; plan no deeper"
    require(deep <= MOST_DEPTH, limit)
    room = f"the route stays between {planned:g} and {max(depth):g} m, but a Slocum's yo turns at {LEAST_DEPTH:g}"
    require(deep > shallow, f"{room} m and more; plan deeper, or write a file of another kind")
    dives = [leg.glide_angle for leg in path.legs if leg.glide_angle < 0]
    climbs = [leg.glide_angle for leg in path.legs if leg.glide_angle > 0]
    height, reason = altitude(path)
    raised = "" if shallow == planned else f"   # the plan has {planned:g}, {LEAST_DEPTH:g} is the least"
    return "\n".join([
        "behavior_name=yo",
        f"# glide angles of the plan: dives {_range(dives)}, climbs {_range(climbs)}; medians below",
        "# pitch is the glide angle less the angle of attack, some 3 degrees: trim it in the water",
        "# a route surfaces at each waypoint: your surfac file must say so, a yo only turns below the surface",
        "# buoyancy is the vehicle's default: add d_use_bpump, d_bpump_value and those of the climb to change it",
        "<start:b_arg>",
        "\tb_arg: start_when(enum) 2          # pitch idle",
        "\tb_arg: num_half_cycles_to_do(nodim) -1",
        f"\tb_arg: d_target_depth(m) {deep:g}",
        f"\tb_arg: d_target_altitude(m) {height:g}   # turns this far above the bottom: {reason}",
        "\tb_arg: d_use_pitch(enum) 3         # servo",
        f"\tb_arg: d_pitch_value(X) {float(np.median(dives or [-STEEPEST])):.4f}",
        f"\tb_arg: c_target_depth(m) {shallow:g}{raised}",
        "\tb_arg: c_target_altitude(m) -1",
        "\tb_arg: c_use_pitch(enum) 3         # servo",
        f"\tb_arg: c_pitch_value(X) {float(np.median(climbs or [STEEPEST])):.4f}",
        "\tb_arg: end_action(enum) 2          # resume",
        "<end:b_arg>",
    ]) + "\n"  # fmt: skip


def altitude(path: Path) -> tuple[float, str]:
    """Return the height above the bottom [m] at which the vehicle turns, and why.

    It is the plan's clearance, within what the vehicle accepts: never less, unless the plan keeps more than
    MOST_ALTITUDE.
    """
    clearance = None if path.origin is None else path.origin.clearance
    if clearance is None:
        return LEAST_ALTITUDE, "the plan does not tell its clearance, put yours here"
    if clearance > MOST_ALTITUDE:
        return MOST_ALTITUDE, f"LESS than the plan's clearance of {clearance:g} m; {MOST_ALTITUDE:g} is the most"
    if clearance < LEAST_ALTITUDE:
        return LEAST_ALTITUDE, f"the plan's clearance is {clearance:g} m, {LEAST_ALTITUDE:g} is the least"
    return clearance, "the plan's clearance"


def altitude_notes(path: Path, name: str) -> list[str]:
    """Return a sentence if the yo file beside the list `name` does not keep the plan's clearance."""
    height, reason = altitude(path)
    clearance = None if path.origin is None else path.origin.clearance
    keeps = clearance is not None and height >= clearance
    return [] if keeps else [f"yo{list_number(name):02}.ma has d_target_altitude {height:g} m: {reason}"]


def turn_notes(path: Path, name: str) -> list[str]:
    """Return a sentence if the plan's yos are not those of the yo file beside the list `name`: all alike."""
    depth = [-float(z) for leg in path.legs for z in (leg.start[2], leg.end[2])]
    deepest, shallow = max(depth), max(LEAST_DEPTH, min(depth))
    off = []
    for leg, following in pairwise(path.legs):
        here, dives = -float(leg.end[2]), leg.glide_angle < 0
        if dives != (following.glide_angle < 0) and (dives or here > SURFACE):
            off.append(abs(here - (deepest if dives else shallow)))
    other = sum(distance > SAME_DEPTH for distance in off)
    if other == 0:
        return []
    return [
        f"turns of the plan ({other} of them) lie up to {max(off):,.0f} m from those of "
        f"yo{list_number(name):02}.ma, which makes all yos alike, from {shallow:g} to {deepest:,.0f} m: "
        "the vehicle will not fly this plan; for equal yos, plan without --polish"
    ]


def _range(angles: list[float]) -> str:
    if not angles:
        return f"none ({math.degrees(STEEPEST):g} degrees, the vehicle's default, stands for them)"
    low, high = (math.degrees(angle) for angle in (min(angles), max(angles)))
    return f"{low:.1f} to {high:.1f} degrees"


def clear_leftovers(folder: File, first: str, written: list[str]) -> list[str]:
    """Remove the lists of an earlier, longer route with the same `first` name; return a message for each.

    A list is removed only if it is exactly what this program wrote. A list that was changed by hand stays.
    """
    messages, number = list[str](), list_number(first) + sum(1 for name in written if NAME.fullmatch(name))
    while number <= 99 and (file := folder / _list_name(number)).is_file():
        text = file.read_bytes()[:1_000_000].decode("utf-8", errors="replace")
        series = SERIES.search(text)
        if series is None or series[2] != first:
            break
        if text == _written_again(text, int(series[1]), first):
            file.unlink()
            messages.append(f"removed {file}, which was left by an earlier, longer route")
        else:
            messages.append(
                f"{file} belongs to an earlier route and was changed by hand, so it stays; remove it unless you "
                "need it"
            )
        number += 1
    return messages


def _written_again(text: str, part: int, first: str) -> str | None:
    """Return what this program would write for the waypoints of a list; None if the list cannot be ours."""
    file = read_mission_file(text)
    radius = next((argument.value for argument in file.arguments if argument.name == "list_when_wpt_dist"), "")
    note = f"# {FROZEN}\n"
    try:
        rows = [[from_degrees_and_minutes(part) for part in row.split()] for _, row in file.rows]
        again = goto_list([Waypoint(lon, lat) for lon, lat in rows], float(radius), part, first)
        return note + again if text.startswith(note) else again
    except ValueError:
        return None
