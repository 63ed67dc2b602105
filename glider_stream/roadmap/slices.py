"""The roadmap of many departures: slices of edges over the same nodes."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Index
from ..base.settings import require
from .roadmap import EDGE_FIELDS, EdgeTable, Roadmap


def rows_of(nodes: Index, slices: int) -> Index:
    """Return the rows of edges of some nodes: node n has `slices` rows from n times `slices` on."""
    return np.asarray((nodes[:, None] * slices + np.arange(slices)).ravel())


@dataclass(frozen=True)
class SlicedRoadmap(EdgeTable):
    """Nodes `position` (n, 3) [m], and edges at each of the rising `departures` (slices,) [s].

    The fields are those of `Roadmap`. But `indptr` (n slices + 1,) has a row for each node and departure, in the
    order of `rows_of`, and `row_counts` (n slices, statuses) are the numbers of pairs of each row.

    Examples:
        >>> departures = ["departures.first=0", "departures.last=600", "departures.every=600"]
        >>> road = planner.build("swinging-gyre", overrides=["sampling.shape=[4, 3, 2]", *departures])
        >>> road.departures.tolist(), len(road.at(1).position)
        ([0.0, 600.0], 26)
    """

    departures: Array = field(kw_only=True)
    row_counts: NDArray[np.int32] | None = field(default=None, kw_only=True)

    def at(self, number: int) -> Roadmap:
        """Return one slice as a roadmap."""
        slices, nodes = self.departures.size, len(self.position)
        require(0 <= number < slices, f"slices have the numbers 0 to {slices - 1}; got {number}")
        rows = np.arange(nodes) * slices + number
        degree = np.diff(self.indptr)[rows]
        indptr = np.concatenate([[0], np.cumsum(degree)])
        edges = np.arange(indptr[-1]) + np.repeat(self.indptr[rows] - indptr[:-1], degree)
        share = edges.size / max(self.target.size, 1)
        counts = dict(self.counts)
        if self.row_counts is not None:
            counts = dict(zip(counts, self.row_counts[rows].sum(axis=0).tolist(), strict=True))
        values: dict[str, Any] = {name: getattr(self, name)[edges] for name in EDGE_FIELDS}
        return Roadmap(
            position=self.position,
            indptr=indptr,
            target=self.target[edges],
            counts=counts,
            provenance=self.provenance,
            wall_s=self.wall_s * (share if slices > 1 else 1.0),
            threads=self.threads,
            lonlat=self.lonlat,
            node_counts=None if self.row_counts is None else self.row_counts[rows],
            file=self.file,
            elsewhere=self.elsewhere,
            **values,
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the table that `info --json` prints."""
        return {"departures": self.departures.tolist(), **super().as_dict()}

    def _sizes(self) -> str:
        degree = np.diff(self.indptr).reshape(-1, self.departures.size).sum(axis=0)
        return (
            f"{len(self.position):,} nodes, {self.departures.size} departures from "
            f"{self.departures[0]:,.0f} s to {self.departures[-1]:,.0f} s, {self.target.size:,} edges, "
            f"{degree.min():,} to {degree.max():,} at a departure"
        )
