"""The journal of a build: keeps what was found, safe from the end of the process, until the roadmap is whole."""

import hashlib
import json
import os
import stat
import struct
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ..base.arrays import Index
from ..base.errors import InputError
from ..base.settings import require
from ..roadmap.roadmap import EMPTY, Edges

MAGIC = b"glider-stream/journal 1\n"
RECORD = struct.Struct("<4sQQd")
"""The head of a record: mark, number of nodes, number of edges, seconds.

After it come the arrays of `Edges` and a digest of everything.
"""
MARK = b"edge"
DIGEST = 16
LONGEST_HEADER = 100_000
BINARY = getattr(os, "O_BINARY", 0)
"""Without this flag Windows would write a carriage return before each byte 10."""


def _sizes(nodes: int, edges: int) -> list[tuple[tuple[int, ...], np.dtype[Any]]]:
    count = (nodes, nodes, edges, edges, nodes)
    return [((n, *shape), np.dtype(kind)) for n, (shape, kind) in zip(count, EMPTY, strict=True)]


class Journal:
    """Records of `Edges`, each written whole or not at all; `done` tells which nodes they hold.

    An unfinished record that a kill leaves is cut off. `every` [s]: how often the disk is asked to keep what was
    written, against a loss of power. If only the process is lost, nothing written is lost.
    """

    def __init__(
        self, path: Path, identity: Mapping[str, Any], nodes: Index, restart: bool, every: float
    ) -> None:
        """Continue the journal at `path`, or begin it; InputError if it belongs to another build.

        `nodes`, rising: the nodes that records may hold, each once.
        """
        self.path, self.every = path, every
        self.done = np.zeros(int(nodes[-1]) + 1 if nodes.size else 0, dtype=bool)
        self._nodes = nodes
        self._places: list[tuple[int, int]] = []
        self._file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | BINARY, 0o666), "r+b", buffering=0)
        self._end, self._mine = 0, False
        self._synced = time.monotonic()
        try:
            self._begin(identity, restart)
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise

    def _begin(self, identity: Mapping[str, Any], restart: bool) -> None:
        header = MAGIC + json.dumps(identity, sort_keys=True).encode() + b"\n"
        if not self._resumes(identity, restart):
            self._file.truncate(0)
            self._mine = True
            self._write(header)
        self._mine = True
        for record in self._scan():
            self._note(record)
        self._file.truncate(self._end)

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if self._mine and not self._places:
                self.path.unlink(missing_ok=True)
            elif self.path.exists():
                os.fsync(self._file.fileno())
        except OSError:
            if error is None:
                raise
        finally:
            self._file.close()

    def _resumes(self, identity: Mapping[str, Any], restart: bool) -> bool:
        """Return whether to continue a journal of the same build; its records begin at `_end`."""
        in_the_way = f"{self.path} has the name of this build's journal but is not a journal; move it away"
        require(stat.S_ISREG(os.fstat(self._file.fileno()).st_mode), in_the_way)
        self._file.seek(0)
        head = self._file.read(LONGEST_HEADER)
        line = head[len(MAGIC) :].split(b"\n", 1)
        # a build that was killed at its first write leaves a part of the header
        require(head.startswith(MAGIC) or MAGIC.startswith(head), in_the_way)
        if restart or not head.startswith(MAGIC) or len(line) < 2:
            return False
        try:
            header = json.loads(line[0])
        except (ValueError, RecursionError):
            header = {}
        if not isinstance(header, dict) or header != dict(identity):
            keys = sorted(key for key in {*identity, *header} if dict(header).get(key) != identity.get(key))
            raise InputError(
                f"{self.path} keeps the progress of another build, whose {', '.join(keys)} differ; "
                "finish that build with its own command, or start again with --restart"
            )
        self._end = len(MAGIC) + len(line[0]) + 1
        return True

    def _scan(self) -> Iterator[Edges]:
        """Yield the whole records from `_end` on, and move `_end` past each."""
        size = os.fstat(self._file.fileno()).st_size
        while self._end < size:
            record = self._read(self._end, size)
            if record is None:
                return
            edges, length = record
            if not self._is_new(edges):
                return
            self._places.append((int(edges.source[0]), self._end))
            self._end += length
            yield edges

    def _read(self, place: int, size: int) -> tuple[Edges, int] | None:
        """Return the record at a position and its length; None if it is cut short or damaged."""
        self._file.seek(place)
        head = self._file.read(RECORD.size)
        if len(head) < RECORD.size:
            return None
        mark, nodes, edges, seconds = RECORD.unpack(head)
        if mark != MARK or max(nodes, edges) > size:
            return None
        sizes = _sizes(nodes, edges)
        lengths = [int(np.prod(shape)) * kind.itemsize for shape, kind in sizes]
        body = self._file.read(sum(lengths) + DIGEST) if sum(lengths) <= size else b""
        if len(body) < sum(lengths) + DIGEST:
            return None
        if hashlib.blake2b(head + body[:-DIGEST], digest_size=DIGEST).digest() != body[-DIGEST:]:
            return None
        ends = np.cumsum(lengths)
        arrays = [
            np.frombuffer(body[end - length : end], kind).reshape(shape)
            for end, length, (shape, kind) in zip(ends, lengths, sizes, strict=True)
        ]
        source, degree, target, values, counts = arrays
        return Edges(source, degree, target, values, counts, seconds), len(head) + len(body)

    def _is_new(self, edges: Edges) -> bool:
        """Return whether a record holds rising nodes of this build that no earlier record holds."""
        source = edges.source
        rises = source.size > 0 and bool((np.diff(source) > 0).all())
        if not rises or self._nodes.size == 0 or source[0] < self._nodes[0] or source[-1] > self._nodes[-1]:
            return False
        return not self.done[source].any() and int(edges.degree.sum()) == edges.target.size

    def _note(self, edges: Edges) -> None:
        self.done[edges.source] = True

    def _write(self, whole: bytes) -> None:
        """Append the bytes, or leave the file unchanged."""
        self._file.seek(self._end)
        try:
            written = 0
            while written < len(whole):
                written += self._file.write(whole[written:]) or 0
        except OSError:
            self._file.truncate(self._end)
            raise
        self._end += len(whole)

    def append(self, edges: Edges) -> None:
        """Keep the edges of these nodes."""
        head = RECORD.pack(MARK, edges.source.size, edges.target.size, edges.seconds)
        sizes = _sizes(edges.source.size, edges.target.size)
        arrays = edges.source, edges.degree, edges.target, edges.values, edges.counts
        kinds = [kind for _, kind in sizes]
        body = b"".join(
            np.ascontiguousarray(array, kind).tobytes() for array, kind in zip(arrays, kinds, strict=True)
        )
        place = self._end
        self._write(head + body + hashlib.blake2b(head + body, digest_size=DIGEST).digest())
        self._places.append((int(edges.source[0]), place))
        self._note(edges)
        if time.monotonic() - self._synced >= self.every:
            os.fsync(self._file.fileno())
            self._synced = time.monotonic()

    def records(self) -> Iterator[Edges]:
        """Yield all records in the order of their first nodes."""
        for _, place in sorted(self._places):
            record = self._read(place, self._end)
            if record is None:
                raise InputError(f"{self.path} was damaged while it was in use; start again with --restart")
            yield record[0]

    def remove(self) -> None:
        """Remove the journal; the roadmap is complete."""
        self.path.unlink(missing_ok=True)
