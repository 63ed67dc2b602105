"""What a query with the clock running costs, without slices, against the build of one slice.

    python benchmarks/clock_query.py [--nodes 1154] [--nodes 10082]

Without goal direction every node is expanded (`arrivals`). With it, a query expands what its bound of the
remaining time does not rule out, and looks a second time for a way by a later arrival. Times are processor time
of all threads; the least of several runs counts for the slice and for `arrivals`, and the median and the worst
over random queries for the rest.
"""

import json
import math
import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median
from typing import Any

import click
import numpy as np

from glider_stream.base.threads import threads
from glider_stream.roadmap.builder import build_roadmap, node_positions, warm_up
from glider_stream.roadmap.problem import Problem
from glider_stream.scenario import read_scenario
from glider_stream.search.time_dependent import ClockPlanner

SIZES = {
    1154: [],
    10082: [
        "sampling.shape=[70,36,4]", "domain.x=[0.0,5800.0]", "domain.y=[0.0,2900.0]", "flow.length=2900.0",
        "flow.x=[-500.0,6300.0]", "flow.y=[-500.0,3400.0]", "query.start=[900.0,900.0,0.0]",
        "query.goal=[4600.0,2000.0,0.0]",
    ],
}  # fmt: skip
"""Scenarios by their number of nodes; nodes lie 83 m apart in each."""


def taken(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return the processor time [s] of some work, and what it makes."""
    began = time.process_time()
    made = work()
    return time.process_time() - began, made


def compared(problem: Problem, runs: int, queries: int) -> dict[str, Any]:
    """One scenario: the slice, all arrivals, and queries, in seconds and over the slice."""
    warm_up(problem)
    position = node_positions(problem)
    planner = ClockPlanner(problem, position)
    planner.query()  # reads the flow's greatest speeds, and compiles
    one_slice = replace(problem, slices=())
    slice_s = min(taken(lambda: build_roadmap(one_slice, None, lambda progress: None))[0] for _ in range(runs))
    everywhere = min(taken(planner.arrivals)[0] for _ in range(runs))
    random, took, shares = np.random.default_rng(0), [], []
    while len(took) < queries:
        start, goal = position[random.choice(len(position), 2, replace=False)]
        seconds, path = taken(lambda a=start, b=goal: planner.query(a, b))
        if path.found and math.dist(start[:2], goal[:2]) > 0:
            took.append(seconds)
            shares.append(path.expanded)
    return {
        "nodes": len(position),
        "slice_s": round(slice_s, 2),
        "arrivals_over_slice": round(everywhere / slice_s, 2),
        "own_query_over_slice": round(taken(planner.query)[0] / slice_s, 2),
        "random_queries": queries,
        "query_over_slice_median": round(median(took) / slice_s, 2),
        "query_over_slice_worst": round(max(took) / slice_s, 2),
        "expanded_share_median": round(median(shares), 3),
    }


@click.command()
@click.option("--nodes", multiple=True, type=int, default=tuple(SIZES), help="A size; again for more.")
@click.option("--runs", default=2, help="Runs of the slice and of all arrivals.")
@click.option("--queries", default=8, help="Random queries.")
def main(nodes: tuple[int, ...], runs: int, queries: int) -> None:
    """Measure and print."""
    with threads(None) as count:
        for size in nodes:
            problem = read_scenario("swinging-gyre", SIZES[size]).problem()
            print(json.dumps(compared(problem, runs, queries) | {"threads": count}), flush=True)


if __name__ == "__main__":
    main()
