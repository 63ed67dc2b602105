"""Thinning: every leg flown again by another integrator, the rules that it keeps, what it says."""

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.reference import flown
from helpers.routes import route
from helpers.small import TOLERANCE, command, roadmap, strict_json

from glider_stream.base.clock import span
from glider_stream.base.errors import InputError
from glider_stream.kernels.edges import Edge, Status
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import scenario_from_text
from glider_stream.search.answer import with_fewer_legs
from glider_stream.search.layered import SurfacingPlanner
from glider_stream.search.path import hops_of
from glider_stream.search.query import Planner
from glider_stream.search.surfacing import Surfacing
from glider_stream.search.thin import thin

GOOD = Edge(int(Status.CONNECTED), 10.0, 10.0, -0.4, 0.0, 0.4, 0.0)


@pytest.fixture(scope="module")
def search():
    return Planner(roadmap(), scenario_from_text(roadmap().provenance.scenario).problem())


def test_every_leg_of_a_thinned_route_can_be_flown(search):
    random = np.random.default_rng(1)
    fewer = 0
    for _ in range(15):
        path = search.query(*random.uniform((-200, -200, -150), (200, 200, 0), (2, 3)))
        stops = [path.legs[0].start, *(leg.end for leg in path.legs)]
        for tolerance in (20.0, 60.0, 1e4):
            thinned = thin(path, tolerance, search.connect, search.fly)
            fewer += len(thinned.legs) < len(path.legs)
            kept = [thinned.legs[0].start, *(leg.end for leg in thinned.legs)]
            assert (kept[0] == path.start).all()
            assert (kept[-1] == path.goal).all()
            places = [next(n for n, stop in enumerate(stops) if (stop == one).all()) for one in kept]
            assert places == sorted(set(places))
            for leg in thinned.legs:
                assert leg.start[2] != leg.end[2]
                end = flown(search.problem.evaluator.flow, leg, [leg.duration])[-1]
                assert np.linalg.norm(end - leg.end) < TOLERANCE + 0.1
            for (a, b), leg in zip(pairwise(places), thinned.legs, strict=True):
                for stop in stops[a + 1 : b]:
                    share = np.linspace(0, 1, 2001)[:, None]
                    line = leg.start + share * (leg.end - leg.start)
                    assert np.linalg.norm(line - stop, axis=1).min() <= tolerance + 0.1
            assert thinned.unthinned == (len(path.legs), path.travel_time)
            again = thin(path, tolerance, search.connect, search.fly)
            assert again.as_dict() == thinned.as_dict()
    assert fewer > 20


def test_a_leg_that_does_not_end_where_it_says_is_refused(search):
    path = search.query()
    turned = replace(path.legs[1], heading=path.legs[1].heading + 1.0)
    with pytest.raises(InputError, match=r"leg 2 ends [\d.]+ m from where it should; `verify` the roadmap"):
        search.fly(hops_of(replace(path, legs=(path.legs[0], turned, *path.legs[2:]))))


def test_a_route_longer_than_the_stack_is_deep():
    stops = [[10.0 * n, float(n % 7) ** 2, -1.0 - n % 5] for n in range(3000)]
    path, flights = route(stops=stops), []
    none = GOOD._replace(status=int(Status.NO_HIT))
    thin(path, 1e9, lambda a, b, since: none, lambda hops: flights.append(hops) or path)
    assert [hop[1].tolist() for hop in flights[0]] == stops[1:]


def test_stops_that_must_stay_stay():
    stops = [[0.0, 0.0, 0.0], [900.0, 0.0, -50.0], [1800.0, 0.0, -1.0], [2700.0, 0.0, -50.0], [3600.0, 0.0, -2.0]]
    path, flights = route(stops=stops), []
    fly, up = (lambda hops: flights.append(hops) or path), (lambda stop: stop[2] > -10)
    thin(path, 1e3, lambda a, b, since: GOOD, fly, up)
    assert [hop[1].tolist() for hop in flights[0]] == [stops[2], stops[4]]


def test_a_rule_of_surfacing_survives(search):
    """Where fewer legs would stay under for too long, the route is left as it was."""
    rule = Surfacing(None, 0.2)
    bound = SurfacingPlanner(roadmap(), search.problem, rule)
    path = bound.query((-190.0, 190.0, 0.0), (160.0, -160.0, 0.0))
    assert rule.holds(path)
    assert not Surfacing(None, 0.1).holds(path)
    # two climbs on end are of one yo
    assert Surfacing(1).holds(path)
    up_and_down = replace(
        path, legs=tuple(replace(path.legs[0], glide_angle=g) for g in (-0.4, 0.4, 0.3, -0.4, 0.4))
    )
    assert Surfacing(2).holds(up_and_down)
    assert not Surfacing(1).holds(up_and_down)
    slow = SimpleNamespace(connect=lambda a, b, since: GOOD, rule=rule)
    late = replace(path, legs=tuple(replace(leg, duration=3600.0) for leg in path.legs))
    keeper = SurfacingPlanner(roadmap(), search.problem, slow.rule)
    keeper.fly = lambda hops: late
    kept = with_fewer_legs(path, 1e4, keeper, None)
    assert kept.legs == path.legs
    dear = replace(path, cost=1e9)
    free = SimpleNamespace(connect=lambda a, b, since: GOOD, fly=lambda hops: dear, rule=Surfacing())
    assert with_fewer_legs(path, 1e4, free, 10.0).cost == path.cost
    assert with_fewer_legs(path, 1e4, free, None).cost == 1e9


def test_from_the_command_line(tmp_path, capsys):
    write_roadmap(roadmap(), tmp_path / "road.h5")
    ends = "--start=-180,-150,-10", "--goal=150,150,-140"
    whole = strict_json(command(capsys, "query", tmp_path / "road.h5", *ends, "--json").out)
    asked = "query", tmp_path / "road.h5", *ends, "--thin", "10000"
    fewer = strict_json(command(capsys, *asked, "--json").out)
    assert fewer["unthinned"] == {"legs": len(whole["legs"]), "travel_time_s": whole["travel_time_s"]}
    assert len(fewer["legs"]) < len(whole["legs"])
    said = command(capsys, *asked).out.splitlines()[0]
    assert said.endswith(f"; before it was thinned {len(whole['legs'])}, {span(whole['travel_time_s'])}")
    for wrong in ("-1", "nan", "inf"):
        refused = command(capsys, *asked[:-1], wrong)
        assert (refused.code, f"got {wrong}" in refused.err) == (2, True)
    assert math.isfinite(fewer["travel_time_s"])
