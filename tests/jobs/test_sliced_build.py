"""Builds of several departures: killed and resumed, in parts, on an older roadmap, by a cluster's chunks."""

import numpy as np
import pytest
from helpers.builds import datasets, interrupt
from helpers.slices import DEPARTURES, problem, sliced

from glider_stream import planner
from glider_stream.base.errors import InputError, Stopped
from glider_stream.jobs import build as jobs
from glider_stream.jobs import cluster
from glider_stream.roadmap.store import read_any_roadmap, write_roadmap
from glider_stream.scenario import read_scenario

pytestmark = pytest.mark.slow

BATCH = 3000


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    path = tmp_path_factory.mktemp("slices") / "whole.h5"
    write_roadmap(sliced(), path)
    return datasets(path)


def test_a_killed_build_goes_on_and_ends_in_the_same_bits(tmp_path, expected):
    path = tmp_path / "road.h5"
    with pytest.raises(Stopped, match="nodes are kept"):
        jobs.build_file(problem(), path, progress=interrupt, batch_pairs=BATCH)
    assert not path.exists()
    looked = []
    jobs.build_file(problem(), path, progress=looked.append, batch_pairs=BATCH)
    assert looked[-1].done < sum(sliced().counts.values()) + 1
    assert datasets(path) == expected


def test_parts_merge_to_the_same_bits(tmp_path, expected):
    parts = [tmp_path / f"{n}.h5" for n in (1, 2, 3)]
    scenario = read_scenario("swinging-gyre", DEPARTURES)
    for n, part in enumerate(parts, 1):
        planner.build_part(scenario, part, f"{n}/3")
    merged = planner.merge(parts, tmp_path / "road.h5")
    assert merged.departures.tolist() == sliced().departures.tolist()
    assert datasets(tmp_path / "road.h5") == expected


@pytest.mark.filterwarnings("ignore")  # dask's own words while its workers end
@pytest.mark.wide
def test_a_cluster_gives_the_same_bits(tmp_path, expected):
    pytest.importorskip("distributed")
    with cluster.scheduler("local:1") as workers:
        job = jobs.Job(finder=workers.find_edges, warm=False)
        jobs.build_file(problem(), tmp_path / "road.h5", job=job, batch_pairs=100 * BATCH)
    assert datasets(tmp_path / "road.h5") == expected


def test_an_older_roadmap_of_the_same_water_is_taken_over(tmp_path, expected):
    everyone = np.ones(len(sliced().position), bool)
    everyone[::3] = False
    job = jobs.Job(base=(sliced(), everyone))
    jobs.build_file(problem(), tmp_path / "road.h5", job=job, batch_pairs=BATCH)
    assert datasets(tmp_path / "road.h5") == expected


def test_what_changed_of_a_sliced_roadmap_is_found_out(tmp_path):
    scenario = read_scenario("swinging-gyre", DEPARTURES)
    write_roadmap(sliced(), tmp_path / "old.h5")
    planner.build(scenario, tmp_path / "new.h5", base=tmp_path / "old.h5")
    assert planner.differ(tmp_path / "old.h5", tmp_path / "new.h5").same_edges
    fewer = read_scenario("swinging-gyre", [*DEPARTURES, "departures.last=1200"])
    with pytest.raises(InputError, match="differs in departure"):
        planner.build(fewer, tmp_path / "new.h5", base=tmp_path / "old.h5")


def test_info_and_verify_read_it(tmp_path):
    write_roadmap(sliced(), tmp_path / "road.h5")
    assert "4 departures from 0 s to 1,800 s" in str(planner.info(tmp_path / "road.h5"))
    assert planner.verify(tmp_path / "road.h5", 8).holds
    assert read_any_roadmap(tmp_path / "road.h5").departures.size == 4
