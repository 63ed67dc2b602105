"""A drawn route, flown."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as File

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..pilot.route_files import read_drawn
from ..pilot.score import Score
from ..pilot.score import score as score_of
from ..search.departures import Moment
from ..search.path import Path, check_frame
from ..search.surfacing import Surfacing
from ..water.domain import GeographicDomain, Point
from .searches import Searches


def scored(
    searches: Searches, route: str | File | Sequence[str | File], start: Point | None, *, depart: Moment | None
) -> Score:
    """Fly a drawn route; see `OpenedScenario.score`."""
    files = [route] if isinstance(route, str | File) else list(route)
    drawn = [read_drawn(file) for file in files]
    # a drawn route may begin or end anywhere, so it does not keep the rule of surfacing
    planner, domain = searches.leaving(depart, Surfacing()), searches.scenario.domain
    on_globe = isinstance(domain, GeographicDomain)
    cure = "and the roadmap is in metres; give x, y, z in a CSV file"
    points = [] if start is None else [searches.point(start)]
    for file, drawing in zip(files, drawn, strict=True):
        require(on_globe or not drawing.geographic, f"the route {file} is in longitude and latitude, {cure}")
        check_frame(drawing.scenario, searches.problem, f"the route {file}")
        points += [domain.point(place) if drawing.geographic else np.array(place) for place in drawing.places]
    require(len(points) > 1, f"the route {files[0]} holds one point; give the vehicle's position with --start")
    for n, point in enumerate(points, 1 if start is None else 0):
        searches.problem.check_point(point, f"point {n}" if n else "start")
    notes = [note for drawing in drawn for note in drawing.notes]
    if start is None and drawn[0].of_vehicle:
        notes.append("the way to its first point is not scored; give the vehicle's position with --start")

    def later(start: Array, end: Array, since: float) -> Path:
        return planner.leaving(since).query(start, end)

    return replace(score_of(points, planner.connect, later, planner.fly), notes=tuple(notes))
