"""Small yos: the best way of a glider that may hold its depth, and yos along it where a current is best."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.small import roadmap

from glider_stream.scenario import scenario_from_text
from glider_stream.search.free import FreeAir, FreePolisher
from glider_stream.search.moves import improve, turns
from glider_stream.search.polish import Polisher
from glider_stream.search.yos import with_yos
from glider_stream.water.analytic import Uniform, Vortex, Vortices
from glider_stream.water.sampled import sample_flow

LEAST = 12.0
DEPTH = 60.0
BOX, HEIGHTS = (-400.0, 400.0), (-150.0, 0.0)


@pytest.fixture(scope="module")
def problem():
    """The small scenario in a current towards the east that is strongest at one depth."""
    small = scenario_from_text(roadmap().provenance.scenario).problem()
    layer = Vortices((Vortex(0.0, -5000.0, 5000.0, -0.6, DEPTH, 30.0),)).kernel(HEIGHTS)
    flow = sample_flow(layer, (50.0, 50.0, 5.0), BOX, BOX, HEIGHTS)
    return replace(small, evaluator=replace(small.evaluator, flow=flow))


@pytest.fixture(scope="module")
def route(problem):
    """One deep yo from the west to the east, and the same polished."""
    polisher = Polisher(problem, least_rise=LEAST)
    stops = np.array([[-190.0, 0.0, 0.0], [0.0, 0.0, -140.0], [190.0, 0.0, 0.0]])
    found = polisher.chain(stops, np.array([0.6, 0.6]), np.zeros(2))
    assert found is not None
    return polisher, found, improve(polisher, found)


def freed(polisher, chain):
    """A route as one that may hold its depth, before and after it is polished."""
    free = FreePolisher(polisher.problem)
    before = free.from_route(polisher, chain, 10)
    assert before is not None
    return free, before, free.best(before)


def test_a_level_leg_in_an_even_current_is_the_closed_form(problem):
    current, way = np.array([0.3, -0.2]), np.array([120.0, 70.0])
    air = FreeAir(replace(problem.evaluator, flow=Uniform(*current).kernel(HEIGHTS)))
    begin = np.array([[-60.0, 0.0, -50.0]])
    end = begin + np.array([*way, 0.0])
    leg = air.glide(begin, end, np.array([100.0]), np.array([0.3]), 0.0)
    fastest = float(problem.evaluator.polar.best_horizontal.max())
    a, b = fastest**2 - current @ current, current @ way
    assert leg.time[0] == pytest.approx((-b + math.sqrt(b * b + a * (way @ way))) / a, rel=1e-6)
    np.testing.assert_allclose(air.drift(begin, end, leg)[0], current, atol=1e-6)


def test_who_may_hold_his_depth_is_never_slower(route):
    polisher, found, _ = route
    _, before, after = freed(polisher, found)
    assert before.cost <= found.cost * (1 + 1e-5)  # shorter steps
    assert after.cost < 0.97 * before.cost
    deepest = after.stops[:, 2].min()
    assert -DEPTH - 15 < deepest < -DEPTH + 15


def test_yos_are_laid_along_it(route):
    polisher, found, _ = route
    free, _, way = freed(polisher, found)
    laid = with_yos(polisher, free, way, 1.3 * LEAST)
    assert laid is not None
    assert way.cost < laid.cost < 1.1 * way.cost
    assert (np.abs(np.diff(laid.stops[:, 2])) >= LEAST).all()
    assert len(turns(laid.stops)) > 4
    np.testing.assert_array_equal(laid.stops[[0, -1]], found.stops[[0, -1]])


def test_a_polished_route_turns_where_the_current_is_best(route):
    _, found, after = route
    assert after.cost < 0.95 * found.cost
    assert len(turns(after.stops)) > 2
    inner = after.stops[turns(after.stops), 2]
    assert abs(np.median(inner) + DEPTH) < 15
    rises = np.abs(np.diff(after.stops[:, 2]))
    assert rises.min() >= LEAST


def test_small_yos_that_gain_nothing_are_not_taken(problem):
    even = replace(problem, evaluator=replace(problem.evaluator, flow=Uniform(0.3, 0.0).kernel(HEIGHTS)))
    polisher = Polisher(even, least_rise=LEAST)
    stops = np.array([[-190.0, 0.0, 0.0], [0.0, 0.0, -130.0], [190.0, 0.0, 0.0]])
    found = polisher.chain(stops, np.array([0.8, 0.8]), np.zeros(2))
    assert found is not None
    assert len(turns(improve(polisher, found).stops)) == 1
