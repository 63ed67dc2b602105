"""Benchmarks: the speed of this machine, part by part."""

import json
import math
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.settings import require
from ..base.threads import in_parallel, threads
from ..kernels.cache import entry_point
from ..kernels.control import control_of
from ..kernels.flight import FLIGHT_ROWS, advance, fly_for, hangar, place
from ..kernels.flow import on_even_steps
from ..kernels.motion import LANE_X, LANE_Y, LANES
from ..kernels.place import Place
from ..roadmap.builder import find_edges, node_positions, warm_up
from ..scenario import read_scenario
from ..water.ocean.flow import grid_flow
from ..water.sampled import sample_flow
from .commands import large, seconds_of, sizes, starts
from .record import Figure, Record, made_by

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
FILE_GRID, FILE_FLIGHTS = (101, 101, 31), 1000
FILE_SHARE = 12
"""Every so many-th node of `ionian` is a source on the file of currents."""
PARTS = ("integrator", "methods", "threads", "sizes", "starts", "file", "large")


def bench(
    *,
    runs: int = 5,
    quick: bool = False,
    only: Sequence[str] = (),
    ceiling: str | Path | None = None,
    currents: str | Path | None = None,
    progress: Callable[[Figure], None] = lambda figure: None,
) -> Record:
    """Return a record of the parts in `only` (empty: all), each figure measured `runs` times.

    Without `only`, `large` is left out, and `file` is measured if `currents`, a file for the scenario `ionian`,
    is given. `quick` measures small problems, to check that everything runs. `ceiling`: a program that prints
    rates as JSON (`evaluations_per_s` for `integrator`; `one time` and `four times` if `only` has `file`); it
    takes turns with ours.
    """
    require(runs >= 1, f"`runs` must be at least 1; got {runs}")
    for name in only:
        require(name in PARTS, f"the part {name!r} is not known; choose from: {', '.join(PARTS)}")
    known = "file" not in only or currents is not None
    require(known, "the part 'file' needs a file of currents; give it with --currents")
    if currents is not None:
        read_scenario("ionian", [f"flow.file={currents}"]).problem()  # a file that is of no use is refused now
    once = 1 if quick else runs
    parts: dict[str, Callable[[], Iterator[Figure]]] = {
        "integrator": partial(integrator, runs, ceiling),
        "methods": partial(methods, runs, quick),
        "threads": partial(thread_scaling, runs, quick),
        "sizes": partial(sizes, once, quick),
        "starts": partial(starts, once, quick),
    }
    if currents is not None:
        parts["file"] = partial(file_legs, once, quick, currents, ceiling if "file" in only else None)
    if "large" in only:
        parts["large"] = partial(large, once, quick)
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
        ours.append(FLIGHTS * LANES * STEPS * 4 / seconds_of(lambda: in_parallel(task, FLIGHTS, AT_ONCE)))
        if ceiling is not None:
            theirs.append(_ceiling(ceiling, "evaluations_per_s")["evaluations_per_s"])
    yield Figure("evaluations_per_s", "1/s", tuple(ours))
    if theirs:
        yield Figure("ceiling: evaluations per second", "1/s", tuple(theirs))
        yield Figure("share of the ceiling", "", tuple(a / b for a, b in zip(ours, theirs, strict=True)))


def _ceiling(program: str | Path, *names: str) -> dict[str, float]:
    """Return the rates of those names that a program prints."""
    try:
        text = subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout
        found = json.loads(text)
        return {name: float(found[name]) for name in names}
    except (OSError, ValueError, KeyError, TypeError, subprocess.CalledProcessError) as error:
        raise InputError(
            f"the ceiling {program} must be a program that prints JSON with `{'`, `'.join(names)}`; got {error}"
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
    return _build_rate("seed-box", [*overrides, f"sampling.shape={shape}"], 1, count)


def _build_rate(scenario: str, overrides: Sequence[str], share: int, count: int | None = None) -> float:
    """Return pairs per second of every `share`-th node of a scenario as a source, on `count` threads."""
    problem = read_scenario(scenario, overrides).problem()
    position = node_positions(problem)
    with threads(count):
        warm_up(problem)
        source = np.arange(0, len(position), share)
        done = [(edges.pairs, edges.seconds) for edges in find_edges(problem, position, source)]
    return sum(pairs for pairs, _ in done) / sum(seconds for _, seconds in done)


def file_legs(runs: int, quick: bool, currents: str | Path, ceiling: str | Path | None) -> Iterator[Figure]:
    """Yield the speed of legs of `ionian` on a file, and of RK4 on one core on grids as files have them."""
    overrides, share = [f"flow.file={currents}"], FILE_SHARE * (20 if quick else 1)
    rates = tuple(_build_rate("ionian", overrides, share) for _ in range(runs))
    yield Figure("a file's legs, flow map", "pairs/s", rates)
    grids, end = _file_grids(), np.empty(FILE_FLIGHTS)
    start = np.random.default_rng(0).uniform(-450, 450, (FILE_FLIGHTS, 2))
    for grid in grids.values():
        _fly(grid, start, end, 0, 1)
    ours: dict[str, list[float]] = {name: [] for name in grids}
    theirs: dict[str, list[float]] = {name: [] for name in grids}
    for _ in range(runs):
        for name, grid in grids.items():
            began = time.process_time()
            _fly(grid, start, end, 0, FILE_FLIGHTS)
            ours[name].append(FILE_FLIGHTS * LANES * STEPS * 4 / (time.process_time() - began))
        for name, rate in ({} if ceiling is None else _ceiling(ceiling, *grids)).items():
            theirs[name].append(rate)
    for name, found in ours.items():
        yield Figure(f"a file's grid, {name}: evaluations, one core", "1/s", tuple(found))
        if theirs[name]:
            ratios = tuple(a / b for a, b in zip(found, theirs[name], strict=True))
            yield Figure(f"a file's grid, {name}: share of the ceiling", "", ratios)


def _file_grids() -> dict[str, Any]:
    """Return flows on a grid as files have them, of one time and of four, for even steps."""
    nx, ny, nz = FILE_GRID
    x, y, z = np.linspace(-600, 600, nx), np.linspace(-600, 600, ny), np.linspace(-300, 0, nz)
    u, v = np.random.default_rng(0).uniform(-1, 1, (2, 4, nz, ny, nx))
    return {
        "one time": on_even_steps(grid_flow(x, y, z, u[0], v[0])[0]),
        "four times": on_even_steps(grid_flow(x, y, z, u, v, np.linspace(0, 5.0 * STEPS, 4))[0]),
    }
