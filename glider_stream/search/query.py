"""Queries: Dijkstra's algorithm over a roadmap, with a start and a goal attached to it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ..base.arrays import Array, Index
from ..kernels.edges import COST, GLIDE_ANGLE, STATUS, TIME, Edge, Status, edge_of
from ..roadmap.pairs import Attached, LegFinder
from ..roadmap.problem import Problem
from ..roadmap.provenance import check_unchanged
from ..roadmap.roadmap import EDGE_FIELDS, Roadmap
from ..roadmap.step_error import check_steps
from .assembly import RoutePlanner, nodes_at, placed_end
from .expansion import Fan
from .labels import Aim, LabelSearch
from .least_time import fastest_sink
from .path import Hop, Path
from .surfacing import Surfacing
from .trade_off import LeftInRoadmap, RoadmapEnds, RoadmapExpansion, TradeOff
from .why_not import why_not

NOTHING = Edge(int(Status.NO_HIT), *[math.nan] * 6)


@dataclass(frozen=True)
class End:
    """An end of a query: its `point` (3,) [m] and the nodes at that point; `legs` if no node lies there."""

    point: Array
    nodes: Index
    legs: Attached | None


@dataclass(frozen=True)
class Blend:
    """The sum that a search makes least: `cost` times the scenario's cost, plus `time` times the seconds."""

    cost: float = 1.0
    time: float = 0.0

    def of(self, cost: Any, time: Any) -> Any:
        """Return the sum for legs with these costs and times [s]."""
        if self == Blend():
            return cost  # most queries use this case, for all edges
        return self.cost * cost + self.time * time


@dataclass(frozen=True)
class _Search:
    """The cheapest ways from a start: the cost and the predecessor `before` of every state.

    If turns are free, a state is a node. Otherwise a node has two states: reached by a dive, reached by a climb.
    The last state is a start that is not a node; `origin` is the state of the start.
    """

    start: End
    blend: Blend
    origin: int
    cost: Array
    before: NDArray[np.int32]


class Planner(RoutePlanner):
    """Answers any number of queries from one roadmap, also from several threads; the roadmap is not changed.

    Examples:
        >>> planner = glider_stream.Planner(road.roadmap, road.problem)
        >>> planner.query(np.array([-190.0, 190.0, 0.0]), np.array([100.0, -100.0, -75.0])).found
        True
    """

    def __init__(
        self,
        roadmap: Roadmap,
        problem: Problem,
        rule: Surfacing = Surfacing(),  # noqa: B008  (frozen)
    ) -> None:
        """Check that the roadmap was built with the problem's flow, terrain and glider."""
        check_unchanged(roadmap, problem)
        check_steps(roadmap, problem)
        self.roadmap = roadmap
        super().__init__(problem, rule, frozen=True)
        self._kept: tuple[Blend, Array] | None = None
        self._turn_by_turn = Lock()

    def query(
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        blend: Blend = Blend(),
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
        blend: Blend = Blend(),
    ) -> list[Path]:
        """Return the cheapest paths from one point (3,) [m] to each of many, as `query` does, by one search."""
        search = self._search(self._start(start), blend)
        ends = [self._goal(goal) for goal in goals]
        direct = self._direct(search.start, ends)
        return [self._way(search, end, leg) for end, leg in zip(ends, direct, strict=True)]

    def arrivals(self, start: ArrayLike | None = None) -> Array:
        """Return the earliest time (n,) [s] at which each node is reached from a point; inf if it never is."""
        search = self._search(self._start(start), Blend(0.0, 1.0))
        nodes = len(self.roadmap.position)
        return np.asarray(search.cost[: self._phases * nodes].reshape(nodes, self._phases).min(axis=1))

    def remaining(self, goal: ArrayLike | None = None) -> Array:
        """Return the least time (n,) [s] from each node to a point; inf if no way leads there."""
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
        return self.roadmap.position, self.arrivals(start)

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
            search = self._search(self._start(start), Blend())
            for m, (end, leg) in enumerate(zip(ends, self._direct(search.start, ends), strict=True)):
                here = np.array_equal(search.start.point, end.point)
                row[m] = 0.0 if here else min(self._through(search, end)[0], self._alone(search, leg))
        return costs

    @property
    def _turns(self) -> Array | None:
        """The cost (n,) of a turn from dive to climb at each node; None if turns are free."""
        return self.problem.evaluator.cost.inflection(self.roadmap.position[:, 2])

    def _turn(self, search: _Search, z: float) -> float:
        cost = self.problem.evaluator.cost.inflection(z)
        return 0.0 if cost is None else search.blend.cost * float(cost)

    def _alone(self, search: _Search, leg: Edge) -> float:
        """Return the cost of the direct leg, inf if it does not exist; its start counts as the end of a dive."""
        if leg.status != Status.CONNECTED:
            return math.inf
        turn = self._turn(search, search.start.point[2]) if leg.glide_angle > 0 else 0.0
        return float(search.blend.of(leg.cost, leg.time)) + turn

    @cached_property
    def _legs(self) -> LegFinder:
        return self.problem.legs(self.roadmap.position)

    def _start(self, point: ArrayLike | None) -> End:
        nodes, place = self._place(point, self.problem.start, "start")
        return End(place, nodes, None if nodes.size else _connected(self._legs.away(place)))

    def _goal(self, point: ArrayLike | None) -> End:
        nodes, place = self._place(point, self.problem.goal, "goal")
        return End(place, nodes, None if nodes.size else _connected(self._legs.towards(place)))

    def _place(self, point: ArrayLike | None, named: Array | None, name: str) -> tuple[Index, Array]:
        """Return the nodes at an end of the query (often the array is empty), and its position (3,) [m]."""
        place = placed_end(self.problem, point, named, name)
        return nodes_at(self.roadmap.position, place), place

    @cached_property
    def _graph(self) -> tuple[Index | slice, NDArray[np.int32], NDArray[np.int32], Array | None]:
        """The graph of states: the edge of each way, its target state, each state's first way, the turn's cost.

        A way costs a turn if it climbs from a state that was reached by a dive. The arrays have room for the ways
        of one more state, the start.
        """
        road, turns, nodes = self.roadmap, self._turns, len(self.roadmap.position)
        room = np.empty(nodes, np.int32)
        if turns is None:
            target = np.concatenate([road.target, room])
            return slice(None), target, np.append(road.indptr, 0).astype(np.int32), None
        degree = np.repeat(np.diff(road.indptr), 2)
        first = np.concatenate([[0], np.cumsum(degree)])
        ways = np.arange(first[-1]) - np.repeat(first[:-1] - np.repeat(road.indptr[:-1], 2), degree)
        climbs = road.glide_angle[ways] > 0
        after_dive = np.repeat(np.arange(degree.size) % 2 == 0, degree)
        turn = np.where(climbs & after_dive, np.repeat(np.repeat(turns, 2), degree), 0.0)
        target = np.concatenate([(2 * road.target[ways] + climbs).astype(np.int32), room])
        return ways, target, np.append(first, 0).astype(np.int32), turn

    def _costs(self, blend: Blend) -> Array:
        """Return the cost of each way, with room for a start's ways; later queries use the same result."""
        if self._kept is None or self._kept[0] != blend:
            ways, _, _, turn = self._graph
            cost = blend.of(self.roadmap.cost, self.roadmap.time)[ways]
            cost = cost if turn is None else cost + blend.cost * turn
            self._kept = blend, np.concatenate([cost, np.empty(len(self.roadmap.position))])
        return self._kept[1]

    @property
    def _phases(self) -> int:
        """The number of states of a node."""
        return 1 if self._graph[3] is None else 2

    def _search(self, start: End, blend: Blend) -> _Search:
        """Search from a start; only one search runs at a time, because each writes into the shared arrays."""
        with self._turn_by_turn:
            return self._dijkstra(start, blend)

    def _dijkstra(self, start: End, blend: Blend) -> _Search:
        (_, target, indptr, turn), cost = self._graph, self._costs(blend)
        states = len(indptr) - 2
        first = last = int(indptr[states])
        origin = int(start.nodes[0]) * self._phases if start.nodes.size else states
        if start.legs is not None:
            rows, to = start.legs.outcomes, start.legs.nodes
            costs, climbs = blend.of(rows[:, COST], rows[:, TIME]), rows[:, GLIDE_ANGLE] > 0
            last += to.size
            pump = self.problem.evaluator.cost.inflection(start.point[2])
            if turn is not None and pump is not None:
                costs, to = costs + blend.cost * np.where(climbs, pump, 0.0), 2 * to + climbs
            cost[first:last], target[first:last] = costs, to
        indptr[-1] = last
        graph = csr_array((cost[:last], target[:last], indptr), shape=(states + 1, states + 1))
        distance, before = dijkstra(graph, directed=True, indices=[origin], return_predecessors=True)
        return _Search(start, blend, origin, distance[0], before[0])

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
        hops: list[Hop] = []
        if leg is not None:
            hops.append((self._where(search, state), goal_at, leg))
        while state != search.origin:
            earlier = int(search.before[state])
            hops.append(
                (self._where(search, earlier), self._where(search, state), self._edge(search, earlier, state))
            )
            state = earlier
        return self._path(start_at, goal_at, hops[::-1])

    def _through(self, search: _Search, goal: End) -> tuple[float, int, Edge | None]:
        """Return the least cost of a way to a goal through nodes, its last state, and its last leg if it has one.

        The cost is inf if no way exists.
        """
        phases = self._phases
        nodes = goal.nodes if goal.legs is None else goal.legs.nodes
        states = (phases * nodes[:, None] + np.arange(phases)).ravel()
        costs = search.cost[states]
        if goal.legs is not None:
            rows = np.repeat(goal.legs.outcomes, phases, axis=0)
            costs = costs + search.blend.of(rows[:, COST], rows[:, TIME])
            if self._turns is not None:
                turn = (rows[:, GLIDE_ANGLE] > 0) & (states % 2 == 0)
                costs = costs + search.blend.cost * np.where(turn, self._turns[states // 2], 0.0)
        if not costs.size or not math.isfinite(costs.min()):
            return math.inf, 0, None
        best = int(np.argmin(costs))
        leg = None if goal.legs is None else edge_of(goal.legs.outcomes[best // phases])
        return float(costs[best]), int(states[best]), leg

    def _where(self, search: _Search, state: int) -> Array:
        node = state // self._phases
        return search.start.point if node == len(self.roadmap.position) else self.roadmap.position[node]

    def _edge(self, search: _Search, earlier: int, later: int) -> Edge:
        source, target = earlier // self._phases, later // self._phases
        if source == len(self.roadmap.position):
            assert search.start.legs is not None
            return edge_of(search.start.legs.outcomes[np.flatnonzero(search.start.legs.nodes == target)[0]])
        row = slice(self.roadmap.indptr[source], self.roadmap.indptr[source + 1])
        n = int(self.roadmap.indptr[source] + np.flatnonzero(self.roadmap.target[row] == target)[0])
        return Edge(int(Status.CONNECTED), *(float(getattr(self.roadmap, name)[n]) for name in EDGE_FIELDS))

    def _path(self, start: Array, goal: Array, hops: list[Hop]) -> Path:
        return self.assembly.path(start, goal, hops)


def _connected(attached: Attached) -> Attached:
    kept = attached.outcomes[:, STATUS] == Status.CONNECTED
    return Attached(attached.nodes[kept], attached.outcomes[kept])
