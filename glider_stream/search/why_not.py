"""Why not? Explains why a search does not reach its goal, and how near to it a glider can come.

The search gives the time at which each node is reached, if it is reached. From the reached nodes that are nearest
to the goal the onward legs are evaluated again, and the status of each leg is counted.
"""

import math
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from ..base.arrays import Array, Bools, Index
from ..base.clock import moment
from ..kernels.edges import Status
from ..kernels.flow import max_rise, velocities
from ..roadmap.problem import Problem
from ..roadmap.roadmap import BaseRoadmap

FRONTIER = 32
"""The legs of this many reached nodes, the nearest to the goal, are evaluated again."""
ONWARD = 27
"""From each of these nodes this many legs are evaluated: those to the nearest nodes at other depths."""
ALONG = 9
"""The current is read at this many places on a leg."""
WORDS = {
    Status.CURRENT_TOO_STRONG: "the current is too strong for any control",
    Status.TOO_FAR: "too far or too deep for one glide within the horizon",
    Status.NO_HIT: "no glide angle and heading lead there",
    Status.BLOCKED: "blocked by land, seabed or a keep-out area",
    Status.OUTSIDE_FLOW: "outside the current's grid",
    Status.SAME_DEPTH: "between nodes of one depth",
    Status.CARRIED_AWAY: "the water rises or sinks faster than any glide against it",
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
    Status.CARRIED_AWAY: "current",
}


@dataclass(frozen=True)
class Looked:
    """Legs that were evaluated again: how many have each status, and for how many the current is too strong."""

    counts: dict[Status, int] = field(default_factory=dict)
    outrun: int = 0

    @property
    def total(self) -> int:
        """The number of legs."""
        return sum(self.counts.values())

    @property
    def share(self) -> float:
        """The share of legs that the current makes impossible."""
        return self.outrun / max(self.total, 1)

    @property
    def cause(self) -> str:
        """The cause of most failures; it is the current if the current forbids half of the legs."""
        if not self.total or 2 * self.outrun >= self.total:
            return "current" if self.total else "depth"
        return CAUSES[max(self.counts, key=lambda status: (self.counts[status], -status))]

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a table for JSON."""
        statuses = {status.name.lower(): count for status, count in self.counts.items()}
        return {"looked_at": self.total, "statuses": statuses, "current_outruns_share": self.share}

    def __str__(self) -> str:
        ranked = sorted(self.counts.items(), key=lambda item: -item[1])
        parts = [f"{count / self.total:.0%} {WORDS[status]}" for status, count in ranked]
        shares = ", ".join(parts)
        return f"{shares}; the current outruns the glider on {self.share:.0%} of them" if self.outrun else shares


@dataclass(frozen=True)
class WhyNot:
    """Why no path leads from start to goal; `reached` of the `nodes` are reached.

    `left`: some leg leaves the start; `entered`: some leg ends at the goal. `nearest` (3,) [m] is the reached
    place that is nearest to the goal, at `distance` [m] from it, reached `after` [s]; `place` (2,) [degrees] is
    the same place, if known. `onward` are legs that would lead on from there, `into` legs that would end at the
    goal. `spacing` of nodes and `reach` of one glide are given across and down [m]. `outside` says how far [m]
    start or goal lie outside the box of nodes.
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
        """Return the same as a table for JSON."""
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
            reason = f"the start is not left: of {self.onward.total} legs looked at, {self.onward}"
        elif not self.entered:
            reason = f"no leg ends at the goal: of {self.into.total} looked at, {self.into}"
        else:
            reason = f"of {self.onward.total} legs that would lead on, {self.onward}"
        if self.onward.total == 0 and not (self.left and not self.entered):
            reason = "there are no nodes at other depths that would lead on"
        if self.cause == "spacing":
            reason += f"; {_apart(self.spacing, self.reach)}"
        reason += "".join(
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
        return f"{reason}; {reached}, {nearest}; {ADVICE[self.cause]}"


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
    """Return why a search does not reach its goal.

    `position` (n, 3) [m] are the nodes and `arrival` (n,) [s] the times at which they are reached, inf if never.
    Start and goal (3,) [m]. Legs leave at the problem's departure, or with `clock` when their node is reached.
    """
    reached = np.isfinite(arrival)
    away = reached & ~(position == start).all(axis=1)
    left = bool(away.any())
    # the start counts as a reached place: it may be the nearest to the goal
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
    """Return the greatest way of one glide within the horizon: across with the fastest current, and down [m]."""
    evaluator = problem.evaluator
    polar, horizon = evaluator.polar, evaluator.integration.dt * evaluator.integration.steps
    across = (float(polar.best_horizontal.max()) + float(evaluator.flow.extent.max_speed)) * horizon
    fastest = float((polar.speed[:, -1] * np.sin(polar.steepest)).max()) + max_rise(evaluator.flow)
    down = fastest * horizon
    return across, down


def _outside(problem: Problem, start: Array, goal: Array) -> dict[str, float]:
    """Return by name how far [m] start and goal lie outside the box of nodes; a point within is left out."""
    far = {}
    for name, point in (("start", start), ("goal", goal)):
        off = float(np.linalg.norm(point - np.clip(point, problem.lo, problem.hi)))
        if off > 0:
            far[name] = off
    return far


def _onward(
    problem: Problem, sources: Array, departs: Array, targets: Array, goal: Array, nearer: bool
) -> tuple[Looked, tuple[float, float]]:
    """Evaluate legs from places to the nearest targets at other depths; return also the spacing of targets [m].

    With `nearer` only targets that are nearer to the goal are used.
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
    """Evaluate legs to the goal from places at other depths: the nearest, and some others within reach."""
    near = np.flatnonzero(position[:, 2] != goal[2])
    far = np.linalg.norm(position[near] - goal, axis=1)
    near = near[np.argsort(far, kind="stable")]
    rest = near[ONWARD : max(ONWARD, int((far <= math.hypot(*reach_of(problem))).sum()))]
    spread = np.unique(np.linspace(0, len(rest) - 1, min(ONWARD, len(rest))).astype(np.int64))
    near = np.sort(np.concatenate([near[:ONWARD], rest[spread]]))
    return _look(problem, position[near], departs[near], np.arange(near.size), np.tile(goal, (near.size, 1)))


def _look(problem: Problem, sources: Array, departs: Array, pairs: Index, ends: Array) -> Looked:
    """Evaluate the legs from sources[pairs] (m,) to `ends` (m, 3) [m]; `pairs` must rise."""
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
    """Return a mask (n,) of the legs (n, 3) [m] whose mean current is too strong for flight along the line.

    The glider must balance the current across the line and still move ahead: u_along + sqrt(V^2 - u_across^2) >
    0, where V is the fastest horizontal speed through water.
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


def no_edges(road: BaseRoadmap, problem: Problem) -> str:
    """Return a sentence that says why a roadmap has no edge; empty if it has edges.

    Legs of some of its nodes are evaluated again, because a law of neighbours may have proposed no pair.
    """
    if road.edge_count:
        return ""
    some = road.position[np.unique(np.linspace(0, len(road.position) - 1, FRONTIER).astype(np.int64))]
    departs = np.full(len(some), problem.departure)
    looked, spacing = _onward(problem, some, departs, road.position, some[0], False)
    if not looked.total:
        return f"the roadmap has no edge: its nodes lie at one depth, and one glide changes it; {ADVICE['depth']}"
    reason = f"the roadmap has no edge: of {looked.total:,} legs to the nearest nodes at other depths, {looked}"
    if looked.cause == "spacing":
        reason += f"; {_apart(spacing, reach_of(problem))}"
    return f"{reason}; {ADVICE[looked.cause]}"
