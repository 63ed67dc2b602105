"""What every peer's script shares: it reads its job, repeats the timed part, writes the answer."""

import json
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

JOB: dict[str, Any] = json.loads(Path(sys.argv[1]).read_text())
"""The files, times and settings of the problem."""


def starts() -> Any:
    """Longitude, latitude [degrees] and depth [m, down] of the particles, one array each."""
    return np.loadtxt(JOB["starts"], delimiter=",", skiprows=1).T


def timed(once: Callable[[], Any]) -> Any:
    """What `once` returns, and the processor and the wall seconds of runs after a first one, which compiles."""
    found, processor, wall = once(), [], []
    for _ in range(JOB["runs"]):
        began, clock = time.process_time(), time.perf_counter()
        found = once()
        processor.append(time.process_time() - began)
        wall.append(time.perf_counter() - clock)
    return found, {"processor_s": processor, "wall_s": wall}


def answer(package: str, seconds: dict[str, Any], **found: Any) -> None:
    """Write what was found beside the job, with the version of the package."""
    told = {"version": f"{package} {version(package)}", **seconds, **found}
    file = Path(sys.argv[1]).with_suffix(".answer")
    part = file.with_suffix(".part")
    part.write_text(json.dumps(told, default=lambda values: np.asarray(values).tolist()))
    part.replace(file)


def routes(package: str, travel_time: Callable[[str, int], float]) -> None:
    """Time a planner of the job's scenario, with another seed in each run, and write its travel times [s]."""
    seeds, found = iter(range(JOB["runs"] + 1)), list[float]()
    _, seconds = timed(lambda: found.append(travel_time(JOB["scenario"], next(seeds))))
    answer(package, seconds, routes_s=finite(found[1:]))


def finite(times: list[float]) -> list[float | None]:
    """The travel times [s], None where there is no route."""
    return [time if np.isfinite(time) else None for time in times]
