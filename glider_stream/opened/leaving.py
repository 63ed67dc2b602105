"""When to leave: one route for each departure."""

from pathlib import Path as File

from ..base.settings import require
from ..search.departures import Departures, Moment, seconds, when_to_leave
from ..search.surfacing import Surfacing
from ..water.domain import Point
from .searches import Searches


def departures(
    searches: Searches,
    between: tuple[Moment, Moment] | None,
    *,
    every: float | None,
    arrive_by: Moment | None,
    start: Point | None,
    goal: Point | None,
    figure: str | File | None,
    surfacing: Surfacing | None,
    title: str,
) -> Departures:
    """Return arrival and travel time against departure; see `OpenedScenario.when_to_leave`."""
    if figure is not None:
        from ..plot import check_figure

        check_figure(figure)
    asked = between is not None or arrive_by is not None
    require(asked, "give two times to depart between, or a time to arrive by")
    planner, ends = searches.planner(surfacing), searches.ends(start, goal)
    require(not planner.assembly.frozen, "frozen paths hold for one departure; leave `query.frozen` out")
    problem = searches.problem
    by = None if arrive_by is None else seconds(arrive_by, problem, "arrive-by")
    first, last = (problem.departure, by) if between is None else between
    times = [seconds(moment, problem, "depart-between") for moment in (first, last) if moment is not None]
    found = when_to_leave(
        lambda when: planner.leaving(when - problem.departure).query(*ends), times[0], times[-1], every, by
    )
    if figure is not None:
        from ..plot import plot_departures, save_figure

        save_figure(plot_departures(found, title), figure)
    return found
