"""The roadmap: nodes, the legs between them, and what made it."""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Index
from ..kernels.edges import Status
from .inputs import settings_sha256
from .rows import Blend, EdgeRows

EDGE_FIELDS = ("time", "cost", "glide_angle", "heading", "speed", "miss")


@dataclass(frozen=True)
class Provenance:
    """What made a roadmap; a value that a file of an earlier version does not hold is empty."""

    scenario: str
    flow: str
    glider: str
    flow_sha256: str
    glider_sha256: str
    kernel_digest: str
    seed: int
    created: str
    software_version: str
    scenario_sha256: str = ""
    terrain_sha256: str = ""
    nodes_sha256: str = ""
    libraries: str = ""
    machine: str = ""
    cost_unit: str = "s"
    inputs: str = ""
    steps: str = ""

    def identity(self) -> dict[str, str]:
        """Return the values that two roadmaps, or two parts, must share to have the same edges; no file names."""
        keys = (
            "nodes_sha256",
            "flow_sha256",
            "terrain_sha256",
            "glider_sha256",
            "kernel_digest",
        )
        return {"scenario_sha256": settings_sha256(self.scenario)} | {key: getattr(self, key) for key in keys}


class Made(Protocol):
    """A roadmap, in memory or in its file: what made it, its file, and new places of its scenario's files."""

    @property
    def provenance(self) -> Provenance:
        """What made it."""
        ...

    @property
    def file(self) -> Path | None:
        """The file from which it was read."""
        ...

    @property
    def elsewhere(self) -> tuple[str, ...]:
        """section.key=FILE for each file of the scenario for which the user gave a new place."""
        ...


@dataclass(frozen=True)
class Edges:
    """The edges from some nodes `source` (n,), whose numbers rise; `degree` (n,) is the number of edges of each.

    `target` (edges,) rises within the edges of a node. `values` (edges, 6) are in the order of EDGE_FIELDS.
    `counts` (n, statuses) are the numbers of pairs by Status. `seconds` is the time that it took, without
    compilation.
    """

    source: Index
    degree: Index
    target: NDArray[np.int32]
    values: Array
    counts: NDArray[np.int32]
    seconds: float = 0.0

    @property
    def pairs(self) -> int:
        """The number of pairs that were evaluated."""
        return int(self.counts.sum())

    def of(self, chosen: NDArray[np.bool_]) -> "Edges":
        """Return the edges of only the `chosen` nodes (n,)."""
        edges = np.repeat(chosen, self.degree)
        kept = self.source[chosen], self.degree[chosen], self.target[edges], self.values[edges]
        return Edges(*kept, self.counts[chosen])

    def before(self, node: int) -> tuple["Edges", "Edges"]:
        """Return the edges of the nodes before `node`, and of `node` and those after it; nothing is copied."""
        row = int(np.searchsorted(self.source, node))
        edge = int(self.degree[:row].sum())
        parts = []
        for rows, edges in ((slice(row), slice(edge)), (slice(row, None), slice(edge, None))):
            arrays = self.source[rows], self.degree[rows], self.target[edges], self.values[edges]
            parts.append(Edges(*arrays, self.counts[rows]))
        return parts[0], parts[1]

    def digest(self) -> str:
        """Return a digest of all values; "" if there is no node."""
        if self.source.size == 0:
            return ""
        text = hashlib.sha256()
        arrays = self.source, self.degree, self.target, self.values, self.counts
        for array, (_, kind) in zip(arrays, EMPTY, strict=True):
            text.update(np.ascontiguousarray(array, kind).tobytes())
        return text.hexdigest()


def by_node(parts: Iterable[Edges]) -> Iterator[Edges]:
    """Yield the edges of `parts` in the order of all nodes; the parts come in the order of their first nodes.

    Parts may overlap, for example if a cluster finds them. Only parts that overlap are kept in memory.
    """
    waiting: list[Edges] = []
    for part in parts:
        if part.source.size == 0:
            continue
        split = [earlier.before(int(part.source[0])) for earlier in waiting]
        ready = [before for before, _ in split if before.source.size]
        if ready:
            yield in_order(ready)
        waiting = [*(rest for _, rest in split if rest.source.size), part]
    if waiting:
        yield in_order(waiting)


def in_order(parts: Sequence[Edges]) -> Edges:
    """Return the edges of several sets of nodes as one set, in the order of the nodes' numbers."""
    empty: list[NDArray[Any]] = [np.empty((0, *shape), kind) for shape, kind in EMPTY]
    parts = [Edges(empty[0], empty[1], empty[2], empty[3], empty[4]), *parts]
    source, degree = (np.concatenate([getattr(part, name) for part in parts]) for name in ("source", "degree"))
    nodes = np.argsort(source, kind="stable")
    edges = np.argsort(np.repeat(source, degree), kind="stable")
    return Edges(
        source[nodes],
        degree[nodes],
        np.concatenate([part.target for part in parts])[edges],
        np.concatenate([part.values for part in parts])[edges],
        np.concatenate([part.counts for part in parts])[nodes],
        sum(part.seconds for part in parts),
    )


EMPTY = (
    ((), np.int64),
    ((), np.int64),
    ((), np.int32),
    ((len(EDGE_FIELDS),), np.float64),
    ((len(Status),), np.int32),
)
"""The shapes and types of the arrays of `Edges` without any node."""


class BaseRoadmap(ABC):
    """What a roadmap tells of itself and of some of its edges, in memory or in its file."""

    position: Array
    indptr: Index
    counts: dict[str, int]
    provenance: Provenance
    wall_s: float
    threads: int

    @abstractmethod
    def rows(self, blend: Blend) -> EdgeRows:
        """Return the edges for a search that makes a sum least."""

    @abstractmethod
    def targets(self, edges: Index) -> NDArray[np.int32]:
        """Return the targets of some edges (n,)."""

    @abstractmethod
    def legs(self, edges: Index) -> Array:
        """Return the values (n, 6) of some edges (n,), in the order of EDGE_FIELDS."""

    @property
    def edge_count(self) -> int:
        """The number of edges."""
        return int(self.indptr[-1])

    @property
    def evaluated(self) -> int:
        """The number of pairs that were evaluated."""
        return sum(self.counts.values())

    @property
    def connected_share(self) -> float:
        """The number of edges as a share of the pairs that were evaluated."""
        return self.edge_count / max(self.evaluated, 1)

    @property
    def pairs_per_s(self) -> float:
        """The number of pairs evaluated per second of wall time, without compilation."""
        return self.evaluated / max(self.wall_s, 1e-9)

    def as_dict(self) -> dict[str, Any]:
        """Return the table that `info --json` prints."""
        return {
            "nodes": len(self.position),
            "edges": self.edge_count,
            "evaluated": self.evaluated,
            "connected_share": self.connected_share,
            "counts": self.counts,
            "pairs_per_s": self.pairs_per_s,
            "wall_s": self.wall_s,
            "threads": self.threads,
            **asdict(self.provenance),
        }

    def _sizes(self) -> str:
        """Return how much the roadmap holds, for the first line of its text."""
        return f"{len(self.position):,} nodes, {self.edge_count:,} edges"

    def __str__(self) -> str:
        others = ", ".join(f"{n:,} {name.replace('_', ' ')}" for name, n in self.counts.items() if n)
        steps = f"  steps:  {self.provenance.steps}\n" if self.provenance.steps else ""
        return (
            f"Roadmap: {self._sizes()}\n"
            f"  pairs:  {self.evaluated:,} evaluated, {self.connected_share:.1%} connected ({others})\n"
            f"  flow:   {self.provenance.flow}\n"
            f"  glider: {self.provenance.glider}\n{steps}"
            f"  built:  {self.wall_s:.1f} s on {self.threads} threads, {self.pairs_per_s:,.0f} pairs/s, "
            f"{self.provenance.created}\n"
            f"  by:     glider-stream {self.provenance.software_version}"
            + "".join(f", {text}" for text in (self.provenance.libraries, self.provenance.machine) if text)
        )


@dataclass(frozen=True)
class EdgeTable(BaseRoadmap):
    """Nodes, and edges in CSR form: what roadmaps of one departure and of several have in common."""

    position: Array
    indptr: Index
    target: NDArray[np.int32]
    time: Array
    cost: Array
    glide_angle: Array
    heading: Array
    speed: Array
    miss: Array
    counts: dict[str, int]
    provenance: Provenance
    wall_s: float
    threads: int
    lonlat: Array | None = None
    file: Path | None = field(default=None, compare=False)
    elsewhere: tuple[str, ...] = field(default=(), compare=False)

    def whole(self) -> Self:
        """Return the roadmap with all its edges: itself."""
        return self

    def rows(self, blend: Blend) -> EdgeRows:
        """Return the edges for a search that makes a sum least."""
        return EdgeRows.whole(self.indptr, self.target, blend.read(lambda name: getattr(self, name)))

    def targets(self, edges: Index) -> NDArray[np.int32]:
        """Return the targets of some edges (n,)."""
        return self.target[edges]

    def legs(self, edges: Index) -> Array:
        """Return the values (n, 6) of some edges (n,), in the order of EDGE_FIELDS."""
        return np.column_stack([getattr(self, name)[edges] for name in EDGE_FIELDS])


@dataclass(frozen=True)
class Roadmap(EdgeTable):
    """Nodes `position` (n, 3) [m] and edges in CSR form by source node.

    `indptr` (n + 1,) and `target` (edges,), which rises within a row. Each edge has `time` [s], `cost`,
    `glide_angle` (signed) and `heading` [rad], `speed` through water [m/s], `miss` [m]. `counts` are the numbers
    of pairs by status, and `node_counts` (n, statuses) those of each node, if the file has them. `file` is the
    file from which it was read. `elsewhere` holds section.key=FILE for each file of the scenario for which the
    user gave a new place.

    Examples:
        >>> roadmap = glider_stream.read_roadmap("small.h5")
        >>> roadmap.position.shape, roadmap.target.size
        ((77, 3), 929)
        >>> first = slice(roadmap.indptr[0], roadmap.indptr[1])
        >>> len(roadmap.target[first]) == len(roadmap.time[first])
        True
    """

    departures: ClassVar[None] = None
    node_counts: NDArray[np.int32] | None = field(default=None, kw_only=True)
