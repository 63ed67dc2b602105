"""Why not? What keeps a search from its goal, and how near to it one could come.

The search says when each node is reached, if it is. From the nodes reached that lie nearest to the goal the legs
that would lead on are looked at again, and each says what became of it.
"""

import math
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from ..base.arrays import Array, Bools, Index
from ..base.clock import moment
from ..kernels.edges import Status
from ..kernels.flow import velocities
from ..roadmap.problem import Problem
from ..roadmap.roadmap import Roadmap

FRONTIER = 32
"""How many of the nodes reached, those nearest to the goal, are looked at."""
ONWARD = 27
"""How many legs of each: to the nearest nodes at other depths."""
ALONG = 9
"""Places on a leg where the current is read."""
WORDS = {
    Status.CURRENT_TOO_STRONG: "the current is too strong for any control",
    Status.TOO_FAR: "too far or too deep for one glide within the horizon",
    Status.NO_HIT: "no glide angle and heading lead there",
    Status.BLOCKED: "blocked by land, seabed or a keep-out area",
    Status.OUTSIDE_FLOW: "outside the current's grid",
    Status.SAME_DEPTH: "between nodes of one depth",
    Status.CONNECTED: "can be flown, but the roadmap does not hold them, or a rule of surfacings forbids them",
}
ADVICE = {
    "current": "choose another departure, or a goal down the current; more nodes may find a way round",
    "spacing": "sample more nodes, or give [integration] more steps",
    "blocked": "move start or goal into open water, or sample more nodes in the narrows",
    "missed": 'sample more nodes, more neighbours, or choose [steering] method = "flow-map"',
    "outside": "give the domain a wider rim of currents",
    "not held": "give [neighbours] more, or relax the rule of surfacings",
    "depth": "sample nodes at more depths",
}
CAUSES = {
    Status.CURRENT_TOO_STRONG: "current",
    Status.TOO_FAR: "spacing",
    Status.NO_HIT: "missed",
    Status.BLOCKED: "blocked",
    Status.OUTSIDE_FLOW: "outside",
    Status.CONNECTED: "not held",
    Status.SAME_DEPTH: "depth",
}


@dataclass(frozen=True)
class Looked:
    """Legs that were looked at again: how many of each status, how many the current makes impossible."""

    counts: dict[Status, int] = field(default_factory=dict)
    outrun: int = 0

    @property
    def total(self) -> int:
        """How many."""
        return sum(self.counts.values())

    @property
    def share(self) -> float:
        """The share that the current makes impossible."""
        return self.outrun / max(self.total, 1)

    @property
    def cause(self) -> str:
        """What most of them fail for; the current where it forbids half of them, whatever a method says."""
        if not self.total or 2 * self.outrun >= self.total:
            return "current" if self.total else "depth"
        return CAUSES[max(self.counts, key=lambda status: (self.counts[status], -status))]

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        statuses = {status.name.lower(): count for status, count in self.counts.items()}
        return {"looked_at": self.total, "statuses": statuses, "current_outruns_share": self.share}

    def __str__(self) -> str:
        ranked = sorted(self.counts.items(), key=lambda item: -item[1])
        parts = [f"{count / self.total:.0%} {WORDS[status]}" for status, count in ranked]
        said = ", ".join(parts)
        return f"{said}; the current outruns the glider on {self.share:.0%} of them" if self.outrun else said


@dataclass(frozen=True)
class WhyNot:
    """Why no path leads from start to goal, of `nodes` in the roadmap, `reached` of them.

    `nearest` (3,) [m]: the place reached that lies nearest to the goal, `distance` [m] from it, `after` [s];
    `place` (2,) [degrees] of it, where known. `onward`: legs that would lead on from there; `into`: those that
    would end at the goal. `spacing` and `reach`: across and down [m], of nodes and of one glide. `outside`: what
    of start and goal lies outside the box of nodes, and how far [m].
    """

    nodes: int
    reached: int
    left: bool
    entered: bool
    nearest: Array
    place: Array | None
    distance: float
    after: float
    departs: datetime | None
    onward: Looked
    into: Looked
    spacing: tuple[float, float]
    reach: tuple[float, float]
    outside: dict[str, float]

    @property
    def cause(self) -> str:
        """One of the keys of ADVICE."""
        if self.left and not self.entered:
            return self.into.cause
        return self.onward.cause

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        when = None if self.departs is None else (self.departs + timedelta(seconds=self.after)).isoformat()
        return {
            "cause": self.cause,
            "nodes": self.nodes,
            "nodes_reached": self.reached,
            "start_left": self.left,
            "goal_entered": self.entered,
            "nearest": {
                "at": self.nearest.tolist(),
                "lonlat": None if self.place is None else self.place.tolist(),
                "distance_to_goal_m": self.distance,
                "after_s": self.after,
                "time": when,
            },
            "legs_onward": self.onward.as_dict(),
            "legs_into_goal": self.into.as_dict(),
            "spacing_m": dict(zip(("across", "down"), self.spacing, strict=True)),
            "reach_m": dict(zip(("across", "down"), self.reach, strict=True)),
            "outside_box_m": self.outside,
        }

    def __str__(self) -> str:
        if not self.left:
            said = f"the start is not left: of {self.onward.total} legs looked at, {self.onward}"
        elif not self.entered:
            said = f"no leg ends at the goal: of {self.into.total} looked at, {self.into}"
        else:
            said = f"of {self.onward.total} legs that would lead on, {self.onward}"
        if self.onward.total == 0 and not (self.left and not self.entered):
            said = "there are no nodes at other depths that would lead on"
        if self.cause == "spacing":
            said += f"; {_apart(self.spacing, self.reach)}"
        said += "".join(
            f"; the {name} lies {_far(far)} outside the box of nodes" for name, far in self.outside.items()
        )
        x, y = self.nearest[:2] if self.place is None else self.place
        where = f"({x:.6g}, {y:.6g}, {self.nearest[2]:.6g})"
        if self.place is not None:
            where = f"({x:.4f}, {y:.4f}, {0.0 - self.nearest[2]:.6g} m)"
        when = f"{'after' if self.departs is None else 'at'} {moment(self.departs, self.after)}"
        near = "the start itself" if self.after == 0 else f"{where}, {when}"
        reached = f"{self.reached:,} of {self.nodes:,} nodes are reached"
        nearest = f"the nearest to the goal, {_far(self.distance)} from it, is {near}"
        return f"{said}; {reached}, {nearest}; {ADVICE[self.cause]}"


def _far(metres: float) -> str:
    return f"{metres:,.0f} m" if metres < 10_000 else f"{metres / 1000:,.1f} km"


def _apart(spacing: tuple[float, float], reach: tuple[float, float]) -> str:
    return (
        f"nodes lie {_far(spacing[0])} apart across and {_far(spacing[1])} in depth, and one glide covers "
        f"{_far(reach[0])} with the fastest current and {_far(reach[1])} of depth at most"
    )


def why_not(
    problem: Problem, position: Array, arrival: Array, start: Array, goal: Array, clock: bool = False
) -> WhyNot:
    """Why a search that reaches nodes (n, 3) [m] at `arrival` (n,) [s], inf where never, does not reach its goal.

    Start and goal (3,) [m]. Legs leave at the problem's departure, or with `clock` when their node is reached.
    """
    reached = np.isfinite(arrival)
    away = reached & ~(position == start).all(axis=1)
    left = bool(away.any())
    # the start counts among the places reached: it may lie nearer to the goal than all others
    places = np.vstack([position[reached], start])
    times = np.append(arrival[reached], 0.0)
    distances = np.linalg.norm(places - goal, axis=1)
    order = np.lexsort((times, distances))
    nearest = int(order[0])
    frontier = order[:FRONTIER] if left else np.array([len(places) - 1])
    departs = problem.departure + (times if clock else np.zeros(len(times)))
    targets = np.vstack([position[~reached], goal])
    onward, spacing = _onward(problem, places[frontier], departs[frontier], targets, goal, left)
    sources = np.vstack([position, start])
    late = np.append(np.where(reached, arrival, 0.0), 0.0) if clock else np.zeros(len(sources))
    into = _into(problem, sources, problem.departure + late, goal)
    to_lonlat = problem.to_lonlat
    return WhyNot(
        nodes=len(position),
        reached=int(reached.sum()),
        left=left,
        entered=into.counts.get(Status.CONNECTED, 0) > 0,
        nearest=places[nearest],
        place=None if to_lonlat is None else to_lonlat(places[nearest : nearest + 1])[0],
        distance=float(distances[nearest]),
        after=float(times[nearest]),
        departs=problem.departs,
        onward=onward,
        into=into,
        spacing=spacing,
        reach=reach_of(problem),
        outside=_outside(problem, start, goal),
    )


def reach_of(problem: Problem) -> tuple[float, float]:
    """What one glide covers at most within the horizon, across with the fastest current, and of depth [m]."""
    evaluator = problem.evaluator
    polar, horizon = evaluator.polar, evaluator.integration.dt * evaluator.integration.steps
    across = (float(polar.best_horizontal.max()) + float(evaluator.flow.extent.max_speed)) * horizon
    down = float((polar.speed[:, -1] * np.sin(polar.steepest)).max()) * horizon
    return across, down


def _outside(problem: Problem, start: Array, goal: Array) -> dict[str, float]:
    """How far start and goal lie outside the box of nodes [m], those that do."""
    far = {}
    for name, point in (("start", start), ("goal", goal)):
        off = float(np.linalg.norm(point - np.clip(point, problem.lo, problem.hi)))
        if off > 0:
            far[name] = off
    return far


def _onward(
    problem: Problem, sources: Array, departs: Array, targets: Array, goal: Array, nearer: bool
) -> tuple[Looked, tuple[float, float]]:
    """The legs from places to the nearest of others at other depths, and how far apart the nearest ones are.

    With `nearer`, only those that lead towards the goal.
    """
    left = np.linalg.norm(targets - goal, axis=1)
    chosen: list[Index] = []
    nearest = []
    for source in sources:
        far = np.linalg.norm(targets - source, axis=1)
        fits = targets[:, 2] != source[2]
        if nearer:
            fits &= left < np.linalg.norm(source - goal)
        near = np.flatnonzero(fits)
        near = near[np.argsort(far[near], kind="stable")[:ONWARD]]
        chosen.append(near)
        if near.size:
            nearest.append(np.abs(targets[near[0]] - source))
    indptr = np.concatenate([[0], np.cumsum([near.size for near in chosen])])
    pairs = np.repeat(np.arange(len(sources)), np.diff(indptr))
    ends = targets[np.concatenate([*chosen, np.empty(0, np.int64)]).astype(np.int64)]
    spacing = np.array(nearest).reshape(-1, 3)
    across = float(np.median(np.hypot(*spacing[:, :2].T))) if len(spacing) else 0.0
    down = float(np.median(spacing[:, 2])) if len(spacing) else 0.0
    return _look(problem, sources, departs, pairs, ends), (across, down)


def _into(problem: Problem, position: Array, departs: Array, goal: Array) -> Looked:
    """The legs to the goal from places at other depths: the nearest, and some of all others within reach."""
    near = np.flatnonzero(position[:, 2] != goal[2])
    far = np.linalg.norm(position[near] - goal, axis=1)
    near = near[np.argsort(far, kind="stable")]
    rest = near[ONWARD : max(ONWARD, int((far <= math.hypot(*reach_of(problem))).sum()))]
    spread = np.unique(np.linspace(0, len(rest) - 1, min(ONWARD, len(rest))).astype(np.int64))
    near = np.sort(np.concatenate([near[:ONWARD], rest[spread]]))
    return _look(problem, position[near], departs[near], np.arange(near.size), np.tile(goal, (near.size, 1)))


def _look(problem: Problem, sources: Array, departs: Array, pairs: Index, ends: Array) -> Looked:
    """What becomes of legs from sources[pairs] (m,) to `ends` (m, 3) [m]; `pairs` rises."""
    if not pairs.size:
        return Looked()
    first = len(sources)
    indptr = np.searchsorted(pairs, np.arange(first + 1))
    nodes = np.vstack([sources, ends])
    leaves = np.concatenate([departs, departs[pairs]])
    rows = np.arange(first), indptr, first + np.arange(len(ends))
    status = problem.evaluator.connect(nodes, leaves, *rows)[:, 0].astype(np.int64)
    counts = {
        Status(int(kind)): int(count) for kind, count in zip(*np.unique(status, return_counts=True), strict=True)
    }
    failed = status != Status.CONNECTED
    beaten = outrun(problem, sources[pairs], ends, departs[pairs]) & failed
    return Looked(counts, int((beaten | (status == Status.CURRENT_TOO_STRONG)).sum()))


def outrun(problem: Problem, starts: Array, ends: Array, departs: Array) -> Bools:
    """Whether the mean current on the straight line of legs (n, 3) [m] leaves the glider no way along it.

    It must make good the current across, and still get ahead: u_along + sqrt(V^2 - u_across^2) > 0, V the
    fastest horizontal speed through water.
    """
    evaluator = problem.evaluator
    share = np.linspace(0.0, 1.0, ALONG)[:, None, None]
    places = (starts + share * (ends - starts)).reshape(-1, 3)
    columns = [np.ascontiguousarray(column) for column in (*places.T, np.tile(departs, ALONG))]
    current = velocities(evaluator.flow, *columns).reshape(ALONG, len(starts), 2).mean(axis=0)
    way = (ends - starts)[:, :2]
    length = np.hypot(*way.T)
    ahead = way / np.where(length > 0, length, 1.0)[:, None]
    along = (current * ahead).sum(axis=1)
    across = current[:, 1] * ahead[:, 0] - current[:, 0] * ahead[:, 1]
    fastest = float(evaluator.polar.best_horizontal.max())
    headway = along + np.sqrt(np.maximum(fastest**2 - across**2, 0.0))
    return np.asarray((length > 0) & ((np.abs(across) > fastest) | (headway <= 0.0)))


def no_edges(road: Roadmap, problem: Problem) -> str:
    """Why a roadmap holds no edge, in a sentence; empty where it holds some.

    Legs of some of its nodes are looked at again: a law of neighbours may have proposed none.
    """
    if road.target.size:
        return ""
    some = road.position[np.unique(np.linspace(0, len(road.position) - 1, FRONTIER).astype(np.int64))]
    departs = np.full(len(some), problem.departure)
    looked, spacing = _onward(problem, some, departs, road.position, some[0], False)
    if not looked.total:
        return f"the roadmap has no edge: its nodes lie at one depth, and one glide changes it; {ADVICE['depth']}"
    said = f"the roadmap has no edge: of {looked.total:,} legs to the nearest nodes at other depths, {looked}"
    if looked.cause == "spacing":
        said += f"; {_apart(spacing, reach_of(problem))}"
    return f"{said}; {ADVICE[looked.cause]}"
