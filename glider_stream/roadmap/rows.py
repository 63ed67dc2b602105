"""Edges of a search: all of them in memory, or blocks of them read when the search comes to them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Bools, Index

Span = tuple[int, int]
"""Edges from the first number to before the second."""


@dataclass(frozen=True)
class Blend:
    """The sum that a search makes least: `cost` times the scenario's cost, plus `time` times the seconds."""

    cost: float = 1.0
    time: float = 0.0

    def of(self, cost: Any, time: Any) -> Any:
        """Return the sum for legs with these costs and times [s]."""
        if self == CHEAPEST:
            return cost  # most queries use this case, for all edges
        if self == FASTEST:
            return time
        return self.cost * cost + self.time * time

    def read(self, column: Callable[[str], Array]) -> Array:
        """Return the sum for some edges; `column` returns their "cost" or "time" (edges,), where it is needed."""
        cost, time = (column(name) if getattr(self, name) else 0.0 for name in ("cost", "time"))
        return np.asarray(self.of(cost, time))


CHEAPEST, FASTEST = Blend(), Blend(0.0, 1.0)
"""A search for the least cost, and for the least time."""


class EdgeSource(Protocol):
    """A place from which edges are read."""

    def read(self, spans: Sequence[Span], target: NDArray[np.int32], weight: Array) -> None:
        """Read targets and weights of some spans of edges into the same places of two arrays (edges,)."""
        ...

    def check(self, span: Span, indptr: Index, target: NDArray[np.int32], weight: Array) -> None:
        """Raise InputError unless the edges of a span are sound."""
        ...


@dataclass(frozen=True)
class EdgeRows:
    """Edges in CSR form: rows `indptr` (rows + 1,), `target` (edges,), `weight` (edges,), what a search adds up.

    The arrays have values only in the blocks of `block` edges that are known; `need` reads others from the
    `source`. Many threads may use it at once.
    """

    indptr: Index
    target: NDArray[np.int32]
    weight: Array
    block: int
    _known: Bools
    _source: EdgeSource | None = None
    _turn_by_turn: Lock = field(default_factory=Lock)

    @classmethod
    def whole(cls, indptr: Index, target: NDArray[np.int32], weight: Array) -> "EdgeRows":
        """Return edges that are all in memory."""
        return cls(indptr, target, weight, max(target.size, 1), np.ones(1, np.bool_))

    @classmethod
    def on_demand(cls, indptr: Index, block: int, source: EdgeSource) -> "EdgeRows":
        """Return edges of which none is known yet. Only the parts of the arrays that are read take memory."""
        edges = int(indptr[-1])
        known = np.zeros(-(-edges // block), np.bool_)
        return cls(indptr, np.empty(edges, np.int32), np.empty(edges), block, known, source)

    @property
    def known(self) -> Bools:
        """A copy of the mask (blocks,) of the blocks that are known."""
        with self._turn_by_turn:
            return self._known.copy()

    def need(self, rows: Index, following: int = 1) -> None:
        """Read what is not known of some rows (n,); `following` rows are meant from each on, itself included.

        InputError if the source is damaged there, or gone.
        """
        if self._source is None:
            return
        first, last = self.indptr[rows], self.indptr[np.minimum(rows + following, self.indptr.size - 1)]
        some = last > first
        begins = np.zeros(self._known.size + 1, np.int64)  # +1 where a row's blocks begin, -1 after their end
        np.add.at(begins, first[some] // self.block, 1)
        np.add.at(begins, (last[some] - 1) // self.block + 1, -1)
        with self._turn_by_turn:
            lacking = np.flatnonzero((np.cumsum(begins[:-1]) > 0) & ~self._known)
            if not lacking.size:
                return
            runs = np.split(lacking, np.flatnonzero(np.diff(lacking) > 1) + 1)
            spans = [self._span(int(run[0]), int(run[-1]) + 1) for run in runs]
            self._source.read(spans, self.target, self.weight)
            for run in runs:
                # a row may go on in the blocks beside
                a, b = int(run[0]), int(run[-1]) + 1
                a -= int(a > 0 and self._known[a - 1])
                b += int(b < self._known.size and self._known[b])
                self._source.check(self._span(a, b), self.indptr, self.target, self.weight)
            self._known[lacking] = True

    def _span(self, first: int, last: int) -> Span:
        """Return the edges of the blocks from `first` to before `last`."""
        return first * self.block, min(last * self.block, self.target.size)
