"""How kernels are compiled; the disk cache of entry points, keyed by the text of every kernel."""

import hashlib
import os
import tempfile
from collections.abc import Callable
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


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def cache_folder() -> Path | None:
    """Where compiled kernels of this digest are kept; None where no place can be written."""
    places = [Path(config.CACHE_DIR)] if config.CACHE_DIR else []
    places += [Path(__file__).parent / "__pycache__"]
    places += [Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "glider-stream"]
    return next((p / KERNEL_DIGEST[:16] for p in places if _writable(p / KERNEL_DIGEST[:16])), None)


ARITHMETIC: dict[str, Any] = {"error_model": "numpy"}
"""A division by zero gives inf or NaN: raising would put a branch beside each one."""
BARE: Any = ARITHMETIC | {"_nrt": False}
"""For kernels that make no array. Numba otherwise counts references to every array of a flow at every call, with
instructions that make the threads wait for each other: without them a look at a flight costs a third."""

making = njit(**ARITHMETIC | {"_nrt": True})
"""Compiles a kernel that makes an array."""
kernel = njit(**BARE)
"""Compiles a kernel that makes none, nor takes one that a callee has made."""
inlined = njit(**BARE | {"inline": "always"})
"""As `kernel`, and put in the place of its call."""
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
