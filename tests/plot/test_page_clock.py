"""The page of a route with the clock running holds the current of several times, for its slider."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.small import strict_json

from glider_stream.opened import open_scenario
from glider_stream.plot import sample_field
from glider_stream.plot.page import MOST_MOMENTS, _moments

pytestmark = pytest.mark.slow

SETS = ["flow.period=900.0", "sampling.shape=[4, 2, 3]", "query.goal=[1000.0, 500.0, -250.0]"]


@pytest.fixture(scope="module")
def opened():
    return open_scenario("swinging-gyre", SETS)


def test_it_holds_the_current_of_the_sliders_times(opened, tmp_path):
    path = opened.query(depart=100.0)
    opened.plot(path, tmp_path / "page.html", depths=[0.0, 150.0])
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    data = strict_json(re.findall(r'<script type="application/json" id="data">(.*?)</script>', text)[0])
    assert data["when"] == ", at the time of the slider"
    times, (columns, rows) = data["current"]["times"], data["current"]["cells"]
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(path.travel_time, abs=0.06)
    # sixteen a cycle
    assert np.diff(times).max() <= 900.0 / 16
    west, east, south, north = data["box"]
    x, y = west + 20.5 / columns * (east - west), south + 7.5 / rows * (north - south)
    for n, since in enumerate(np.linspace(0.0, path.travel_time, len(times))):
        u, v = sample_field(opened.problem.evaluator.flow, x, y, -150.0, 100.0 + since)
        kept = [data["current"][name][n][1][7 * columns + 20] for name in "uv"]
        np.testing.assert_allclose(kept, [1e3 * u, 1e3 * v], atol=0.51)
    assert json.dumps(data["current"]["u"][0]) != json.dumps(data["current"]["u"][1])


def test_a_long_route_has_no_more_times_than_a_page_can_hold(opened):
    path = opened.query()
    flow = opened.problem.evaluator.flow
    late = replace(path, legs=(replace(path.legs[0], duration=1e6),))
    assert _moments(flow, late).size == MOST_MOMENTS
    assert _moments(flow, replace(path, frozen=True)).tolist() == [0.0]
