"""Untrusted HDF5, and other packed files: what may not be followed, nor believed, before anything is read."""

import math
import stat
from collections.abc import Sequence
from pathlib import Path

import h5py

from .settings import require

MOST_RATIO = 1100
"""Deflate packs no better than 1032 to 1: data that claim more than that of their file are none."""
FREE = 50_000_000
"""Claims up to this size [bytes] need no proof."""
MOST_OBJECTS = 10_000
"""No current file and no roadmap holds as many groups and datasets."""


def check_file(path: str | Path, what: str) -> None:
    """InputError where `what` is neither a file nor a folder: reading a pipe or a device may never end."""
    try:
        mode = Path(path).stat().st_mode
    except (OSError, ValueError):
        return  # who reads it says what is wrong
    ordinary = stat.S_ISREG(mode) or stat.S_ISDIR(mode)
    require(ordinary, f"{what} {path} is a pipe or a device, and no file; save it as a file first")


def check_claim(file: str | Path, name: str, shape: Sequence[int], itemsize: int, held: int) -> None:
    """InputError, before room is made, if data `name` claim more than a file of `held` bytes can hold."""
    claimed = math.prod(shape) * itemsize
    require(
        claimed <= max(FREE, MOST_RATIO * held),
        f"{file} is damaged: {name} claims {float(claimed):.3g} bytes, which {held:,} cannot hold; make it again",
    )


def check_links(path: str | Path) -> None:
    """InputError where a file leads out of itself: external links, external or virtual datasets.

    OSError or RuntimeError, as h5py has them, where it is damaged.
    """
    seen: set[object] = set()
    with h5py.File(path, "r") as file:
        waiting: list[h5py.Group] = [file]
        while waiting:
            group = waiting.pop()
            for name in group:
                link = group.get(name, getlink=True)
                within = not isinstance(link, h5py.ExternalLink)
                require(within, f"{path} links to another file at `{name}`, which is not followed: copy it in")
                if isinstance(link, h5py.SoftLink):
                    continue
                one = group.get(name)
                if one is None or one.id in seen:
                    continue
                seen.add(one.id)
                require(len(seen) <= MOST_OBJECTS, f"{path} holds more than {MOST_OBJECTS:,} objects; cut it")
                if isinstance(one, h5py.Group):
                    waiting.append(one)
                elif isinstance(one, h5py.Dataset):
                    own = not one.external and not one.is_virtual
                    require(own, f"the data of `{name}` in {path} lie in other files, not followed: copy them in")
                    _check_storage(path, str(one.name).lstrip("/"), one)


def _check_storage(path: str | Path, name: str, dataset: h5py.Dataset) -> None:
    """InputError where a dataset is of lists, whose lengths may be anything, or larger than it can be."""
    inner = h5py.check_vlen_dtype(dataset.dtype)
    even = inner is None or inner in (str, bytes)
    require(even, f"`{name}` in {path} holds lists of uneven lengths, which are not read: write plain numbers")
    if dataset.shape is not None and inner is None:
        check_claim(path, f"`{name}`", dataset.shape, dataset.dtype.itemsize, dataset.id.get_storage_size())


def groups_of(path: str | Path) -> tuple[list[str], set[str]]:
    """The names of all groups of a file, and of those with data of two dimensions or more; "" is the root."""
    every: list[str] = []
    grids: set[str] = set()

    def look(name: str, one: object) -> None:
        if isinstance(one, h5py.Group):
            every.append(name)
        elif isinstance(one, h5py.Dataset) and one.ndim >= 2:
            grids.add(name.rpartition("/")[0])

    with h5py.File(path, "r") as file:
        file.visititems(look)
    return every, grids
