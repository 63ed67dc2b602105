"""Neighbour laws: they choose the pairs of nodes that are evaluated, always nodes at different depths."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from ..base.arrays import Array, Index
from ..base.nearest import tree_of
from ..base.settings import require

if TYPE_CHECKING:
    from scipy.spatial import KDTree


class Neighbourhood(Protocol):
    """A neighbour law, prepared for one set of nodes."""

    def of(self, point: Array) -> Index:
        """Return the neighbours of a point (3,) [m] among the nodes at other depths; their numbers rise."""
        ...


class NeighbourLaw(Protocol):
    """A law that chooses neighbours; it is the same for a node, a start and a goal."""

    def among(self, position: Array, volume: float) -> Neighbourhood:
        """Return the law for nodes (n, 3) [m] that fill a `volume` [m^3]."""
        ...


@dataclass(frozen=True)
class Nearest:
    """The k nearest nodes at other depths; "prm*": k = ceil(e (1 + 1/d) ln n), d = 3."""

    k: int | Literal["prm*"]

    def __post_init__(self) -> None:
        require(
            self.k == "prm*" or int(self.k) >= 1,
            f'`neighbours.k` must be at least 1, or "prm*"; got {self.k}',
        )

    def among(self, position: Array, volume: float) -> Neighbourhood:
        """Return the law for nodes (n, 3) [m] that fill a `volume` [m^3]."""
        k = math.ceil(math.e * (4 / 3) * math.log(max(len(position), 2))) if self.k == "prm*" else int(self.k)
        return _Nearest(tree_of(position), k)


@dataclass(frozen=True)
class _Nearest:
    tree: "KDTree"
    k: int

    def of(self, point: Array) -> Index:
        asked = 2 * self.k + 1
        while True:
            asked = min(asked, self.tree.n)
            distance, index = map(np.asarray, self.tree.query(point, k=np.arange(1, asked + 1)))
            other = self.tree.data[index, 2] != point[2]
            # on a grid equal distances are common; the lower index goes first, so all of them must be found
            if (distance[other] < distance[-1]).sum() >= self.k or asked == self.tree.n:
                order = np.lexsort((index[other], distance[other]))[: self.k]
                return np.sort(index[other][order])
            asked *= 2


@dataclass(frozen=True)
class Radius:
    """The nodes within `radius` [m]; "prm*": 2 ((1 + 1/d) (volume / unit ball) ln n / n)^(1/d), d = 3.

    Karaman and Frazzoli 2011, Sampling-based algorithms for optimal motion planning.
    """

    radius: float | Literal["prm*"]

    def __post_init__(self) -> None:
        fits = self.radius == "prm*" or float(self.radius) > 0
        require(fits, f'`neighbours.radius` must be above 0, or "prm*"; got {self.radius}')

    def among(self, position: Array, volume: float) -> Neighbourhood:
        """Return the law for nodes (n, 3) [m] that fill a `volume` [m^3]."""
        n = max(len(position), 2)
        unit_ball = 4 / 3 * math.pi
        prm_star = 2 * (4 / 3 * volume / unit_ball * math.log(n) / n) ** (1 / 3)
        return _Radius(tree_of(position), prm_star if self.radius == "prm*" else float(self.radius))


@dataclass(frozen=True)
class _Radius:
    tree: "KDTree"
    radius: float

    def of(self, point: Array) -> Index:
        index: Index = np.sort(np.asarray(self.tree.query_ball_point(point, self.radius), np.int64))
        return np.asarray(index[self.tree.data[index, 2] != point[2]])


@dataclass(frozen=True)
class AllNodes:
    """Every node at another depth."""

    def among(self, position: Array, volume: float) -> Neighbourhood:
        """Return the law for nodes (n, 3) [m] that fill a `volume` [m^3]."""
        return _All(position)


@dataclass(frozen=True)
class _All:
    position: Array

    def of(self, point: Array) -> Index:
        return np.flatnonzero(self.position[:, 2] != point[2])


@dataclass(frozen=True)
class Reachable:
    """All nodes that a node can reach by the flow map: the fastest `limit` down and `limit` up; 0 means all."""

    limit: int = 0

    def __post_init__(self) -> None:
        require(self.limit >= 0, f"`neighbours.limit` must be at least 0, all; got {self.limit}")


NEIGHBOURS: dict[str, type[NeighbourLaw | Reachable]] = {
    "nearest": Nearest,
    "radius": Radius,
    "all": AllNodes,
    "reachable": Reachable,
}


def as_csr(rows: Iterable[Index]) -> tuple[Index, Index]:
    """Return rows of targets in CSR form: (indptr, target)."""
    rows = list(rows)
    indptr = np.concatenate([[0], np.cumsum([len(row) for row in rows])]).astype(np.int64)
    return indptr, np.concatenate([np.empty(0, np.int64), *rows])
