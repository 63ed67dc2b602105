"""What each question does with a roadmap of several departures: answered truly, or refused."""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from helpers.slices import problem, sliced
from helpers.small import command, strict_json
from helpers.small import roadmap as small_roadmap

import glider_stream
from glider_stream.base.errors import InputError
from glider_stream.kernels.edges import CONNECTED
from glider_stream.opened import OpenedRoadmap
from glider_stream.roadmap.store import write_roadmap
from glider_stream.search.path import load_path
from glider_stream.search.sliced import SliceSearch
from glider_stream.search.time_dependent import ClockPlanner

pytestmark = pytest.mark.slow

BY_SLICES = "slices and truth differ by"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("sliced") / "tides.h5"
    write_roadmap(sliced(), path)
    return path


@pytest.fixture
def road():
    return glider_stream.open(sliced())


def frozen(road):
    """A roadmap whose scenario asks for frozen paths."""
    scenario = road.provenance.scenario.replace("[query]", "[query]\nfrozen = true")
    return OpenedRoadmap(replace(road, provenance=replace(road.provenance, scenario=scenario)))


def test_a_query_leaves_when_it_is_told_to(file, capsys):
    said = command(capsys, "query", file, "--depart", "370", "--json")
    path = strict_json(said.out)
    assert said.code == 0
    assert BY_SLICES in said.err
    assert path["departure_s"] == 370.0
    assert BY_SLICES in path["notes"][0]
    alone = ClockPlanner(replace(problem(), departure=370.0), sliced().position).query()
    assert abs(path["travel_time_s"] - alone.travel_time) < 0.01 * alone.travel_time


def test_a_departure_beside_the_slices_is_answered_without_them(road):
    path = road.query(depart=2500)
    assert "from 0 s to 1800 s, and this route leaves at 2500 s: its legs were found without" in path.notes[0]
    alone = ClockPlanner(replace(problem(), departure=2500.0), sliced().position).query()
    assert path.travel_time == alone.travel_time


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (["--depart", "soon"], "must be seconds or a time such as"),
        (["--depart", "2024-10-29T06:00"], "the flow has no calendar; give seconds"),
        (["--depart", "nan"], "must be a finite time"),
        (["--depart", "0", "--depart-between", "0", "600"], "--depart cannot be used with"),
    ],
)
def test_departures_that_make_no_sense_are_refused(file, capsys, given, says):
    said = command(capsys, "query", file, *given)
    assert said.code == 2
    assert says in " ".join(said.err.split())


def test_frozen_paths_take_a_slice_of_any_departure():
    still = frozen(sliced())
    path = still.query(depart=600)
    assert (path.frozen, path.departure) == (True, 600.0)
    one = glider_stream.open(sliced().at(1))
    with pytest.raises(InputError, match="which is no slice of the roadmap; choose one of: 0, 600"):
        still.query(depart=601)
    card = still.card(path)
    assert np.isfinite([row.along for row in card.legs]).all()
    # a roadmap of one departure has legs of no other
    with pytest.raises(InputError, match=r"leave at 0 s; got 601; leave `query\.frozen` out"):
        frozen(one.roadmap).query(depart=601)


def test_in_a_steady_current_any_departure_is_alike():
    road = glider_stream.open(small_roadmap())
    assert road.query(depart=77).travel_time == road.query().travel_time
    when = datetime(2024, 10, 29, tzinfo=UTC)
    road.searches._kept["problem"] = replace(road.problem, departs=when)
    assert road.query(depart="2024-10-29T06:00").departs == when + timedelta(hours=6)


def test_tables_arrivals_and_trade_offs_let_the_clock_run(road):
    ends = [tuple(sliced().position[n]) for n in (3, 40)]
    free = ClockPlanner(replace(problem(), departure=500.0), sliced().position)
    assert road.table([ends[0]], ends, depart=500).tolist() == free.table([ends[0]], ends).tolist()
    assert road.arrivals(ends[0], depart=500).tolist() == free.arrivals(ends[0]).tolist()
    with pytest.raises(InputError, match="the cost is time"):
        road.trade_off()


def test_what_was_found_scores_thins_and_fits_its_card(road, tmp_path):
    path = road.query(depart=370, outputs=[tmp_path / "path.json"])
    scored = road.score(tmp_path / "path.json", depart=370)
    assert scored.time == pytest.approx(path.travel_time, abs=0.5)
    assert load_path(tmp_path / "path.json").departure == 370.0
    assert road.card(path).whole.arrives == pytest.approx(path.travel_time)
    thinned = road.query(depart=370, thin=200.0)
    assert thinned.unthinned[0] == len(path.legs)
    assert BY_SLICES in thinned.notes[0]


def test_the_card_reads_the_current_of_the_time_at_which_a_leg_passes(road):
    here, elsewhere = glider_stream.open(sliced()), replace(problem(), departure=1200.0)
    path = road.query(depart=370)
    here.searches._kept["problem"] = elsewhere
    assert [row.along for row in here.card(path).legs] == [row.along for row in road.card(path).legs]


@pytest.mark.wide
def test_when_to_leave_asks_the_slices(file, capsys):
    said = command(capsys, "query", file, "--depart-between", "0", "600", "--every", "300", "--json")
    rows = json.loads(said.out)["departures"]
    assert [row["departure_s"] for row in rows] == [0.0, 300.0, 600.0]
    for row in rows:
        alone = ClockPlanner(replace(problem(), departure=row["departure_s"]), sliced().position).query()
        assert abs(row["travel_time_s"] - alone.travel_time) < 0.01 * alone.travel_time


def test_a_figure_of_it_shows_one_slice_over_the_current_of_its_time(road, monkeypatch):
    drawn = []
    monkeypatch.setattr("glider_stream.plot.draw.draw_roadmap", lambda *what: drawn.append(what))
    road.searches._kept["problem"] = replace(problem(), departure=700.0)
    road.plot()
    slice_drawn, at, *_, title = drawn[0]
    assert slice_drawn.target.size == sliced().at(1).target.size
    assert at.departure == 600.0
    assert title == "Slice 2 of 4"


def test_no_leg_outlasts_the_flow():
    """The currents end a little after the fastest route, or a little before: then there is none."""
    search = SliceSearch(sliced(), problem())
    start, goal = sliced().position[-2], sliced().position[-1]
    hops, _ = search.fastest(start, goal, 0.0)
    takes = sum(edge.time for _, _, edge in hops)
    evaluator = problem().evaluator
    for ends, found in ((takes + 30.0, True), (takes - 5.0, False)):
        flow = evaluator.flow._replace(extent=evaluator.flow.extent._replace(t_hi=ends))
        search.problem = replace(problem(), evaluator=replace(evaluator, flow=flow))
        bounded, agreement = search.fastest(start, goal, 0.0)
        assert agreement.agreed
        assert (bounded is not None) == found
        assert not found or [edge.status for _, _, edge in bounded] == [CONNECTED] * len(hops)
