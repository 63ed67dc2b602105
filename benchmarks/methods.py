"""The paper's comparison on its own problem: edges, route and pairs per second by method, law and controls.

python benchmarks/methods.py [-o benchmarks/records/methods.json]
"""

import argparse
import json
import platform
from pathlib import Path

import numba

from glider_stream.roadmap.builder import build_roadmap
from glider_stream.scenario import read_scenario
from glider_stream.search.query import Planner

SAMPLED = [(method, candidates) for candidates in (16, 54) for method in ("streamline", "surface")]
CASES = [(law, *case) for law in ("nearest", "all") for case in (*SAMPLED, ("flow-map", None))]


def main() -> None:
    """Build and query every case; print a table, keep a record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    print(
        "| neighbours | method | controls | edges | connected | route | pairs/s |\n|---|---|---|---|---|---|---|"
    )
    rows = []
    for law, method, candidates in CASES:
        overrides = [f"neighbours.kind={law}", f"steering.method={method}"]
        overrides += [] if candidates is None else [f"steering.candidates={candidates}"]
        problem = read_scenario("seed-box", overrides).problem()
        road = build_roadmap(problem)
        path = Planner(road, problem).query()
        route = f"{path.travel_time:,.0f} s" if path.found else "none"
        name = "27 nearest" if law == "nearest" else "all"
        print(
            f"| {name} | {method} | {candidates or 'exact'} | {road.target.size:,} | {road.connected_share:.2%} "
            f"| {route} | {road.pairs_per_s:,.0f} |",
            flush=True,
        )
        seconds = path.travel_time if path.found else None
        rows.append(
            {**road.as_dict(), "law": name, "method": method, "candidates": candidates, "route_s": seconds}
        )
        for text in ("scenario", "flow", "glider"):
            rows[-1].pop(text)
    machine = {"processor": platform.processor() or platform.machine(), "threads": numba.get_num_threads()}
    if options.output:
        options.output.write_text(json.dumps({"machine": machine, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
