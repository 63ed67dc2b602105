"""Routes over a roadmap that keep a rule of surfacing."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array, Index
from ..kernels.edges import GLIDE_ANGLE, STATUS, TIME, Status
from ..roadmap.pairs import Attached, LegFinder
from ..roadmap.problem import Problem
from ..roadmap.roadmap import EDGE_FIELDS, Roadmap
from .path import SURFACE
from .query import End, Planner
from .surfacing import Surfacing
from .trade_off import TradeOff


class SurfacingPlanner(Planner):
    """A planner whose paths keep a rule of surfacing.

    Each node is repeated once for every state. A state says how much of the rule's limits is used up.
    """

    def __init__(self, roadmap: Roadmap, problem: Problem, rule: Surfacing) -> None:
        """Check the roadmap as `Planner` does, and repeat its nodes for each state."""
        self.base = roadmap
        super().__init__(_layered(roadmap, rule), problem, rule)

    def front(
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
    ) -> TradeOff:
        """Return every path for which no other is better both in time and in energy; hours are not rounded."""
        return Planner(self.base, self.problem, self.rule).front(start, goal)

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
        self.rule.check_end(place, name)
        return nodes, place

    def _reached(self, start: Array) -> tuple[Array, Array]:
        """Return the nodes' positions (n, 3) [m], and the earliest time (n,) [s] of any of their states."""
        return self.base.position, self.arrivals(start).reshape(-1, len(self.base.position)).min(axis=0)

    def _on_base(self) -> LegFinder:
        return self.problem.legs(self.base.position)


def _onward(rule: Surfacing, position: Array, used: Index, nodes: Index, outcomes: Array) -> tuple[Index, Index]:
    """Return the states in which legs to `nodes` end that begin in state `used` (2,), and which keep the rule."""
    turns, parts = rule.steps(int(used[0]), outcomes[:, GLIDE_ANGLE], outcomes[:, TIME])
    after = np.stack([used[0] + turns, used[1] + parts])
    counts = np.array(rule.counts)
    fits = (outcomes[:, STATUS] == Status.CONNECTED) & (after < counts[:, None]).all(axis=0)
    up = position[nodes, 2] >= -SURFACE
    half, part = np.where(up, 0, after)[:, fits]
    return (half * counts[1] + part) * len(position) + nodes[fits], np.flatnonzero(fits)


def _layered(road: Roadmap, rule: Surfacing) -> Roadmap:
    """Return a roadmap that has each node once for each state, and only the edges that keep the rule."""
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
