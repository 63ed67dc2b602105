"""Polished routes: never worse, exact, within their limits; their derivatives; a closed form met."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.small import command, roadmap, strict_json

import glider_stream
from glider_stream.base.errors import InputError
from glider_stream.kernels.terrain import OpenWater
from glider_stream.roadmap.verify import replayed_misses
from glider_stream.scenario import scenario_from_text
from glider_stream.search.glides import Air
from glider_stream.search.moves import improve
from glider_stream.search.polish import Polisher
from glider_stream.vehicle.cost import GRAVITY, Energy
from glider_stream.water.analytic import Uniform

HEIGHTS = (-150.0, 0.0)


@pytest.fixture(scope="module")
def problem():
    """The small scenario made into objects."""
    return scenario_from_text(roadmap().provenance.scenario).problem()


@pytest.fixture(scope="module")
def found():
    """Its route between the nodes, and the same polished."""
    road = glider_stream.open(roadmap())
    return road.query(), road.query(polish=True)


def in_flow(problem, flow, **changes):
    """The problem in another flow."""
    return replace(problem, evaluator=replace(problem.evaluator, flow=flow, **changes))


def polisher(problem):
    """Of routes whose legs may be as short as 15 m."""
    return Polisher(problem, least_rise=15.0)


def zigzag(start, goal, legs, deepest):
    """Stops evenly from start to goal, at the surface and at a height by turns."""
    stops = np.linspace(start, goal, legs + 1)
    stops[1::2, 2], stops[2::2, 2] = deepest, 0.0
    return stops


def route(problem, stops):
    """The route through stops, from the controls of still water."""
    way = np.diff(stops, axis=0)
    angle = np.arctan2(np.abs(way[:, 2]), np.hypot(way[:, 0], way[:, 1]))
    found = polisher(problem).chain(stops, angle, np.arctan2(way[:, 1], way[:, 0]))
    assert found is not None
    return found


def test_a_polished_route_is_quicker_and_says_what_it_was(found):
    before, after = found
    assert after.travel_time < 0.995 * before.travel_time
    assert after.unpolished == (len(before.legs), before.travel_time, before.cost)
    assert after.as_dict()["unpolished"]["travel_time_s"] == before.travel_time
    assert f"; before it was polished {len(before.legs)}, " in str(after)
    assert "polished" not in str(before)
    assert "unpolished" not in before.as_dict()


def test_its_legs_end_where_they_say_by_another_integrator(found, problem):
    legs = found[1].legs
    stops = np.array([legs[0].start, *(leg.end for leg in legs)])
    rows = [[leg.duration, leg.cost, leg.glide_angle, leg.heading, leg.speed, leg.miss] for leg in legs]
    away = np.arange(len(legs))
    misses = replayed_misses(problem.evaluator, problem.departure, stops, away, away + 1, np.array(rows))
    assert misses.max() < 1.0
    np.testing.assert_array_equal(stops[0], found[0].legs[0].start)
    np.testing.assert_array_equal(stops[-1], found[0].legs[-1].end)


def test_it_keeps_depths_horizon_and_polar(found, problem):
    glide, integration = problem.evaluator.polar, problem.evaluator.integration
    for leg in found[1].legs:
        assert problem.lo[2] <= leg.end[2] <= 0.0
        assert leg.duration <= integration.dt * integration.steps
        way = int(leg.glide_angle > 0)
        assert glide.shallowest[way] <= abs(leg.glide_angle) <= glide.steepest[way]
        assert (leg.end[2] > leg.start[2]) == (leg.glide_angle > 0)


def test_a_floor_is_kept(problem):
    shallow = in_flow(problem, problem.evaluator.flow, terrain=OpenWater(-100.0))
    start, goal = np.array([-150.0, 150.0, 0.0]), np.array([120.0, -120.0, 0.0])
    chain = route(shallow, zigzag(start, goal, 4, -70.0))
    after = improve(polisher(shallow), chain)
    assert after.cost < chain.cost
    assert after.stops[:, 2].min() >= -100.0


def test_polish_of_a_polished_route_changes_next_to_nothing(problem):
    chain = route(problem, zigzag(np.array([-150.0, 150.0, 0.0]), np.array([120.0, -120.0, 0.0]), 4, -90.0))
    once = polisher(problem).polish(chain)
    twice = polisher(problem).polish(once)
    assert once.cost * (1 - 1e-3) < twice.cost <= once.cost


def test_derivatives_are_those_of_flown_legs(problem, gyre):
    swinging = in_flow(problem, gyre)
    chain = route(swinging, zigzag(np.array([-100.0, 100.0, 0.0]), np.array([60.0, -80.0, 0.0]), 2, -60.0))
    air = Air(swinging.evaluator)
    begin, end, glides = chain.stops[:-1], chain.stops[1:], chain.glides
    slopes = air.slopes(begin, end, glides)
    for n in range(7):
        times = []
        for step in (0.5, -0.5):
            ends, departs = np.concatenate([begin, end], axis=1), glides.departs.copy()
            if n == 6:
                departs += step
            else:
                ends[:, n] += step
            beside = air.glide(ends[:, :3], ends[:, 3:], glides.angle, glides.heading, departs)
            assert beside.exact.all()
            times.append(beside.time)
        np.testing.assert_allclose(slopes.time[:, n], times[0] - times[1], rtol=1e-3, atol=1e-4)


def test_the_clock_runs_from_leg_to_leg(problem, gyre):
    swinging = in_flow(problem, gyre)
    chain = route(swinging, zigzag(np.array([-100.0, 100.0, 0.0]), np.array([60.0, -80.0, 0.0]), 4, -30.0))
    after = polisher(swinging).polish(chain)
    assert after.cost < chain.cost
    np.testing.assert_allclose(after.glides.departs[1:], np.cumsum(after.glides.time)[:-1], atol=1e-9)
    evaluator, at = swinging.evaluator, after.stops[0]
    for _, end, edge in polisher(swinging).hops(after):
        n = [*map(tuple, after.stops[1:])].index(tuple(end))
        rows = evaluator.trace(at, edge, after.glides.departs[n])
        at = rows[-1, 1:]
    assert math.dist(at, after.stops[-1]) < 0.01


def test_in_a_uniform_current_it_is_the_straight_optimum(problem):
    # as many yos as bring every leg to the fastest glide: |goal - current T| = Vh T
    current, way = np.array([0.3, -0.2]), np.array([300.0, -300.0])
    even = in_flow(problem, Uniform(*current).kernel(HEIGHTS))
    start = np.array([-150.0, 150.0, 0.0])
    goal = start + np.array([*way, 0.0])
    stops = zigzag(start, goal, 4, -40.0)
    stops[1:-1, :2] += [[40.0, 30.0], [-20.0, 50.0], [-30.0, -40.0]]
    after = improve(polisher(even), route(even, stops))
    fastest = float(even.evaluator.polar.best_horizontal.max())
    # (fastest^2 - |c|^2) T^2 + 2 c.way T - |way|^2 = 0
    a, b = fastest**2 - current @ current, current @ way
    best = (-b + math.sqrt(b * b + a * (way @ way))) / a
    assert best <= after.cost * (1 + 1e-7)  # legs end within 0.01 mm of their stops
    assert after.cost < 1.0001 * best


def test_in_a_uniform_current_the_least_energy_is_that_of_the_best_glide_angle(problem):
    # one dive of depth d and one climb cost P T + k d, k the pump's energy of a metre: no more yos cost less
    pump = Energy(hotel=0.5, trim=0.0, volume=20.0, efficiency=((100.0, 0.3),), density=1025.0)
    current, way = np.array([0.3, -0.2]), np.array([300.0, -300.0])
    costly = in_flow(problem, Uniform(*current).kernel(HEIGHTS), cost=pump)
    start = np.array([-150.0, 150.0, 0.0])
    stops = zigzag(start, start + np.array([*way, 0.0]), 2, -60.0)
    stops[1, :2] += [30.0, 50.0]
    after = improve(polisher(costly), route(costly, stops))

    polar, per_metre = costly.evaluator.polar, 1025.0 * GRAVITY * 20e-6 / 0.3
    angle = np.linspace(polar.shallowest[0], polar.steepest[0], 20_001)
    speed = np.interp(angle, np.linspace(angle[0], angle[-1], polar.speed.shape[1]), polar.speed[0])
    # (Vh^2 - |c|^2) T^2 + 2 c.way T - |way|^2 = 0
    a, b = (speed * np.cos(angle)) ** 2 - current @ current, current @ way
    time = np.where(a > 0, (-b + np.sqrt(np.maximum(b * b + a * (way @ way), 0.0))) / a, np.inf)
    energy = (0.5 + per_metre * speed * np.sin(angle) / 2) * time
    best = energy.min()
    assert energy[0] > 1.001 * best  # so the optimum is no end of the polar
    assert best * (1 - 1e-6) <= after.cost < 1.0005 * best


@pytest.mark.slow
def test_energy_is_what_is_polished_where_the_cost_is_energy(problem):
    pump = Energy(hotel=0.5, trim=5.0, volume=500.0, efficiency=((100.0, 0.15), (1000.0, 0.45)), density=1025.0)
    costly = in_flow(problem, problem.evaluator.flow, cost=pump)
    chain = route(costly, zigzag(np.array([-150.0, 150.0, 0.0]), np.array([120.0, -120.0, 0.0]), 4, -90.0))
    after = improve(polisher(costly), chain)
    time, legs = after.glides.time.sum(), len(after.glides.time)
    turns = [z for before, z, then in zip(*(after.stops[n : n - 2 or None, 2] for n in range(3)), strict=True)
             if before > z < then]  # fmt: skip
    assert after.cost == pytest.approx(0.5 * time + 5.0 * legs + float(pump.inflection(turns).sum()))
    assert after.cost < chain.cost


def test_legs_that_only_pass_their_stops_are_polished_too():
    # a deep yo, whose dive is too steep to end at the node
    road = glider_stream.open(roadmap())
    ends = (0.0, 0.0, -75.0), (3.0, 0.0, -75.0)
    before, after = road.query(*ends), road.query(*ends, polish=True)
    assert before.legs[0].miss > 5.0
    assert after.travel_time < 0.5 * before.travel_time
    assert math.dist(after.legs[-1].trajectory[-1, 1:], ends[1]) < 0.01


def test_a_rule_of_surfacing_is_kept():
    road = glider_stream.open(roadmap())
    rule = glider_stream.Surfacing(most_yos=1)
    before = road.query((-160.0, 160.0, 0.0), (160.0, -160.0, 0.0), surfacing=rule)
    after = road.query((-160.0, 160.0, 0.0), (160.0, -160.0, 0.0), surfacing=rule, polish=True)
    assert after.travel_time < before.travel_time
    assert rule.holds(after)


def test_a_bound_on_energy_is_not_polished():
    road = glider_stream.open(roadmap())
    with pytest.raises(InputError, match="a route within a bound on energy is not polished"):
        road.query(polish=True, most_energy=1000.0)


def test_the_command_line_polishes(capsys, tmp_path):
    from glider_stream.roadmap.store import write_roadmap

    file = tmp_path / "small.h5"
    write_roadmap(roadmap(), file)
    before = strict_json(command(capsys, "query", file, "--json").out)
    after = strict_json(command(capsys, "query", file, "--polish", "--json").out)
    assert after["unpolished"]["travel_time_s"] == before["travel_time_s"]
    assert after["travel_time_s"] < before["travel_time_s"]
