"""Queries: Dijkstra over a roadmap, a start and a goal attached to it, the path with its legs."""

import json
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as File
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from .errors import InputError
from .flow import flow_sha256
from .glider import glider_sha256
from .kernels.edges import Edge, Status
from .legs import Attached, Legs
from .roadmap import EDGE_FIELDS, Problem, Roadmap
from .settings import require

Array = NDArray[np.float64]
Index = NDArray[np.int64]
LARGEST = 1e12
"""A number [m, s] in a path file beyond it is no place or time on Earth."""


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

    def __str__(self) -> str:
        way, glide = "climb" if self.glide_angle > 0 else "dive ", math.degrees(self.glide_angle)
        compass = math.degrees(math.pi / 2 - self.heading) % 360
        return (
            f"{self.depart:9,.0f} s  {way} {self.start[2]:7.0f} m to {self.end[2]:6.0f} m  "
            f"glide {glide:6.1f} deg  compass {compass:5.1f} deg  "
            f"{self.duration:7,.0f} s  miss {self.miss:.2f} m"
        )


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
        return sum((leg.duration for leg in self.legs), 0.0) if self.found else math.inf

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
        start, goal = (f"({x:.6g}, {y:.6g}, {z:.6g})" for x, y, z in (self.start, self.goal))
        if not self.found:
            return f"no path from {start} to {goal}; more nodes, neighbours or candidates may find one"
        count = f"{len(self.legs)} leg{'' if len(self.legs) == 1 else 's'}"
        title = f"path from {start} to {goal}: {count}, {self.travel_time:,.0f} s"
        return "\n".join([title, *(f"  {leg}" for leg in self.legs)])


def load_path(file: str | File) -> Path:
    """Read a path file (JSON) that `query` wrote; InputError where it is not one."""
    try:
        table = json.loads(File(file).read_text(encoding="utf-8"))
        legs = tuple(
            Leg(
                start=_numbers(leg, "from", (3,)),
                end=_numbers(leg, "to", (3,)),
                glide_angle=float(_numbers(leg, "glide_angle_rad", ())),
                heading=float(_numbers(leg, "heading_rad", ())),
                speed=float(_numbers(leg, "speed_mps", ())),
                depart=float(_numbers(leg, "depart_s", ())),
                duration=float(_numbers(leg, "duration_s", ())),
                miss=float(_numbers(leg, "miss_m", ())),
                trajectory=_numbers(leg, "trajectory", (-1, 4)),
            )
            for leg in table["legs"]
        )
        cost = float(_numbers(table, "cost", ())) if table["found"] else math.inf
        clock = np.concatenate([[0.0], *(leg.trajectory[:, 0] for leg in legs)])
        require(bool((np.diff(clock) >= 0).all()), "the times of its trajectory do not rise from 0")
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        said = error.strerror if isinstance(error, OSError) else f"{type(error).__name__} at {error}"
        said = str(error) if isinstance(error, InputError) else said
        raise InputError(f"the path file {file} cannot be read: {said}; write it with `query -o`") from None
    require(bool(legs), f"the path file {file} holds no leg, so there is nothing to draw; query another path")
    return Path(legs[0].start, legs[-1].end, cost, legs)


def _numbers(table: dict[str, Any], key: str, shape: tuple[int, ...]) -> Array:
    """The finite numbers under a key of a path file; a length of -1 is any above 0."""
    values = np.array(table[key], np.float64)
    fits = values.ndim == len(shape) and all(
        have == n or n < 0 < have for have, n in zip(values.shape, shape, strict=True)
    )
    said = f"its `{key}` must be finite numbers of shape {shape}, -1 standing for any length"
    require(fits and float(np.abs(values).max()) <= LARGEST, said)
    return values


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

        A point that is a node is used as it is; any other is attached by its own neighbours, and the leg
        from end to end is looked at, too.
        """
        first, start_at = self._end(start, self.problem.start, "start")
        last, goal_at = self._end(goal, self.problem.goal, "goal")
        if np.array_equal(start_at, goal_at):
            return Path(start_at, goal_at, 0.0, ())
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
            return Path(start_at, goal_at, math.inf, ())
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
            legs.append(Leg(source, target, *control, clock, edge.time, edge.miss, rows))
            clock += edge.time
        return Path(start, goal, cost, tuple(legs))


def _connected(attached: Attached) -> Attached:
    kept = attached.outcomes[:, 0] == Status.CONNECTED
    return Attached(attached.nodes[kept], attached.outcomes[kept])


def _edge(row: Array) -> Edge:
    return Edge(int(row[0]), *(float(value) for value in row[1:]))
