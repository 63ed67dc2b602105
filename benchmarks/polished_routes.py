"""Routes before and after they are polished, against level-set values: the paper's box in random vortices.

1,026 nodes, reachable neighbours, exact legs; the fields of the paper's experiment (experiment.py), by seed. With
--ionian a file of currents, the shipped scenario of that name too. References are the level set's (level_set.py),
each run over a scenario that --write makes:

    python benchmarks/polished_routes.py --write fields
    hj/bin/python benchmarks/level_set.py fields/0.toml --grid 51,51,31 --grid 101,101,61 -o 0.json

and kept, by seed, in records/level_set_fields.json: the value of the finest grid, the estimate of its error, and
the travel time of a path of 80 controls that arrives: what can be had lies between the two.
"""

import argparse
import json
import os
import platform
import sys
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from experiment import random_vortices

import glider_stream
from glider_stream.base.threads import threads
from glider_stream.base.toml import to_toml
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
    stops = np.array([after.legs[0].start, *(leg.end for leg in after.legs)])
    here = np.arange(len(after.legs))
    rows = [[n.duration, n.cost, n.glide_angle, n.heading, n.speed, n.miss] for n in after.legs]
    off = replayed_misses(road.problem.evaluator, road.problem.departure, stops, here, here + 1, np.array(rows))
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
        "worst_end_m": round(float(off.max()), 4),
        **refined,
    }


def routes(ionian: Path | None, within: float | None) -> Iterator[dict[str, Any]]:
    """All routes, the fields' with their references."""
    references = json.loads((RECORDS / "level_set_fields.json").read_text())["fields"]
    for seed in range(SEEDS):
        scenario = scenario_from_text(scenario_text(seed))
        road = glider_stream.open(build_roadmap(scenario.problem(), None, lambda progress: None))
        row = compared(f"field {seed}", road, within)
        finest = references[str(seed)]["finest_s"]
        names = ("found", "polished", "refined") if within is not None else ("found", "polished")
        over = {name: round(100 * (row[f"{name}_s"] / finest - 1), 2) for name in names}
        yield row | {"level_set_s": finest, "over_percent": over}
    if ionian is not None:
        scenario = read_scenario("ionian", [f"flow.file={ionian}"])
        yield compared(
            "ionian", glider_stream.open(build_roadmap(scenario.problem(), None, lambda progress: None)), within
        )


def main() -> None:
    """Read the arguments, measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write the fields' scenarios instead")
    parser.add_argument("--ionian", type=Path, metavar="CURRENTS.nc", help="the shipped Ionian scenario, too")
    parser.add_argument("--within", type=float, metavar="SHARE", help="refine too, until a round gains less")
    parser.add_argument("-o", "--output", type=Path, help="a JSON file to keep the result in")
    args = parser.parse_args()
    if args.write:
        args.write.mkdir(exist_ok=True)
        for seed in range(SEEDS):
            (args.write / f"{seed}.toml").write_text(scenario_text(seed))
        return
    rows = []
    with threads(None) as count:
        for row in routes(args.ionian, args.within):
            rows.append(row)
            print(row, file=sys.stderr, flush=True)
    machine = f"{platform.machine()}, {os.cpu_count()} cores, {count} threads, Python {platform.python_version()}"
    text = json.dumps({"machine": machine, "routes": rows}, indent=1)
    if args.output:
        args.output.write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
