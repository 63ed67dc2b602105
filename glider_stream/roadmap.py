"""The roadmap: nodes, the legs between them, and how it is built."""

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .edges import Evaluator, count_statuses
from .flow import flow_sha256
from .glider import glider_sha256
from .kernels.cache import KERNEL_DIGEST
from .kernels.edges import Status
from .legs import Legs, legs_of
from .neighbours import NeighbourLaw, Reachable
from .sampling import Sampler
from .settings import require
from .threads import threads

Array = NDArray[np.float64]
Index = NDArray[np.int64]
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
    """What made a roadmap."""

    scenario: str
    flow: str
    glider: str
    flow_sha256: str
    glider_sha256: str
    kernel_digest: str
    seed: int
    created: str
    software_version: str


@dataclass(frozen=True)
class Edges:
    """Edges of consecutive nodes: the `degree` of each (nodes,), `target` (edges,), rising within a node's.

    `values` (edges, 6): the numbers of each edge, in the order of EDGE_FIELDS.
    """

    degree: Index
    target: NDArray[np.int32]
    values: Array


@dataclass(frozen=True)
class Tally:
    """What a build has looked at: pairs by status, wall time [s] without compilation, threads."""

    counts: dict[str, int]
    wall_s: float
    threads: int


@dataclass(frozen=True)
class Roadmap:
    """Nodes `position` (n, 3) [m] and edges in CSR form by source node.

    `indptr` (n + 1,), `target` (edges,), rising within a row; per edge `time` [s], `cost`, `glide_angle`
    (signed) and `heading` [rad], `speed` through water [m/s], `miss` [m]. `counts`: pairs by status.
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
    lonlat: Array | None = field(default=None)

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
            f"{self.provenance.created}"
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
    problem.legs(problem.lo[None]).of(0, 1)


def find_edges(
    problem: Problem,
    position: Array,
    keep: Callable[[Edges], None],
    thread_count: int | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
    batch_pairs: int = BATCH_PAIRS,
) -> Tally:
    """Evaluate all neighbour pairs of nodes (n, 3) [m], in batches of whole nodes of some `batch_pairs` pairs.

    Each batch's edges are handed to `keep`, in order, and forgotten. Neither the number of threads nor the
    batch size changes a bit of the result.
    """
    require(batch_pairs >= 1, f"`batch_pairs` must be at least 1; got {batch_pairs}")
    legs, nodes = problem.legs(position), len(position)
    counts = dict.fromkeys((status.name.lower() for status in Status), 0)
    with threads(thread_count) as used:
        warm_up(problem)
        began = time.perf_counter()
        first, looked = 0, 0
        while first < nodes:
            batch = legs.of(first, batch_pairs)
            connected = batch.outcomes[:, 0] == Status.CONNECTED
            degree = np.diff(np.concatenate([[0], np.cumsum(connected)])[batch.indptr])
            target = batch.target[connected].astype(np.int32)
            keep(Edges(degree, target, batch.outcomes[connected, 1:]))
            for name, count in count_statuses(batch.outcomes).items():
                counts[name] += count
            first, looked = first + degree.size, looked + batch.target.size
            total = looked + round(looked / first * (nodes - first))
            progress(Progress(looked, total, counts["connected"], time.perf_counter() - began))
        return Tally(counts, time.perf_counter() - began, used)


def build_roadmap(
    problem: Problem,
    thread_count: int | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
    batch_pairs: int = BATCH_PAIRS,
) -> Roadmap:
    """A problem's roadmap, in memory; see `find_edges`, and `store.build_file` for one on disk."""
    position = node_positions(problem)
    parts: list[Edges] = []
    tally = find_edges(problem, position, parts.append, thread_count, progress, batch_pairs)
    columns = {name: np.concatenate([part.values[:, n] for part in parts]) for n, name in enumerate(EDGE_FIELDS)}
    return Roadmap(
        position=position,
        indptr=np.concatenate([[0], np.cumsum(np.concatenate([part.degree for part in parts]))]),
        target=np.concatenate([part.target for part in parts]),
        provenance=provenance_of(problem),
        lonlat=lonlat_of(problem, position),
        counts=tally.counts,
        wall_s=tally.wall_s,
        threads=tally.threads,
        **columns,
    )


def lonlat_of(problem: Problem, position: Array) -> Array | None:
    """Longitude and latitude [degrees] of nodes (n, 3) [m], where the scenario is geographic."""
    return None if problem.to_lonlat is None else problem.to_lonlat(position)


def provenance_of(problem: Problem) -> Provenance:
    """What a roadmap of this problem is made by, now."""
    return Provenance(
        scenario=problem.scenario,
        flow=problem.flow_words,
        glider=problem.glider_words,
        flow_sha256=flow_sha256(problem.evaluator.flow),
        glider_sha256=glider_sha256(problem.evaluator.polar),
        kernel_digest=KERNEL_DIGEST,
        seed=problem.sampler.seed,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        software_version=version("glider-stream"),
    )
