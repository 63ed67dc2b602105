"""Slocum mission files of pilots: reads goto lists and yo files and finds their faults.

Names, units and ranges of arguments are from the vehicle's masterdata. If the vehicle cannot read a file, it
ignores the file or flies by its defaults. Each fault here was found in a public file.
"""

import math
import re
from typing import NamedTuple

from .route_columns import NotARoute
from .waypoints import from_degrees_and_minutes, plain_number

MOST_WAYPOINTS = 8
"""A goto list may hold this many waypoints; a vehicle can be compiled with another number."""
LEAST_DEPTH, MOST_DEPTH = 3.0, 1000.0
"""A yo turns between these depths [m]."""
MOST_ALTITUDE = 100.0
"""The greatest height above the bottom [m] at which a yo can turn."""
LEAST_RADIUS = 10.0
"""The smallest arrival radius of a waypoint [m]."""
FARTHEST = 2_000e3
"""A waypoint this far [m] from the one before has a wrong sign, or longitude and latitude are swapped."""
EARTH = 6_371e3


class Argument(NamedTuple):
    """One `b_arg`: its line, its name, its unit and the text of its value."""

    line: int
    name: str
    unit: str
    value: str


class MissionFile(NamedTuple):
    """A mission file: its behavior in lower case, arguments, rows of waypoints (line, text), and faults."""

    behavior: str
    arguments: list[Argument]
    rows: list[tuple[int, str]]
    faults: list[str]


class Bounds(NamedTuple):
    """The allowed values of an argument: unit, least and greatest value, whether whole, which numbers."""

    unit: str
    least: float = -math.inf
    most: float = math.inf
    whole: bool = False
    choices: tuple[int, ...] = ()


def _choice(*choices: int) -> Bounds:
    return Bounds("enum", whole=True, choices=choices)


BOOL = Bounds("bool", 0, 1, whole=True)
GOTO_LIST = {
    "start_when": _choice(*range(14)),
    "list_stop_when": _choice(1, 2, 5, 7),
    "list_when_wpt_dist": Bounds("m", LEAST_RADIUS),
    "initial_wpt": Bounds("enum", -2, whole=True),
    "num_waypoints": Bounds("nodim", 1, whole=True),
    "num_legs_to_run": Bounds("nodim", -2, whole=True),
    "end_action": _choice(0, 6),
}
_HALF = {
    "target_depth": Bounds("m", LEAST_DEPTH, MOST_DEPTH),
    "target_altitude": Bounds("m", -1, MOST_ALTITUDE),
    "use_bpump": _choice(0, 1, 2, 3, 4),
    "bpump_value": Bounds("X", -1000, 1000),
    "use_pitch": _choice(1, 2, 3, 4),
    "pitch_value": Bounds("X"),
    "use_thruster": _choice(0, 1, 2, 3, 4),
    "thruster_value": Bounds("X"),
    "stop_when_hover_for": Bounds("sec"),
    "stop_when_stalled_for": Bounds("sec"),
    "speed_min": Bounds("m/s"),
    "speed_max": Bounds("m/s"),
    "depth_rate_method": Bounds("enum", whole=True),
    "wait_for_pitch": BOOL,
    "wait_for_ballast": Bounds("sec"),
    "delta_bpump_speed": Bounds("X"),
    "delta_bpump_ballast": Bounds("X"),
    "time_ratio": Bounds("X"),
    "use_sc_model": BOOL,
    "max_thermal_charge_time": Bounds("sec"),
    "max_pumping_charge_time": Bounds("sec"),
    "thr_reqd_pres_mul": Bounds("nodim"),
}
YO = {
    "start_when": _choice(0, 1, 2, 4),
    "start_diving": BOOL,
    "num_half_cycles_to_do": Bounds("nodim", -1, whole=True),
    "end_action": _choice(0, 2),
    "alt_time": Bounds("sec"),
    **{f"{half}_{name}": bounds for half in "dc" for name, bounds in _HALF.items()},
}
"""A yo's arguments: those of its dive, `d_`, and of its climb, `c_`."""
SERVO = ("2", "3")
"""With these values of `use_pitch`, `pitch_value` is an angle [rad]; with others it is in inches or cc."""


def read_mission_file(text: str) -> MissionFile:
    """Return the parts of a mission file; comments may stand anywhere, also before the first line."""
    faults = [
        f"line {n} has a character outside ASCII: {line.strip()!r}"
        for n, line in _lines(text)
        if not line.isascii()
    ]
    code = [(n, part) for n, line in _lines(text) if (part := line.split("#")[0].strip())]
    behavior = ""
    if code and code[0][1].partition("=")[0].strip() == "behavior_name":
        behavior = code.pop(0)[1].partition("=")[2].strip().lower()
    arguments: list[Argument] = []
    rows: list[tuple[int, str]] = []
    block, seen = "", list[str]()
    for n, line in code:
        mark = re.fullmatch(r"<(start|end):(b_arg|waypoints)>", line)
        if mark:
            fits = (block == "") if mark[1] == "start" else (block == mark[2])
            if not fits or (mark[1] == "start" and mark[2] in seen):
                faults.append(f"line {n}, {line}, is in a wrong place")
            block = mark[2] if mark[1] == "start" else ""
            seen.append(mark[2])
        elif block == "waypoints":
            rows.append((n, line))
        elif block == "b_arg" and (match := re.fullmatch(r"b_arg:\s*(\w+)\(([^)]*)\)\s*(.*)", line)):
            arguments.append(Argument(n, match[1], match[2], match[3]))
        else:
            faults.append(f"line {n} is neither an argument nor a waypoint: {line!r}")
    if block or seen.count("b_arg") != 2:
        faults.append("the arguments must stand between <start:b_arg> and <end:b_arg>, waypoints between theirs")
    return MissionFile(behavior, arguments, rows, faults)


def _lines(text: str) -> list[tuple[int, str]]:
    return list(enumerate(text.splitlines(), 1))


def goto_faults(text: str, most: int = MOST_WAYPOINTS) -> list[str]:
    """Return the faults of a goto list, one sentence each; no fault if it can be flown with `most` waypoints."""
    file = read_mission_file(text)
    faults = [*file.faults]
    if file.behavior != "goto_list":
        faults.append("the first line must be behavior_name=goto_list")
    if "<start:waypoints>" not in text or "<end:waypoints>" not in text:
        return [*faults, "the waypoints must stand between <start:waypoints> and <end:waypoints>"]
    values = _values(file, GOTO_LIST, faults)
    count = len(file.rows)
    number = values.get("num_waypoints")
    if number is None or number != count:
        shown = "not given" if number is None else f"{number:g}"
        faults.append(f"num_waypoints is {shown}, but there are {count} rows")
    if count > most:
        faults.append(f"{count} waypoints are more than {most}")
    if values.get("num_legs_to_run") == 0:
        faults.append("num_legs_to_run must not be 0")
    first = values.get("initial_wpt", 0.0)
    if first >= max(count, 1):
        faults.append(f"initial_wpt is {first:g}, but the last of {count} waypoints has the number {count - 1}")
    # a list that is flown for ever, which is the default, may begin anywhere
    if first == -2 and count > 1 and values.get("num_legs_to_run", -1.0) != -1:
        faults.append("initial_wpt is -2, the closest: an ordered route begins at 0")
    return faults + _row_faults(file.rows)


def _row_faults(rows: list[tuple[int, str]]) -> list[str]:
    """Return the faults of the rows of a goto list."""
    faults, places = [], list[tuple[float, float]]()
    for _, row in rows:
        try:
            lon, lat = (from_degrees_and_minutes(part) for part in row.split())
        except ValueError as error:
            form = "is not a longitude and a latitude, DDDMM.mmmm DDMM.mmmm"
            faults.append(f"the row {row!r} {form}: {error}")
            continue
        if abs(lat) > 90:
            faults.append(f"the row {row!r} has a latitude of {lat:g}; write the longitude first")
            continue
        if places and (far := _apart(places[-1], (lon, lat))) > FARTHEST:
            faults.append(
                f"the row {row!r} lies {far / 1000:,.0f} km from the waypoint before it; check its signs, and "
                "that the longitude is first"
            )
        places.append((lon, lat))
    return faults


def _apart(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return the distance [m] between two places [degrees] on a sphere."""
    (lon, lat), (lon_b, lat_b) = (tuple(map(math.radians, place)) for place in (a, b))
    half = math.sin((lat_b - lat) / 2) ** 2 + math.cos(lat) * math.cos(lat_b) * math.sin((lon_b - lon) / 2) ** 2
    return 2 * EARTH * math.asin(min(1.0, math.sqrt(half)))


def yo_faults(text: str) -> list[str]:
    """Return the faults of a yo file, one sentence each; no fault if it can be flown."""
    file = read_mission_file(text)
    faults = [*file.faults]
    if file.behavior != "yo":
        faults.append("the first line must be behavior_name=yo")
    if file.rows:
        faults.append("a yo file holds waypoints; move them into a goto list")
    values = _values(file, YO, faults)
    if values.get("num_half_cycles_to_do") == 0:
        faults.append("num_half_cycles_to_do must not be 0")
    deep, shallow = values.get("d_target_depth"), values.get("c_target_depth")
    if deep is not None and shallow is not None and not shallow < deep:
        faults.append(f"c_target_depth is {shallow:g}; it must be less than d_target_depth, {deep:g}")
    use = {argument.name: argument.value for argument in file.arguments if argument.name.endswith("use_pitch")}
    for half, sign, way in (("d", -1, "below 0 for a dive"), ("c", 1, "above 0 for a climb")):
        angle, name = values.get(f"{half}_pitch_value"), f"{half}_pitch_value"
        if angle is None or use.get(f"{half}_use_pitch", "3") not in SERVO:
            continue
        if abs(angle) >= math.pi / 2:
            faults.append(
                f"{name} is {angle:g}, but its unit is radians: {angle:g} degrees are {math.radians(angle):.4f}"
            )
        elif angle * sign <= 0:
            faults.append(f"{name} is {angle:g}; it must be {way}")
    return faults


def _values(file: MissionFile, known: dict[str, Bounds], faults: list[str]) -> dict[str, float]:
    """Return the arguments that are numbers; add the faults of others to `faults`."""
    values: dict[str, float] = {}
    for argument in file.arguments:
        name, bounds = argument.name, known.get(argument.name)
        if bounds is None:
            what = f"{name} is not known as an argument of {file.behavior or 'this file'}"
            faults.append(f"{what}; check its spelling")
            continue
        if name in (earlier.name for earlier in file.arguments[: file.arguments.index(argument)]):
            faults.append(f"{name} is given twice")
        unit = {"s": "sec"}.get(argument.unit.lower(), argument.unit.lower())
        if unit != bounds.unit.lower():
            faults.append(f"{name} has the unit {argument.unit}; write {name}({bounds.unit})")
        try:
            value = plain_number(argument.value)
        except ValueError:
            faults.append(f"{name} must be one number; got {argument.value!r}")
            continue
        values[name] = value
        if bounds.choices and value not in bounds.choices:
            faults.append(f"{name} must be one of {', '.join(map(str, bounds.choices))}; got {argument.value}")
        elif not bounds.least <= value <= bounds.most:
            upper = "" if bounds.most == math.inf else f" to {bounds.most:g}"
            faults.append(f"{name} must be from {bounds.least:g}{upper}; got {argument.value}")
        elif bounds.whole and value != int(value):
            faults.append(f"{name} must be a whole number; got {argument.value}")
    return values


def goto_points(text: str) -> tuple[list[tuple[float, float, float]], list[str]]:
    """Return the waypoints of a goto list in flown order as lon, lat [degrees], depth 0 [m], and notes.

    NotARoute if the vehicle would not fly these rows.
    """
    file = read_mission_file(text)
    if file.behavior != "goto_list":
        named = f"the behavior {file.behavior!r}" if file.behavior else "no behavior_name"
        raise NotARoute(f"it has {named}, but a route is a goto_list; name the goto list")
    faults: list[str] = []
    values = _values(file, GOTO_LIST, faults)
    faults += _row_faults(file.rows)
    if values.get("num_waypoints") != len(file.rows):
        faults.append(f"num_waypoints is not {len(file.rows)}, the number of its rows")
    if faults:
        raise NotARoute(f"{faults[0]}; `glider-stream lint` shows all its faults")
    places = [tuple(from_degrees_and_minutes(part) for part in row.split()) for _, row in file.rows]
    first, notes = int(values.get("initial_wpt", -2)), list[str]()
    if first < 0 and len(places) > 1:
        which = "the closest to the vehicle" if first == -2 else "the one after the last that it reached"
        notes.append(f"the goto list begins with the waypoint that is {which}; it is read from its first row")
        first = 0
    if values.get("num_legs_to_run", -1.0) == -1:
        notes.append("the goto list is flown again and again; it is read once")
    return [(lon, lat, 0.0) for lon, lat in places[max(first, 0) :]], notes
