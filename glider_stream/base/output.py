"""Outputs: whether one can be written, and how it is replaced whole or not at all."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .errors import InputError, Unwritable
from .settings import require


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
    require(path.is_file() or not path.exists(), f"the output {path} is not an ordinary file; name another")
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
        with temporary.open("rb") as whole:
            os.fsync(whole.fileno())
        # only the owner may read what mkstemp makes; an output is as readable as any new file
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, target)
    except OSError as error:
        reason = (error.strerror or "it cannot be written").lower()
        room = "make room on its disk, or name another output"
        raise Unwritable(f"the output {path} cannot be written whole: {reason}; {room}") from None
    finally:
        temporary.unlink(missing_ok=True)
