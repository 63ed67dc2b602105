"""Says when kernels are compiled, which takes long and happens once for each kind of current."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core.event import Event, Listener, install_listener

COMPILING = "compiling kernels, once for each kind of current; this takes a minute or so"


class _First(Listener):
    """Tells of the first compilation alone: a kernel's own kernels are compiled within it."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._told = False

    def on_start(self, event: Event) -> None:
        if not self._told:
            self._told = True
            self._tell(COMPILING)

    def on_end(self, event: Event) -> None:
        """Nothing is said at the end."""


@contextmanager
def telling_of_compiling(tell: Callable[[str], None]) -> Iterator[None]:
    """Call `tell` once in the block if a kernel is compiled there; what comes from the disk cache is not told."""
    with install_listener("numba:compile", _First(tell)):
        yield
