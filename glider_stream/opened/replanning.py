"""Plans made anew from a fix."""

import tomllib
from collections.abc import Sequence
from pathlib import Path as File
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Array, Bools
from ..base.clock import moment
from ..base.nearest import tree_of
from ..base.settings import require
from ..pilot.replan import Replan, compared, good_until_of, shown
from ..pilot.slocum import RADIUS
from ..roadmap.problem import Problem
from ..roadmap.roadmap import Roadmap
from ..roadmap.slices import SlicedRoadmap
from ..scenario import with_currents
from ..search.assembly import RoutePlanner
from ..search.departures import Moment, seconds
from ..search.flown_on import check_currents, check_plan, check_smooth, flown_on
from ..search.path import SURFACE, Path, load_plan, placed
from ..search.query import Planner
from ..search.surfacing import Surfacing
from ..search.time_dependent import ClockPlanner
from ..water.domain import GeographicDomain, domain_from_table
from .routes import exported, routed, split_outputs
from .searches import Nodes, Searches

LATEST_FIX = 366 * 86_400.0
"""A fix is at most so long [s] after its plan's departure; seconds since 1970, say, are not the flow's."""
NEAR = 0.03, 0.1
"""A replan with the clock running searches the nodes on ways at most this share longer than the best way, by the
legs of a roadmap, which are those of another time. Among 38,000 nodes of the Ionian Sea these are thousands. The
second share is for when the first finds no route, or one that passes nodes of more than half the share."""
WRITING = "window_hours", "most_waypoints", "arrival_radius"
"""The options of route files."""


class Fix(NamedTuple):
    """Where and when a vehicle surfaced."""

    place: Array
    """(3,) [m]."""
    since: float
    """[s] since the departure of the old plan."""
    before: Problem
    """The old plan's water, for gliders that leave at the fix."""
    leaves: Problem
    """The new plan's water, for gliders that leave at the fix."""


def replanned(
    searches: Searches,
    path: str | File | Path,
    fix: tuple[float, float],
    time: Moment,
    *,
    dac: tuple[float, float] | None,
    currents: str | File | Sequence[str | File] | None,
    tolerance: float,
    surfacing: Surfacing | None,
    arrival_radius: float | None,
    all_nodes: bool,
    **options: Any,
) -> Replan:
    """Return a new plan from a position fix to the goal of an old plan; see `OpenedScenario.replan`."""
    old = path if isinstance(path, Path) else load_plan(path)
    require(len(old.legs) > 0, "the plan holds no leg, so nothing is left to be planned anew; plan a route first")
    require(0 <= tolerance < np.inf, f"the tolerance must be from 0 % up; got {tolerance:.0%}")
    # a newer forecast is often written over the older one, whose currents are then no more known
    before, since = at_fix(searches, old, time, renewed=currents is not None and old.origin is not None)
    place = searches.point((*fix, 0.0))
    now = searches if currents is None else _renewed(searches, currents, before, place, old.goal)
    leaves = before if currents is None else now.problem
    check_moment(leaves, "fix", "name newer currents with --currents")
    leaves.check_point(place, "fix")
    radius = _radius(searches, old.goal, arrival_radius)
    if arrival_radius is not None:
        options["arrival_radius"] = arrival_radius
    arrived = float(np.linalg.norm(place - old.goal)) <= radius
    planner = now.leaving(leaves.departure, _rule_of(old) if surfacing is None else surfacing)
    new, planner, notes = _anew(now, planner, (place, place if arrived else old.goal), all_nodes, options)
    old = placed(old, before.leaving(-since))
    flown = flown_on(old, since, place, leaves)
    current = None
    if dac is not None:
        current = compared(np.array(dac), old, since, place, (leaves, before), new, tolerance)
    good = None if arrived else good_until_of(flown, new, planner, radius, tolerance)
    return Replan(new, old, since, place, flown, good, current, radius, arrived, leaves, notes)


def _anew(
    searches: Searches, planner: RoutePlanner, ends: tuple[Array, Array], all_nodes: bool, options: dict[str, Any]
) -> tuple[Path, RoutePlanner, tuple[str, ...]]:
    """Return a new route, its planner and notes: among the nodes near the best ways, else among all."""
    writing = {name: value for name, value in options.items() if name in WRITING}
    finding = {name: value for name, value in options.items() if name not in WRITING}
    refines = finding.get("within") is not None or finding.get("seconds") is not None
    files, finding["outputs"] = split_outputs(finding.get("outputs", ()), refines)
    new, among, said = _found(searches, planner, ends, all_nodes, finding)
    new = exported(new, files, **writing)
    return new, among, (*new.notes, *said)


def _found(
    searches: Searches, planner: RoutePlanner, ends: tuple[Array, Array], all_nodes: bool, finding: dict[str, Any]
) -> tuple[Path, RoutePlanner, tuple[str, ...]]:
    """Return a new route, its planner, and which nodes were searched; no route file is written."""
    every = all_nodes or type(planner) is not ClockPlanner
    longer = np.zeros(len(searches.position)) if every else _longer(searches, *ends)
    for share in NEAR:
        near: Bools = longer <= share
        if near.all():
            break
        nodes = np.ascontiguousarray(searches.position[near])
        among = ClockPlanner(planner.problem, nodes, planner.rule, planner.assembly.frozen)
        new = routed(searches, among, ends, **finding)
        inside = new.found and _stays_within(new, searches.position, longer, share / 2)
        if inside or (new.found and share == NEAR[-1]):
            return new, among, (_told(int(near.sum()), near.size, share, inside),)
    return routed(searches, planner, ends, **finding), planner, ()


def _told(searched: int, nodes: int, share: float, inside: bool) -> str:
    """Return a note on which nodes were searched, and whether that may matter."""
    far = f"ways at most {share:.0%} longer than the best, by the roadmap's legs"
    edge = "the route comes near their edge, so a better one may lie beyond"
    keeps = "the route keeps well inside these" if inside else edge
    some = f"to be quick, only the {searched:,} nodes on {far}, were searched"
    return f"{some}; {keeps}; --all-nodes takes all {nodes:,}"


def _stays_within(path: Path, position: Array, longer: Array, share: float) -> bool:
    """Return whether the nodes (n, 3) [m] at a path's stops lie on ways at most a share `longer` (n,) than the
    best."""
    stops = np.array([leg.end for leg in path.legs[:-1]]).reshape(-1, 3)
    return bool((longer[tree_of(position).query(stops)[1]] <= share).all())


def _longer(searches: Searches, start: Array, goal: Array) -> Array:
    """Return by which share (n,) the ways through each node are longer than the best, by the legs of a roadmap.

    Zeros if no roadmap has legs of one departure, or if they lead to no way.
    """
    guide = searches.guide
    if guide is None:
        return np.zeros(len(searches.position))
    road, legs_of = guide.road, guide.problem
    assert road is not None
    by_legs = guide.once("guide", Planner, lambda: Planner(_one_slice(road), legs_of))
    through = by_legs.arrivals(start) + by_legs.remaining(goal)
    best = float(through.min(initial=np.inf))
    return through / best - 1 if 0 < best < np.inf else np.zeros(through.size)


def at_fix(searches: Searches, old: Path, time: Moment, renewed: bool) -> tuple[Problem, float]:
    """Return the problem for gliders that leave at a fix, and the time [s] since the departure of an old
    plan.

    InputError if the plan is not one of this problem, or if the fix is before its departure. `renewed`: the
    currents of the plan may have changed since.
    """
    problem = searches.problem
    if old.origin is not None:
        same = domain_from_table(tomllib.loads(old.origin.scenario).get("domain", {})) == searches.scenario.domain
        require(same, "the plan was made in another [domain], so its places are others; give its own scenario")
    began = problem.departure if old.departure is None else old.departure
    began = began if old.origin is None else old.origin.departure
    leaving = problem.leaving(began - problem.departure)
    check_plan(old, leaving)
    if not renewed:
        check_moment(leaving, "the plan's departure", "give the currents that it was planned with")
        check_currents(old, leaving)
    elif leaving.to_lonlat is not None:
        check_smooth(old)
    since = seconds(time, problem, "fix") - began
    if since < 0:
        left = f"{began:,.0f} s" if leaving.departs is None else moment(leaving.departs, 0.0)
        require(False, f"the fix's time {time} is before the plan's departure, {left}; give the time of the fix")
    require(
        since <= LATEST_FIX,
        f"the fix's time {time} is {since / 86_400:,.0f} days after the plan's departure, more than "
        f"{LATEST_FIX / 86_400:g}; give a date, or seconds as the scenario counts them",
    )
    return leaving.leaving(since), since


def _radius(searches: Searches, goal: Array, arrival_radius: float | None) -> float:
    """Return the distance [m] at which a goal counts as reached: a list's for places that surface, else a
    leg's."""
    if arrival_radius is not None:
        require(0 <= arrival_radius < np.inf, f"the arrival radius must be 0 m or more; got {arrival_radius:g}")
        return arrival_radius
    listed = isinstance(searches.scenario.domain, GeographicDomain) and goal[2] >= -SURFACE
    return float(RADIUS if listed else searches.problem.evaluator.integration.tolerance)


def _renewed(
    searches: Searches, currents: str | File | Sequence[str | File], before: Problem, start: Array, goal: Array
) -> Searches:
    """Return the same scenario and nodes in newer currents, for gliders that leave as in `before`."""
    files = [currents] if isinstance(currents, str | File) else list(currents)
    ends = {name: shown(place, before) for name, place in (("start", start), ("goal", goal))}
    query: dict[str, Any] = {**ends, "departure": before.departure}
    if before.departs is not None:
        query |= {"departure": 0.0, "epoch": before.departs.replace(tzinfo=None).isoformat()}
    nodes = Nodes(searches.position, searches.file, searches.guide)
    return Searches(with_currents(searches.scenario, files, query), nodes=nodes)


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


def _one_slice(road: Roadmap | SlicedRoadmap) -> Roadmap:
    """Return a roadmap of one departure, the first of several."""
    return road.at(0) if isinstance(road, SlicedRoadmap) else road
