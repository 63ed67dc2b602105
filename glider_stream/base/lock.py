"""A lock on an output: one build at a time writes it."""

import contextlib
import fcntl
import json
import os
import platform
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from .errors import InputError


@contextlib.contextmanager
def locked(output: Path) -> Iterator[None]:
    """Hold the lock beside an output for as long as the block runs; InputError, naming the holder, if taken.

    The system's own lock on the file, which ends with its process: what a killed build leaves is no obstacle.
    """
    path = output.with_name(f"{output.name}.lock")
    while True:
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            said = (error.strerror or "").lower()
            raise InputError(f"the output {output} cannot be locked: {said}; name another") from None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            who = _holder(handle)
            os.close(handle)
            raise InputError(
                f"another build of {output} is running, {who}; wait for it, or name another"
            ) from None
        # whoever held it may have removed the file since it was opened
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), os.stat(path)):
                break
        os.close(handle)
    try:
        now = datetime.now(UTC).isoformat("T", "seconds")
        me = {"process": os.getpid(), "machine": platform.node(), "since": now}
        with contextlib.suppress(OSError):  # who holds it is a courtesy, which a full disk may not stop
            os.ftruncate(handle, 0)
            os.pwrite(handle, json.dumps(me).encode(), 0)
        yield
    finally:
        with contextlib.suppress(OSError):
            path.unlink()
        os.close(handle)


def _holder(handle: int) -> str:
    try:
        said = json.loads(os.pread(handle, 4096, 0))
        return f"process {int(said['process'])} on {said['machine']} since {said['since']}"
    except (OSError, ValueError, TypeError, KeyError):
        return "which has not said who it is"
