"""Assembly: legs that a search has chosen made into the path that is flown."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array, Index
from ..base.settings import require
from ..kernels.edges import Edge, Status
from ..roadmap.problem import Problem
from ..water.frame import true_north
from ..water.inspect import is_steady
from .path import Hop, Leg, Path
from .surfacing import Surfacing
from .trade_off import TradeOff

EXACT_MAY_FIND = (Status.NO_HIT, Status.BLOCKED, Status.CURRENT_TOO_STRONG)
FLOWN_AGAIN = 0.1
"""By how much a leg that is flown again may miss by more than the tolerance, in tolerances: as in verify."""


class Assembly:
    """Makes paths of legs in a problem's flow; with `frozen` every leg is flown as at the problem's departure."""

    def __init__(self, problem: Problem, frozen: bool) -> None:
        """`frozen` says nothing of a steady flow."""
        self.problem = problem
        self.changes = not is_steady(problem.evaluator.flow)
        self.frozen = frozen and self.changes

    def begins(self, since: float) -> float:
        """The time [s] whose current a leg meets that begins `since` [s] after departure."""
        return self.problem.departure + since if self.clock_runs else self.problem.departure

    @property
    def clock_runs(self) -> bool:
        """Whether each leg meets the current of the time at which it begins."""
        return self.changes and not self.frozen

    def connect(self, start: Array, end: Array, begins: float) -> Edge:
        """One glide between two points (3,) [m], as the roadmap's method finds it, else by the flow map.

        A line or a surface of controls finds few of the glides that there are; what it says of a pair that
        the flow map does not join either stays. In a flow that ends, no glide ends later.
        """
        evaluator = self.problem.evaluator
        edge = evaluator.connect_pair(start, end, begins)
        if edge.status in EXACT_MAY_FIND and evaluator.by_fan() is not evaluator:
            exact = evaluator.by_fan().connect_pair(start, end, begins)
            edge = exact if exact.status == Status.CONNECTED else edge
        late = edge.status == Status.CONNECTED and begins + edge.time > evaluator.flow.extent.t_hi
        return Edge(int(Status.NO_HIT), *[math.nan] * 6) if late else edge

    def fly(self, hops: list[Hop]) -> Path:
        """The path of some legs flown again; InputError where one does not end where it says."""
        path = self.path(hops[0][0], hops[-1][1], hops)
        most = (1 + FLOWN_AGAIN) * self.problem.evaluator.integration.tolerance
        for n, leg in enumerate(path.legs, 1):
            off = math.dist(leg.trajectory[-1, 1:], leg.end)
            require(off <= most, f"leg {n} ends {off:.1f} m from where it should; `verify` the roadmap")
        return path

    def path(self, start: Array, goal: Array, hops: list[Hop]) -> Path:
        """The path of some legs; of none where start and goal are one point."""
        legs, clock = [], 0.0
        for source, target, edge in hops:
            begins = self.begins(clock)
            rows = self.problem.evaluator.trace(source, edge, begins)
            rows[:, 0] += clock - begins
            # the sum above rounds: legs follow each other exactly, and no row lies beyond its leg's end
            rows[:, 0] = np.clip(rows[:, 0], clock, clock + edge.time)
            rows[[0, -1], 0] = clock, clock + edge.time
            control = edge.glide_angle, edge.heading, edge.speed
            ends, track = self._lonlat(source, target), self._lonlat(*rows[:, 1:])
            north = self._north(source)
            legs.append(
                Leg(source, target, *control, clock, edge.time, edge.miss, rows, ends, track, north, edge.cost)
            )
            clock += edge.time
        return self._titled(start, goal, self.cost(hops), tuple(legs))

    def no_path(self, start: Array, goal: Array, why: str = "") -> Path:
        """The honest no."""
        return self._titled(start, goal, math.inf, (), why)

    def cost(self, hops: list[Hop]) -> float:
        """The scenario's own cost of some legs, their turns included."""
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
    """What answers queries, whether from a roadmap's legs or by legs found with the clock running.

    `rule`: of surfacing; its paths keep it. Points are (3,) [m]; None for the scenario's own start or goal.
    """

    def __init__(self, problem: Problem, rule: Surfacing, frozen: bool) -> None:
        """`frozen`: in a flow that changes every leg meets the current of the departure."""
        self.problem, self.rule, self.assembly = problem, rule, Assembly(problem, frozen)

    @abstractmethod
    def query(self, start: ArrayLike | None = None, goal: ArrayLike | None = None) -> Path:
        """The cheapest path between two points."""

    @abstractmethod
    def within(self, start: ArrayLike | None, goal: ArrayLike | None, most_cost: float) -> Path:
        """The fastest path that costs no more than so much; where there is none, why."""

    @abstractmethod
    def front(self, start: ArrayLike | None = None, goal: ArrayLike | None = None) -> TradeOff:
        """Every path that no other beats both in time and in energy, by rising time."""

    @abstractmethod
    def table(self, starts: Sequence[ArrayLike], goals: Sequence[ArrayLike]) -> Array:
        """Costs of the cheapest paths from n points to m others: (n, m), inf where there is none."""

    @abstractmethod
    def arrivals(self, start: ArrayLike | None = None) -> Array:
        """When each node (n,) can be reached at the soonest [s since departure]; inf where it cannot."""

    @abstractmethod
    def leaving(self, since: float) -> "RoutePlanner":
        """The same planner for routes that leave `since` [s] later."""

    def connect(self, start: Array, end: Array, since: float = 0.0) -> Edge:
        """One glide between two points, begun `since` [s] after departure; see `Assembly.connect`."""
        return self.assembly.connect(start, end, self.assembly.begins(since))

    def fly(self, hops: list[Hop]) -> Path:
        """The path of some legs flown again; InputError where one does not end where it says."""
        return self.assembly.fly(hops)


def placed_end(problem: Problem, point: ArrayLike | None, named: Array | None, name: str) -> Array:
    """Where an end of a query is (3,) [m], the scenario's `named` where none is given; checked."""
    if point is None:
        require(named is not None, f"the scenario names no {name}; give one with --{name} X,Y,Z")
        point = named
    place = np.asarray(point, np.float64)
    require(place.shape == (3,), f"`{name}` must be three numbers X,Y,Z; got {place.tolist()}")
    problem.check_point(place, name)
    return place


def nodes_at(position: Array, place: Array) -> Index:
    """The nodes of (n, 3) [m] that lie at a place, often none."""
    return np.flatnonzero((position == place).all(axis=1))
