"""Progress on standard error: a live bar on a terminal, a line from time to time in a log."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import IO, Any, cast

from .terminal import Murmur, say

LOG_EVERY = 10.0
"""Seconds between the lines of a log."""


@contextmanager
def reporter(what: str) -> Iterator[Callable[[Any], None]]:
    """Yield a function that shows a `Progress`, during the block."""
    if not Murmur().isatty():
        last = -LOG_EVERY

        def line(progress: Any) -> None:
            nonlocal last
            finished = progress.done >= progress.total
            if finished or time.monotonic() - last >= LOG_EVERY:
                say(f"{what}: {progress}", error=True)
                last = time.monotonic()

        yield line
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    console = Console(file=cast(IO[str], Murmur()))
    with Progress(TextColumn(what), BarColumn(), TextColumn("{task.fields[state]}"), console=console) as bar:
        task = bar.add_task(what, state="compiling")

        def update(progress: Any) -> None:
            bar.update(task, completed=progress.done, total=progress.total, state=str(progress))

        yield update
