"""Locks: the system's where it has them, else a file that is made once; importing needs none of a system."""

import builtins
import errno
import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import portalocker
import pytest

from glider_stream.base import lock
from glider_stream.base.errors import InputError
from glider_stream.base.lock import locked

pytestmark = pytest.mark.slow

NO_LOCKS = [errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL]


@pytest.fixture
def output(tmp_path):
    return tmp_path / "road.h5"


def without_locks(number):
    """As a file system without locks answers."""

    def refuse(*_):
        error = OSError(number, os.strerror(number))
        raise portalocker.LockException(error, str(error))

    return patch.object(portalocker, "lock", refuse)


@pytest.mark.parametrize("number", NO_LOCKS)
def test_a_disk_without_locks(output, number):
    with without_locks(number):
        with locked(output):
            [name] = os.listdir(output.parent)
            assert name == f"road.h5{lock.ENDING}"
            assert json.loads((output.parent / name).read_text())["process"] == os.getpid()
            with (
                pytest.raises(
                    InputError, match=r"process \d+ on .* since 20.*, or remove .* this disk has no locks"
                ),
                locked(output),
            ):
                pass
        assert os.listdir(output.parent) == []
        with pytest.raises(ZeroDivisionError), locked(output):
            raise ZeroDivisionError
        assert os.listdir(output.parent) == []


def test_a_disk_without_locks_or_links(output):
    with without_locks(errno.ENOLCK), patch.object(os, "link", side_effect=OSError(errno.EPERM, "no")):
        with locked(output), pytest.raises(InputError, match="another build of"), locked(output):
            pass
        assert os.listdir(output.parent) == []


@pytest.mark.parametrize(("machine", "free"), [(platform.node(), True), ("another", False)])
def test_a_lock_that_is_left_where_there_are_no_locks(output, machine, free):
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        pass
    path = output.with_name(f"road.h5{lock.ENDING}")
    path.write_text(json.dumps({"process": ended.pid, "machine": machine, "since": "2026-01-01T00:00:00+00:00"}))
    with without_locks(errno.ENOLCK):
        if free:
            with locked(output):
                assert json.loads(path.read_text())["process"] == os.getpid()
        else:
            with (
                pytest.raises(
                    InputError, match=r"on another since 2026-01-01.*remove .* if that build has ended"
                ),
                locked(output),
            ):
                pass
            assert path.exists()
    with locked(output):  # a true lock knows whether its holder runs
        pass


def test_many_processes_that_take_a_stale_lock_at_once(output):
    """Of twelve processes that find the same stale lock, one after the other holds it, never two."""
    code = (
        "import sys, os, errno, portalocker, time; from pathlib import Path\n"
        "def refuse(*a): raise portalocker.LockException(OSError(errno.ENOLCK, 'no'), 'no')\n"
        "portalocker.lock = refuse\n"
        "from glider_stream.base.lock import locked; from glider_stream.base.errors import InputError\n"
        "out = Path(sys.argv[1]); held = out.with_name('held')\n"
        "try:\n"
        "    with locked(out):\n"
        "        os.close(os.open(held, os.O_CREAT | os.O_EXCL)); time.sleep(0.05); held.unlink()\n"
        "except InputError: pass\n"
    )
    stale = {"process": 4194305, "machine": platform.node(), "since": "2026"}
    output.with_name(f"road.h5{lock.ENDING}").write_text(json.dumps(stale))
    many = [
        subprocess.Popen([sys.executable, "-c", code, str(output)], stderr=subprocess.PIPE) for _ in range(12)
    ]
    said = [one.communicate()[1] for one in many]
    assert [one.returncode for one in many] == [0] * 12, said
    assert os.listdir(output.parent) == []


def test_importing_needs_no_fcntl():
    """As on Windows, which has none."""
    code = (
        "import sys, builtins\n"
        "real = builtins.__import__\n"
        "def without(name, *rest, **more):\n"
        "    caller = (rest[0] or {}).get('__name__', '') if rest else ''\n"
        "    if name in ('fcntl', 'resource', 'pwd', 'grp', 'termios') and caller.startswith('glider_stream'):\n"
        "        raise ModuleNotFoundError(name)\n"
        "    return real(name, *rest, **more)\n"
        "builtins.__import__ = without\n"
        "import glider_stream.planner, glider_stream.cli, glider_stream.evaluation.bench\n"
        "print('imported')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "imported\n", done.stderr
    assert builtins.__import__ is not None


def test_a_users_lock_file_is_left_alone(output):
    other = output.with_name("road.h5.lock")
    other.write_text("name = 'poetry'")
    with locked(output):
        assert other.read_text() == "name = 'poetry'"
    assert other.read_text() == "name = 'poetry'"
    assert Path(output.parent).exists()
