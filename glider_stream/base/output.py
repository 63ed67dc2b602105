"""Outputs: checks whether a file can be written, and replaces it whole or not at all."""

import contextlib
import os
import re
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextvars import ContextVar
from pathlib import Path

from .errors import InputError, Unwritable
from .settings import require

MARKER = "glider-stream"
"""This text is in the name of each of our temporary files, so that no other file is taken for one."""

LONGEST_NAME = 200
"""An output's name may have this many bytes; files beside it have longer names, and file systems allow 255."""

_WRITTEN: ContextVar[list[Path] | None] = ContextVar("written", default=None)


@contextlib.contextmanager
def noting_files() -> Iterator[list[Path]]:
    """Yield a list to which every output is added that is written in the block."""
    files: list[Path] = []
    before = _WRITTEN.set(files)
    try:
        yield files
    finally:
        _WRITTEN.reset(before)


def check_output(path: str | Path) -> None:
    """Raise InputError unless a file can be made at `path`; this is checked before the work begins."""
    path = Path(path)
    size = len(os.fsencode(path.name))
    fits = size <= LONGEST_NAME
    require(fits, f"the name of the output {path} is {size} bytes long; give a name of at most {LONGEST_NAME}")
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


def check_apart(output: str | Path, inputs: Iterable[str | Path]) -> None:
    """Raise InputError if an output would be written over an input, perhaps by another name of the same file."""
    for file in inputs:
        with contextlib.suppress(OSError):  # one of them is not there yet
            same = Path(output).samefile(file)
            require(not same, f"the output {output} is the input {file}, which would be lost; name another")


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path`; it is moved to `path` if the block ends well, else removed.

    InputError that names `path` if the block cannot write, for example on a full disk.
    """
    check_output(path)
    target = path.resolve()  # a link stays a link
    before, after = f".{target.name}.{os.getpid()}-", f".{MARKER}{target.suffix}"
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=before, suffix=after)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        with temporary.open("rb") as whole:
            os.fsync(whole.fileno())
        # only the owner may read a file of mkstemp; an output gets the permissions of any new file
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, target)
        noted = _WRITTEN.get()
        if noted is not None:
            noted.append(path)
    except OSError as error:
        reason = (error.strerror or "it cannot be written").lower()
        room = "make room on its disk, or name another output"
        raise Unwritable(f"the output {path} cannot be written whole: {reason}; {room}") from None
    finally:
        temporary.unlink(missing_ok=True)


def remove_abandoned(target: Path) -> None:
    """Remove the temporary files of an output that killed processes left.

    Only regular files with the names that `replacing` makes for this output are removed, and no file of a process
    that still runs here. The caller holds the output's lock, so no build on another machine writes one now.
    """
    name, ending = re.escape(target.name), re.escape(f".{MARKER}{target.suffix}")
    form = re.compile(rf"\.{name}\.(\d+)-[a-z0-9_]{{8}}{ending}")
    with os.scandir(target.parent) as entries:
        left = [(entry, match) for entry in entries if (match := form.fullmatch(entry.name))]
    for entry, match in left:
        process = int(match[1])
        # in a container, a build that starts again often has the process number of the build before
        over = process == os.getpid() or not is_running(process)
        with contextlib.suppress(OSError):  # Windows keeps a file that is open
            if over and stat.S_ISREG(entry.stat(follow_symlinks=False).st_mode):
                os.unlink(entry.path)


def is_running(process: int) -> bool:
    """Return whether another process of this machine has that number; False if the system does not tell."""
    if os.name == "nt" or not 0 < process < 2**31:
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
