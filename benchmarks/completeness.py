"""The flow map against brute force, on fields that it was not tuned on: what it finds, how soon, how exactly.

python benchmarks/completeness.py [--sources 5] [--quick] [-o benchmarks/records/completeness.json]

For each field, pairs from a few nodes to their 27 nearest neighbours and to all others. A connection is true
where brute force (a scan of 48 x 96 controls, Newton from every local minimum of the miss) or the flow map finds
it; what the flow map finds is replayed with scipy's DOP853 in the full flow. Exits 1 where a bound is missed.
"""

import argparse
import json
import math
import platform
import sys
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numba
import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
import brute_force
import reference

from glider_stream.edges import Evaluator, FlowMapMethod, IntegrationSettings
from glider_stream.flow import DoubleGyre, Vortex, Vortices, is_steady, sample_flow
from glider_stream.glider import PRESETS, polar
from glider_stream.kernels.edges import Status
from glider_stream.kernels.flow import Grid
from glider_stream.kernels.terrain import OpenWater
from glider_stream.neighbours import AllNodes, Nearest, as_csr
from glider_stream.roadmap import node_positions
from glider_stream.scenario import read_scenario

SCAN = (48, 96)
NEAR = 10
"""So many times the sources for pairs of near neighbours, of which each has few."""
LATE = 1.0
"""A leg that arrives this much [s] after brute force's is late."""
BOUNDS = {"near": 0.99, "all": 0.98, "in_time": 0.99, "reachable": 0.995}
MOST_OFF = {True: 0.5, False: 0.1}
"""Distance [m] from the target that a replayed leg may end at, on a grid and elsewhere."""
DEPTHS = (-330.0, 0.0)


def random_vortices(seed: int, count: int, speed: float, thickness: tuple[float, float]) -> Any:
    """Vortices over the seed box, the kernel's flow."""
    rng = np.random.default_rng(seed)
    rows = zip(
        *rng.uniform(-550, 550, (2, count)),
        rng.uniform(70, 160, count),
        rng.uniform(0.5, 1.0, count) * speed * rng.choice([-1.0, 1.0], count),
        rng.uniform(0, 300, count),
        rng.uniform(*thickness, count),
        strict=True,
    )
    return Vortices(tuple(Vortex(*row) for row in rows)).kernel(DEPTHS)


def in_grid(flow: Any, spacing: tuple[float, float, float]) -> Any:
    """The flow on a grid wide enough for all paths."""
    return sample_flow(flow, spacing, (-2200.0, 2200.0), (-2200.0, 2200.0), DEPTHS)


def on_levels(seed: int, count: int, half: float, levels: list[float]) -> Any:
    """Nodes (count, 3) [m], random on a few depths."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-half, half, (count, 2)), rng.choice(levels, count)])


def fields() -> dict[str, tuple[Any, float, Evaluator]]:
    """Name -> nodes (n, 3) [m], departure [s], evaluator."""
    box = IntegrationSettings(5.0, 125, 5.0)
    gyre = IntegrationSettings(20.0, 100, 10.0)
    paper, slocum = polar(PRESETS["paper"]), polar(PRESETS["slocum"])

    def judge(flow: Any, glide: Any = paper, integration: Any = box) -> Evaluator:
        return Evaluator(flow, OpenWater(-math.inf), glide, FlowMapMethod(), integration)

    seed_box = read_scenario("seed-box", ["steering.method=flow-map"]).problem()
    rng = np.random.default_rng(5)
    anywhere = rng.uniform([-450, -450, -300], [450, 450, 0], (900, 3))
    four = [0.0, -100.0, -200.0, -300.0]
    gyres = rng.uniform([0, 0], [4000, 2000], (500, 2))
    gyres = np.column_stack([gyres, rng.choice([0.0, -100.0, -200.0], 500)])
    strong = in_grid(random_vortices(23, 14, 1.6, (40, 90)), (15, 15, 10))
    coarse = in_grid(random_vortices(24, 12, 1.0, (50, 150)), (25, 25, 20))
    steady = DoubleGyre(amplitude=0.15, length=2000.0, epsilon=0.0, period=14400.0).kernel(DEPTHS)
    swinging = DoubleGyre(amplitude=0.15, length=2000.0, epsilon=0.25, period=3600.0).kernel(DEPTHS)
    return {
        "seed box": (node_positions(seed_box), 0.0, seed_box.evaluator),
        "other vortices": (on_levels(1, 900, 450, four), 0.0, judge(random_vortices(21, 10, 0.9, (60, 200)))),
        "nodes at any depth": (anywhere, 0.0, judge(random_vortices(22, 12, 0.9, (40, 120)))),
        "strong vortices, in a grid": (on_levels(2, 900, 450, four), 0.0, judge(strong)),
        "any depth, in a coarse grid": (anywhere, 0.0, judge(coarse)),
        "double gyre": (gyres, 0.0, judge(steady, slocum, gyre)),
        "double gyre, swinging": (gyres, 1234.0, judge(swinging, slocum, gyre)),
    }  # fmt: skip


def brute(judge: Evaluator, position: Any, source: Any, targets: Any, departure: float, threads: int) -> Any:
    """Least travel times of each source's row of targets, one after the other [s], inf where there is no leg."""
    integration = judge.integration
    horizon = integration.dt * integration.steps

    def of(one: int) -> Any:
        ends = position, source[one : one + 1], targets[one]
        return brute_force.fastest_legs(judge.flow, judge.polar, *ends, departure, *SCAN, integration.dt, horizon)

    with ThreadPoolExecutor(threads) as pool:
        return np.concatenate([row.ravel() for row in pool.map(of, range(len(source)))])


def end_distance(judge: Evaluator, start: Any, goal: Any, row: Any, departure: float) -> float:
    """How far from its target [m] a leg ends, flown by DOP853."""
    angle, heading, speed = row[3], row[4], row[5]
    along = speed * math.cos(angle)
    through = along * math.cos(heading), along * math.sin(heading), speed * math.sin(angle)
    end = reference.replay(judge.flow, start, through, row[1], departure)(row[1])
    return float(np.linalg.norm(end - goal))


def measure(
    name: str, case: tuple[Any, float, Evaluator], sources: int, replays: int, threads: int
) -> dict[str, Any]:
    """One field's row."""
    position, departure, judge = case
    rng = np.random.default_rng(0)
    result: dict[str, Any] = {"field": name, "nodes": len(position), "sources": sources}
    for key, law, count in (("near", Nearest(27), NEAR * sources), ("all", AllNodes(), sources)):
        source = np.sort(rng.choice(len(position), count, replace=False))
        targets = [law.among(position, 1.0).of(position[n]) for n in source]
        indptr, target = as_csr(targets)
        rows = judge.connect(position, departure, source, indptr, target)
        from_ = np.repeat(np.arange(count), np.diff(indptr))
        best = brute(judge, position, source, targets, departure, threads)
        found = rows[:, 0] == Status.CONNECTED
        there = found | np.isfinite(best)
        result[f"true_{key}"] = int(there.sum())
        result[key] = float(found[there].mean())
        both = found & np.isfinite(best)
        result[f"in_time_{key}"] = float((rows[both, 1] <= best[both] + LATE).mean())
        assert np.isfinite(rows[found, 1:]).all()
    some = rng.choice(np.flatnonzero(found), min(replays, int(found.sum())), replace=False)
    off = [end_distance(judge, position[source[from_[n]]], position[target[n]], rows[n], departure) for n in some]
    result["replayed"], result["most_off_m"] = len(some), max(off)
    at, under, legs = judge.reach(position, departure, source, 0)
    reached = np.zeros((sources, len(position)), bool)
    hit = legs[:, 0] == Status.CONNECTED
    reached[np.repeat(np.arange(sources), np.diff(at))[hit], under[hit]] = True
    result["reachable"] = float(reached[from_[found], target[found]].mean())
    result["grid"], result["steady"] = isinstance(judge.flow, Grid), is_steady(judge.flow)
    result["holds"] = bool(
        all(result[key] >= BOUNDS[key] for key in ("near", "all", "reachable"))
        and min(result["in_time_near"], result["in_time_all"]) >= BOUNDS["in_time"]
        and result["most_off_m"] < MOST_OFF[result["grid"]]
    )
    return result


def odd_pairs(judge: Evaluator, count: int) -> int:
    """How many of so many random pairs, degenerate ones among them, have NaN where there should be none."""
    rng = np.random.default_rng(3)
    position = rng.uniform([-650, -650, -300], [650, 650, 0], (600, 3))
    position[::5, 2] = -100.0
    position[1::7] = position[::7][: len(position[1::7])]  # twins
    position[2::9, :2] = position[0, :2]  # above each other
    position[3::11, 0] = judge.flow.x_hi  # on the border
    source, target = rng.integers(0, 600, (2, count))
    order = np.argsort(source, kind="stable")
    nodes, counts = np.unique(source[order], return_counts=True)
    rows = judge.connect(position, 0.0, nodes, np.concatenate([[0], np.cumsum(counts)]), target[order])
    connected = rows[:, 0] == Status.CONNECTED
    known = np.isin(rows[:, 0], [status.value for status in Status])
    return int((~known).sum() + (~np.isfinite(rows[connected])).sum() + np.isfinite(rows[~connected, 1:]).sum())


def main() -> None:
    """Measure every field; print a table, keep a record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sources", type=int, default=5)
    parser.add_argument("--replays", type=int, default=50)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    sources, replays = (2, 20) if options.quick else (options.sources, options.replays)
    threads = numba.config.NUMBA_NUM_THREADS
    cases, rows = fields(), []
    print("| field | true, near | found | in time | true, all | found | in time | most off | reachable |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, case in cases.items():
        row = measure(name, case, sources, replays, threads)
        rows.append(row)
        print(
            f"| {name} | {row['true_near']} | {row['near']:.2%} | {row['in_time_near']:.2%} "
            f"| {row['true_all']:,} "
            f"| {row['all']:.2%} | {row['in_time_all']:.2%} | {1e3 * row['most_off_m']:.1f} mm "
            f"| {row['reachable']:.2%} |",
            flush=True,
        )
    odd = odd_pairs(cases["seed box"][2], 2_000 if options.quick else 100_000)
    print(f"random pairs, degenerate ones among them, with a wrong status or NaN: {odd}")
    if options.output:
        machine = {"processor": platform.processor() or platform.machine(), "threads": threads}
        record = {
            "date": datetime.now(UTC).date().isoformat(),
            "machine": machine,
            "rows": rows,
            "odd_pairs": odd,
        }
        options.output.write_text(json.dumps(record, indent=1) + "\n")
    if odd or not all(row["holds"] for row in rows):
        sys.exit(1)


if __name__ == "__main__":
    main()
