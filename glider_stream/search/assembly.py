"""Assembly: makes the path that is flown from the legs that a search has chosen."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array, Index
from ..base.settings import require
from ..kernels.edges import Edge, Status
from ..kernels.flow import rises
from ..roadmap.problem import Problem
from ..water.frame import true_north
from ..water.inspect import is_steady
from .path import Hop, Leg, Path
from .surfacing import Surfacing
from .trade_off import TradeOff

EXACT_MAY_FIND = (Status.NO_HIT, Status.BLOCKED, Status.CURRENT_TOO_STRONG)
FLOWN_AGAIN = 0.1
"""A leg that is flown again may miss by one tolerance and this share of it more, as in `verify`."""


class Assembly:
    """Makes paths from legs in a problem's flow; with `frozen` every leg meets the current of the departure."""

    def __init__(self, problem: Problem, frozen: bool) -> None:
        """Keep the problem; `frozen` has no effect in a steady flow."""
        self.problem = problem
        self.changes = not is_steady(problem.evaluator.flow)
        self.frozen = frozen and self.changes

    def begins(self, since: float) -> float:
        """Return the flow's time [s] for a leg that begins `since` [s] after departure."""
        return self.problem.departure + since if self.clock_runs else self.problem.departure

    @property
    def clock_runs(self) -> bool:
        """Whether each leg meets the current of the time at which it begins."""
        return self.changes and not self.frozen

    def connect(self, start: Array, end: Array, begins: float) -> Edge:
        """Return one glide between two points (3,) [m]: by the roadmap's method, else by the flow map.

        The control line and the control surface find only few of the glides that exist. If the flow map finds no
        glide either, the status of the roadmap's method is returned. No glide ends after the flow's last time.
        """
        evaluator = self.problem.evaluator
        edge = evaluator.connect_pair(start, end, begins)
        if edge.status in EXACT_MAY_FIND and evaluator.by_fan() is not evaluator:
            exact = evaluator.by_fan().connect_pair(start, end, begins)
            edge = exact if exact.status == Status.CONNECTED else edge
        late = edge.status == Status.CONNECTED and begins + edge.time > evaluator.flow.extent.t_hi
        return Edge(int(Status.NO_HIT), *[math.nan] * 6) if late else edge

    def fly(self, hops: list[Hop]) -> Path:
        """Fly legs again and return their path; InputError if a leg does not end at its target."""
        path = self.path(hops[0][0], hops[-1][1], hops)
        most = (1 + FLOWN_AGAIN) * self.problem.evaluator.integration.tolerance
        for n, leg in enumerate(path.legs, 1):
            off = math.dist(leg.trajectory[-1, 1:], leg.end)
            require(off <= most, f"leg {n} ends {off:.1f} m from where it should; `verify` the roadmap")
        return path

    def path(self, start: Array, goal: Array, hops: list[Hop]) -> Path:
        """Return the path of `hops`; the list is empty if start and goal are the same point."""
        legs, clock = [], 0.0
        for source, target, edge in hops:
            begins = self.begins(clock)
            rows = self.problem.evaluator.trace(source, edge, begins)
            rows[:, 0] += clock - begins
            # the sum above has rounding errors; legs must follow each other exactly, each row within its leg
            rows[:, 0] = np.clip(rows[:, 0], clock, clock + edge.time)
            rows[[0, -1], 0] = clock, clock + edge.time
            control = edge.glide_angle, edge.heading, edge.speed
            ends, track = self._lonlat(source, target), self._lonlat(*rows[:, 1:])
            north, lifted = self._north(source), self._lifted(edge, rows)
            times = clock, edge.time, edge.miss
            legs.append(Leg(source, target, *control, *times, rows, ends, track, north, edge.cost, lifted))
            clock += edge.time
        return self._titled(start, goal, self.cost(hops), tuple(legs))

    def _lifted(self, edge: Edge, rows: Array) -> float:
        """Return how far [m] the water has lifted the glider on a leg; 0 in a flow without a vertical part."""
        if not rises(self.problem.evaluator.flow):
            return 0.0
        return float(rows[-1, 3] - rows[0, 3]) - edge.speed * math.sin(edge.glide_angle) * edge.time

    def no_path(self, start: Array, goal: Array, why: str = "") -> Path:
        """Return a path that is not found, with the reason `why`."""
        return self._titled(start, goal, math.inf, (), why)

    def cost(self, hops: list[Hop]) -> float:
        """Return the scenario's cost of `hops`, with the cost of their turns."""
        dived, turns = True, 0.0
        for source, _, edge in hops:
            climbs = edge.glide_angle > 0
            turn = self.problem.evaluator.cost.inflection(source[2]) if climbs and dived else None
            turns, dived = turns + (0.0 if turn is None else float(turn)), not climbs
        return sum(edge.cost for _, _, edge in hops) + turns

    def _titled(self, start: Array, goal: Array, cost: float, legs: tuple[Leg, ...], why: str = "") -> Path:
        problem = self.problem
        return Path(
            start,
            goal,
            cost,
            legs,
            self._lonlat(start, goal),
            problem.departs,
            problem.evaluator.cost.unit,
            why,
            departure=problem.departure if self.changes else None,
            frozen=self.frozen,
        )

    def _north(self, point: Array) -> float:
        to_lonlat = self.problem.to_lonlat
        return 0.0 if to_lonlat is None else true_north(to_lonlat, point)

    def _lonlat(self, *points: Array) -> Array | None:
        to_lonlat = self.problem.to_lonlat
        return None if to_lonlat is None else to_lonlat(np.stack(points))


class RoutePlanner(ABC):
    """The interface of all planners: those that use a roadmap's legs, and those that find legs as the clock runs.

    All paths keep `rule`, the rule of surfacing. Points are (3,) [m]; None stands for the scenario's start or
    goal.
    """

    def __init__(self, problem: Problem, rule: Surfacing, frozen: bool) -> None:
        """Keep problem and rule; with `frozen` every leg meets the current of the departure."""
        self.problem, self.rule, self.assembly = problem, rule, Assembly(problem, frozen)

    @abstractmethod
    def query(self, start: ArrayLike | None = None, goal: ArrayLike | None = None) -> Path:
        """Return the cheapest path between two points."""

    @abstractmethod
    def within(self, start: ArrayLike | None, goal: ArrayLike | None, most_cost: float) -> Path:
        """Return the fastest path that costs at most `most_cost`; if no path does, it says why."""

    @abstractmethod
    def front(self, start: ArrayLike | None = None, goal: ArrayLike | None = None) -> TradeOff:
        """Return every path for which no other is better both in time and in energy, sorted by time."""

    @abstractmethod
    def table(self, starts: Sequence[ArrayLike], goals: Sequence[ArrayLike]) -> Array:
        """Return the costs of the cheapest paths from n points to m others: (n, m); inf where no path exists."""

    @abstractmethod
    def arrivals(self, start: ArrayLike | None = None) -> Array:
        """Return the earliest time [s after departure] at each node (n,); inf where a node is not reached."""

    @abstractmethod
    def leaving(self, since: float) -> "RoutePlanner":
        """Return the same planner for routes that leave `since` [s] later."""

    def connect(self, start: Array, end: Array, since: float = 0.0) -> Edge:
        """Return one glide between two points that begins `since` [s] after departure; see `Assembly.connect`."""
        return self.assembly.connect(start, end, self.assembly.begins(since))

    def fly(self, hops: list[Hop]) -> Path:
        """Fly legs again and return their path; InputError if a leg does not end at its target."""
        return self.assembly.fly(hops)


def placed_end(problem: Problem, point: ArrayLike | None, named: Array | None, name: str) -> Array:
    """Return an end of a query (3,) [m], after checks; it is the scenario's `named` if `point` is None."""
    if point is None:
        require(named is not None, f"the scenario names no {name}; give one with --{name} X,Y,Z")
        point = named
    place = np.asarray(point, np.float64)
    require(place.shape == (3,), f"`{name}` must be three numbers X,Y,Z; got {place.tolist()}")
    problem.check_point(place, name)
    return place


def nodes_at(position: Array, place: Array) -> Index:
    """Return the numbers of the nodes (n, 3) [m] that lie exactly at a place; often the result is empty."""
    return np.flatnonzero((position == place).all(axis=1))
