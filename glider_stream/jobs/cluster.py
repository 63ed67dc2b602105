"""Builds on a cluster: the workers of a Dask scheduler evaluate the same chunks of nodes."""

import contextlib
import importlib
import itertools
import math
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Index
from ..base.cores import usable_cores
from ..base.errors import InputError
from ..base.settings import require
from ..base.threads import threads
from ..kernels.cache import KERNEL_DIGEST
from ..roadmap.builder import find_edges, nodes_of_batch, warm_up
from ..roadmap.problem import Problem
from ..roadmap.roadmap import Edges

Given = TypeVar("Given")
Item = TypeVar("Item")
Result = TypeVar("Result")
AHEAD = 4
"""This many chunks wait at the scheduler for each thread of a worker."""
TRIES = 10
"""A chunk that has lost more workers than this has failed: the chunk itself may be the cause."""
COUNT_AGAIN = 1.0
"""The workers are counted again after this many seconds."""
WAIT = 60.0
"""Wait this many seconds for a scheduler and for its first worker."""
_ONE_AT_A_TIME = threading.Lock()
"""Kernels use all threads of a worker's process, so several Dask threads of a worker take turns."""


@dataclass(frozen=True)
class Work:
    """The data that a worker needs to evaluate nodes: the problem, its nodes (n, 3) [m], and the sender."""

    problem: Problem
    position: Array
    threads: int | None
    software: dict[str, str]


def software() -> dict[str, str]:
    """Return the versions that must be equal everywhere to get the same bits."""
    return {"kernels": KERNEL_DIGEST} | {
        name: version(name) for name in ("glider-stream", "numpy", "numba", "scipy")
    }


def check_software(asked: dict[str, str]) -> None:
    """Raise InputError, in a worker, unless its versions are as asked."""
    unlike = [
        f"{name} {version} and not {asked.get(name)}"
        for name, version in software().items()
        if version != asked.get(name)
    ]
    require(not unlike, f"a worker has {', '.join(unlike)}; install the same versions there")


def evaluate(work: Work, source: NDArray[np.int64]) -> Edges:
    """Return the edges from some nodes; this runs in a worker."""
    check_software(work.software)
    with _ONE_AT_A_TIME, threads(work.threads):
        warm_up(work.problem)
        [edges] = find_edges(work.problem, work.position, source, batch_pairs=2**62)
        return edges


def _distributed() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise InputError("--scheduler needs Dask distributed: pip install glider-stream[dask]") from None


@contextlib.contextmanager
def scheduler(address: str) -> Iterator["Cluster"]:
    """Yield the cluster of a Dask scheduler at an address; "local:N" starts N worker processes for the block."""
    distributed = _distributed()
    local = re.fullmatch(r"local:(\d{1,4})", address)
    if local is None:
        require(
            ":" in address, f"a scheduler is tcp://HOST:PORT, or local:N for N processes here; got {address!r}"
        )
        try:
            with distributed.Client(address, timeout=WAIT) as client:
                yield Cluster(client, None)
        except (OSError, TimeoutError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            message = " ".join(str(error).split())[:200]
            raise InputError(
                f"no Dask scheduler answers at {address} ({message}); start one, or correct the address"
            ) from None
        return
    count = int(local.group(1))
    require(count >= 1, f"a local cluster needs at least 1 worker; got {address!r}")
    each = max(1, usable_cores() // count)
    with (
        distributed.LocalCluster(
            n_workers=count, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield Cluster(client, each)


@dataclass(frozen=True)
class Cluster:
    """A client of a scheduler; the kernels of each worker use `threads` threads (None: all of its machine)."""

    client: Any
    threads: int | None

    def find_edges(self, problem: Problem, position: Array, source: Index, batch_pairs: int) -> Iterator[Edges]:
        """Yield edges as `roadmap.find_edges` does, in the order in which chunks are done.

        Chunks of a lost worker are done again.
        """
        yield from self._guarded(self._evaluated(problem, position, source, batch_pairs))

    def _evaluated(self, problem: Problem, position: Array, source: Index, batch_pairs: int) -> Iterator[Edges]:
        # degrees are computed here, so that the frame need not be sent
        work = Work(replace(problem, to_lonlat=None), position, self.threads, software())
        size = nodes_of_batch(problem, problem.legs(position), batch_pairs)
        yield from self._each(evaluate, work, np.array_split(source, range(size, len(source), size)))

    def each(
        self, function: Callable[[Given, Item], Result], work: Given, items: Iterable[Item]
    ) -> Iterator[Result]:
        """Yield `function(work, item)` of all items, from the workers, in the order in which they are done.

        Items of a lost worker are done again. InputError if the cluster fails.
        """
        yield from self._guarded(self._each(function, work, items))

    def _guarded(self, results: Iterator[Result]) -> Iterator[Result]:
        """Yield results; an error of the cluster becomes an InputError."""
        try:
            yield from results
        except InputError:
            raise
        except Exception as error:
            # Dask does not document what it raises when a worker, the scheduler or the network fails
            reason = " ".join(str(error).split())[:300].rstrip(".") or type(error).__name__
            raise InputError(
                f"the cluster failed: {reason}; give the same command to continue, here or with another scheduler"
            ) from None

    def _each(
        self, function: Callable[[Given, Item], Result], work: Given, items: Iterable[Item]
    ) -> Iterator[Result]:
        self.client.wait_for_workers(1, timeout=WAIT)
        sent = self.client.scatter(work, broadcast=True, hash=False)
        left = iter(items)
        waiting = _distributed().as_completed()
        counted, room = -math.inf, 0
        while True:
            if time.monotonic() - counted >= COUNT_AGAIN:
                # a worker that joins late gets its share
                counted, room = time.monotonic(), AHEAD * max(1, sum(self.client.nthreads().values()))
            for item in itertools.islice(left, max(0, room - waiting.count())):
                waiting.add(self.client.submit(function, sent, item, pure=False, retries=TRIES))
            if waiting.is_empty():
                return
            yield next(waiting).result()
