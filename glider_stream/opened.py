"""An opened roadmap: roadmap, problem and searches are each made once, when they are first needed."""

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
from .roadmap.density import Density, density_of
from .roadmap.problem import Problem
from .roadmap.roadmap import Roadmap
from .roadmap.slices import SlicedRoadmap
from .roadmap.store import read_any_roadmap
from .scenario import Scenario, read_scenario, scenario_of, shipped_scenarios
from .search.answer import Ends, best_path, front, planner_of
from .search.assembly import RoutePlanner
from .search.departures import Departures, Moment, seconds, when_to_leave
from .search.least_time import GreatestSpeeds, least_cost
from .search.path import Path, load_path
from .search.refine import Asked, refined
from .search.surfacing import Surfacing
from .search.trade_off import TradeOff
from .search.why_not import no_edges
from .vehicle.polar import polar
from .water.domain import GeographicDomain, Point
from .water.inspect import is_steady

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
    """A scenario with all that its queries need; many threads may use it at once.

    `scenario`, `problem` and `planner()` are made when they are first needed, and kept. Points are in the
    coordinates of the scenario's domain: x, y, z [m], z upward, or lon, lat [degrees], depth [m] if it is
    geographic. None stands for the scenario's own start or goal.
    """

    def __init__(self, scenario: Scenario, title: str = "") -> None:
        """Keep a scenario, whose legs are found when they are needed; `title` is the title of figures."""
        self.title = title
        self._kept: dict[object, object] = {"scenario": scenario}
        self._lock = RLock()

    def _once(self, name: object, kind: type[T], make: Callable[[], T]) -> T:
        """Return the object that is kept under a name; the first caller makes it, and others wait."""
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
        raise AssertionError("the scenario is set at the start")

    @property
    def problem(self) -> Problem:
        """The problem of the scenario; its water is read once."""
        return self._once("problem", Problem, lambda: self.scenario.problem())

    def planner(self, surfacing: Surfacing | None = None) -> RoutePlanner:
        """Return the planner whose paths keep a rule of surfacing; None stands for the scenario's own rule."""
        rule = self._surfacing if surfacing is None else surfacing
        return self._once(rule, RoutePlanner, lambda: planner_of(self.problem, self._roadmap, rule))  # type: ignore[type-abstract]

    def _leaving(self, depart: Moment | None, surfacing: Surfacing | None = None) -> RoutePlanner:
        """Return the `planner` for routes that leave at a time; None stands for the scenario's departure."""
        problem, road = self.problem, self._roadmap
        since = 0.0 if depart is None else seconds(depart, problem, "depart") - problem.departure
        changes = not is_steady(problem.evaluator.flow)
        if since == 0.0 or (changes and not problem.frozen):
            planner = self.planner(surfacing)
            return planner.leaving(since) if since else planner
        fits = not (changes and isinstance(road, Roadmap))
        legs = f"frozen paths over this roadmap leave at {problem.departure:g} s"
        require(fits, f"{legs}; got {depart}; leave `query.frozen` out, or build it with that `query.departure`")
        return planner_of(problem.leaving(since), road, self._surfacing if surfacing is None else surfacing)

    def _problem_of(self, route: Path) -> Problem:
        """Return the problem at the time when a route leaves, if the route has one."""
        problem = self.problem
        return problem if route.departure is None else problem.leaving(route.departure - problem.departure)

    @property
    def _roadmap(self) -> Roadmap | SlicedRoadmap | None:
        return None

    @property
    def position(self) -> Array:
        """The nodes (n, 3) [m]."""
        return self._once("position", np.ndarray, lambda: node_positions(self.problem))

    @property
    def _surfacing(self) -> Surfacing:
        """The scenario's own rule of surfacing."""
        query = self.scenario.query
        return Surfacing() if query is None else Surfacing(query.most_yos, query.most_hours)

    def query(
        self,
        start: Point | None = None,
        goal: Point | None = None,
        *,
        depart: Moment | None = None,
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
        """Return the cheapest path between two points, and write it to each of `outputs`.

        `depart`: the departure, in seconds of the flow or an ISO 8601 text (UTC); None stands for the scenario's.
        `most_energy` [J]: take the fastest of the paths of `trade_off` that uses no more. `polish`: move the
        stops off the nodes, cut legs and count yos anew, as long as the cost falls. `within`: add nodes where
        they can help, in rounds, until a round gains less than this share of the cost, 0.01 for 1 %. `seconds`:
        add them, as long as another round likely fits this time. `progress` is told of each round. An output
        that ends in .h5 is the roadmap with the new nodes. `thin` [m]: join legs whose stops lie this near to a
        straight line, if one glide can do it and no other rule is broken. `surfacing`: a rule for how often to
        come up; None stands for the scenario's own. Exported windows last `window_hours`, a goto list holds
        `most_waypoints`, and a waypoint counts as reached within `arrival_radius` [m]; None stands for each
        vehicle's usual value. The path's `notes` tell what else happened to files.

        Examples:
            >>> path = road.query((-190, 190, 0), (100, -100, -75), thin=20)
            >>> len(path.legs), round(path.travel_time)
            (3, 430)
        """
        asked = None if within is None and seconds is None else Asked(within, seconds)
        outputs, roadmaps = split_outputs(outputs, asked is not None)
        planner, ends = self._leaving(depart, surfacing), self._ends(start, goal)

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
            path = replace(path, least=self._least(path, planner.problem.departure))
        check_legs(path, outputs)
        notes: list[str] = []
        written = {
            "window_hours": window_hours,
            "most_waypoints": most_waypoints,
            "arrival_radius": arrival_radius,
        }
        for output in outputs:
            export_path(path, output, notes.append, **written)
        return replace(path, notes=(*path.notes, *notes))

    def _least(self, path: Path, departure: float) -> float:
        """A bound below the cost of every route between a path's ends that leaves at a departure [s]."""
        problem = self.problem
        speeds = self._once(
            ("speeds", departure), GreatestSpeeds, lambda: GreatestSpeeds(problem, self.position, departure)
        )
        return least_cost(speeds, path.start, path.goal, problem.evaluator.cost)

    def table(self, starts: Sequence[Point], goals: Sequence[Point], *, depart: Moment | None = None) -> Array:
        """Return the costs of the cheapest paths from n points to m others: (n, m), inf where no path exists.

        They leave at `depart`, as in `query`. In a flow that changes, only the earliest way to each node is
        followed to several goals, without a second look for later ways: a cost may be above that of `query`. If
        `query.frozen` is set, all legs meet the current of the departure, and these times do not hold.

        Examples:
            >>> road.table([(-190, 190, 0)], [(100, -100, -75), (0, 0, -150)]).round()
            array([[430., 382.]])
        """
        free = self._leaving(depart, Surfacing())
        return free.table([self._point(start) for start in starts], [self._point(goal) for goal in goals])

    def arrivals(self, start: Point | None = None, *, depart: Moment | None = None) -> Array:
        """Return the earliest time [s from departure] at which each node (n,) can be reached; inf if it cannot.

        Gliders leave at `depart`, as in `query`. In a flow that changes, only the earliest way to each node is
        followed: who comes later to a node on the way may in rare cases arrive earlier. If `query.frozen` is set,
        all legs meet the current of the departure, and these times do not hold.

        Examples:
            >>> int((road.arrivals() < 300).sum())
            18
        """
        return self._leaving(depart, Surfacing()).arrivals(None if start is None else self._point(start))

    def trade_off(
        self,
        start: Point | None = None,
        goal: Point | None = None,
        *,
        depart: Moment | None = None,
        surfacing: Surfacing | None = None,
    ) -> TradeOff:
        """Return all paths of one query that no other path beats in both time and energy; see `query`.

        Examples:
            >>> energy = planner.build("small.toml", overrides=["cost.kind=energy", "cost.preset=slocum"])
            >>> [len(path.legs) for path in glider_stream.open(energy).trade_off().paths]
            [4]
        """
        return front(self._leaving(depart, surfacing), self._ends(start, goal))

    def card(self, path: Path) -> Card:
        """Return the card of a route of this roadmap: speed over ground and currents, leg by leg.

        Examples:
            >>> print(road.card(road.query()))  # doctest: +ELLIPSIS
            leg   hours  over ground ...
            ...
        """
        return card_of(path, self._problem_of(path))

    def score(
        self,
        route: str | File | Sequence[str | File],
        start: Point | None = None,
        *,
        depart: Moment | None = None,
    ) -> Score:
        """Fly a drawn route (CSV, GeoJSON, KML, GPX, a path file, goto lists, targets) in the roadmap's water.

        Several files are one route, one after another. `start` is where the vehicle is, before its first point;
        it leaves at `depart`, as in `query`.

        Examples:
            >>> _ = road.query(outputs=["path.json"])
            >>> road.score("path.json").flyable
            True
        """
        files = [route] if isinstance(route, str | File) else list(route)
        drawn = [read_drawn(file) for file in files]
        # a drawn route may begin or end anywhere, so it does not keep the rule of surfacing
        planner, domain = self._leaving(depart, Surfacing()), self.scenario.domain
        on_globe = isinstance(domain, GeographicDomain)
        cure = "and the roadmap is in metres; give x, y, z in a CSV file"
        points = [] if start is None else [self._point(start)]
        for file, drawing in zip(files, drawn, strict=True):
            require(on_globe or not drawing.geographic, f"the route {file} is in longitude and latitude, {cure}")
            points += [domain.point(place) if drawing.geographic else np.array(place) for place in drawing.places]
        require(
            len(points) > 1, f"the route {files[0]} holds one point; give the vehicle's position with --start"
        )
        for n, point in enumerate(points, 1 if start is None else 0):
            self.problem.check_point(point, f"point {n}" if n else "start")
        notes = [note for drawing in drawn for note in drawing.notes]
        if start is None and drawn[0].of_vehicle:
            notes.append("the way to its first point is not scored; give the vehicle's position with --start")

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
        """Return arrival and travel time against departure: the best, and the latest to `arrive_by` a time.

        Departures lie `between` two times, one `every` so many seconds; if none are given, they begin at the
        scenario's own and end at the time to `arrive_by`. Times are seconds of the flow, or ISO 8601 texts (UTC).
        A figure is written to `figure`.
        """
        if figure is not None:
            from .plot import check_figure

            check_figure(figure)
        asked = between is not None or arrive_by is not None
        require(asked, "give two times to depart between, or a time to arrive by")
        planner, ends = self.planner(surfacing), self._ends(start, goal)
        require(not planner.assembly.frozen, "frozen paths hold for one departure; leave `query.frozen` out")
        problem = self.problem
        by = None if arrive_by is None else seconds(arrive_by, problem, "arrive-by")
        first, last = (problem.departure, by) if between is None else between
        times = [seconds(moment, problem, "depart-between") for moment in (first, last) if moment is not None]
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
        """Draw a path over the roadmap and the current at some `depths` [m], or the roadmap if no path is given.

        `path`: a path file or object. There are up to four depths for a path, one for a roadmap or a `chart`. A
        chart shows a path by time, with heading and speeds; `fronts` also draws there what can be reached every
        so many hours. The figure is written to `output`; if that ends in .html, it is an interactive page and
        None is returned.

        Examples:
            >>> figure = road.plot(road.query(), "route.png", depths=[0, 75])
        """
        from .plot.draw import check_drawing, draw_roadmap, draw_route

        check_drawing(output, path, depths, chart, fronts)
        route = path if path is None or isinstance(path, Path) else load_path(path)
        free = self.planner(Surfacing())  # this also compares the water with the roadmap's
        if route is None:
            cure = "draw a route over it, or build its roadmap"
            require(self._roadmap is not None, f"a scenario has no roadmap to draw; {cure}")
            road, problem, title = self._roadmap, self.problem, self.title
            assert road is not None
            if isinstance(
                road, SlicedRoadmap
            ):  # draw the slice nearest to the departure, over the current of its time
                number = int(np.abs(road.departures - problem.departure).argmin())
                problem = problem.leaving(float(road.departures[number]) - problem.departure)
                which = f"slice {number + 1} of {road.departures.size}"
                road, title = road.at(number), f"{title}, {which}" if title else which.capitalize()
            return draw_roadmap(road, problem, output, depths, title)
        problem = self._problem_of(route)
        arrivals = self._leaving(problem.departure, Surfacing()).arrivals if fronts is not None else free.arrivals
        return draw_route(self.position, problem, route, output, depths, chart, fronts, arrivals, self.title)

    def plot_routes(
        self,
        paths: Sequence[str | File] | Mapping[str, Path],
        output: str | File | None = None,
        depth: float | None = None,
    ) -> "Figure":
        """Draw two to four paths of this water side by side, with their times, over the current at a `depth` [m].

        `paths` are path files, which are named by their file names without the ending, or a dictionary of paths
        by name. Without a `depth` it is the middle of the box. The figure is written to `output`.

        Examples:
            >>> paths = {"near": road.query(goal=(0, 0, -150)), "far": road.query()}
            >>> figure = road.plot_routes(paths, "routes.png", depth=75)
        """
        from .plot.draw import check_drawing, draw_routes

        check_drawing(output, None, None, False, None)
        routes = (
            dict(paths) if isinstance(paths, Mapping) else {File(path).stem: load_path(path) for path in paths}
        )
        named = f"each path needs a different name; got {', '.join(map(str, paths))}; rename a file"
        require(len(routes) == len(paths), named)
        self.planner(Surfacing())  # this also compares the water with the roadmap's
        leave = {route.departure for route in routes.values()}
        problem = self._problem_of(next(iter(routes.values()))) if len(leave) == 1 else self.problem
        return draw_routes(self.position, problem, routes, output, depth)


class OpenedRoadmap(OpenedScenario):
    """A roadmap with all that its queries need, like `OpenedScenario`; `roadmap` holds its data.

    InputError at the first query if flow, terrain or glider differ from those that it was built with.

    Examples:
        >>> road = glider_stream.open("small.h5")
        >>> road.query().found
        True
        >>> road.problem is road.problem
        True
    """

    def __init__(self, roadmap: Roadmap | SlicedRoadmap, title: str = "") -> None:
        """Keep a roadmap; `title` is the title of figures."""
        self.roadmap = roadmap
        self.title = title
        self._kept: dict[object, object] = {}
        self._lock = RLock()

    def _read_scenario(self) -> Scenario:
        return scenario_of(self.roadmap)

    @property
    def _roadmap(self) -> Roadmap | SlicedRoadmap | None:
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
        if self.roadmap.target.size:
            return ""
        one = self.roadmap.at(0) if isinstance(self.roadmap, SlicedRoadmap) else self.roadmap
        return no_edges(one, self.problem)

    def density(self) -> Density:
        """Return how far nodes lie apart in the vehicle's legs, and in how many directions legs leave them.

        Examples:
            >>> print(road.density())
            nodes 95 m apart at a depth, 0.45 legs; legs in 7 of 36 directions from a node
        """
        one = self.roadmap.at(0) if isinstance(self.roadmap, SlicedRoadmap) else self.roadmap
        return density_of(one, float(polar(self.scenario.glider).best_angle.max()))

    def __str__(self) -> str:
        return str(self.roadmap)


def open(
    roadmap: str | File | Roadmap | SlicedRoadmap | OpenedRoadmap, overrides: Sequence[str] = ()
) -> OpenedRoadmap:
    """Open a roadmap (a file or an object) for any number of queries.

    `overrides`, such as "flow.file=currents.nc", give the new place of a file that the scenario reads; a file
    beside the roadmap is found without.

    InputError if the file is not a roadmap, or is newer, incomplete or damaged.

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
    if isinstance(roadmap, Roadmap | SlicedRoadmap):
        return OpenedRoadmap(roadmap)
    return OpenedRoadmap(read_any_roadmap(roadmap), File(roadmap).stem)


def open_scenario(scenario: str | File | Scenario, overrides: Sequence[str] = ()) -> OpenedScenario:
    """Open a scenario (a file, a shipped name or an object), whose legs are found when they are needed."""
    if isinstance(scenario, Scenario):
        require(not overrides, f"overrides are for a scenario that is read from a file; got {list(overrides)}")
        return OpenedScenario(scenario)
    return OpenedScenario(read_scenario(scenario, overrides), File(scenario).stem)


def open_either(
    source: "str | File | Roadmap | SlicedRoadmap | Scenario | OpenedScenario", overrides: Sequence[str] = ()
) -> OpenedScenario:
    """Open a roadmap or a scenario: an object, a file (a scenario's ends in .toml), or a shipped name.

    `overrides`: see `open` and `open_scenario`.
    """
    if isinstance(source, OpenedRoadmap):
        return open(source, overrides)
    if isinstance(source, OpenedScenario):
        require(not overrides, f"overrides are for a scenario that is read from a file; got {list(overrides)}")
        return source
    if isinstance(source, Scenario):
        return open_scenario(source, overrides)
    if isinstance(source, Roadmap | SlicedRoadmap):
        return open(source, overrides)
    if File(source).suffix == ".toml" or str(source) in shipped_scenarios():
        return open_scenario(source, overrides)
    return open(source, overrides)
