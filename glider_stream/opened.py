"""An opened roadmap: roadmap, problem and searches are each made once, when they are first needed."""

import tomllib
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as File
from threading import RLock
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from .base.arrays import Array
from .base.clock import moment
from .base.errors import InputWarning
from .base.output import check_output
from .base.settings import require
from .pilot.card import Card
from .pilot.card import card as card_of
from .pilot.export import check_export, check_legs, export_path
from .pilot.replan import TOLERANCE, Replan, compared, good_until_of, shown
from .pilot.route_files import read_drawn
from .pilot.score import Score
from .pilot.score import score as score_of
from .pilot.slocum import RADIUS
from .pilot.slocum_files import MOST_WAYPOINTS
from .pilot.windows import HOURS
from .roadmap.builder import node_positions
from .roadmap.density import Density, density_of
from .roadmap.inputs import settings_sha256
from .roadmap.problem import Problem
from .roadmap.roadmap import Roadmap
from .roadmap.slices import SlicedRoadmap
from .roadmap.store import read_any_roadmap
from .scenario import (
    Scenario,
    read_scenario,
    scenario_from_text,
    scenario_of,
    shipped_scenarios,
    with_currents,
)
from .search.answer import Ends, best_path, front, planner_of
from .search.assembly import RoutePlanner
from .search.departures import Departures, Moment, seconds, when_to_leave
from .search.flown_on import check_currents, check_plan, flown_on
from .search.least_time import GreatestSpeeds, least_cost
from .search.path import SURFACE, Origin, Path, load_path, placed
from .search.query import Planner
from .search.refine import Asked, refined
from .search.surfacing import Surfacing
from .search.time_dependent import ClockPlanner
from .search.trade_off import TradeOff
from .search.why_not import no_edges
from .vehicle.polar import polar
from .water.domain import GeographicDomain, Point, domain_from_table
from .water.inspect import is_steady

if TYPE_CHECKING:
    from matplotlib.figure import Figure

T = TypeVar("T")
LATEST_FIX = 366 * 86_400.0
"""A fix is at most so long [s] after its plan's departure; seconds since 1970, say, are not the flow's."""
NEAR = 0.1
"""A replan with the clock running searches the nodes on ways at most this share longer than the best way, by the
legs of a roadmap, which are those of another time. Among 38,000 nodes of the Ionian Sea these are thousands."""


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
        return self._once(rule, RoutePlanner, lambda: self._planner_of(self.problem, rule))  # type: ignore[type-abstract]

    def _planner_of(self, problem: Problem, rule: Surfacing) -> RoutePlanner:
        road = self._roadmap
        return planner_of(problem, road, rule, self.position if road is None else None)

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
        return self._planner_of(problem.leaving(since), self._surfacing if surfacing is None else surfacing)

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
        split_outputs(outputs, within is not None or seconds is not None)  # before the water is read
        planner = self._leaving(depart, surfacing)
        route: dict[str, Any] = {"outputs": outputs, "most_energy": most_energy, "polish": polish, "thin": thin}
        route |= {"within": within, "seconds": seconds, "progress": progress, "window_hours": window_hours}
        route |= {"most_waypoints": most_waypoints, "arrival_radius": arrival_radius}
        return self._route(planner, self._ends(start, goal), **route)

    def _route(
        self,
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
        path = replace(path, origin=self._origin(planner))
        check_legs(path, outputs)
        notes: list[str] = []
        for output in outputs:
            export_path(path, output, notes.append, **written)
        return replace(path, notes=(*path.notes, *notes))

    def replan(
        self,
        path: str | File | Path,
        fix: tuple[float, float],
        time: Moment,
        *,
        dac: tuple[float, float] | None = None,
        currents: str | File | Sequence[str | File] | None = None,
        tolerance: float = TOLERANCE,
        surfacing: Surfacing | None = None,
        arrival_radius: float | None = None,
        all_nodes: bool = False,
        **options: Any,
    ) -> Replan:
        """Return a new plan from a position fix at the surface to the goal of an old plan, and what becomes of
        that.

        `path`: the old plan, a path file or an object. `fix`: lon, lat [degrees], or x, y [m] where the domain
        is in metres; `time`: when, in seconds of the flow, or an ISO 8601 text (UTC). `dac`: the depth-averaged
        current of the last dive, east and north [m/s], which is compared with the forecast. `currents`: newer
        current files; the nodes are kept, and legs are found as the clock runs. The old list is good as long as
        flying it on, and planning anew after that, costs at most the share `tolerance` more than the new plan.
        `surfacing`: None stands for the old plan's rule. The goal counts as reached within `arrival_radius` [m].
        Where the clock runs and a roadmap has legs of one departure, only the nodes are searched that these legs
        connect with a way at most NEAR longer than their best, unless `all_nodes`. `options` are those of
        `query` for a route and its files: outputs, polish, thin, within, seconds, progress, window_hours,
        most_waypoints.

        Examples:
            >>> path = road.query()
            >>> answer = road.replan(path, (-60.0, 60.0), 200.0)
            >>> answer.new.found, answer.flown.first
            (True, 3)

        """
        old = path if isinstance(path, Path) else load_path(path)
        require(
            len(old.legs) > 0, "the plan holds no leg, so nothing is left to be planned anew; plan a route first"
        )
        require(0 <= tolerance < np.inf, f"the tolerance must be from 0 % up; got {tolerance:.0%}")
        # a newer forecast is often written over the older one, whose currents are then no more known
        renewed = currents is not None and old.origin is not None
        before, since = self._at_fix(old, time, renewed)
        place = self._point((*fix, 0.0))
        now = self if currents is None else self._renewed(currents, before, place, old.goal)
        leaves = now.problem if currents is not None else before
        check_moment(leaves, "fix", "name newer currents with --currents")
        leaves.check_point(place, "fix")
        planner = now._leaving(leaves.departure, _rule_of(old) if surfacing is None else surfacing)
        wide, share = planner, 1.0
        if not all_nodes:
            planner, share = now._near_ways(planner, place, old.goal)
        radius = self._radius(old.goal, arrival_radius)
        arrived = float(np.linalg.norm(place - old.goal)) <= radius
        if arrival_radius is not None:
            options["arrival_radius"] = arrival_radius
        ends = place, place if arrived else old.goal
        new = now._route(planner, ends, **options)
        if share < 1 and not new.found:
            planner, share = wide, 1.0
            new = now._route(planner, ends, **options)
        notes = new.notes
        if share < 1:
            among = (
                f"searched among {share:.0%} of the nodes, those on ways of the roadmap's legs at most {NEAR:.0%}"
            )
            notes = (*notes, f"{among} longer than their best; --all-nodes searches all, which takes longer")
        old = placed(old, before.leaving(-since))
        flown = flown_on(old, since, place, leaves)
        current = None
        if dac is not None:
            current = compared(np.array(dac), old, since, place, (leaves, before), new, tolerance)
        good = None if arrived else good_until_of(flown, new, planner, radius, tolerance)
        return Replan(new, old, since, place, flown, good, current, radius, arrived, leaves, notes)

    def _near_ways(self, planner: RoutePlanner, start: Array, goal: Array) -> tuple[RoutePlanner, float]:
        """Return the planner among the nodes near the best ways by the legs of a roadmap, and their share.

        It is the same planner, and 1, if its legs are known, or if no roadmap has legs of one departure.
        """
        guide = self._guide
        if type(planner) is not ClockPlanner or guide is None:
            return planner, 1.0
        by_legs = guide._once("guide", Planner, lambda: Planner(_one_slice(guide.roadmap), guide.problem))
        through = by_legs.arrivals(start) + by_legs.remaining(goal)
        best = float(through.min(initial=np.inf))
        if not np.isfinite(best):
            return planner, 1.0
        near = through <= (1 + NEAR) * best
        nodes = np.ascontiguousarray(planner.position[near])
        return ClockPlanner(planner.problem, nodes, planner.rule, planner.assembly.frozen), float(near.mean())

    @property
    def _guide(self) -> "OpenedRoadmap | None":
        """A roadmap of the same nodes, whose legs are of another time or another forecast; None without one."""
        kept = self._kept.get("guide of nodes")
        return kept if isinstance(kept, OpenedRoadmap) else None

    def _at_fix(self, old: Path, time: Moment, renewed: bool) -> tuple[Problem, float]:
        """Return the problem for gliders that leave at a fix, and the time [s] since the departure of an old
        plan.

        InputError if the plan is not one of this problem, or if the fix is before its departure. `renewed`: the
        currents of the plan may have changed since.
        """
        problem = self.problem
        if old.origin is not None:
            same = domain_from_table(tomllib.loads(old.origin.scenario).get("domain", {})) == self.scenario.domain
            require(
                same, "the plan was made in another [domain], so its places are others; give its own scenario"
            )
        began = problem.departure if old.departure is None else old.departure
        began = began if old.origin is None else old.origin.departure
        leaving = problem.leaving(began - problem.departure)
        check_plan(old, leaving)
        if not renewed:
            check_moment(leaving, "the plan's departure", "give the currents that it was planned with")
            check_currents(old, leaving)
        since = seconds(time, problem, "fix") - began
        if since < 0:
            left = f"{began:,.0f} s" if leaving.departs is None else moment(leaving.departs, 0.0)
            require(
                False, f"the fix's time {time} is before the plan's departure, {left}; give the time of the fix"
            )
        require(
            since <= LATEST_FIX,
            f"the fix's time {time} is {since / 86_400:,.0f} days after the plan's departure, more than "
            f"{LATEST_FIX / 86_400:g}; give a date, or seconds as the scenario counts them",
        )
        return leaving.leaving(since), since

    def _radius(self, goal: Array, arrival_radius: float | None) -> float:
        """Return the distance [m] at which a goal counts as reached: a list's for places that surface, else a
        leg's."""
        if arrival_radius is not None:
            require(
                0 <= arrival_radius < np.inf, f"the arrival radius must be 0 m or more; got {arrival_radius:g}"
            )
            return arrival_radius
        listed = isinstance(self.scenario.domain, GeographicDomain) and goal[2] >= -SURFACE
        return float(RADIUS if listed else self.problem.evaluator.integration.tolerance)

    def _renewed(
        self, currents: str | File | Sequence[str | File], before: Problem, start: Array, goal: Array
    ) -> "OpenedScenario":
        """Return the same scenario and nodes in newer currents, for gliders that leave as in `before`."""
        files = [currents] if isinstance(currents, str | File) else list(currents)
        ends = {name: shown(place, before) for name, place in (("start", start), ("goal", goal))}
        query: dict[str, Any] = {**ends, "departure": before.departure}
        if before.departs is not None:
            query |= {"departure": 0.0, "epoch": before.departs.replace(tzinfo=None).isoformat()}
        later = OpenedScenario(with_currents(self.scenario, files, query), self.title)
        later._kept |= {"position": self.position, "file": self._file, "guide of nodes": self._guide}
        return later

    def _origin(self, planner: RoutePlanner) -> Origin:
        """Return what the paths of a planner are planned with."""
        rule, road = planner.rule, self._file
        named = "" if road is None else str(road.absolute())
        what: dict[str, Any] = {"departure": planner.problem.departure, "most_yos": rule.most_yos}
        nodes_only = self._roadmap is None and bool(named)
        return Origin(self.scenario.text, named, nodes_only, most_hours=rule.most_hours, **what)

    @property
    def _file(self) -> File | None:
        """The file of the roadmap whose nodes are searched; None without one."""
        kept = self._kept.get("file")
        return kept if isinstance(kept, File) else None

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
    def _file(self) -> File | None:
        return self.roadmap.file

    @property
    def _guide(self) -> "OpenedRoadmap | None":
        return self

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


def open_plan(path: Path, overrides: Sequence[str] = ()) -> OpenedScenario:
    """Open what a plan was made with: its roadmap if that is still there, else its scenario.

    `overrides` give the new place of files, such as "flow.file=currents.nc". InputError if the plan does not say
    what it was made with.
    """
    origin = path.origin
    cure = "name its roadmap with --roadmap, or its scenario with --scenario"
    require(
        origin is not None, f"the plan does not say what it was made with: an earlier version wrote it; {cure}"
    )
    assert origin is not None
    road = None
    if origin.roadmap and File(origin.roadmap).is_file():
        road = open(origin.roadmap)
        if not origin.nodes_only:
            built = settings_sha256(road.roadmap.provenance.scenario)
            same = built == settings_sha256(origin.scenario)
            require(same, f"the roadmap {origin.roadmap} has been built anew with other settings; {cure}")
            return open(origin.roadmap, overrides) if overrides else road
    elif origin.roadmap:
        gone = f"the plan's roadmap {origin.roadmap} is not there: the scenario's nodes are taken instead"
        warnings.warn(f"{gone}; to use the roadmap, name it with --roadmap", InputWarning, stacklevel=2)
    opened = OpenedScenario(scenario_from_text(origin.scenario, overrides, "the plan's scenario"))
    if road is not None:
        opened._kept |= {"position": road.position, "file": road.roadmap.file, "guide of nodes": road}
    return opened


def _one_slice(road: Roadmap | SlicedRoadmap) -> Roadmap:
    """Return a roadmap of one departure, the first of several."""
    return road.at(0) if isinstance(road, SlicedRoadmap) else road


def _rule_of(path: Path) -> Surfacing | None:
    """Return the rule of surfacing that a path was planned with; None if that is unknown."""
    return None if path.origin is None else Surfacing(path.origin.most_yos, path.origin.most_hours)


def check_moment(problem: Problem, what: str, cure: str) -> None:
    """Raise InputError unless a problem leaves within the times of its flow."""
    extent, when = problem.evaluator.flow.extent, problem.departure
    ends = f"{extent.t_lo:,.0f} to {extent.t_hi:,.0f} s"
    at = f"{when:,.0f} s"
    if problem.departs is not None and np.isfinite([extent.t_lo, extent.t_hi]).all():
        ends = " to ".join(moment(problem.departs, end - when) for end in (extent.t_lo, extent.t_hi))
        at = moment(problem.departs, 0.0)
    within = extent.t_lo <= when <= extent.t_hi
    require(within, f"{what}, {at}, lies outside the times of the currents, {ends}; {cure}")


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
