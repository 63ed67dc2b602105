"""Dates and times in UTC where the departure is known, hours where it is not: in tables, card and scores."""

import csv
import json
import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from helpers.routes import DEPARTS, route
from helpers.small import roadmap

from glider_stream.base.clock import moment, span
from glider_stream.kernels.edges import Edge, Status
from glider_stream.pilot.card import card
from glider_stream.pilot.export import export_path
from glider_stream.pilot.score import score
from glider_stream.scenario import scenario_from_text
from glider_stream.search.query import Planner

UNKNOWN = replace(route(), departs=None)


def test_a_moment_and_a_length_of_time():
    assert moment(DEPARTS, 45_296.0) == "2024-11-21 00:34Z"
    assert moment(datetime(2023, 12, 31, 23, 59, tzinfo=UTC), 60.0) == "2024-01-01 00:00Z"
    assert moment(None, 174_282.0) == "48.41 h"
    assert span(174_282.0) == "174,282 s (48.41 h)"


@pytest.mark.parametrize(("path", "etas"), [
    (route(), ["2024-11-20T12:16:40Z", "2024-11-20T12:33:20Z", "2024-11-20T12:50:00Z"]),
    (UNKNOWN, ["0.278 h", "0.556 h", "0.833 h"]),
])  # fmt: skip
def test_tables(tmp_path, path, etas):
    for name in ("a.csv", "a.geojson", "a.windows.csv", "a.kml"):
        export_path(path, tmp_path / name)
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))
    assert [row["eta"] for row in rows] == etas
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert [feature["properties"]["eta"] for feature in features[1:]] == etas
    [window] = csv.DictReader((tmp_path / "a.windows.csv").read_text().splitlines())
    assert window["to"] == etas[-1]
    assert window["from"] == ("2024-11-20T12:00:00Z" if path.departs else "0.000 h")
    assert all(f"eta {eta}" in (tmp_path / "a.kml").read_text() for eta in etas)


def problem():
    return scenario_from_text(roadmap().provenance.scenario).problem()


@pytest.mark.parametrize("departs", [None, DEPARTS])
def test_the_path_and_the_card(departs):
    known = replace(problem(), departs=departs)
    path = Planner(roadmap(), known).query()
    arrival = moment(departs, path.travel_time)
    title, *legs = str(path).splitlines()
    assert span(path.travel_time) in title
    assert (f"arrives {arrival}" in title) == (departs is not None)
    for line, leg in zip(legs, path.legs, strict=True):
        assert line.split("  d")[0].split("  c")[0].strip() == moment(departs, leg.depart)
    lines = str(card(path, known)).splitlines()
    assert lines[len(path.legs) + 1].endswith(arrival)
    assert not any(line.endswith(" s") for line in lines)
    assert card(path, known).as_dict()["departs"] == (None if departs is None else "2024-11-20T12:00:00+00:00")


@pytest.mark.parametrize("departs", [None, DEPARTS])
def test_the_score(departs):
    edge = Edge(int(Status.CONNECTED), 7200.0, 7200.0, -0.4, 0.0, 0.4, 0.0)
    path = replace(route(), departs=departs)
    found = score([np.zeros(3), np.array([1.0, 2.0, -3.0])], lambda a, b, since: edge, None, lambda hops: path)
    found = replace(found, legs=(replace(found.legs[0], glides=3),), notes=("as drawn",))
    said = str(found).splitlines()
    assert said[0] == "the route takes 7,200 s (2.00 h)" + (
        "" if departs is None else ", arrives 2024-11-20 14:00Z"
    )
    assert said[1] == "  note: as drawn"
    assert found.as_dict()["notes"] == ["as drawn"]
    assert said[3].strip().startswith(moment(departs, 0.0))
    assert math.isclose(found.time, 7200.0)
