"""Outputs: whether one can be written, and how it is replaced whole or not at all."""

import contextlib
import os
import re
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .errors import InputError, Unwritable
from .settings import require

MARKER = "glider-stream"
"""In the name of every temporary file that we make, so that no other file is taken for one."""

LONGEST_NAME = 200
"""Bytes in an output's name: what is kept beside it has a longer one, and 255 is what file systems take."""


def check_output(path: str | Path) -> None:
    """InputError unless a file can be made at `path`: before the work, not after it."""
    path = Path(path)
    size = len(os.fsencode(path.name))
    fits = size <= LONGEST_NAME
    require(fits, f"the name of the output {path} is {size} bytes long; name one of at most {LONGEST_NAME}")
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
    before, after = f".{target.name}.{os.getpid()}-", f".{MARKER}{target.suffix}"
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=before, suffix=after)
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


def remove_abandoned(target: Path) -> None:
    """Remove the temporary files of an output that processes left which were killed in their last moment.

    Only regular files whose names `replacing` makes for this output, and none of a process that still runs
    here. The caller holds the output's lock, so that no build on another machine writes one now.
    """
    name, ending = re.escape(target.name), re.escape(f".{MARKER}{target.suffix}")
    form = re.compile(rf"\.{name}\.(\d+)-[a-z0-9_]{{8}}{ending}")
    with os.scandir(target.parent) as entries:
        left = [(entry, match) for entry in entries if (match := form.fullmatch(entry.name))]
    for entry, match in left:
        process = int(match[1])
        # in a container, a build that is begun again often has the number of the one before
        over = process == os.getpid() or not is_running(process)
        with contextlib.suppress(OSError):  # Windows keeps a file that is open
            if over and stat.S_ISREG(entry.stat(follow_symlinks=False).st_mode):
                os.unlink(entry.path)


def is_running(process: int) -> bool:
    """Whether another process of this machine has that number; where the system does not tell, no."""
    if os.name == "nt" or not 0 < process < 2**31:
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
