"""Currents with a vertical part: RK4's rate beside the same grid without, routes beside a level set, a real file.

python benchmarks/vertical.py [--parts rate bound file] [--currents IONIAN.nc] [-o RECORD.json]

`rate`: flow evaluations per second of CPU, in turns, of one thread. `bound`: in convection cells, the route of
a roadmap, raw and polished, and the least time by a level set. `file`: a route with w from continuity, and
without.
"""

import argparse
import json
import platform
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from glider_stream import planner
from glider_stream.evaluation.bench import _fly
from glider_stream.evaluation.level_set import bound
from glider_stream.kernels.motion import LANES
from glider_stream.scenario import read_scenario
from glider_stream.water.analytic import Rolls
from glider_stream.water.sampled import sample_flow

FLIGHTS, STEPS, RUNS = 2048, 60, 7
CELLS = (
    "flow.kind=convection-cells", "flow.w=0.3", "flow.width=300.0", "flow.depth=300.0",
    "steering.method=flow-map", "neighbours.kind=reachable", "neighbours.limit=64", "sampling.kind=sobol",
    "sampling.count=1026", "sampling.seed=1",
)  # fmt: skip


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


def over_bound(folder: Path) -> dict[str, Any]:
    """The route in convection cells, raw and polished, over the least time by a level set."""
    least = bound(read_scenario("seed-box", CELLS).problem(), 3)
    planner.build("seed-box", folder / "cells.h5", overrides=CELLS)
    raw, polished = (planner.query(folder / "cells.h5", polish=how).travel_time for how in (False, True))
    return {"least_s": least.least, "error_s": least.error, "route_s": raw, "polished_s": polished}


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
        record["bound"] = over_bound(options.folder)
    if "file" in options.parts:
        record["file"] = of_file(options.folder, options.currents.absolute())
    print(json.dumps(record, indent=1))
    if options.output:
        options.output.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
