"""A cluster that grows or ends in the middle of a build, which goes on elsewhere to the same bytes."""

import pytest
from helpers.builds import BATCH, datasets, expected, problem
from helpers.small import scenario_file

from glider_stream.base.errors import InputError
from glider_stream.jobs import cluster
from glider_stream.jobs.build import Job, build_file
from glider_stream.roadmap.builder import find_edges

distributed = pytest.importorskip("distributed")
# what dask says while it ends is its own
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    expected.cache_clear()
    return tmp_path


class Ending(cluster.Cluster):
    """A cluster that is gone after two chunks, as its client tells it."""

    def _evaluated(self, problem, position, source, batch_pairs):
        parts = find_edges(problem, position, source, batch_pairs)
        if source.size < len(position):
            yield from parts  # the sample whose steps are checked first
            return
        yield next(parts)
        yield next(parts)
        raise distributed.client.FutureCancelledError(key="evaluate-1", reason="scheduler-connection-lost")


def test_a_scheduler_that_ends(place):
    """What it found is kept, and the build goes on without it."""
    seen = []
    words = r"the cluster failed: .*scheduler-connection-lost; give the same command to continue, here or with"
    job = Job(finder=Ending(None, 1).find_edges)
    with pytest.raises(InputError, match=words):
        build_file(problem(place), "road.h5", progress=seen.append, batch_pairs=BATCH // 4, job=job)
    assert (place / "road.h5.journal").exists()
    done = seen[-1].done
    build_file(problem(place), "road.h5", progress=seen.append, batch_pairs=BATCH)
    assert seen[2].done > done > 0
    assert datasets("road.h5") == expected("streamline")


def test_a_worker_that_joins_late(place, monkeypatch):
    """It gets its share: as many chunks wait as all workers of the moment can use."""
    monkeypatch.setattr(cluster, "COUNT_AGAIN", 0.0)
    whole, asked = expected("streamline"), []
    with distributed.Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
        workers, real = cluster.Cluster(client, 1), client.submit
        monkeypatch.setattr(client, "submit", lambda *a, **k: asked.append(1) or real(*a, **k))

        def join(progress):
            asked.append(0)
            if len(client.nthreads()) == 1:
                client.cluster.scale(2)
                client.wait_for_workers(2)

        job = Job(finder=workers.find_edges, warm=False)
        build_file(problem(place), "road.h5", progress=join, batch_pairs=40, job=job)
    between = "".join(map(str, asked)).split("0")
    assert len(between[1]) >= cluster.AHEAD  # asked for between the first chunk, when it joined, and the second
    assert datasets("road.h5") == whole
