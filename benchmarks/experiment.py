"""The paper's experiment: equispaced nodes in random flow fields, roadmaps by method and number of controls.

What the three figures of it (edges_by_controls.py, route_by_controls.py, route_by_time.py) share. Rows are kept
as they are made: a run that was stopped goes on where it was.
"""

import argparse
import json
import platform
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
from scipy.stats import t as student

from glider_stream.kernels.cache import KERNEL_DIGEST
from glider_stream.plot import Mean, Series
from glider_stream.roadmap.builder import build_roadmap
from glider_stream.roadmap.problem import Problem
from glider_stream.roadmap.steering import FlowMapMethod, Method, StreamlineMethod, SurfaceMethod
from glider_stream.scenario import scenario_from_table, shipped_scenarios
from glider_stream.search.query import Planner
from glider_stream.water.analytic import Vortex, Vortices
from glider_stream.water.sampled import sample_flow

RECORD = Path(__file__).parent / "records" / "experiment.jsonl"
RUNS, CONTROLS = 32, (16, 25, 36, 54, 100, 200, 400)
REFINED = 54
"""Controls that are refined at most: beyond, the line's candidates outnumber what they lead to."""
FASTEST = 1.9
CONFIDENCE = 0.997
METHODS: dict[str, Callable[[int], Method]] = {
    "surface": SurfaceMethod,
    "streamline": StreamlineMethod,
    "streamline, refined": lambda controls: StreamlineMethod(controls, refine=True),
    "flow map": lambda controls: FlowMapMethod(),
}
Row = dict[str, Any]


def random_vortices(seed: int) -> list[dict[str, float]]:
    """Fourteen vortices like the seed box's, as fast together as its own at most."""
    rng, names = np.random.default_rng(seed), ("x", "y", "radius", "speed", "depth", "thickness")
    columns = (
        *rng.uniform(-520, 520, (2, 14)),
        rng.uniform(80, 135, 14),
        rng.uniform(0.8, 1.5, 14) * rng.choice([-1, 1], 14),
        rng.uniform(40, 290, 14),
        rng.uniform(35, 80, 14),
    )
    rows = [dict(zip(names, map(float, row), strict=True)) for row in zip(*columns, strict=True)]
    flow = Vortices(tuple(Vortex(**row) for row in rows)).kernel((-300.0, 0.0))
    box = (-600.0, 600.0)
    scale = FASTEST / sample_flow(flow, (12.0, 12.0, 10.0), box, box, (-300.0, 0.0)).extent.max_speed
    return [row | {"speed": scale * row["speed"]} for row in rows]


def problem_of(seed: int, shape: list[int]) -> Problem:
    """The seed box in another random field, with nodes evenly spread."""
    table = tomllib.loads(shipped_scenarios()["seed-box"].read_text())
    table["flow"]["vortex"] = random_vortices(seed)
    table["sampling"]["shape"] = shape
    return scenario_from_table(table, Path()).problem()


def cases(runs: int, controls: tuple[int, ...]) -> Iterator[tuple[int, str, int | None]]:
    """Seed, method, number of controls; the flow map has none. Whole seeds one after the other."""
    for seed in range(runs):
        for method in METHODS:
            counts = [n for n in controls if method != "streamline, refined" or n <= REFINED]
            for count in [None] if method == "flow map" else counts:
                yield seed, method, count


def measure(problem: Problem, method: str, controls: int | None) -> Row:
    """One roadmap and its route; compilation left out."""
    steering = METHODS[method](controls or 1)
    case = replace(problem, evaluator=replace(problem.evaluator, steering=steering))
    road = build_roadmap(case)
    path = Planner(road, case).query()
    return {
        "nodes": len(road.position),
        "pairs": road.evaluated,
        "edges": int(road.target.size),
        "wall_s": round(road.wall_s, 4),
        "route_s": round(path.travel_time, 3) if path.found else None,
        "legs": len(path.legs),
    }


def collect(record: Path, quick: bool) -> list[Row]:
    """All rows, those that the record has and those that it lacks."""
    runs, controls, shape = (2, (4, 16), [5, 5, 4]) if quick else (RUNS, CONTROLS, [10, 10, 10])
    here = {
        "machine": platform.processor() or platform.machine(),
        "threads": numba.get_num_threads(),
        "kernel_digest": KERNEL_DIGEST[:16],
    }
    rows = [json.loads(line) for line in record.read_text().splitlines()] if record.exists() else []
    done = {(row["seed"], row["method"], row["controls"]) for row in rows}
    missing = [case for case in cases(runs, controls) if case not in done]
    problem, of = None, -1
    for n, (seed, method, count) in enumerate(missing):
        if problem is None or of != seed:
            problem, of = problem_of(seed, shape), seed
        row = {"seed": seed, "method": method, "controls": count, **measure(problem, method, count), **here}
        with record.open("a") as file:
            file.write(json.dumps(row) + "\n")
        rows.append(row)
        print(f"{n + 1} of {len(missing)}: {json.dumps(row)}", file=sys.stderr, flush=True)
    return rows


def mean_and_interval(values: list[float]) -> tuple[float, float, float]:
    """The mean, and the ends of its confidence interval by Student's t."""
    middle = float(np.mean(values))
    if len(values) < 2:
        return middle, middle, middle
    half = float(
        student.ppf(0.5 + CONFIDENCE / 2, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
    )
    return middle, middle - half, middle + half


def by_case(rows: list[Row], method: str) -> dict[int | None, list[Row]]:
    """A method's rows by number of controls, rising."""
    mine = [row for row in rows if row["method"] == method]
    counts = sorted({row["controls"] for row in mine}, key=lambda count: count or 0)
    return {n: [row for row in mine if row["controls"] == n] for n in counts}


def series(rows: list[Row], value: str, against: Callable[[list[Row]], float | None]) -> list[Series]:
    """Per method the mean of a value that is known, with its interval, against something of the same rows."""
    result = []
    for method in METHODS:
        points = []
        for group in by_case(rows, method).values():
            known = [row[value] for row in group if row[value] is not None]
            if known:
                note = "" if len(known) == len(group) else f"{len(known)}/{len(group)}"
                points.append(Mean(against(group), *mean_and_interval(known), note))
        result.append(Series(method, points))
    return result


def over_flow_map(rows: list[Row]) -> list[Row]:
    """The rows with `route`: the travel time over the flow map's in the same field, None where there is none."""
    best = {row["seed"]: row["route_s"] for row in rows if row["method"] == "flow map"}
    return [row | {"route": row["route_s"] and row["route_s"] / best[row["seed"]]} for row in rows]


def arguments(document: str) -> argparse.Namespace:
    """What each of the three scripts is told."""
    parser = argparse.ArgumentParser(description=document.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two small runs, into a record of their own")
    parser.add_argument("--record", type=Path, help=f"the rows, to go on with; {RECORD.name} if not given")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the figure: PNG, SVG or PDF")
    options = parser.parse_args()
    if options.record is None:
        options.record = Path(tempfile.mkdtemp()) / "quick.jsonl" if options.quick else RECORD
    return options
