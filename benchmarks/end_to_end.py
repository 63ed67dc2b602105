"""Routes in currents that change, flown from end to end by another integrator with what they export.

Each route is planned among a scenario's nodes, written as the path file has it, read back, and flown by scipy's
DOP853 through the flow as the planner reads it: one glide angle, heading and speed a leg, each for its exported
time, the next leg from where the last one ends. Beside it the same route planned with `frozen`, every leg as at
the departure, and flown likewise: by how far it misses.

    python benchmarks/end_to_end.py -o benchmarks/records/end_to_end.json
    python benchmarks/end_to_end.py --washington wa_RTOFS_global.nc --galicia cmems_galicia.nc -o ...
"""

import argparse
import json
import math
import sys
import time
from dataclasses import replace
from pathlib import Path as File
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from glider_stream.kernels.flow import Flow, velocity
from glider_stream.roadmap.builder import build_slices, node_positions
from glider_stream.scenario import Scenario, read_scenario
from glider_stream.search.path import Path
from glider_stream.search.slice_planner import SlicePlanner
from glider_stream.search.sliced import SliceSearch
from glider_stream.search.time_dependent import ClockPlanner

GYRE = "swinging-gyre"
COARSE = "sampling.shape=[12, 6, 4]"
ANALYTIC = {
    "gyre, 600 s": (GYRE, ["flow.period=600.0", COARSE]),
    "gyre, 1,500 s": (GYRE, ["flow.period=1500.0", COARSE]),
    "gyre, 3,600 s": (GYRE, ["flow.period=3600.0", COARSE]),
    "gyre, 12.42 h": (GYRE, [COARSE]),
    "wide swing, 900 s": (GYRE, ["flow.period=900.0", "flow.epsilon=0.45", COARSE]),
    "fast, 1,800 s": (GYRE, ["flow.period=1800.0", "flow.amplitude=0.5", COARSE]),
    "tidal strait": ("tidal-strait", ["sampling.shape=[15,6,4]"]),
    "moving vortex": ("moving-vortex", ["sampling.shape=[12,8,4]"]),
}


SLICED = "galicia, by slices"
"""The same route by a roadmap of six slices, six hours apart."""


def replayed(flow: Flow, path: dict[str, Any], *, rtol: float = 1e-9) -> np.ndarray:
    """Where a path file's legs lead, one after the other from its start, in a flow as it changes (n, 3)."""
    at, places = np.array(path["legs"][0]["from"], float), []
    places.append(at)
    for leg in path["legs"]:
        along = leg["speed_mps"] * math.cos(leg["glide_angle_rad"])
        through = np.array([
            along * math.cos(leg["heading_rad"]),
            along * math.sin(leg["heading_rad"]),
            leg["speed_mps"] * math.sin(leg["glide_angle_rad"]),
        ])  # fmt: skip

        def rate(t: float, here: np.ndarray, through: np.ndarray = through) -> np.ndarray:
            return through + np.array([*velocity(flow, *map(float, here), float(t)), 0.0])

        begins = path["departure_s"] + leg["depart_s"]
        span = begins, begins + leg["duration_s"]
        step = min(60.0, leg["duration_s"] / 8)
        at = solve_ivp(rate, span, at, "DOP853", rtol=rtol, atol=1e-7, max_step=step).y[:, -1]
        places.append(at)
    return np.array(places)


def one_route(
    scenario: Scenario, start: Any, goal: Any, nodes: np.ndarray, frozen: bool
) -> dict[str, Any] | None:
    """A route planned and flown: legs, hours, how far it ends from the goal and its legs from their nodes [m]."""
    problem = scenario.problem()
    path = ClockPlanner(problem, nodes, frozen=frozen).query(start, goal)
    return flown(problem.evaluator.flow, path) if path.found and path.legs else None


def flown(flow: Flow, path: Path) -> dict[str, Any]:
    """What a route comes to that is flown from end to end with what it exports."""
    text = json.loads(json.dumps(path.as_dict()))
    places = replayed(flow, text)
    stops = np.array([leg["to"] for leg in text["legs"]])
    return {
        "legs": len(stops),
        "hours": round(path.travel_time / 3600, 3),
        "miss_m": float(np.linalg.norm(places[-1] - stops[-1])),
        "worst_stop_m": float(np.linalg.norm(places[1:] - stops, axis=1).max()),
        "expanded": path.expanded,
    }


def field(name: str, scenario: Scenario, routes: int, seed: int) -> dict[str, Any]:
    """Some routes between random points of a scenario's box, at random departures."""
    random, problem = np.random.default_rng(seed), scenario.problem()
    nodes = node_positions(problem)
    rows: list[dict[str, Any]] = []
    began = time.perf_counter()
    while len(rows) < routes:
        ends = random.uniform(problem.lo, problem.hi, (2, 3))
        ends[:, 2] = np.where(random.random(2) < 0.5, 0.0, ends[:, 2])
        if not problem.evaluator.allowed(ends, problem.departure).all():
            continue
        moving = one_route(scenario, *ends, nodes, frozen=False)
        if moving is None:
            continue
        still = one_route(scenario, *ends, nodes, frozen=True)
        rows.append(moving | {"frozen_miss_m": None if still is None else still["miss_m"]})
    return summary(name, rows) | {"wall_s": round(time.perf_counter() - began, 1)}


def summary(name: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """What the routes of one flow come to."""
    missed = [row["frozen_miss_m"] for row in rows if row["frozen_miss_m"] is not None]
    return {
        "flow": name,
        "routes": len(rows),
        "legs": sum(row["legs"] for row in rows),
        "longest_h": max(row["hours"] for row in rows),
        "worst_miss_m": round(max(row["miss_m"] for row in rows), 4),
        "worst_miss_a_leg_m": round(max(row["miss_m"] / row["legs"] for row in rows), 4),
        "frozen_median_m": round(float(np.median(missed)), 1) if missed else None,
        "frozen_worst_m": round(max(missed), 1) if missed else None,
    }


def file_route(name: str, scenario: Scenario) -> dict[str, Any]:
    """The scenario's own route."""
    nodes = node_positions(scenario.problem())
    began = time.perf_counter()
    moving = one_route(scenario, None, None, nodes, frozen=False)
    wall = time.perf_counter() - began
    if moving is None:
        return {"flow": name, "routes": 0}
    still = one_route(scenario, None, None, nodes, frozen=True)
    row = moving | {"frozen_miss_m": None if still is None else still["miss_m"]}
    return summary(name, [row]) | {"wall_s": round(wall, 1), "expanded": moving["expanded"]}


def sliced_route(name: str, scenario: Scenario, every: float, count: int) -> dict[str, Any]:
    """The scenario's own route by a roadmap of slices, `every` [s] one."""
    problem = scenario.problem()
    problem = replace(problem, slices=tuple(problem.departure + every * np.arange(count)))
    began = time.perf_counter()
    road = build_slices(problem)
    built = time.perf_counter() - began
    path = SlicePlanner(problem, SliceSearch(road, problem)).query()
    row = flown(problem.evaluator.flow, path)
    kept = {"slices": count, "built_s": round(built, 1), "notes": list(path.notes)}
    return summary(name, [row | {"frozen_miss_m": None}]) | kept


def washington(file: str) -> Scenario:
    """Two days along the coast in a three-hourly forecast: its currents outrun the glider, which drifts about."""
    return read_scenario("ionian", [
        f"flow.file={file}", "flow.epoch=2024-10-29T00:00:00", "domain.lon=[-126.1,-125.4]",
        "domain.lat=[46.9,47.7]", "sampling.kind=grid", "sampling.shape=[30,52,2]",
        "query.start=[-125.75,47.2,0.0]",
        "query.goal=[-125.75,47.5,0.0]",
    ])  # fmt: skip


def washington_north(file: str) -> Scenario:
    """105 km north against the coastal current: the glider is carried south first, and comes back for days."""
    return read_scenario("ionian", [
        f"flow.file={file}", "flow.epoch=2024-10-29T00:00:00", "domain.lon=[-125.9,-125.5]",
        "domain.lat=[46.8,47.9]", "sampling.kind=grid", "sampling.shape=[26,98,2]",
        "query.start=[-125.6,46.9,0.0]",
        "query.goal=[-125.6,47.85,0.0]",
    ])  # fmt: skip


def galicia(file: str) -> Scenario:
    """More than a day in a daily analysis."""
    return read_scenario("ionian", [
        f"flow.file={file}", "flow.epoch=2025-01-01T00:00:00", "terrain.clearance=10.0",
        "domain.lon=[-9.24,-9.21]", "domain.lat=[42.09,42.38]", "domain.depth=[0.0,110.0]",
        "sampling.kind=grid", "sampling.shape=[16,205,2]", "integration.dt=20.0",
        "query.start=[-9.225,42.092,0.0]",
        "query.goal=[-9.225,42.374,0.0]",
    ])  # fmt: skip


def main() -> None:
    """Read the arguments, plan, fly, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--routes", type=int, default=34, help="in each of the flows given by formulas")
    parser.add_argument("--washington", metavar="FILE", help="the real three-hourly file")
    parser.add_argument("--galicia", metavar="FILE", help="the real daily file")
    parser.add_argument("--only", action="append", help="a flow of the table; again for more")
    parser.add_argument("-o", "--output", type=File)
    args = parser.parse_args()
    found = []
    for seed, (name, (scenario, sets)) in enumerate(ANALYTIC.items()):
        if args.only is None or name in args.only:
            found.append(field(name, read_scenario(scenario, sets), args.routes, seed))
            print(found[-1], file=sys.stderr, flush=True)
    for name, file, make in (
        ("washington", args.washington, washington),
        ("washington, 105 km north", args.washington, washington_north),
        ("galicia", args.galicia, galicia),
    ):
        if file is not None and (args.only is None or name in args.only):
            found.append(file_route(name, make(file)))
            print(found[-1], file=sys.stderr, flush=True)
    if args.galicia is not None and (args.only is None or SLICED in args.only):
        found.append(sliced_route(SLICED, galicia(args.galicia), 21_600.0, 6))
        print(found[-1], file=sys.stderr, flush=True)
    text = json.dumps({"command": " ".join(["python", *sys.argv]), "flows": found}, indent=1)
    if args.output:
        args.output.write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
