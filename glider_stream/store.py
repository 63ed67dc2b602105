"""The roadmap file: HDF5, format version 1. Nothing else knows h5py."""

import contextlib
import io
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .kernels.edges import Status
from .roadmap import (
    BATCH_PAIRS,
    EDGE_FIELDS,
    Edges,
    Problem,
    Progress,
    Provenance,
    Roadmap,
    Tally,
    find_edges,
    lonlat_of,
    node_positions,
    provenance_of,
)
from .settings import require

Array = NDArray[Any]
FORMAT = "glider-stream/roadmap"
VERSION = 1
CHUNK = 32768
"""Edges in a chunk of a dataset, 256 kB: one is checked and cached whole."""

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


class Guarded(io.FileIO):
    """A file for HDF5 that takes whatever is written: HDF5 can close no file on a full disk.

    What went wrong first is kept in `error`, to be raised when HDF5 does not look.
    """

    error: OSError | None = None

    def write(self, part: Any) -> int:
        """Write all of `part`, or pretend to."""
        whole = memoryview(part).nbytes
        done = 0
        while self.error is None and done < whole:
            try:
                done += super().write(memoryview(part)[done:])
            except OSError as error:
                self.error = error
        return whole

    def check(self) -> None:
        """Raise what went wrong."""
        if self.error is not None:
            raise self.error


class RoadmapWriter:
    """An open roadmap file that takes its edges batch by batch, in the order of their source nodes."""

    def __init__(
        self, disk: Guarded, file: h5py.File, position: Array, lonlat: Array | None, made: Provenance
    ) -> None:
        """Write what is known before the edges are."""
        self._disk, self._file = disk, file
        self._waiting: list[Edges] = []
        self._degree: list[Array] = []
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = VERSION
        for name, value in asdict(made).items():
            file.attrs[name] = value
        self._put("nodes/position", position)
        if lonlat is not None:
            self._put("nodes/lonlat", lonlat)

    def append(self, edges: Edges) -> None:
        """Take the edges of the next nodes."""
        self._degree.append(edges.degree)
        self._waiting.append(edges)
        if sum(one.target.size for one in self._waiting) >= CHUNK:
            self._flush()

    def finish(self, tally: Tally) -> None:
        """Write what is known after the edges are, and declare the file complete."""
        self._flush()
        degree = np.concatenate([np.zeros(1, np.int64), *self._degree])
        self._put("edges/indptr", np.cumsum(degree))
        pairs = self._file.create_group("pairs")
        pairs.attrs["evaluated"] = sum(tally.counts.values())
        for name, count in tally.counts.items():
            pairs.attrs[name] = count
        pairs.attrs["wall_s"] = tally.wall_s
        pairs.attrs["threads"] = tally.threads
        self._file.attrs["complete"] = True

    def _flush(self) -> None:
        waiting, self._waiting = self._waiting, []
        values = np.concatenate([np.empty((0, len(EDGE_FIELDS))), *(one.values for one in waiting)])
        self._put("edges/target", np.concatenate([np.empty(0, np.int32), *(one.target for one in waiting)]))
        for n, name in enumerate(EDGE_FIELDS):
            self._put(f"edges/{name}", values[:, n])
        self._file.flush()
        self._disk.check()

    def _put(self, name: str, rows: Array) -> None:
        """Append rows to a dataset, which is made if there is none."""
        kind, unit, words = _DESCRIBED[name]
        if name in self._file:
            dataset = self._file[name]
            before = len(dataset)
            dataset.resize(before + len(rows), axis=0)
            dataset[before:] = rows
            return
        # checksums need chunks, and chunks an element
        chunks = (max(1, min(CHUNK, len(rows))), *rows.shape[1:])
        more = {"maxshape": (None, *rows.shape[1:]), "chunks": chunks, "fletcher32": True}
        dataset = self._file.create_dataset(name, data=np.asarray(rows, kind), **more)
        dataset.attrs["units"] = unit
        dataset.attrs["long_name"] = words


@contextlib.contextmanager
def _writing(
    path: str | Path, position: Array, lonlat: Array | None, made: Provenance
) -> Iterator[RoadmapWriter]:
    """A roadmap file in the making; at `path` when the block ends well, and not at all else."""
    with replacing(Path(path)) as temporary, Guarded(temporary, "w+") as disk:
        with h5py.File(disk, "w") as file:
            yield RoadmapWriter(disk, file, position, lonlat, made)
        disk.check()


def write_roadmap(roadmap: Roadmap, path: str | Path) -> None:
    """Write a roadmap file; an existing one is replaced at once, by a complete one, or not at all."""
    values = np.stack([getattr(roadmap, name) for name in EDGE_FIELDS], axis=1)
    with _writing(path, roadmap.position, roadmap.lonlat, roadmap.provenance) as file:
        file.append(Edges(np.diff(roadmap.indptr), roadmap.target, values))
        file.finish(Tally(roadmap.counts, roadmap.wall_s, roadmap.threads))


def build_file(
    problem: Problem,
    path: str | Path,
    thread_count: int | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
    batch_pairs: int = BATCH_PAIRS,
) -> None:
    """Build a problem's roadmap into a file, batch by batch: memory holds the nodes and one batch of edges."""
    position = node_positions(problem)
    with _writing(path, position, lonlat_of(problem, position), provenance_of(problem)) as file:
        file.finish(find_edges(problem, position, file.append, thread_count, progress, batch_pairs))


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
        arrays[name] = stored.astype(kind, copy=False)
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
    rises = target[1:] > target[:-1]
    rises[indptr[1:-1][(indptr[1:-1] > 0) & (indptr[1:-1] < edges)] - 1] = True  # from one row to the next
    require(bool(rises.all()), f"the roadmap {path} is damaged: its targets do not rise; build it again")
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
