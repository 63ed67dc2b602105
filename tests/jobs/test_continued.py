"""A build that goes on: on the base that it began with, or not at all; nothing but its own files is touched."""

import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import h5py
import numpy as np
import pytest
from helpers.builds import BATCH, datasets, interrupt, problem
from helpers.small import scenario_file

from glider_stream.base.errors import InputError, Stopped
from glider_stream.base.output import MARKER, remove_abandoned
from glider_stream.jobs.build import Job, Shard, build_file
from glider_stream.jobs.journal import RECORD
from glider_stream.kernels.edges import Status
from glider_stream.roadmap import store
from glider_stream.roadmap.roadmap import Edges, by_node, in_order
from glider_stream.roadmap.store import read_roadmap

pytestmark = pytest.mark.slow

NODES = 77
KEEP = np.arange(NODES) % 3 != 1
OTHER = np.arange(NODES) < 40


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    build_file(problem(tmp_path), "old.h5")
    return tmp_path


def job(kept, shard=None):
    """A build on the older roadmap, of which the edges of some nodes are right; afresh where `kept` is None."""
    return Job(base=None if kept is None else (read_roadmap("old.h5"), kept), shard=shard, checkpoint=0.0)


def stopped(one, kept, shard=None):
    """A build that is stopped after its second batch."""
    seen = []
    with pytest.raises(Stopped):
        build_file(
            one, "new.h5", progress=lambda p: seen.append(p) or (len(seen) == 2 and interrupt(p)),
            batch_pairs=BATCH // 4, job=job(kept, shard),
        )  # fmt: skip
    assert Path("new.h5.journal").exists()


@pytest.mark.parametrize(
    ("first", "second"),
    [(KEEP, None), (None, KEEP), (KEEP, OTHER)],
    ids=["with, without", "without, with", "other"],
)
def test_a_build_goes_on_with_its_own_base_alone(place, first, second):
    one = problem(place)
    stopped(one, first)
    kept = Path("new.h5.journal").read_bytes()
    Path("new.h5").write_bytes(Path("old.h5").read_bytes())
    with pytest.raises(InputError, match=r"keeps the progress of another build, whose base differ.* --restart"):
        build_file(one, "new.h5", job=job(second))
    assert Path("new.h5.journal").read_bytes() == kept
    assert Path("new.h5").read_bytes() == Path("old.h5").read_bytes()
    build_file(one, "new.h5", job=job(first))
    assert datasets("new.h5") == datasets("old.h5")
    assert not Path("new.h5.journal").exists()


def test_a_shard_goes_on_with_its_own_base(place):
    one = problem(place)
    for number in (1, 2):
        shard = Shard(number, 2)
        stopped(one, KEEP, shard)
        with pytest.raises(InputError, match="base differ"):
            build_file(one, "new.h5", job=job(None, shard))
        build_file(one, "new.h5", job=job(KEEP, shard))
        os.rename("new.h5", f"{number}.h5")
    parts = [store.read_part(f"{n}.h5") for n in (1, 2)]
    assert sum(part.edges.target.size for part in parts) == read_roadmap("old.h5").target.size


def test_a_journal_whose_records_stand_twice(place):
    one = problem(place)
    stopped(one, None)
    file = Path("new.h5.journal")
    whole = file.read_bytes()
    start = whole.index(b"\n", whole.index(b"\n") + 1) + 1
    mark, nodes, edges, _ = RECORD.unpack(whole[start : start + RECORD.size])
    assert mark == b"edge"
    again = whole[start:]
    file.write_bytes(whole + again)
    build_file(one, "new.h5")
    assert datasets("new.h5") == datasets("old.h5")
    assert nodes > 0
    assert edges > 0


def test_batches_that_interleave_are_written_by_node(place):
    """As a cluster that was stopped leaves them: the second chunk is done, the first is done later."""
    one = problem(place)
    from glider_stream.roadmap.builder import find_edges

    def finder(*given):
        parts = list(find_edges(*given))
        odd = parts[0].source % 2 == 1
        yield from [*parts[:0:-1], parts[0].of(odd), parts[0].of(~odd)]

    build_file(one, "new.h5", batch_pairs=BATCH, job=Job(finder=finder))
    assert datasets("new.h5") == datasets("old.h5")


def test_edges_that_lack_a_node_make_no_file(place):
    one = problem(place)
    from glider_stream.roadmap.builder import find_edges

    before = Path("old.h5").read_bytes()

    def finder(problem, position, source, batch_pairs):
        yield from find_edges(problem, position, source[source != 5], batch_pairs)

    with pytest.raises(
        RuntimeError, match="edges of nodes from 0 on are missing, or stand twice; no file is made"
    ):
        build_file(one, "old.h5", job=Job(finder=finder))
    assert Path("old.h5").read_bytes() == before
    assert sorted(path.name for path in place.glob("*old*")) == ["old.h5", "old.h5.journal"]


def test_a_file_that_reads_back_otherwise_replaces_nothing(place):
    one = problem(place)
    before, real = Path("old.h5").read_bytes(), store._check_written

    def damaged(temporary, *rest):
        with h5py.File(temporary, "r+") as file:
            file["edges/target"][7] += 1
        real(temporary, *rest)

    with (
        patch.object(store, "_check_written", damaged),
        pytest.raises(
            InputError, match=r"cannot be written whole: its edges/target reads back otherwise; 77 of 77"
        ),
    ):
        build_file(one, "old.h5")
    assert Path("old.h5").read_bytes() == before
    build_file(one, "old.h5")
    assert not list(place.glob(".old*"))


def test_parts_by_their_nodes():
    rng = np.random.default_rng(3)
    degree = rng.integers(0, 4, 50)
    total = int(degree.sum())
    whole = Edges(
        np.arange(50), degree, rng.integers(0, 50, total).astype(np.int32), rng.random((total, 6)),
        rng.integers(0, 9, (50, len(Status))).astype(np.int32),
    )  # fmt: skip
    for count in (1, 2, 5):
        owner = rng.integers(0, count, 50)
        parts = sorted((whole.of(owner == n) for n in range(count)), key=lambda part: part.source[0])
        again = in_order(list(by_node(iter(parts))))
        sources = np.concatenate([part.source for part in by_node(iter(parts))])
        assert sources.tolist() == list(range(50))
        assert again.digest() == whole.digest()
    assert in_order([]).digest() == ""


@pytest.mark.parametrize("name", ["env", "road.h5", "a[1]*.h5", "env.local"])
def test_left_over_files_are_distinguished_from_files_of_others(tmp_path, name):
    target = tmp_path / name
    suffix = target.suffix
    alien = [
        f".{name}.local",
        f".{name}.production",
        f".{name}.abcdefgh{suffix}",
        f".{name}",
        f".{name}.1-abc{suffix}",
    ]
    alien += [f".{name}.4194305-abcdefgh.{MARKER}{suffix}x", f"{name}.4194305-abcdefgh.{MARKER}{suffix}"]
    for one in alien:
        (tmp_path / one).write_text("mine")
    ours = tmp_path / f".{name}.4194305-abcdef_1.{MARKER}{suffix}"  # beyond the greatest number of a process
    ours.write_text("half")
    running = tmp_path / f".{name}.1-abcdef_2.{MARKER}{suffix}"
    running.write_text("half")
    folder, link = (tmp_path / f".{name}.4194305-abcdef_{n}.{MARKER}{suffix}" for n in (3, 4))
    folder.mkdir()
    link.symlink_to(tmp_path / alien[0])
    remove_abandoned(target)
    assert not ours.exists()
    assert running.exists()
    assert folder.is_dir()
    assert link.is_symlink()
    assert all((tmp_path / one).read_text() == "mine" for one in alien)


def test_a_build_named_as_a_users_files(place):
    """An output `env` beside .env.local, env.lock and env.journal of other programs."""
    mine = [".env.local", ".env.production", "env.lock", "env.part"]
    for name in mine:
        Path(name).write_text("mine")
    build_file(problem(place), "env")
    assert [Path(name).read_text() for name in mine] == ["mine"] * 4
    assert datasets("env") == datasets("old.h5")
    Path("env.journal").write_text("my diary")
    for restart in (False, True):
        with pytest.raises(InputError, match="has the name of this build's journal"):
            build_file(problem(place), "env", job=Job(restart=restart))
    assert Path("env.journal").read_text() == "my diary"
    os.remove("env.journal")
    os.mkfifo("env.journal")
    with pytest.raises(InputError, match="has the name of this build's journal"):
        build_file(problem(place), "env")


def test_what_a_killed_build_leaves_goes_with_the_next(place):
    code = (
        "import os, signal, sys; from glider_stream.roadmap import store; from glider_stream.cli import main\n"
        "store._check_written = lambda *a: os.kill(os.getpid(), signal.SIGKILL)\n"
        "sys.argv[1:] = ['build', 'small.toml', '-o', 'env']; main()"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == -9
    [left] = place.glob(".env.*")
    assert MARKER in left.name
    Path(".env.local").write_text("mine")
    build_file(problem(place), "env")
    assert [path.name for path in place.glob(".env*")] == [".env.local"]
