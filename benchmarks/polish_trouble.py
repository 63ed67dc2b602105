"""Tries to break polishing: random queries of many scenarios, with rules, both costs, and the clock running.

Of each polished route it checks: it costs no more than before; each leg ends where it should by another
integrator, within 1 m in an analytic flow, 5 m in a file's; depths, horizon, polar and rules of surfacing hold; a
second run gives the same bits, on one thread and on two. With a file also among closed areas, 3 km apart:
no point of a route lies in one, by matplotlib's own test.

    python benchmarks/polish_trouble.py --queries 20 --ionian CURRENTS.nc
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.path import Path as Polygon
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


AMONG = "ionian, closed areas"
SIDE, APART = 0.05, 0.085
"""The side of each closed area, and how far their corners lie apart [degrees]."""
BETWEEN = ["query.start=[18.305, 38.1, 0.0]", "query.goal=[18.815, 37.75, 0.0]"]
LOOKS = 5.0
"""A route is looked at this often [m]."""


def closed_areas() -> list[list[tuple[float, float]]]:
    """Corners lon, lat [degrees] of squares in the Ionian domain, every second column moved by half."""
    areas = []
    for column, west in enumerate(np.arange(18.24, 18.8, APART)):
        for south in np.arange(37.7 + (column % 2) * APART / 2, 38.1, APART):
            east, north = west + SIDE, south + SIDE
            areas.append([(west, south), (east, south), (east, north), (west, north), (west, south)])
    return areas


def write_areas(file: Path) -> None:
    """Write the closed areas as GeoJSON."""
    polygons = [{"type": "Polygon", "coordinates": [area]} for area in closed_areas()]
    features = [{"type": "Feature", "properties": {}, "geometry": polygon} for polygon in polygons]
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))


def in_closed_areas(road: Any, path: Any) -> bool:
    """Whether a route enters a closed area."""
    rows = path.trajectory[:, 1:4]
    lengths = np.linalg.norm(np.diff(rows, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    looks = np.arange(0.0, along[-1], LOOKS)
    points = np.stack([np.interp(looks, along, column) for column in rows.T], axis=1)
    places = road.problem.to_lonlat(points)[:, :2]
    return any(Polygon(area).contains_points(places).any() for area in closed_areas())


def cases(ionian: Path | None) -> Iterator[tuple[str, Any, dict[str, Any], float]]:
    """Name, opened roadmap, options of a query, and how far [m] a leg may end from its stop."""
    for name, (scenario, overrides, asked) in CASES.items():
        yield name, glider_stream.open(build_roadmap(read_scenario(scenario, overrides).problem())), asked, 1.0
    if ionian is not None:
        for name, cost in (("ionian", []), ("ionian, energy", ENERGY)):
            problem = read_scenario("ionian", [f"flow.file={ionian}", *cost]).problem()
            yield name, glider_stream.open(build_roadmap(problem)), {}, 5.0
        with tempfile.TemporaryDirectory() as folder:
            write_areas(Path(folder) / "closed.geojson")
            sets = [f"flow.file={ionian}", f'terrain.keep_out=["{folder}/closed.geojson"]', *BETWEEN]
            problem = read_scenario("ionian", sets).problem()
            yield AMONG, glider_stream.open(build_roadmap(problem)), {}, 5.0


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
        if name == AMONG and (in_closed_areas(road, before) or in_closed_areas(road, after)):
            wrong.append(f"{ends}: it enters a closed area")
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
