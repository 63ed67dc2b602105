"""An opened roadmap: roadmap, problem and searches, each made once, when it is first needed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as File
from threading import RLock
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from .base.arrays import Array
from .base.output import check_output
from .base.settings import require
from .pilot.card import Card
from .pilot.card import card as card_of
from .pilot.export import check_export, check_legs, export_path
from .pilot.route_files import read_drawn
from .pilot.score import Score
from .pilot.score import score as score_of
from .pilot.slocum_files import MOST_WAYPOINTS
from .pilot.windows import HOURS
from .roadmap.builder import node_positions
from .roadmap.problem import Problem
from .roadmap.roadmap import Roadmap
from .roadmap.store import read_roadmap
from .scenario import Scenario, read_scenario, scenario_of, shipped_scenarios
from .search.answer import Ends, best_path, front, planner_of
from .search.assembly import RoutePlanner
from .search.departures import Departures, Moment, seconds, when_to_leave
from .search.path import Path, load_path
from .search.refine import Asked, refined
from .search.surfacing import Surfacing
from .search.trade_off import TradeOff
from .search.why_not import no_edges
from .water.domain import GeographicDomain, Point

if TYPE_CHECKING:
    from matplotlib.figure import Figure

T = TypeVar("T")


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


class OpenedScenario:
    """A scenario and what its questions need; any number of threads may ask one at once.

    `scenario`, `problem` and `planner()`; these are made when they are first needed, and kept. Points are given
    in the coordinates of the scenario's domain: x, y, z [m], z upward, or lon, lat [degrees], depth [m] where it
    is geographic; None for the scenario's own start or goal.
    """

    def __init__(self, scenario: Scenario, title: str = "") -> None:
        """A scenario at hand, whose legs are found as they are needed; figures have the `title`."""
        self.title = title
        self._kept: dict[object, object] = {"scenario": scenario}
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
        """The scenario."""
        return self._once("scenario", Scenario, self._read_scenario)

    def _read_scenario(self) -> Scenario:
        raise AssertionError("a scenario is at hand from the first")

    @property
    def problem(self) -> Problem:
        """The scenario made into objects: its water is read once."""
        return self._once("problem", Problem, lambda: self.scenario.problem())

    def planner(self, surfacing: Surfacing | None = None) -> RoutePlanner:
        """The planner whose paths keep a rule of surfacing, the scenario's own if None."""
        rule = self._surfacing if surfacing is None else surfacing
        return self._once(rule, RoutePlanner, lambda: planner_of(self.problem, self._roadmap, rule))  # type: ignore[type-abstract]

    @property
    def _roadmap(self) -> Roadmap | None:
        return None

    @property
    def position(self) -> Array:
        """The nodes (n, 3) [m]."""
        return self._once("position", np.ndarray, lambda: node_positions(self.problem))

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
        within: float | None = None,
        seconds: float | None = None,
        thin: float | None = None,
        surfacing: Surfacing | None = None,
        progress: Callable[[str], None] = lambda line: None,
        window_hours: float = HOURS,
        most_waypoints: int = MOST_WAYPOINTS,
        arrival_radius: float | None = None,
    ) -> Path:
        """The cheapest path between two points, written to each of `outputs`.

        `most_energy` [J] asks for the fastest of the paths of `trade_off` that uses no more. `polish` moves the
        stops off the nodes, cuts legs and counts yos anew, as long as the cost falls. `within` refines: nodes are
        added where they can help, in rounds, until one gains less than such a share of the cost, 0.01 for 1 %;
        with `seconds` no round begins that would likely end later; `progress` is told of each. An output that
        ends in .h5 is the roadmap with those nodes. `thin` [m] joins legs whose
        stops lie so near the straight line, where one glide does, and none where that breaks another rule.
        `surfacing` is a rule for how often to come up; the scenario's own if None. Exported windows last
        `window_hours`, a goto list holds `most_waypoints`, and a waypoint is reached within `arrival_radius` [m],
        each vehicle's usual one if None; `notes` of the path say what else became of files.

        Examples:
            >>> path = road.query((-190, 190, 0), (100, -100, -75), thin=20)
            >>> len(path.legs), round(path.travel_time)
            (3, 430)
        """
        asked = None if within is None and seconds is None else Asked(within, seconds)
        outputs, roadmaps = split_outputs(outputs, asked is not None)
        planner, ends = self.planner(surfacing), self._ends(start, goal)

        def refine(path: Path, polish: Callable[[Path], Path]) -> Path:
            assert asked is not None
            found = refined(planner, self._roadmap, ends, path, asked, polish, progress)
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
        """Costs of the cheapest paths from n points to m others: (n, m), inf where there is none.

        Examples:
            >>> road.table([(-190, 190, 0)], [(100, -100, -75), (0, 0, -150)]).round()
            array([[430., 382.]])
        """
        free = self.planner(Surfacing())
        return free.table([self._point(start) for start in starts], [self._point(goal) for goal in goals])

    def arrivals(self, start: Point | None = None) -> Array:
        """When each node (n,) can be reached from a point at the soonest [s]; inf where it cannot.

        Examples:
            >>> int((road.arrivals() < 300).sum())
            18
        """
        return self.planner(Surfacing()).arrivals(None if start is None else self._point(start))

    def trade_off(
        self, start: Point | None = None, goal: Point | None = None, *, surfacing: Surfacing | None = None
    ) -> TradeOff:
        """Every path of one query that no other beats both in time and in energy; all else as in `query`.

        Examples:
            >>> energy = planner.build("small.toml", overrides=["cost.kind=energy", "cost.preset=slocum"])
            >>> [len(path.legs) for path in glider_stream.open(energy).trade_off().paths]
            [4]
        """
        return front(self.planner(surfacing), self._ends(start, goal))

    def card(self, path: Path) -> Card:
        """What a route of this roadmap makes over ground, leg by leg, and what the water does to it.

        Examples:
            >>> print(road.card(road.query()))  # doctest: +ELLIPSIS
            leg   hours  over ground ...
            ...
        """
        return card_of(path, self.problem)

    def score(self, route: str | File | Sequence[str | File], start: Point | None = None) -> Score:
        """Fly a drawn route (CSV, GeoJSON, KML, GPX, a path file, goto lists, targets) in the roadmap's water.

        Several files are one route, one after another. `start` is where the vehicle is, before its first point.

        Examples:
            >>> _ = road.query(outputs=["path.json"])
            >>> road.score("path.json").flyable
            True
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

        def later(start: Array, end: Array, since: float) -> Path:
            return planner.leaving(since).query(start, end)

        return replace(score_of(points, planner.connect, later, planner.fly), notes=tuple(notes))

    def _point(self, values: Point) -> Array:
        return self.scenario.domain.point(values)

    def _ends(self, *points: Point | None) -> Ends:
        start, goal = (None if point is None else self._point(point) for point in points)
        return start, goal

    def when_to_leave(
        self,
        between: tuple[Moment, Moment] | None = None,
        *,
        every: float | None = None,
        arrive_by: Moment | None = None,
        start: Point | None = None,
        goal: Point | None = None,
        figure: str | File | None = None,
        surfacing: Surfacing | None = None,
    ) -> Departures:
        """Arrival and travel time against departure: the best departure, the latest to `arrive_by` a time.

        Departures `between` two times, one `every` so many seconds; from the scenario's own on, until the time
        to `arrive_by`, where none are given. Times are seconds of the flow, or ISO 8601 texts (UTC). Drawn where
        `figure` says.
        """
        if figure is not None:
            from .plot import check_figure

            check_figure(figure)
        asked = between is not None or arrive_by is not None
        require(asked, "give two times to depart between, or one to arrive by")
        planner, ends = self.planner(surfacing), self._ends(start, goal)
        require(not planner.assembly.frozen, "frozen paths hold for one departure; leave `query.frozen` out")
        problem = self.problem
        by = None if arrive_by is None else seconds(arrive_by, problem, "arrive-by")
        first, last = (problem.departure, by) if between is None else between
        times = [seconds(one, problem, "depart-between") for one in (first, last) if one is not None]
        found = when_to_leave(
            lambda when: planner.leaving(when - problem.departure).query(*ends), times[0], times[-1], every, by
        )
        if figure is not None:
            from .plot import plot_departures, save_figure

            save_figure(plot_departures(found, self.title), figure)
        return found

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

        Examples:
            >>> figure = road.plot(road.query(), "route.png", depths=[0, 75])
        """
        from .plot.draw import check_drawing, draw_roadmap, draw_route

        check_drawing(output, path, depths, chart, fronts)
        route = path if path is None or isinstance(path, Path) else load_path(path)
        free = self.planner(Surfacing())  # which has compared the water with the roadmap's
        if route is None:
            cure = "draw a route over it, or build its roadmap"
            require(self._roadmap is not None, f"a scenario has no roadmap to draw; {cure}")
            assert self._roadmap is not None
            return draw_roadmap(self._roadmap, self.problem, output, depths, self.title)
        how = output, depths, chart, fronts, free.arrivals
        return draw_route(self.position, self.problem, route, *how, self.title)

    def plot_routes(
        self,
        paths: Sequence[str | File] | Mapping[str, Path],
        output: str | File | None = None,
        depth: float | None = None,
    ) -> "Figure":
        """Draw two to four paths of this water side by side, with their times, over the current at a `depth` [m].

        `paths` are path files, which are called by their names without the ending, or paths by name. Without
        a `depth` the middle of the box is drawn. The figure is written where `output` says.

        Examples:
            >>> paths = {"near": road.query(goal=(0, 0, -150)), "far": road.query()}
            >>> figure = road.plot_routes(paths, "routes.png", depth=75)
        """
        from .plot.draw import check_drawing, draw_routes

        check_drawing(output, None, None, False, None)
        routes = (
            dict(paths) if isinstance(paths, Mapping) else {File(path).stem: load_path(path) for path in paths}
        )
        named = f"each path needs a name of its own; got {', '.join(map(str, paths))}; rename a file"
        require(len(routes) == len(paths), named)
        self.planner(Surfacing())  # which compares the water with the roadmap's
        return draw_routes(self.position, self.problem, routes, output, depth)


class OpenedRoadmap(OpenedScenario):
    """A roadmap and what its questions need, as `OpenedScenario`; `roadmap` is its data.

    InputError at the first question where flow, terrain or glider are no longer those that it was built with.

    Examples:
        >>> road = glider_stream.open("small.h5")
        >>> road.query().found
        True
        >>> road.problem is road.problem
        True
    """

    def __init__(self, roadmap: Roadmap, title: str = "") -> None:
        """A roadmap at hand; figures have the `title`."""
        self.roadmap = roadmap
        self.title = title
        self._kept: dict[object, object] = {}
        self._lock = RLock()

    def _read_scenario(self) -> Scenario:
        return scenario_of(self.roadmap)

    @property
    def _roadmap(self) -> Roadmap | None:
        return self.roadmap

    @property
    def position(self) -> Array:
        """The nodes (n, 3) [m]."""
        return self.roadmap.position

    def why_no_edges(self) -> str:
        """The reason, in a sentence, if the roadmap has no edge; empty if it has some.

        Examples:
            >>> road.why_no_edges()
            ''
        """
        return "" if self.roadmap.target.size else no_edges(self.roadmap, self.problem)

    def __str__(self) -> str:
        return str(self.roadmap)


def open(roadmap: str | File | Roadmap | OpenedRoadmap, overrides: Sequence[str] = ()) -> OpenedRoadmap:
    """Open a roadmap, from its file or as it was built, for any number of questions.

    `overrides`, such as "flow.file=currents.nc", say where a file is now that its scenario reads; one that lies
    beside the roadmap is found without.

    InputError where the file is not a roadmap, newer, incomplete or damaged.

    Examples:
        >>> road = glider_stream.open("small.h5")
        >>> print(road)  # doctest: +ELLIPSIS
        Roadmap: 77 nodes, 929 edges
        ...
    """
    if overrides:
        before = open(roadmap)
        return OpenedRoadmap(replace(before.roadmap, elsewhere=tuple(overrides)), before.title)
    if isinstance(roadmap, OpenedRoadmap):
        return roadmap
    if isinstance(roadmap, Roadmap):
        return OpenedRoadmap(roadmap)
    return OpenedRoadmap(read_roadmap(roadmap), File(roadmap).stem)


def open_scenario(scenario: str | File | Scenario, overrides: Sequence[str] = ()) -> OpenedScenario:
    """Open a scenario (a file, a shipped name or an object), whose legs are found as they are needed."""
    if isinstance(scenario, Scenario):
        require(not overrides, f"overrides are for a scenario that is read from a file; got {list(overrides)}")
        return OpenedScenario(scenario)
    return OpenedScenario(read_scenario(scenario, overrides), File(scenario).stem)


def open_either(
    source: "str | File | Roadmap | Scenario | OpenedScenario", overrides: Sequence[str] = ()
) -> OpenedScenario:
    """Open a roadmap, or a scenario: an object, a file that ends in .toml, or the name of a shipped one.

    `overrides` as `open` or `open_scenario` has them.
    """
    if isinstance(source, OpenedRoadmap):
        return open(source, overrides)
    if isinstance(source, OpenedScenario):
        require(not overrides, f"overrides are for a scenario that is read from a file; got {list(overrides)}")
        return source
    if isinstance(source, Scenario):
        return open_scenario(source, overrides)
    if not isinstance(source, Roadmap) and (File(source).suffix == ".toml" or str(source) in shipped_scenarios()):
        return open_scenario(source, overrides)
    return open(source, overrides)
