"""Jobs: builds that survive a kill; in parts, on a cluster, or with the edges of an older roadmap."""

import heapq
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Index
from ..base.errors import InputError, Stopped, Unwritable
from ..base.lock import locked
from ..base.output import check_output, remove_abandoned
from ..base.settings import require
from ..base.threads import threads
from ..roadmap.builder import BATCH_PAIRS, Progress, Tally, find_edges, node_positions, warm_up
from ..roadmap.problem import Problem
from ..roadmap.provenance import lonlat_of, provenance_of
from ..roadmap.roadmap import EDGE_FIELDS, Edges, Provenance, Roadmap, by_node, in_order
from ..roadmap.shard import Shard
from ..roadmap.slices import SlicedRoadmap, rows_of
from ..roadmap.step_error import StepSample
from ..roadmap.store import read_part, writing
from .journal import Journal

Finder = Callable[[Problem, Array, Index, int], Iterator[Edges]]
CHECKPOINT = 30.0
"""After this many seconds the disk is asked again to keep what was found."""


def shard_of(text: str) -> Shard:
    """Return shard 3 of 16 for the text "3/16"."""
    match = re.fullmatch(r"\s*(\d{1,7})\s*/\s*(\d{1,7})\s*", text)
    number, count = (int(match.group(n)) for n in (1, 2)) if match else (0, 0)
    require(1 <= number <= count, f"a shard is NUMBER/COUNT, such as 3/16; got {text!r}")
    return Shard(number, count)


@dataclass(frozen=True)
class Job:
    """Settings of a build; they do not change a bit of the result.

    `restart`: forget what an earlier run has kept. `checkpoint` [s]: see `Journal`. `shard`: build only this
    part. `base`: an older roadmap, and the nodes (n,) whose edges are still right. `finder`: evaluates the nodes.
    `warm`: whether the kernels are compiled here first.
    """

    restart: bool = False
    checkpoint: float = CHECKPOINT
    shard: Shard | None = None
    base: tuple[Roadmap | SlicedRoadmap, NDArray[np.bool_]] | None = None
    finder: Finder = find_edges
    warm: bool = True

    def __post_init__(self) -> None:
        require(self.checkpoint >= 0, f"`checkpoint` must be at least 0 s; got {self.checkpoint:g}")


def build_file(
    problem: Problem,
    path: str | Path,
    thread_count: int | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
    batch_pairs: int = BATCH_PAIRS,
    job: Job = Job(),
) -> None:
    """Build the roadmap of a problem into a file; memory holds the nodes and one batch of edges.

    Edges are kept in a journal beside the file; the same call continues from it after a kill. The file appears
    whole or not at all.
    """
    path = Path(path)
    check_output(path)
    target = path.resolve()  # a link stays a link
    with locked(target):
        remove_abandoned(target)
        position = node_positions(problem)
        made = provenance_of(problem, position, target.parent)
        shard = job.shard or Shard(1, 1)
        nodes = np.arange(*shard.nodes(len(position)))
        slices = len(problem.departures)
        rows = rows_of(nodes, slices)
        old = _taken_over(job, rows, slices)
        # records do not hold the edges of the base, so they fit only a build with the same base
        identity = {**made.identity(), "shard": str(shard), "nodes": len(position), "base": old.digest()}
        journal_path = target.with_name(f"{target.name}.journal")
        kept = ""
        try:
            with (
                Journal(journal_path, identity, rows, job.restart, job.checkpoint) as journal,
                threads(thread_count) as used,
            ):
                try:
                    _run(problem, position, made, path, journal, shard, old, job, used, progress, batch_pairs)
                finally:
                    done = int(journal.done.sum()) // slices
                    kept = f"{done:,} of {len(position):,} nodes are kept in {journal_path.name}"
        except KeyboardInterrupt:
            raise Stopped(f"stopped; {kept}: give the same command again to continue") from None
        except Unwritable as error:
            raise InputError(f"{error}; {kept}: give the same command again to continue") from None
        except OSError as error:
            reason, more = (error.strerror or "it cannot be written").lower(), ""
            if kept:
                more = f"; {kept}: give the same command again to continue"
            room = "make room on its disk, or name another output"
            raise InputError(f"the output {path} cannot be written whole: {reason}; {room}{more}") from None


def _run(
    problem: Problem,
    position: Array,
    made: Provenance,
    path: Path,
    journal: Journal,
    shard: Shard,
    old: Edges,
    job: Job,
    used: int,
    progress: Callable[[Progress], None],
    batch_pairs: int,
) -> None:
    slices = len(problem.departures)
    nodes = np.arange(*shard.nodes(len(position)))
    tally, sample = Tally(len(nodes) * slices, used), StepSample(len(position))
    for edges in itertools.chain([old] if old.source.size else [], journal.records()):
        tally.add(edges)
        if slices == 1:
            sample.take(edges)
    made = sample.checked(made, problem, position, lambda one, some: job.finder(one, position, some, batch_pairs))
    known = journal.done.copy()
    twice = known[old.source].any()
    require(not twice, f"{journal.path} holds nodes that --from already covers; start again with --restart")
    known[old.source] = True
    waiting = nodes[~known[nodes * slices]]  # a node's departures are found together
    if waiting.size:
        if job.warm:
            warm_up(problem)
        for edges in job.finder(problem, position, waiting, batch_pairs):
            journal.append(edges)
            progress(tally.add(edges))
    departures = np.array(problem.departures) if slices > 1 else None
    with writing(path, position, lonlat_of(problem, position), made, shard, departures) as file:
        for edges in by_node(heapq.merge([old], journal.records(), key=_first)):
            file.append(edges)
        file.finish(tally)
    journal.remove()


def _first(edges: Edges) -> int:
    """Return the first node that the edges leave, or -1 if there are no edges."""
    return int(edges.source[0]) if edges.source.size else -1


def _taken_over(job: Job, rows: Index, slices: int) -> Edges:
    """Return, of these rows of edges, those of the nodes that an older roadmap has right."""
    if job.base is None:
        return in_order([])
    road, nodes = job.base
    counts = road.row_counts if isinstance(road, SlicedRoadmap) else road.node_counts
    assert counts is not None
    values = np.stack([getattr(road, name) for name in EDGE_FIELDS], axis=1)
    right = np.repeat(nodes, slices)
    every = Edges(np.arange(len(right)), np.diff(road.indptr), road.target, values, counts)
    mine = np.zeros(len(right), dtype=bool)
    mine[rows] = True
    return every.of(right & mine)


def merge(parts: Sequence[str | Path], output: str | Path) -> None:
    """Merge the shards of a roadmap into one file.

    InputError if a shard is missing, is given twice, or belongs to another roadmap.
    """
    check_output(output)
    require(len(parts) > 0, "there is nothing to merge; give the parts that `build --shard` wrote")
    heads = [(Path(path), read_part(path, edges=False)) for path in parts]
    first_path, first = heads[0]
    seen: dict[int, Path] = {}
    for path, part in heads:
        require(
            part.shard.count == first.shard.count,
            f"{path} is part {part.shard} but {first_path} is part {first.shard}; give parts with the same count",
        )
        mine, others = part.provenance.identity(), first.provenance.identity()
        unlike = [key for key in mine if mine[key] != others[key]]
        require(
            not unlike,
            f"{path} belongs to another roadmap than {first_path}: {', '.join(unlike)} differ; build both with "
            "the same scenario and software",
        )
        number = part.shard.number
        require(number not in seen, f"{path} and {seen.get(number)} are both part {part.shard}; leave one out")
        seen[number] = path
    lacks = [str(n) for n in range(1, first.shard.count + 1) if n not in seen]
    missing = f"part {lacks[0]}" if len(lacks) == 1 else f"parts {', '.join(lacks[:20])}"
    require(
        not lacks,
        f"{missing} of {first.shard.count} {'is' if len(lacks) == 1 else 'are'} missing; build and add it",
    )
    target = Path(output)
    require(
        all(target.resolve() != path.resolve() for path, _ in heads),
        f"the output {output} is one of the parts; name another",
    )
    with locked(target.resolve()):
        remove_abandoned(target.resolve())
        slices = 1 if first.departures is None else first.departures.size
        tally = Tally(len(first.position) * slices, max(part.threads for _, part in heads))
        what = first.position, first.lonlat, first.provenance, Shard(1, 1), first.departures
        with writing(target, *what) as file:
            for _, path in sorted(seen.items()):
                part = read_part(path)
                assert part.edges is not None
                tally.add(part.edges)
                file.append(part.edges)
            tally.seconds = sum(part.wall_s for _, part in heads)
            file.finish(tally)
