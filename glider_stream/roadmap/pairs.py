"""Legs: what a neighbour law and a steering method find together, from nodes, from a point, to a point."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..base.arrays import Array, Index
from ..water.inspect import is_steady
from .evaluator import Evaluator
from .neighbours import Neighbourhood, NeighbourLaw, Reachable, as_csr
from .steering import FlowMapMethod

SAMPLED = 16
"""Nodes whose pairs are counted before any work is cut."""


@dataclass(frozen=True)
class Found:
    """Pairs that were looked at: CSR `indptr` (sources + 1,), `target` (pairs,), `outcomes` (pairs, 7)."""

    indptr: Index
    target: Index
    outcomes: Array


@dataclass(frozen=True)
class Attached:
    """Pairs of one point with nodes (n,), either way; `outcomes` (n, 7): rows of Edge's fields."""

    nodes: Index
    outcomes: Array


class Legs(Protocol):
    """How legs between the nodes of a roadmap, and points beside it, are found."""

    @property
    def pairs_per_node(self) -> int:
        """Some number of pairs that a node makes, to cut work by."""
        ...

    def of(self, source: Index) -> Found:
        """Pairs from the nodes `source`."""
        ...

    def away(self, point: Array) -> Attached:
        """Pairs from a point (3,) [m] to nodes."""
        ...

    def towards(self, point: Array) -> Attached:
        """Pairs from nodes to a point (3,) [m]."""
        ...


def legs_of(
    law: NeighbourLaw | Reachable, evaluator: Evaluator, position: Array, volume: float, departure: float
) -> Legs:
    """The legs of a law and a method among nodes (n, 3) [m] that fill a `volume` [m^3]."""
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
        """As Legs says: the most of some nodes, far apart in the order."""
        some = np.linspace(0, len(self.position) - 1, SAMPLED).astype(np.int64)
        return max(1, *(len(self.neighbourhood.of(self.position[n])) for n in some))

    def of(self, source: Index) -> Found:
        """As Legs says."""
        indptr, target = as_csr([self.neighbourhood.of(self.position[n]) for n in source])
        outcomes = self.evaluator.connect(self.position, self.departure, source, indptr, target)
        return Found(indptr, target, outcomes)

    def away(self, point: Array) -> Attached:
        """As Legs says."""
        nodes = self.neighbourhood.of(point)
        position = np.vstack([self.position[nodes], point])
        here, others = len(nodes), np.arange(len(nodes))
        return Attached(nodes, self.evaluator.connect(position, self.departure, [here], [0, here], others))

    def towards(self, point: Array) -> Attached:
        """As Legs says; by one fan backward in time where the method and the flow allow it."""
        nodes = self.neighbourhood.of(point)
        if self.evaluator.flies_backward:
            there, outcomes = self.evaluator.reach_point(self.position[nodes], point, self.departure, True)
            return Attached(nodes[there], outcomes)
        return _each_towards(self.evaluator, self.position, nodes, point, self.departure)


@dataclass(frozen=True)
class ReachableLegs:
    """Legs to the nodes that a fan reaches, the fastest `limit` of each vertical direction."""

    evaluator: Evaluator
    position: Array
    departure: float
    limit: int
    _fan: Evaluator = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_fan", self.evaluator.by_fan())

    @property
    def pairs_per_node(self) -> int:
        """As Legs says."""
        return 2 * self.limit if self.limit else len(self.position)

    def of(self, source: Index) -> Found:
        """As Legs says."""
        indptr, target, outcomes = self._fan.reach(self.position, self.departure, source, self.limit)
        if not isinstance(self.evaluator.steering, FlowMapMethod):
            outcomes = self.evaluator.connect(self.position, self.departure, source, indptr, target)
        return Found(indptr, target, outcomes)

    def away(self, point: Array) -> Attached:
        """As Legs says; all that are reached."""
        nodes, outcomes = self._fan.reach_point(self.position, point, self.departure, False)
        if not isinstance(self.evaluator.steering, FlowMapMethod):
            position, here = np.vstack([self.position[nodes], point]), len(nodes)
            others = np.arange(here)
            outcomes = self.evaluator.connect(position, self.departure, [here], [0, here], others)
        return Attached(nodes, outcomes)

    def towards(self, point: Array) -> Attached:
        """As Legs says; all that reach it."""
        if not is_steady(self.evaluator.flow):
            nodes = np.flatnonzero(self.position[:, 2] != point[2])
            return _each_towards(self.evaluator, self.position, nodes, point, self.departure)
        nodes, outcomes = self._fan.reach_point(self.position, point, self.departure, True)
        if not isinstance(self.evaluator.steering, FlowMapMethod):
            return _each_towards(self.evaluator, self.position, nodes, point, self.departure)
        return Attached(nodes, outcomes)


def _each_towards(
    evaluator: Evaluator, position: Array, nodes: Index, point: Array, departure: float
) -> Attached:
    here = len(nodes)
    places = np.vstack([position[nodes], point])
    rows = np.arange(here), np.arange(here + 1), np.full(here, here)
    return Attached(nodes, evaluator.connect(places, departure, *rows))
