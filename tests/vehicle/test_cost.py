"""Energy as a cost: against every simple path there is; the trade-off against time, and what bounds it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.roadmaps import COST, random_roadmap
from helpers.small import command, roadmap, scenario_file, strict_json

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.kernels.cost import edge_cost
from glider_stream.roadmap.roadmap import Roadmap
from glider_stream.scenario import read_scenario
from glider_stream.search.query import Blend, Planner
from glider_stream.vehicle.cost import GRAVITY, PRESETS, Energy, TravelTime

ENERGY = [
    'cost={}', "cost.kind=energy", "cost.hotel=2.0", "cost.trim=5.0", "cost.volume=300.0", "cost.density=1025.0",
    "cost.efficiency=[[0.0, 0.1], [200.0, 0.3]]",
]  # fmt: skip
SETS = [one for one in ENERGY if one != "cost={}"]


def by_hand(cost, legs):
    """What some legs take: (z at its start, glide angle, time) each."""
    total, dived = 0.0, True
    for z, angle, time in legs:
        total += cost.hotel * time + cost.trim
        if angle > 0 and dived:
            share = 0.1 + min(-z, 200.0) / 200.0 * 0.2
            total += 1025.0 * GRAVITY * -z * 300e-6 / share
        dived = angle < 0
    return total


def test_the_pump_works_against_the_depth():
    # physics.md, section 3: ideal work for 500 cc
    ideal = replace(COST, volume=500.0, efficiency=((0.0, 1.0),), density=1025.0)
    assert ideal.inflection(-200.0) == pytest.approx(1005, abs=1)
    assert ideal.inflection(-1000.0) == pytest.approx(5030, abs=5)
    assert COST.inflection(0.0) == 0.0
    assert edge_cost(COST.kernel(), 10.0) == 25.0
    assert edge_cost(TravelTime().kernel(), 0.1 + 0.2) == 0.1 + 0.2
    assert TravelTime().inflection(-100.0) is None
    Energy(**{name: tuple(map(tuple, v)) if isinstance(v, list) else v for name, v in PRESETS["slocum"].items()})


def every_path(road: Roadmap, start, goal):
    """Time and energy of every simple path."""
    edges = {}
    for node in range(len(road.position)):
        for n in range(road.indptr[node], road.indptr[node + 1]):
            edges.setdefault(node, []).append((int(road.target[n]), n))
    found = []

    def walk(node, seen, legs):
        if node == goal:
            found.append((sum(leg[2] for leg in legs), by_hand(COST, legs)))
            return
        for there, n in edges.get(node, []):
            if there not in seen:
                walk(there, seen | {there}, [*legs, (road.position[node, 2], road.glide_angle[n], road.time[n])])

    walk(start, {start}, [])
    return np.array(found)


@pytest.mark.parametrize("seed", range(12))
def test_no_path_is_cheaper_and_no_corner_is_missing(tmp_path, monkeypatch, seed):
    problem = read_scenario(scenario_file(tmp_path), SETS).problem()
    road = random_roadmap(seed)
    monkeypatch.setattr("glider_stream.search.query.check_unchanged", lambda *_: None)
    search = Planner(road, problem)
    every = every_path(road, 0, len(road.position) - 1)
    ends = road.position[0], road.position[-1]
    best = search.query(*ends)
    if not every.size:
        assert not best.found
        return
    # simple paths hold the optimum: a node is never worth a second visit unless its phase changed
    assert best.cost <= every[:, 1].min() + 1e-9
    legs = [(leg.start[2], leg.glide_angle, leg.duration) for leg in best.legs]
    assert best.cost == pytest.approx(by_hand(COST, legs), rel=1e-12)
    assert search.query(*ends, blend=Blend(0.0, 1.0)).travel_time == pytest.approx(every[:, 0].min())
    front = search.front(*ends)
    times, energies = ([getattr(path, name) for path in front.paths] for name in ("travel_time", "cost"))
    assert times == sorted(times)
    assert energies == sorted(energies, reverse=True)
    for price in np.geomspace(1e-3, 1e3, 60):
        least = (every @ [price, 1.0]).min()
        assert min(price * t + e for t, e in zip(times, energies, strict=True)) <= least * (1 + 1e-9)
    for bound in np.quantile(every[:, 1], [0.0, 0.3, 0.7, 1.0]):
        allowed = every[every[:, 1] <= bound, 0].min()
        path = search.within(*ends, bound)
        assert path.cost <= bound
        # exact: a way that visits a node twice, as no simple path does, may only be better
        assert path.travel_time <= allowed * (1 + 1e-9)
        assert path.travel_time == front.within(bound).travel_time
    for time, energy in every:
        assert ((np.array(times) <= time * (1 + 1e-9)) & (np.array(energies) <= energy * (1 + 1e-9))).any()


def test_from_the_command_line(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    sets = [part for one in SETS for part in ("--set", one)]
    assert command(capsys, "build", "small.toml", "-o", "road.h5", *sets).code == 0
    assert planner.verify("road.h5", sample=20).holds
    said = strict_json(command(capsys, "query", "road.h5", "--json").out)
    assert said["cost"] == said["energy_j"]
    front = strict_json(command(capsys, "query", "road.h5", "--trade-off", "--json").out)["trade_off"]
    assert front[-1]["energy_j"] == pytest.approx(said["cost"])
    assert front[0]["travel_time_s"] == pytest.approx(planner.query(roadmap()).travel_time)
    assert "kJ" in command(capsys, "query", "road.h5", "--trade-off").out
    bound = f"{math.ceil(front[0]['energy_j'])}"
    fast = strict_json(command(capsys, "query", "road.h5", "--most-energy", bound, "--json").out)
    assert fast["travel_time_s"] == pytest.approx(front[0]["travel_time_s"])
    if len(front) > 1:
        tight = f"{math.ceil(front[1]['energy_j'])}"
        told = strict_json(command(capsys, "query", "road.h5", "--most-energy", tight, "--json").out)
        assert front[0]["travel_time_s"] < told["travel_time_s"] <= front[1]["travel_time_s"]
    none = command(capsys, "query", "road.h5", "--most-energy", "1")
    assert (none.code, "the least that one takes is" in none.err) == (1, True)
    command(capsys, "build", "small.toml", "-o", "time.h5")
    refused = command(capsys, "query", "time.h5", "--trade-off")
    assert (refused.code, "cost is time" in refused.err) == (2, True)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("cost.hotel=0.0", "must be above 0 W"),
        ("cost.volume=-1.0", "`cost.volume` must be at least 0"),
        ("cost.efficiency=[[100.0, 0.1], [50.0, 0.3]]", "must rise"),
        ("cost.efficiency=[[100.0, 1.1]]", "at most 1"),
        ("cost.preset=moon", "`cost.preset` = 'moon' is not known"),
        ("cost.pump=3.0", "cost.pump"),
    ],
)
def test_bad_coefficients(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        read_scenario(scenario_file(tmp_path), [*SETS, change])


def test_a_preset_and_what_it_lacks(tmp_path):
    file = scenario_file(tmp_path)
    cost = read_scenario(file, ["cost.kind=energy", "cost.preset=slocum", "cost.trim=7.0"]).cost
    assert (cost.hotel, cost.trim) == (0.5, 7.0)
    with pytest.raises(InputError, match=r"cost\.hotel`, .*`cost\.\w+` are missing; give all"):
        read_scenario(file, ["cost.kind=energy"])
