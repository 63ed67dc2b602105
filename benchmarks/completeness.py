"""The flow map against brute force, on fields that it was not tuned on: what it finds, how soon, how exactly.

python benchmarks/completeness.py [--sources 16] [--quick] [--beyond] [--rising] [--only FIELD] [-o RECORD.json]

For each field, pairs from random nodes to their 27 nearest neighbours, and to random ones of all others. A
connection is true where brute force (a scan of 48 x 96 controls, Newton from every local minimum of the miss) or
the flow map finds it, the latter verified by a replay with scipy's DOP853 in the full flow, as is a sample of all
legs. Exits 1 where a bound is missed. Pairs that are missed or late are kept in the record.
"""

import argparse
import json
import platform
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numba
import numpy as np
from completeness_fields import BEYOND, fields, rising_fields

from glider_stream.evaluation import brute_force
from glider_stream.kernels.edges import MISS, STATUS, TIME, Status
from glider_stream.kernels.flow import Grid, RisingGrid
from glider_stream.roadmap.evaluator import Evaluator
from glider_stream.roadmap.neighbours import AllNodes, Nearest, as_csr
from glider_stream.roadmap.verify import replayed_misses

SCAN = (48, 96)
LATE = 1.0
"""A leg that arrives this much [s] after brute force's is late."""
BOUNDS = {"near": 0.99, "all": 0.98, "in_time_near": 0.99, "in_time_all": 0.99, "reachable": 0.995}
MOST_OFF = {True: 0.5, False: 0.1}
"""Distance [m] from the target that a replayed leg may end at, on a grid and elsewhere."""
Case = tuple[Any, float, Evaluator]


def brute(case: Case, source: Any, targets: Any, threads: int) -> Any:
    """Least travel times of each source's row of targets [s], inf where there is no leg: one flat array."""
    position, departure, judge = case
    dt, horizon = judge.integration.dt, judge.integration.dt * judge.integration.steps

    def of(one: int) -> Any:
        ends = position, source[one : one + 1], targets[one]
        return brute_force.fastest_legs(judge.flow, judge.polar, *ends, departure, *SCAN, dt, horizon)[0]

    with ThreadPoolExecutor(threads) as pool:
        return np.concatenate(list(pool.map(of, range(len(source)))))


def end_distances(case: Case, source: Any, target: Any, rows: Any) -> Any:
    """How far from their targets [m] legs end, flown by DOP853 in the full flow: (n,)."""
    position, departure, judge = case
    return replayed_misses(judge, departure, position, source, target, rows[:, TIME:])


def connect(case: Case, source: Any, targets: Any) -> tuple[Any, Any, Any]:
    """All pairs of sources with their rows of targets: source, target, outcome of each."""
    position, departure, judge = case
    indptr, target = as_csr(targets)
    rows = judge.connect(position, departure, source, indptr, target)
    return np.repeat(source, np.diff(indptr)), target, rows


def compare(case: Case, source: Any, target: Any, rows: Any, best: Any) -> tuple[dict[str, Any], list[Any]]:
    """Brute force's least times beside the flow map's outcomes; the pairs that it misses, or is late for."""
    position = case[0]
    grid, found = isinstance(case[2].flow, Grid | RisingGrid), rows[:, STATUS] == Status.CONNECTED
    only = np.flatnonzero(found & np.isinf(best))
    off = end_distances(case, source[only], target[only], rows[only])
    false = only[off >= MOST_OFF[grid]]
    found[false] = False
    true = found | np.isfinite(best)
    both = found & np.isfinite(best)
    late = both & (rows[:, TIME] > best + LATE)
    poor = [
        {
            "source": int(source[n]),
            "target": int(target[n]),
            "rise_m": float(position[target[n], 2] - position[source[n], 2]),
            "brute_s": float(best[n]),
            "found_s": float(rows[n, TIME]) if found[n] else None,
        }
        for n in np.flatnonzero((true & ~found) | late)
    ]
    share = found[true].mean() if true.any() else 1.0
    in_time = 1.0 - late.sum() / max(both.sum(), 1)
    counts = {"true": int(true.sum()), "by_fan_alone": len(only), "false": len(false)}
    return counts | {"share": float(share), "in_time": float(in_time)}, poor


def reachable_share(case: Case, source: Any) -> tuple[float, int]:
    """The share of the legs to all nodes that lie under the fan too, and how many legs there are."""
    position, departure, judge = case
    law = AllNodes().among(position, 1.0)
    start, target, rows = connect(case, source, [law.of(position[n]) for n in source])
    found = rows[:, STATUS] == Status.CONNECTED
    indptr, under, legs = judge.reach(position, departure, source, 0)
    hit = legs[:, STATUS] == Status.CONNECTED
    reached = np.zeros((len(position), len(position)), bool)
    reached[np.repeat(source, np.diff(indptr))[hit], under[hit]] = True
    return float(reached[start[found], target[found]].mean()), int(found.sum())


def measure(name: str, case: Case, size: dict[str, int], threads: int) -> dict[str, Any]:
    """One field's row."""
    began = time.perf_counter()
    position = case[0]
    rng = np.random.default_rng(0)
    source = np.sort(rng.choice(len(position), size["sources"], replace=False))
    laws = Nearest(27).among(position, 1.0), AllNodes().among(position, 1.0)
    near, every = ([law.of(position[n]) for n in source] for law in laws)
    some = [np.sort(rng.choice(row, min(size["others"], row.size), replace=False)) for row in every]
    best = brute(case, source, [np.concatenate(pair) for pair in zip(near, some, strict=True)], threads)
    is_near = np.concatenate([np.arange(a.size + b.size) < a.size for a, b in zip(near, some, strict=True)])
    result: dict[str, Any] = {"field": name, "nodes": len(position), **size, "missed_or_late": {}}
    start, target, rows = connect(case, source, every)
    # what a roadmap of all pairs holds, of which brute force has looked at some
    looked = np.concatenate([np.isin(row, few) for row, few in zip(every, some, strict=True)])
    pairs = {"near": (connect(case, source, near), best[is_near]),
             "all": ((start[looked], target[looked], rows[looked]), best[~is_near])}  # fmt: skip
    for law, (outcome, least) in pairs.items():
        counts, result["missed_or_late"][law] = compare(case, *outcome, least)
        result |= {f"{key}_{law}" if key != "share" else law: value for key, value in counts.items()}
    legs = np.flatnonzero(rows[:, STATUS] == Status.CONNECTED)
    legs = rng.choice(legs, min(size["replays"], legs.size), replace=False)
    off = end_distances(case, start[legs], target[legs], rows[legs])
    result |= {"replayed": legs.size, "most_off_m": off.max(), "off_999_m": float(np.quantile(off, 0.999))}
    wide = np.sort(rng.choice(len(position), size["fans"], replace=False))
    result["reachable"], result["edges"] = reachable_share(case, wide)
    bounds = all(result[key] >= bound for key, bound in BOUNDS.items())
    close = result["most_off_m"] < MOST_OFF[isinstance(case[2].flow, Grid | RisingGrid)]
    result["holds"] = bool(bounds and close and not result["false_near"] and not result["false_all"])
    return result | {"seconds": round(time.perf_counter() - began, 1)}


def odd_pairs(case: Case, count: int) -> int:
    """How many of so many random pairs, degenerate ones among them, have a wrong status, or NaN or not amiss."""
    _, departure, judge = case
    flow, rng = judge.flow, np.random.default_rng(3)
    known = flow.extent
    lo, hi = np.array([known.x_lo, known.y_lo, -300.0]), np.array([known.x_hi, known.y_hi, 0.0])
    position = rng.uniform(lo - 0.05 * (hi - lo) * [1, 1, 0], hi + 0.05 * (hi - lo) * [1, 1, 0], (600, 3))
    position[::5, 2] = -100.0
    position[1::7] = position[::7][: len(position[1::7])]  # twins
    position[2::9, :2] = 0.5 * (lo + hi)[:2]  # above each other
    position[3::11, 0], position[4::13, 1] = known.x_hi, known.y_lo  # on the border
    position[5::17, 2] = np.nextafter(-100.0, 0.0)  # a rise too short for its square
    source, target = np.sort(rng.integers(0, 600, count)), rng.integers(0, 600, count)
    nodes, counts = np.unique(source, return_counts=True)
    rows = judge.connect(position, departure, nodes, np.concatenate([[0], np.cumsum(counts)]), target)
    status, connected = rows[:, STATUS], rows[:, STATUS] == Status.CONNECTED
    known = ((position >= lo) & (position <= hi))[:, :2].all(axis=1)
    outside = ~(known[source] & known[target])
    level = ~outside & (position[source, 2] == position[target, 2])
    wrong = ~np.isin(status, [one.value for one in Status])
    wrong |= (status == Status.OUTSIDE_FLOW) != outside
    wrong |= (status == Status.SAME_DEPTH) != level
    wrong |= np.where(connected, ~np.isfinite(rows).all(axis=1), np.isfinite(rows[:, 1:]).any(axis=1))
    wrong |= connected & ~(rows[:, MISS] <= 0.01)
    return int(wrong.sum())


def main() -> None:
    """Measure every field; print a table, keep a record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sources", type=int, default=16)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--beyond", action="store_true", help=f"only {BEYOND}, which is held to no bound")
    parser.add_argument("--rising", action="store_true", help="the flows with a vertical part instead")
    parser.add_argument("--only", help="only the field with this name")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    size = {"sources": options.sources, "others": 100, "replays": 200, "fans": 40}
    if options.quick:
        size = {"sources": 2, "others": 30, "replays": 20, "fans": 10}
    threads = int(numba.config.NUMBA_NUM_THREADS)
    machine = {"processor": platform.processor() or platform.machine(), "threads": threads}
    record: dict[str, Any] = {"date": datetime.now(UTC).isoformat(timespec="seconds"), "machine": machine}
    print(f"{record['date']}, {machine['processor']}, {threads} threads, {size}")
    found = "| true, {} | found | in time "
    print("| field " + found.format("near") + found.format("all") + "| most off | 99.9 % | reachable |")
    print("|" + 10 * "---|")
    cases, record["rows"] = rising_fields() if options.rising else fields(), []
    names = [BEYOND] if options.beyond else [name for name in cases if name != BEYOND]
    for name in [name for name in names if options.only in (None, name)]:
        case = cases[name]
        row = measure(name, case, size, threads)
        record["rows"].append(row)
        laws = (
            f"{row[f'true_{law}']:,} | {row[law]:.2%} | {row[f'in_time_{law}']:.2%}" for law in ("near", "all")
        )
        print(
            f"| {name} | {' | '.join(laws)} | {1e3 * row['most_off_m']:.1f} mm | {1e3 * row['off_999_m']:.1f} mm "
            f"| {row['reachable']:.2%} |{'' if row['holds'] else ' <- a bound is missed'}",
            flush=True,
        )
    count = 3_000 if options.quick else 100_000
    boxed = ("cells in a grid",) if options.rising else ("seed box", "double gyre, swinging")
    odd = {name: odd_pairs(cases[name], count) for name in boxed if options.only in (None, name)}
    print(f"of {count:,} random pairs, degenerate ones among them, with a wrong status or NaN: {odd}")
    if options.output:
        options.output.write_text(json.dumps(record | {"odd_pairs": odd}, indent=1) + "\n")
    if any(odd.values()) or not (options.beyond or all(row["holds"] for row in record["rows"])):
        sys.exit(1)


if __name__ == "__main__":
    main()
