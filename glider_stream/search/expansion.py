"""Expansion: finds the legs that leave a place when a search comes to the place."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ..base.arrays import Array, Bools, Index
from ..kernels.edges import EDGE_COLUMNS, STATUS, TIME, Status
from ..roadmap.pairs import ReachableLegs
from ..roadmap.problem import Problem

MOST_REMEMBERED = 512
"""A bounded expansion remembers at most this many fans; each fan has some thousand legs."""


class Fan(NamedTuple):
    """Legs that leave one place at one time: numbers of places `target` (n,), rising; `rows` of `Edge` (n, 7)."""

    target: Index
    rows: Array


class Expansion(Protocol):
    """The source of legs for a search.

    The places are the nodes, then each goal that is not a node, then the start if it is not a node.
    """

    @property
    def places(self) -> Array:
        """The positions of all places (n, 3) [m]."""
        ...

    @property
    def nodes(self) -> int:
        """The number of nodes; the nodes are the first places."""
        ...

    @property
    def start(self) -> int:
        """The number of the start among the places."""
        ...

    @property
    def spent(self) -> bool:
        """Whether no more fans may be asked for; the search then ends early."""
        ...

    @property
    def chosen(self) -> Index | slice:
        """The places of which `fans` reads whether they are wanted; the legs to all others come anyway."""
        ...

    def fans(self, place: Index, time: Array, wanted: Bools) -> list[Fan]:
        """Return the legs from places `place` (n,) that begin at `time` (n,) [s]; no place occurs twice.

        `wanted` (n, places) marks the targets of use; legs to other targets may be left out.
        """
        ...


class Ends(NamedTuple):
    """The ends of a search: position (3,) [m] of the start and of each goal, and the nodes at each position.

    Often no node lies there; then the array of nodes is empty.
    """

    start: Array
    start_nodes: Index
    goals: Sequence[Array]
    goal_nodes: Sequence[Index]


class ClockExpansion:
    """Finds each leg at the time at which it begins; with `frozen`, at the problem's departure.

    No leg ends after the flow's last time. `cut` says whether any leg might have ended after it.
    """

    def __init__(self, problem: Problem, position: Array, ends: Ends, frozen: bool) -> None:
        """Number the places, and find the nodes from which a leg may lead to a goal."""
        self.problem, self.position, self.ends, self.frozen = problem, position, ends, frozen
        self.legs = problem.legs(position)
        self.new_goals = [n for n, nodes in enumerate(ends.goal_nodes) if not nodes.size]
        beside = [ends.goals[n] for n in self.new_goals]
        apart = [] if ends.start_nodes.size else [ends.start]
        self._places = np.vstack([position, *beside, *apart])
        self._may_end = np.zeros((len(position), len(beside)), bool)
        for n, goal in enumerate(beside):
            self._may_end[self.legs.before(goal), n] = True
        self.cut = False
        limited = isinstance(self.legs, ReachableLegs) and self.legs.limit > 0
        goals = [place for places in self.goals for place in places.tolist()]
        self._chosen: Index | slice = np.unique(np.array(goals, np.int64)) if limited else slice(None)

    @property
    def places(self) -> Array:
        """The positions of all places (n, 3) [m]."""
        return self._places

    @property
    def nodes(self) -> int:
        """The number of nodes; the nodes are the first places."""
        return len(self.position)

    @property
    def start(self) -> int:
        """The number of the start among the places."""
        nodes = self.ends.start_nodes
        return int(nodes[0]) if nodes.size else len(self._places) - 1

    @property
    def goals(self) -> list[Index]:
        """The numbers of the places at each goal."""
        first = len(self.position)
        return [
            nodes if nodes.size else np.array([first + self.new_goals.index(n)])
            for n, nodes in enumerate(self.ends.goal_nodes)
        ]

    @property
    def spent(self) -> bool:
        """Always False: this expansion has no limit."""
        return False

    @property
    def chosen(self) -> Index | slice:
        """The places of which it matters whether they are wanted.

        If a node's legs are limited by number, these are the goals: all other legs are found anyway.
        """
        return self._chosen

    def fans(self, place: Index, time: Array, wanted: Bools) -> list[Fan]:
        """Return the connected legs from places `place` (n,) that begin at `time` (n,) [s]; see `Expansion`."""
        nodes, flow = len(self.position), self.problem.evaluator.flow
        when = np.full(time.size, self.problem.departure) if self.frozen else time
        integration = self.problem.evaluator.integration
        self.cut |= bool(when.max() + integration.dt * integration.steps > flow.extent.t_hi)
        result = [Fan(np.empty(0, np.int64), np.empty((0, EDGE_COLUMNS)))] * place.size
        asked = np.flatnonzero(place < nodes)
        if asked.size:
            found = self.legs.of(place[asked], when[asked], wanted[asked, :nodes])
            for n, first, last in zip(asked, found.indptr, found.indptr[1:], strict=False):
                result[n] = Fan(found.target[first:last], found.outcomes[first:last])
        if place.max() >= nodes:
            away = self.legs.away(self.ends.start, float(when[int(np.argmax(place))]))
            result[int(np.argmax(place))] = Fan(away.nodes, away.outcomes)
        self._to_goals(place, when, wanted, result)
        return [_kept(fan, float(t), flow.extent.t_hi) for fan, t in zip(result, when, strict=True)]

    def _to_goals(self, place: Index, when: Array, wanted: Bools, result: list[Fan]) -> None:
        """Add the legs to goals that are not nodes; if the start is not a node, add its legs to all goals."""
        nodes, goals = len(self.position), np.array([int(places[0]) for places in self.goals], np.int64)
        if not goals.size:
            return
        beside, column = goals >= nodes, np.maximum(goals - nodes, 0)
        ask = np.zeros((place.size, goals.size), bool)
        for n, at in enumerate(place):
            if at == self.start:
                ask[n] = beside | bool(at >= nodes)
            elif at < nodes and self._may_end.shape[1]:
                ask[n] = beside & self._may_end[at, column]
        ask &= wanted[:, goals]
        if not ask.any():
            return
        points = np.vstack([self._places[place], self._places[goals]])
        indptr = np.concatenate([[0], np.cumsum(ask.sum(axis=1))])
        departs = np.concatenate([when, np.zeros(goals.size)])
        to = np.nonzero(ask)[1]
        rows = self.problem.evaluator.connect(points, departs, np.arange(place.size), indptr, place.size + to)
        for n in map(int, np.flatnonzero(ask.any(axis=1))):
            here, new = result[n], slice(indptr[n], indptr[n + 1])
            result[n] = Fan(np.concatenate([here.target, goals[to[new]]]), np.concatenate([here.rows, rows[new]]))


class BoundedExpansion:
    """A `ClockExpansion` that is `spent` after `most` fans; it remembers the first fans for another search."""

    def __init__(self, clock: ClockExpansion, most: float) -> None:
        """Begin with no remembered fan."""
        self.clock, self.most, self.found = clock, most, 0
        self.known: dict[tuple[int, float], tuple[Bools, Fan]] = {}

    @property
    def places(self) -> Array:
        """The positions of all places (n, 3) [m]."""
        return self.clock.places

    @property
    def nodes(self) -> int:
        """The number of nodes; the nodes are the first places."""
        return self.clock.nodes

    @property
    def start(self) -> int:
        """The number of the start among the places."""
        return self.clock.start

    @property
    def spent(self) -> bool:
        """Whether `most` fans have been found."""
        return self.found >= self.most

    @property
    def chosen(self) -> Index | slice:
        """The places of which it matters whether they are wanted."""
        return self.clock.chosen

    def fans(self, place: Index, time: Array, wanted: Bools) -> list[Fan]:
        """Return the legs from places `place` (n,) that begin at `time` (n,) [s], remembered ones if possible."""
        asked = zip(place.tolist(), time.tolist(), wanted, strict=True)
        fans = [self._remembered(at, when, some) for at, when, some in asked]
        new = np.array([n for n, fan in enumerate(fans) if fan is None], np.int64)
        if new.size:
            found = self.clock.fans(place[new], time[new], wanted[new])
            self.found += new.size
            for n, fan in zip(new, found, strict=True):
                fans[n] = fan
                if len(self.known) < MOST_REMEMBERED:
                    self.known[int(place[n]), float(time[n])] = wanted[n], fan
        return [fan for fan in fans if fan is not None]

    def _remembered(self, place: int, time: float, wanted: Bools) -> Fan | None:
        """Return the remembered fan of a place and a time [s]; None if it lacks legs that are wanted."""
        had, fan = self.known.get((place, time), (None, None))
        return None if had is None or bool((wanted & ~had).any()) else fan


def _kept(fan: Fan, departure: float, last: float) -> Fan:
    """Return the fan with only the legs that connect and arrive before the flow's last time `last` [s]."""
    with np.errstate(invalid="ignore"):
        fits = (fan.rows[:, STATUS] == Status.CONNECTED) & (departure + fan.rows[:, TIME] <= last)
    return Fan(fan.target[fits], fan.rows[fits])
