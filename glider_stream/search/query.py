"""Queries: the cheapest ways over a roadmap, with a start and a goal attached to it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array, Index
from ..kernels.cheapest import Ahead, Rows, cheapest_ways
from ..kernels.cost import CostRates
from ..kernels.edges import COST, GLIDE_ANGLE, STATUS, TIME, Edge, Status, edge_of
from ..roadmap.pairs import Attached, LegFinder
from ..roadmap.problem import Problem
from ..roadmap.provenance import check_unchanged
from ..roadmap.roadmap import Roadmap
from ..roadmap.rows import CHEAPEST, FASTEST, Blend, EdgeRows
from ..roadmap.slices import SlicedRoadmap
from ..roadmap.step_error import check_steps
from ..roadmap.store import StoredRoadmap
from .assembly import RoutePlanner, nodes_at, placed_end
from .expansion import Fan
from .labels import Aim, LabelSearch
from .least_time import NOTHING_AHEAD, GreatestSpeeds, fastest_sink
from .path import Hop, Path
from .surfacing import Surfacing
from .trade_off import LeftInRoadmap, RoadmapEnds, RoadmapExpansion, TradeOff
from .why_not import why_not

NOTHING = Edge(int(Status.NO_HIT), *[math.nan] * 6)
MOST_KEPT = 2
"""The edges of this many blends are kept: as a rule the scenario's cost, and time."""
TOGETHER = 32
"""When a search needs edges that are not read yet, the edges of this many nodes are read, in different blocks."""
FAR = 20_000
"""With fewer nodes a bound of what remains to the goal takes longer than it saves."""


@dataclass(frozen=True)
class End:
    """An end of a query: its `point` (3,) [m] and the nodes at that point; `legs` if no node lies there."""

    point: Array
    nodes: Index
    legs: Attached | None


@dataclass(frozen=True)
class _Search:
    """The cheapest ways from a start: the cost and the predecessor `before` of every state.

    If turns are free, a state is a node. Otherwise a node has two states: reached by a dive, reached by a climb.
    The last state is a start that is not a node; `origin` is the state of the start.
    """

    start: End
    blend: Blend
    rows: EdgeRows
    origin: int
    cost: Array
    before: Index


class Planner(RoutePlanner):
    """Answers any number of queries from one roadmap, also from several threads; the roadmap is not changed.

    Examples:
        >>> planner = glider_stream.Planner(road.roadmap, road.problem)
        >>> planner.query(np.array([-190.0, 190.0, 0.0]), np.array([100.0, -100.0, -75.0])).found
        True
    """

    def __init__(
        self,
        roadmap: Roadmap | StoredRoadmap,
        problem: Problem,
        rule: Surfacing = Surfacing(),  # noqa: B008  (frozen)
    ) -> None:
        """Check that the roadmap was built with the problem's flow, terrain and glider.

        Of a roadmap of one departure that stays in its file, the edges are read that a search comes to; the
        routes are the same.
        """
        check_unchanged(roadmap, problem)
        check_steps(roadmap, problem)
        self._source, self.position = roadmap, roadmap.position
        super().__init__(problem, rule, frozen=True)
        self._kept: dict[Blend, EdgeRows] = {}
        self._turn_by_turn = Lock()

    @cached_property
    def roadmap(self) -> Roadmap:
        """The roadmap with all its edges; if it stayed in its file, it is read now."""
        whole = self._source.whole()
        assert not isinstance(whole, SlicedRoadmap)
        return whole

    def query(
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        blend: Blend = CHEAPEST,
    ) -> Path:
        """Return the cheapest path between two points (3,) [m]; None stands for the scenario's start or goal.

        A point that is a node is used directly. Any other point is attached to its neighbours, and the direct leg
        from start to goal is tried, too. `blend` says which sum of cost and time is made least.
        """
        path = self.queries(start, [goal], blend)[0]
        if path.found:
            return path
        reason = why_not(self.problem, *self._reached(path.start), path.start, path.goal)
        return replace(path, why=str(reason), why_not=reason.as_dict())

    def queries(
        self,
        start: ArrayLike | None,
        goals: Sequence[ArrayLike | None],
        blend: Blend = CHEAPEST,
    ) -> list[Path]:
        """Return the cheapest paths from one point (3,) [m] to each of many, as `query` does, by one search."""
        ends = [self._goal(goal) for goal in goals]
        search = self._search(self._start(start), blend, ends)
        direct = self._direct(search.start, ends)
        return [self._way(search, end, leg) for end, leg in zip(ends, direct, strict=True)]

    def arrivals(self, start: ArrayLike | None = None) -> Array:
        """Return the earliest time (n,) [s] at which each node is reached from a point; inf if it never is."""
        search = self._search(self._start(start), FASTEST)
        return np.asarray(search.cost.reshape(-1, self._phases).min(axis=1))

    def remaining(self, goal: ArrayLike | None = None) -> Array:
        """Return the least time (n,) [s] from each node to a point; inf if no way leads there."""
        from scipy.sparse import csr_array  # importing both takes 0.1 s, and a query does not need them
        from scipy.sparse.csgraph import dijkstra

        road, end = self.roadmap, self._goal(goal)
        nodes = len(road.position)
        backward = csr_array((road.time, road.target, road.indptr), shape=(nodes, nodes)).T.tocoo()
        last = end.nodes if end.legs is None else end.legs.nodes
        times = np.zeros(last.size) if end.legs is None else end.legs.outcomes[:, TIME]
        # the goal is one more node, from which the search runs backward; a time of 0 would be no edge
        to = np.concatenate([backward.col, last]), np.concatenate([backward.data, np.maximum(times, 1e-9)])
        begin = np.concatenate([backward.row, np.full(last.size, nodes)])
        graph = csr_array((to[1], (begin, to[0])), shape=(nodes + 1, nodes + 1))
        return np.asarray(dijkstra(graph, directed=True, indices=[nodes])[0, :nodes])

    def front(
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
    ) -> TradeOff:
        """Return every path for which no other is better both in time and in energy, sorted by time."""
        rule = self.rule
        begin, end = self._start(start), self._goal(goal)
        for place, name in ((begin.point, "start"), (end.point, "goal")):
            rule.check_end(place, name)
        if np.array_equal(begin.point, end.point):
            return TradeOff((self._path(begin.point, end.point, []),))
        direct = self._direct(begin, [end])[0]
        legs = [None if at.legs is None else Fan(at.legs.nodes, at.legs.outcomes) for at in (begin, end)]
        ends = RoadmapEnds(begin.point, end.point, begin.nodes, end.nodes, legs[0], legs[1], direct)
        expansion, evaluator, departure = RoadmapExpansion(self.roadmap, ends), self.problem.evaluator, 0.0
        left = LeftInRoadmap(expansion, fastest_sink(evaluator.polar, evaluator.flow))
        aim = Aim(front=True)
        search = LabelSearch(expansion, evaluator.cost, rule, left, expansion.goals, departure, aim)
        found = [n for n in search.settled() if search.is_goal[search.labels[n].place]]
        if not found:
            return TradeOff((self.assembly.no_path(begin.point, end.point),))
        return TradeOff(tuple(self._path(begin.point, end.point, search.hops(n)) for n in found))

    def _reached(self, start: Array) -> tuple[Array, Array]:
        """Return the nodes' positions (n, 3) [m], and the earliest time (n,) [s] at which each is reached."""
        return self.position, self.arrivals(start)

    def within(self, start: ArrayLike | None, goal: ArrayLike | None, most_cost: float) -> Path:
        """Return the fastest path that costs at most `most_cost`; if no path does, it says why."""
        return self.front(start, goal).within(most_cost)

    def leaving(self, since: float) -> "Planner":
        """Return this planner: its legs are the same at any time."""
        return self

    def table(self, starts: Sequence[ArrayLike], goals: Sequence[ArrayLike]) -> Array:
        """Return the costs (n, m) of the cheapest paths from n points (3,) [m] to m others; else inf."""
        ends = [self._goal(goal) for goal in goals]
        costs = np.empty((len(starts), len(goals)))
        for row, start in zip(costs, starts, strict=True):
            search = self._search(self._start(start), CHEAPEST, ends)
            for m, (end, leg) in enumerate(zip(ends, self._direct(search.start, ends), strict=True)):
                here = np.array_equal(search.start.point, end.point)
                row[m] = 0.0 if here else min(self._through(search, end)[0], self._alone(search, leg))
        return costs

    @cached_property
    def _turns(self) -> Array | None:
        """The cost (n,) of a turn from dive to climb at each node; None if turns are free."""
        return self.problem.evaluator.cost.inflection(self.position[:, 2])

    def _turn(self, blend: Blend, z: float) -> float:
        cost = self.problem.evaluator.cost.inflection(z)
        return 0.0 if cost is None else blend.cost * float(cost)

    def _alone(self, search: _Search, leg: Edge) -> float:
        """Return the cost of the direct leg, inf if it does not exist; its start counts as the end of a dive."""
        if leg.status != Status.CONNECTED:
            return math.inf
        turn = self._turn(search.blend, search.start.point[2]) if leg.glide_angle > 0 else 0.0
        return float(search.blend.of(leg.cost, leg.time)) + turn

    @cached_property
    def _legs(self) -> LegFinder:
        return self.problem.legs(self.position)

    def _start(self, point: ArrayLike | None) -> End:
        nodes, place = self._place(point, self.problem.start, "start")
        return End(place, nodes, None if nodes.size else _connected(self._legs.away(place)))

    def _goal(self, point: ArrayLike | None) -> End:
        nodes, place = self._place(point, self.problem.goal, "goal")
        return End(place, nodes, None if nodes.size else _connected(self._legs.towards(place)))

    def _place(self, point: ArrayLike | None, named: Array | None, name: str) -> tuple[Index, Array]:
        """Return the nodes at an end of the query (often the array is empty), and its position (3,) [m]."""
        place = placed_end(self.problem, point, named, name)
        return nodes_at(self.position, place), place

    def _rows(self, blend: Blend) -> EdgeRows:
        """Return the edges for a search; later queries use the same, and what they have read."""
        with self._turn_by_turn:
            if blend not in self._kept:
                if len(self._kept) == MOST_KEPT:
                    del self._kept[next(iter(self._kept))]
                self._kept[blend] = self._source.rows(blend)
            return self._kept[blend]

    @property
    def _phases(self) -> int:
        """The number of states of a node."""
        return 1 if self._turns is None else 2

    @cached_property
    def _speeds(self) -> GreatestSpeeds:
        return GreatestSpeeds(self.problem, self.position, self.problem.departure)

    def _ahead(self, goal: Array, blend: Blend) -> Ahead:
        """Return a bound of what remains to a goal (3,) [m]; it says nothing if none is known, or none pays."""
        if len(self.position) < FAR or not self.problem.evaluator.exact:
            return NOTHING_AHEAD
        rates = self.problem.evaluator.cost.kernel()
        per_second = blend.cost * rates.per_second + blend.time
        return self._speeds.ahead(goal, CostRates(per_second, blend.cost * rates.per_leg))

    def _search(self, start: End, blend: Blend, goals: Sequence[End] = ()) -> _Search:
        """Search from a start to one goal; without a goal, or with many, to all that can be reached."""
        nodes, phases, rows = len(self.position), self._phases, self._rows(blend)
        states, turns = nodes * phases, self._turns
        spent, before = np.full(states, math.inf), np.full(states, states, np.int64)
        origin = states
        if start.legs is None:
            origin = int(start.nodes[0]) * phases
            spent[origin] = 0.0
        else:
            legs, climbs = start.legs.outcomes, start.legs.outcomes[:, GLIDE_ANGLE] > 0
            turn = np.where(climbs, self._turn(blend, start.point[2]), 0.0)
            to = start.legs.nodes if phases == 1 else 2 * start.legs.nodes + climbs
            spent[to] = blend.of(legs[:, COST], legs[:, TIME]) + turn
        last, ahead = np.full(states, math.inf), NOTHING_AHEAD
        if len(goals) == 1:
            ahead = self._ahead(goals[0].point, blend)
            reached, adds, turned = self._last(goals[0], blend)
            last[reached] = adds + turned
        turn = np.empty(0) if turns is None else blend.cost * turns
        least = np.full(nodes, 0.0 if ahead is NOTHING_AHEAD else math.nan)
        settled = np.zeros(states, np.bool_)
        wanted = np.empty(TOGETHER, np.int64)
        ends = self.position, turn, ahead, last, least, spent, before, settled, wanted
        edges = rows.indptr, rows.target, rows.weight, rows.block
        while lacking := cheapest_ways(Rows(*edges, rows.known), *ends):
            rows.need(wanted[:lacking])
        return _Search(start, blend, rows, origin, spent, before)

    def _direct(self, start: End, goals: Sequence[End]) -> list[Edge]:
        """Return the direct legs from start to each goal; between two nodes only the roadmap's edges count."""
        asked = [n for n, end in enumerate(goals) if start.legs is not None or end.legs is not None]
        points = np.array([start.point, *(goals[n].point for n in asked)])
        rows = [0], [0, len(asked)], np.arange(1, len(points))
        found = self.problem.evaluator.connect(points, self.problem.departure, *rows)
        legs = [NOTHING] * len(goals)
        for n, row in zip(asked, found, strict=True):
            legs[n] = edge_of(row)
        return legs

    def _way(self, search: _Search, goal: End, direct: Edge) -> Path:
        """Return the path to a goal, through nodes or by the direct leg."""
        start_at, goal_at = search.start.point, goal.point
        if np.array_equal(start_at, goal_at):
            return self._path(start_at, goal_at, [])
        cost, state, leg = self._through(search, goal)
        if self._alone(search, direct) < cost:
            return self._path(start_at, goal_at, [(start_at, goal_at, direct)])
        if not math.isfinite(cost):
            return self.assembly.no_path(start_at, goal_at)
        way = [state]
        while way[-1] != search.origin:
            way.append(int(search.before[way[-1]]))
        hops = self._hops(search, way[::-1])
        if leg is not None:
            hops.append((self._where(search, state), goal_at, leg))
        return self._path(start_at, goal_at, hops)

    def _last(self, goal: End, blend: Blend) -> tuple[Index, Array, Array]:
        """Return the states from which a goal is reached, what the last leg of each adds, and what its turn."""
        phases = self._phases
        nodes = goal.nodes if goal.legs is None else goal.legs.nodes
        states = (phases * nodes[:, None] + np.arange(phases)).ravel()
        none = np.zeros(states.size)
        if goal.legs is None:
            return states, none, none
        rows = np.repeat(goal.legs.outcomes, phases, axis=0)
        adds = np.asarray(blend.of(rows[:, COST], rows[:, TIME]))
        if self._turns is None:
            return states, adds, none
        turns = (rows[:, GLIDE_ANGLE] > 0) & (states % 2 == 0)
        return states, adds, blend.cost * np.where(turns, self._turns[states // 2], 0.0)

    def _through(self, search: _Search, goal: End) -> tuple[float, int, Edge | None]:
        """Return the least cost of a way to a goal through nodes, its last state, and its last leg if it has one.

        The cost is inf if no way exists.
        """
        states, adds, turned = self._last(goal, search.blend)
        costs = search.cost[states] + adds + turned
        if not costs.size or not math.isfinite(costs.min()):
            return math.inf, 0, None
        best = int(np.argmin(costs))
        leg = None if goal.legs is None else edge_of(goal.legs.outcomes[best // self._phases])
        return float(costs[best]), int(states[best]), leg

    def _where(self, search: _Search, state: int) -> Array:
        node = state // self._phases
        return search.start.point if node == len(self.position) else self.position[node]

    def _hops(self, search: _Search, way: list[int]) -> list[Hop]:
        """Return the legs of a way from state to state."""
        nodes = np.array(way) // self._phases
        apart, rows = search.start.legs is not None, search.rows
        within = list(pairwise(nodes[apart:].tolist()))
        rows.need(np.array([a for a, _ in within], np.int64))
        begins = [(slice(*rows.indptr[a : a + 2]), b) for a, b in within]
        edges = [row.start + np.flatnonzero(rows.target[row] == b)[0] for row, b in begins]
        values = self._source.legs(np.array(edges, np.int64)) if edges else np.empty((0, 6))
        legs = [edge_of(np.concatenate([[Status.CONNECTED], row])) for row in values]
        if apart:
            assert search.start.legs is not None
            first = np.flatnonzero(search.start.legs.nodes == nodes[1])[0]
            legs.insert(0, edge_of(search.start.legs.outcomes[first]))
        places = [self._where(search, state) for state in way]
        return list(zip(places[:-1], places[1:], legs, strict=True))

    def _path(self, start: Array, goal: Array, hops: list[Hop]) -> Path:
        return self.assembly.path(start, goal, hops)


def _connected(attached: Attached) -> Attached:
    kept = attached.outcomes[:, STATUS] == Status.CONNECTED
    return Attached(attached.nodes[kept], attached.outcomes[kept])
