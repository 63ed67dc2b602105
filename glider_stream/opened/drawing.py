"""Figures of roadmaps, and of routes over them or over a scenario's water."""

from collections.abc import Mapping, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np

from ..base.settings import require
from ..plot.draw import check_drawing, draw_roadmap, draw_route, draw_routes
from ..roadmap.slices import SlicedRoadmap
from ..search.path import Path, load_plan
from ..search.surfacing import Surfacing
from .searches import Searches

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(
    searches: Searches,
    path: str | File | Path | None,
    output: str | File | None,
    depths: Sequence[float] | None,
    chart: bool,
    fronts: float | None,
    title: str,
) -> "Figure | None":
    """Draw a path, or the roadmap; see `OpenedScenario.plot`."""
    check_drawing(output, path, depths, chart, fronts)
    route = path if path is None or isinstance(path, Path) else load_plan(path)
    free = searches.planner(Surfacing())  # this also compares the water with the roadmap's
    if route is None:
        cure = "draw a route over it, or build its roadmap"
        require(searches.source is not None, f"a scenario has no roadmap to draw; {cure}")
        assert searches.source is not None
        road, problem = searches.source if searches.source.departures is None else searches.road, searches.problem
        assert road is not None
        if isinstance(road, SlicedRoadmap):
            # draw the slice nearest to the departure, over the current of its time
            number = int(np.abs(road.departures - problem.departure).argmin())
            problem = problem.leaving(float(road.departures[number]) - problem.departure)
            which = f"slice {number + 1} of {road.departures.size}"
            road, title = road.at(number), f"{title}, {which}" if title else which.capitalize()
        return draw_roadmap(road, problem, output, depths, title)
    problem = searches.problem_of(route)
    arrivals = searches.leaving(problem.departure, Surfacing()).arrivals if fronts is not None else free.arrivals
    return draw_route(searches.position, problem, route, output, depths, chart, fronts, arrivals, title)


def draw_beside(
    searches: Searches,
    paths: Sequence[str | File] | Mapping[str, Path],
    output: str | File | None,
    depth: float | None,
) -> "Figure":
    """Draw two to four paths side by side; see `OpenedScenario.plot_routes`."""
    check_drawing(output, None, None, False, None)
    routes = dict(paths) if isinstance(paths, Mapping) else {File(path).stem: load_plan(path) for path in paths}
    named = f"each path needs a different name; got {', '.join(map(str, paths))}; rename a file"
    require(len(routes) == len(paths), named)
    searches.planner(Surfacing())  # this also compares the water with the roadmap's
    leave = {route.departure for route in routes.values()}
    problem = searches.problem_of(next(iter(routes.values()))) if len(leave) == 1 else searches.problem
    return draw_routes(searches.position, problem, routes, output, depth)
