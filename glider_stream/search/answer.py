"""Options of a query beyond the cheapest path: a rule of surfacing, a bound on energy, fewer legs, polishing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..roadmap.builder import node_positions
from ..roadmap.problem import Problem
from ..roadmap.provenance import check_unchanged
from ..roadmap.roadmap import Roadmap
from ..roadmap.slices import SlicedRoadmap
from ..roadmap.store import StoredRoadmap
from ..water.inspect import is_steady
from .assembly import RoutePlanner
from .layered import SurfacingPlanner
from .moves import improve
from .path import SURFACE, Path
from .polish import Polisher
from .query import Planner
from .slice_planner import SlicePlanner
from .sliced import SliceSearch
from .surfacing import Surfacing
from .thin import thin
from .time_dependent import ClockPlanner
from .trade_off import TradeOff

SAME = 1e-6
"""Two departures that differ by less than this [s] count as the same: sums of times have rounding errors."""
Ends = tuple[Array | None, Array | None]
"""Start and goal (3,) [m]; None stands for the start or goal of the scenario."""
Refinement = Callable[[Path, Callable[[Path], Path] | None], Path]
"""A function that refines a path; its second argument, if given, polishes the routes of each round."""


def planner_of(
    problem: Problem,
    roadmap: Roadmap | SlicedRoadmap | None,
    rule: Surfacing,
    nodes: Array | None = None,
) -> RoutePlanner:
    """Return the planner for a roadmap, or for `nodes` (n, 3) [m] if `roadmap` is None; its paths keep `rule`.

    Without `nodes` they are the scenario's.

    In a flow that changes with time the clock runs, unless the problem is `frozen`. Then the planner uses the
    slices of the roadmap; if the roadmap has no slices, it uses only the nodes.
    """
    if isinstance(roadmap, SlicedRoadmap):
        if not problem.frozen:
            return SlicePlanner(problem, SliceSearch(roadmap, problem), rule)
        roadmap = _slice_of(roadmap, problem.departure)
    if roadmap is None:
        return ClockPlanner(problem, node_positions(problem) if nodes is None else nodes, rule, problem.frozen)
    if not is_steady(problem.evaluator.flow) and not problem.frozen:
        check_unchanged(roadmap, problem)
        return ClockPlanner(problem, roadmap.position, rule)
    return Planner(roadmap, problem) if rule == Surfacing() else SurfacingPlanner(roadmap, problem, rule)


def planner_on_demand(problem: Problem, roadmap: StoredRoadmap, rule: Surfacing) -> RoutePlanner | None:
    """Return the planner for a roadmap that stays in its file; None if all its edges are needed."""
    if not is_steady(problem.evaluator.flow) and not problem.frozen:
        if roadmap.departures is not None:
            return SlicePlanner(problem, SliceSearch(roadmap, problem), rule)
        check_unchanged(roadmap, problem)
        return ClockPlanner(problem, roadmap.position, rule)
    whole = roadmap.departures is not None or rule != Surfacing()
    return None if whole else Planner(roadmap, problem)


def _slice_of(roadmap: SlicedRoadmap, departure: float) -> Roadmap:
    """Return the slice of a departure [s]; InputError if the roadmap has no slice at that time."""
    number = np.flatnonzero(np.abs(roadmap.departures - departure) < SAME)
    times = ", ".join(f"{time:g}" for time in roadmap.departures[:20])
    what = (
        f"frozen paths take every leg as at `query.departure` = {departure:g} s, which is no slice of the roadmap"
    )
    require(number.size == 1, f"{what}; choose one of: {times} s, or leave `query.frozen` out")
    return roadmap.at(int(number[0]))


def best_path(
    planner: RoutePlanner,
    ends: Ends,
    *,
    most_energy: float | None = None,
    polish: bool = False,
    refine: Refinement | None = None,
    thinned: float | None = None,
) -> Path:
    """Return the cheapest path, or with `most_energy` [J] the fastest path that uses no more energy.

    With `thinned` [m] the path gets fewer legs where these can be flown. With `polish` its stops are moved until
    no route near it costs less. `refine` adds nodes where they can help. InputError if `most_energy` is given and
    the roadmap has no energies, or if `most_energy` is given together with `polish` or `refine`.
    """
    for asked, done in ((polish, "polished"), (refine is not None, "refined")):
        both = asked and most_energy is not None
        require(
            not both, f"a route within a bound on energy is not {done}: that makes its cost less, not its time"
        )
    if most_energy is None:
        path = planner.query(*ends)
    else:
        require(most_energy >= 0, f"`most_energy` must be at least 0 J; got {most_energy:g}")
        _check_energy(planner)
        path = planner.within(*ends, most_energy)
    notes = path.notes
    if refine is not None:
        path = refine(path, (lambda route: polished(route, planner)) if polish else None)
    elif polish:
        path = polished(path, planner)
    path = path if thinned is None else with_fewer_legs(path, thinned, planner, most_energy)
    return replace(path, notes=notes)


def front(planner: RoutePlanner, ends: Ends) -> TradeOff:
    """Return every path for which no other path is better both in time and in energy."""
    _check_energy(planner)
    return planner.front(*ends)


def _check_energy(planner: RoutePlanner) -> None:
    unit = planner.problem.evaluator.cost.unit
    cure = 'plan, or build the roadmap, with [cost] kind = "energy"'
    require(unit == "J", f"the cost is time, without energy; {cure}")


def with_fewer_legs(path: Path, tolerance: float, planner: RoutePlanner, most_energy: float | None) -> Path:
    """Return the path with fewer legs; unchanged if these break the rule of surfacing or the bound on energy."""
    rule = planner.rule
    bound = rule != Surfacing()
    stays = (lambda stop: bool(stop[2] >= -SURFACE)) if bound else (lambda stop: False)
    fewer = thin(path, tolerance, planner.connect, planner.fly, stays)
    keeps = rule.holds(fewer) and (most_energy is None or fewer.cost <= most_energy)
    return fewer if keeps else replace(path, unthinned=fewer.unthinned)


def polished(path: Path, planner: RoutePlanner) -> Path:
    """Return the path with moved stops, cut legs and another number of yos; unchanged if that gains nothing.

    Stops at the surface stay there if there is a rule of surfacing. They also stay there in a geographic
    scenario, because a vehicle's files are made from them.
    """
    if not path.legs:
        return path
    problem, rule = planner.problem, planner.rule
    bound = rule != Surfacing()
    fixed = bound or problem.to_lonlat is not None
    stays = (lambda stop: bool(stop[2] >= -SURFACE)) if fixed else (lambda stop: False)
    polisher = Polisher.of(problem, path, stays=stays, frozen=planner.assembly.frozen, single_yos=not bound)
    kept = replace(path, unpolished=(len(path.legs), path.travel_time, path.cost))
    chain = polisher.chain_of(path)
    if chain is None:
        return kept
    better = planner.fly(polisher.hops(improve(polisher, chain)))
    better = replace(better, unpolished=kept.unpolished, expanded=path.expanded, rounds=path.rounds)
    return better if better.cost < path.cost and rule.holds(better) else kept
