"""Tries to break polishing: random queries of many scenarios, with rules, both costs, and the clock running.

Of each polished route it checks: it costs no more than before; each leg ends where it should by another
integrator, within 1 m in an analytic flow, 5 m in a file's; depths, horizon, polar and rules of surfacing hold; a
second run gives the same bits, on one thread and on two.

    python benchmarks/polish_trouble.py --queries 20 --ionian CURRENTS.nc
"""

import argparse
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from polished_routes import worst_end
from record import keep

import glider_stream
from glider_stream.base.threads import threads
from glider_stream.roadmap.builder import build_roadmap
from glider_stream.scenario import read_scenario

EXACT = ["neighbours.kind=reachable", "steering.method=flow-map"]
ENERGY = ["cost.kind=energy", "cost.preset=slocum"]
CASES: dict[str, tuple[str, list[str], dict[str, Any]]] = {
    "time": ("seed-box", EXACT, {}),
    "energy": ("seed-box", [*EXACT, *ENERGY], {}),
    "most yos": ("seed-box", EXACT, {"surfacing": glider_stream.Surfacing(most_yos=2)}),
    "most hours": ("seed-box", EXACT, {"surfacing": glider_stream.Surfacing(most_hours=0.2)}),
    "strong vortices": ("strong-vortices", EXACT, {}),
    "gyre": ("single-gyre", EXACT, {}),
    "gyre, energy": ("single-gyre", [*EXACT, *ENERGY], {}),
    "clock": ("swinging-gyre", EXACT, {}),
    "frozen": ("swinging-gyre", [*EXACT, "query.frozen=true"], {}),
}


def cases(ionian: Path | None) -> Iterator[tuple[str, Any, dict[str, Any], float]]:
    """Name, opened roadmap, options of a query, and how far [m] a leg may end from its stop."""
    for name, (scenario, overrides, asked) in CASES.items():
        yield name, glider_stream.open(build_roadmap(read_scenario(scenario, overrides).problem())), asked, 1.0
    if ionian is not None:
        for name, cost in (("ionian", []), ("ionian, energy", ENERGY)):
            problem = read_scenario("ionian", [f"flow.file={ionian}", *cost]).problem()
            yield name, glider_stream.open(build_roadmap(problem)), {}, 5.0


def faults(road: Any, before: Any, after: Any, asked: dict[str, Any], off: float, most: float) -> list[str]:
    """What is wrong with a polished route."""
    problem = road.problem
    polar, integration, legs = problem.evaluator.polar, problem.evaluator.integration, after.legs
    ways = [int(leg.glide_angle > 0) for leg in legs]
    angles = [abs(leg.glide_angle) for leg in legs]
    clock = np.cumsum([0.0, *(leg.duration for leg in legs)])
    found = {
        "costs more": after.cost > before.cost,
        "ends elsewhere": off > most,
        "leaves its depths": min(leg.trajectory[:, 3].min() for leg in legs) < problem.lo[2] - 1e-6
        or max(leg.trajectory[:, 3].max() for leg in legs) > 1e-6,
        "is not on the polar": any(
            not polar.shallowest[way] - 1e-9 <= angle <= polar.steepest[way] + 1e-9
            for way, angle in zip(ways, angles, strict=True)
        ),
        "lasts too long": max(leg.duration for leg in legs) > integration.dt * integration.steps,
        "breaks its clock": not np.allclose([leg.depart for leg in legs], clock[:-1], atol=1e-6),
        "breaks its rule": "surfacing" in asked and not asked["surfacing"].holds(after),
        "has other ends": not np.array_equal(legs[0].start, before.legs[0].start)
        or not np.array_equal(legs[-1].end, before.legs[-1].end),
        "has gaps": any(not np.array_equal(a.end, b.start) for a, b in pairwise(legs)),
    }
    return [what for what, wrong in found.items() if wrong]


def random_ends(road: Any, rng: np.random.Generator, surface: bool) -> list[tuple[float, ...]]:
    """Two places in open water, in the coordinates of the scenario, at the surface if asked."""
    problem, ends = road.problem, []
    lo, hi = problem.lo, np.minimum(problem.hi, [np.inf, np.inf, 0.0])
    while len(ends) < 2:
        place = rng.uniform(lo, hi)
        place[2] = hi[2] if surface else rng.choice([place[2], hi[2]])
        if problem.evaluator.allowed(place[None], problem.departure)[0]:
            ends.append(place)
    if problem.to_lonlat is None:
        return [tuple(end) for end in ends]
    return [(*map(float, problem.to_lonlat(end[None])[0]), -float(end[2])) for end in ends]


def tried(name: str, road: Any, asked: dict[str, Any], most: float, queries: int) -> dict[str, Any]:
    """The result of a case: gains, times, the worst end [m], faults."""
    rng, gains, seconds, worst, wrong = np.random.default_rng(5), [], [], 0.0, []
    while len(gains) < queries:
        ends = random_ends(road, rng, "surfacing" in asked)
        before = road.query(*ends, **asked)
        if not before.legs:
            queries -= 1
            continue
        began = time.perf_counter()
        with threads(1):
            after = road.query(*ends, **asked, polish=True)
        seconds.append(time.perf_counter() - began)
        off = worst_end(road, after)
        wrong += [f"{ends}: it {what}" for what in faults(road, before, after, asked, off, most)]
        if len(gains) < 3 and road.query(*ends, **asked, polish=True).as_dict() != after.as_dict():
            wrong.append(f"{ends}: two threads give another route")
        gains.append(1 - after.cost / before.cost)
        worst = max(worst, off)
    return {
        "case": name,
        "routes": len(gains),
        "mean_gain_percent": round(100 * float(np.mean(gains or [0.0])), 2),
        "median_s": round(float(np.median(seconds or [0.0])), 2),
        "longest_s": round(max(seconds, default=0.0), 2),
        "worst_end_m": round(worst, 4),
        "faults": wrong,
    }


def main() -> None:
    """Read the arguments, try, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--queries", type=int, default=10, help="random queries of each case")
    parser.add_argument("--ionian", type=Path, metavar="CURRENTS.nc", help="the shipped Ionian scenario, too")
    parser.add_argument("--only", nargs="*", default=[], help="these cases alone")
    parser.add_argument("-o", "--output", type=Path, help="a JSON file to keep the result in")
    args = parser.parse_args()
    rows = []
    for name, road, asked, most in cases(args.ionian):
        if not args.only or name in args.only:
            rows.append(tried(name, road, asked, most, args.queries))
            print(rows[-1], file=sys.stderr, flush=True)
    print(keep(rows, args.output))
    sys.exit(any(row["faults"] for row in rows))


if __name__ == "__main__":
    main()
