"""The roadmap: nodes, the legs between them, and how it is built."""

import hashlib
import math
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base.arrays import Array, Index
from .base.settings import require
from .base.threads import threads
from .edges import Evaluator
from .kernels.cache import KERNEL_DIGEST
from .kernels.edges import Status
from .legs import Legs, legs_of
from .neighbours import NeighbourLaw, Reachable
from .sampling import Sampler
from .vehicle.polar import glider_sha256
from .water.inspect import flow_sha256

BATCH_PAIRS = 100_000
EDGE_FIELDS = ("time", "cost", "glide_angle", "heading", "speed", "miss")


@dataclass(frozen=True)
class Problem:
    """A scenario made into objects: what `build` and `query` need.

    `lo`, `hi` (3,) [m]: the box of nodes. `departure` [s]: when a glider leaves a node. `to_lonlat` turns
    x, y [m] into degrees where the scenario is geographic. `departs`: the departure's date and time (UTC),
    where known. `flow_words`, `glider_words` say what they are.
    """

    evaluator: Evaluator
    sampler: Sampler
    law: NeighbourLaw | Reachable
    lo: Array
    hi: Array
    departure: float
    start: Array | None
    goal: Array | None
    scenario: str
    flow_words: str
    glider_words: str
    to_lonlat: Callable[[Array], Array] | None = None
    departs: datetime | None = None

    def check_point(self, point: Array, name: str) -> None:
        """InputError unless a glider can be at `point` (3,) [m]."""
        shown, deepest = [*point], f"domain, which ends at z = {self.lo[2]:g} m"
        if self.to_lonlat is not None and np.isfinite(point).all():
            shown = [*self.to_lonlat(point[None])[0], 0.0 - point[2]]
            deepest = f"domain, which ends at a depth of {-self.lo[2]:g} m"
        said = "[" + ", ".join(f"{value:.7g}" for value in shown) + "]"
        require(bool(np.isfinite(point).all()), f"`{name}` must be three finite numbers; got {said}")
        require(point[2] <= 0, f"`{name}` = {said} lies above the surface; z is upward, a depth of 100 m is -100")
        require(bool(point[2] >= self.lo[2]), f"`{name}` = {said} lies below the {deepest}; move it up")
        inside = bool(self.evaluator.allowed(point[None], self.departure)[0])
        where = "outside the flow, on land or too near the seabed"
        require(inside, f"`{name}` = {said} lies {where}; move it into open water")

    def legs(self, position: Array) -> Legs:
        """How legs among these nodes (n, 3) [m] are found."""
        volume = float(np.prod(self.hi - self.lo))
        return legs_of(self.law, self.evaluator, position, volume, self.departure)


@dataclass(frozen=True)
class Progress:
    """How far a build is: pairs done and in all, connected so far, seconds since it began."""

    done: int
    total: int
    connected: int
    seconds: float

    def __str__(self) -> str:
        rate = self.done / max(self.seconds, 1e-9)
        left = (self.total - self.done) / rate if self.done else 0.0 if self.total == 0 else math.inf
        share = self.connected / max(self.done, 1)
        so_far = f"{self.done:,} of {self.total:,} pairs, {rate:,.0f} pairs/s"
        return f"{so_far}, {share:.1%} connected, {left:,.0f} s left"


@dataclass(frozen=True)
class Provenance:
    """What made a roadmap; what a file of an earlier version of the program does not say is empty."""

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

    def identity(self) -> dict[str, str]:
        """What two roadmaps, or parts of one, must share to hold the same edges."""
        keys = (
            "scenario_sha256",
            "nodes_sha256",
            "flow_sha256",
            "terrain_sha256",
            "glider_sha256",
            "kernel_digest",
        )
        return {key: getattr(self, key) for key in keys}


@dataclass(frozen=True)
class Edges:
    """What was found from some nodes `source` (n,), rising: the `degree` of each (n,), the edges, the pairs.

    `target` (edges,) rises within a node's; `values` (edges, 6) in the order of EDGE_FIELDS; `counts`
    (n, statuses) pairs by Status; `seconds` that it took, compilation left out.
    """

    source: Index
    degree: Index
    target: NDArray[np.int32]
    values: Array
    counts: NDArray[np.int32]
    seconds: float = 0.0

    @property
    def pairs(self) -> int:
        """How many pairs were looked at."""
        return int(self.counts.sum())

    def of(self, chosen: NDArray[np.bool_]) -> "Edges":
        """Those of some of the nodes (n,)."""
        edges = np.repeat(chosen, self.degree)
        kept = self.source[chosen], self.degree[chosen], self.target[edges], self.values[edges]
        return Edges(*kept, self.counts[chosen])


def in_order(parts: Sequence[Edges]) -> Edges:
    """The edges of several sets of nodes as one, by the nodes' numbers."""
    none: list[NDArray[Any]] = [np.empty((0, *shape), kind) for shape, kind in EMPTY]
    parts = [Edges(none[0], none[1], none[2], none[3], none[4]), *parts]
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
"""Shapes and types of the arrays of `Edges`."""


@dataclass(frozen=True)
class Roadmap:
    """Nodes `position` (n, 3) [m] and edges in CSR form by source node.

    `indptr` (n + 1,), `target` (edges,), rising within a row; per edge `time` [s], `cost`, `glide_angle`
    (signed) and `heading` [rad], `speed` through water [m/s], `miss` [m]. `counts`: pairs by status;
    `node_counts` (n, statuses) those of each node, where the file has them.
    """

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
    node_counts: NDArray[np.int32] | None = None

    @property
    def evaluated(self) -> int:
        """How many pairs were looked at."""
        return sum(self.counts.values())

    @property
    def connected_share(self) -> float:
        """Edges found, as a share of the pairs looked at."""
        return self.target.size / max(self.evaluated, 1)

    @property
    def pairs_per_s(self) -> float:
        """Pairs evaluated per second of wall time, compilation left out."""
        return self.evaluated / max(self.wall_s, 1e-9)

    def as_dict(self) -> dict[str, Any]:
        """What `info --json` says."""
        return {
            "nodes": len(self.position),
            "edges": self.target.size,
            "evaluated": self.evaluated,
            "connected_share": self.connected_share,
            "counts": self.counts,
            "pairs_per_s": self.pairs_per_s,
            "wall_s": self.wall_s,
            "threads": self.threads,
            **asdict(self.provenance),
        }

    def __str__(self) -> str:
        others = ", ".join(f"{n:,} {name.replace('_', ' ')}" for name, n in self.counts.items() if n)
        return (
            f"Roadmap: {len(self.position):,} nodes, {self.target.size:,} edges\n"
            f"  pairs:  {self.evaluated:,} evaluated, {self.connected_share:.1%} connected ({others})\n"
            f"  flow:   {self.provenance.flow}\n"
            f"  glider: {self.provenance.glider}\n"
            f"  built:  {self.wall_s:.1f} s on {self.threads} threads, {self.pairs_per_s:,.0f} pairs/s, "
            f"{self.provenance.created}\n"
            f"  by:     glider-stream {self.provenance.software_version}"
            + "".join(f", {words}" for words in (self.provenance.libraries, self.provenance.machine) if words)
        )


def node_positions(problem: Problem) -> Array:
    """The scenario's nodes (n, 3) [m]; its start and goal are the last two, where it names them."""
    sampled = problem.sampler.nodes(
        problem.lo, problem.hi, lambda points: problem.evaluator.allowed(points, problem.departure)
    )
    require(len(sampled) > 0, "the scenario has no node in open water; move the domain or sample more")
    named = []
    for name, point in (("query.start", problem.start), ("query.goal", problem.goal)):
        if point is not None:
            problem.check_point(point, name)
            named.append(point)
    return np.vstack([sampled, *named])


def warm_up(problem: Problem) -> None:
    """Compile the kernels that a build needs, or load them from the disk cache."""
    problem.legs(problem.lo[None]).of(np.zeros(1, np.int64))


def find_edges(
    problem: Problem, position: Array, source: Index | None = None, batch_pairs: int = BATCH_PAIRS
) -> Iterator[Edges]:
    """Evaluate all pairs of the nodes `source`, all if None, among nodes (n, 3) [m], some `batch_pairs` at once.

    Neither the number of threads nor the batches change a bit of the result.
    """
    require(batch_pairs >= 1, f"`batch_pairs` must be at least 1; got {batch_pairs}")
    legs = problem.legs(position)
    source = np.arange(len(position)) if source is None else source
    size = max(1, batch_pairs // legs.pairs_per_node)
    for first in range(0, len(source), size):
        yield _evaluated(legs, source[first : first + size])


def _evaluated(legs: Legs, source: Index) -> Edges:
    began = time.perf_counter()
    batch = legs.of(source)
    status = batch.outcomes[:, 0].astype(np.int64)
    connected = status == Status.CONNECTED
    node = np.repeat(np.arange(len(source)), np.diff(batch.indptr))
    counts = np.bincount(node * len(Status) + status, minlength=len(source) * len(Status))
    by_node: NDArray[np.int32] = counts.reshape(len(source), len(Status)).astype(np.int32)
    target, values = batch.target[connected].astype(np.int32), batch.outcomes[connected, 1:]
    degree = np.bincount(node[connected], minlength=len(source))
    return Edges(source, degree, target, values, by_node, time.perf_counter() - began)


@dataclass
class Tally:
    """What a build of `nodes` has looked at so far: pairs by status, seconds, compilation left out, threads."""

    nodes: int
    threads: int
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(Status), np.int64))
    seconds: float = 0.0
    done: int = 0

    def add(self, edges: Edges) -> Progress:
        """Count some more nodes' pairs; how far that is."""
        self.counts += edges.counts.sum(axis=0)
        self.seconds += edges.seconds
        self.done += edges.source.size
        looked = int(self.counts.sum())
        total = looked + round(looked / max(self.done, 1) * (self.nodes - self.done))
        return Progress(looked, total, int(self.counts[Status.CONNECTED]), self.seconds)

    def by_name(self) -> dict[str, int]:
        """Pairs by the name of their status, in lower case."""
        return {status.name.lower(): int(self.counts[status]) for status in Status}


def build_roadmap(
    problem: Problem,
    thread_count: int | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
    batch_pairs: int = BATCH_PAIRS,
) -> Roadmap:
    """A problem's roadmap, in memory; see `jobs.build_file` for one on disk."""
    position = node_positions(problem)
    parts: list[Edges] = []
    with threads(thread_count) as used:
        warm_up(problem)
        tally = Tally(len(position), used)
        for edges in find_edges(problem, position, batch_pairs=batch_pairs):
            parts.append(edges)
            progress(tally.add(edges))
    whole = in_order(parts)
    return Roadmap(
        position=position,
        indptr=np.concatenate([[0], np.cumsum(whole.degree)]),
        target=whole.target,
        provenance=provenance_of(problem, position),
        lonlat=lonlat_of(problem, position),
        counts=tally.by_name(),
        wall_s=tally.seconds,
        threads=used,
        node_counts=whole.counts,
        **{name: np.ascontiguousarray(whole.values[:, n]) for n, name in enumerate(EDGE_FIELDS)},
    )


def lonlat_of(problem: Problem, position: Array) -> Array | None:
    """Longitude and latitude [degrees] of nodes (n, 3) [m], where the scenario is geographic."""
    return None if problem.to_lonlat is None else problem.to_lonlat(position)


def provenance_of(problem: Problem, position: Array) -> Provenance:
    """What a roadmap of this problem, with nodes (n, 3) [m], is made by, now."""
    return Provenance(
        scenario=problem.scenario,
        flow=problem.flow_words,
        glider=problem.glider_words,
        scenario_sha256=hashlib.sha256(problem.scenario.encode()).hexdigest(),
        flow_sha256=flow_sha256(problem.evaluator.flow),
        terrain_sha256=flow_sha256(problem.evaluator.terrain),
        glider_sha256=glider_sha256(problem.evaluator.polar),
        nodes_sha256=hashlib.sha256(np.ascontiguousarray(position, "<f8").tobytes()).hexdigest(),
        kernel_digest=KERNEL_DIGEST,
        seed=problem.sampler.seed,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        software_version=version("glider-stream"),
        cost_unit=problem.evaluator.cost.unit,
        libraries=", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "scipy", "h5py")),
        machine=f"{platform.node()}, {platform.machine()}, Python {platform.python_version()}",
    )
