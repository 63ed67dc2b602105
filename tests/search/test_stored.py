"""Queries of a roadmap that stays in its file, bit by bit those of the same roadmap in memory."""

import h5py
import numpy as np
import pytest
from helpers.small import command, scenario_file, strict_json

import glider_stream
from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.plot import roadmap as drawing
from glider_stream.roadmap import rows, store
from glider_stream.roadmap.roadmap import EDGE_FIELDS
from glider_stream.scenario import scenario_of
from glider_stream.search import query
from glider_stream.search.query import FASTEST, Planner

ENERGY = ["cost.kind=energy", "cost.preset=slocum"]
PAIRS = [
    ((-190.0, 190.0, 0.0), (160.0, -160.0, 0.0)),
    ((-160.0, 160.0, 0.0), (0.0, 0.0, -75.0)),
    ((0.0, 80.0, 0.0), (123.0, -99.0, -120.0)),
    ((-30.0, 20.0, -50.0), (100.0, 20.0, -10.0)),
]


@pytest.fixture(scope="module", params=["time", "energy"])
def file(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    overrides = ["steering.method=flow-map", *(ENERGY if request.param == "energy" else [])]
    planner.build(scenario_file(folder), folder / "road.h5", overrides=overrides)
    return folder / "road.h5"


@pytest.fixture
def small_blocks(monkeypatch):
    """Blocks of 16 edges; every roadmap stays in its file, and its searches are directed by a bound."""
    for module, name, value in ((store, "CHUNK", 16), (store, "LARGE", 0), (rows, "AHEAD", 1), (query, "FAR", 0)):
        monkeypatch.setattr(module, name, value)


def test_routes_are_the_same_and_only_some_edges_are_read(file, small_blocks, monkeypatch):
    road = store.read_roadmap(file)
    problem = scenario_of(road).problem()
    shares = []
    for start, goal in PAIRS:
        monkeypatch.setattr(query, "FAR", 1000)
        undirected = Planner(road, problem)
        monkeypatch.setattr(query, "FAR", 0)
        kept = Planner(store.stored_roadmap(file), problem)
        assert kept.query(start, goal).as_dict() == undirected.query(start, goal).as_dict()
        shares.append(kept._rows(query.CHEAPEST).known.mean())
        whole = undirected.query(start, goal, FASTEST)
        assert kept.query(start, goal, FASTEST).as_dict() == whole.as_dict()
        ends = [goal for _, goal in PAIRS]
        assert kept.table([start], ends).tolist() == undirected.table([start], ends).tolist()
    assert min(shares) < 0.7
    assert kept.arrivals(PAIRS[0][0]).tobytes() == undirected.arrivals(PAIRS[0][0]).tobytes()
    assert kept.remaining(PAIRS[0][1]).tobytes() == undirected.remaining(PAIRS[0][1]).tobytes()


def test_an_opened_roadmap_answers_all_questions(file, small_blocks, monkeypatch):
    monkeypatch.setattr(drawing, "SUCCESSIVE", 10)
    kept, whole = glider_stream.open(file), glider_stream.open(planner.info(file))
    assert isinstance(kept.searches.source, store.StoredRoadmap)
    assert str(kept) == str(whole)
    assert str(kept.density()) == str(whole.density())
    assert kept.why_no_edges() == ""
    rule = glider_stream.Surfacing(most_yos=1)
    for options in ({}, {"surfacing": rule}, {"polish": True}, {"thin": 20.0}, {"within": 0.05}):
        answers = [road.query(*PAIRS[0], **options).as_dict() for road in (kept, whole)]
        assert answers[0]["legs"] == answers[1]["legs"]
    texts = [text.get_text() for text in kept.plot().findobj(match=lambda one: hasattr(one, "get_text"))]
    assert "(d) How one steers, of 640 sampled edges" in texts
    assert "Edges sampled, for all below" in texts
    assert kept.roadmap.time.tobytes() == whole.roadmap.time.tobytes()


def test_some_edges_are_those_of_the_whole(file, small_blocks):
    road, kept = store.read_roadmap(file), store.stored_roadmap(file)
    some = np.random.default_rng(0).integers(0, road.edge_count, 50)
    assert kept.legs(some).tobytes() == road.legs(some).tobytes()
    assert kept.targets(some).tobytes() == road.targets(some).tobytes()
    assert kept.legs(some[:0]).shape == (0, len(EDGE_FIELDS))


@pytest.mark.parametrize(
    ("name", "value", "what"),
    [("cost", np.nan, "holds NaN"), ("target", 10**6, "a target is no node"), ("heading", np.inf, "holds NaN")],
)
def test_damage_where_a_query_reads_is_refused(file, small_blocks, tmp_path, capsys, name, value, what):
    (tmp_path / "damaged.h5").write_bytes(file.read_bytes())
    with h5py.File(tmp_path / "damaged.h5", "r+") as damaged:
        damaged[f"edges/{name}"][:] = value
    said = command(capsys, "query", tmp_path / "damaged.h5")
    assert said.code == 2
    assert what in said.err
    said = command(capsys, "verify", tmp_path / "damaged.h5", "--sample", 20, "--json")
    assert said.code == 1
    assert what in strict_json(said.out)["faults"][0]


def test_a_file_that_was_replaced_is_refused(file, small_blocks, tmp_path):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(file.read_bytes())
    opened = glider_stream.open(copy)
    copy.write_bytes(file.read_bytes()[:-1] + b"\0")
    with pytest.raises(InputError, match="has been replaced since it was opened; open it again"):
        opened.query()
