"""Chooses the drawing: a roadmap, a route, its chart, or a page of it."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import Array
from ..base.output import check_output
from ..base.settings import require
from ..roadmap.problem import Problem
from ..roadmap.roadmap import Roadmap
from ..roadmap.store import StoredRoadmap
from ..search.path import Path, check_frame, placed
from ..water.inspect import is_steady
from .canvas import EARLIEST, check_figure, save_figure
from .chart import plot_chart
from .fronts import Fronts, fronts_of
from .page import PAGE, save_page
from .roadmap import plot_roadmap
from .route import plot_route
from .routes import plot_routes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def is_page(output: str | File | None) -> bool:
    """Return whether an output is an interactive page (.html)."""
    return output is not None and File(output).suffix.lower() == PAGE


def check_drawing(
    output: str | File | None, path: object, depths: Sequence[float] | None, chart: bool, fronts: float | None
) -> None:
    """Raise InputError, before any work, if options do not go together or the output cannot be written."""
    as_page = is_page(output)
    if output is not None:
        check_output(output) if as_page else check_figure(output)
    needs = "a page" if as_page else "`fronts`" if fronts is not None else "a chart"
    plain = not chart and not as_page and fronts is None
    require(path is not None or plain, f"{needs} needs a path; got none: give the file that `query -o` wrote")
    single = path is not None or depths is None or len(depths) == 1
    require(single, f"a roadmap is drawn at one depth; got {depths}")


def check_water(problem: Problem, route: Path, name: str) -> None:
    """Raise InputError if a leg of a route begins or ends outside the problem's water."""
    check_frame("" if route.origin is None else route.origin.scenario, problem, name)
    stops = np.array([point for leg in route.legs for point in (leg.start, leg.end)]).reshape(-1, 3)
    here = bool(problem.evaluator.allowed(stops, problem.departure).all())
    require(here, f"{name} leaves the roadmap's water; draw it over the roadmap that it was found in")


def draw_roadmap(
    road: Roadmap | StoredRoadmap,
    problem: Problem,
    output: str | File | None,
    depths: Sequence[float] | None,
    title: str,
) -> "Figure":
    """Draw the roadmap at one depth [m]."""
    flow, terrain = problem.evaluator.flow, problem.evaluator.terrain
    figure = plot_roadmap(flow, terrain, problem, road, None if depths is None else depths[0], title)
    if output is not None:
        save_figure(figure, output)
    return figure


def draw_route(
    position: Array,
    problem: Problem,
    route: Path,
    output: str | File | None,
    depths: Sequence[float] | None,
    chart: bool,
    fronts: float | None,
    arrivals: Callable[[Array], Array],
    title: str,
) -> "Figure | None":
    """Draw a route over maps of the current, by time on a chart, or as a page.

    Return the figure, or None for a page. `position` (n, 3) [m]: the nodes. `arrivals` from a start (3,) [m]: the
    earliest time [s] at each node, for `fronts` [h].
    """
    flow, terrain = problem.evaluator.flow, problem.evaluator.terrain
    check_water(problem, route, "the path")
    route = placed(route, problem)
    if not chart and fronts is None and not is_page(output):
        figure = plot_route(flow, terrain, problem, position, route, depths, title)
    else:
        every: tuple[Fronts, float] | None = None
        if fronts is not None:
            reached, changes = fronts_of(position, arrivals(route.start), terrain), not is_steady(flow)
            frozen = changes and problem.frozen
            every = reached._replace(ways=EARLIEST if changes and not frozen else "", frozen=frozen), fronts
        if output is not None and is_page(output):
            save_page(output, flow, terrain, problem, position, route, depths, every, title)
            return None
        figure = plot_chart(flow, terrain, problem, route, depths, every, title)
    if output is not None:
        save_figure(figure, output)
    return figure


def draw_routes(
    position: Array,
    problem: Problem,
    routes: Mapping[str, Path],
    output: str | File | None,
    depth: float | None,
) -> "Figure":
    """Draw several named routes side by side."""
    for name, route in routes.items():
        check_water(problem, route, f"the path {name}")
    flow, terrain = problem.evaluator.flow, problem.evaluator.terrain
    figure = plot_routes(flow, terrain, problem, position, routes, depth)
    if output is not None:
        save_figure(figure, output)
    return figure
