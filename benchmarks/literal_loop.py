"""Pairs per second, by candidates and exact, beside the literal loop (every control, all steps): one run.

python benchmarks/literal_loop.py [--law nearest|all] [--runs 5] [--share 4]
"""

import argparse
import platform
import statistics
import time
from dataclasses import replace

import numba
import numpy as np
from numba import njit, prange

from glider_stream.kernels.control import candidate_controls, control_towards, direction_of
from glider_stream.kernels.edges import STATUS, TIME, Status
from glider_stream.kernels.motion import along_segment, rk4_step
from glider_stream.kernels.place import Pair, Place
from glider_stream.roadmap.builder import node_positions
from glider_stream.roadmap.neighbours import AllNodes, Nearest, as_csr
from glider_stream.roadmap.steering import FlowMapMethod
from glider_stream.scenario import read_scenario


@njit
def literal_approach(flow, pair, through, integration):
    """Miss [m] and time [s] of the closest approach over all steps."""
    miss, time_of_miss = np.inf, np.inf
    dt = integration.dt
    start, here = pair.start, pair.start
    for n in range(integration.steps):
        x, y = rk4_step(flow, here, through, dt)
        there = Place(x, y, start.z + (n + 1) * dt * through.w, start.t + (n + 1) * dt)
        share, distance = along_segment(here, there, pair.goal)
        if distance < miss:
            miss, time_of_miss = distance, (n + share) * dt
        here = there
    return miss, time_of_miss


@njit(parallel=True)
def literal_loop(flow, polar, steering, integration, position, source, indptr, target):
    """Travel time of each pair's best hit [s], inf where none."""
    best = np.full(target.size, np.inf)
    for n in prange(source.size):
        controls = np.empty((steering.candidates, 2))
        x, y, z = position[source[n]]
        for k in range(indptr[n], indptr[n + 1]):
            x_q, y_q, z_q = position[target[k]]
            pair = Pair(Place(x, y, z, 0.0), Place(x_q, y_q, z_q, 0.0))
            slowest = abs(z_q - z) / (integration.steps * integration.dt)
            count = candidate_controls(steering, flow, polar, pair, slowest, controls)
            for one in range(count):
                c = control_towards(polar, direction_of(pair), controls[one, 0], controls[one, 1])
                miss, when = literal_approach(flow, pair, c, integration)
                if miss < integration.tolerance and 0.0 < when < best[k]:
                    best[k] = when
    return best


def main() -> None:
    """Measure, and print a row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--law", choices=["nearest", "all"], default="nearest")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--share", type=int, default=1, help="take every so many-th node as a source")
    options = parser.parse_args()
    problem = read_scenario("seed-box").problem()
    evaluator, position = problem.evaluator, node_positions(problem)
    law = Nearest(27) if options.law == "nearest" else AllNodes()
    neighbourhood = law.among(position, 1.0)
    source = np.arange(0, len(position), options.share)
    indptr, target = as_csr([neighbourhood.of(position[n]) for n in source])
    literal = (evaluator.flow, evaluator.polar, evaluator.steering.kernel(), evaluator.integration.kernel())

    began = time.perf_counter()
    literal_loop(*literal, position, source[:1], np.array([0, 1]), target[:1])
    evaluator.connect(position, 0.0, source[:1], [0, 1], target[:1])
    compiled = time.perf_counter() - began
    exact = replace(evaluator, steering=FlowMapMethod())
    exact.connect(position, 0.0, source[:1], [0, 1], target[:1])
    slow, fast, fan = [], [], []
    for _ in range(options.runs):
        began = time.perf_counter()
        best = literal_loop(*literal, position, source, indptr, target)
        half = time.perf_counter()
        edges = evaluator.connect(position, 0.0, source, indptr, target)
        slow.append(half - began)
        fast.append(time.perf_counter() - half)
        began = time.perf_counter()
        exact.connect(position, 0.0, source, indptr, target)
        fan.append(time.perf_counter() - began)
    same = np.array_equal(np.isfinite(best), joined := edges[:, STATUS] == Status.CONNECTED)
    same &= bool(np.nanmax(np.abs(best - edges[:, TIME])[joined], initial=0.0) < 1e-9)
    print(f"seed-box, {options.law}, {evaluator.steering.candidates} controls, {target.size:,} pairs,")
    print(f"{platform.processor() or platform.machine()}, {numba.get_num_threads()} threads")
    print(f"literal loop {target.size / statistics.median(slow):>10,.0f} pairs/s")
    for name, times, what in (("evaluator", fast, f", the same edges: {same}"), ("flow map", fan, "")):
        ratios = [a / b for a, b in zip(slow, times, strict=True)]
        spread = f"{statistics.median(ratios):.2f} times ({min(ratios):.2f} to {max(ratios):.2f})"
        print(f"{name:<12} {target.size / statistics.median(times):>10,.0f} pairs/s, {spread}{what}")
    print(f"first calls, compilation or its cache included: {compiled:.1f} s")


if __name__ == "__main__":
    main()
