"""The roadmap file: HDF5, format version 1. Nothing else knows h5py."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .errors import InputError
from .kernels.edges import Status
from .roadmap import EDGE_FIELDS, Provenance, Roadmap
from .settings import require

FORMAT = "glider-stream/roadmap"
VERSION = 1

_DESCRIBED = {
    "nodes/position": ("f8", "m", "node position: x east, y north, z upward from the surface"),
    "nodes/lonlat": ("f8", "degrees", "node longitude and latitude"),
    "edges/indptr": ("i8", "1", "first edge of each source node, CSR"),
    "edges/target": ("i4", "1", "target node"),
    "edges/time": ("f8", "s", "time from departure to closest approach"),
    "edges/cost": ("f8", "s", "cost of the leg: travel time"),
    "edges/glide_angle": ("f8", "rad", "glide angle through water, negative dives"),
    "edges/heading": ("f8", "rad", "heading through water, counter-clockwise from east"),
    "edges/speed": ("f8", "m s-1", "speed through water along the glide path"),
    "edges/miss": ("f8", "m", "distance from the target at closest approach"),
}


def check_output(path: str | Path) -> None:
    """InputError unless a file can be made at `path`: before the work, not after it."""
    path = Path(path)
    try:
        path.stat()
    except FileNotFoundError:
        pass
    except OSError as error:
        raise InputError(f"the output {path} cannot be written: {error.strerror}; name another") from None
    require(not path.is_dir(), f"the output {path} is a folder; name a file")
    # a device such as /dev/null would be replaced by a file
    require(path.is_file() or not path.exists(), f"the output {path} is no ordinary file; name another")
    require(path.parent.is_dir(), f"the output folder {path.parent} does not exist; make it first")
    try:
        tempfile.TemporaryFile(dir=path.resolve().parent).close()
    except OSError as error:
        raise InputError(f"the output {path} cannot be written: {error.strerror}; name another") from None


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary name beside `path`, moved into its place when the block ends well, else removed.

    What the block cannot write, as where the disk is full, is an InputError that names `path`.
    """
    check_output(path)
    target = path.resolve()  # a link stays one
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=target.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files for their owner alone; an output is as readable as any new file
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, target)
    except OSError as error:
        reason = (error.strerror or "it cannot be written").lower()
        room = "make room on its disk, or name another output"
        raise InputError(f"the output {path} cannot be written whole: {reason}; {room}") from None
    finally:
        temporary.unlink(missing_ok=True)


def write_roadmap(roadmap: Roadmap, path: str | Path) -> None:
    """Write a roadmap file; an existing one is replaced at once, by a complete one, or not at all."""
    # made in memory: where the disk is full, HDF5 can neither write a file nor close it
    with h5py.File(Path(path).name, "w", driver="core", backing_store=False) as file:
        _write(file, roadmap)
        file.flush()
        image = file.id.get_file_image()
    with replacing(Path(path)) as temporary:
        temporary.write_bytes(image)


def _write(file: h5py.File, roadmap: Roadmap) -> None:
    arrays: dict[str, Any] = {"nodes/position": roadmap.position, "edges/indptr": roadmap.indptr}
    arrays |= {f"edges/{name}": getattr(roadmap, name) for name in ("target", *EDGE_FIELDS)}
    if roadmap.lonlat is not None:
        arrays["nodes/lonlat"] = roadmap.lonlat
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = VERSION
    for name, value in asdict(roadmap.provenance).items():
        file.attrs[name] = value
    for name, array in arrays.items():
        kind, unit, words = _DESCRIBED[name]
        # a dataset without elements cannot be chunked, and so not be checksummed
        checked = {"fletcher32": True, "chunks": True} if array.size else {}
        dataset = file.create_dataset(name, data=array.astype(kind), **checked)
        dataset.attrs["units"] = unit
        dataset.attrs["long_name"] = words
    pairs = file.create_group("pairs")
    pairs.attrs["evaluated"] = roadmap.evaluated
    for name, count in roadmap.counts.items():
        pairs.attrs[name] = count
    pairs.attrs["wall_s"] = roadmap.wall_s
    pairs.attrs["threads"] = roadmap.threads
    file.attrs["complete"] = True


def read_roadmap(path: str | Path) -> Roadmap:
    """Read a roadmap file; InputError where it is not one, newer, incomplete or damaged."""
    path = Path(path)
    require(path.exists(), f"the roadmap {path} does not exist; build it first")
    try:
        with h5py.File(path, "r") as file:
            return _read(file, path)
    except (OSError, RuntimeError) as error:
        reason = "a checksum fails" if "filter" in str(error) else "it is no HDF5 file, or it is cut short"
        if isinstance(error, OSError) and error.errno:
            reason = os.strerror(error.errno).lower()
        raise InputError(f"the roadmap {path} cannot be read: {reason}; build it again") from None
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"the roadmap {path} is damaged: {' '.join(str(error).split())}") from None


def _read(file: h5py.File, path: Path) -> Roadmap:
    said = file.attrs.get("format")
    what = "none" if said is None else repr(said)
    require(said == FORMAT, f"{path} is not a roadmap, its format is {what}; give a file that `build` wrote")
    version = int(file.attrs["format_version"])
    require(
        version == VERSION,
        f"the roadmap {path} has format version {version}, this program reads version {VERSION}; "
        + ("update the program" if version > VERSION else "build it again"),
    )
    complete = file.attrs.get("complete", False)
    require(
        isinstance(complete, np.bool_) and bool(complete), f"the roadmap {path} is incomplete; build it again"
    )
    arrays = {}
    for name, (kind, _, _) in _DESCRIBED.items():
        if name == "nodes/lonlat" and name not in file:
            continue
        require(name in file, f"the roadmap {path} is damaged: it has no dataset {name}; build it again")
        stored = np.asarray(file[name][()])
        fits = stored.dtype.kind == np.dtype(kind).kind
        require(fits, f"the roadmap {path} is damaged: {name} is {stored.dtype}, not {kind}; build it again")
        arrays[name] = stored.astype(kind)
        finite = bool(np.isfinite(arrays[name]).all())
        require(finite, f"the roadmap {path} is damaged: {name} holds NaN or infinity; build it again")
    position, indptr, target = arrays["nodes/position"], arrays["edges/indptr"], arrays["edges/target"]
    lonlat = arrays.get("nodes/lonlat")
    nodes, edges = len(position), target.size
    whole = (
        position.shape == (nodes, 3)
        and indptr.shape == (nodes + 1,)
        and indptr[0] == 0
        and indptr[-1] == edges
        and bool((np.diff(indptr) >= 0).all())
        and all(arrays[f"edges/{name}"].shape == (edges,) for name in EDGE_FIELDS)
        and target.shape == (edges,)
        and (edges == 0 or bool(target.min() >= 0 and target.max() < nodes))
        and (lonlat is None or lonlat.shape == (nodes, 2))
    )
    require(whole, f"the roadmap {path} is damaged: its datasets do not fit each other; build it again")
    for name in ("time", "cost", "speed", "miss"):
        sound = bool((arrays[f"edges/{name}"] >= 0).all())
        require(sound, f"the roadmap {path} is damaged: it holds a {name} below 0; build it again")
    step = np.diff(target.astype(np.int64))
    step[indptr[1:-1][(indptr[1:-1] > 0) & (indptr[1:-1] < edges)] - 1] = 1  # from one row to the next
    require(bool((step > 0).all()), f"the roadmap {path} is damaged: its targets do not rise; build it again")
    pairs = file["pairs"].attrs
    counts = {status.name.lower(): int(pairs.get(status.name.lower(), 0)) for status in Status}
    wall = float(pairs["wall_s"])
    counted = min(counts.values()) >= 0 and 0 <= wall < np.inf
    require(counted, f"the roadmap {path} is damaged: a count or its wall time makes no sense; build it again")
    return Roadmap(
        position=position,
        indptr=indptr,
        target=target,
        **{name: arrays[f"edges/{name}"] for name in EDGE_FIELDS},
        counts=counts,
        provenance=Provenance(
            seed=int(file.attrs["seed"]),
            **{f.name: str(file.attrs[f.name]) for f in fields(Provenance) if f.name != "seed"},
        ),
        wall_s=wall,
        threads=int(pairs["threads"]),
        lonlat=lonlat,
    )
