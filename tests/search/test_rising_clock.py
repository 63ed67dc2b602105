"""Routes over slices in a wave that lifts and travels: flown by DOP853 they arrive when they say."""

import math

import numpy as np
import pytest
from helpers.reference import replay_rising
from helpers.small import SCENARIO

from glider_stream import planner
from glider_stream.scenario import read_scenario

pytestmark = pytest.mark.wide

WAVE = """\
[flow]
kind = "internal-wave"
w = 0.15
length = 400.0
depth = 150.0
period = 900.0

"""
HOW = ("steering.method=flow-map", "neighbours.kind=reachable", "neighbours.limit=24", "sampling.shape=[5,5,3]")
SLICES = ("departures.first=0", "departures.last=1200", "departures.every=300")


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    file = tmp_path_factory.mktemp("wave") / "wave.toml"
    file.write_text(WAVE + SCENARIO[SCENARIO.index("[glider]") :])
    return file


def off_by_dop853(path, flow, departure):
    """How far from its goal [m] a route ends, flown leg by leg with the clock, and how late [s]."""
    here, clock = path.legs[0].start, departure
    for leg in path.legs:
        way = math.cos(leg.glide_angle)
        through = leg.speed * np.array(
            [way * math.cos(leg.heading), way * math.sin(leg.heading), math.sin(leg.glide_angle)]
        )
        *here, lasted = replay_rising(flow, (*here, clock), through, leg.end[2], 2.0 * leg.duration)
        clock += lasted
    return math.dist(here, path.goal), clock - departure - path.travel_time


@pytest.mark.parametrize(("departure", "polish"), [(0.0, False), (137.0, False), (700.0, True)])
def test_a_route_over_slices_arrives_when_it_says(scenario, tmp_path, departure, polish):
    planner.build(scenario, tmp_path / "many.h5", overrides=[*HOW, *SLICES])
    path = planner.query(tmp_path / "many.h5", depart=departure, polish=polish)
    assert path.found
    assert any(abs(leg.lifted) > 2.0 for leg in path.legs)
    flow = read_scenario(scenario, HOW).problem().evaluator.flow
    off, late = off_by_dop853(path, flow, departure)
    # each leg of a roadmap ends up to 9 mm beside its stop, and those after it begin there
    assert off < 0.1
    assert abs(late) < 0.1


def test_a_plan_with_the_clock_is_no_later_than_one_over_slices(scenario, tmp_path):
    planner.build(scenario, tmp_path / "many.h5", overrides=[*HOW, *SLICES])
    over = planner.query(tmp_path / "many.h5", depart=137.0)
    planned = planner.plan(scenario, depart=137.0, overrides=HOW)
    assert planned.travel_time == pytest.approx(over.travel_time, rel=0.02)
