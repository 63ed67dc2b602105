"""How kernels are compiled; the disk cache of entry points, keyed by the text of every kernel."""

import contextlib
import hashlib
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
from numba import njit
from numba.extending import overload, register_jitable

config: Any = numba.config  # its settings are made at run time


def _digest() -> str:
    text = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        text.update(source.name.encode() + b"\0" + source.read_bytes() + b"\0")
    return text.hexdigest()


KERNEL_DIGEST = _digest()
"""SHA-256 of all kernel sources: part of the cache's place, and stored in every roadmap."""


def _usable(folder: Path) -> bool:
    """Return whether compiled code can be kept in a folder, and no other user can have put code there."""
    try:
        # Python's own folder is read by all users; ours is not
        private = 0o777 if folder.parent.name == "__pycache__" else 0o700
        folder.parent.mkdir(parents=True, exist_ok=True, mode=private)
        folder.mkdir(exist_ok=True, mode=0o700)
        if not trusted(folder):
            return False
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def trusted(folder: Path) -> bool:
    """Return whether a folder is ours, and no other user can write there or replace it by another folder.

    Code that is loaded from it runs with our rights. Windows separates users by other means.
    """
    if os.name == "nt":
        return True
    me, shared = os.geteuid(), stat.S_IWGRP | stat.S_IWOTH
    itself, parent = folder.lstat(), folder.parent.stat()
    # in a folder with the sticky bit, such as /tmp, only the owner of an item moves it
    kept = not parent.st_mode & shared or bool(parent.st_mode & stat.S_ISVTX)
    mine = stat.S_ISDIR(itself.st_mode) and itself.st_uid == me and not itself.st_mode & shared
    return mine and kept and parent.st_uid in (0, me)


def _places() -> Iterator[Path]:
    """Yield folders for compiled kernels, the best first."""
    if config.CACHE_DIR:
        yield Path(config.CACHE_DIR)
    yield Path(__file__).parent / "__pycache__"
    # an account without a home folder, for example in a container, raises an error here
    with contextlib.suppress(RuntimeError):
        yield Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "glider-stream"
    with contextlib.suppress(OSError):
        user = os.geteuid() if os.name != "nt" else "cache"
        yield Path(tempfile.gettempdir()) / f"glider-stream-{user}"


def cache_folder() -> Path | None:
    """Return the folder for compiled kernels of this digest; None if no folder can be written and trusted."""
    return next((place / KERNEL_DIGEST[:16] for place in _places() if _usable(place / KERNEL_DIGEST[:16])), None)


ARITHMETIC: dict[str, Any] = {"error_model": "numpy"}
"""A division by zero gives inf or NaN: raising would put a branch beside each one."""
BARE: Any = ARITHMETIC | {"_nrt": False}
"""For kernels that make no array. Numba otherwise counts references to every array of a flow at every call, with
instructions that make the threads wait for each other: without them a look at a flight costs a third."""

making = njit(**ARITHMETIC | {"_nrt": True})
"""Compiles a kernel that makes an array."""
kernel = njit(**BARE)
"""Compiles a kernel that makes no array and takes no array that another kernel has made."""
inlined = njit(**BARE | {"inline": "always"})
"""Put in the place of its call, whatever it makes. A large kernel that is called once compiles sooner so: LLVM
meets its instructions once, and not again in every caller up to the entry point."""
shared = register_jitable(**BARE)
"""As `kernel` where a kernel calls it; Python runs it as it stands."""


def in_kernels(function: Callable[..., Any], table: dict[type, Callable[..., Any]]) -> None:
    """Let kernels call a function that chooses by its first argument's class: compiled, it is the table's row."""

    @overload(function, jit_options=BARE, strict=False)
    def chosen(first: Any, *others: Any) -> Any:
        return table.get(getattr(first, "instance_class", type(None)))


def entry_point(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a kernel that Python calls, cached on disk under the digest of all kernel sources.

    Numba's own cache looks at the file of the entry point alone: after an edit to any other kernel
    it would answer with old numbers. It reads `CACHE_DIR` once, when the function is decorated.
    """

    def compiled(function: Callable[..., Any]) -> Any:
        folder, before = cache_folder(), config.CACHE_DIR
        if folder is None:
            return njit(**ARITHMETIC, **options)(function)
        try:
            config.CACHE_DIR = str(folder)
            return njit(cache=True, **ARITHMETIC, **options)(function)
        finally:
            config.CACHE_DIR = before

    return compiled
