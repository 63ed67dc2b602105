"""Legs: a neighbour law and a steering method together find legs from nodes, from a point and to a point."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..base.arrays import Array, Bools, Index
from ..water.inspect import is_steady
from .evaluator import Evaluator
from .neighbours import Neighbourhood, NeighbourLaw, Reachable, as_csr

SAMPLED = 16
"""The pairs of this many nodes are counted before work is divided into batches."""


@dataclass(frozen=True)
class Found:
    """Pairs that were evaluated: CSR `indptr` (sources + 1,), `target` (pairs,), `outcomes` (pairs, 7)."""

    indptr: Index
    target: Index
    outcomes: Array


@dataclass(frozen=True)
class Attached:
    """Pairs between one point and `nodes` (n,), in either direction; `outcomes` (n, 7) are rows of `Edge`."""

    nodes: Index
    outcomes: Array


class LegFinder(Protocol):
    """Finds legs between the nodes of a roadmap, and between nodes and other points."""

    @property
    def pairs_per_node(self) -> int:
        """A typical number of pairs of a node; work is divided by it."""
        ...

    def of(self, source: Index, departure: Array | None = None, wanted: Bools | None = None) -> Found:
        """Return pairs from the nodes `source` at `departure` (sources,) [s], or at the problem's if it is None.

        No node occurs twice in `source`. If `wanted` (sources, nodes) is given, other pairs may be left out.
        """
        ...

    def away(self, point: Array, departure: float | None = None) -> Attached:
        """Return pairs from a point (3,) [m] to nodes at `departure` [s], or at the problem's if it is None."""
        ...

    def before(self, point: Array) -> Index:
        """Return the nodes, with rising numbers, from which a leg to a point (3,) [m] is searched."""
        ...

    def towards(self, point: Array) -> Attached:
        """Return pairs from nodes to a point (3,) [m]."""
        ...


def legs_of(
    law: NeighbourLaw | Reachable, evaluator: Evaluator, position: Array, volume: float, departure: float
) -> LegFinder:
    """Return the object that finds legs by a law and a method among nodes (n, 3) [m] in a `volume` [m^3]."""
    if isinstance(law, Reachable):
        return ReachableLegs(evaluator, position, departure, law.limit)
    return NeighbourLegs(evaluator, position, departure, law.among(position, volume))


@dataclass(frozen=True)
class NeighbourLegs:
    """Legs to the nodes that a neighbour law proposes."""

    evaluator: Evaluator
    position: Array
    departure: float
    neighbourhood: Neighbourhood

    @property
    def pairs_per_node(self) -> int:
        """The greatest number of pairs of a node, over some nodes that lie far apart in the order."""
        some = np.linspace(0, len(self.position) - 1, SAMPLED).astype(np.int64)
        return max(1, *(len(self.neighbourhood.of(self.position[n])) for n in some))

    def of(self, source: Index, departure: Array | None = None, wanted: Bools | None = None) -> Found:
        """Return pairs from the nodes `source`, no node twice; see `Legs.of`."""
        rows = [self.neighbourhood.of(self.position[n]) for n in source]
        if wanted is not None:
            rows = [row[some[row]] for row, some in zip(rows, wanted, strict=True)]
        indptr, target = as_csr(rows)
        departs = self.departure if departure is None else _by_node(self.position, source, departure)
        outcomes = self.evaluator.connect(self.position, departs, source, indptr, target)
        return Found(indptr, target, outcomes)

    def away(self, point: Array, departure: float | None = None) -> Attached:
        """Return pairs from a point (3,) [m] to nodes at `departure` [s], or at the problem's if it is None."""
        nodes = self.neighbourhood.of(point)
        return _from_point(self.evaluator, self.position, nodes, point, _or(departure, self.departure))

    def before(self, point: Array) -> Index:
        """Return the nodes, with rising numbers, from which a leg to a point (3,) [m] is searched."""
        return self.neighbourhood.of(point)

    def towards(self, point: Array) -> Attached:
        """Return pairs from nodes to a point (3,) [m]; by one fan back in time if method and flow allow it."""
        nodes = self.neighbourhood.of(point)
        if self.evaluator.flies_backward:
            found, outcomes = self.evaluator.reach_point(self.position[nodes], point, self.departure, True)
            return Attached(nodes[found], outcomes)
        return _each_towards(self.evaluator, self.position, nodes, point, self.departure)


@dataclass(frozen=True)
class ReachableLegs:
    """Legs to the nodes that a fan reaches: the fastest `limit` of each vertical direction; 0 means all."""

    evaluator: Evaluator
    position: Array
    departure: float
    limit: int
    _fan: Evaluator = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_fan", self.evaluator.by_fan())

    @property
    def pairs_per_node(self) -> int:
        """Twice the limit; the number of all nodes if the limit is 0."""
        return 2 * self.limit if self.limit else len(self.position)

    def of(self, source: Index, departure: Array | None = None, wanted: Bools | None = None) -> Found:
        """Return pairs from the nodes `source`; see `Legs.of`. With a limit, `wanted` is ignored."""
        departs = self.departure if departure is None else departure
        some = wanted if self.limit == 0 else None
        indptr, target, outcomes = self._fan.reach(self.position, departs, source, self.limit, some)
        if not self.evaluator.exact:
            departs = self.departure if departure is None else _by_node(self.position, source, departure)
            outcomes = self.evaluator.connect(self.position, departs, source, indptr, target)
        return Found(indptr, target, outcomes)

    def away(self, point: Array, departure: float | None = None) -> Attached:
        """Return pairs from a point (3,) [m] to all nodes that it reaches; see `Legs.away`."""
        departs = _or(departure, self.departure)
        nodes, outcomes = self._fan.reach_point(self.position, point, departs, False)
        if not self.evaluator.exact:
            return _from_point(self.evaluator, self.position, nodes, point, departs)
        return Attached(nodes, outcomes)

    def before(self, point: Array) -> Index:
        """Return the numbers of all nodes at other depths than a point (3,) [m]."""
        return np.flatnonzero(self.position[:, 2] != point[2])

    def towards(self, point: Array) -> Attached:
        """Return pairs to a point (3,) [m] from all nodes that reach it."""
        if not is_steady(self.evaluator.flow):
            return _each_towards(self.evaluator, self.position, self.before(point), point, self.departure)
        nodes, outcomes = self._fan.reach_point(self.position, point, self.departure, True)
        if not self.evaluator.exact:
            return _each_towards(self.evaluator, self.position, nodes, point, self.departure)
        return Attached(nodes, outcomes)


def _or(departure: float | None, usual: float) -> float:
    return usual if departure is None else departure


def _by_node(position: Array, source: Index, departure: Array) -> Array:
    """Return departures [s] for all nodes, as the evaluator needs them; only those of `source` are read."""
    departs = np.zeros(len(position))
    departs[source] = departure
    return departs


def _from_point(evaluator: Evaluator, position: Array, nodes: Index, point: Array, departure: float) -> Attached:
    places, here = np.vstack([position[nodes], point]), len(nodes)
    return Attached(nodes, evaluator.connect(places, departure, [here], [0, here], np.arange(here)))


def _each_towards(
    evaluator: Evaluator, position: Array, nodes: Index, point: Array, departure: float
) -> Attached:
    here = len(nodes)
    places = np.vstack([position[nodes], point])
    rows = np.arange(here), np.arange(here + 1), np.full(here, here)
    return Attached(nodes, evaluator.connect(places, departure, *rows))
