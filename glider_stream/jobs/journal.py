"""Journals: keep what a job has found, safe from the end of the process, until its output is whole."""

import hashlib
import json
import os
import stat
import struct
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np

from ..base.arrays import Index
from ..base.errors import InputError
from ..base.settings import require
from ..roadmap.roadmap import EMPTY, Edges

T = TypeVar("T")
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


class Records(ABC, Generic[T]):
    """A file of records, each written whole or not at all.

    An unfinished record that a kill leaves is cut off. `every` [s]: how often the disk is asked to keep what was
    written, against a loss of power. If only the process is lost, nothing written is lost.
    """

    magic: ClassVar[bytes]
    """The first line of the file."""
    job: ClassVar[str]
    """The kind of job, for messages."""

    def __init__(self, path: Path, identity: Mapping[str, Any], restart: bool, every: float) -> None:
        """Continue the journal at `path`, or begin it; InputError if it belongs to another job."""
        self.path, self.every = path, every
        self._places: list[tuple[int, int]] = []
        self._file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | BINARY, 0o666), "r+b", buffering=0)
        self._end, self._mine = 0, False
        self._synced = time.monotonic()
        try:
            self._begin(identity, restart)
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise

    @abstractmethod
    def _read(self, place: int, size: int) -> tuple[T, int] | None:
        """Return the record at a position and its length; None if it is cut short or damaged."""

    @abstractmethod
    def _is_new(self, record: T) -> bool:
        """Return whether a record belongs to this job and repeats no earlier one."""

    @abstractmethod
    def _note(self, record: T) -> None:
        """Note what a record holds."""

    @abstractmethod
    def _rank(self, record: T) -> int:
        """Return the number by which records are sorted."""

    @abstractmethod
    def _bytes(self, record: T) -> bytes:
        """Return a record as it is written."""

    def _begin(self, identity: Mapping[str, Any], restart: bool) -> None:
        header = self.magic + json.dumps(identity, sort_keys=True).encode() + b"\n"
        if not self._resumes(identity, restart):
            self._file.truncate(0)
            self._mine = True
            self._write(header)
        self._mine = True
        for record in self._scan():
            self._note(record)
        self._file.truncate(self._end)

    def __enter__(self) -> Self:
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
        """Return whether to continue a journal of the same job; its records begin at `_end`."""
        in_the_way = f"{self.path} has the name of this {self.job}'s journal but is not a journal; move it away"
        require(stat.S_ISREG(os.fstat(self._file.fileno()).st_mode), in_the_way)
        self._file.seek(0)
        head = self._file.read(LONGEST_HEADER)
        line = head[len(self.magic) :].split(b"\n", 1)
        # a job that was killed at its first write leaves a part of the header
        require(head.startswith(self.magic) or self.magic.startswith(head), in_the_way)
        if restart or not head.startswith(self.magic) or len(line) < 2:
            return False
        try:
            header = json.loads(line[0])
        except (ValueError, RecursionError):
            header = {}
        if not isinstance(header, dict) or header != dict(identity):
            keys = sorted(key for key in {*identity, *header} if dict(header).get(key) != identity.get(key))
            raise InputError(
                f"{self.path} keeps the progress of another {self.job}, whose {', '.join(keys)} differ; "
                f"finish that {self.job} with its own command, or start again with --restart"
            )
        self._end = len(self.magic) + len(line[0]) + 1
        return True

    def _scan(self) -> Iterator[T]:
        """Yield the whole records from `_end` on, and move `_end` past each."""
        size = os.fstat(self._file.fileno()).st_size
        while self._end < size:
            found = self._read(self._end, size)
            if found is None:
                return
            record, length = found
            if not self._is_new(record):
                return
            self._places.append((self._rank(record), self._end))
            self._end += length
            yield record

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

    def append(self, record: T) -> None:
        """Keep a record."""
        place = self._end
        self._write(self._bytes(record))
        self._places.append((self._rank(record), place))
        self._note(record)
        if time.monotonic() - self._synced >= self.every:
            os.fsync(self._file.fileno())
            self._synced = time.monotonic()

    def records(self) -> Iterator[T]:
        """Yield all records in their order."""
        for _, place in sorted(self._places):
            record = self._read(place, self._end)
            if record is None:
                raise InputError(f"{self.path} was damaged while it was in use; start again with --restart")
            yield record[0]

    def remove(self) -> None:
        """Remove the journal; the output is whole."""
        self.path.unlink(missing_ok=True)


class Journal(Records[Edges]):
    """The records of a build: `Edges`; `done` tells which nodes they hold."""

    magic = b"glider-stream/journal 1\n"
    job = "build"

    def __init__(
        self, path: Path, identity: Mapping[str, Any], nodes: Index, restart: bool, every: float
    ) -> None:
        """Continue the journal at `path`, or begin it; InputError if it belongs to another build.

        `nodes`, rising: the nodes that records may hold, each once.
        """
        self.done = np.zeros(int(nodes[-1]) + 1 if nodes.size else 0, dtype=bool)
        self._nodes = nodes
        super().__init__(path, identity, restart, every)

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

    def _rank(self, edges: Edges) -> int:
        return int(edges.source[0])

    def _bytes(self, edges: Edges) -> bytes:
        head = RECORD.pack(MARK, edges.source.size, edges.target.size, edges.seconds)
        sizes = _sizes(edges.source.size, edges.target.size)
        arrays = edges.source, edges.degree, edges.target, edges.values, edges.counts
        kinds = [kind for _, kind in sizes]
        body = b"".join(
            np.ascontiguousarray(array, kind).tobytes() for array, kind in zip(arrays, kinds, strict=True)
        )
        return head + body + hashlib.blake2b(head + body, digest_size=DIGEST).digest()
