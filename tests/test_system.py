"""The program in its surroundings: broken streams, hostile texts, signals, cores, odd names, no home."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import patch

import h5py
import pytest
from helpers.small import command, executable, scenario_file

from glider_stream import planner
from glider_stream.base import cores
from glider_stream.base.terminal import plain

pytestmark = pytest.mark.slow

COMMAND = [sys.executable, "-m", "glider_stream"]


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    return tmp_path


@pytest.fixture
def built(place):
    planner.build("small.toml", "road.h5")
    return place


def shell(line, **more):
    """A line of the shell, in which $G is the program."""
    env = {**os.environ, "G": " ".join(COMMAND), **more.pop("env", {})}
    env = {name: value for name, value in env.items() if value is not None}
    return subprocess.run(["bash", "-c", line], capture_output=True, text=True, env=env, errors="replace", **more)


def test_as_a_module_and_as_a_command():
    module = subprocess.run([*COMMAND, "--version"], capture_output=True, text=True)
    alone = subprocess.run([executable(), "--version"], capture_output=True, text=True)
    assert module.stdout == alone.stdout != ""
    assert module.returncode == 0


@pytest.mark.parametrize(
    "where",
    ["2>/dev/full", *(pytest.param(one, marks=pytest.mark.wide) for one in ("2> >(exit)", "<&- 1>&- 2>&-"))],
)
def test_progress_with_standard_error_closed(place, where):
    if "/dev/full" in where and not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    done = shell(f"sleep 0.1; $G build small.toml -o road.h5 {where}")
    assert done.returncode == 0, done
    assert "Traceback" not in done.stderr
    assert planner.verify("road.h5", sample=2).holds


@pytest.mark.parametrize("where", ["2>&-", "2>/dev/full"])
def test_a_refusal_with_standard_error_closed_keeps_its_exit_code(place, where):
    assert shell(f"$G build nowhere.toml -o road.h5 {where}").returncode == 2


def test_a_reader_that_closes_standard_output(built):
    done = shell("$G info road.h5 | true; echo ${PIPESTATUS[0]}")
    assert done.stdout.strip() in ("0", "141")
    assert done.stderr == ""
    full = shell("$G info road.h5 > /dev/full")
    assert full.returncode == 2
    assert "standard output cannot be used: no space left on device" in full.stderr


def test_what_files_say_cannot_move_the_cursor(built, capsys):
    forged = "calm\x1b[2J\x9b1A\r\n  built:  0.1 s on 64 threads\u202e\u2028x"
    with h5py.File("road.h5", "r+") as file:
        for name in ("flow", "glider", "machine", "libraries", "created"):
            file.attrs[name] = forged
    said = command(capsys, "info", "road.h5")
    lines = said.out.split("\n")
    assert sum(line.startswith("  built:") for line in lines) == 1
    assert all(line.isprintable() for line in lines)
    assert "calm\\x1b[2J\\x9b1A\\r\\n  built:" in said.out
    assert command(capsys, "info", "road.h5", "--json").out.replace("\n", "").isprintable()
    with h5py.File("road.h5", "r+") as file:
        file.attrs["format"] = "\x1b]0;title\x07\nglider-stream: done"
    refused = command(capsys, "info", "road.h5")
    assert refused.code == 2
    assert refused.err.count("\n") == 1
    assert refused.err[:-1].isprintable()


def test_plain_text():
    assert plain("Îles d'Hyères, 12 µm") == "Îles d'Hyères, 12 µm"
    assert plain("a\nb\tc\x00\x7f\x85\udcff") == "a\\nb\\tc\\x00\\x7f\\x85\\udcff"


@pytest.mark.wide
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names are UTF-8")
def test_names_that_are_not_utf_8(built, capsys):
    done = shell(
        "$G build small.toml -o $'\\xff.h5' && $G info $'\\xff.h5' && $G query $'\\xff.h5' -o $'p\\xff.json'"
    )
    assert done.returncode == 0, done
    assert b"p\xff.json" in os.listdir(b".")
    assert "\\udcff.h5" in done.stdout
    odd = os.fsdecode(b"\xff")
    for line in (
        f"build small.toml -o x.h5 --set flow.kind=netcdf --set flow.file={odd}.nc",
        f"build {odd}.toml -o x.h5",
        f"info none{odd}.h5",
        f"query road.h5 -o {odd}/none.json",
        f"describe {odd}.nc",
        f"score road.h5 {odd}.csv",
        f"calibrate {odd}.csv",
        f"plot road.h5 {odd}.json -o x.png",
    ):
        said = command(capsys, *line.split())
        assert (said.code, said.err.count("\n"), "\\udcff" in said.err) == (2, 1, True), said


def test_an_output_with_a_small_alphabet(built):
    said = shell("$G info $'no\u2192\u03b3.h5'", env={"PYTHONIOENCODING": "cp1252", "LC_ALL": "C.UTF-8"})
    assert (said.returncode, "Traceback" in said.stderr) == (2, False)
    assert "no\\u2192\\u03b3.h5" in said.stderr


@pytest.mark.wide
def test_a_notebooks_backend(built):
    nowhere = {"MPLBACKEND": "module://matplotlib_inline.backend_nowhere"}
    done = shell("$G plot road.h5 -o x.png", env=nowhere)
    assert (done.returncode, Path("x.png").exists()) == (0, True), done.stderr


EARLY = """
import builtins, os, signal, sys
real, wanted = builtins.__import__, sys.argv.pop(1)

def watched(name, *rest, **more):
    global wanted
    if name == wanted:
        wanted = None
        os.kill(os.getpid(), signal.SIGINT)
    return real(name, *rest, **more)

builtins.__import__ = watched
from glider_stream.__main__ import main
main()
"""


@pytest.mark.parametrize("module", ["click", "numba", "h5py"])
def test_ctrl_c_while_modules_are_loaded(place, module):
    program = [sys.executable, "-c", EARLY, module, "build", "small.toml", "-o", "road.h5"]
    done = subprocess.run(program, capture_output=True, text=True)
    assert done.returncode in (-signal.SIGINT, 130), done
    assert done.stderr.strip() in ("", "glider-stream: stopped")
    assert os.listdir() == ["small.toml"]


STUCK = """
import sys, time, numba
from glider_stream.base.interrupt import stoppable
from glider_stream.base.threads import in_parallel, threads

@numba.njit(nogil=True)
def spin(first, last):
    x = 0.0
    for i in range(10**13):
        x += (i % 7) * 1e-9
    return x

spin.compile("float64(int64, int64)")
with stoppable(), threads(int(sys.argv[1])):
    print("spinning", flush=True)
    in_parallel(spin, 4, 1)
"""


@pytest.mark.parametrize("count", [1, 2])
def test_two_ctrl_c_end_whatever_runs(count):
    """Kernels that take hours, in the main thread and in others."""
    with subprocess.Popen(
        [sys.executable, "-c", STUCK, str(count)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "NUMBA_NUM_THREADS": "2"},
    ) as running:
        assert running.stdout.readline() == "spinning\n"
        time.sleep(0.3)
        running.send_signal(signal.SIGINT)
        time.sleep(1.3)
        assert running.poll() is None
        running.send_signal(signal.SIGINT)
        said = running.communicate(timeout=5)[1]
    assert running.returncode == 130
    assert said == "glider-stream: stopping; press Ctrl-C again to end it at once\nglider-stream: ended at once\n"


def test_what_nohup_ignores_stays_ignored(place):
    done = shell("trap '' INT; $G build small.toml -o road.h5 & sleep 0.4; kill -INT $!; wait $!; echo $?")
    assert done.stdout.endswith("0\n"), done
    assert Path("road.h5").exists()


def test_cores_that_may_be_used(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    group = tmp_path / "a/b"
    group.mkdir(parents=True)
    (tmp_path / "a/cpu.max").write_text("150000 100000\n")
    (group / "cpu.max").write_text("max 100000\n")
    assert list(cores._shares(["0::/a/b"], tmp_path)) == [1.5]
    (tmp_path / "cpu/x").mkdir(parents=True)
    (tmp_path / "cpu/x/cpu.cfs_quota_us").write_text("50000")
    (tmp_path / "cpu/x/cpu.cfs_period_us").write_text("100000")
    assert list(cores._shares(["4:cpu,cpuacct:/x", "3:memory:/x", "broken"], tmp_path)) == [0.5]
    with patch.object(cores, "_share", lambda: 0.5):
        assert cores.usable_cores() == 1
    with patch.object(cores, "_share", lambda: float("inf")):
        assert 1 <= cores.usable_cores() <= os.cpu_count()
    monkeypatch.setenv("NUMBA_NUM_THREADS", "3")
    assert cores.usable_cores() == 3


@pytest.mark.wide
@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no affinity here")
def test_one_core_by_affinity(place):
    pytest.importorskip("distributed")
    line = "taskset -c 0 $G build small.toml -o road.h5 --scheduler local:1"
    done = shell(line, env={"NUMBA_NUM_THREADS": None})
    assert done.returncode == 0, done.stderr
    assert planner.info("road.h5").threads == 1


def test_an_account_without_home_and_name(built):
    """As in a container that runs under a number alone."""
    code = (
        "import os, pwd, sys; os.environ.pop('HOME', None)\n"
        "def nobody(*_): raise KeyError('uid not found')\n"
        "pwd.getpwuid = nobody\n"
        "import glider_stream.kernels.cache as cache\n"
        "cache._usable = lambda place, real=cache._usable: '__pycache__' not in str(place) and real(place)\n"
        "print(cache.cache_folder(), file=sys.stderr)\n"
        "sys.argv[1:] = ['info', 'road.h5']; from glider_stream.__main__ import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"glider-stream-{os.geteuid()}" in done.stderr
    assert "Traceback" not in done.stderr
