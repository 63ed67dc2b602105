"""Threads: kernels run without the interpreter's lock; each free thread takes the next few items."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numba

from .cores import usable_cores
from .settings import require

_CONFIG: Any = numba.config  # its attributes exist only at run time
_COUNT: ContextVar[int | None] = ContextVar("threads", default=None)


@contextmanager
def threads(count: int | None) -> Iterator[int]:
    """Run kernels in the block on `count` threads (None: all that this process may use); yield the number."""
    most = max(usable_cores(), int(_CONFIG.NUMBA_NUM_THREADS))
    fits = count is None or 1 <= count <= most
    require(fits, f"`threads` must be from 1 to {most} on this machine; got {count}")
    used = count or usable_cores()
    before = _COUNT.set(used)
    try:
        yield used
    finally:
        _COUNT.reset(before)


def thread_count() -> int:
    """Return the number of threads that kernels use here."""
    return _COUNT.get() or usable_cores()


def in_parallel(kernel: Callable[[int, int], object], count: int, at_once: int) -> None:
    """Call `kernel(first, last)` until items 0 to count - 1 are done, `at_once` items in a call.

    The kernel writes only to the rows of its items, so results depend neither on threads nor on `at_once`.
    """
    spans = [(first, min(first + at_once, count)) for first in range(0, count, at_once)]
    workers = min(thread_count(), len(spans))
    if workers <= 1:
        for span in spans:
            kernel(*span)
        return
    pool = ThreadPoolExecutor(workers)
    try:
        for _ in pool.map(lambda span: kernel(*span), spans):
            pass
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
