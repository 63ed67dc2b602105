"""Paths: legs from a start to a goal, as text for people, as JSON for programs, and read from a path file."""

import json
import math
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import Array
from ..base.clock import moment, span
from ..base.errors import InputError, InputWarning
from ..base.settings import from_table, require
from ..base.untrusted import check_file
from ..kernels.edges import Edge, Status
from ..water.domain import domain_from_table
from ..water.frame import LocalFrame, true_north, wrapped

if TYPE_CHECKING:
    from ..roadmap.problem import Problem

MOST_TEXT = 200_000_000
"""A path file may hold at most this many bytes; a route of a thousand legs takes some five million."""
LARGEST = 1e12
"""A larger number [m, s] in a path file cannot be a place or time on Earth."""
SURFACE = 10.0
"""A leg that ends at this depth [m] or above it counts as a leg to the surface."""
SAME_CENTRE = 1e-7
"""Metres of two plans count from one place if their frames' centres differ by less than this [degrees]."""
FROZEN = "FROZEN: every leg meets the current of the departure, so these times and places do not hold"
"""Every output says this about a path whose clock does not run."""
FIRST, LAST = 10, 5
"""Of a route of many legs, people see so many at its begin and its end; JSON has all."""
Hop = tuple[Array, Array, Edge]
"""A leg in a search: its start and end (3,) [m], and the edge between them."""


@dataclass(frozen=True)
class Leg:
    """One glide with constant trim, planned from the node `start` to the node `end` (3,) [m].

    `glide_angle` (positive in a climb) and `heading` are in rad, `speed` in m/s. `depart` [s] counts from the
    begin of the path; `duration` in s. `trajectory` has rows [t, x, y, z] and ends at the closest approach to
    `end`, at the distance `miss` [m]. In a geographic scenario `lonlat` (2, 2) [degrees] are start and end,
    `track` (m, 2) [degrees] is the trajectory, and `north` [rad] is the direction of true north,
    counter-clockwise from the frame's +y. `cost` is the cost of this leg.
    `lifted` [m] is how far the water lifts the glider on the way, below 0 if it sinks.

    Examples:
        >>> leg = road.query().legs[0]
        >>> bool(leg.end[2] < leg.start[2]), leg.glide_angle < 0
        (True, True)
        >>> round(leg.compass, 1)
        137.5
    """

    start: Array
    end: Array
    glide_angle: float
    heading: float
    speed: float
    depart: float
    duration: float
    miss: float
    trajectory: Array
    lonlat: Array | None = None
    track: Array | None = None
    north: float = 0.0
    cost: float = 0.0
    lifted: float = 0.0

    @property
    def compass(self) -> float:
        """The heading as a bearing, clockwise from true north [degrees]."""
        return math.degrees(math.pi / 2 + self.north - self.heading) % 360

    def as_dict(self) -> dict[str, Any]:
        """Return the table that is written to the path file."""
        return {
            "from": self.start.tolist(),
            "to": self.end.tolist(),
            "glide_angle_rad": self.glide_angle,
            "heading_rad": self.heading,
            "speed_mps": self.speed,
            "depart_s": self.depart,
            "duration_s": self.duration,
            "miss_m": self.miss,
            **({"lifted_m": self.lifted} if self.lifted else {}),
            "trajectory": self.trajectory.tolist(),
        }

    def told(self, departs: datetime | None) -> str:
        """Return a line for people; `departs` is the path's departure (UTC), if that is known."""
        way, glide = "climb" if self.glide_angle > 0 else "dive ", math.degrees(self.glide_angle)
        # a geographic scenario speaks of depths, any other of heights
        begin, end = (z if self.lonlat is None else 0.0 - z for z in (self.start[2], self.end[2]))
        place = "" if self.lonlat is None else "  at {:.4f}, {:.4f}".format(*self.lonlat[1])
        return (
            f"{moment(departs, self.depart):>9}  {way} {begin:7.0f} m to {end:6.0f} m{place}  "
            f"glide {glide:6.1f} deg  compass {self.compass:5.1f} deg  "
            f"{self.duration:7,.0f} s  miss {self.miss:.2f} m"
            + (f"  lifted {self.lifted:.1f} m" if self.lifted else "")
        )


@dataclass(frozen=True)
class Round:
    """A round of refinement: new nodes every `spacing` [m] where they could help, and the best route after it.

    `nodes` and `edges` are the numbers that the round searched, with the new ones. `travel_time` [s] and `cost`
    belong to the best route so far. `gain` is the share of the cost that the round saved.
    """

    spacing: float
    nodes: int
    edges: int
    travel_time: float
    cost: float
    gain: float

    def as_dict(self) -> dict[str, Any]:
        """Return the table that is written to the path file."""
        return {
            "spacing_m": self.spacing,
            "nodes": self.nodes,
            "edges": self.edges,
            "travel_time_s": self.travel_time,
            "cost": self.cost,
            "gain": self.gain,
        }

    def told(self, number: int) -> str:
        """Return a line for people."""
        return (
            f"  round {number}: nodes every {self.spacing:,.0f} m where they could help, {self.nodes:,} in all: "
            f"{span(self.travel_time)}, {self.gain:.2%} gained"
        )


@dataclass(frozen=True)
class Origin:
    """What a path was planned with, by which it can be planned anew.

    `scenario`: the complete TOML. `roadmap`: the file of the roadmap whose legs were searched, or of which only
    the nodes were taken if `nodes_only`; empty without one. `departure` [s] of the flow. `most_yos`,
    `most_hours`: the rule of surfacing, as in a scenario's [query].
    """

    scenario: str
    roadmap: str = ""
    nodes_only: bool = False
    departure: float = 0.0
    most_yos: int | None = None
    most_hours: float | None = None

    @property
    def clearance(self) -> float:
        """The distance [m] that the plan keeps above the seabed; 0 where the scenario names none."""
        return float(tomllib.loads(self.scenario).get("terrain", {}).get("clearance", 0.0))

    def as_dict(self) -> dict[str, Any]:
        """Return the table that is written to the path file."""
        rule = {"most_yos": self.most_yos, "most_hours": self.most_hours}
        road = {"roadmap": self.roadmap, "nodes_only": self.nodes_only} if self.roadmap else {}
        asked = {name: value for name, value in rule.items() if value is not None}
        return {**road, "departure_s": self.departure, **asked, "scenario": self.scenario}


@dataclass(frozen=True)
class Path:
    """The cheapest path of a query from `start` to `goal` (3,) [m], or the answer that no path was found.

    `cost` has the `unit` s or J; it is inf if no path was found. `lonlat` (2, 2) [degrees] are start and goal in
    a geographic scenario. `departs` is the date of departure (UTC), if known. `why` says why no path was found,
    and `why_not` says the same for JSON, if known. `notes` belong to the files that are written from the path.
    `departure` [s] is the flow's time at which the path begins; None in a steady flow. `frozen`: every leg meets
    the current of that time. `expanded` is the share of the nodes at which the search looked for legs, if it did.
    `origin` is what it was planned with, if that is known. `confidence` says how often, and by when, it arrives
    in the members of an ensemble, if it was flown there.
    `unthinned` are the number of legs and the time [s] before thinning. `unpolished` are the number of legs, the
    time [s] and the cost before polishing. `rounds` are the rounds of refinement. `least` is a lower bound of the
    cost of every route, from the greatest currents. `closer` is the command that finds a closer one, if known.

    Examples:
        >>> path = road.query()
        >>> path.found, len(path.legs), path.unit
        (True, 4, 's')
        >>> path.trajectory.shape[1]
        4
    """

    start: Array
    goal: Array
    cost: float
    legs: tuple[Leg, ...]
    lonlat: Array | None = None
    departs: datetime | None = None
    unit: str = "s"
    why: str = ""
    unthinned: tuple[int, float] | None = None
    unpolished: tuple[int, float, float] | None = None
    rounds: tuple[Round, ...] = ()
    least: float | None = None
    why_not: Mapping[str, Any] | None = None
    notes: tuple[str, ...] = ()
    departure: float | None = None
    frozen: bool = False
    expanded: float | None = None
    origin: Origin | None = None
    confidence: Mapping[str, Any] | None = None
    closer: str = ""

    @property
    def clock_runs(self) -> bool:
        """Whether each leg meets the current of the time at which it begins; False in a steady flow."""
        return self.departure is not None and not self.frozen

    def water_times(self, leg: Leg, departure: float) -> Array:
        """Return the flow's times (m,) [s] of a leg's rows; if frozen, each leg begins at the departure.

        `departure` [s] is used if the path has no departure.
        """
        since = leg.trajectory[:, 0]
        begins = departure if self.departure is None else self.departure
        return np.asarray(begins + (since if self.clock_runs else since - since[0]))

    @property
    def found(self) -> bool:
        """Whether a path was found."""
        return math.isfinite(self.cost)

    @property
    def travel_time(self) -> float:
        """The time from start to goal [s]; inf if no path was found."""
        return sum((leg.duration for leg in self.legs), 0.0) if self.found else math.inf

    @property
    def trajectory(self) -> Array:
        """The rows [t, x, y, z] of all legs, (m, 4)."""
        return np.concatenate([np.empty((0, 4)), *(leg.trajectory for leg in self.legs)])

    def as_dict(self) -> dict[str, Any]:
        """Return the table that is written to the path file."""
        energy = {"energy_j": self.cost} if self.found and self.unit == "J" else {}
        thinned = {}
        if self.unthinned is not None:
            thinned = {"unthinned": {"legs": self.unthinned[0], "travel_time_s": self.unthinned[1]}}
        return {
            "found": self.found,
            "travel_time_s": self.travel_time if self.found else None,
            "cost": self.cost if self.found else None,
            **energy,
            **thinned,
            **self._before_polishing(),
            **({"rounds": [item.as_dict() for item in self.rounds]} if self.rounds else {}),
            **self._against_the_best(),
            **({} if self.departure is None else {"departure_s": self.departure, "frozen": self.frozen}),
            **({} if self.expanded is None else {"expanded_share": self.expanded}),
            **({} if self.found or not self.why else {"why": self.why}),
            **({} if self.why_not is None else {"why_not": dict(self.why_not)}),
            **({"notes": list(self.notes)} if self.notes else {}),
            **({} if self.origin is None else {"origin": self.origin.as_dict()}),
            **({} if self.confidence is None else {"confidence": dict(self.confidence)}),
            "legs": [leg.as_dict() for leg in self.legs],
        }

    def _before_polishing(self) -> dict[str, Any]:
        if self.unpolished is None:
            return {}
        legs, time, cost = self.unpolished
        return {"unpolished": {"legs": legs, "travel_time_s": time, "cost": cost}}

    @property
    def likely_gain(self) -> float | None:
        """The share of the cost that another round of refinement may save: an estimate, the gain of the last."""
        return self.rounds[-1].gain if self.rounds else None

    def _against_the_best(self) -> dict[str, Any]:
        if not self.found or self.least is None:
            return {}
        estimate = {} if self.likely_gain is None else {"estimate_of_further_gain": self.likely_gain}
        return {"lower_bound": {"cost": self.least, "over_it": self._over_least()}, **estimate}

    def _over_least(self) -> float | None:
        return None if not self.least else self.cost / self.least - 1

    def _told_against_the_best(self) -> list[str]:
        """Return a line for people that says how far the route may be from the best one."""
        over = self._over_least()
        if over is None or self.least is None:
            return []
        least = f"{self.least / 1000:,.1f} kJ" if self.unit == "J" else span(self.least)
        line = f"  no route costs less than {least}, by the greatest currents: this one at most {over:.1%} more"
        if self.likely_gain is not None:
            return [f"{line}; another round may gain {self.likely_gain:.2%}, an estimate"]
        closer = f"; for a closer bound, `{self.closer}`" if self.closer else ""
        return [f"{line}; to look for a better one, --within 1%{closer}"]

    def __str__(self) -> str:
        if self.lonlat is None:
            start, goal = (f"({x:.6g}, {y:.6g}, {z:.6g})" for x, y, z in (self.start, self.goal))
        else:
            ends = zip(self.lonlat, (self.start, self.goal), strict=True)
            start, goal = (f"({lon:.4f}, {lat:.4f}, {0.0 - z:.6g} m)" for (lon, lat), (_, _, z) in ends)
        if not self.found:
            why = self.why or "more nodes, neighbours or candidates may find one"
            return f"no path from {start} to {goal}; {why}" + (f"; {FROZEN}" if self.frozen else "")
        count = f"{len(self.legs)} leg{'' if len(self.legs) == 1 else 's'}"
        arrives = "" if self.departs is None else f", arrives {moment(self.departs, self.travel_time)}"
        energy = f", {self.cost / 1000:,.1f} kJ" if self.unit == "J" else ""
        title = f"path from {start} to {goal}: {count}, {span(self.travel_time)}{arrives}{energy}"
        if self.unthinned is not None:
            title += f"; before it was thinned {self.unthinned[0]}, {span(self.unthinned[1])}"
        if self.unpolished is not None:
            legs, time, cost = self.unpolished
            title += f"; before it was polished {legs}, {span(time)}"
            title += f", {cost / 1000:,.1f} kJ" if self.unit == "J" else ""
        if self.frozen:
            title += f"; {FROZEN}"
        rounds = [item.told(n) for n, item in enumerate(self.rounds, 1)]
        lines = shortened([f"  {leg.told(self.departs)}" for leg in self.legs])
        return "\n".join([title, *rounds, *lines, *self._told_against_the_best()])


def shortened(lines: Sequence[str]) -> list[str]:
    """Return the lines of a route's legs for people; of many, only the first and the last."""
    left = len(lines) - FIRST - LAST
    if left <= FIRST:
        return list(lines)
    return [*lines[:FIRST], f"  ... {left} more legs, in --json and in the file of -o", *lines[-LAST:]]


def hops_of(path: Path) -> list[Hop]:
    """Return the legs of a path in the form that `fly` takes."""
    return [
        (
            leg.start,
            leg.end,
            Edge(
                int(Status.CONNECTED), leg.duration, leg.cost, leg.glide_angle, leg.heading, leg.speed, leg.miss
            ),
        )
        for leg in path.legs
    ]


BESIDE = 0.01
"""Parts of a leg in a file may differ by this share of its length or time, or of 1 m or 1 s if it is shorter."""


NO_ORIGIN = (
    "has no `origin`, so it cannot be checked for its frame: its places are taken as metres from the origin of "
    "the scenario here"
)


def load_path(file: str | File) -> Path:
    """Read a path file (JSON) that `query` wrote; InputError if it is another file or holds no leg."""
    try:
        size = File(file).stat().st_size
        require(size <= MOST_TEXT, f"it holds {size:,} bytes, more than a path needs ({MOST_TEXT:,})")
        check_file(file, "the path")
        table = json.loads(File(file).read_text(encoding="utf-8"))
        require(isinstance(table, dict) and isinstance(table.get("legs"), list), "it has no list `legs`")
        require(len(table["legs"]) > 0, "it holds no leg, so there is nothing to draw")
        require(table.get("found") is True, f"its `found` is {table.get('found')!r}, yet it has legs")
        legs = tuple(_read_leg(leg, f"leg {n}") for n, leg in enumerate(table["legs"], 1))
        _check_legs(legs)
        cost = float(_numbers(table, "cost", "the path"))
        clock = np.concatenate([[0.0], *(leg.trajectory[:, 0] for leg in legs)])
        require(bool((np.diff(clock) >= 0).all()), "the times of its trajectory do not rise from 0")
        require(bool(clock[-1] > 0), "it takes no time")
        bound = table.get("lower_bound")
        require(bound is None or isinstance(bound, dict), "its `lower_bound` is no table")
        least = None if bound is None else float(_numbers(bound, "cost", "`lower_bound`"))
    except (OSError, ValueError, RecursionError) as error:
        reason = f"it is no JSON text, {error}"
        if isinstance(error, OSError):
            reason = (error.strerror or "it is no file").lower()
        elif isinstance(error, InputError):
            reason = str(error)
        raise InputError(f"the path file {file} cannot be read: {reason}; write it with `query -o`") from None
    departure = float(_numbers(table, "departure_s", "the path")) if "departure_s" in table else None
    frozen = table.get("frozen") is True
    origin = _read_origin(table["origin"], file) if "origin" in table else None
    known: dict[str, Any] = {"least": least, "departure": departure, "frozen": frozen, "origin": origin}
    return Path(legs[0].start, legs[-1].end, cost, legs, **known)


def load_plan(file: str | File) -> Path:
    """Read a path file, as `load_path` does, to put it into a scenario's water.

    InputWarning if it does not say what it was planned with: then nothing tells from where its metres count.
    """
    path = load_path(file)
    if path.origin is None:
        warnings.warn(f"the path file {file} {NO_ORIGIN}", InputWarning, stacklevel=2)
    return path


def _read_origin(table: Any, file: str | File) -> Origin:
    """Return what a path file says it was planned with; InputError if that is not as `query` writes it."""
    where = f"`origin` of the path file {file}"
    require(isinstance(table, dict), f"{where} must be a table; got {table!r}; write it with `query -o`")
    rest = {"departure" if name == "departure_s" else name: value for name, value in table.items()}
    origin = from_table(Origin, rest, where)
    try:
        known = math.isfinite(origin.clearance)
    except (ValueError, TypeError, AttributeError, RecursionError):
        known = False
    require(known, f"the scenario in {where} is no scenario's text; write it with `query -o`")
    return origin


def _read_leg(leg: Any, where: str) -> Leg:
    require(isinstance(leg, dict), f"{where} is no table")
    names = ("glide_angle_rad", "heading_rad", "speed_mps", "depart_s", "duration_s", "miss_m")
    angle, heading, speed, depart, duration, miss = (float(_numbers(leg, name, where)) for name in names)
    require(min(speed, depart, duration, miss) >= 0, f"{where} has a speed, time or miss below 0")
    start, end = (_numbers(leg, name, where, 3) for name in ("from", "to"))
    rows = _numbers(leg, "trajectory", where, None, 4)
    lifted = float(_numbers({"lifted_m": 0.0, **leg}, "lifted_m", where))
    return Leg(start, end, angle, heading, speed, depart, duration, miss, rows, lifted=lifted)


def _check_legs(legs: tuple[Leg, ...]) -> None:
    """Raise InputError unless each leg is one glide, whose parts agree, and begins where and when the last one
    ends.

    A file that was changed by hand, a stop without its trajectory or a leg taken out, is no plan that was found.
    """
    here, clock = legs[0].start, legs[0].depart
    for n, leg in enumerate(legs, 1):
        rows, rises = leg.trajectory, leg.speed * math.sin(leg.glide_angle) * leg.duration + leg.lifted
        most = BESIDE * max(1.0, math.dist(leg.start, leg.end))
        late = [leg.depart - clock, rows[0, 0] - leg.depart, rows[-1, 0] - leg.depart - leg.duration]
        odd = {
            "begins beside the end of the leg before": math.dist(here, leg.start) > most,
            "has a trajectory that begins elsewhere": math.dist(rows[0, 1:], leg.start) > most,
            "has a trajectory that ends elsewhere": math.dist(rows[-1, 1:], leg.end) > leg.miss + most,
            "does not reach its depth in its time": abs(leg.end[2] - leg.start[2] - rises) > leg.miss + most,
            "has times that do not fit": max(map(abs, late)) > BESIDE * max(1.0, leg.duration),
        }
        wrong = next((what for what, found in odd.items() if found), None)
        require(wrong is None, f"leg {n} {wrong}, so the file was changed")
        here, clock = leg.end, leg.depart + leg.duration


def _numbers(table: dict[str, Any], key: str, where: str, *shape: int | None) -> Array:
    """The finite numbers under a key, of a shape; None for any length above 0."""
    require(key in table, f"{where} has no `{key}`")
    try:
        values = np.array(table[key], np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.array(math.nan)
    fits = values.ndim == len(shape) and all(
        have == want or (want is None and have > 0) for have, want in zip(values.shape, shape, strict=True)
    )
    count = " x ".join("n" if size is None else str(size) for size in shape) or "one"
    fits = fits and float(np.abs(values).max()) <= LARGEST  # False for NaN, too
    require(fits, f"`{key}` of {where} must be finite numbers, {count} of them")
    return values


def check_frame(scenario: str, problem: "Problem", name: str) -> None:
    """Raise InputError if the metres of the plan `name` count from another place than the problem's.

    `scenario` is the TOML text with which it was planned; if it is empty, nothing is checked.
    """
    if not scenario or problem.domain is None:
        return
    try:
        table = tomllib.loads(scenario).get("domain", {})
    except ValueError:
        raise InputError(f"the scenario in `origin` of {name} is no TOML text; plan again") from None
    theirs, mine = domain_from_table(table).frame(), problem.domain.frame()
    same = theirs is None and mine is None
    if theirs is not None and mine is not None:
        apart = float(wrapped(theirs.lon - mine.lon, 0.0)), theirs.lat - mine.lat
        same = max(map(abs, apart)) <= SAME_CENTRE
    places = f"its metres count from {_centre(theirs)}, and here from {_centre(mine)}"
    require(same, f"{name} was planned in another [domain]: {places}; give its own scenario, or plan again")


def _centre(frame: LocalFrame | None) -> str:
    return "x = 0, y = 0" if frame is None else f"longitude {frame.lon:.7g}, latitude {frame.lat:.7g}"


def placed(path: Path, problem: "Problem") -> Path:
    """Return a path with what a path file leaves out: its date, and where geographic, degrees and true north."""
    path = replace(path, departs=path.departs or problem.departs)
    to_lonlat = problem.to_lonlat
    if to_lonlat is None:
        return path
    legs = tuple(
        replace(
            leg,
            lonlat=to_lonlat(np.stack([leg.start, leg.end])),
            track=to_lonlat(leg.trajectory[:, 1:]),
            north=true_north(to_lonlat, leg.start),
        )
        for leg in path.legs
    )
    return replace(path, legs=legs, lonlat=to_lonlat(np.stack([path.start, path.goal])))
