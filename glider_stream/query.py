"""Queries: Dijkstra over a roadmap, a start and a goal attached to it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from .flow import flow_sha256
from .glider import glider_sha256
from .kernels.edges import Edge, Status
from .legs import Attached, Legs
from .path import Leg, Path
from .roadmap import EDGE_FIELDS, Problem, Roadmap
from .settings import require

Array = NDArray[np.float64]
Index = NDArray[np.int64]
NOTHING = Edge(int(Status.NO_HIT), *[math.nan] * 6)


def check_unchanged(roadmap: Roadmap, problem: Problem) -> None:
    """InputError unless flow and glider are those that the roadmap was built with."""
    made = roadmap.provenance
    for name, digest, now in (
        ("flow", made.flow_sha256, flow_sha256(problem.evaluator.flow)),
        ("glider", made.glider_sha256, glider_sha256(problem.evaluator.polar)),
    ):
        require(
            digest == now,
            f"the {name} has changed since the roadmap was built (its digest was {digest[:12]}, it is "
            f"{now[:12]} now); build the roadmap again",
        )


@dataclass(frozen=True)
class _End:
    """An end of a query: its `point` (3,) [m], the nodes that lie there, often none, else its legs."""

    point: Array
    nodes: Index
    legs: Attached | None


@dataclass(frozen=True)
class _Search:
    """The cheapest ways from a start: its number, cost and predecessor of every node, itself the last."""

    start: _End
    origin: int
    cost: Array
    before: NDArray[np.int32]


class Planner:
    """Answers queries from one roadmap; any number, the roadmap is left as it is."""

    def __init__(self, roadmap: Roadmap, problem: Problem) -> None:
        """Check that flow and glider are those that the roadmap was built with."""
        check_unchanged(roadmap, problem)
        self.roadmap = roadmap
        self.problem = problem

    def query(self, start: ArrayLike | None = None, goal: ArrayLike | None = None) -> Path:
        """The cheapest path between two points (3,) [m]; the scenario's own start and goal where None.

        A point that is a node is used as it is; any other is attached by its own neighbours, and the leg
        from end to end is looked at, too.
        """
        return self.queries(start, [goal])[0]

    def queries(self, start: ArrayLike | None, goals: Sequence[ArrayLike | None]) -> list[Path]:
        """The cheapest paths from a point (3,) [m] to each of many, as `query` finds them, by one search."""
        search = self._search(self._start(start))
        ends = [self._goal(goal) for goal in goals]
        direct = self._direct(search.start, ends)
        return [self._way(search, end, leg) for end, leg in zip(ends, direct, strict=True)]

    def table(self, starts: Sequence[ArrayLike], goals: Sequence[ArrayLike]) -> Array:
        """Costs of the cheapest paths from n points (3,) [m] to m others: (n, m), inf where there is none."""
        ends = [self._goal(goal) for goal in goals]
        costs = np.empty((len(starts), len(goals)))
        for row, start in zip(costs, starts, strict=True):
            search = self._search(self._start(start))
            for m, (end, leg) in enumerate(zip(ends, self._direct(search.start, ends), strict=True)):
                row[m] = 0.0 if np.array_equal(search.start.point, end.point) else _through(search, end)[0]
                row[m] = min(row[m], leg.cost if leg.status == Status.CONNECTED else math.inf)
        return costs

    def arrivals(self, start: ArrayLike | None = None) -> Array:
        """The least times [s] from a point (3,) [m] to every node: (n,), inf where there is no way."""
        begin, road = self._start(start), self.roadmap
        time, target, nodes = road.time, road.target, len(road.position)
        if begin.legs is not None:
            time = np.concatenate([time, begin.legs.outcomes[:, 1]])
            target = np.concatenate([target, begin.legs.nodes.astype(np.int32)])
        indptr = np.append(road.indptr, target.size).astype(np.int32)
        origin = int(begin.nodes[0]) if begin.nodes.size else nodes
        graph = csr_array((time, target, indptr), shape=(nodes + 1, nodes + 1))
        return np.asarray(dijkstra(graph, directed=True, indices=[origin])[0, :nodes])

    @cached_property
    def _legs(self) -> Legs:
        return self.problem.legs(self.roadmap.position)

    def _start(self, point: ArrayLike | None) -> _End:
        nodes, place = self._place(point, self.problem.start, "start")
        return _End(place, nodes, None if nodes.size else _connected(self._legs.away(place)))

    def _goal(self, point: ArrayLike | None) -> _End:
        nodes, place = self._place(point, self.problem.goal, "goal")
        return _End(place, nodes, None if nodes.size else _connected(self._legs.towards(place)))

    def _place(self, point: ArrayLike | None, named: Array | None, name: str) -> tuple[Index, Array]:
        """The nodes that lie at an end of the query, often none, and where it is."""
        if point is None:
            require(named is not None, f"the scenario names no {name}; give one with --{name} X,Y,Z")
            point = named
        place = np.asarray(point, np.float64)
        require(place.shape == (3,), f"`{name}` must be three numbers X,Y,Z; got {place.tolist()}")
        self.problem.check_point(place, name)
        return np.flatnonzero((self.roadmap.position == place).all(axis=1)), place

    @cached_property
    def _graph(self) -> tuple[Array, NDArray[np.int32], NDArray[np.int32]]:
        """Cost, target and first edge of each node, with room for the edges of one more, a start."""
        road, nodes = self.roadmap, len(self.roadmap.position)
        cost = np.concatenate([road.cost, np.empty(nodes)])
        target = np.concatenate([road.target, np.empty(nodes, np.int32)])
        return cost, target, np.append(road.indptr, road.target.size).astype(np.int32)

    def _search(self, start: _End) -> _Search:
        """Dijkstra's algorithm from a start."""
        (cost, target, indptr), nodes = self._graph, len(self.roadmap.position)
        last = first = self.roadmap.target.size
        if start.legs is not None:
            last += start.legs.nodes.size
            cost[first:last], target[first:last] = start.legs.outcomes[:, 2], start.legs.nodes
        indptr[-1] = last
        origin = int(start.nodes[0]) if start.nodes.size else nodes
        graph = csr_array((cost[:last], target[:last], indptr), shape=(nodes + 1, nodes + 1))
        distance, before = dijkstra(graph, directed=True, indices=[origin], return_predecessors=True)
        return _Search(start, origin, distance[0], before[0])

    def _direct(self, start: _End, goals: Sequence[_End]) -> list[Edge]:
        """The legs from end to end; between nodes the roadmap has said what there is."""
        asked = [n for n, end in enumerate(goals) if start.legs is not None or end.legs is not None]
        points = np.array([start.point, *(goals[n].point for n in asked)])
        rows = [0], [0, len(asked)], np.arange(1, len(points))
        found = self.problem.evaluator.connect(points, self.problem.departure, *rows)
        legs = [NOTHING] * len(goals)
        for n, row in zip(asked, found, strict=True):
            legs[n] = _edge(row)
        return legs

    def _way(self, search: _Search, goal: _End, direct: Edge) -> Path:
        """The path to a goal, by nodes or directly."""
        start_at, goal_at = search.start.point, goal.point
        if np.array_equal(start_at, goal_at):
            return self._path(start_at, goal_at, 0.0, [])
        cost, nearest = _through(search, goal)
        if direct.status == Status.CONNECTED and direct.cost < cost:
            return self._path(start_at, goal_at, direct.cost, [(start_at, goal_at, direct)])
        if not math.isfinite(cost):
            return self._path(start_at, goal_at, math.inf, [])
        hops: list[tuple[Array, Array, Edge]] = []
        end = int(goal.nodes[nearest] if goal.legs is None else goal.legs.nodes[nearest])
        if goal.legs is not None:
            hops.append((self._where(search, end), goal_at, _edge(goal.legs.outcomes[nearest])))
        while end != search.origin:
            earlier = int(search.before[end])
            hops.append(
                (self._where(search, earlier), self._where(search, end), self._edge(search, earlier, end))
            )
            end = earlier
        return self._path(start_at, goal_at, cost, hops[::-1])

    def _where(self, search: _Search, node: int) -> Array:
        return search.start.point if node == len(self.roadmap.position) else self.roadmap.position[node]

    def _edge(self, search: _Search, source: int, target: int) -> Edge:
        if source == len(self.roadmap.position):
            assert search.start.legs is not None
            return _edge(search.start.legs.outcomes[np.flatnonzero(search.start.legs.nodes == target)[0]])
        row = slice(self.roadmap.indptr[source], self.roadmap.indptr[source + 1])
        n = int(self.roadmap.indptr[source] + np.flatnonzero(self.roadmap.target[row] == target)[0])
        return Edge(int(Status.CONNECTED), *(float(getattr(self.roadmap, name)[n]) for name in EDGE_FIELDS))

    def _path(self, start: Array, goal: Array, cost: float, hops: list[tuple[Array, Array, Edge]]) -> Path:
        legs, clock = [], 0.0
        for source, target, edge in hops:
            rows = self.problem.evaluator.trace(source, edge, self.problem.departure)
            rows[:, 0] += clock - self.problem.departure
            control = edge.glide_angle, edge.heading, edge.speed
            where = self._lonlat(source, target), self._lonlat(*rows[:, 1:]), self._north(source)
            legs.append(Leg(source, target, *control, clock, edge.time, edge.miss, rows, *where))
            clock += edge.time
        return Path(start, goal, cost, tuple(legs), self._lonlat(start, goal), self.problem.departs)

    def _north(self, point: Array) -> float:
        to_lonlat = self.problem.to_lonlat
        return 0.0 if to_lonlat is None else true_north(to_lonlat, point)

    def _lonlat(self, *points: Array) -> Array | None:
        to_lonlat = self.problem.to_lonlat
        return None if to_lonlat is None else to_lonlat(np.stack(points))


def true_north(to_lonlat: Callable[[Array], Array], point: Array) -> float:
    """True north [rad], counter-clockwise from the frame's +y: which way a metre along it goes."""
    ends = to_lonlat(np.stack([point, point + np.array([0.0, 1.0, 0.0])]))
    east, north = (ends[1] - ends[0]) * [math.cos(math.radians(ends[0, 1])), 1.0]
    return math.atan2(east, north)


def _through(search: _Search, goal: _End) -> tuple[float, int]:
    """The least cost of a way to a goal by nodes, inf where there is none, and which of its nodes is last."""
    costs = search.cost[goal.nodes]
    if goal.legs is not None:
        costs = search.cost[goal.legs.nodes] + goal.legs.outcomes[:, 2]
    nearest = int(np.argmin(costs)) if costs.size else 0
    return (float(costs[nearest]) if costs.size else math.inf), nearest


def _connected(attached: Attached) -> Attached:
    kept = attached.outcomes[:, 0] == Status.CONNECTED
    return Attached(attached.nodes[kept], attached.outcomes[kept])


def _edge(row: Array) -> Edge:
    return Edge(int(row[0]), *(float(value) for value in row[1:]))
