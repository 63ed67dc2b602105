"""Pilots: a policy makes orders from a fix and a forecast, once or at each call."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Array
from ..kernels.control import DIVE
from ..roadmap.builder import build_roadmap
from ..roadmap.problem import Problem
from ..roadmap.roadmap import Roadmap
from ..search.answer import planner_of
from ..search.assembly import RoutePlanner
from ..search.path import Path
from ..water.inspect import is_steady
from .assimilating import corrected
from .depth_averaged import Chart, chart_of
from .orders import Orders, Waypoints, trims_of, waypoints_of
from .settings import Mission
from .vehicle import Dive, Fix


class Office:
    """What a pilot plans with in one current: a problem, its planner and chart, each made when it is needed."""

    def __init__(self, problem: Problem, mission: Mission, road: Roadmap | None = None) -> None:
        """Keep the problem, and in a steady current its roadmap, if that is known."""
        self.problem, self.mission, self._road = problem, mission, road

    @cached_property
    def planner(self) -> RoutePlanner:
        """The planner of routes that come up as the mission asks; in a steady current it has a roadmap's legs."""
        steady = is_steady(self.problem.evaluator.flow)
        road = build_roadmap(self.problem) if steady and self._road is None else self._road
        return planner_of(self.problem, road, self.mission.pilot.rule)

    @cached_property
    def chart(self) -> Chart:
        """The map of depth-averaged currents."""
        return chart_of(self.problem, self.depth, self.mission.arrival.longest)

    @property
    def goal(self) -> Array:
        """The goal (3,) [m]."""
        assert self.problem.goal is not None
        return self.problem.goal

    @property
    def depth(self) -> float:
        """The depth of a yo that no plan has chosen [m, downward]: the domain's deepest."""
        return -float(self.problem.lo[2])

    @property
    def angle(self) -> float:
        """The angle of the fastest glide [rad]."""
        return float(self.problem.evaluator.polar.best_angle[DIVE])

    def route(self, fix: Fix) -> Path | None:
        """Return the best route from a fix to the goal; None without one, or if the fix is outside the water."""
        start = np.array([fix.x, fix.y, 0.0])
        if not bool(self.problem.evaluator.allowed(start[None], fix.t)[0]):
            return None
        since = fix.t - self.problem.departure
        steady = is_steady(self.problem.evaluator.flow)
        path = (self.planner if steady else self.planner.leaving(since)).query(start, self.goal)
        return path if path.found and path.legs else None

    def after(self, dives: Sequence[Dive]) -> "Office":
        """Return the office with the forecast corrected by dives; this one if nothing is to correct."""
        problem = corrected(self.problem, self.mission, dives)
        return self if problem is self.problem else Office(problem, self.mission)

    def towards(self, stops: Array) -> Waypoints:
        """Return the orders to head for places (n, 2) [m] with the deepest yos at the fastest glide."""
        count = len(stops)
        return Waypoints(np.asarray(stops), np.full(count, self.depth), np.full(count, self.angle))


@dataclass(frozen=True)
class Plan:
    """Orders, the route on a map (n, 2) [m] that they stand for, and the time that they should take [s]."""

    orders: Orders
    line: Array
    takes: float


def plan_of(path: Path, office: Office, steering: str | None = None) -> Plan:
    """Return a route as orders for a `steering`, the mission's if it is None."""
    by_trims = (steering or office.mission.vehicle.steering) == "trims"
    orders = trims_of(path) if by_trims else waypoints_of(path, office.angle)
    return Plan(orders, path.trajectory[:, 1:3], path.travel_time)


class Policy(ABC):
    """A way to make orders; `replans`: again at each call; `knows`: it plans in the true current."""

    replans = True
    knows = False

    @abstractmethod
    def plan(self, office: Office, fix: Fix) -> Plan | None:
        """Return a plan from a fix, or None."""


class Replan(Policy):
    """The fastest route in the forecast, again at each call."""

    def plan(self, office: Office, fix: Fix) -> Plan | None:
        """Return the best route from a fix."""
        path = office.route(fix)
        return None if path is None else plan_of(path, office)


class Assimilate(Replan):
    """The fastest route in the forecast corrected by the currents of all dives so far, again at each call."""

    def plan(self, office: Office, fix: Fix) -> Plan | None:
        """Return the best route from a fix in the corrected forecast."""
        return super().plan(office.after(fix.dives), fix)


class OpenLoop(Replan):
    """The fastest route in the forecast, made once."""

    replans = False


class Omniscient(Replan):
    """The fastest route in the true current, again at each call; no pilot can do better."""

    knows = True


class Straight(Policy):
    """Straight for the goal, with the deepest yos at the fastest glide."""

    replans = False

    def plan(self, office: Office, fix: Fix) -> Plan | None:
        """Return the goal as the only waypoint."""
        stops = office.goal[None, :2]
        return Plan(office.towards(stops), np.vstack([[fix.x, fix.y], stops]), float("nan"))


class DepthAveraged(Policy):
    """The fastest way on a map of depth-averaged forecast currents (A*), again at each call."""

    def plan(self, office: Office, fix: Fix) -> Plan | None:
        """Return the way's places as waypoints."""
        speed = float(office.problem.evaluator.polar.best_horizontal[DIVE])
        here = np.array([fix.x, fix.y])
        stops = office.chart.fastest(here, office.goal[:2], fix.t, speed)
        return None if stops is None else Plan(office.towards(stops), np.vstack([here, stops]), float("nan"))


POLICIES: dict[str, type[Policy]] = {
    "open-loop": OpenLoop,
    "replan": Replan,
    "assimilate": Assimilate,
    "straight": Straight,
    "depth-averaged": DepthAveraged,
    "omniscient": Omniscient,
}
