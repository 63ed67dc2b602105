"""Checks of packed files such as HDF5, which may come from anyone, before their data are read."""

import math
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import h5py

from .settings import require

MOST_RATIO = 1100
"""Deflate packs at most 1032 to 1. A file that declares more data for its size is damaged."""
FREE = 50_000_000
"""A declared size up to this [bytes] is not compared with the size of the file."""
MOST_OBJECTS = 10_000
"""Current files and roadmaps hold fewer groups and datasets than this."""


def check_file(path: str | Path, what: str) -> None:
    """Raise InputError if `what` is neither a file nor a folder: reading a pipe or a device may never end."""
    try:
        mode = Path(path).stat().st_mode
    except (OSError, ValueError):
        return  # the reader reports the error
    ordinary = stat.S_ISREG(mode) or stat.S_ISDIR(mode)
    require(ordinary, f"{what} {path} is a pipe or a device, not a file; save it as a file first")


def check_claim(file: str | Path, name: str, shape: Sequence[int], itemsize: int, held: int) -> None:
    """Raise InputError if data `name` declare more than a file of `held` bytes can hold.

    This is checked before memory is used.
    """
    claimed = math.prod(shape) * itemsize
    require(
        claimed <= max(FREE, MOST_RATIO * held),
        f"{file} is damaged: {name} claims {float(claimed):.3g} bytes, which {held:,} cannot hold; make it again",
    )


def check_links(path: str | Path) -> None:
    """Raise InputError if a file refers to other files: external links, external or virtual datasets.

    OSError or RuntimeError, from h5py, if it is damaged.
    """
    with h5py.File(path, "r") as file:
        for name, item in _objects(path, file):
            if isinstance(item, h5py.Dataset):
                inside = not item.external and not item.is_virtual
                cure = "lie in other files, which are not read: copy them into it"
                require(inside, f"the data of `{name}` in {path} {cure}")
                _check_storage(path, str(item.name).lstrip("/"), item)


def _objects(path: str | Path, file: h5py.File) -> Iterator[tuple[str, Any]]:
    """Yield each group and dataset of a file once, with its name; InputError at a link to another file."""
    seen: set[object] = set()
    waiting: list[h5py.Group] = [file]
    while waiting:
        group = waiting.pop()
        for name in group:
            link = group.get(name, getlink=True)
            cure = "but links are not followed: copy the data into it"
            within = not isinstance(link, h5py.ExternalLink)
            require(within, f"{path} links to another file at `{name}`, {cure}")
            if isinstance(link, h5py.SoftLink):
                continue
            item = group.get(name)
            if item is None or item.id in seen:
                continue
            seen.add(item.id)
            require(len(seen) <= MOST_OBJECTS, f"{path} holds more than {MOST_OBJECTS:,} objects; cut it")
            if isinstance(item, h5py.Group):
                waiting.append(item)
            yield name, item


def _check_storage(path: str | Path, name: str, dataset: h5py.Dataset) -> None:
    """Raise InputError if a dataset holds lists, whose lengths may be anything, or declares too much data."""
    inner = h5py.check_vlen_dtype(dataset.dtype)
    even = inner is None or inner in (str, bytes)
    require(even, f"`{name}` in {path} holds lists of uneven lengths, which are not read: write plain numbers")
    if dataset.shape is not None and inner is None:
        check_claim(path, f"`{name}`", dataset.shape, dataset.dtype.itemsize, dataset.id.get_storage_size())


def groups_of(path: str | Path) -> tuple[list[str], set[str]]:
    """Return the names of all groups, and of those with data of two or more dimensions; "" is the root."""
    every: list[str] = []
    grids: set[str] = set()

    def look(name: str, item: object) -> None:
        if isinstance(item, h5py.Group):
            every.append(name)
        elif isinstance(item, h5py.Dataset) and item.ndim >= 2:
            grids.add(name.rpartition("/")[0])

    with h5py.File(path, "r") as file:
        file.visititems(look)
    return every, grids
