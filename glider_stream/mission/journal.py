"""The journal of a campaign: the runs that are done, kept until the results are whole."""

import hashlib
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..jobs.journal import DIGEST, Records
from .run import Outcome

HEAD = struct.Struct("<4sQQQ")
"""The head of a record: mark, number of the run, bytes of JSON, bytes of arrays."""
MARK = b"run "
ARRAYS = ("track", "line")
"""The fields of an outcome that are written as arrays."""
Run = list[Outcome]
"""The outcomes of one run, one for each policy."""


class RunJournal(Records[Run]):
    """The records of a campaign; `done` are the numbers of the runs that they hold."""

    magic = b"glider-stream/runs 1\n"
    job = "campaign"

    def __init__(
        self, path: Path, identity: Mapping[str, Any], policies: Sequence[str], restart: bool, every: float
    ) -> None:
        """Continue the journal at `path`, or begin it; InputError if it belongs to another campaign."""
        self.done: set[int] = set()
        self._policies = list(policies)
        super().__init__(path, identity, restart, every)

    def _read(self, place: int, size: int) -> tuple[Run, int] | None:
        self._file.seek(place)
        head = self._file.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        mark, _, words, numbers = HEAD.unpack(head)
        length = words + numbers + DIGEST
        if mark != MARK or length > size:
            return None
        body = self._file.read(length)
        if len(body) < length or _digest(head + body[:-DIGEST]) != body[-DIGEST:]:
            return None
        values = np.frombuffer(body[words:-DIGEST], np.float64)
        run, first = [], 0
        for outcome in json.loads(body[:words]):
            for name in ARRAYS:
                rows, columns = outcome[name]
                outcome[name] = values[first : first + rows * columns].reshape(rows, columns).copy()
                first += rows * columns
            run.append(Outcome(**outcome))
        return run, len(head) + length

    def _is_new(self, run: Run) -> bool:
        mine = [outcome.policy for outcome in run] == self._policies
        return mine and run[0].number not in self.done

    def _note(self, run: Run) -> None:
        self.done.add(run[0].number)

    def _rank(self, run: Run) -> int:
        return run[0].number

    def _bytes(self, run: Run) -> bytes:
        tables = [asdict(outcome) for outcome in run]
        arrays = [np.ascontiguousarray(table[name], np.float64) for table in tables for name in ARRAYS]
        shapes = iter([array.shape for array in arrays])
        words = json.dumps([table | {name: next(shapes) for name in ARRAYS} for table in tables]).encode()
        numbers = b"".join(array.tobytes() for array in arrays)
        whole = HEAD.pack(MARK, run[0].number, len(words), len(numbers)) + words + numbers
        return whole + _digest(whole)


def _digest(text: bytes) -> bytes:
    return hashlib.blake2b(text, digest_size=DIGEST).digest()
