"""A cluster of two processes, one of which dies: the same bytes as one process; what is refused."""

import os
import signal
from pathlib import Path

import pytest
from helpers.builds import BATCH, METHODS, datasets, expected, problem
from helpers.small import command, scenario_file

from glider_stream.base.errors import InputError
from glider_stream.jobs import cluster
from glider_stream.jobs.build import Job, build_file

pytest.importorskip("distributed")
# what dask says while its workers die is its own
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    expected.cache_clear()
    return tmp_path


@pytest.mark.wide
def test_a_worker_that_dies(place):
    with cluster.scheduler("local:2") as workers:
        pids = [int(worker["pid"]) for worker in workers.client.run(lambda: {"pid": os.getpid()}).values()]
        killed = []

        def kill(progress):
            if not killed:
                os.kill(pids[0], signal.SIGKILL)
                killed.append(progress.done)

        for method in ("streamline", "reachable"):
            job = Job(finder=workers.find_edges, warm=False)
            build_file(
                problem(place, METHODS[method]), f"{method}.h5", progress=kill, batch_pairs=BATCH // 4, job=job
            )
            assert datasets(f"{method}.h5") == expected(method)
        assert 0 < killed[0] < 1540
        with pytest.raises(
            InputError, match=r"a worker has kernels .* and not other; install the same versions there"
        ):
            workers.client.submit(cluster.check_software, cluster.software() | {"kernels": "other"}).result()


def test_what_is_refused(capsys, place, monkeypatch):
    monkeypatch.setattr(cluster, "WAIT", 0.5)
    for address, words in {
        "nowhere": "tcp://HOST:PORT",
        "local:0": "at least 1 worker",
        "tcp://127.0.0.1:9": "no Dask scheduler answers at tcp://127.0.0.1:9",
    }.items():
        said = command(capsys, "build", "small.toml", "-o", "road.h5", "--scheduler", address)
        assert said.code == 2, said
        assert words in said.err
        assert "Traceback" not in said.err
        assert not list(Path().glob("road*"))
