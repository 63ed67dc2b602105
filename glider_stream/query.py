"""Queries: Dijkstra over a roadmap, a start and a goal attached to it, the path with its legs."""

import json
import math
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from .edges import Edge, Status
from .flow import flow_sha256
from .glider import glider_sha256
from .roadmap import EDGE_FIELDS, Problem, Roadmap
from .settings import require

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Leg:
    """One glide, with one trim: from `start` to `end` (3,) [m]; the nodes it was planned between.

    `depart` [s] since the path began; `trajectory` rows [t, x, y, z] end at the closest approach, `miss` [m].
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

    def as_dict(self) -> dict[str, Any]:
        """As the path file has it."""
        return {
            "from": self.start.tolist(),
            "to": self.end.tolist(),
            "glide_angle_rad": self.glide_angle,
            "heading_rad": self.heading,
            "speed_mps": self.speed,
            "depart_s": self.depart,
            "duration_s": self.duration,
            "miss_m": self.miss,
            "trajectory": self.trajectory.tolist(),
        }


@dataclass(frozen=True)
class Path:
    """The cheapest path of a query, or the honest no: `found`, `travel_time` [s], `cost`, `legs`."""

    start: Array
    goal: Array
    cost: float
    legs: tuple[Leg, ...]

    @property
    def found(self) -> bool:
        """Whether there is a path."""
        return math.isfinite(self.cost)

    @property
    def travel_time(self) -> float:
        """Time from start to goal [s]; inf where there is no path."""
        return sum(leg.duration for leg in self.legs) if self.found else math.inf

    @property
    def trajectory(self) -> Array:
        """All legs' rows [t, x, y, z], (m, 4)."""
        return np.concatenate([np.empty((0, 4)), *(leg.trajectory for leg in self.legs)])

    def as_dict(self) -> dict[str, Any]:
        """As the path file has it."""
        return {
            "found": self.found,
            "travel_time_s": self.travel_time if self.found else None,
            "cost": self.cost if self.found else None,
            "legs": [leg.as_dict() for leg in self.legs],
        }

    def __str__(self) -> str:
        ends = " to ".join("(" + ", ".join(f"{value:.6g}" for value in end) + ")" for end in (self.start, self.goal))
        if not self.found:
            return f"no path from {ends}"
        rows = [f"path from {ends}: {len(self.legs)} legs, {self.travel_time:,.0f} s"]
        for leg in self.legs:
            rows.append(
                f"  {leg.depart:9,.0f} s  {'climb' if leg.glide_angle > 0 else 'dive ':5} {leg.start[2]:7.0f} m to"
                f" {leg.end[2]:6.0f} m  glide {math.degrees(leg.glide_angle):6.1f} deg  compass"
                f" {math.degrees(math.pi / 2 - leg.heading) % 360:5.1f} deg  {leg.duration:7,.0f} s  miss {leg.miss:.2f} m"
            )
        return "\n".join(rows)


def load_path(file: str | File) -> Path:
    """Read a path file (JSON) that `query` wrote; InputError where it is not one."""
    try:
        table = json.loads(File(file).read_text())
        legs = tuple(
            Leg(
                start=np.array(leg["from"], np.float64),
                end=np.array(leg["to"], np.float64),
                glide_angle=float(leg["glide_angle_rad"]),
                heading=float(leg["heading_rad"]),
                speed=float(leg["speed_mps"]),
                depart=float(leg["depart_s"]),
                duration=float(leg["duration_s"]),
                miss=float(leg["miss_m"]),
                trajectory=np.array(leg["trajectory"], np.float64).reshape(-1, 4),
            )
            for leg in table["legs"]
        )
        cost = float(table["cost"]) if table["found"] else math.inf
    except (OSError, ValueError, KeyError, TypeError) as error:
        said = error.strerror if isinstance(error, OSError) else f"{type(error).__name__} at {error}"
        require(False, f"the path file {file} cannot be read: {said}; write it with `query -o`")
    require(bool(legs), f"the path file {file} holds no leg: no path was found, so there is nothing to draw")
    return Path(legs[0].start, legs[-1].end, cost, legs)


@dataclass(frozen=True)
class _Attached:
    """Edges between one point and the nodes of a roadmap: node numbers (n,), rows of `Edge` (n, 7)."""

    nodes: NDArray[np.int64]
    outcomes: Array


class Planner:
    """Answers queries from one roadmap; any number, the roadmap is left as it is."""

    def __init__(self, roadmap: Roadmap, problem: Problem) -> None:
        """Check that flow and glider are those that the roadmap was built with."""
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
        self.roadmap = roadmap
        self.problem = problem

    def query(self, start: ArrayLike | None = None, goal: ArrayLike | None = None) -> Path:
        """The cheapest path between two points (3,) [m]; the scenario's own start and goal where None.

        A point that is a node is used as it is; any other is attached by its own neighbours.
        """
        first, start_at = self._end(start, self.problem.start, "start")
        last, goal_at = self._end(goal, self.problem.goal, "goal")
        nodes = len(self.roadmap.position)
        away = self._attach(start_at, departing=True) if first is None else None
        towards = self._attach(goal_at, departing=False) if last is None else None
        distance, before = self._search(first, away)
        if towards is None:
            assert last is not None
            cost, end = float(distance[last]), last
        else:
            through = distance[towards.nodes] + towards.outcomes[:, 2]
            cost, end = (float(through.min()), int(np.argmin(through))) if through.size else (math.inf, 0)
        direct = self.problem.evaluator.connect_pair(start_at, goal_at, self.problem.departure)
        if (first is None or last is None) and direct.status == Status.CONNECTED and direct.cost < cost:
            return self._path(start_at, goal_at, direct.cost, [(start_at, goal_at, direct)])
        if not math.isfinite(cost):
            return Path(start_at, goal_at, math.inf, ())
        hops: list[tuple[Array, Array, Edge]] = []
        if towards is not None:
            node = int(towards.nodes[end])
            hops.append((self._where(node, start_at), goal_at, _edge(towards.outcomes[end])))
            end = node
        origin = nodes if first is None else first
        while end != origin:
            earlier = int(before[end])
            hops.append((self._where(earlier, start_at), self._where(end, start_at), self._edge(earlier, end, away)))
            end = earlier
        return self._path(start_at, goal_at, cost, hops[::-1])

    def _end(self, point: ArrayLike | None, named: Array | None, name: str) -> tuple[int | None, Array]:
        if point is None:
            require(named is not None, f"the scenario names no {name}; give one with --{name} X,Y,Z")
            point = named
        place = np.asarray(point, np.float64)
        require(place.shape == (3,), f"`{name}` must be three numbers X,Y,Z; got {place.tolist()}")
        self.problem.check_point(place, name)
        same = np.flatnonzero((self.roadmap.position == place).all(axis=1))
        return (int(same[-1]) if same.size else None), place

    def _attach(self, point: Array, departing: bool) -> _Attached:
        nodes = self.problem.neighbourhood(self.roadmap.position).of(point)
        position = np.vstack([self.roadmap.position[nodes], point])
        here, others = len(nodes), np.arange(len(nodes))
        if departing:
            source, indptr, target = np.array([here]), np.array([0, here]), others
        else:
            source, indptr, target = others, np.arange(here + 1), np.full(here, here)
        outcomes = self.problem.evaluator.connect(position, self.problem.departure, source, indptr, target)
        connected = outcomes[:, 0] == Status.CONNECTED
        return _Attached(nodes[connected], outcomes[connected])

    def _search(self, first: int | None, away: _Attached | None) -> tuple[Array, NDArray[np.int32]]:
        """Cost from the start to every node, and each node's predecessor; the start is one more node."""
        road, nodes = self.roadmap, len(self.roadmap.position)
        cost, target, indptr = road.cost, road.target, road.indptr
        if away is not None:
            cost = np.concatenate([cost, away.outcomes[:, 2]])
            target = np.concatenate([target, away.nodes.astype(np.int32)])
            indptr = np.append(indptr, cost.size)
        else:
            indptr = np.append(indptr, indptr[-1])
        graph = csr_array((cost, target, indptr), shape=(nodes + 1, nodes + 1))
        origin = nodes if first is None else first
        distance, before = dijkstra(graph, indices=origin, return_predecessors=True)
        return distance, before

    def _where(self, node: int, start: Array) -> Array:
        return start if node == len(self.roadmap.position) else self.roadmap.position[node]

    def _edge(self, source: int, target: int, away: _Attached | None) -> Edge:
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
            legs.append(
                Leg(
                    source, target, edge.glide_angle, edge.heading, edge.speed, clock, edge.time, edge.miss, rows
                )
            )
            clock += edge.time
        return Path(start, goal, cost, tuple(legs))


def _edge(row: Array) -> Edge:
    return Edge(int(row[0]), *(float(value) for value in row[1:]))
