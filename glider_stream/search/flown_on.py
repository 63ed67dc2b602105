"""An old list of trims, flown on from a position fix: where it leads, and until when it is good.

A vehicle that gets no new list flies on with the old one. Each glide ends at the depth of its end in the plan,
since a vehicle turns by its depth; so the time of a glide does not depend on the current, unless the water rises,
but the place where it ends does.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.control import control_of
from ..kernels.edges import Edge, Status
from ..kernels.flow import rises
from ..kernels.legs import fly_legs
from ..kernels.steer import FLOWN
from ..roadmap.evaluator import Evaluator
from ..roadmap.problem import Problem
from ..water.frame import true_north
from .assembly import Assembly
from .glides import Air, Glides
from .path import SURFACE, Leg, Path

SAME_SPEED = 0.02
"""The trims of a plan are another vehicle's if its speeds differ by more than this share."""
ROUNDED = 1e-6
"""Depths in a plan's file are rounded by less than this [m]."""
MOST_JUMP = 0.1
"""Where one leg ends and the next begins, the current [m/s] that they meet in a step may differ by so much."""
FLOWN_BESIDE = 1.5
"""A leg of a plan may end this many tolerances beside its stop; else it was planned in another water."""
ANOTHER = "give the scenario or the roadmap of the plan, or plan again"


@dataclass(frozen=True)
class Stop:
    """A place (3,) [m] to which a list has been flown, up to leg `legs`, `since` [s] after a fix, at a `cost`."""

    legs: int
    since: float
    place: Array
    cost: float

    @property
    def at_surface(self) -> bool:
        """Whether the vehicle can call there."""
        return bool(self.place[2] >= -SURFACE)


@dataclass(frozen=True)
class FlownOn:
    """An old list flown on: the `path` of the legs that can be flown, which begins at the fix.

    `first` is the number of the old leg with which it goes on, from 1. `why`: why it ends before the list does;
    empty if it does not. `miss` [m] is the horizontal distance from its end to the goal. `stops` are the fix,
    every surfacing, and the end.
    """

    path: Path
    first: int
    miss: float
    why: str
    stops: tuple[Stop, ...]


def check_plan(path: Path, problem: Problem) -> None:
    """Raise InputError unless a plan can be one of this problem, which leaves when the plan does.

    Its places must lie in the box, and its speeds must be those of the vehicle.
    """
    cure = ANOTHER
    z = np.array([[leg.start[2], leg.end[2]] for leg in path.legs])
    require(bool((z <= ROUNDED).all()), f"the plan goes {z.max():g} m above the surface: it was changed; {cure}")
    fits = bool((z >= problem.lo[2] - ROUNDED).all())
    require(fits, f"the plan goes to {-z.min():g} m, below the depths of this scenario: it is another's; {cure}")
    angle, speed = (np.array([getattr(leg, name) for leg in path.legs]) for name in ("glide_angle", "speed"))
    expected = Air(problem.evaluator).speed(np.abs(angle), angle > 0)
    odd = np.flatnonzero(np.abs(speed - expected) > SAME_SPEED * expected)
    if odd.size:
        n, shown = int(odd[0]), math.degrees(angle[odd[0]])
        speeds = f"leg {n + 1} of the plan glides {speed[n]:.3f} m/s at {shown:.1f} degrees"
        require(False, f"{speeds}, this vehicle {expected[n]:.3f}: the plan is another vehicle's; {cure}")


def check_currents(path: Path, problem: Problem) -> None:
    """Raise InputError unless each leg of a plan, flown again, ends where the plan says.

    The problem leaves when the plan does.
    """
    last = problem.evaluator.flow.extent.t_hi
    for n, leg in enumerate(path.legs, 1):
        begins = problem.departure + (0.0 if path.frozen else leg.depart)
        if begins + leg.duration > last:
            return  # these currents end before: what is left cannot be compared
        rows = problem.evaluator.trace(leg.start, _edge(leg, leg.duration, leg.heading), begins)
        off = math.dist(rows[-1, 1:], leg.end)
        most = FLOWN_BESIDE * max(problem.evaluator.integration.tolerance, leg.miss)
        others = "is another scenario's, or the currents have changed since" if n == 1 else "was changed by hand"
        cure = f"{ANOTHER}; name newer currents by --currents" if n == 1 else "plan again"
        where = f"leg {n} of the plan, flown in these currents, ends {off:,.0f} m from where the plan says"
        require(off <= most, f"{where}: the plan {others}; {cure}")


def check_smooth(path: Path) -> None:
    """Raise InputError unless the legs of a plan, where one ends and the next begins, meet nearly the same
    current.

    This needs no currents: the motion of a leg's trajectory less its own speed is the current that it meets.
    """
    met = [(_met(leg, True), _met(leg, False)) for leg in path.legs]
    for n, ((_, before), (after, _)) in enumerate(pairwise(met), 2):
        jump = math.dist(before, after)
        where = f"legs {n - 1} and {n} of the plan meet currents {jump:.2f} m/s apart at one place"
        require(jump <= MOST_JUMP, f"{where}, so the heading of one was changed; plan again")


def _met(leg: Leg, at_first: bool) -> Array:
    """Return the current (2,) [m/s] that a leg meets in the first or last step of its trajectory.

    A step shorter than a second, which may be nothing but rounding, is taken with the step beside it.
    """
    rows = leg.trajectory
    since = rows[:, 0] - rows[0, 0] if at_first else rows[-1, 0] - rows[:, 0]
    far = np.flatnonzero(since >= min(1.0, leg.duration / 2))
    first, second = (rows[0], rows[far[0]]) if at_first else (rows[far[-1]], rows[-1])
    way = np.array([math.cos(leg.heading), math.sin(leg.heading)])
    over_ground = (second[1:3] - first[1:3]) / max(second[0] - first[0], 1e-9)
    return np.asarray(over_ground - leg.speed * math.cos(leg.glide_angle) * way)


def _edge(leg: Leg, duration: float, heading: float) -> Edge:
    return Edge(int(Status.CONNECTED), duration, 0.0, leg.glide_angle, heading, leg.speed, 0.0)


def next_leg(path: Path, since: float) -> int:
    """Return the number of the leg, from 0, with which a vehicle goes on that has surfaced `since` [s] after
    departure.

    It is the leg that begins at the stop nearest in time, because trims end by depth, whatever the current does.
    A stop at the surface is preferred if one lies within a leg's time. len(path.legs): the list is over.
    """
    begins = np.array([leg.depart for leg in path.legs] + [path.legs[-1].depart + path.legs[-1].duration])
    height = np.array([leg.start[2] for leg in path.legs] + [path.legs[-1].end[2]])
    apart = np.abs(begins - since)
    up = np.flatnonzero(height >= -SURFACE)
    longest = max(leg.duration for leg in path.legs)
    if up.size and apart[up].min() <= longest:
        return int(up[apart[up].argmin()])
    return int(apart.argmin())


def flown_on(path: Path, since: float, place: Array, problem: Problem) -> FlownOn:
    """Fly the rest of a `placed` path's trims from a fix (3,) [m], `since` [s] after the path's departure.

    The problem leaves at the fix. The clock runs. The vehicle keeps the compass bearings of the plan.
    """
    assembly = Assembly(problem, frozen=False)
    first = next_leg(path, since)
    hops: list[tuple[Array, Array, Edge]] = []
    stops, clock, here, why = [Stop(0, 0.0, place, 0.0)], 0.0, place, ""
    for number, leg in enumerate(path.legs[first:], first + 1):
        heading, begins = leg.heading + _turned(leg, here, problem), assembly.begins(clock)
        duration = _duration(leg, here, heading, begins, problem.evaluator)
        if duration <= 0:
            continue  # the vehicle is already at or beyond the depth where this glide ends
        if duration == math.inf:
            why = f"on leg {number} the water rises or sinks faster than the vehicle: it never turns"
            break
        edge = _priced(_edge(leg, duration, heading), problem)
        why = _why_not_flown(here, edge, begins, problem, number)
        if why:
            break
        end = problem.evaluator.trace(here, edge, begins)[-1, 1:].copy()
        end[2] = leg.end[2]
        hops.append((here, end, edge))
        clock, here = clock + duration, end
        if end[2] >= -SURFACE or number == len(path.legs):
            stops.append(Stop(number, clock, end, assembly.cost(hops)))
    if stops[-1].since < clock:
        stops.append(Stop(first + len(hops), clock, here, assembly.cost(hops)))
    flown = assembly.path(place, here, hops)
    miss = math.dist(here[:2], path.goal[:2])
    return FlownOn(flown, first + 1, miss, why, tuple(stops))


def _duration(leg: Leg, here: Array, heading: float, begins: float, evaluator: Evaluator) -> float:
    """Return how long [s] the vehicle glides until it is at the depth of a leg's end; inf if it never is.

    0 or less if it is there already. In water that rises the glide is flown to know it.
    """
    flow, still = evaluator.flow, (float(leg.end[2]) - float(here[2])) / (leg.speed * math.sin(leg.glide_angle))
    if still <= 0 or not rises(flow):
        return still
    through = control_of(leg.speed, leg.glide_angle, heading)
    integration, end = evaluator.integration, np.empty((1, 3))
    start, velocity = np.array([[*here, begins]]), np.array([[through.u, through.v, through.w]])
    longest = FLOWN * integration.dt * integration.steps
    height = np.array([float(leg.end[2])])
    fly_legs(flow, start, velocity, np.array([still]), height, longest, integration.dt, end, 0, 1)
    return float(end[0, 2]) if math.isfinite(end[0, 0]) else math.inf


def _turned(leg: Leg, here: Array, problem: Problem) -> float:
    """Return the change [rad] of a heading in the frame by which its compass bearing stays the same at another
    place."""
    return 0.0 if problem.to_lonlat is None else true_north(problem.to_lonlat, here) - leg.north


def _priced(edge: Edge, problem: Problem) -> Edge:
    price = problem.evaluator.cost.kernel()
    return edge._replace(cost=price.per_second * edge.time + price.per_leg)


def _why_not_flown(here: Array, edge: Edge, begins: float, problem: Problem, number: int) -> str:
    """Return why a leg cannot be flown from a place; an empty text if it can."""
    evaluator = problem.evaluator
    if begins + edge.time > evaluator.flow.extent.t_hi:
        return f"the currents' times end during leg {number}"
    rise = edge.speed * math.sin(edge.glide_angle) * edge.time
    angle, heading, time, departs, miss = (
        np.array([value]) for value in (abs(edge.glide_angle), edge.heading, edge.time, begins, 0.0)
    )
    glides, end = Glides(angle, heading, time, departs, miss), here + np.array([0.0, 0.0, rise])
    if Air(evaluator).fit(here[None], end[None], glides)[0]:
        return ""
    return f"leg {number} would leave the known water, or touch land, seabed or a keep-out area"


@dataclass(frozen=True)
class GoodUntil:
    """Until when an old list is good: up to the stop `last`, at which a call at the latest must bring a new list.

    A list is good as long as a vehicle that flies it on to a surfacing, and is planned anew from there, spends at
    most the share `tolerance` more in all than by the new plan now. `extra` is what that is at `last`, as a
    share; `beyond` says what comes after it. `whole`: the list is good to its end.
    """

    last: Stop
    extra: float
    tolerance: float
    beyond: str
    whole: bool

    def as_dict(self, lonlat: Callable[[Array], Any]) -> dict[str, Any]:
        """Return the same for JSON; `lonlat` shows a place."""
        return {
            "since_fix_s": self.last.since,
            "place": lonlat(self.last.place),
            "leg": self.last.legs,
            "extra_share": self.extra,
            "tolerance_share": self.tolerance,
            "beyond": self.beyond,
            "whole": self.whole,
        }


def good_until(flown: FlownOn, cost: float, left: Callable[[Stop], float], tolerance: float) -> GoodUntil:
    """Return until when a list is good.

    `cost`: of the new plan now. `left`: the cost of a new plan from a stop; inf if none exists. By the principle
    of optimality the sum does not fall from one stop to the next, so the last good stop is found by halving.
    Among the nodes of a roadmap that holds up to the nodes' spacing.
    """
    stops = [stop for stop in flown.stops if stop.at_surface or stop is flown.stops[-1]]

    def extra(stop: Stop) -> float:
        return (stop.cost + left(stop)) / cost - 1 if cost > 0 else 0.0

    known = {0: 0.0}
    low, high = 0, len(stops)
    if len(stops) > 1:
        known[len(stops) - 1] = extra(stops[-1])
        if known[len(stops) - 1] <= tolerance:
            low = len(stops) - 1
        else:
            high = len(stops) - 1
    while high - low > 1 and low < len(stops) - 1:
        middle = (low + high) // 2
        known[middle] = extra(stops[middle])
        low, high = (middle, high) if known[middle] <= tolerance else (low, middle)
    whole = len(stops) > 1 and low == len(stops) - 1 and not flown.why
    beyond = flown.why
    if len(stops) == 1 and not beyond:
        beyond = "all its glides that are left end at the depth where the vehicle is, so it flies none of them"
    if low < len(stops) - 1:
        more = known[low + 1]
        beyond = f"a new plan from the next surfacing would cost {more:.1%} more in all than the new plan now"
        if math.isinf(more):
            beyond = "no way to the goal is found from the next surfacing"
    return GoodUntil(stops[low], known[low], tolerance, beyond, whole)
