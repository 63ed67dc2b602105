"""The pilot's card, in water where everything is known in closed form."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.routes import route
from helpers.small import command, roadmap, strict_json

from glider_stream.pilot.card import card
from glider_stream.roadmap.store import write_roadmap
from glider_stream.water.analytic import Uniform

DIVES = [[0.0, 0.0, 0.0], [600.0, 0.0, -200.0], [600.0, 800.0, -5.0], [600.0, 400.0, -90.0], [0.0, 400.0, -8.0]]
U, V = 0.3, -0.2


def problem(best):
    polar = SimpleNamespace(best_horizontal=np.array([best - 0.01, best]))
    flow = Uniform(U, V).kernel((-300.0, 0.0))
    return SimpleNamespace(departure=0.0, evaluator=SimpleNamespace(flow=flow, polar=polar))


def test_a_uniform_current():
    said = card(route(stops=DIVES), problem(0.5))
    # legs go east, north, south, west, 1000 s each
    assert [row.over_ground for row in said.legs] == pytest.approx([0.6, 0.8, 0.4, 0.6])
    assert [row.along for row in said.legs] == pytest.approx([U, V, -V, -U])
    assert [row.across for row in said.legs] == pytest.approx([V, -U, U, -V])
    goal = DIVES[-1][:2]
    left = [math.dist(stop[:2], goal) for stop in DIVES]
    assert [row.toward_goal for row in said.legs] == pytest.approx(-np.diff(left) * 86.4 / 1000)
    assert said.whole.toward_goal == pytest.approx(left[0] / 4000 * 86.4)
    assert said.whole.over_ground == pytest.approx(0.6)
    assert [row.arrives for row in said.legs] == [1000.0, 2000.0, 3000.0, 4000.0]
    assert said.under == (2000.0, 2000.0)
    assert not said.whole.outrun
    table = said.as_dict()
    assert table["whole"]["over_ground_km_per_day"] == pytest.approx(0.6 * 86.4)
    assert table["surface_to_surface_s"] == [2000.0, 2000.0]
    text = str(said)
    assert "2024-11-20 12:16Z" in text
    assert "surface to surface: 2 times, 0.56 to 0.56 h" in text


def test_station_can_be_held_up_to_the_best_speed_and_not_beyond():
    current = math.hypot(U, V)
    assert not card(route(stops=DIVES), problem(current + 1e-6)).whole.outrun
    said = card(route(stops=DIVES), problem(current - 1e-6))
    assert all(row.outrun for row in said.legs)
    assert str(said).endswith("faster than the vehicle's 0.36 m/s: it cannot hold station on legs 1, 2, 3, 4")


def test_one_dive_and_no_dive():
    assert "surface to surface: 0.56 h" in str(card(route(stops=DIVES[:3]), problem(0.5)))
    said = card(route(stops=DIVES[:2]), problem(0.5))
    assert said.under == ()
    assert "does not surface twice" in str(said)


def test_from_the_command_line(tmp_path, capsys):
    write_roadmap(roadmap(), tmp_path / "road.h5")
    table = strict_json(command(capsys, "query", tmp_path / "road.h5", "--card", "--json").out)
    path = strict_json(command(capsys, "query", tmp_path / "road.h5", "--json").out)
    assert table["whole"]["duration_s"] == pytest.approx(path["travel_time_s"])
    assert len(table["legs"]) == len(path["legs"])
    assert command(capsys, "query", tmp_path / "road.h5", "--card", "--trade-off").code == 2
