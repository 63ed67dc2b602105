"""Replanning from a position fix: the new plan, what changes, what the old list would do, until when that is
good."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..base.clock import moment, span
from ..base.settings import require
from ..kernels.flow import velocities
from ..roadmap.problem import Problem
from ..search.assembly import RoutePlanner
from ..search.flown_on import FlownOn, GoodUntil, Stop, good_until, next_leg
from ..search.path import SURFACE, Leg, Path
from ..water.frame import true_north
from ..water.mapping.measured import FASTEST

TOLERANCE = 0.05
"""An old list is good as long as flying it on costs at most this share more in all than the new plan."""


@dataclass(frozen=True)
class CurrentCheck:
    """The depth-averaged current that a dive measured, against the forecast's along it; (2,) [m/s], east and
    north.

    `by_next` [m]: how far the difference would move the vehicle until the new plan's next surfacing, and
    `by_goal` [m] on the whole way, if it stayed and nobody planned anew. `later`: the share by which the way to
    the goal would take longer, to first order; negative if it would take less. `tolerance`: the share above which
    that is warned of.
    """

    measured: Array
    forecast: Array
    by_next: float
    by_goal: float
    later: float
    tolerance: float

    @property
    def difference(self) -> Array:
        """Measured less forecast (2,) [m/s], east and north."""
        return self.measured - self.forecast

    @property
    def beyond(self) -> bool:
        """Whether the difference, if it stayed, would change the arrival by more than the tolerance."""
        return abs(self.later) > self.tolerance

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a dictionary for JSON."""
        east_north = {
            name: [float(value) for value in getattr(self, name)]
            for name in ("measured", "forecast", "difference")
        }
        return {
            **{f"{name}_mps": value for name, value in east_north.items()},
            "off_at_next_surfacing_m": self.by_next,
            "off_at_goal_m": self.by_goal,
            "later_share": self.later,
            "beyond_tolerance": self.beyond,
            "applied": False,
        }

    def __str__(self) -> str:
        both = ", ".join(
            f"{name} {value[0]:+.3f} east {value[1]:+.3f} north"
            for name, value in (
                ("measured", self.measured),
                ("forecast", self.forecast),
                ("apart", self.difference),
            )
        )
        line = (
            f"current of the last dive [m/s]: {both}; it is compared, not put into the plan. If the difference "
            f"stays, the vehicle is {self.by_next / 1000:.1f} km off at the next surfacing, and the way to the "
            f"goal takes {abs(self.later):.0%} {'longer' if self.later > 0 else 'less'}"
        )
        if self.beyond:
            line += f": more than {self.tolerance:.0%}, so plan again at each surfacing, or take a newer forecast"
        return line


@dataclass(frozen=True)
class Replan:
    """The answer of a replan: the `new` plan from the `fix` (3,) [m], `since` [s] after the `old` plan's
    departure.

    `flown`: the old list flown on from the fix. `good`: until when it is good; None if no new plan exists to
    compare it with. `current`: the comparison of a measured current, if one was given. `radius` [m]: at this
    distance the goal counts as reached; `arrived`: whether the vehicle is within it.
    """

    new: Path
    old: Path
    since: float
    fix: Array
    flown: FlownOn
    good: GoodUntil | None
    current: CurrentCheck | None
    radius: float
    arrived: bool
    problem: Problem
    notes: tuple[str, ...] = ()

    @property
    def later(self) -> float:
        """How much later than by the old plan the vehicle arrives now [s]; inf if no new plan exists."""
        return self.since + self.new.travel_time - self.old.travel_time

    @property
    def off(self) -> float:
        """The horizontal distance [m] from the fix to the place where the old plan has the vehicle then."""
        return math.dist(self.fix[:2], place_at(self.old, self.since)[:2])

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a dictionary for JSON; places are in the domain's coordinates."""
        flown, old, new = self.flown, self.old, self.new
        return {
            "fix": {"place": self.shown(self.fix), "since_departure_s": self.since, "off_the_plan_m": self.off},
            "arrived": self.arrived,
            "changes": {
                "arrival_before_s": old.travel_time - self.since,
                "arrival_now_s": new.travel_time if new.found else None,
                "later_s": self.later if new.found else None,
                "length_before_m": length(old.legs[flown.first - 1 :]),
                "length_now_m": length(new.legs) if new.found else None,
                "next_before": self._next(old.legs[flown.first - 1 :]),
                "next_now": self._next(new.legs),
            },
            "old_list": {
                "next_leg": flown.first if flown.first <= len(old.legs) else None,
                "legs_flown": len(flown.path.legs),
                "time_s": flown.path.travel_time,
                "ends_at": self.shown(flown.path.legs[-1].end if flown.path.legs else self.fix),
                "misses_goal_by_m": flown.miss,
                "why_it_stops": flown.why or None,
                "good_until": None if self.good is None else self.good.as_dict(self.shown),
            },
            **({} if self.current is None else {"current": self.current.as_dict()}),
            **({"notes": list(self.notes)} if self.notes else {}),
            "plan": new.as_dict(),
        }

    def shown(self, place: Array) -> list[float]:
        """Return a place (3,) [m] in the domain's coordinates: lon, lat, depth if it is geographic."""
        return shown(place, self.problem)

    def _next(self, legs: Sequence[Leg]) -> dict[str, Any] | None:
        """Return the first glide of some legs, and the place where they next surface."""
        if not legs:
            return None
        up = next((leg for leg in legs if leg.end[2] >= -SURFACE), legs[-1])
        return {
            "compass_deg": legs[0].compass,
            "glide_angle_deg": math.degrees(legs[0].glide_angle),
            "surfaces_at": self.shown(up.end),
            "after_s": up.depart + up.duration - legs[0].depart,
        }

    def __str__(self) -> str:
        when = moment(self.problem.departs, 0.0) if self.problem.departs is not None else f"{self.since:,.0f} s"
        where = _place(self.shown(self.fix), self.problem)
        goal = math.dist(self.fix[:2], self.old.goal[:2]) / 1000
        lines = [f"fix at {where}, {when}: {self.off / 1000:.1f} km off the plan, {goal:.1f} km from the goal"]
        if self.arrived:
            lines.append(f"the vehicle has arrived: the goal counts as reached within {self.radius:,.0f} m")
        lines += self._told_changes() + self._told_old()
        lines += [] if self.current is None else [str(self.current)]
        return "\n".join([*lines, f"new {self.new}" if self.new.legs else str(self.new)])

    def _told_changes(self) -> list[str]:
        old, new = self.old.legs[self.flown.first - 1 :], self.new
        before = f"arrival: before {self._moment(self.old.travel_time - self.since)}"
        if not new.found:
            return [f"{before}; now no way to the goal is found"]
        change = f"{abs(self.later) / 3600:.2f} h {'later' if self.later > 0 else 'earlier'}"
        lines = [f"{before}, now {self._moment(new.travel_time)}, {change}"]
        if old and new.legs:
            lines.append(
                f"way: before {length(old) / 1000:.1f} km, now {length(new.legs) / 1000:.1f} km; the next glide: "
                f"before compass {old[0].compass:.1f} at {math.degrees(old[0].glide_angle):.1f} degrees, now "
                f"{new.legs[0].compass:.1f} at {math.degrees(new.legs[0].glide_angle):.1f}"
            )
        return lines

    def _told_old(self) -> list[str]:
        flown = self.flown
        if flown.first > len(self.old.legs):
            return ["old list: it is over, the vehicle has nothing left to fly"]
        end = _place(self.shown(flown.path.legs[-1].end if flown.path.legs else self.fix), self.problem)
        line = f"old list: flown on from leg {flown.first} for {span(flown.path.travel_time)} it ends at {end}, "
        line += f"{flown.miss / 1000:.2f} km from the goal"
        lines = [f"{line}; {flown.why}" if flown.why else line]
        if self.good is None:
            return lines
        good = self.good
        if good.last.since == 0:
            return [
                *lines,
                f"old list: not good even to the next surfacing: {good.beyond}; bring the new one now",
            ]
        until = f"{self._moment(good.last.since)}, {_place(self.shown(good.last.place), self.problem)}"
        told = (
            f"old list: if this call fails, it is good until {until}, the end of leg {good.last.legs}: a new plan"
        )
        told += f" from there costs {max(good.extra, 0.0):.1%} more in all, and {good.tolerance:.0%} is allowed"
        return [*lines, f"{told}; {good.beyond}" if good.beyond else told]

    def _moment(self, since: float) -> str:
        return moment(self.problem.departs, since)


def shown(place: Array, problem: Problem) -> list[float]:
    """Return a place (3,) [m] in the coordinates of a problem's domain: lon, lat, depth if it is geographic."""
    if problem.to_lonlat is None:
        return [float(value) for value in place]
    lon, lat = problem.to_lonlat(place[None])[0]
    return [float(lon), float(lat), 0.0 - float(place[2])]


def _place(values: Sequence[float], problem: Problem) -> str:
    x, y, z = values
    if problem.to_lonlat is None:
        return f"({x:.6g}, {y:.6g}, {z:.6g})"
    return f"({x:.4f}, {y:.4f}, {z:.0f} m)"


def length(legs: Sequence[Leg]) -> float:
    """Return the length over ground [m] of some legs."""
    return float(sum(np.hypot(*np.diff(leg.trajectory[:, 1:3], axis=0).T).sum() for leg in legs))


def place_at(path: Path, since: float) -> Array:
    """Return where a plan has its vehicle (3,) [m], `since` [s] after departure; its ends before and after."""
    rows = path.trajectory
    return np.array([np.interp(since, rows[:, 0], rows[:, n]) for n in (1, 2, 3)])


def compared(
    measured: Array, old: Path, since: float, fix: Array, waters: Sequence[Problem], new: Path, tolerance: float
) -> CurrentCheck:
    """Compare a measured current (2,) [m/s], east and north, with the forecast's mean along the dive before the
    fix.

    The dive is that of the old plan that ends by the fix, moved so that it ends there. `waters`: problems that
    leave at the fix, of which the first that knows the time of the dive is read.
    """
    speed = float(np.hypot(*measured)) if measured.shape == (2,) else math.nan
    require(speed <= FASTEST, f"`dac` must be two numbers [m/s], together at most {FASTEST:g}; got {measured}")
    first = next_leg(old, since)
    begin = first - 1
    while begin > 0 and old.legs[begin].start[2] < -SURFACE:
        begin -= 1
    require(
        begin >= 0,
        "no dive of the plan ends by the fix, so `--dac` has nothing to be compared with; leave it out",
    )
    ends = old.legs[begin].start[2], old.legs[first - 1].end[2]
    require(
        min(ends) >= -SURFACE,
        f"the dive of the plan that ends by the fix is from {0.0 - ends[0]:.0f} m to {0.0 - ends[1]:.0f} m, "
        "not from the surface to the surface, so `--dac` would be compared with a part of it; leave it out",
    )
    rows = np.concatenate([leg.trajectory for leg in old.legs[begin:first]])
    places = rows[:, 1:3] + (fix[:2] - rows[-1, 1:3])
    past = rows[:, 0] - rows[-1, 0]
    problem = next((one for one in waters if one.departure + past[0] >= one.evaluator.flow.extent.t_lo), None)
    require(problem is not None, "no forecast reaches back to the dive before the fix; leave `--dac` out")
    assert problem is not None
    flow, column = problem.evaluator.flow, np.ascontiguousarray
    current = velocities(
        flow, column(places[:, 0]), column(places[:, 1]), column(rows[:, 3]), column(problem.departure + past)
    )
    x, y = np.trapezoid(current, past, axis=0) / (past[-1] - past[0])
    north = 0.0 if problem.to_lonlat is None else true_north(problem.to_lonlat, fix)
    c, s = math.cos(north), math.sin(north)
    forecast = np.array([x * c + y * s, y * c - x * s])
    apart = measured - forecast
    way = new.goal[:2] - fix[:2]
    east, north_ = way[0] * c + way[1] * s, way[1] * c - way[0] * s
    far, size = float(np.hypot(*way)), float(np.hypot(*apart))
    time = new.travel_time if new.found else 0.0
    along = float(apart @ np.array([east, north_])) / far if far > 0 else 0.0
    up = next((leg for leg in new.legs if leg.end[2] >= -SURFACE), None)
    by_next = size * (time if up is None else up.depart + up.duration)
    later = -along * time / far if far > 0 else 0.0
    return CurrentCheck(measured, forecast, by_next, size * time, later, tolerance)


def good_until_of(
    flown: FlownOn, new: Path, planner: RoutePlanner, radius: float, tolerance: float
) -> GoodUntil | None:
    """Return until when an old list is good, by plans from its surfacings; None if no new plan exists."""
    if not new.found:
        return None

    def left(stop: Stop) -> float:
        if math.dist(stop.place, new.goal) <= radius:
            return 0.0
        if planner.rule.counts != (1, 1) and not stop.at_surface:
            return math.inf  # a route with a rule of surfacing begins at the surface
        return float(planner.leaving(stop.since).table([stop.place], [new.goal])[0, 0])

    cost = new.cost if new.unpolished is None else new.unpolished[2]
    return good_until(flown, cost, left, tolerance)
