"""What the queries of a scenario or a roadmap need: each thing is made once, when it is first needed."""

from collections.abc import Callable
from pathlib import Path as File
from threading import RLock
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..roadmap.builder import node_positions
from ..roadmap.problem import Problem
from ..roadmap.roadmap import EdgeTable, Roadmap
from ..roadmap.slices import SlicedRoadmap
from ..roadmap.store import KeptRoadmap, StoredRoadmap
from ..scenario import Scenario, scenario_of
from ..search.answer import Ends, planner_of, planner_on_demand
from ..search.assembly import RoutePlanner
from ..search.departures import Moment, seconds
from ..search.least_time import GreatestSpeeds, least_cost
from ..search.path import Origin, Path
from ..search.surfacing import Surfacing
from ..water.domain import Point
from ..water.inspect import is_steady

T = TypeVar("T")


class Nodes(NamedTuple):
    """Nodes of a roadmap that are searched without its legs, which are of another time or another forecast."""

    position: Array
    """(n, 3) [m]."""
    file: File | None
    """The roadmap's file."""
    guide: "Searches | None"
    """The roadmap itself: its legs tell which nodes lie near a good way."""


class Searches:
    """A scenario or a roadmap with problem and planners; many threads may use it at once."""

    def __init__(
        self,
        scenario: Scenario | None,
        source: KeptRoadmap | None = None,
        nodes: Nodes | None = None,
    ) -> None:
        """Keep a `scenario`, or a roadmap with its own; `nodes` are searched instead of the scenario's.

        Of a roadmap that stays in its file, queries with the clock running read only the edges that they need.
        """
        self.source = source
        self._nodes = nodes
        self._kept: dict[object, object] = {} if scenario is None else {"scenario": scenario}
        self._lock = RLock()

    def once(self, name: object, kind: type[T], make: Callable[[], T]) -> T:
        """Return the object that is kept under a name; the first caller makes it, and others wait."""
        with self._lock:
            if name not in self._kept:
                self._kept[name] = make()
            kept = self._kept[name]
        assert isinstance(kept, kind)
        return kept

    @property
    def road(self) -> Roadmap | SlicedRoadmap | None:
        """The roadmap with all its edges; None without one."""
        source = self.source
        if not isinstance(source, StoredRoadmap):
            return source
        return self.once("road", EdgeTable, source.whole)  # type: ignore[return-value]

    @property
    def scenario(self) -> Scenario:
        """The scenario."""

        def read() -> Scenario:
            assert self.source is not None
            return scenario_of(self.source)

        return self.once("scenario", Scenario, read)

    @property
    def problem(self) -> Problem:
        """The problem of the scenario; its water is read once."""
        return self.once("problem", Problem, lambda: self.scenario.problem())

    def planner(self, surfacing: Surfacing | None = None) -> RoutePlanner:
        """Return the planner whose paths keep a rule of surfacing; None stands for the scenario's own rule."""
        rule = self.surfacing if surfacing is None else surfacing
        return self.once(rule, RoutePlanner, lambda: self._planner_of(self.problem, rule))  # type: ignore[type-abstract]

    def _planner_of(self, problem: Problem, rule: Surfacing) -> RoutePlanner:
        source = self.source
        if isinstance(source, StoredRoadmap):
            planner = planner_on_demand(problem, source, rule)
            if planner is not None:
                return planner
        return planner_of(problem, self.road, rule, self.position if source is None else None)

    def leaving(self, depart: Moment | None, surfacing: Surfacing | None = None) -> RoutePlanner:
        """Return the `planner` for routes that leave at a time; None stands for the scenario's departure."""
        problem = self.problem
        since = 0.0 if depart is None else seconds(depart, problem, "depart") - problem.departure
        changes = not is_steady(problem.evaluator.flow)
        if since == 0.0 or (changes and not problem.frozen):
            planner = self.planner(surfacing)
            return planner.leaving(since) if since else planner
        fits = not changes or self.source is None or self.source.departures is not None
        legs = f"frozen paths over this roadmap leave at {problem.departure:g} s"
        require(fits, f"{legs}; got {depart}; leave `query.frozen` out, or build it with that `query.departure`")
        return self._planner_of(problem.leaving(since), self.surfacing if surfacing is None else surfacing)

    def problem_of(self, route: Path) -> Problem:
        """Return the problem at the time when a route leaves, if the route has one."""
        problem = self.problem
        return problem if route.departure is None else problem.leaving(route.departure - problem.departure)

    @property
    def position(self) -> Array:
        """The nodes (n, 3) [m]."""
        if self.source is not None:
            return self.source.position
        if self._nodes is not None:
            return self._nodes.position
        return self.once("position", np.ndarray, lambda: node_positions(self.problem))

    @property
    def file(self) -> File | None:
        """The file of the roadmap whose nodes are searched; None without one."""
        if self.source is not None:
            return self.source.file
        return None if self._nodes is None else self._nodes.file

    @property
    def guide(self) -> "Searches | None":
        """The roadmap of the nodes that are searched; None without one."""
        if self.source is not None:
            return self
        return None if self._nodes is None else self._nodes.guide

    @property
    def surfacing(self) -> Surfacing:
        """The scenario's own rule of surfacing."""
        query = self.scenario.query
        return Surfacing() if query is None else Surfacing(query.most_yos, query.most_hours)

    def point(self, values: Point) -> Array:
        """Return a point (3,) [m], given in the coordinates of the domain."""
        return self.scenario.domain.point(values)

    def ends(self, *points: Point | None) -> Ends:
        """Return start and goal [m]; None stands for the scenario's own."""
        start, goal = (None if point is None else self.point(point) for point in points)
        return start, goal

    def origin(self, planner: RoutePlanner) -> Origin:
        """Return what the paths of a planner are planned with."""
        rule, road = planner.rule, self.file
        named = "" if road is None else str(road.absolute())
        what: dict[str, Any] = {"departure": planner.problem.departure, "most_yos": rule.most_yos}
        nodes_only = self.source is None and bool(named)
        return Origin(self.scenario.text, named, nodes_only, most_hours=rule.most_hours, **what)

    def least(self, path: Path, departure: float) -> float:
        """A bound below the cost of every route between a path's ends that leaves at a departure [s]."""
        problem = self.problem
        speeds = self.once(
            ("speeds", departure), GreatestSpeeds, lambda: GreatestSpeeds(problem, self.position, departure)
        )
        return least_cost(speeds, path.start, path.goal, problem.evaluator.cost)
