"""Rules of surfacing: a vehicle must come up, for a fix and a call, after so many yos or hours."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array, Index
from ..base.settings import require
from ..kernels.edges import GLIDE_ANGLE, STATUS, TIME, Status
from ..roadmap.pairs import Attached, Legs
from ..roadmap.problem import Problem
from ..roadmap.roadmap import EDGE_FIELDS, Roadmap
from .path import SURFACE, Path
from .query import End, Planner

BINS = 48
"""Parts of the longest time under water that are told apart; a leg's is rounded up, so the rule always holds."""
MOST_YOS = 100


@dataclass(frozen=True)
class Surfacing:
    """At most so many yos (a dive and a climb), and so many hours, from one surfacing to the next."""

    most_yos: int | None = None
    most_hours: float | None = None

    def __post_init__(self) -> None:
        yos, hours = self.most_yos, self.most_hours
        fits = yos is None or 1 <= yos <= MOST_YOS
        require(fits, f"`most_yos` must be from 1 to {MOST_YOS}; got {yos}")
        require(hours is None or 0 < hours < math.inf, f"`most_hours` must be above 0 h; got {hours}")

    @property
    def counts(self) -> tuple[int, int]:
        """How many states of either measure there are: half-yos, in which it dives and climbs by turns; time."""
        return 1 if self.most_yos is None else 2 * self.most_yos, 1 if self.most_hours is None else BINS + 1

    def holds(self, path: Path) -> bool:
        """Whether a path keeps the rule, each leg's time as it is."""
        yos, hours, climbing = 0, 0.0, False
        for leg in path.legs:
            turns, climbing = leg.glide_angle > 0 and not climbing, leg.glide_angle > 0
            yos, hours = yos + turns, hours + leg.duration / 3600
            if yos > (self.most_yos or math.inf) or hours > (self.most_hours or math.inf):
                return False
            if leg.end[2] >= -SURFACE:
                yos, hours, climbing = 0, 0.0, False
        return True

    def steps(self, half: int, glide_angle: Array, time: Array) -> tuple[Index, Index]:
        """By how much legs (n,) use up either measure, in a half-yo (odd ones climb); time in parts."""
        none = np.zeros(len(time), np.int64)
        turns = none if self.most_yos is None else ((glide_angle > 0) != (half % 2 == 1)).astype(np.int64)
        if self.most_hours is None:
            return turns, none
        return turns, np.ceil(np.nan_to_num(time) / (3600 * self.most_hours / BINS) - 1e-9).astype(np.int64)


class SurfacingPlanner(Planner):
    """A planner whose paths keep a rule: a node stands once for each state of what is left until a surfacing."""

    def __init__(self, roadmap: Roadmap, problem: Problem, rule: Surfacing) -> None:
        """As Planner; the roadmap's nodes are repeated, state by state."""
        self.base, self.rule = roadmap, rule
        super().__init__(_layered(roadmap, rule), problem)

    def _start(self, point: ArrayLike | None) -> End:
        nodes, place = self._surface(point, self.problem.start, "start")
        if nodes.size:
            return End(place, nodes, None)
        away = self._on_base().away(place)
        to, rows = _onward(self.rule, self.base.position, np.zeros(2, np.int64), away.nodes, away.outcomes)
        return End(place, nodes, Attached(to, away.outcomes[rows]))

    def _goal(self, point: ArrayLike | None) -> End:
        nodes, place = self._surface(point, self.problem.goal, "goal")
        if nodes.size:
            return End(place, nodes, None)
        towards = self._on_base().towards(place)
        kept, states = [], []
        for number, used in enumerate(np.ndindex(*self.rule.counts)):
            _, rows = _onward(self.rule, self.base.position, np.array(used), towards.nodes, towards.outcomes)
            kept.append(rows)
            states.append(number * len(self.base.position) + towards.nodes[rows])
        rows = np.concatenate(kept)
        return End(place, nodes, Attached(np.concatenate(states), towards.outcomes[rows]))

    def _surface(self, point: ArrayLike | None, named: Array | None, name: str) -> tuple[Index, Array]:
        nodes, place = self._place(point, named, name)
        up = float(place[2]) >= -SURFACE
        require(
            up, f"a route with a rule of surfacings has its {name} at the surface; got a depth of {-place[2]:g} m"
        )
        return nodes, place

    def _reached(self, start: Array) -> tuple[Array, Array]:
        """As Planner; a node is reached in whichever of its states is reached first."""
        return self.base.position, self.arrivals(start).reshape(-1, len(self.base.position)).min(axis=0)

    def _on_base(self) -> Legs:
        return self.problem.legs(self.base.position)


def _onward(rule: Surfacing, position: Array, used: Index, nodes: Index, outcomes: Array) -> tuple[Index, Index]:
    """Of legs to `nodes`, from a state `used` (2,): the states that they end in, and which keep the rule."""
    turns, parts = rule.steps(int(used[0]), outcomes[:, GLIDE_ANGLE], outcomes[:, TIME])
    after = np.stack([used[0] + turns, used[1] + parts])
    counts = np.array(rule.counts)
    fits = (outcomes[:, STATUS] == Status.CONNECTED) & (after < counts[:, None]).all(axis=0)
    up = position[nodes, 2] >= -SURFACE
    half, part = np.where(up, 0, after)[:, fits]
    return (half * counts[1] + part) * len(position) + nodes[fits], np.flatnonzero(fits)


def _layered(road: Roadmap, rule: Surfacing) -> Roadmap:
    """A roadmap with each node once for each state, and the edges that keep the rule."""
    nodes, states = len(road.position), int(np.prod(rule.counts))
    source = np.repeat(np.arange(nodes), np.diff(road.indptr))
    rows = np.column_stack([np.full(road.target.size, Status.CONNECTED), road.time, road.cost, road.glide_angle])
    sources, targets, edges = [], [], []
    for number, used in enumerate(np.ndindex(*rule.counts)):
        to, kept = _onward(rule, road.position, np.array(used), road.target.astype(np.int64), rows)
        sources.append(number * nodes + source[kept])
        targets.append(to)
        edges.append(kept)
    degree = np.bincount(np.concatenate(sources), minlength=states * nodes)
    every = np.concatenate(edges)
    return replace(
        road,
        position=np.tile(road.position, (states, 1)),
        indptr=np.concatenate([[0], np.cumsum(degree)]),
        target=np.concatenate(targets).astype(np.int32),
        node_counts=None,
        lonlat=None,
        **{name: getattr(road, name)[every] for name in EDGE_FIELDS},
    )
