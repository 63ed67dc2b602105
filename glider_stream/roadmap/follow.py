"""Slices of a roadmap: finds the legs of some nodes at many departures, each from the legs at the one before."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..base.arrays import Array, Bools, Index
from ..base.nearest import tree_of
from ..base.threads import in_parallel
from ..kernels import follow
from ..kernels.connect import Pairs
from ..kernels.edges import EDGE_COLUMNS, STATUS, TIME, Status
from ..kernels.patch import MAX_LEVELS
from ..kernels.reach import LEG_COLUMNS, LEG_EDGE, LEG_NODE, answer, quick_statuses
from .evaluator import NODES_AT_ONCE, Evaluator
from .neighbours import as_csr
from .pairs import Found, NeighbourLegs, ReachableLegs
from .problem import Problem

FAN_EVERY = 12
"""After this many slices a fan finds all legs again; at the slices between, the legs are followed."""
FEW = 48
"""A node with fewer legs gets a fan at every departure: its targets lie too far apart to lead to each other."""
BESIDE, ABOVE = 8, 1
"""The legs of a node are tried for this many nodes near each target: at its depth, and at the depths above and
below."""
ROOM = 2.0
"""There is room for this many times the legs that a node had at the departure before. If the room is too small,
all legs are followed again. About a third more pairs are tried than connect."""


@dataclass(frozen=True)
class Held:
    """Legs of some nodes at one departure: rows (n, room, FOLLOWED_COLUMNS) of `kernels.follow`, counts (n,)."""

    rows: Array
    counts: Index


def nodes_near(position: Array) -> Index:
    """Return the numbers (n, near) of nodes near each node (n, 3) [m]; the node itself fills empty places."""
    depths, layer = np.unique(position[:, 2], return_inverse=True)
    everyone = np.arange(len(position))
    if depths.size > MAX_LEVELS:
        # nodes at any depth: scale the box to equal sides, so that distances count alike in all directions
        sides = np.ptp(position, axis=0)
        points = position / np.where(sides > 0, sides, 1.0)
        return _nearest(points, everyone, points, everyone, BESIDE + 2 * ABOVE)
    near = np.empty((len(position), BESIDE + 2 * ABOVE), np.int64)
    at = position[:, :2]
    layers = [np.flatnonzero(layer == number) for number in range(depths.size)]
    for number, nodes in enumerate(layers):
        near[nodes, :BESIDE] = _nearest(at[nodes], nodes, at[nodes], nodes, BESIDE)
        for column, other in ((BESIDE, number - 1), (BESIDE + ABOVE, number + 1)):
            beside = layers[other] if 0 <= other < depths.size else nodes
            near[nodes, column : column + ABOVE] = _nearest(at[beside], beside, at[nodes], nodes, ABOVE)
    return near


def _nearest(points: Array, numbers: Index, at: Array, itself: Index, count: int) -> Index:
    """Return the numbers (n, count) of the points nearest to each place; the place's own number is left out."""
    asked = min(count + 1, len(points))
    _, found = tree_of(points).query(at, k=np.arange(1, asked + 1))
    chosen = numbers[found]
    result = np.repeat(itself[:, None], count, axis=1)
    # the place's own number goes last and is cut off
    order = np.argsort(chosen == itself[:, None], axis=1, kind="stable")
    kept = np.take_along_axis(chosen, order, axis=1)[:, :count]
    result[:, : kept.shape[1]] = kept
    return result


@dataclass(frozen=True)
class Follower:
    """Finds the legs of nodes at a problem's departures, one after another."""

    problem: Problem
    position: Array
    near: Index
    fan_every: int = FAN_EVERY
    few: int = FEW

    @staticmethod
    def of(problem: Problem, position: Array) -> "Follower":
        """Return a follower for nodes (n, 3) [m]."""
        return Follower(problem, position, nodes_near(position))

    def slices(self, source: Index) -> Iterator[Found]:
        """Yield the pairs from the nodes `source` at each departure; each node is independent of the others."""
        exact = self.problem.evaluator.exact
        held: Held | None = None
        before = 0.0
        for number, departure in enumerate(self.problem.departures):
            legs = replace(self.problem, departure=departure).legs(self.position)
            by_fan = np.ones(len(source), bool)
            if isinstance(legs, NeighbourLegs | ReachableLegs) and held is not None and exact:
                by_fan = (held.counts < self.few) | (number % self.fan_every == 0)
            if by_fan.all():
                found = legs.of(source)
                held = _held(found)
            else:
                assert isinstance(legs, NeighbourLegs | ReachableLegs)
                assert held is not None
                rest = Held(held.rows[~by_fan], held.counts[~by_fan])
                found, held = self._follow(legs, source[~by_fan], departure, departure - before, rest)
                if by_fan.any():
                    fans = legs.of(source[by_fan])
                    found, held = _joined(by_fan, fans, found), _side_by_side(by_fan, _held(fans), held)
            before = departure
            yield found

    def _follow(
        self, legs: NeighbourLegs | ReachableLegs, source: Index, departure: float, since: float, held: Held
    ) -> tuple[Found, Held]:
        evaluator: Evaluator = legs.evaluator
        nobody = np.empty(0, np.int64)
        limit = legs.limit if isinstance(legs, ReachableLegs) else 0
        if isinstance(legs, NeighbourLegs):
            indptr, target = as_csr([legs.neighbourhood.of(self.position[n]) for n in source])
        else:
            indptr, target = nobody, nobody
        room = int(ROOM * held.counts.max(initial=0)) + BESIDE
        counts = np.zeros(len(source), np.int64)
        how = evaluator.medium, self.position, self.near, source, departure, since, indptr, target, limit
        while True:
            rows = np.empty((len(source), room, follow.FOLLOWED_COLUMNS))
            task = partial(follow.follow_nodes, *how, held.rows, held.counts, counts, rows)
            in_parallel(task, len(source), NODES_AT_ONCE)
            if counts.max(initial=0) <= room:
                break
            room = int(counts.max())
        filled = np.arange(room) < counts[:, None]
        going = filled & (rows[:, :, follow.LEG_STATUS] != Status.NO_HIT)
        pairs = self._pairs(evaluator, source, departure, rows, filled, indptr, target)
        return pairs, _packed(rows, going)

    def _pairs(
        self, evaluator: Evaluator, source: Index, departure: float, rows: Array, filled: Bools, *asked: Index
    ) -> Found:
        """Return all pairs that were tried; with a neighbour law, all pairs that it proposes."""
        edges = filled & (rows[:, :, follow.LEG_CHOSEN] > 0)
        chosen = rows[edges]
        outcomes = np.ascontiguousarray(chosen[:, LEG_EDGE:LEG_COLUMNS])
        outcomes[outcomes[:, STATUS] != Status.CONNECTED, TIME:] = np.nan
        first = np.concatenate([[0], np.cumsum(edges.sum(axis=1))]).astype(np.int64)
        found = first, chosen[:, LEG_NODE].astype(np.int64), outcomes
        indptr, target = asked
        if not indptr.size:
            return Found(*found)
        result = np.empty((target.size, EDGE_COLUMNS))
        every = Pairs(self.position, np.full(len(self.position), departure), source, indptr, target)
        in_parallel(partial(quick_statuses, evaluator.medium, every, result), source.size, NODES_AT_ONCE)
        in_parallel(partial(answer, every, *found, result), source.size, NODES_AT_ONCE)
        return Found(indptr, target, result)


def _held(found: Found) -> Held:
    """Return the legs of a fan in the form in which they are followed; their flow maps are not known yet."""
    counts = np.diff(found.indptr)
    rows = np.zeros((len(counts), int(counts.max(initial=0)), follow.FOLLOWED_COLUMNS))
    filled = np.arange(rows.shape[1]) < counts[:, None]
    flat = np.zeros((found.target.size, follow.FOLLOWED_COLUMNS))
    flat[:, LEG_NODE] = found.target
    flat[:, LEG_EDGE:LEG_COLUMNS] = found.outcomes
    rows[filled] = flat
    return _packed(rows, filled & (rows[:, :, follow.LEG_STATUS] == Status.CONNECTED))


def _packed(rows: Array, kept: Bools) -> Held:
    """Return only the `kept` rows of each node, without gaps."""
    counts = kept.sum(axis=1).astype(np.int64)
    packed = np.zeros((len(rows), int(counts.max(initial=0)), rows.shape[2]))
    packed[np.arange(packed.shape[1]) < counts[:, None]] = rows[kept]
    return Held(packed, counts)


def _joined(chosen: Bools, first: Found, other: Found) -> Found:
    """Return the pairs of the `chosen` nodes (`first`) and of the others, in the order of the nodes."""
    degree = np.empty(chosen.size, np.int64)
    degree[chosen], degree[~chosen] = np.diff(first.indptr), np.diff(other.indptr)
    mine = np.repeat(chosen, degree)
    target, outcomes = np.empty(mine.size, np.int64), np.empty((mine.size, EDGE_COLUMNS))
    target[mine], target[~mine] = first.target, other.target
    outcomes[mine], outcomes[~mine] = first.outcomes, other.outcomes
    return Found(np.concatenate([[0], np.cumsum(degree)]), target, outcomes)


def _side_by_side(chosen: Bools, first: Held, other: Held) -> Held:
    """Return the legs of the `chosen` nodes (`first`) and of the others, in the order of the nodes."""
    room = max(first.rows.shape[1], other.rows.shape[1])
    rows, counts = np.zeros((chosen.size, room, follow.FOLLOWED_COLUMNS)), np.empty(chosen.size, np.int64)
    for where, part in ((chosen, first), (~chosen, other)):
        counts[where] = part.counts
        rows[np.flatnonzero(where), : part.rows.shape[1]] = part.rows
    return Held(rows, counts)
