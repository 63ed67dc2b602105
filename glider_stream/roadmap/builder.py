"""Builds a roadmap: first the nodes, then the pairs of some nodes at a time."""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Bools, Index
from ..base.settings import require
from ..base.threads import thread_count as threads_now
from ..base.threads import threads
from ..kernels.edges import STATUS, TIME, Status
from .evaluator import NODES_AT_ONCE
from .follow import Follower
from .pairs import Found, LegFinder
from .problem import Problem
from .provenance import lonlat_of, provenance_of
from .roadmap import EDGE_FIELDS, Edges, Provenance, Roadmap, in_order
from .slices import SlicedRoadmap, rows_of
from .step_error import StepSample

BATCH_PAIRS = 100_000
"""About this many pairs are evaluated together."""
SPANS = 2
"""A batch has at least this many shares for each thread, so that no thread waits long for the slowest."""


@dataclass(frozen=True)
class Progress:
    """The progress of a build: pairs that are done, all pairs, connected pairs, seconds since the begin."""

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


def node_positions(problem: Problem) -> Array:
    """Return the scenario's nodes (n, 3) [m]; the last two are its start and goal, if it has them."""
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
    nobody = np.zeros(1, np.int64)
    problem.legs(problem.lo[None]).of(nobody)
    if len(problem.departures) > 1:
        follower = replace(Follower.of(problem, problem.lo[None]), few=0)
        for _ in replace(follower, problem=replace(problem, slices=problem.departures[:2])).slices(nobody):
            pass


def find_edges(
    problem: Problem,
    position: Array,
    source: Index | None = None,
    batch_pairs: int = BATCH_PAIRS,
    departure: Array | None = None,
    wanted: Callable[[Index], Bools] | None = None,
) -> Iterator[Edges]:
    """Evaluate the pairs from nodes `source` to the nodes (n, 3) [m], and yield the edges of each batch.

    If `source` is None, all nodes are sources. A batch has about `batch_pairs` pairs. Legs begin at the node's
    `departure` (n,) [s], or at the problem's if it is None. `wanted` returns for some sources a mask (sources, n)
    of the targets of use; other pairs may be left out. Threads and batches do not change a bit of the result. The
    sources of the edges are rows as `slices.rows_of` numbers them; with one departure they are nodes.
    """
    require(batch_pairs >= 1, f"`batch_pairs` must be at least 1; got {batch_pairs}")
    legs = problem.legs(position)
    source = np.arange(len(position)) if source is None else source
    size = nodes_of_batch(problem, legs, batch_pairs)
    follower = Follower.of(problem, position) if len(problem.departures) > 1 else None
    for first in range(0, len(source), size):
        some = source[first : first + size]
        if follower is not None:
            yield _followed(follower, some)
            continue
        when = None if departure is None else departure[some]
        yield _evaluated(legs, some, when, None if wanted is None else wanted(some))


def nodes_of_batch(problem: Problem, legs: LegFinder, batch_pairs: int) -> int:
    """Return the number of nodes with about `batch_pairs` pairs; with many departures enough for all threads."""
    nodes, slices = max(1, batch_pairs // legs.pairs_per_node), len(problem.departures)
    return max(nodes // slices, min(nodes, SPANS * NODES_AT_ONCE * threads_now()))


def _evaluated(legs: LegFinder, source: Index, departure: Array | None, wanted: Bools | None) -> Edges:
    began = time.perf_counter()
    batch = legs.of(source, departure, wanted)
    return _edges(source, batch, time.perf_counter() - began)


def _followed(follower: Follower, source: Index) -> Edges:
    """Return the edges of some nodes at all departures."""
    began = time.perf_counter()
    rows = rows_of(source, len(follower.problem.departures)).reshape(len(source), -1)
    edges = in_order([_edges(rows[:, k], found, 0.0) for k, found in enumerate(follower.slices(source))])
    return replace(edges, seconds=time.perf_counter() - began)


def _edges(source: Index, batch: Found, seconds: float) -> Edges:
    """Return evaluated pairs as edges and counts."""
    status = batch.outcomes[:, STATUS].astype(np.int64)
    connected = status == Status.CONNECTED
    node = np.repeat(np.arange(len(source)), np.diff(batch.indptr))
    counts = np.bincount(node * len(Status) + status, minlength=len(source) * len(Status))
    by_node: NDArray[np.int32] = counts.reshape(len(source), len(Status)).astype(np.int32)
    target, values = batch.target[connected].astype(np.int32), batch.outcomes[connected, TIME:]
    degree = np.bincount(node[connected], minlength=len(source))
    return Edges(source, degree, target, values, by_node, seconds)


@dataclass
class Tally:
    """What a build of `nodes` has evaluated so far: pairs by status, seconds without compilation, threads."""

    nodes: int
    threads: int
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(Status), np.int64))
    seconds: float = 0.0
    done: int = 0

    def add(self, edges: Edges) -> Progress:
        """Count the pairs of more nodes, and return the progress."""
        self.counts += edges.counts.sum(axis=0)
        self.seconds += edges.seconds
        self.done += edges.source.size
        looked = int(self.counts.sum())
        total = looked + round(looked / max(self.done, 1) * (self.nodes - self.done))
        return Progress(looked, total, int(self.counts[Status.CONNECTED]), self.seconds)

    def by_name(self) -> dict[str, int]:
        """Return the number of pairs by the name of their status, in lower case."""
        return {status.name.lower(): int(self.counts[status]) for status in Status}


def build_roadmap(
    problem: Problem,
    thread_count: int | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
    batch_pairs: int = BATCH_PAIRS,
) -> Roadmap:
    """Return a problem's roadmap, made in memory; `jobs.build_file` makes one on disk.

    Examples:
        >>> problem = glider_stream.read_scenario("small.toml").problem()
        >>> glider_stream.build_roadmap(problem).target.size
        929
    """
    require(len(problem.departures) == 1, "a roadmap of several departures is built by `build_slices`")
    return build_slices(problem, thread_count, progress, batch_pairs).at(0)


def build_slices(
    problem: Problem,
    thread_count: int | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
    batch_pairs: int = BATCH_PAIRS,
) -> SlicedRoadmap:
    """Return a problem's roadmap of all its departures, made in memory."""
    position = node_positions(problem)
    parts: list[Edges] = []
    with threads(thread_count) as used:
        warm_up(problem)
        made = StepSample(len(position)).checked(
            provenance_of(problem, position),
            problem,
            position,
            lambda at_departure, nodes: find_edges(at_departure, position, nodes, batch_pairs),
        )
        tally = Tally(len(position) * len(problem.departures), used)
        for edges in find_edges(problem, position, batch_pairs=batch_pairs):
            parts.append(edges)
            progress(tally.add(edges))
    return _slices_of(problem, position, in_order(parts), made, tally)


def _slices_of(problem: Problem, position: Array, edges: Edges, made: Provenance, tally: Tally) -> SlicedRoadmap:
    values: dict[str, Any] = {n: np.ascontiguousarray(edges.values[:, k]) for k, n in enumerate(EDGE_FIELDS)}
    return SlicedRoadmap(
        departures=np.array(problem.departures),
        position=position,
        indptr=np.concatenate([[0], np.cumsum(edges.degree)]),
        target=edges.target,
        provenance=made,
        lonlat=lonlat_of(problem, position),
        counts=tally.by_name(),
        wall_s=tally.seconds,
        threads=tally.threads,
        row_counts=edges.counts,
        **values,
    )


def roadmap_of(problem: Problem, position: Array, edges: Edges, made: Provenance, tally: Tally) -> Roadmap:
    """Return a roadmap of nodes (n, 3) [m] and the edges of all of them, at the problem's only departure."""
    return _slices_of(problem, position, edges, made, tally).at(0)
