"""Says when kernels are compiled, which takes long and happens once for each kind of current."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core.caching import NullCache
from numba.core.event import Event, Listener, install_listener

from ..kernels.cache import cache_folder

COMPILING = "compiling kernels, once for each kind of current; this takes a minute or so"


class _First(Listener):
    """Tells of the first compilation of an entry point: its own kernels are compiled within it.

    A kernel that is not cached, though there is a cache, is no entry point: it is small, and compiled every time.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._told = False

    def on_start(self, event: Event) -> None:
        cached = not isinstance(event.data["dispatcher"]._cache, NullCache)
        if not self._told and (cached or cache_folder() is None):
            self._told = True
            self._tell(COMPILING)

    def on_end(self, event: Event) -> None:
        """Nothing is said at the end."""


@contextmanager
def telling_of_compiling(tell: Callable[[str], None]) -> Iterator[None]:
    """Call `tell` once in the block if a kernel is compiled there; what comes from the disk cache is not told."""
    with install_listener("numba:compile", _First(tell)):
        yield
