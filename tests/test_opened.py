"""An opened roadmap: made once, asked by many threads at once, equal to one question after another."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers.small import command, roadmap

import glider_stream
from glider_stream import planner
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import Scenario
from glider_stream.search.surfacing import Surfacing


@pytest.fixture
def file(tmp_path):
    write_roadmap(roadmap(), tmp_path / "small.h5")
    return tmp_path / "small.h5"


def some_ends(count, seed=7):
    """Starts and goals, most of them beside the nodes, some at nodes."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([-190, -190, -149], [190, 190, -1], (count, 2, 3))
    nodes = roadmap().position
    at_nodes = rng.random((count, 2)) < 0.3
    points[at_nodes] = nodes[rng.integers(len(nodes), size=int(at_nodes.sum()))]
    return [tuple(tuple(map(float, point)) for point in pair) for pair in points]


def answer(road, ends):
    return road.query(*ends).as_dict()


def test_threads_get_what_one_after_another_gets(file):
    ends = some_ends(60)
    alone = glider_stream.open(file)
    one_by_one = [answer(alone, pair) for pair in ends]
    starts, goals = [pair[0] for pair in ends[:12]], [pair[1] for pair in ends[:12]]
    table = alone.table(starts, goals)
    shared = glider_stream.open(file)
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(8) as pool:
            tables = [pool.submit(shared.table, starts, goals) for _ in range(4)]
            together = list(pool.map(lambda pair: answer(shared, pair), ends))
            for found in tables:
                assert found.result().tobytes() == table.tobytes()
    finally:
        sys.setswitchinterval(before)
    assert together == one_by_one


def test_the_water_is_made_once(file, monkeypatch, capsys):
    made = []
    monkeypatch.setattr(Scenario, "problem", lambda self, make=Scenario.problem: made.append(self) or make(self))
    road = glider_stream.open(file)
    assert not made
    path = road.query()
    road.card(path)
    road.table([path.start], [path.goal])
    road.arrivals()
    road.query(surfacing=Surfacing(most_yos=3))
    assert len(made) == 1
    assert command(capsys, "query", file, "--card").code == 0
    assert len(made) == 2


def test_functions_of_the_planner_take_it(file):
    road = glider_stream.open(file)
    assert glider_stream.open(road) is road
    assert planner.info(road) is road.roadmap
    assert planner.query(road).as_dict() == planner.query(file).as_dict() == road.query().as_dict()
    ends = some_ends(2)
    assert (
        planner.table(road, *zip(*ends, strict=True)).tobytes() == road.table(*zip(*ends, strict=True)).tobytes()
    )


@pytest.mark.parametrize("call", [planner.query, planner.build, glider_stream.OpenedRoadmap.query])
def test_a_wrong_keyword_is_named(call):
    with pytest.raises(TypeError, match="unexpected keyword argument 'wrong'"):
        call(None, wrong=1)


def test_a_rule_of_surfacing_is_the_scenarios_unless_another_is_given(file):
    road = glider_stream.open(file)
    assert road.planner() is road.planner(Surfacing())
    assert road.planner(Surfacing(most_yos=2)) is road.planner(Surfacing(most_yos=2))
