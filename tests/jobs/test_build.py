"""Jobs: killed at any moment and begun again, in parts, two at once, on full disks: the same bytes, or a word."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from helpers.builds import BATCH, METHODS, datasets, expected, interrupt, problem
from helpers.small import command, executable, scenario_file

from glider_stream import planner
from glider_stream.base.errors import InputError, Stopped
from glider_stream.jobs import build as jobs
from glider_stream.jobs import journal
from glider_stream.jobs.build import Job, Shard, build_file, merge, shard_of
from glider_stream.kernels.edges import Status
from glider_stream.roadmap import builder, store
from glider_stream.roadmap.builder import find_edges
from glider_stream.roadmap.provenance import provenance_of
from glider_stream.roadmap.roadmap import Edges, in_order
from glider_stream.roadmap.store import read_part, read_roadmap

pytestmark = pytest.mark.slow


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    return tmp_path


def die(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)


def at_the(count, real):
    """`real`, but for the call of that number, which kills the process."""
    calls = iter(range(1, 10**9))
    return lambda *a, **k: die() if next(calls) == count else real(*a, **k)


def half_written(count):
    """A record of which half reaches the file before the end."""
    real, calls = journal.Journal._write, iter(range(1, 10**9))

    def write(self, whole):
        if next(calls) == count:
            self._file.seek(self._end)
            self._file.write(whole[: len(whole) // 2])
            die()
        real(self, whole)

    return patch.object(journal.Journal, "_write", write)


MOMENTS = {
    "before the first record": lambda: patch.object(journal.Journal, "append", at_the(1, journal.Journal.append)),
    "in the header": lambda: half_written(1),
    "in the second record": lambda: half_written(2),
    "in the fourth record": lambda: half_written(4),
    "at a checkpoint": lambda: patch.object(journal.os, "fsync", at_the(2, os.fsync)),
    "while the roadmap is written": lambda: patch.object(
        store.RoadmapWriter, "_put", at_the(3, store.RoadmapWriter._put)
    ),
    "before the move": lambda: patch.object(store.os, "replace", die),
    "after the move": lambda: patch.object(journal.Journal, "remove", die),
}


def run_and_die(work, trap):
    """Run in a child that the trap kills; whether it did."""
    child = os.fork()
    if child == 0:
        try:
            with trap:
                work()
        finally:
            os._exit(0)
    return os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL


@pytest.mark.parametrize("moment", list(MOMENTS))
@pytest.mark.parametrize("method", ["streamline", "reachable"])
def test_a_killed_build_is_started_again(place, method, moment):
    expected.cache_clear()
    whole = expected(method)
    one = problem(place, METHODS[method])

    def build():
        build_file(one, "road.h5", 1, batch_pairs=BATCH, job=Job(checkpoint=0.0))

    assert run_and_die(build, MOMENTS[moment]())
    if Path("road.h5").exists():
        assert datasets("road.h5") == whole
    evaluated = []
    with patch.object(
        builder, "_evaluated", lambda *a, real=builder._evaluated: evaluated.append(a[1]) or real(*a)
    ):
        build()
    assert datasets("road.h5") == whole
    assert sorted(path.name for path in place.glob("*road*")) == ["road.h5"]
    assert not list(place.glob(".*"))
    nodes = sum(source.size for source in evaluated)
    assert (nodes < 77) == (moment not in ("before the first record", "in the header", "in the second record"))


@pytest.mark.parametrize("method", METHODS)
def test_stopped_from_the_keyboard(place, method):
    expected.cache_clear()
    one = problem(place, METHODS[method])
    seen = []

    def stop(progress):
        seen.append(progress)
        if len(seen) == 2:
            raise KeyboardInterrupt

    with pytest.raises(Stopped, match=r"of 77 nodes are kept in road.h5.journal: give the same command again"):
        build_file(one, "road.h5", progress=stop, batch_pairs=BATCH)
    assert not Path("road.h5").exists()
    build_file(one, "road.h5", progress=seen.append, batch_pairs=10**6)
    assert datasets("road.h5") == expected(method)
    assert seen[-1].done == seen[-1].total


def test_restart_begins_anew_and_another_build_is_refused(place):
    one = problem(place)
    with (
        patch.object(builder, "_evaluated", lambda *a, real=builder._evaluated: real(*a)),
        pytest.raises(Stopped),
    ):
        build_file(one, "road.h5", progress=interrupt, batch_pairs=BATCH)
    other = problem(place, ["flow.vortex=[{x=0.0,y=0.0,radius=100.0,speed=0.2}]"])
    with pytest.raises(
        InputError, match=r"road.h5.journal keeps .* another build, whose flow_sha256.* --restart"
    ):
        build_file(other, "road.h5")
    assert Path("road.h5.journal").exists()
    build_file(other, "road.h5", job=Job(restart=True))
    assert read_roadmap("road.h5").provenance.flow_sha256 != provenance_of(one, np.zeros((1, 3))).flow_sha256
    Path("b.h5.journal").write_text("my diary")
    with pytest.raises(InputError, match="has the name of this build's journal"):
        build_file(one, "b.h5")
    assert Path("b.h5.journal").read_text() == "my diary"


def test_a_damaged_journal_is_cut_where_it_is_whole(place):
    expected.cache_clear()
    one = problem(place)
    with pytest.raises(Stopped):
        build_file(one, "road.h5", progress=lambda p: p.done > 900 and interrupt(p), batch_pairs=BATCH)
    good = Path("road.h5.journal").read_bytes()
    rng = np.random.default_rng(0)
    for place_of in rng.integers(0, len(good), 12):
        bad = bytearray(good)
        bad[place_of] ^= 1 << rng.integers(8)
        Path("road.h5.journal").write_bytes(bad)
        try:
            build_file(one, "road.h5")
        except InputError:
            continue  # the header
        assert datasets("road.h5") == expected("streamline")


def test_two_builds_at_once(place):
    path = (place / "road.h5").resolve()
    hold = "with locked(Path(sys.argv[1])): print('held', flush=True); sys.stdin.read()"
    code = f"import sys; from pathlib import Path; from glider_stream.base.lock import locked\n{hold}"
    with subprocess.Popen(
        [sys.executable, "-c", code, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as first:
        assert first.stdout.readline() == b"held\n"
        with pytest.raises(
            InputError, match=rf"another build of .*road.h5 is running, process {first.pid} on .* since 20"
        ):
            build_file(problem(place), "road.h5")
        assert not Path("road.h5.journal").exists()
        first.kill()
        first.wait()
    assert Path("road.h5.glider-stream.lock").exists()  # stale
    build_file(problem(place), "road.h5")
    assert read_roadmap("road.h5").target.size > 100
    assert not Path("road.h5.glider-stream.lock").exists()


@pytest.mark.parametrize("count", [1, 2, 5, pytest.param(100, marks=pytest.mark.wide)])
def test_shards_make_the_whole(place, count):
    expected.cache_clear()
    numbers = range(1, count + 1)
    for number in numbers:
        build_file(problem(place), f"part{number}.h5", job=Job(shard=Shard(number, count)))
    if count == 1:
        assert datasets("part1.h5") == expected("streamline")
        return
    merge([f"part{number}.h5" for number in reversed(numbers)], "road.h5")
    assert datasets("road.h5") == expected("streamline")
    assert planner.verify("road.h5", sample=5).holds


def test_parts_that_do_not_fit(place):
    for number in (1, 2, 3):
        build_file(problem(place), f"part{number}.h5", job=Job(shard=Shard(number, 3)))
    build_file(problem(place), "half.h5", job=Job(shard=Shard(1, 2)))
    build_file(problem(place, ["integration.tolerance=7.0"]), "other.h5", job=Job(shard=Shard(3, 3)))
    build_file(problem(place), "whole.h5")
    for parts, words in {
        ("part1.h5", "part3.h5"): "part 2 of 3 is missing",
        ("part2.h5",): "parts 1, 3 of 3 are missing",
        ("part1.h5", "part2.h5", "part2.h5"): "part2.h5 and part2.h5 are both part 2/3",
        ("part1.h5", "half.h5"): "half.h5 is part 1/2 but part1.h5 is part 1/3",
        (
            "part1.h5",
            "part2.h5",
            "other.h5",
        ): "other.h5 belongs to another roadmap than part1.h5: scenario_sha256 differ",
        ("part1.h5", "whole.h5"): "whole.h5 is not a part of a roadmap",
        ("none.h5",): "does not exist",
    }.items():
        with pytest.raises(InputError, match=words):
            merge(parts, "road.h5")
        assert not Path("road.h5").exists()
    with pytest.raises(InputError, match="is one of the parts"):
        merge(["part1.h5", "part2.h5", "part3.h5"], "part1.h5")
    with pytest.raises(InputError, match=r"part1.h5 is part 1/3 of a roadmap; .* merge"):
        read_roadmap("part1.h5")
    assert read_part("part2.h5").shard == Shard(2, 3)


def test_shards_from_the_command_line(capsys, place):
    for number in (1, 2):
        said = command(capsys, "build", "small.toml", "-o", f"{number}.h5", "--shard", f"{number}/2")
        assert (said.code, f"part {number}/2 of a roadmap" in said.out) == (0, True)
    assert command(capsys, "query", "1.h5").code == 2
    assert command(capsys, "merge", "1.h5", "2.h5", "-o", "road.h5").code == 0
    assert command(capsys, "query", "road.h5").code == 0
    for wrong in ("0/3", "4/3", "3", "a/b", "1/0", "-1/2"):
        said = command(capsys, "build", "small.toml", "-o", "x.h5", f"--shard={wrong}")
        assert (said.code, "such as 3/16" in said.err, wrong in said.err) == (2, True, True)
    with pytest.raises(InputError, match="3/16"):
        shard_of("1/2/3")


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_disk_that_fills_keeps_progress(place, share):
    expected.cache_clear()
    whole = expected("streamline")
    one = problem(place)
    least, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(share * Path("expected-streamline.h5").stat().st_size), most))
    try:
        with pytest.raises(
            InputError, match=r"file too large; make room on its disk.* nodes are kept in road.h5.journal"
        ):
            build_file(one, "road.h5", batch_pairs=BATCH)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (least, most))
    assert not Path("road.h5").exists()
    evaluated = []
    with patch.object(
        builder, "_evaluated", lambda *a, real=builder._evaluated: evaluated.append(a[1]) or real(*a)
    ):
        build_file(one, "road.h5", batch_pairs=BATCH)
    assert datasets("road.h5") == whole
    assert sum(source.size for source in evaluated) < 77


def test_a_folder_that_is_closed_half_way(place):
    """What root may do nevertheless is seen with a failing move."""
    expected.cache_clear()
    one = problem(place)
    with (
        patch.object(store.os, "replace", side_effect=PermissionError(13, "Permission denied")),
        pytest.raises(InputError, match=r"cannot be written whole: permission denied.* 77 of 77 nodes are kept"),
    ):
        build_file(one, "road.h5")
    evaluated = []
    with patch.object(builder, "_evaluated", lambda *a: evaluated.append(a)):
        build_file(one, "road.h5")
    assert not evaluated
    assert datasets("road.h5") == expected("streamline")


@pytest.mark.wide
def test_a_command_that_is_killed_goes_on(place):
    """The command line as it is run: interrupted by the terminal's signal, then the same again."""
    scenario = [
        "build",
        "small.toml",
        "-o",
        "road.h5",
        "--set",
        "sampling.shape=[12,12,4]",
        "--set",
        "neighbours.kind=all",
    ]
    with subprocess.Popen(
        [executable(), *scenario, "--threads", "1"], stderr=subprocess.PIPE, text=True
    ) as running:
        until = time.monotonic() + 60
        while time.monotonic() < until and running.poll() is None:
            if Path("road.h5.journal").exists() and Path("road.h5.journal").stat().st_size > 1e5:
                running.send_signal(signal.SIGINT)
                break
            time.sleep(0.01)
        said = running.communicate()[1]
    assert running.returncode == 130, said
    assert "nodes are kept in road.h5.journal: give the same command again to continue" in said
    assert "Traceback" not in said
    done = subprocess.run([executable(), *scenario], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = json.loads(
        subprocess.run([executable(), "info", "road.h5", "--json"], capture_output=True, text=True).stdout
    )
    assert told["nodes"] == 12 * 12 * 4 + 2
    assert told["evaluated"] == sum(told["counts"].values())


def test_edges_in_any_order_are_the_same(place):
    one = problem(place)
    position = builder.node_positions(one)
    parts = list(find_edges(one, position, batch_pairs=BATCH))
    whole = in_order(parts)
    shuffled = in_order([parts[n] for n in np.random.default_rng(1).permutation(len(parts))])
    for name in ("source", "degree", "target", "values", "counts"):
        assert getattr(whole, name).tobytes() == getattr(shuffled, name).tobytes()
    odd = whole.source % 2 == 1
    again = in_order([whole.of(~odd), whole.of(odd)])
    assert again.target.tobytes() == whole.target.tobytes()
    assert whole.counts.sum(axis=0)[Status.CONNECTED] == whole.target.size
    assert isinstance(again, Edges)


def test_unusable_checkpoints_are_refused(capsys, place):
    said = command(capsys, "build", "small.toml", "-o", "road.h5", "--checkpoint=-1")
    assert (said.code, "`checkpoint` must be at least 0 s; got -1" in said.err) == (2, True)
    assert jobs.CHECKPOINT > 0
