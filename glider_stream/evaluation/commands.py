"""Whole commands, measured in their own processes: starts, and larger and larger roadmaps."""

import math
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..base.settings import require
from ..base.toml import to_toml
from ..roadmap.store import opened_roadmap, read_roadmap
from ..scenario import scenario_of, shipped_scenarios
from ..search.query import Planner
from .record import Figure

SIZES = (1_000, 10_000, 100_000)
LIMIT = 64
LARGE, LARGE_LIMIT = 1_000_000, 32


def growing(nodes: int) -> str:
    """Return a scenario as text whose box grows with its nodes on four depths, at constant density."""
    side = math.ceil(math.sqrt(nodes / 4))
    half = 28.125 * side
    rng = np.random.default_rng(5)
    count = max(1, round(nodes / 2000))
    rows = zip(
        *rng.uniform(-half, half, (2, count)).tolist(),
        rng.uniform(250, 500, count).tolist(),
        (rng.uniform(0.5, 1.2, count) * rng.choice([-1, 1], count)).tolist(),
        rng.uniform(0, 300, count).tolist(),
        rng.uniform(60, 150, count).tolist(),
        strict=True,
    )
    names = ("x", "y", "radius", "speed", "depth", "thickness")
    vortex = [dict(zip(names, row, strict=True)) for row in rows]
    return to_toml(
        {
            "flow": {"kind": "vortices", "sampled": [30.0, 30.0, 15.0], "vortex": vortex},
            "glider": {"preset": "paper"},
            "domain": {"x": [-half, half], "y": [-half, half], "z": [-300.0, 0.0]},
            "sampling": {"kind": "grid", "shape": [side, side, 4]},
            "neighbours": {"kind": "reachable", "limit": LIMIT},
            "steering": {"method": "flow-map"},
            "integration": {"dt": 5.0, "steps": 125, "tolerance": 5.0},
            "cost": {"kind": "time"},
            "query": {"start": [-0.9 * half, 0.9 * half, 0.0], "goal": [0.9 * half, -0.9 * half, 0.0]},
        }
    )


def sizes(runs: int, quick: bool) -> Iterator[Figure]:
    """Yield time and memory of builds and queries of larger and larger roadmaps, in their own processes."""
    with tempfile.TemporaryDirectory() as folder:
        for nodes in (400,) if quick else SIZES:
            name, scenario, file = f"{nodes:,} nodes", Path(folder) / "growing.toml", Path(folder) / "growing.h5"
            scenario.write_text(growing(nodes))
            walls, megabytes = [], []
            for _ in range(runs):
                megabytes.append(process("build", scenario, "-o", file)[1])
                road = read_roadmap(file)
                walls.append(road.wall_s)
            per_edge = tuple(1e6 * wall / road.target.size for wall in walls)
            yield Figure(f"{name}: build, per edge", "microseconds", per_edge, False)
            yield Figure(f"{name}: build, wall time", "s", tuple(walls), False)
            yield Figure(f"{name}: most memory", "MB", tuple(megabytes), False)
            yield Figure(f"{name}: edges", "", (float(road.target.size),))
            first = tuple(process("query", file)[0] for _ in range(1 if quick else 5))
            yield Figure(f"{name}: first query, whole process", "s", first, False)
            began = time.perf_counter()
            problem = scenario_of(road).problem()
            sampled = time.perf_counter() - began
            yield Figure(f"{name}: of it, sampling the flow", "s", (sampled,), False)
            planner, rng, half = Planner(road, problem), np.random.default_rng(1), 0.9 * problem.hi[0]
            planner.query()
            ends = rng.uniform([-half, -half, -290], [half, half, -10], (5, 2, 3))
            times = tuple(seconds_of(partial(planner.query, start, goal)) for start, goal in ends)
            yield Figure(f"{name}: further query", "s", times, False)


def wide_box(nodes: int, limit: int) -> str:
    """Return the seed box as text, as wide as its nodes need to lie 56 m apart on four depths; its flow too."""
    table = tomllib.loads(shipped_scenarios()["seed-box"].read_text(encoding="utf-8"))
    side = math.ceil(math.sqrt(nodes / 4))
    wider = side / 16
    half, flow = 450.0 * wider, table["flow"]
    for vortex in flow["vortex"]:
        vortex |= {name: vortex[name] * wider for name in ("x", "y", "radius")}
    flow |= {name: [-600.0 * wider, 600.0 * wider] for name in ("x", "y")}
    flow["sampled"] = [12.0 * wider, 12.0 * wider, 10.0]
    return to_toml(
        table
        | {
            "domain": {"x": [-half, half], "y": [-half, half], "z": [-300.0, 0.0]},
            "sampling": {"kind": "grid", "shape": [side, side, 4]},
            "neighbours": {"kind": "reachable", "limit": limit},
            "steering": {"method": "flow-map"},
            "query": {"start": [-half, half, 0.0], "goal": [half, -half, 0.0]},
        }
    )


def large(runs: int, quick: bool) -> Iterator[Figure]:
    """Yield time and memory of a large roadmap's build, and of what is asked of it, in their own processes."""
    nodes = 1024 if quick else LARGE
    with tempfile.TemporaryDirectory() as folder:
        scenario, file = Path(folder) / "wide.toml", Path(folder) / "wide.h5"
        scenario.write_text(wide_box(nodes, LARGE_LIMIT), encoding="utf-8")
        asked: dict[str, list[Any]] = {"query": [], "verify": ["--sample", 200], "info": []}
        asked["plot"] = ["-o", Path(folder) / "wide.png"]
        for name, count in {"build": 1, **dict.fromkeys(asked, runs)}.items():
            options = ["-o", file] if name == "build" else asked[name]
            of = scenario if name == "build" else file
            seconds, megabytes = zip(*(process(name, of, *options) for _ in range(count)), strict=True)
            yield Figure(f"{nodes:,} nodes, wide: {name}, whole process", "s", seconds, False)
            yield Figure(f"{nodes:,} nodes, wide: {name}, most memory", "MB", megabytes, False)
        edges = float(opened_roadmap(file).indptr[-1])
        yield Figure(f"{nodes:,} nodes, wide: edges", "", (edges,))
        yield Figure(f"{nodes:,} nodes, wide: file", "MB", (file.stat().st_size / 1e6,), False)


def starts(runs: int, quick: bool) -> Iterator[Figure]:
    """Yield the time of whole processes: idle ones and working ones, with and without compiled kernels."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "small.h5"
        small = ["build", "seed-box", "-o", file, "--set", "sampling.shape=[4,4,3]"]
        builds = {"streamline 16": small, "flow map": [*small, "--set", "steering.method=flow-map"]}
        commands: dict[str, list[Any]] = {"--help": ["--help"], "build, streamline 16": small}
        commands |= {"info": ["info", file], "query": ["query", file], "build, flow map": builds["flow map"]}
        for name, command in commands.items():
            if not quick:
                process(*command)
            yield Figure(f"start: {name}", "s", tuple(process(*command)[0] for _ in range(runs)), False)
        for name, command in () if quick else builds.items():
            cold = Path(folder) / name
            seconds = process(*command, environment={"NUMBA_CACHE_DIR": str(cold)})[0]
            yield Figure(f"start without compiled kernels: build, {name}", "s", (seconds,), False)


MEASURED = """
import resource, subprocess, sys, time
began = time.perf_counter()
run = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
seconds = time.perf_counter() - began
print(seconds, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, run.returncode)
sys.stderr.buffer.write(run.stderr[-300:])
"""
"""A small process in between: the memory of a large process would count as its child's."""


def process(*arguments: Any, environment: dict[str, str] | None = None) -> tuple[float, float]:
    """Return wall time [s] and most memory [MB] of a command in its own process; a query may find no path."""
    program = [sys.executable, "-c", "from glider_stream.cli import main; main()", *map(str, arguments)]
    measured = subprocess.run(
        [sys.executable, "-c", MEASURED, *program],
        env=os.environ | (environment or {}),
        capture_output=True,
        text=True,
        check=True,
    )
    seconds, memory, code = measured.stdout.split()
    require(code in ("0", "1"), f"`{arguments[0]}` failed: {measured.stderr}; mend the cause")
    return float(seconds), float(memory) / (1e6 if sys.platform == "darwin" else 1e3)


def seconds_of(task: Callable[[], object]) -> float:
    """Return how long a task takes [s]."""
    began = time.perf_counter()
    task()
    return time.perf_counter() - began
