"""Legs in a file's currents: processor time per pair on one thread, and evaluations per second inside RK4.

python benchmarks/file_legs.py CURRENTS.nc [--beside CHECKOUT] [--scenario ionian] [--set KEY=VALUE]...
    [--share 12] [--runs 5] [--ceiling PROGRAM]

`--beside` measures another checkout of this project in the same run, in turns, each turn in its own process.
`--ceiling`: benchmarks/mapped_grid.cpp, compiled as its first lines say.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

NODES = 101, 101, 31
FLIGHTS, STEPS = 1000, 60


def pairs(options: argparse.Namespace) -> dict[str, float]:
    """Return the processor time of some nodes' pairs [microseconds per pair], and how many edges there are."""
    from glider_stream.base.threads import threads
    from glider_stream.roadmap.builder import find_edges, node_positions, warm_up
    from glider_stream.scenario import read_scenario

    problem = read_scenario(options.scenario, [f"flow.file={options.currents}", *options.set]).problem()
    position = node_positions(problem)
    source = np.arange(0, len(position), options.share)
    with threads(1):
        warm_up(problem)
        began = time.process_time()
        found = list(find_edges(problem, position, source))
        seconds = time.process_time() - began
    return {
        "microseconds per pair": 1e6 * seconds / sum(part.pairs for part in found),
        "edges": float(sum(part.target.size for part in found)),
    }


def rates() -> dict[str, float]:
    """Return millions of evaluations per second and core on a file's grid of four times, and of one."""
    from glider_stream.evaluation.bench import LANES, _fly
    from glider_stream.water.ocean.flow import grid_flow

    rng, (nx, ny, nz) = np.random.default_rng(0), NODES
    x, y, z = np.linspace(-600, 600, nx), np.linspace(-600, 600, ny), np.linspace(-300, 0, nz)
    u, v = rng.uniform(-1, 1, (2, 4, nz, ny, nx))
    changing, _ = grid_flow(x, y, z, u, v, np.linspace(0, 5.0 * STEPS, 4))
    steady, _ = grid_flow(x, y, z, u[0], v[0])
    start, end = rng.uniform(-450, 450, (FLIGHTS, 2)), np.empty(FLIGHTS)
    found = {}
    for name, flow in (("four times", changing), ("one time", steady)):
        if hasattr(flow, "ladder"):  # an older checkout has none
            flow = flow._replace(ladder=flow.ladder._replace(longest=0.0))
        _fly(flow, start, end, 0, 1)
        began = time.process_time()
        _fly(flow, start, end, 0, FLIGHTS)
        seconds = time.process_time() - began
        found[f"{name}: million evaluations per second"] = FLIGHTS * LANES * STEPS * 4 / seconds / 1e6
    return found


def turn(checkout: Path | None) -> dict[str, float]:
    """Return the figures of one turn in its own process."""
    paths = {} if checkout is None else {"PYTHONPATH": str(checkout)}
    program = [sys.executable, __file__, *sys.argv[1:], "--turn"]
    found: dict[str, float] = json.loads(
        subprocess.run(program, env=os.environ | paths, capture_output=True, text=True, check=True).stdout
    )
    return found


def ceiling(program: str) -> dict[str, float]:
    """Return the figures of the ceiling."""
    found: dict[str, Any] = json.loads(
        subprocess.run([program], capture_output=True, text=True, check=True).stdout
    )
    return {f"{name}: million evaluations per second": value / 1e6 for name, value in found.items()}


def main() -> None:
    """Measure in turns, and print a table of medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("currents", type=Path)
    parser.add_argument("--beside", type=Path)
    parser.add_argument("--scenario", default="ionian")
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--share", type=int, default=12, help="take every so many-th node as a source")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--ceiling")
    parser.add_argument("--turn", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.turn:
        print(json.dumps(pairs(options) | rates()))
        return
    columns = {"here": lambda: turn(None)}
    if options.beside is not None:
        columns["beside"] = lambda: turn(options.beside)
    if options.ceiling is not None:
        columns["ceiling"] = lambda: ceiling(options.ceiling)
    runs: dict[str, list[dict[str, float]]] = {name: [] for name in columns}
    for _ in range(options.runs):
        for name, measure in columns.items():
            runs[name].append(measure())
    for figure in runs["here"][0]:
        print(figure)
        for name, found in runs.items():
            values = [one[figure] for one in found if figure in one]
            if values:
                ours = [one[figure] for one in runs["here"]]
                ratio = statistics.median(a / b for a, b in zip(ours, values, strict=True))
                spread = f"{min(values):.4g} to {max(values):.4g}"
                print(f"  {name:<8} {statistics.median(values):10.4g}  ({spread}), ours over it {ratio:.2f}")


if __name__ == "__main__":
    main()
