"""Compares two roadmaps: what made them, their nodes, their edges."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.settings import require
from ..base.terminal import plain
from .roadmap import EDGE_FIELDS, Roadmap
from .slices import SlicedRoadmap

AnyRoadmap = Roadmap | SlicedRoadmap

WORDS = {
    "flow_sha256": "flow",
    "terrain_sha256": "terrain",
    "glider_sha256": "glider",
    "nodes_sha256": "nodes",
    "kernel_digest": "kernels",
    "software_version": "version",
    "libraries": "libraries",
    "machine": "machine",
    "created": "created",
}
MOST_LINES = 40
"""At most this many different lines of each scenario are shown."""


@dataclass(frozen=True)
class Difference:
    """The differences between two roadmaps.

    `made` holds by name what made them, with both values, where these differ. `scenario` holds the lines that
    only the first and only the second scenario has. `edges` are the numbers of edges only in the first, only in
    the second, and in both. `times` are the greatest difference [s] in the time of an edge in both, and the
    number of edges in both that differ. `edges` and `times` are None if nodes or departures are not the same.
    """

    made: dict[str, tuple[str, str]]
    scenario: tuple[tuple[str, ...], tuple[str, ...]]
    edges: tuple[int, int, int] | None
    times: tuple[float, int] | None

    @property
    def same_edges(self) -> bool:
        """Whether both have exactly the same edges, bit by bit."""
        return (
            self.edges is not None and self.edges[:2] == (0, 0) and self.times is not None and self.times[1] == 0
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a table for JSON."""
        edges = dict(zip(("only_first", "only_second", "both"), self.edges, strict=True)) if self.edges else None
        return {
            "made": {name: list(pair) for name, pair in self.made.items()},
            "scenario_only_first": list(self.scenario[0]),
            "scenario_only_second": list(self.scenario[1]),
            "edges": edges,
            "greatest_time_difference_s": None if self.times is None else self.times[0],
            "edges_that_differ": None if self.times is None else self.times[1],
            "same_edges": self.same_edges,
        }

    def __str__(self) -> str:
        lines = [
            f"{name}: {first or 'not said'} | {second or 'not said'}"
            for name, (first, second) in self.made.items()
        ]
        for mark, own_lines in zip("<>", self.scenario, strict=True):
            lines += [f"{mark} {plain(line)}" for line in own_lines[:MOST_LINES]]
            more = len(own_lines) - MOST_LINES
            lines += [f"{mark} ... {more} lines more"] if more > 0 else []
        if self.edges is None or self.times is None:
            lines.append("their nodes, or their departures, are not the same, so no edge is compared")
        elif self.same_edges:
            lines.append(f"all {self.edges[2]:,} edges are the same")
        else:
            lines.append(
                f"edges: {self.edges[0]:,} only in the first, {self.edges[1]:,} only in the second, "
                f"{self.edges[2]:,} in both, of which {self.times[1]:,} differ, by at most {self.times[0]:.3g} s"
            )
        return "\n".join(lines)


def difference(first: AnyRoadmap, second: AnyRoadmap) -> Difference:
    """Return the differences between two roadmaps."""
    made = {}
    for key, name_shown in WORDS.items():
        values = getattr(first.provenance, key), getattr(second.provenance, key)
        if values[0] != values[1]:
            made[name_shown] = (values[0][:40], values[1][:40])
    texts = [road.provenance.scenario.splitlines() for road in (first, second)]
    unshared = tuple(
        tuple(line for line in text if line and line not in set(other)) for text, other in (texts, texts[::-1])
    )
    slices = [road.departures.tobytes() if isinstance(road, SlicedRoadmap) else b"" for road in (first, second)]
    if first.position.tobytes() != second.position.tobytes() or slices[0] != slices[1]:
        return Difference(made, (unshared[0], unshared[1]), None, None)
    keys = _keys(first), _keys(second)
    both, in_first, in_second = np.intersect1d(keys[0], keys[1], assume_unique=True, return_indices=True)
    unlike = np.zeros(both.size, dtype=bool)
    for name in EDGE_FIELDS:
        unlike |= getattr(first, name)[in_first] != getattr(second, name)[in_second]
    apart = float(np.abs(first.time[in_first] - second.time[in_second]).max(initial=0.0))
    counts = keys[0].size - both.size, keys[1].size - both.size, both.size
    return Difference(made, (unshared[0], unshared[1]), counts, (apart, int(unlike.sum())))


def _keys(road: AnyRoadmap) -> NDArray[np.int64]:
    """Return a unique number (edges,) for each source, slice and target."""
    nodes, rows = len(road.position), len(road.indptr) - 1
    require(nodes < 2**31, f"a roadmap of {nodes:,} nodes is too large to compare")
    return np.repeat(np.arange(rows, dtype=np.int64), np.diff(road.indptr)) * nodes + road.target
