"""What two roadmaps differ in: what made them, their nodes, their edges."""

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


@dataclass(frozen=True)
class Difference:
    """`made`: what made them differently, by name, with both values; `scenario`: the lines that only one has.

    `edges`: how many only the first has, only the second, and both; `times` [s]: the greatest difference in
    the time of an edge that both have, and how many differ. None where nodes or departures are not the same.
    """

    made: dict[str, tuple[str, str]]
    scenario: tuple[tuple[str, ...], tuple[str, ...]]
    edges: tuple[int, int, int] | None
    times: tuple[float, int] | None

    @property
    def same_edges(self) -> bool:
        """Whether both hold the same edges, to the bit."""
        return (
            self.edges is not None and self.edges[:2] == (0, 0) and self.times is not None and self.times[1] == 0
        )

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
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
        for mark, lines_of_one in zip("<>", self.scenario, strict=True):
            lines += [f"{mark} {plain(line)}" for line in lines_of_one[:MOST_LINES]]
            more = len(lines_of_one) - MOST_LINES
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
    """What differs between two roadmaps."""
    made = {}
    for key, word in WORDS.items():
        values = getattr(first.provenance, key), getattr(second.provenance, key)
        if values[0] != values[1]:
            made[word] = (values[0][:40], values[1][:40])
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
    """A number for each edge, by its source, its slice and its target."""
    nodes, rows = len(road.position), len(road.indptr) - 1
    require(nodes < 2**31, f"a roadmap of {nodes:,} nodes is too large to compare")
    return np.repeat(np.arange(rows, dtype=np.int64), np.diff(road.indptr)) * nodes + road.target
