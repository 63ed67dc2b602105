"""Benchmarks: the speed of this machine; each figure has its spread, so that two records can be compared."""

import json
import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.output import replacing
from ..base.settings import require
from ..base.threads import in_parallel, threads
from ..base.toml import to_toml
from ..base.untrusted import check_file
from ..kernels.cache import KERNEL_DIGEST, entry_point
from ..kernels.control import control_of
from ..kernels.flight import FLIGHT_ROWS, advance, fly_for, hangar, place
from ..kernels.motion import LANE_X, LANE_Y, LANES
from ..kernels.place import Place
from ..roadmap.builder import find_edges, node_positions, warm_up
from ..roadmap.store import read_roadmap
from ..scenario import read_scenario, scenario_of
from ..search.query import Planner
from ..water.sampled import sample_flow

STEPS, FLIGHTS, AT_ONCE = 60, 16_384, 256
"""The work of the raw integrator.

RK4 steps of a flight; flights, in batches of LANES; batches that a thread takes at a time.
"""
RATED = {
    "streamline 16, 27 nearest": (),
    "surface 16, 27 nearest": ("steering.method=surface",),
    "flow map, 27 nearest": ("steering.method=flow-map",),
    "streamline 16, all": ("neighbours.kind=all",),
    "surface 16, all": ("neighbours.kind=all", "steering.method=surface"),
    "flow map, all": ("neighbours.kind=all", "steering.method=flow-map"),
}
SIZES = (1_000, 10_000, 100_000)
LIMIT = 64
PARTS = ("integrator", "methods", "threads", "sizes", "starts")


@dataclass(frozen=True)
class Figure:
    """One measured quantity with all its values; `more` tells whether more of it is better."""

    name: str
    unit: str
    values: tuple[float, ...]
    more: bool = True

    @property
    def median(self) -> float:
        """The median of the values."""
        return statistics.median(self.values)

    def as_dict(self) -> dict[str, Any]:
        """Return the figure as it stands in a record."""
        spread = {"median": self.median, "low": min(self.values), "high": max(self.values)}
        return (
            {"name": self.name, "unit": self.unit, "more_is_better": self.more}
            | spread
            | {"runs": len(self.values)}
        )

    def __str__(self) -> str:
        spread = (
            f"{_number_text(min(self.values))} to {_number_text(max(self.values))}"
            if len(self.values) > 1
            else "one run"
        )
        return f"{self.name:<44}{_number_text(self.median):>12} {self.unit:<16}({spread})"


@dataclass(frozen=True)
class Record:
    """The figures of a run, with the date and the machine."""

    figures: tuple[Figure, ...]
    made: dict[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """Return the record for JSON; the raw integrator's rate also has a key of its own."""
        raw = {figure.name: figure.median for figure in self.figures if figure.name == "evaluations_per_s"}
        return self.made | raw | {"figures": [figure.as_dict() for figure in self.figures]}

    def __str__(self) -> str:
        made = self.made
        head = f"{made['date']}, {made['processor']}, {made['threads']} threads, Python {made['python']}"
        return "\n".join([head, *(f"  {figure}" for figure in self.figures)])

    def moved(self, before: dict[str, Any]) -> list[str]:
        """Return texts on figures outside the spread of an earlier record: the ratio, and which is better."""
        then = {figure["name"]: figure for figure in before["figures"]}
        moved = []
        for now in self.figures:
            old = then.get(now.name)
            if old is None or (min(now.values) <= old["high"] and max(now.values) >= old["low"]):
                continue
            better = "better" if (now.median > old["median"]) == now.more else "worse"
            ratio = now.median / old["median"]
            moved.append(f"{now.name}: {ratio:.2f} times {_number_text(old['median'])} {now.unit}, {better}")
        return moved


def bench(
    *,
    runs: int = 5,
    quick: bool = False,
    only: Sequence[str] = (),
    ceiling: str | Path | None = None,
    progress: Callable[[Figure], None] = lambda figure: None,
) -> Record:
    """Return a record of the parts in `only` (empty: all), each figure measured `runs` times.

    `quick` measures small problems, to check that everything runs. `ceiling`: a program that prints its own
    `evaluations_per_s` as JSON; it takes turns with the raw integrator.
    """
    require(runs >= 1, f"`runs` must be at least 1; got {runs}")
    for name in only:
        require(name in PARTS, f"the part {name!r} is not known; choose from: {', '.join(PARTS)}")
    parts = {
        "integrator": partial(integrator, runs, ceiling),
        "methods": partial(methods, runs, quick),
        "threads": partial(thread_scaling, runs, quick),
        "sizes": partial(sizes, 1 if quick else runs, quick),
        "starts": partial(starts, 1 if quick else runs, quick),
    }
    figures = []
    with threads(None) as count:
        for name, part in parts.items():
            if name in only or not only:
                for figure in part():
                    progress(figure)
                    figures.append(figure)
    return Record(
        tuple(figures),
        made_by(count, quick),
    )


def made_by(thread_count: int, quick: bool) -> dict[str, Any]:
    """Return the date and the machine of a record."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": platform.processor() or platform.machine(),
        "threads": thread_count,
        "python": platform.python_version(),
        "numba": version("numba"),
        "software_version": version("glider-stream"),
        "kernel_digest": KERNEL_DIGEST,
        "quick": quick,
    }


@entry_point(nogil=True)
def _fly(flow, start, end, first, last):  # type: ignore[no-untyped-def]
    lanes = hangar(FLIGHT_ROWS)
    for e in range(first, last):
        for n in range(LANES):
            x, y = start[e]
            place(lanes, n, Place(x, y, -100.0, 0.0), control_of(0.68, -0.49, 2.0 * math.pi * n / LANES))
            fly_for(lanes, n, 5.0 * STEPS, 5.0)
        for _ in range(STEPS):
            advance(flow, lanes)
        end[e] = lanes[LANE_X].sum() + lanes[LANE_Y].sum()


def integrator(runs: int, ceiling: str | Path | None) -> Iterator[Figure]:
    """Yield the currents interpolated per second inside RK4, from a grid as large as the ceiling's."""
    flow = read_scenario("seed-box").problem().evaluator.flow
    box = (-600.0, 600.0)
    grid = sample_flow(flow, (12.0, 12.0, 10.0), box, box, (-300.0, 0.0))
    start, end = np.random.default_rng(0).uniform(-450, 450, (FLIGHTS, 2)), np.empty(FLIGHTS)
    task = partial(_fly, grid, start, end)
    in_parallel(task, 2, 1)
    ours, theirs = [], []
    for _ in range(runs):
        ours.append(FLIGHTS * LANES * STEPS * 4 / _seconds(lambda: in_parallel(task, FLIGHTS, AT_ONCE)))
        if ceiling is not None:
            theirs.append(_ceiling(ceiling))
    yield Figure("evaluations_per_s", "1/s", tuple(ours))
    if theirs:
        yield Figure("ceiling: evaluations per second", "1/s", tuple(theirs))
        yield Figure("share of the ceiling", "", tuple(a / b for a, b in zip(ours, theirs, strict=True)))


def _ceiling(program: str | Path) -> float:
    try:
        text = subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout
        return float(json.loads(text)["evaluations_per_s"])
    except (OSError, ValueError, KeyError, TypeError, subprocess.CalledProcessError) as error:
        raise InputError(
            f"the ceiling {program} must be a program that prints JSON with `evaluations_per_s`; got {error}"
        ) from None


def methods(runs: int, quick: bool) -> Iterator[Figure]:
    """Yield pairs per second for each method and neighbour law, on the seed box, without compilation."""
    shape = "[5,5,3]" if quick else "[16,16,4]"
    for name, overrides in RATED.items():
        yield Figure(name, "pairs/s", tuple(_rate(overrides, shape) for _ in range(runs)))


def thread_scaling(runs: int, quick: bool) -> Iterator[Figure]:
    """Yield the speed on all threads over the speed on one thread, measured in turns."""
    shape = "[5,5,3]" if quick else "[12,12,4]"
    for name in ("streamline 16, all", "flow map, all"):
        ratios = []
        for _ in range(runs):
            single = _rate(RATED[name], shape, 1)
            ratios.append(_rate(RATED[name], shape) / single)
        yield Figure(f"all threads over one: {name}", "times", tuple(ratios))


def _rate(overrides: Sequence[str], shape: str, count: int | None = None) -> float:
    """Return pairs per second of a build of the seed box on `count` threads (None: all)."""
    problem = read_scenario("seed-box", [*overrides, f"sampling.shape={shape}"]).problem()
    position = node_positions(problem)
    with threads(count):
        warm_up(problem)
        done = [(edges.pairs, edges.seconds) for edges in find_edges(problem, position)]
    return sum(pairs for pairs, _ in done) / sum(seconds for _, seconds in done)


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
                megabytes.append(_process("build", scenario, "-o", file)[1])
                road = read_roadmap(file)
                walls.append(road.wall_s)
            per_edge = tuple(1e6 * wall / road.target.size for wall in walls)
            yield Figure(f"{name}: build, per edge", "microseconds", per_edge, False)
            yield Figure(f"{name}: build, wall time", "s", tuple(walls), False)
            yield Figure(f"{name}: most memory", "MB", tuple(megabytes), False)
            yield Figure(f"{name}: edges", "", (float(road.target.size),))
            first = tuple(_process("query", file)[0] for _ in range(1 if quick else 5))
            yield Figure(f"{name}: first query, whole process", "s", first, False)
            began = time.perf_counter()
            problem = scenario_of(road).problem()
            sampled = time.perf_counter() - began
            yield Figure(f"{name}: of it, sampling the flow", "s", (sampled,), False)
            planner, rng, half = Planner(road, problem), np.random.default_rng(1), 0.9 * problem.hi[0]
            planner.query()
            ends = rng.uniform([-half, -half, -290], [half, half, -10], (5, 2, 3))
            times = tuple(_seconds(partial(planner.query, start, goal)) for start, goal in ends)
            yield Figure(f"{name}: further query", "s", times, False)


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
                _process(*command)
            yield Figure(f"start: {name}", "s", tuple(_process(*command)[0] for _ in range(runs)), False)
        for name, command in () if quick else builds.items():
            cold = Path(folder) / name
            seconds = _process(*command, environment={"NUMBA_CACHE_DIR": str(cold)})[0]
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


def _process(*arguments: Any, environment: dict[str, str] | None = None) -> tuple[float, float]:
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


def _seconds(task: Callable[[], object]) -> float:
    began = time.perf_counter()
    task()
    return time.perf_counter() - began


def _number_text(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def read_record(file: str | Path) -> dict[str, Any]:
    """Return a record that `bench --json` wrote; InputError if it is not one."""
    try:
        check_file(file, "the record")
        record = json.loads(Path(file).read_text(encoding="utf-8"))
        for figure in record["figures"]:
            sound = isinstance(figure["name"], str) and figure["low"] <= figure["median"] <= figure["high"]
            require(sound and figure["median"] != 0, "its figures are not usable")
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        text = (error.strerror or "it is not a file").lower() if isinstance(error, OSError) else str(error)
        raise InputError(f"the record {file} cannot be read: {text}; write it with `bench --json`") from None
    return dict(record)


def write_record(record: dict[str, Any], file: str | Path) -> None:
    """Write a record to a file as JSON."""
    with replacing(Path(file)) as temporary:
        temporary.write_text(json.dumps(record, indent=1) + "\n")
