"""Searches over slices against labels expanded at their own times; routes flown from end to end."""

import math
from dataclasses import replace

import h5py
import numpy as np
import pytest
from helpers.slices import arrival_by_labels, problem, sliced
from scipy.integrate import solve_ivp

import glider_stream
from glider_stream.base.errors import InputError
from glider_stream.base.threads import threads
from glider_stream.kernels.edges import CONNECTED
from glider_stream.kernels.flow import velocity
from glider_stream.roadmap import store
from glider_stream.roadmap.compare import difference
from glider_stream.search import sliced as sliced_module
from glider_stream.search.answer import planner_of
from glider_stream.search.slice_planner import SlicePlanner
from glider_stream.search.sliced import SliceSearch
from glider_stream.search.surfacing import Surfacing
from glider_stream.search.time_dependent import ClockPlanner

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def search():
    return SliceSearch(sliced(), problem())


def arrival(hops, departure):
    return departure + sum(edge.time for _, _, edge in hops)


def flown(flow, hops, when):
    """Where a glider ends (3,) [m] that flies some legs one after another, each when the last one has ended."""
    at = np.array(hops[0][0])
    for _, _, edge in hops:
        along = edge.speed * math.cos(edge.glide_angle)
        through = along * math.cos(edge.heading), along * math.sin(edge.heading)
        sinks = edge.speed * math.sin(edge.glide_angle)

        def rate(t, at, through=through, sinks=sinks):
            u, v = velocity(flow, *at, t)
            return [u + through[0], v + through[1], sinks]

        at = solve_ivp(rate, (when, when + edge.time), at, "DOP853", rtol=1e-9, atol=1e-6, max_step=10.0).y[:, -1]
        when += edge.time
    return at


@pytest.mark.parametrize("departure", [0.0, 370.0])
def test_routes_are_as_fast_as_those_of_labels(search, departure):
    position = sliced().position
    start, goal = len(position) - 2, len(position) - 1
    hops, agreement = search.fastest(position[start], position[goal], departure)
    truth = arrival_by_labels(problem(), position, start, goal, departure)
    assert agreement.agreed
    assert agreement.legs >= len(hops)
    assert agreement.most < 100.0
    least = truth - departure
    assert -0.5 <= arrival(hops, departure) - truth <= 0.01 * least
    end = flown(problem().evaluator.flow, hops, departure)
    assert np.linalg.norm(end - position[goal]) < 0.5


def test_points_beside_the_nodes_are_attached(search):
    start, goal = np.array([420.0, 380.0, 0.0]), np.array([1510.0, 640.0, -300.0])
    hops, agreement = search.fastest(start, goal, 500.0)
    assert agreement.agreed
    assert (hops[0][0] == start).all()
    assert (hops[-1][1] == goal).all()
    assert np.linalg.norm(flown(problem().evaluator.flow, hops, 500.0) - goal) < 0.5


def test_a_leg_from_end_to_end_is_looked_at(search):
    one, alone = sliced().at(0), 0
    for edge in range(0, one.target.size, one.target.size // 8):
        start = one.position[int(np.searchsorted(one.indptr, edge, side="right")) - 1]
        goal = one.position[one.target[edge]] + np.array([1.0, 0.0, 0.0])
        direct = problem().evaluator.connect_pair(start, goal, 0.0)
        hops, _ = search.fastest(start, goal, 0.0)
        assert direct.status != CONNECTED or arrival(hops, 0.0) <= direct.time
        alone += len(hops) == 1
    assert alone > 0


def test_a_roadmap_that_stays_in_its_file_gives_the_same_routes(search, tmp_path, monkeypatch):
    """Bit by bit, though it reads only some edges; a file that was written since, or is damaged, is refused."""
    monkeypatch.setattr(store, "CHUNK", 256)
    monkeypatch.setattr(sliced_module, "AHEAD", 1)
    file, position = tmp_path / "slices.h5", sliced().position
    store.write_roadmap(sliced(), file)
    beside = np.array([420.0, 380.0, 0.0]), np.array([1510.0, 640.0, -300.0])
    near = position[-2], position[sliced().target[sliced().indptr[(len(position) - 2) * 4]]]
    for ends, departure in ((near, 0.0), ((position[-2], position[-1]), 370.0), (beside, 1300.0)):
        kept = store.stored_roadmap(file)
        by_file = SliceSearch(kept, problem())
        assert str(by_file.fastest(*ends, departure)) == str(search.fastest(*ends, departure))
        assert ends is not near or by_file.rows.known.mean() < 0.9
    opened = glider_stream.open(file)
    assert opened.query().as_dict()["legs"] == glider_stream.open(sliced()).query().as_dict()["legs"]
    assert opened.planner().slices.rows.known.any()
    assert difference(opened.roadmap.at(1), sliced().at(1)).same_edges
    kept, late = store.stored_roadmap(file), store.stored_roadmap(file)
    with h5py.File(file, "r+") as damaged:
        damaged["edges/target"][:] = 0
    with pytest.raises(InputError, match="has been replaced since it was opened; open it again"):
        SliceSearch(late, problem()).fastest(*beside, 0.0)
    with pytest.raises(InputError, match="has been replaced since it was opened; open it again"):
        kept.whole()
    with pytest.raises(InputError, match="its targets do not rise; build it again"):
        SliceSearch(store.stored_roadmap(file), problem()).fastest(*beside, 0.0)


def test_threads_do_not_change_a_bit(search):
    ends = np.array([420.0, 380.0, 0.0]), np.array([1510.0, 640.0, -300.0])
    found = []
    for count in (1, 2):
        with threads(count):
            found.append(search.fastest(*ends, 333.0))
    assert str(found[0]) == str(found[1])


def test_slices_that_are_wrong_are_found_out():
    """Times that are off by a fifth, some this way and some that: the route is still one that is flown."""
    road = sliced()
    worse = replace(road, time=road.time * np.random.default_rng(0).uniform(0.8, 1.2, road.time.size))
    position = road.position
    hops, agreement = SliceSearch(worse, problem()).fastest(position[-2], position[-1], 300.0)
    assert agreement.agreed
    assert agreement.most > 5.0
    assert agreement.rounds > 1
    assert np.linalg.norm(flown(problem().evaluator.flow, hops, 300.0) - position[-1]) < 0.5
    assert "differ by" in str(agreement)


def test_a_departure_outside_the_slices_is_refused(search):
    position = sliced().position
    with pytest.raises(InputError, match="from 0 s to 1800 s; got 1801 s"):
        search.fastest(position[-2], position[-1], 1801.0)


def test_no_way_is_the_honest_no():
    road = sliced()
    none = {name: getattr(road, name)[:0] for name in ("time", "cost", "glide_angle", "heading", "speed", "miss")}
    empty = replace(road, indptr=np.zeros_like(road.indptr), target=road.target[:0], **none)
    hops, agreement = SliceSearch(empty, problem()).fastest(road.position[-2], road.position[-1], 0.0)
    assert hops is None
    assert agreement.agreed


def test_a_query_of_slices_is_a_query(search):
    road = glider_stream.open(sliced())
    path = road.query()
    assert isinstance(road.planner(), SlicePlanner)
    assert path.clock_runs
    assert "slices and truth differ by" in path.notes[0]
    by_labels = ClockPlanner(problem(), sliced().position).query()
    assert abs(path.travel_time - by_labels.travel_time) <= 0.01 * by_labels.travel_time
    later = road.planner().leaving(700.0)
    assert isinstance(later, SlicePlanner)
    assert later.query().departure == 700.0
    assert np.isfinite(road.arrivals()).sum() > 10
    assert road.why_no_edges() == ""


def test_frozen_paths_need_a_slice_of_their_departure():
    road = sliced()
    frozen = planner_of(replace(problem(), frozen=True, departure=600.0), road, Surfacing())
    assert difference(frozen.roadmap, road.at(1)).same_edges
    with pytest.raises(InputError, match="no slice of the roadmap; choose one of: 0, 600, 1200, 1800 s"):
        planner_of(replace(problem(), frozen=True, departure=601.0), road, Surfacing())


def test_beyond_the_last_slice_legs_are_found_when_they_are_needed():
    late = replace(problem(), departure=1800.0)
    path = planner_of(late, sliced(), Surfacing()).query()
    assert path.travel_time == ClockPlanner(late, sliced().position).query().travel_time
    assert "some legs of this route leave later: its legs were found without them" in path.notes[0]
