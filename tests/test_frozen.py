"""Every output of a route whose currents are frozen says so: files, texts, JSON, figures and the page."""

import json
import re
from dataclasses import replace

import pytest
from helpers.routes import route
from helpers.small import strict_json

from glider_stream.evaluation.level_set import Bound
from glider_stream.opened import open_scenario
from glider_stream.pilot.export import EXPORTS, export_path
from glider_stream.search.path import FROZEN

pytestmark = pytest.mark.slow

MARK = re.compile("FROZEN")
SETS = ["flow.period=900.0", "sampling.shape=[4, 2, 3]", "query.goal=[1000.0, 500.0, -250.0]"]
STILL = "query.frozen=true"
ENERGY = ["cost.kind=energy", "cost.preset=slocum", "cost.hotel=0.9"]


@pytest.fixture(scope="module")
def still():
    return open_scenario("swinging-gyre", [*SETS, STILL])


def says(table):
    """Whether JSON says `frozen` at its top."""
    return strict_json(json.dumps(table))["frozen"] is True


def texts_of(figure):
    from matplotlib.text import Text

    return " ".join(text.get_text() for text in figure.findobj(Text))


@pytest.mark.parametrize("form", EXPORTS)
def test_every_export_says_so(tmp_path, form):
    """All forms that exist: a new one is in this test as soon as it is in the table."""
    frozen = replace(route(), departure=0.0, frozen=True)
    name = {"targets": "targets", ".ma": "goto_l20.ma"}.get(form, f"a{form}")
    for marked in (True, False):
        for file in export_path(replace(frozen, frozen=marked), tmp_path / name):
            text = file.read_text(encoding="utf-8")
            told = strict_json(text)["frozen"] if form == ".json" else FROZEN in text
            assert told is marked, file.name


def test_texts_and_json_say_so(still):
    path = still.query()
    assert path.found
    assert FROZEN in str(path)
    assert says(path.as_dict())
    card = still.card(path)
    assert FROZEN in str(card)
    assert says(card.as_dict())
    none = replace(path, legs=(), cost=float("inf"))
    assert FROZEN in str(none)
    assert says(none.as_dict())
    polished = still.query(polish=True, thin=20.0)
    assert FROZEN in str(polished)


def test_score_and_trade_off_say_so(still, tmp_path):
    path = still.query(outputs=[tmp_path / "path.json"])
    assert path.frozen
    scored = still.score(tmp_path / "path.json")
    assert FROZEN in str(scored)
    assert says(scored.as_dict())
    front = open_scenario("swinging-gyre", [*SETS, *ENERGY, STILL]).trade_off()
    assert FROZEN in str(front)
    assert says(front.as_dict())


def test_a_bound_says_so():
    found = Bound(3600.0, 36.0, 3, (50.0, 40.0, 30.0), frozen=True)
    assert MARK.search(str(found))
    assert says(found.as_dict())
    moving = replace(found, frozen=False)
    assert not MARK.search(str(moving))
    assert "frozen" not in moving.as_dict()


def test_departures_are_refused(still):
    with pytest.raises(ValueError, match="frozen paths hold for one departure"):
        still.when_to_leave((0.0, 600.0), every=300.0)


def test_figures_and_page_say_so(still, tmp_path):
    path = still.query()
    moving = open_scenario("swinging-gyre", SETS)
    clock = moving.query()
    assert MARK.search(texts_of(still.plot(path)))
    assert MARK.search(texts_of(still.plot_routes({"one": path, "two": clock})))
    # fronts of frozen currents beside a route with the clock running
    assert MARK.search(texts_of(still.plot(clock, chart=True, fronts=0.1)))
    told = texts_of(still.plot(path, chart=True))
    assert MARK.search(told)
    assert "as the route passes" not in told
    told = texts_of(moving.plot(clock, chart=True, fronts=0.1))
    assert not MARK.search(told)
    assert "as the route passes" in told
    assert "by the earliest way to each node" in told
    for opened, drawn, marked in ((still, path, True), (moving, clock, False)):
        opened.plot(drawn, tmp_path / "page.html")
        assert (MARK.search((tmp_path / "page.html").read_text(encoding="utf-8")) is not None) is marked
