"""An opened roadmap: roadmap, problem and searches, each made once, when it is first needed."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path as File
from threading import RLock
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from .base.arrays import Array
from .base.settings import require
from .pilot.card import Card
from .pilot.card import card as card_of
from .pilot.export import check_export, check_legs, export_path
from .pilot.route_files import read_drawn
from .pilot.score import Score
from .pilot.score import score as score_of
from .pilot.slocum_files import MOST_WAYPOINTS
from .pilot.windows import HOURS
from .roadmap.problem import Problem
from .roadmap.roadmap import Roadmap
from .roadmap.store import read_roadmap
from .scenario import Scenario, scenario_from_text
from .search.answer import Ends, best_path, front, planner_of
from .search.path import Path, load_path
from .search.query import Planner
from .search.surfacing import Surfacing
from .search.trade_off import TradeOff
from .search.why_not import no_edges
from .water.domain import GeographicDomain, Point

if TYPE_CHECKING:
    from matplotlib.figure import Figure

T = TypeVar("T")


class OpenedRoadmap:
    """A roadmap and what its questions need; any number of threads may ask one at once.

    `roadmap` is its data. `scenario`, `problem` and `planner()` are made when they are first needed, and
    kept. Points are given in the coordinates of the scenario's domain: x, y, z [m], z upward, or lon, lat
    [degrees], depth [m] where it is geographic; None for the scenario's own start or goal.
    """

    def __init__(self, roadmap: Roadmap, title: str = "") -> None:
        """A roadmap at hand; figures have the `title`."""
        self.roadmap = roadmap
        self.title = title
        self._kept: dict[object, object] = {}
        self._lock = RLock()

    def _once(self, name: object, kind: type[T], make: Callable[[], T]) -> T:
        """What is kept under a name, made by the first who asks for it; others wait."""
        with self._lock:
            if name not in self._kept:
                self._kept[name] = make()
            kept = self._kept[name]
        assert isinstance(kept, kind)
        return kept

    @property
    def scenario(self) -> Scenario:
        """The scenario that the roadmap was built from."""
        return self._once("scenario", Scenario, lambda: scenario_from_text(self.roadmap.provenance.scenario))

    @property
    def problem(self) -> Problem:
        """The scenario made into objects: its water is read once."""
        return self._once("problem", Problem, lambda: self.scenario.problem())

    def planner(self, surfacing: Surfacing | None = None) -> Planner:
        """The planner whose paths keep a rule of surfacing, the scenario's own if None.

        InputError where flow, terrain or glider are no longer those that the roadmap was built with.
        """
        rule = self._surfacing if surfacing is None else surfacing
        return self._once(rule, Planner, lambda: planner_of(self.roadmap, self.problem, rule))

    @property
    def _surfacing(self) -> Surfacing:
        """The scenario's own rule."""
        query = self.scenario.query
        return Surfacing() if query is None else Surfacing(query.most_yos, query.most_hours)

    def query(
        self,
        start: Point | None = None,
        goal: Point | None = None,
        *,
        outputs: Sequence[str | File] = (),
        most_energy: float | None = None,
        polish: bool = False,
        thin: float | None = None,
        surfacing: Surfacing | None = None,
        window_hours: float = HOURS,
        most_waypoints: int = MOST_WAYPOINTS,
        arrival_radius: float | None = None,
    ) -> Path:
        """The cheapest path between two points, written to each of `outputs`.

        `most_energy` [J] asks for the fastest of the paths of `trade_off` that uses no more. `polish` moves the
        stops of the path between the nodes, until nothing near costs less. `thin` [m] joins
        legs whose stops lie so near the straight line, where one glide does, and none where that breaks
        another rule. `surfacing` is a rule for how often to come up; the scenario's own if None. Exported
        windows last `window_hours`, a goto list holds `most_waypoints`, and a waypoint is reached within
        `arrival_radius` [m], each vehicle's usual one if None; `notes` of the path say what else became of files.
        """
        for output in outputs:
            check_export(output)
        planner, ends = self.planner(surfacing), self._ends(start, goal)
        path = best_path(planner, ends, most_energy=most_energy, polish=polish, thinned=thin)
        check_legs(path, outputs)
        notes: list[str] = []
        written = {
            "window_hours": window_hours,
            "most_waypoints": most_waypoints,
            "arrival_radius": arrival_radius,
        }
        for output in outputs:
            export_path(path, output, notes.append, **written)
        return replace(path, notes=tuple(notes))

    def table(self, starts: Sequence[Point], goals: Sequence[Point]) -> Array:
        """Costs of the cheapest paths from n points to m others: (n, m), inf where there is none."""
        free = self.planner(Surfacing())
        return free.table([self._point(start) for start in starts], [self._point(goal) for goal in goals])

    def arrivals(self, start: Point | None = None) -> Array:
        """When each node (n,) can be reached from a point at the soonest [s]; inf where it cannot."""
        return self.planner(Surfacing()).arrivals(None if start is None else self._point(start))

    def trade_off(
        self, start: Point | None = None, goal: Point | None = None, *, surfacing: Surfacing | None = None
    ) -> TradeOff:
        """The paths of one query that are best for some price of time against energy; all else as in `query`."""
        return front(self.planner(surfacing), self._ends(start, goal))

    def card(self, path: Path) -> Card:
        """What a route of this roadmap makes over ground, leg by leg, and what the water does to it."""
        return card_of(path, self.problem)

    def why_no_edges(self) -> str:
        """Why it holds no edge, in a sentence; empty where it holds some."""
        return "" if self.roadmap.target.size else no_edges(self.roadmap, self.problem)

    def score(self, route: str | File | Sequence[str | File], start: Point | None = None) -> Score:
        """Fly a drawn route (CSV, GeoJSON, KML, GPX, a path file, goto lists, targets) in the roadmap's water.

        Several files are one route, one after another. `start` is where the vehicle is, before its first point.
        """
        files = [route] if isinstance(route, str | File) else list(route)
        drawn = [read_drawn(file) for file in files]
        # a rule of surfacing is the planner's, and what was drawn may begin or end anywhere
        planner, domain = self.planner(Surfacing()), self.scenario.domain
        on_globe = isinstance(domain, GeographicDomain)
        cure = "and the roadmap is in metres; give x, y, z in a CSV file"
        points = [] if start is None else [self._point(start)]
        for file, one in zip(files, drawn, strict=True):
            require(on_globe or not one.geographic, f"the route {file} is in longitude and latitude, {cure}")
            points += [domain.point(place) if one.geographic else np.array(place) for place in one.places]
        require(len(points) > 1, f"the route {files[0]} holds one point; say with --start where the vehicle is")
        for n, point in enumerate(points, 1 if start is None else 0):
            self.problem.check_point(point, f"point {n}" if n else "start")
        notes = [note for one in drawn for note in one.notes]
        if start is None and drawn[0].of_vehicle:
            notes.append("the way to its first point is not scored; say with --start where the vehicle is")
        return replace(score_of(points, planner.connect, planner.query, planner.fly), notes=tuple(notes))

    def plot(
        self,
        path: str | File | Path | None = None,
        output: str | File | None = None,
        depths: Sequence[float] | None = None,
        *,
        chart: bool = False,
        fronts: float | None = None,
    ) -> "Figure | None":
        """Draw a path over the roadmap and the current at some `depths` [m], or the roadmap where there is none.

        A path file or object; up to four depths for a path, one for a roadmap or a `chart`, which shows a path
        by time, with heading and speeds; `fronts` draws there what is reached every so many hours. Written
        where `output` says; one that ends in .html is a page to look around in, and no figure is returned.
        """
        from .plot.draw import check_drawing, draw_roadmap, draw_route

        check_drawing(output, path, depths, chart, fronts)
        route = path if path is None or isinstance(path, Path) else load_path(path)
        free = self.planner(Surfacing())  # which has compared the water with the roadmap's
        if route is None:
            return draw_roadmap(self.roadmap, self.problem, output, depths, self.title)
        how = output, depths, chart, fronts, free.arrivals
        return draw_route(self.roadmap, self.problem, route, *how, self.title)

    def _point(self, values: Point) -> Array:
        return self.scenario.domain.point(values)

    def _ends(self, *points: Point | None) -> Ends:
        start, goal = (None if point is None else self._point(point) for point in points)
        return start, goal

    def __str__(self) -> str:
        return str(self.roadmap)


def open(roadmap: str | File | Roadmap | OpenedRoadmap) -> OpenedRoadmap:
    """Open a roadmap, from its file or as it was built, for any number of questions.

    InputError where the file is not a roadmap, newer, incomplete or damaged.
    """
    if isinstance(roadmap, OpenedRoadmap):
        return roadmap
    if isinstance(roadmap, Roadmap):
        return OpenedRoadmap(roadmap)
    return OpenedRoadmap(read_roadmap(roadmap), File(roadmap).stem)
