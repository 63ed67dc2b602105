"""Queries: Dijkstra over a roadmap, a start and a goal attached to it."""

import math
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
        first, start_at = self._end(start, self.problem.start, "start")
        last, goal_at = self._end(goal, self.problem.goal, "goal")
        if np.array_equal(start_at, goal_at):
            return self._path(start_at, goal_at, 0.0, [])
        away = None if first.size else _connected(self._legs.away(start_at))
        towards = None if last.size else _connected(self._legs.towards(goal_at))
        origin = int(first[0]) if first.size else len(self.roadmap.position)
        distance, before = self._search(origin, away)
        ends = last if towards is None else towards.nodes
        costs = distance[ends] + (0.0 if towards is None else towards.outcomes[:, 2])
        nearest = int(np.argmin(costs)) if costs.size else 0
        cost = float(costs[nearest]) if costs.size else math.inf
        if away is not None or towards is not None:
            direct = self.problem.evaluator.connect_pair(start_at, goal_at, self.problem.departure)
            if direct.status == Status.CONNECTED and direct.cost < cost:
                return self._path(start_at, goal_at, direct.cost, [(start_at, goal_at, direct)])
        if not math.isfinite(cost):
            return self._path(start_at, goal_at, math.inf, [])
        end = int(ends[nearest])
        hops: list[tuple[Array, Array, Edge]] = []
        if towards is not None:
            hops.append((self._where(end, start_at), goal_at, _edge(towards.outcomes[nearest])))
        while end != origin:
            earlier = int(before[end])
            ends_at = self._where(earlier, start_at), self._where(end, start_at)
            hops.append((*ends_at, self._edge(earlier, end, away)))
            end = earlier
        return self._path(start_at, goal_at, cost, hops[::-1])

    @cached_property
    def _legs(self) -> Legs:
        return self.problem.legs(self.roadmap.position)

    def _end(self, point: ArrayLike | None, named: Array | None, name: str) -> tuple[Index, Array]:
        """The nodes that lie at an end of the query, often none, and where it is."""
        if point is None:
            require(named is not None, f"the scenario names no {name}; give one with --{name} X,Y,Z")
            point = named
        place = np.asarray(point, np.float64)
        require(place.shape == (3,), f"`{name}` must be three numbers X,Y,Z; got {place.tolist()}")
        self.problem.check_point(place, name)
        return np.flatnonzero((self.roadmap.position == place).all(axis=1)), place

    def _search(self, origin: int, away: Attached | None) -> tuple[Array, NDArray[np.int32]]:
        """Cost from `origin` to every node, and each one's predecessor; an attached start is one more."""
        road, nodes = self.roadmap, len(self.roadmap.position)
        cost, target, indptr = road.cost, road.target, road.indptr
        if away is not None:
            cost = np.concatenate([cost, away.outcomes[:, 2]])
            target = np.concatenate([target, away.nodes.astype(np.int32)])
            indptr = np.append(indptr, cost.size)
        else:
            indptr = np.append(indptr, indptr[-1])
        graph = csr_array((cost, target, indptr), shape=(nodes + 1, nodes + 1))
        distance, before = dijkstra(graph, directed=True, indices=[origin], return_predecessors=True)
        return distance[0], before[0]

    def _where(self, node: int, start: Array) -> Array:
        return start if node == len(self.roadmap.position) else self.roadmap.position[node]

    def _edge(self, source: int, target: int, away: Attached | None) -> Edge:
        if source == len(self.roadmap.position):
            assert away is not None
            return _edge(away.outcomes[np.flatnonzero(away.nodes == target)[0]])
        row = slice(self.roadmap.indptr[source], self.roadmap.indptr[source + 1])
        n = int(self.roadmap.indptr[source] + np.flatnonzero(self.roadmap.target[row] == target)[0])
        return Edge(int(Status.CONNECTED), *(float(getattr(self.roadmap, name)[n]) for name in EDGE_FIELDS))

    def _path(self, start: Array, goal: Array, cost: float, hops: list[tuple[Array, Array, Edge]]) -> Path:
        legs, clock = [], 0.0
        for source, target, edge in hops:
            rows = self.problem.evaluator.trace(source, edge, self.problem.departure)
            rows[:, 0] += clock - self.problem.departure
            control = edge.glide_angle, edge.heading, edge.speed
            ends = self._lonlat(source, target)
            legs.append(Leg(source, target, *control, clock, edge.time, edge.miss, rows, ends))
            clock += edge.time
        return Path(start, goal, cost, tuple(legs), self._lonlat(start, goal))

    def _lonlat(self, *points: Array) -> Array | None:
        to_lonlat = self.problem.to_lonlat
        return None if to_lonlat is None else to_lonlat(np.stack(points))


def _connected(attached: Attached) -> Attached:
    kept = attached.outcomes[:, 0] == Status.CONNECTED
    return Attached(attached.nodes[kept], attached.outcomes[kept])


def _edge(row: Array) -> Edge:
    return Edge(int(row[0]), *(float(value) for value in row[1:]))
