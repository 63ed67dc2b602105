"""Routes before and after they are polished, against level-set values: the paper's box in random vortices.

1,026 nodes, reachable neighbours, exact legs; the fields of the paper's experiment (experiment.py), by seed. With
--ionian a file of currents, the shipped scenario of that name too. References are the level set's (level_set.py),
each run over a scenario that --write makes:

    python benchmarks/polished_routes.py --write fields
    hj/bin/python benchmarks/level_set.py fields/0.toml --grid 51,51,31 --grid 101,101,61 --tau 40 -o 0.json

and kept, by seed, in records/level_set_fields.json: the value of the finest grid, the estimate of its error, and
the travel time of a path of 80 controls that arrives: what can be had lies between the two.
"""

import argparse
import json
import sys
import time
import tomllib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from experiment import random_vortices
from record import keep, machine

import glider_stream
from glider_stream.base.threads import threads
from glider_stream.base.toml import to_toml
from glider_stream.evaluation.suite import LAW, references
from glider_stream.roadmap.builder import build_roadmap
from glider_stream.roadmap.verify import replayed_misses
from glider_stream.scenario import read_scenario, scenario_from_text, shipped_scenarios

RECORDS = Path(__file__).parent / "records"
SEEDS = 6


def scenario_text(seed: int) -> str:
    """The seed box in another random field, its legs exact."""
    table = tomllib.loads(shipped_scenarios()["seed-box"].read_text())
    table["flow"]["vortex"] = random_vortices(seed)
    table["neighbours"], table["steering"] = {"kind": "reachable"}, {"method": "flow-map"}
    return to_toml(table)


def compared(name: str, road: Any, within: float | None) -> dict[str, Any]:
    """A route as it is found, and polished: travel time [s], legs, seconds that it took, the worst end [m].

    Refined and polished too, where `within` says until when.
    """
    before = road.query()
    road.query(polish=True)  # compiles
    begun = time.perf_counter()
    found = road.query()
    searched = time.perf_counter()
    after = road.query(polish=True)
    took = time.perf_counter() - searched - (searched - begun)
    assert found.travel_time == before.travel_time
    off = worst_end(road, after)
    refined: dict[str, Any] = {}
    if within is not None:
        begun = time.perf_counter()
        best = road.query(polish=True, within=within)
        refined = {
            "refined_s": round(best.travel_time, 1),
            "refined_legs": len(best.legs),
            "rounds": len(best.rounds),
            "refined_wall_s": round(time.perf_counter() - begun, 1),
        }
    return {
        "route": name,
        "found_s": round(before.travel_time, 1),
        "legs": len(before.legs),
        "polished_s": round(after.travel_time, 1),
        "polished_legs": len(after.legs),
        "wall_s": round(took, 2),
        "worst_end_m": round(off, 4),
        **refined,
    }


def worst_end(road: Any, path: Any) -> float:
    """The greatest distance [m] from its stop at which another integrator ends a leg of a path."""
    stops = np.array([path.legs[0].start, *(leg.end for leg in path.legs)])
    here = np.arange(len(path.legs))
    rows = np.array([[n.duration, n.cost, n.glide_angle, n.heading, n.speed, n.miss] for n in path.legs])
    departs = np.array([road.problem.departure + path.clock_runs * leg.depart for leg in path.legs])
    return float(replayed_misses(road.problem.evaluator, departs, stops, here, here + 1, rows).max())


def field_routes(within: float | None) -> Iterator[dict[str, Any]]:
    """The routes in the random fields, with their references."""
    finest_times = json.loads((RECORDS / "level_set_fields.json").read_text())["fields"]
    for seed in range(SEEDS):
        scenario = scenario_from_text(scenario_text(seed))
        road = glider_stream.open(build_roadmap(scenario.problem()))
        row = compared(f"field {seed}", road, within)
        known = finest_times[str(seed)]
        finest, arrives = known["finest_s"], known["path_that_arrives_s"]
        yield row | {
            "level_set_s": finest,
            "over_percent": over_percent(row, finest),
            "path_that_arrives_s": arrives,
            "over_the_path_percent": over_percent(row, arrives),
        }


def ionian_routes(currents: Path | None, within: float | None) -> Iterator[dict[str, Any]]:
    """The route of the shipped Ionian scenario, if there is a file of currents."""
    if currents is not None:
        scenario = read_scenario("ionian", [f"flow.file={currents}"])
        yield compared("ionian", glider_stream.open(build_roadmap(scenario.problem())), within)


def suite_routes(within: float | None) -> Iterator[dict[str, Any]]:
    """The suite's problems that have a route, with their references, and whether a route is below the bound."""
    for name, reference in references().items():
        if reference.seconds is None or reference.bound is None:
            continue
        scenario = read_scenario(name, [LAW, "steering.method=flow-map"])
        row = compared(name, glider_stream.open(build_roadmap(scenario.problem())), within)
        over = over_percent(row, reference.seconds)
        below = min(row[f"{name}_s"] for name in over) < reference.bound - 0.05
        known = {"reference_s": reference.seconds, "bound_s": reference.bound}
        yield row | known | {"over_percent": over, "below_the_bound": below}


def over_percent(row: dict[str, Any], reference: float) -> dict[str, float]:
    """By how much the routes of a row take longer than a reference [s]."""
    names = [name for name in ("found", "polished", "refined") if f"{name}_s" in row]
    return {name: round(100 * (row[f"{name}_s"] / reference - 1), 2) for name in names}


def main() -> None:
    """Read the arguments, measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write the fields' scenarios instead")
    parser.add_argument("--ionian", type=Path, metavar="CURRENTS.nc", help="the shipped Ionian scenario, too")
    parser.add_argument("--within", type=float, metavar="SHARE", help="refine too, until a round gains less")
    parser.add_argument("--only", choices=("fields", "suite"), help="these routes alone")
    parser.add_argument("--threads", type=int, help="so many threads; all if not given")
    parser.add_argument("-o", "--output", type=Path, help="a JSON file to keep the result in")
    args = parser.parse_args()
    if args.write:
        args.write.mkdir(exist_ok=True)
        for seed in range(SEEDS):
            (args.write / f"{seed}.toml").write_text(scenario_text(seed))
        return
    rows = []
    with threads(args.threads) as count:
        fields = field_routes(args.within) if args.only != "suite" else ()
        suite = suite_routes(args.within) if args.only != "fields" else ()
        for row in chain(fields, suite, ionian_routes(args.ionian, args.within)):
            rows.append(row)
            print(row, file=sys.stderr, flush=True)
    print(keep({"machine": machine(count), "routes": rows}, args.output))


if __name__ == "__main__":
    main()
