"""A lock on an output: only one build at a time writes it."""

import contextlib
import json
import os
import platform
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import portalocker

from .errors import InputError
from .output import is_running

ENDING = ".glider-stream.lock"
"""The ending of a lock's name. Other programs have files such as poetry.lock, which are not locks of ours."""


@contextlib.contextmanager
def locked(output: Path) -> Iterator[None]:
    """Hold the lock beside an output during the block; InputError, naming the holder, if it is taken.

    It is the system's own lock on the file and ends with its process, so a killed build leaves no lock behind. On
    a file system without locks the file itself is the lock: see `_claimed`.
    """
    path = output.with_name(f"{output.name}{ENDING}")
    while True:
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            reason = (error.strerror or "").lower()
            raise InputError(f"the output {output} cannot be locked: {reason}; name another") from None
        try:
            portalocker.lock(handle, portalocker.LockFlags.EXCLUSIVE | portalocker.LockFlags.NON_BLOCKING)
        except portalocker.AlreadyLocked:
            holder = _holder(handle)
            os.close(handle)
            raise InputError(_taken(output, holder)) from None
        except portalocker.LockException:
            os.close(handle)
            with _claimed(output, path):
                yield
            return
        # the last holder may have removed the file after it was opened
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), os.stat(path)):
                break
        os.close(handle)
    try:
        with contextlib.suppress(
            OSError
        ):  # the holder's name is only information, so a full disk does not matter
            os.ftruncate(handle, 0)
            os.write(handle, _myself())
        yield
    finally:
        with contextlib.suppress(OSError):
            path.unlink()
        os.close(handle)


@contextlib.contextmanager
def _claimed(output: Path, path: Path) -> Iterator[None]:
    """Hold the lock on a file system without locks: the process that makes the lock's name first has it.

    A hard link to a file of our own is made whole or not at all, also on network file systems. A lock of a build
    that has ended on this machine is removed. A lock of another machine stays, because its build may still run.
    """
    mine = path.with_name(f"{path.name}.{platform.node()}.{os.getpid()}")
    try:
        mine.write_bytes(_myself())
        while not _linked(mine, path):
            _remove_stale(output, path, mine.with_name(f"{mine.name}.old"))
    except OSError as error:
        reason = (error.strerror or "").lower()
        raise InputError(f"the output {output} cannot be locked: {reason}; name another") from None
    finally:
        with contextlib.suppress(OSError):
            mine.unlink()
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            path.unlink()


def _remove_stale(output: Path, path: Path, aside: Path) -> None:
    """Remove a lock whose holder has ended; InputError, naming the holder, if it may still run."""
    with contextlib.suppress(FileNotFoundError):  # its holder may have removed it just now
        before = path.read_bytes()
        holder = _read(before)
        # the attempt at a system lock leaves an empty file
        ended = holder.get("machine") == platform.node() and not is_running(int(holder["process"]))
        if holder and not ended:
            cure = f"or remove {path} if that build has ended, since this disk has no locks"
            raise InputError(f"{_taken(output, holder)}, {cure}")
        # move it, then check again: two builds may find the same old lock at once
        os.rename(path, aside)
        if aside.read_bytes() != before:
            with contextlib.suppress(OSError):
                os.link(aside, path)
        aside.unlink()


def _linked(mine: Path, path: Path) -> bool:
    """Return whether the lock's name is now ours; without hard links the file is made directly."""
    try:
        os.link(mine, path)
    except FileExistsError:
        return False
    except OSError:
        try:
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        except FileExistsError:
            return False
        os.write(handle, _myself())
        os.close(handle)
    return True


def _myself() -> bytes:
    now = datetime.now(UTC).isoformat("T", "seconds")
    return json.dumps({"process": os.getpid(), "machine": platform.node(), "since": now}).encode()


def _read(text: bytes) -> dict[str, Any]:
    """Return the holder in a lock's text; empty if the text names none."""
    try:
        holder = json.loads(text)
        return {
            "process": int(holder["process"]),
            "machine": str(holder["machine"]),
            "since": str(holder["since"]),
        }
    except (ValueError, TypeError, KeyError, RecursionError):
        return {}


def _holder(handle: int) -> dict[str, Any]:
    try:
        os.lseek(handle, 0, os.SEEK_SET)
        return _read(os.read(handle, 4096))
    except OSError:
        return {}


def _taken(output: Path, holder: dict[str, Any]) -> str:
    who = "which has not written its name"
    if holder:
        who = f"process {holder['process']} on {holder['machine']} since {holder['since']}"
    return f"another build of {output} is running, {who}; wait for it, or name another"
