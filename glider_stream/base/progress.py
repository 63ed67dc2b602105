"""Progress on standard error: a live bar on a terminal, a line now and then in a log."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

LOG_EVERY = 10.0
"""Seconds between the lines of a log."""


@contextmanager
def reporter(what: str) -> Iterator[Callable[[Any], None]]:
    """A callable that shows a `Progress`, for as long as the block runs."""
    if not sys.stderr.isatty():
        last = -LOG_EVERY

        def line(progress: Any) -> None:
            nonlocal last
            finished = progress.done >= progress.total
            if finished or time.monotonic() - last >= LOG_EVERY:
                print(f"{what}: {progress}", file=sys.stderr, flush=True)
                last = time.monotonic()

        yield line
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    with Progress(
        TextColumn(what), BarColumn(), TextColumn("{task.fields[state]}"), console=Console(stderr=True)
    ) as bar:
        task = bar.add_task(what, state="compiling")

        def update(progress: Any) -> None:
            bar.update(task, completed=progress.done, total=progress.total, state=str(progress))

        yield update
