"""Answers with confidence: reads mission, members and routes, and writes the route, and a figure."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path as File

import numpy as np

from .base.settings import require
from .mission.confidence.answer import Confidence, confidence_of
from .mission.confidence.candidates import FORECAST
from .mission.confidence.ensemble import Ensemble, Progress, drawn, first_member, from_files
from .mission.confidence.judged import Criterion
from .mission.settings import Mission, read_mission
from .pilot.export import check_export, check_places, export_path
from .search.flown_on import check_plan
from .search.path import Path, check_frame, load_plan

Best = float | str
"""A share, 0.9 for the time by which 90 % arrive; "mean"; or "by" for most arrivals by a time."""
SAME = 1.0
"""Routes that are compared begin and end within this distance [m]."""


def answered(
    mission: "str | File | Mission",
    routes: Sequence[str | File],
    members: Sequence[str | File],
    draws: int | None,
    first: int,
    best: Best,
    by: float | None,
    replanned: bool,
    reach: bool,
    outputs: Sequence[str | File],
    figure: str | File | None,
    overrides: Sequence[str],
    progress: Callable[[Progress], None],
) -> tuple[Confidence, list[str]]:
    """Return the answer, and notes on the files that are written; see `planner.confidence`."""
    require(
        (draws is None) != (not members), "give the members' files, or the number of draws; not both, not none"
    )
    require(not (replanned and len(routes) > 1), f"only one route can be planned anew; got {len(routes)}")
    for output in outputs:
        check_export(output)
    if figure is not None:
        from .plot.canvas import check_figure

        check_figure(figure)
    given = [*first_member(members), *overrides] if members else overrides
    resolved = mission if isinstance(mission, Mission) else read_mission(mission, given)
    criterion = _criterion(best, by, resolved.arrival.longest)
    check_places(outputs, resolved.scenario.domain.frame() is not None)
    ensemble = drawn(resolved, draws, first) if draws is not None else from_files(resolved, members)
    ensemble = replace(ensemble, progress=progress)
    named = [(File(route).name, load_plan(route)) for route in routes]
    if named:
        ensemble = _between(ensemble, named)
    found = confidence_of(ensemble, criterion, named, replanned=replanned, reach=reach)
    notes = _written(found, outputs)
    if figure is not None:
        _draw(found, figure)
    return found, notes


def _criterion(best: Best, by: float | None, limit: float) -> Criterion:
    if isinstance(best, str):
        require(best in ("mean", "by"), f"the best is by a share such as 90%, `mean` or `by`; got {best!r}")
        require(best == "mean" or by is not None, "most arrivals by a time need that time: add it (--by HOURS)")
    require(best == "by" or by is None, f"a time to arrive by goes with `best` = by; got {best!r}: leave one out")
    return Criterion(limit, None if isinstance(best, str) else best, by)


def _between(ensemble: Ensemble, routes: Sequence[tuple[str, Path]]) -> Ensemble:
    """Return the ensemble for the ends of routes; InputError if they are of another scenario or of several."""
    name, path = routes[0]
    forecast = ensemble.forecast
    for other, route in routes:
        check_frame("" if route.origin is None else route.origin.scenario, forecast, other)
        for mine, theirs, end in ((path.start, route.start, "start"), (path.goal, route.goal, "goal")):
            off = float(np.linalg.norm(mine - theirs))
            require(
                off <= SAME, f"the routes {name} and {other} {end} {off:,.0f} m apart: they cannot be compared"
            )
        check_plan(route, forecast)
        leaves = forecast.departure if route.departure is None else route.departure
        cure = f"--set query.departure={leaves:g}, and a mission whose currents reach as far"
        apart = abs(leaves - forecast.departure) <= SAME
        require(apart, f"{other} leaves at {leaves:g} s, the mission at {forecast.departure:g} s; give {cure}")
    return ensemble.between(path.start, path.goal)


def _written(found: Confidence, outputs: Sequence[str | File]) -> list[str]:
    notes: list[str] = []
    path = found.path
    if path is not None and outputs and found.best.candidate.member >= 0:
        name = found.best.candidate.name.partition(",")[0]
        notes.append(f"the route is the {name}, and its file shows it as flown there")
    if path is None and outputs:
        name = found.best.candidate.name
        return [f"the best, {name}, makes its orders on the way, so no route file is written"]
    for output in outputs:
        assert path is not None
        export_path(path, output, notes.append)
    return notes


def _draw(found: Confidence, figure: str | File) -> None:
    from .plot.canvas import save_figure
    from .plot.confidence import plot_confidence

    best, mission = found.best, found.ensemble.mission
    beside = [
        next((e for e in found.flights if e.candidate.name.startswith(w)), None) for w in (FORECAST, "straight")
    ]
    shown = [best, *(each for each in beside if each is not None)]
    names = list({each.candidate.name: each.time for each in shown}.items())
    grey = [each.time for each in found.flights if each.candidate.name not in dict(names)]
    area = None if found.reach is None else (found.reach.place, found.reach.share, found.reach.by)
    title = f"{mission.title}: {best.candidate.name}, in {found.ensemble.count} members"
    radius = mission.arrival.radius_m
    save_figure(plot_confidence(found.ensemble.forecast, found.tracks, names, grey, radius, title, area), figure)
