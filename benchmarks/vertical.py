"""Currents with a vertical part: RK4's rate beside the same grid without, routes beside references, a real file.

python benchmarks/vertical.py [--parts rate bound file] [--only PROBLEM...] [--within SHARE]
                              [--currents IONIAN.nc] [-o RECORD.json]

`rate`: flow evaluations per second of CPU, in turns, of one thread. `bound`: in convection cells and in an
internal wave, between several ends, the route of a roadmap of 1,026 nodes at any depth, polished, and refined
too, in percent over two references:
- `level_set_s`, on the finer of two grids. It begins at a set of TAU around one end, and is too early by up to
  `early_s` for that; `coarser_s` is on the other grid, so that the two tell the scheme's error;
- `arrives_s`, a path that arrives (path_that_arrives.py), whose end DOP853 finds `misses_m` from the goal, and
  `guesses_s`, the times to which each of some random guesses led.
`file`: a route with w from continuity, and without.
"""

import argparse
import json
import platform
import sys
import time
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from path_that_arrives import arriving
from polished_routes import over_percent, worst_end

import glider_stream
from glider_stream import planner
from glider_stream.base.toml import to_toml
from glider_stream.evaluation.bench import _fly
from glider_stream.evaluation.level_set import Front, Waters
from glider_stream.kernels.motion import LANES
from glider_stream.roadmap.builder import build_roadmap
from glider_stream.roadmap.problem import Problem
from glider_stream.scenario import read_scenario, scenario_from_text, shipped_scenarios
from glider_stream.water.analytic import Rolls
from glider_stream.water.sampled import sample_flow

FLIGHTS, STEPS, RUNS = 2048, 60, 7
SHORT = {"neighbours": {"kind": "reachable", "limit": 64}, "steering": {"method": "flow-map"}}
NODES = {"kind": "sobol", "count": 1026, "seed": 1}
BOX = {"x": [-600.0, 600.0], "y": [-600.0, 600.0]}
CELLS = BOX | {
    "kind": "convection-cells", "w": 0.3, "width": 300.0, "depth": 300.0, "sampled": [12.0, 12.0, 10.0]
}  # fmt: skip
WAVE = BOX | {"kind": "internal-wave", "w": 0.3, "length": 600.0, "depth": 300.0, "period": 1800.0}
ENDS = {
    "corners": ([-450.0, 450.0, 0.0], [450.0, -450.0, 0.0]),
    "along": ([-430.0, -60.0, 0.0], [440.0, 80.0, -300.0]),
    "oblique": ([400.0, -300.0, -150.0], [-250.0, 380.0, 0.0]),
}
PROBLEMS = {
    f"{flow}, {ends}": (table, *ENDS[ends])
    for flow, table, many in (("cells", CELLS, ENDS), ("wave", WAVE, ENDS))
    for ends in many
}
LEVEL_NODES, TAU = (31, 61), 60.0
"""Nodes along the longest side of a level set, and the size [s] of the set at which it begins."""


def rate() -> dict[str, Any]:
    """Evaluations per second of CPU on a grid, u and v alone and with w; the median ratio of the turns."""
    box, depths = (-600.0, 600.0), (-300.0, 0.0)
    cells = Rolls(w=0.3, width=300.0, depth=300.0).kernel(depths)
    rising = sample_flow(cells, (12.0, 12.0, 10.0), box, box, depths)
    still = read_scenario("seed-box").problem().evaluator.flow
    level = sample_flow(still, (12.0, 12.0, 10.0), box, box, depths)
    start, end = np.random.default_rng(0).uniform(-450, 450, (FLIGHTS, 2)), np.empty(FLIGHTS)
    found: dict[str, list[float]] = {"level": [], "rising": []}
    for run in range(RUNS + 1):
        for name, flow in (("level", level), ("rising", rising)):
            began = time.process_time()
            _fly(flow, start, end, 0, FLIGHTS)
            if run:
                found[name].append(FLIGHTS * LANES * STEPS * 4 / (time.process_time() - began))
    ratios = [b / a for a, b in zip(*found.values(), strict=True)]
    return {name: float(np.median(values)) for name, values in found.items()} | {
        "ratio": float(np.median(ratios))
    }


def scenario_text(name: str) -> str:
    """The seed box with the flow and the ends of a problem, nodes at any depth, and exact legs."""
    table = tomllib.loads(shipped_scenarios()["seed-box"].read_text())
    flow, start, goal = PROBLEMS[name]
    return to_toml(table | SHORT | {"flow": flow, "sampling": NODES, "query": {"start": start, "goal": goal}})


def least_time(problem: Problem) -> dict[str, Any]:
    """The references of a problem: a level set on two grids, and a path that arrives."""
    waters = Waters(problem, 3)
    fronts = [Front(waters, nodes, TAU) for nodes in LEVEL_NODES]
    times = [front.arrival() for front in fronts]
    above = arriving(problem)
    return {
        "level_set_s": round(times[1], 1),
        "coarser_s": round(times[0], 1),
        "early_s": round(fronts[1].early, 1),
        "arrives_s": round(above.time, 1),
        "misses_m": round(above.misses, 4),
        "guesses_s": [round(time, 1) for time in above.times],
    }


def over_bound(name: str, within: float | None) -> dict[str, Any]:
    """The route of a problem, raw, polished and refined, over the references."""
    scenario = scenario_from_text(scenario_text(name))
    road = glider_stream.open(build_roadmap(scenario.problem()))
    polished = road.query(polish=True)
    found = polished.travel_time if polished.unpolished is None else polished.unpolished[1]
    row: dict[str, Any] = {
        "route": name,
        "found_s": round(found, 1),
        "polished_s": round(polished.travel_time, 1),
        "polished_legs": len(polished.legs),
        "worst_end_m": round(worst_end(road, polished), 4),
    }
    if within is not None:
        row["refined_s"] = round(road.query(polish=True, within=within).travel_time, 1)
    known = least_time(scenario.problem())
    names = {"level_set_s": "over_level_set_percent", "arrives_s": "over_path_percent"}
    return row | known | {names[key]: over_percent(row, known[key]) for key in names}


def of_file(folder: Path, currents: Path) -> dict[str, Any]:
    """The route of a real file's currents, with w by continuity and without."""
    found = {}
    for name, more in (("without", ()), ("continuity", ("flow.vertical=continuity",))):
        overrides = (f"flow.file={currents}", "steering.method=flow-map", *more)
        road = planner.build("ionian", folder / f"{name}.h5", overrides=overrides)
        path = planner.query(folder / f"{name}.h5")
        lifted = [leg.lifted for leg in path.legs]
        found[name] = {
            "edges": int(road.target.size),
            "time_s": path.travel_time,
            "legs": len(path.legs),
            "most_lifted_m": max(map(abs, lifted)),
        }
    return found


def main() -> None:
    """Measure; print, and keep a record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", nargs="+", default=["rate", "bound"], choices=["rate", "bound", "file"])
    parser.add_argument(
        "--only",
        nargs="+",
        default=[*PROBLEMS],
        choices=[*PROBLEMS],
        metavar="PROBLEM",
        help=f"of `bound`: {'; '.join(PROBLEMS)}",
    )
    parser.add_argument("--within", type=float, metavar="SHARE", help="refine too, until a round gains less")
    parser.add_argument("--currents", type=Path, help="the Ionian file of `data/ionian.toml`")
    parser.add_argument("--folder", type=Path, default=Path())
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    record: dict[str, Any] = {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": platform.machine(),
    }
    if "rate" in options.parts:
        record["rate"] = rate()
    if "bound" in options.parts:
        record["bound"] = []
        for name in options.only:
            record["bound"].append(over_bound(name, options.within))
            print(record["bound"][-1], file=sys.stderr, flush=True)
    if "file" in options.parts:
        record["file"] = of_file(options.folder, options.currents.absolute())
    print(json.dumps(record, indent=1))
    if options.output:
        options.output.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
