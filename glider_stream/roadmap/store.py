"""The roadmap file: HDF5, format versions 1 and 2 (many departures). Only this module uses h5py for it."""

import contextlib
import hashlib
import io
import os
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Index
from ..base.errors import InputError, Unwritable
from ..base.output import replacing
from ..base.settings import require
from ..base.terminal import plain
from ..base.untrusted import check_claim, check_file, check_links
from ..kernels.edges import Status
from .builder import Tally
from .roadmap import EDGE_FIELDS, BaseRoadmap, Edges, Provenance, Roadmap
from .rows import Blend, EdgeRows, Span
from .shard import Part, Shard
from .slices import SlicedRoadmap

AnyArray = NDArray[Any]
FORMAT = "glider-stream/roadmap"
PART_FORMAT = "glider-stream/roadmap-part"
VERSION, SLICED_VERSION = 1, 2
"""The format versions of a roadmap of one departure, and of several; see docs/roadmap-format.md."""
CHUNK = 32768
"""A chunk of a dataset has this many edges, 256 kB; HDF5 checks and caches whole chunks."""
CHECKED = 16 * CHUNK
"""When a file is checked, this many rows are read back at a time."""

_DESCRIBED = {
    "nodes/position": ("f8", "m", "node position: x east, y north, z upward from the surface"),
    "nodes/lonlat": ("f8", "degrees", "node longitude and latitude"),
    "slices/departure": ("f8", "s", "departure of each slice since the epoch"),
    "edges/indptr": ("i8", "1", "first edge of each source node, CSR; of several slices of each node and slice"),
    "edges/target": ("i4", "1", "target node"),
    "edges/time": ("f8", "s", "time from departure to closest approach"),
    "edges/cost": ("f8", "", "cost of the leg: its travel time, or the energy that it takes"),
    "edges/glide_angle": ("f8", "rad", "glide angle through water, negative dives"),
    "edges/heading": ("f8", "rad", "heading through water, counter-clockwise from east"),
    "edges/speed": ("f8", "m s-1", "speed through water along the glide path"),
    "edges/miss": ("f8", "m", "distance from the target at closest approach"),
    "pairs/by_node": ("i4", "1", "pairs of each row of edges by status, named by the attribute `statuses`"),
}
RARE = (Status.CARRIED_AWAY,)
"""The last statuses, which only flows with a vertical part know: a file names them where it counts a pair."""
_OPTIONAL = {"nodes/lonlat", "pairs/by_node"}
_SLICES = "slices/departure"
_NEVER_BELOW_0 = {"time", "cost", "speed", "miss"}


class Guarded(io.FileIO):
    """A file for HDF5 in which writing never fails, because HDF5 cannot close a file on a full disk.

    The first error is kept in `error`; `check` raises it later, outside of HDF5.
    """

    error: OSError | None = None

    def write(self, part: Any) -> int:
        """Write all of `part`; after an error nothing is written, but the full size is returned."""
        whole = memoryview(part).nbytes
        done = 0
        while self.error is None and done < whole:
            try:
                done += super().write(memoryview(part)[done:])
            except OSError as error:
                self.error = error
        return whole

    def flush(self) -> None:
        """Do nothing: HDF5 calls this, but the file has no buffer."""

    def check(self) -> None:
        """Raise the first error, if there was one."""
        if self.error is not None:
            raise self.error


class RoadmapWriter:
    """An open roadmap file that takes its edges batch by batch, in the order of their source nodes."""

    def __init__(
        self,
        disk: Guarded,
        file: h5py.File,
        position: AnyArray,
        lonlat: AnyArray | None,
        made: Provenance,
        shard: Shard,
        departures: AnyArray | None,
    ) -> None:
        """Write everything that is known before the edges."""
        self._disk, self._file = disk, file
        self._unit = made.cost_unit
        self._waiting: list[Edges] = []
        self._degree: list[AnyArray] = []
        self._counts: list[AnyArray] = []
        slices = 1 if departures is None else len(departures)
        self._next, self._last = shard.rows(len(position), slices)
        self.digests: dict[str, Any] = {}
        file.attrs["format"] = FORMAT if shard.whole else PART_FORMAT
        if not shard.whole:
            file.attrs["shard"] = str(shard)
        file.attrs["format_version"] = VERSION if departures is None else SLICED_VERSION
        for name, value in asdict(made).items():
            file.attrs[name] = value
        self._put("nodes/position", position)
        if lonlat is not None:
            self._put("nodes/lonlat", lonlat)
        if departures is not None:
            self._put(_SLICES, departures)

    def append(self, edges: Edges) -> None:
        """Take the edges of the next rows, node by node; RuntimeError if they are other rows, which is a bug."""
        follows = np.array_equal(edges.source, np.arange(self._next, self._next + edges.source.size))
        whole = edges.degree.sum() == edges.target.size == len(edges.values)
        if not follows or not whole:
            raise RuntimeError(
                f"edges of nodes from {self._next:,} on are missing, or stand twice; no file is made"
            )
        self._next += edges.source.size
        self._degree.append(edges.degree)
        self._counts.append(edges.counts)
        self._waiting.append(edges)
        if sum(edges.target.size for edges in self._waiting) >= CHUNK:
            self._flush()

    def finish(self, tally: Tally) -> None:
        """Write everything that is known after the edges, and mark the file as complete."""
        self._flush()
        if self._next != self._last:
            raise RuntimeError(f"the edges of node {self._next:,} are missing; no file is made")
        degree = np.concatenate([np.zeros(1, np.int64), *self._degree])
        self._put("edges/indptr", np.cumsum(degree))
        counts = np.concatenate([np.empty((0, len(Status)), np.int32), *self._counts])
        named = [status for status in Status if status not in RARE or tally.counts[status] > 0]
        by_name = {name: tally.by_name()[name] for name in (status.name.lower() for status in named)}
        self._put("pairs/by_node", counts[:, named])
        self._file["pairs/by_node"].attrs["statuses"] = " ".join(by_name)
        pairs = self._file["pairs"]
        pairs.attrs["evaluated"] = sum(by_name.values())
        for name, count in by_name.items():
            pairs.attrs[name] = count
        pairs.attrs["wall_s"] = tally.seconds
        pairs.attrs["threads"] = tally.threads
        self._file.attrs["complete"] = True

    def _flush(self) -> None:
        waiting, self._waiting = self._waiting, []
        values = np.concatenate([np.empty((0, len(EDGE_FIELDS))), *(edges.values for edges in waiting)])
        self._put("edges/target", np.concatenate([np.empty(0, np.int32), *(edges.target for edges in waiting)]))
        for n, name in enumerate(EDGE_FIELDS):
            self._put(f"edges/{name}", values[:, n])
        self._file["edges/cost"].attrs["units"] = self._unit
        self._file.flush()
        self._disk.check()

    def _put(self, name: str, rows: AnyArray) -> None:
        """Append rows to a dataset; the dataset is made if it does not exist."""
        kind, unit, description = _DESCRIBED[name]
        rows = np.ascontiguousarray(rows, kind)
        self.digests.setdefault(name, hashlib.blake2b()).update(rows.tobytes())
        if name in self._file:
            dataset = self._file[name]
            before = len(dataset)
            dataset.resize(before + len(rows), axis=0)
            dataset[before:] = rows
            return
        # checksums need chunks, and a chunk has at least one element
        chunks = (max(1, min(CHUNK, len(rows))), *rows.shape[1:])
        more = {"maxshape": (None, *rows.shape[1:]), "chunks": chunks, "fletcher32": True}
        dataset = self._file.create_dataset(name, data=rows, **more)
        dataset.attrs["units"] = unit
        dataset.attrs["long_name"] = description


@contextlib.contextmanager
def writing(
    path: str | Path,
    position: AnyArray,
    lonlat: AnyArray | None,
    made: Provenance,
    shard: Shard,
    departures: AnyArray | None = None,
) -> Iterator[RoadmapWriter]:
    """Yield the writer of a roadmap file; the file appears at `path` only if the block ends well.

    With `departures` (slices,) [s] the file has several slices.
    """
    with replacing(Path(path)) as temporary, Guarded(temporary, "w+") as disk:
        with h5py.File(disk, "w") as file:
            writer = RoadmapWriter(disk, file, position, lonlat, made, shard, departures)
            yield writer
        disk.check()
        _check_written(temporary, Path(path), writer.digests)


def _check_written(temporary: Path, path: Path, digests: dict[str, Any]) -> None:
    """Raise Unwritable unless a finished file reads back bit by bit as written; no file is replaced before."""
    with h5py.File(temporary, "r") as file:
        for name, digest in digests.items():
            dataset, read = file[name], hashlib.blake2b()
            for first in range(0, len(dataset), CHECKED):
                read.update(dataset[first : first + CHECKED].tobytes())
            if read.digest() != digest.digest():
                raise Unwritable(f"the output {path} cannot be written whole: its {name} reads back otherwise")


def write_roadmap(roadmap: Roadmap | SlicedRoadmap, path: str | Path) -> None:
    """Write a roadmap file; an existing file is replaced by the complete new one, or stays as it is.

    Examples:
        >>> roadmap = glider_stream.read_roadmap("small.h5")
        >>> glider_stream.write_roadmap(roadmap, "copy.h5")
    """
    values = np.stack([getattr(roadmap, name) for name in EDGE_FIELDS], axis=1)
    known, departures = None, None
    if isinstance(roadmap, SlicedRoadmap):
        known, departures = roadmap.row_counts, roadmap.departures
    else:
        known = roadmap.node_counts
    rows = len(roadmap.indptr) - 1
    counts = np.zeros((rows, len(Status)), np.int32) if known is None else known
    by_status = np.array([roadmap.counts[s.name.lower()] for s in Status])
    tally = Tally(rows, roadmap.threads, by_status, roadmap.wall_s)
    what = roadmap.position, roadmap.lonlat, roadmap.provenance, Shard(1, 1), departures
    with writing(path, *what) as file:
        file.append(Edges(np.arange(rows), np.diff(roadmap.indptr), roadmap.target, values, counts))
        file.finish(tally)


def read_roadmap(path: str | Path) -> Roadmap:
    """Read the file of a roadmap of one departure; InputError if it is another file, newer or damaged.

    Examples:
        >>> glider_stream.read_roadmap("small.h5").target.size
        929
    """
    roadmap = read_any_roadmap(path)
    if isinstance(roadmap, SlicedRoadmap):
        first, last = roadmap.departures[[0, -1]]
        raise InputError(
            f"the roadmap {path} is of {roadmap.departures.size} departures, from {first:g} s to {last:g} s, and "
            "this takes one; `query` and `info` read it, or build it without [departures]"
        )
    return roadmap


def read_any_roadmap(path: str | Path) -> Roadmap | SlicedRoadmap:
    """Read a roadmap file of one departure or of several; InputError if it is another file or damaged."""
    path = Path(path)
    with _reading(path) as file:
        _check_head(file, path, FORMAT)
        departures = _departures(file, path)
        arrays = _arrays(file, path, _names())
        slices = 1 if departures is None else departures.size
        _with_every_status(arrays)
        _check_edges(arrays, len(arrays["nodes/position"]) * slices, path)
        wall, used = _effort(file, path)
        whole: dict[str, Any] = {
            "position": arrays["nodes/position"],
            "indptr": arrays["edges/indptr"],
            "target": arrays["edges/target"],
            **{name: arrays[f"edges/{name}"] for name in EDGE_FIELDS},
            "counts": _counts(file, path),
            "provenance": _provenance(file),
            "wall_s": wall,
            "threads": used,
            "lonlat": arrays.get("nodes/lonlat"),
            "file": path,
        }
        by_row = arrays.get("pairs/by_node")
        if departures is None:
            return Roadmap(**whole, node_counts=by_row)
        return SlicedRoadmap(**whole, departures=departures, row_counts=by_row)
    raise AssertionError  # never reached, because _reading raises


@dataclass(frozen=True)
class StoredRoadmap(BaseRoadmap):
    """A roadmap that stays in its `file`; nodes `position` (n, 3) [m] and rows `indptr` are in memory.

    `departures` (slices,) [s] are those of its slices, None for a roadmap of one departure. `identity` is that of
    the file when it was opened. Other fields: see `Roadmap`. Damage in a part that is never read is not found.
    """

    position: Array
    indptr: Index
    counts: dict[str, int]
    provenance: Provenance
    wall_s: float
    threads: int
    departures: Array | None
    file: Path
    identity: tuple[int, ...]
    elsewhere: tuple[str, ...] = ()

    def whole(self) -> Roadmap | SlicedRoadmap:
        """Read all of it; InputError if it is damaged, or if the file is another one by now."""
        _check_same(self.file, self.identity)
        return replace(read_any_roadmap(self.file), elsewhere=self.elsewhere)

    def rows(self, blend: Blend) -> EdgeRows:
        """Return the edges for a search that makes a sum least; they are read when the search needs them."""
        source = _StoredEdges(self.file, self.identity, len(self.position), blend)
        return EdgeRows.on_demand(self.indptr, CHUNK, source)

    def targets(self, edges: Index) -> NDArray[np.int32]:
        """Return the targets of some edges (n,); InputError if they are damaged."""
        found = self._some("edges/target", edges).astype(np.int32, copy=False)
        _check_nodes(found, len(self.position), self.file)
        return found

    def legs(self, edges: Index) -> Array:
        """Return the values (n, 6) of some edges (n,), in the order of EDGE_FIELDS; InputError if damaged."""
        return np.column_stack([self._some(f"edges/{name}", edges) for name in EDGE_FIELDS])

    def _some(self, name: str, edges: Index) -> AnyArray:
        """Return a dataset's values of some edges (n,); each block of the file is read once."""
        _check_same(self.file, self.identity)  # so its links are checked already
        order = np.argsort(edges, kind="stable")
        found = np.empty(edges.size, _DESCRIBED[name][0])
        with _errors_of(self.file), h5py.File(self.file, "r") as file:
            dataset = file[name]
            for some in np.split(order, np.flatnonzero(np.diff(edges[order] // CHUNK)) + 1):
                if some.size:
                    first = int(edges[some[0]]) // CHUNK * CHUNK
                    found[some] = dataset[first : first + CHUNK][edges[some] - first]
        _check_values(name, found, self.file)
        return found


KeptRoadmap = Roadmap | SlicedRoadmap | StoredRoadmap
"""A roadmap, in memory or in its file."""
LARGE = 64 * CHUNK
"""A roadmap of more edges than this, 100 MB, stays in its file when it is opened."""


def opened_roadmap(path: str | Path) -> Roadmap | StoredRoadmap:
    """Return a roadmap file as queries use it: if it is large or of several departures, it stays in its file."""
    with _reading(Path(path)) as file:
        _check_head(file, Path(path), FORMAT)
        several = int(file.attrs["format_version"]) == SLICED_VERSION
        large = _declared(file, Path(path), "edges/target").size > LARGE
    return stored_roadmap(path) if several or large else read_roadmap(path)


def stored_roadmap(path: str | Path) -> StoredRoadmap:
    """Return a roadmap file of which edges are read when they are needed; InputError as `read_any_roadmap`."""
    path = Path(path)
    with _reading(path) as file:
        _check_head(file, path, FORMAT)
        departures = _departures(file, path)
        arrays = _arrays(file, path, ["nodes/position", "edges/indptr"])
        position, indptr = arrays["nodes/position"], arrays["edges/indptr"]
        slices = 1 if departures is None else departures.size
        edges = _declared(file, path, "edges/target").shape
        _check_shapes(path, position, indptr, edges, len(position) * slices)
        for name in EDGE_FIELDS:
            fits = _declared(file, path, f"edges/{name}").shape == edges
            require(fits, f"the roadmap {path} is damaged: its datasets do not fit each other; build it again")
        made = _counts(file, path), _provenance(file), *_effort(file, path)
        return StoredRoadmap(position, indptr, *made, departures, path, _identity(path))
    raise AssertionError  # never reached, because _reading raises


@dataclass(frozen=True)
class _StoredEdges:
    """The edges of a roadmap file among so many `nodes`; `identity` is that of the file when it was opened."""

    path: Path
    identity: tuple[int, ...]
    nodes: int
    blend: Blend

    def read(self, spans: Sequence[Span], target: NDArray[np.int32], weight: Array) -> None:
        """Read targets and weights of some spans; InputError if the file is another one by now."""
        _check_same(self.path, self.identity)  # so its links are checked already
        with _errors_of(self.path), h5py.File(self.path, "r") as file:
            for first, last in spans:
                target[first:last] = file["edges/target"][first:last]
                weight[first:last] = self.blend.read(partial(self._column, file, slice(first, last)))

    def _column(self, file: h5py.File, some: slice, name: str) -> Array:
        values: Array = file[f"edges/{name}"][some]
        _check_values(f"edges/{name}", values, self.path)
        return values

    def check(self, span: Span, indptr: Index, target: NDArray[np.int32], weight: Array) -> None:
        """Raise InputError unless the targets are nodes that rise within a row."""
        to = target[slice(*span)]
        _check_nodes(to, self.nodes, self.path)
        begins = indptr[np.searchsorted(indptr, span[0]) : np.searchsorted(indptr, span[1])] - span[0]
        _check_rises(to, begins, self.path)


def _check_nodes(target: NDArray[np.int32], nodes: int, path: Path) -> None:
    """Raise InputError unless targets are among so many nodes."""
    among = target.size == 0 or bool(target.min() >= 0 and target.max() < nodes)
    require(among, f"the roadmap {path} is damaged: a target is no node; build it again")


def _identity(path: Path) -> tuple[int, ...]:
    """Return what changes if a file is replaced or written again."""
    stat = path.stat()
    return stat.st_dev, stat.st_ino, stat.st_size, stat.st_mtime_ns


def _check_same(path: Path, identity: tuple[int, ...]) -> None:
    same = path.exists() and _identity(path) == identity
    require(same, f"the roadmap {path} has been replaced since it was opened; open it again")


def _names() -> list[str]:
    """Return the names of the datasets that every version may have."""
    return [name for name in _DESCRIBED if name != _SLICES]


def _departures(file: h5py.File, path: Path) -> AnyArray | None:
    """Return the departures (slices,) [s] of a file; None if the file has only one departure."""
    if int(file.attrs["format_version"]) == VERSION:
        return None
    times = _arrays(file, path, [_SLICES])[_SLICES]
    rises = times.ndim == 1 and times.size > 0 and bool((np.diff(times) > 0).all())
    require(rises, f"the roadmap {path} is damaged: its departures do not rise; build it again")
    return times


def read_part(path: str | Path, edges: bool = True) -> Part:
    """Read a shard's file, only its head if `edges` is False; InputError if it is another file or damaged."""
    path = Path(path)
    with _reading(path) as file:
        _check_head(file, path, PART_FORMAT)
        number, _, count = str(file.attrs["shard"]).partition("/")
        shard = Shard(int(number), int(count))
        require(
            1 <= shard.number <= shard.count, f"the part {path} is damaged: it says it is {shard}; build it again"
        )
        departures = _departures(file, path)
        arrays = _arrays(file, path, _names() if edges else ["nodes/position", "nodes/lonlat"])
        slices = 1 if departures is None else departures.size
        nodes = np.arange(*shard.rows(len(arrays["nodes/position"]), slices))
        found = None
        if edges:
            _with_every_status(arrays)
            _check_edges(arrays, len(nodes), path)
            values = np.stack([arrays[f"edges/{name}"] for name in EDGE_FIELDS], axis=1)
            require(
                "pairs/by_node" in arrays, f"the part {path} is damaged: it has no pairs/by_node; build it again"
            )
            degree = np.diff(arrays["edges/indptr"])
            found = Edges(nodes, degree, arrays["edges/target"], values, arrays["pairs/by_node"])
        made = _provenance(file)
        places = arrays["nodes/position"], arrays.get("nodes/lonlat")
        return Part(shard, made, *places, found, *_effort(file, path), departures)
    raise AssertionError  # _reading raises


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[h5py.File]:
    """Yield an open roadmap file after checks of its links; see `_errors_of`."""
    require(path.exists(), f"the roadmap {path} does not exist; build it first")
    check_file(path, "the roadmap")
    with _errors_of(path):
        check_links(path)
        with h5py.File(path, "r") as file:
            yield file


@contextlib.contextmanager
def _errors_of(path: Path) -> Iterator[None]:
    """Turn every error that h5py raises on a damaged file into an InputError."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        reason = "a checksum fails" if "filter" in str(error) else "it is no HDF5 file, or it is cut short"
        if isinstance(error, OSError) and error.errno:
            reason = os.strerror(error.errno).lower()
        raise InputError(f"the roadmap {path} cannot be read: {reason}; build it again") from None
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"the roadmap {path} is damaged: {' '.join(str(error).split())}") from None


def _check_head(file: h5py.File, path: Path, wanted: str) -> None:
    found = file.attrs.get("format")
    if found == PART_FORMAT and wanted == FORMAT:
        shard = str(file.attrs.get("shard"))
        raise InputError(f"{path} is part {shard} of a roadmap; make it whole with `glider-stream merge`")
    what, command = "none" if found is None else repr(found), "build" if wanted == FORMAT else "build --shard"
    noun = "a roadmap" if wanted == FORMAT else "a part of a roadmap"
    require(found == wanted, f"{path} is not {noun}, its format is {what}; give a file that `{command}` wrote")
    version = int(file.attrs["format_version"])
    require(
        version in (VERSION, SLICED_VERSION),
        f"the roadmap {path} has format version {version}, this program reads versions {VERSION} and "
        f"{SLICED_VERSION}; " + ("update the program" if version > SLICED_VERSION else "build it again"),
    )
    complete = file.attrs.get("complete", False)
    require(
        isinstance(complete, np.bool_) and bool(complete), f"the roadmap {path} is incomplete; build it again"
    )


def _arrays(file: h5py.File, path: Path, names: list[str]) -> dict[str, AnyArray]:
    """Return the datasets by name, after checks of their types and of their sizes against the file's size."""
    arrays: dict[str, AnyArray] = {}
    for name in names:
        kind = _DESCRIBED[name][0]
        if name in _OPTIONAL and name not in file:
            continue
        stored = np.asarray(_declared(file, path, name)[()])
        arrays[name] = stored.astype(kind, copy=False)
        _check_values(name, arrays[name], path)
    return arrays


def _declared(file: h5py.File, path: Path, name: str) -> h5py.Dataset:
    """Return a dataset after checks of its type, and of its size against the file's size."""
    kind = _DESCRIBED[name][0]
    require(name in file, f"the roadmap {path} is damaged: it has no dataset {name}; build it again")
    dataset = file[name]
    fits = isinstance(dataset, h5py.Dataset) and dataset.dtype.kind == np.dtype(kind).kind
    found = getattr(dataset, "dtype", "a group")
    require(fits, f"the roadmap {path} is damaged: {name} is {found}, not {kind}; build it again")
    check_claim(path, name, dataset.shape, dataset.dtype.itemsize, dataset.id.get_storage_size())
    return dataset


def _check_values(name: str, values: AnyArray, path: Path) -> None:
    """Raise InputError if a dataset holds NaN, infinity, or values below 0 where there are none."""
    finite = bool(np.isfinite(values).all())
    require(finite, f"the roadmap {path} is damaged: {name} holds NaN or infinity; build it again")
    what = name.rpartition("/")[2]
    sound = what not in _NEVER_BELOW_0 or bool((values >= 0).all())
    require(sound, f"the roadmap {path} is damaged: it holds a {what} below 0; build it again")


def _with_every_status(arrays: dict[str, AnyArray]) -> None:
    """Put zeros, in place, for the last statuses where a file does not name them."""
    counts = arrays.get("pairs/by_node")
    if counts is not None and counts.ndim == 2 and counts.shape[1] == len(Status) - len(RARE):
        arrays["pairs/by_node"] = np.pad(counts, ((0, 0), (0, len(RARE))))


def _check_edges(arrays: dict[str, AnyArray], rows: int, path: Path) -> None:
    """Raise InputError unless the datasets fit each other and hold edges of `rows` rows among the nodes."""
    position, indptr, target = arrays["nodes/position"], arrays["edges/indptr"], arrays["edges/target"]
    lonlat, counts = arrays.get("nodes/lonlat"), arrays.get("pairs/by_node")
    nodes, edges = len(position), target.size
    _check_shapes(path, position, indptr, target.shape, rows)
    whole = (
        all(arrays[f"edges/{name}"].shape == (edges,) for name in EDGE_FIELDS)
        and (edges == 0 or bool(target.min() >= 0 and target.max() < nodes))
        and (lonlat is None or lonlat.shape == (nodes, 2))
        and (counts is None or (counts.shape == (rows, len(Status)) and bool((counts >= 0).all())))
    )
    require(whole, f"the roadmap {path} is damaged: its datasets do not fit each other; build it again")
    _check_rises(target, indptr[:-1], path)


def _check_shapes(path: Path, position: AnyArray, indptr: AnyArray, edges: tuple[int, ...], rows: int) -> None:
    """Raise InputError unless nodes and the ends of `rows` rows fit edges of a shape."""
    whole = (
        position.shape == (len(position), 3)
        and indptr.shape == (rows + 1,)
        and indptr[0] == 0
        and edges == (indptr[-1],)
        and bool((np.diff(indptr) >= 0).all())
    )
    require(whole, f"the roadmap {path} is damaged: its datasets do not fit each other; build it again")


def _check_rises(target: AnyArray, begins: AnyArray, path: Path) -> None:
    """Raise InputError unless targets rise, except from one row to the next; rows begin at some edges."""
    rises = target[1:] > target[:-1]
    rises[begins[(begins > 0) & (begins < target.size)] - 1] = True
    require(bool(rises.all()), f"the roadmap {path} is damaged: its targets do not rise; build it again")


def _counts(file: h5py.File, path: Path) -> dict[str, int]:
    """Return the number of pairs by the name of their status."""
    pairs = file["pairs"].attrs
    counts = {status.name.lower(): int(pairs.get(status.name.lower(), 0)) for status in Status}
    counted = min(counts.values()) >= 0
    require(counted, f"the roadmap {path} is damaged: a count of its pairs makes no sense; build it again")
    return counts


def _effort(file: h5py.File, path: Path) -> tuple[float, int]:
    """Return the wall time [s] and the number of threads of a build."""
    pairs = file["pairs"].attrs
    wall, used = float(pairs["wall_s"]), int(pairs["threads"])
    require(0 <= wall < np.inf, f"the roadmap {path} is damaged: its wall time makes no sense; build it again")
    return wall, used


def _provenance(file: h5py.File) -> Provenance:
    attributes = file.attrs
    values = {
        f.name: attributes[f.name] if f.default is MISSING else attributes.get(f.name, f.default)
        for f in fields(Provenance)
    }
    seed = int(values.pop("seed"))
    # all values except these two are single lines that are printed
    texts = {n: str(v) if n in ("scenario", "inputs") else plain(str(v)) for n, v in values.items()}
    return Provenance(seed=seed, **texts)
