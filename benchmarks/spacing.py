"""How much time a route loses by how far nodes lie apart, in legs: lattices and jittered layers, yos to 600 m.

A Slocum in an even current of 0.15 m/s: the least time is known in closed form, so that all that a route takes
more is lost by the nodes. Three ways of 12 km, 0, 20 and 45 degrees off the lattice; each row says
the mean and the worst of them. Polished routes are beside.

    python benchmarks/spacing.py -o benchmarks/records/spacing.json
"""

import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from record import keep, machine

import glider_stream
from glider_stream.roadmap.builder import build_roadmap
from glider_stream.roadmap.density import density_of
from glider_stream.scenario import scenario_from_text

SCENARIO = """\
[flow]
kind = "uniform"
u = 0.12
v = -0.09
[glider]
preset = "slocum"
[domain]
x = [-7500.0, 7500.0]
y = [-7500.0, 7500.0]
z = [-600.0, 0.0]
[sampling]
kind = "yo"
depths = [0.0, 600.0]
per_leg = {per_leg}
jitter = {jitter}
[neighbours]
kind = "reachable"
limit = 60
[steering]
method = "flow-map"
[integration]
dt = 60.0
steps = 100
tolerance = 20.0
[cost]
kind = "time"
"""
CURRENT = np.array([0.12, -0.09])
WAYS = (0.0, 20.0, 45.0)
LENGTH = 12_000.0
PER_LEG = (0.6, 0.8, 1.0, 1.5, 2.0)


def least(way: np.ndarray, fastest: float) -> float:
    """The least time [s] of a way (2,) [m]: |way - current T| = Vh T."""
    a, b = fastest**2 - CURRENT @ CURRENT, float(CURRENT @ way)
    return (-b + math.sqrt(b * b + a * float(way @ way))) / a


def percent(share: float) -> float | None:
    """A share in percent; None where one of the ways has no route."""
    return round(100 * float(share), 2) if math.isfinite(share) else None


def row(per_leg: float, jitter: bool) -> dict[str, Any]:
    """One roadmap, all ways in it."""
    problem = scenario_from_text(SCENARIO.format(per_leg=per_leg, jitter=str(jitter).lower())).problem()
    begun = time.perf_counter()
    road = glider_stream.open(build_roadmap(problem))
    built = time.perf_counter() - begun
    fastest = float(problem.evaluator.polar.best_horizontal.max())
    lost: dict[str, list[float]] = {"found": [], "polished": []}
    for degrees in WAYS:
        way = LENGTH * np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
        ends = (*(-way / 2), 0.0), (*(way / 2), 0.0)
        for name, polish in (("found", False), ("polished", True)):
            lost[name].append(road.query(*ends, polish=polish).travel_time / least(way, fastest) - 1)
    dense = density_of(road.roadmap, float(problem.evaluator.polar.best_angle.max()))
    return {
        "per_leg": per_leg,
        "jitter": jitter,
        "nodes": len(road.position),
        "spacing_legs": round(dense.legs, 3),
        "directions": round(dense.directions, 1),
        **{f"lost_{name}_percent": percent(sum(some) / len(some)) for name, some in lost.items()},
        **{f"worst_{name}_percent": percent(max(some)) for name, some in lost.items()},
        "build_s": round(built, 1),
    }


def main() -> None:
    """Read the arguments, measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, help="a JSON file to keep the result in")
    args = parser.parse_args()
    rows = []
    for per_leg in PER_LEG:
        for jitter in (False, True):
            rows.append(row(per_leg, jitter))
            print(rows[-1], file=sys.stderr, flush=True)
    print(keep({"machine": machine(), "rows": rows}, args.output))


if __name__ == "__main__":
    main()
