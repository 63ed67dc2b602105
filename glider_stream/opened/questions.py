"""An opened scenario or roadmap: the questions that can be asked of it."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

from ..base.arrays import Array
from ..pilot.card import Card
from ..pilot.card import card as card_of
from ..pilot.replan import TOLERANCE, Replan
from ..pilot.score import Score
from ..pilot.slocum_files import MOST_WAYPOINTS
from ..pilot.windows import HOURS
from ..roadmap.density import Density, density_of
from ..roadmap.problem import Problem
from ..roadmap.roadmap import BaseRoadmap, Roadmap
from ..roadmap.slices import SlicedRoadmap
from ..roadmap.store import KeptRoadmap
from ..scenario import Scenario
from ..search.answer import front
from ..search.assembly import RoutePlanner
from ..search.departures import Departures, Moment
from ..search.path import Path
from ..search.surfacing import Surfacing
from ..search.trade_off import TradeOff
from ..search.why_not import no_edges
from ..vehicle.polar import polar
from ..water.domain import Point
from .leaving import departures
from .replanning import replanned
from .routes import routed, split_outputs
from .scored import scored
from .searches import Searches

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class OpenedScenario:
    """A scenario with all that its queries need; many threads may use it at once.

    `scenario`, `problem` and `planner()` are made when they are first needed, and kept. Points are in the
    coordinates of the scenario's domain: x, y, z [m], z upward, or lon, lat [degrees], depth [m] if it is
    geographic. None stands for the scenario's own start or goal.
    """

    def __init__(self, searches: Searches, title: str = "") -> None:
        """Ask questions of what is searched; `title` is the title of figures."""
        self.searches = searches
        self.title = title

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.searches.scenario

    @property
    def problem(self) -> Problem:
        """The problem of the scenario; its water is read once."""
        return self.searches.problem

    @property
    def position(self) -> Array:
        """The nodes (n, 3) [m]."""
        return self.searches.position

    def planner(self, surfacing: Surfacing | None = None) -> RoutePlanner:
        """Return the planner whose paths keep a rule of surfacing; None stands for the scenario's own rule."""
        return self.searches.planner(surfacing)

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
        planner = self.searches.leaving(depart, surfacing)
        route: dict[str, Any] = {"outputs": outputs, "most_energy": most_energy, "polish": polish, "thin": thin}
        route |= {"within": within, "seconds": seconds, "progress": progress, "window_hours": window_hours}
        route |= {"most_waypoints": most_waypoints, "arrival_radius": arrival_radius}
        return routed(self.searches, planner, self.searches.ends(start, goal), **route)

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
        return replanned(
            self.searches, path, fix, time, dac=dac, currents=currents, tolerance=tolerance, surfacing=surfacing,
            arrival_radius=arrival_radius, all_nodes=all_nodes, **options,
        )  # fmt: skip

    def table(self, starts: Sequence[Point], goals: Sequence[Point], *, depart: Moment | None = None) -> Array:
        """Return the costs of the cheapest paths from n points to m others: (n, m), inf where no path exists.

        They leave at `depart`, as in `query`. In a flow that changes, only the earliest way to each node is
        followed to several goals, without a second look for later ways: a cost may be above that of `query`. If
        `query.frozen` is set, all legs meet the current of the departure, and these times do not hold.

        Examples:
            >>> road.table([(-190, 190, 0)], [(100, -100, -75), (0, 0, -150)]).round()
            array([[430., 382.]])
        """
        free = self.searches.leaving(depart, Surfacing())
        return free.table(
            [self.searches.point(start) for start in starts], [self.searches.point(goal) for goal in goals]
        )

    def arrivals(self, start: Point | None = None, *, depart: Moment | None = None) -> Array:
        """Return the earliest time [s from departure] at which each node (n,) can be reached; inf if it cannot.

        Gliders leave at `depart`, as in `query`. In a flow that changes, only the earliest way to each node is
        followed: who comes later to a node on the way may in rare cases arrive earlier. If `query.frozen` is set,
        all legs meet the current of the departure, and these times do not hold.

        Examples:
            >>> int((road.arrivals() < 300).sum())
            18
        """
        return self.searches.leaving(depart, Surfacing()).arrivals(
            None if start is None else self.searches.point(start)
        )

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
        return front(self.searches.leaving(depart, surfacing), self.searches.ends(start, goal))

    def card(self, path: Path) -> Card:
        """Return the card of a route of this roadmap: speed over ground and currents, leg by leg.

        Examples:
            >>> print(road.card(road.query()))  # doctest: +ELLIPSIS
            leg   hours  over ground ...
            ...
        """
        return card_of(path, self.searches.problem_of(path))

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
        return scored(self.searches, route, start, depart=depart)

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
        asked: dict[str, Any] = {"start": start, "goal": goal, "figure": figure, "surfacing": surfacing}
        return departures(self.searches, between, every=every, arrive_by=arrive_by, title=self.title, **asked)

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
        from .drawing import draw

        return draw(self.searches, path, output, depths, chart, fronts, self.title)

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
        from .drawing import draw_beside

        return draw_beside(self.searches, paths, output, depth)


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

    def __init__(self, roadmap: KeptRoadmap, title: str = "") -> None:
        """Keep a roadmap; `title` is the title of figures."""
        super().__init__(Searches(None, roadmap), title)

    @property
    def roadmap(self) -> Roadmap | SlicedRoadmap:
        """The roadmap with all its edges; if it stayed in its file, it is read now."""
        road = self.searches.road
        assert road is not None
        return road

    def why_no_edges(self) -> str:
        """The reason, in a sentence, if the roadmap has no edge; empty if it has some.

        Examples:
            >>> road.why_no_edges()
            ''
        """
        return no_edges(self._one, self.problem)

    def density(self) -> Density:
        """Return how far nodes lie apart in the vehicle's legs, and in how many directions legs leave them.

        Examples:
            >>> print(road.density())
            nodes 95 m apart at a depth, 0.45 legs; legs in 7 of 36 directions from a node
        """
        return density_of(self._one, float(polar(self.scenario.glider).best_angle.max()))

    def as_dict(self) -> dict[str, Any]:
        """Return the table that `info --json` prints.

        Examples:
            >>> road.as_dict()["nodes"]
            77
        """
        return self._told.as_dict()

    @property
    def _told(self) -> BaseRoadmap:
        """The roadmap; if it has one departure and stays in its file, it is not read."""
        source = self.searches.source
        assert source is not None
        return source if source.departures is None else self.roadmap

    @property
    def _one(self) -> BaseRoadmap:
        """The roadmap, of several departures its first slice."""
        told = self._told
        return told.at(0) if isinstance(told, SlicedRoadmap) else told

    def __str__(self) -> str:
        return str(self._told)
