"""The roadmap file: to the letter of the format, whole or not there at all."""

import os
import signal
import subprocess
import sys
from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from helpers.small import command, roadmap, scenario_file, strict_json

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.base.output import check_output, replacing
from glider_stream.jobs import build as jobs
from glider_stream.kernels.cache import KERNEL_DIGEST
from glider_stream.kernels.edges import Status
from glider_stream.roadmap import store
from glider_stream.roadmap.compare import difference
from glider_stream.roadmap.store import read_roadmap, write_roadmap
from glider_stream.scenario import read_scenario, scenario_from_text
from glider_stream.vehicle.polar import glider_sha256
from glider_stream.water.inspect import flow_sha256

USUAL = [status for status in Status if status not in store.RARE]
DATASETS = {
    "nodes/position": ("<f8", "m"),
    "edges/indptr": ("<i8", "1"),
    "edges/target": ("<i4", "1"),
    "edges/time": ("<f8", "s"),
    "edges/cost": ("<f8", "s"),
    "edges/glide_angle": ("<f8", "rad"),
    "edges/heading": ("<f8", "rad"),
    "edges/speed": ("<f8", "m s-1"),
    "edges/miss": ("<f8", "m"),
    "pairs/by_node": ("<i4", "1"),
}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "small.h5"
    write_roadmap(roadmap(), path)
    return path


def assert_same(a, b):
    for field in (field for field in fields(a) if field.compare):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if isinstance(one, np.ndarray):
            assert one.dtype == other.dtype
            assert one.shape == other.shape
            assert one.tobytes() == other.tobytes(), field.name
        else:
            assert one == other, field.name


@pytest.mark.parametrize(("chunk", "batch"), [(1, 1), (7, 30), (100, 250), (store.CHUNK, 10**6)])
def test_a_file_written_in_batches_is_the_roadmap(tmp_path, monkeypatch, chunk, batch):
    monkeypatch.setattr(store, "CHUNK", chunk)
    scenario = scenario_file(tmp_path)
    jobs.build_file(read_scenario(scenario).problem(), tmp_path / "road.h5", batch_pairs=batch)
    road = read_roadmap(tmp_path / "road.h5")
    assert_same(replace(road, provenance=None, wall_s=0.0), replace(roadmap(), provenance=None, wall_s=0.0))


def without_edges(road):
    none = {name: np.empty(0) for name in ("time", "cost", "glide_angle", "heading", "speed", "miss")}
    return replace(road, indptr=np.zeros_like(road.indptr), target=np.empty(0, np.int32), **none)


def test_round_trip_is_bit_equal(file):
    assert_same(read_roadmap(file), roadmap())


def test_round_trip_without_edges_and_with_degrees(tmp_path):
    degrees = np.random.default_rng(1).random((len(roadmap().position), 2))
    bare = replace(without_edges(roadmap()), lonlat=degrees)
    write_roadmap(bare, tmp_path / "bare.h5")
    assert_same(read_roadmap(tmp_path / "bare.h5"), bare)
    with h5py.File(tmp_path / "bare.h5") as opened:
        assert opened["edges/target"].shape == (0,)
        lonlat = opened["nodes/lonlat"]
        assert (lonlat.dtype.str, lonlat.attrs["units"], lonlat.fletcher32) == ("<f8", "degrees", True)


def test_the_file_in_plain_h5py(file):
    road = roadmap()
    nodes, edges = len(road.position), road.target.size
    assert edges > 100
    shapes = {"nodes/position": (nodes, 3), "edges/indptr": (nodes + 1,), "pairs/by_node": (nodes, len(USUAL))}
    with h5py.File(file) as opened:
        found = []
        opened.visititems(lambda name, one: found.append(name) if isinstance(one, h5py.Dataset) else None)
        assert sorted(found) == sorted(DATASETS)
        for name, (kind, unit) in DATASETS.items():
            dataset = opened[name]
            assert dataset.dtype.str == kind, name
            assert dataset.shape == shapes.get(name, (edges,)), name
            assert dataset.attrs["units"] == unit, name
            assert len(dataset.attrs["long_name"]) > 8, name
            assert dataset.fletcher32, name
        indptr, target = opened["edges/indptr"][()], opened["edges/target"][()]
        assert indptr[0] == 0
        assert indptr[-1] == edges
        for begin, end in pairwise(indptr):
            assert (np.diff(target[begin:end]) > 0).all()
        assert ((opened["edges/miss"][()] >= 0) & (opened["edges/miss"][()] < 8)).all()
        source = np.repeat(np.arange(nodes), np.diff(indptr))
        rise = opened["nodes/position"][:, 2][target] - opened["nodes/position"][:, 2][source]
        assert (np.sign(opened["edges/glide_angle"][()]) == np.sign(rise)).all()


def test_the_attributes(file):
    problem = scenario_from_text(roadmap().provenance.scenario).problem()
    with h5py.File(file) as opened:
        said = dict(opened.attrs)
        pairs = dict(opened["pairs"].attrs)
    asked = {"format", "format_version", "software_version", "created", "scenario", "flow_sha256"}
    asked |= {"glider_sha256", "kernel_digest", "seed", "complete"}
    assert asked <= set(said)
    assert said["format"] == "glider-stream/roadmap"
    assert said["format_version"] == 1
    assert said["software_version"] == version("glider-stream")
    assert bool(said["complete"]) is True
    assert said["seed"] == 0
    assert said["kernel_digest"] == KERNEL_DIGEST
    assert said["flow_sha256"] == flow_sha256(problem.evaluator.flow)
    assert said["glider_sha256"] == glider_sha256(problem.evaluator.polar)
    created = datetime.fromisoformat(said["created"])
    assert created.utcoffset() == timedelta(0)
    assert abs(datetime.now(UTC) - created) < timedelta(hours=1)
    counts = {status.name.lower() for status in USUAL}
    assert set(pairs) == counts | {"evaluated", "wall_s", "threads"}
    assert pairs["evaluated"] == sum(pairs[name] for name in counts)
    assert pairs["evaluated"] == 77 * 20
    assert pairs["connected"] == roadmap().target.size
    assert pairs["wall_s"] > 0
    assert pairs["threads"] >= 1


def test_complete_is_written_last(tmp_path, monkeypatch):
    written = []
    attribute, dataset = h5py.AttributeManager.__setitem__, h5py.Group.create_dataset

    def set_attribute(self, name, value):
        written.append(name)
        attribute(self, name, value)

    def create_dataset(self, name, *arguments, **options):
        written.append(name)
        return dataset(self, name, *arguments, **options)

    monkeypatch.setattr(h5py.AttributeManager, "__setitem__", set_attribute)
    monkeypatch.setattr(h5py.Group, "create_dataset", create_dataset)
    write_roadmap(roadmap(), tmp_path / "small.h5")
    assert written[-1] == "complete"
    assert written.count("complete") == 1
    assert set(DATASETS) <= set(written)


def test_the_file_comes_into_its_place_complete(tmp_path, monkeypatch):
    moves = []
    move = os.replace

    def watch(source, target):
        with h5py.File(source) as opened:
            moves.append((Path(source).parent, Path(target), bool(opened.attrs["complete"])))
        move(source, target)

    monkeypatch.setattr(os, "replace", watch)
    write_roadmap(roadmap(), tmp_path / "small.h5")
    assert moves == [(tmp_path, tmp_path / "small.h5", True)]
    assert [path.name for path in tmp_path.iterdir()] == ["small.h5"]


def test_a_writer_that_fails_leaves_the_old_file(file, monkeypatch):
    before = file.read_bytes()
    monkeypatch.setattr(store, "_DESCRIBED", {})
    with pytest.raises(KeyError):
        write_roadmap(roadmap(), file)
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


KILLED = """
import os, signal, sys
from glider_stream import planner
from glider_stream.roadmap import store
def half(file, tally):
    file._flush()
    os.kill(os.getpid(), signal.SIGKILL)
store.RoadmapWriter.finish = half
planner.build(sys.argv[1], sys.argv[2])
"""


def test_a_killed_writer_leaves_nothing_at_the_output(tmp_path):
    roadmap()  # the kernels are compiled by now
    scenario, output = scenario_file(tmp_path), tmp_path / "killed.h5"
    ended = subprocess.run([sys.executable, "-c", KILLED, scenario, output], capture_output=True, check=False)
    assert ended.returncode == -signal.SIGKILL
    assert not output.exists()


def test_outputs_are_as_readable_as_any_new_file(tmp_path):
    (tmp_path / "usual").touch()
    with replacing(tmp_path / "new.txt") as temporary:
        temporary.write_text("x")
    assert (tmp_path / "new.txt").stat().st_mode == (tmp_path / "usual").stat().st_mode


@pytest.mark.parametrize("place", ["/dev/null", "/dev/zero"])
def test_a_device_is_not_replaced(place):
    with pytest.raises(InputError, match=f"the output {place} "):
        check_output(place)


def test_an_output_that_is_a_link_stays_one(tmp_path):
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    link.symlink_to(real)
    with replacing(link) as temporary:
        temporary.write_text("x")
    assert link.is_symlink()
    assert real.read_text() == "x"


def test_a_damaged_file_never_passes_unseen(file):
    whole, random = file.read_bytes(), np.random.default_rng(7)
    road, refused = roadmap(), 0
    damaged = file.with_name("damaged.h5")
    for place in random.integers(0, len(whole), 200):
        parts = bytearray(whole)
        parts[place] ^= 1 << random.integers(8)
        damaged.write_bytes(parts)
        try:
            read = read_roadmap(damaged)
        except InputError:
            refused += 1
            continue
        for name in (
            "position",
            "indptr",
            "target",
            "time",
            "cost",
            "glide_angle",
            "heading",
            "speed",
            "miss",
        ):
            assert getattr(read, name).tobytes() == getattr(road, name).tobytes()
    assert refused > 20


def test_a_roadmap_is_read_without_its_scenario_file(file):
    assert scenario_from_text(read_roadmap(file).provenance.scenario) == read_scenario(scenario_file(file.parent))


def test_what_differs_between_two_roadmaps(tmp_path, capsys):
    road = roadmap()
    assert difference(road, road).same_edges
    later = replace(road, time=road.time + np.where(np.arange(road.time.size) == 7, 0.25, 0.0))
    changed = difference(road, later)
    assert changed.edges == (0, 0, road.target.size)
    assert changed.times == (0.25, 1)
    fewer = planner.build(scenario_file(tmp_path), tmp_path / "fewer.h5", overrides=["neighbours.k=15"])
    write_roadmap(road, tmp_path / "road.h5")
    said = command(capsys, "info", tmp_path / "road.h5", "--diff", tmp_path / "fewer.h5")
    assert said.code == 0
    assert "< k = 20" in said.out
    assert "> k = 15" in said.out
    told = strict_json(
        command(capsys, "info", tmp_path / "road.h5", "--diff", tmp_path / "fewer.h5", "--json").out
    )
    assert told["edges"]["only_first"] == road.target.size - told["edges"]["both"]
    assert told["edges"]["only_second"] == fewer.target.size - told["edges"]["both"]
    assert not told["same_edges"]
    other = planner.build(scenario_file(tmp_path), overrides=["sampling.shape=[4,4,3]"])
    assert difference(road, other).edges is None


def test_a_status_of_rising_water_stands_only_where_a_pair_has_it(tmp_path):
    plain, rare = roadmap(), Status.CARRIED_AWAY
    counts = plain.node_counts.copy()
    counts[3, rare] += 2
    lifted = replace(plain, node_counts=counts, counts=plain.counts | {"carried_away": 2})
    for made, named in ((plain, False), (lifted, True)):
        write_roadmap(made, tmp_path / "road.h5")
        with h5py.File(tmp_path / "road.h5") as file:
            assert file["pairs/by_node"].shape[1] == len(Status) - (not named)
            assert ("carried_away" in file["pairs/by_node"].attrs["statuses"].split()) == named
            assert ("carried_away" in file["pairs"].attrs) == named
        read = read_roadmap(tmp_path / "road.h5")
        assert read.counts == made.counts
        np.testing.assert_array_equal(read.node_counts, made.node_counts)
