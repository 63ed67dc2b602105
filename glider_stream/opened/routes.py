"""One route of a scenario or a roadmap, made better and written."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path as File
from typing import Any

import numpy as np

from ..base.output import check_output
from ..base.settings import require
from ..pilot.export import check_export, check_legs, check_places, export_path
from ..search.answer import Ends, best_path
from ..search.assembly import RoutePlanner
from ..search.path import Path
from ..search.refine import Asked, refined
from .searches import Searches


def split_outputs(outputs: Sequence[str | File], refines: bool) -> tuple[list[str | File], list[str | File]]:
    """The route files of a query's outputs, and the roadmap files; checked before anything is done."""
    roadmaps = [output for output in outputs if File(output).suffix == ".h5"]
    cure = "add --within or --seconds, or leave it out"
    require(
        refines or not roadmaps, f"a query writes a roadmap only where it refines; got {roadmaps[:1]}; {cure}"
    )
    routes = [output for output in outputs if output not in roadmaps]
    for output in routes:
        check_export(output)
    for output in roadmaps:
        check_output(output)
    return routes, roadmaps


def routed(
    searches: Searches,
    planner: RoutePlanner,
    ends: Ends,
    *,
    outputs: Sequence[str | File] = (),
    most_energy: float | None = None,
    polish: bool = False,
    within: float | None = None,
    seconds: float | None = None,
    thin: float | None = None,
    progress: Callable[[str], None] = lambda line: None,
    **written: Any,
) -> Path:
    """Return the cheapest path between two `ends` of a planner, and write it; see `query`."""
    asked = None if within is None and seconds is None else Asked(within, seconds)
    outputs, roadmaps = split_outputs(outputs, asked is not None)
    check_places(outputs, searches.problem.to_lonlat is not None)

    def refine(path: Path, polish: Callable[[Path], Path] | None) -> Path:
        assert asked is not None
        found = refined(planner, ends, path, asked, polish, progress)
        for file in roadmaps:
            found.write(file)
        return found.path

    path = best_path(
        planner,
        ends,
        most_energy=most_energy,
        polish=polish,
        refine=None if asked is None else refine,
        thinned=thin,
    )
    if path.found and path.legs:
        least = searches.least(path, planner.problem.departure)
        path = replace(path, least=least, closer=closer_bound(searches, planner, path))
    path = replace(path, origin=searches.origin(planner))
    return exported(path, outputs, **written)


def closer_bound(searches: Searches, planner: RoutePlanner, path: Path) -> str:
    """Return the command that bounds a path's time.

    It is empty where the path's cost, ends or departure are not those of the scenario.
    """
    problem, file = searches.problem, searches.file
    if problem.start is None or problem.goal is None or path.unit != "s":
        return ""
    own = np.array_equal(path.start, problem.start) and np.array_equal(path.goal, problem.goal)
    if not own or planner.problem.departure != problem.departure:
        return ""
    return f"glider-stream bound {'SCENARIO' if file is None else shlex.quote(str(file))}"


def exported(path: Path, outputs: Sequence[str | File], **written: Any) -> Path:
    """Write a path to route files, and return it with notes on them; `written` are options of `export_path`."""
    check_legs(path, outputs)
    notes: list[str] = []
    for output in outputs:
        export_path(path, output, notes.append, **written)
    return replace(path, notes=(*path.notes, *notes))
