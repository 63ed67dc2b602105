"""What a query may ask beyond the cheapest path: a rule of surfacing, a bound on energy, fewer legs, a polish."""

import math
from dataclasses import replace

from ..base.arrays import Array
from ..base.settings import require
from ..roadmap.problem import Problem
from ..roadmap.roadmap import Roadmap
from ..water.inspect import is_steady
from .moves import improve
from .path import SURFACE, Path
from .polish import Polisher
from .query import Planner
from .surfacing import Surfacing, SurfacingPlanner
from .thin import thin
from .trade_off import TradeOff, trade_off

Ends = tuple[Array | None, Array | None]
"""Start and goal (3,) [m]; None for the scenario's own."""


def planner_of(roadmap: Roadmap, problem: Problem, rule: Surfacing) -> Planner:
    """The planner whose paths keep a rule of surfacing."""
    free = rule == Surfacing()
    return Planner(roadmap, problem) if free else SurfacingPlanner(roadmap, problem, rule)


def best_path(
    planner: Planner,
    ends: Ends,
    *,
    most_energy: float | None = None,
    polish: bool = False,
    thinned: float | None = None,
) -> Path:
    """The cheapest path; within `most_energy` [J] the fastest; with `thinned` [m] of fewer legs, where they hold.

    With `polish` its stops are moved until nothing near costs less. InputError where `most_energy` is asked of a
    roadmap that has no energies, or with `polish`.
    """
    both = polish and most_energy is not None
    require(not both, "a route within a bound on energy is not polished: that makes its cost less, not its time")
    path = planner.query(*ends) if most_energy is None else _within(planner, ends, most_energy)
    path = polished(path, planner) if polish else path
    return path if thinned is None else with_fewer_legs(path, thinned, planner, most_energy)


def front(planner: Planner, ends: Ends) -> TradeOff:
    """The paths that are best for some price of time against energy."""
    unit = planner.problem.evaluator.cost.unit
    require(unit == "J", 'the roadmap\'s cost is time, without energy; build it with [cost] kind = "energy"')
    return trade_off(lambda blend: planner.query(*ends, blend=blend))


def _within(planner: Planner, ends: Ends, most_energy: float) -> Path:
    require(most_energy >= 0, f"`most_energy` must be at least 0 J; got {most_energy:g}")
    paths = front(planner, ends)
    within = paths.within(most_energy)
    if within:
        return replace(within, least_time=paths.least_time(most_energy))
    last = paths.paths[-1]
    if not last.found:
        return last
    why = f"the least that one takes is {last.cost:,.0f} J, more than {most_energy:,.0f}"
    return replace(last, cost=math.inf, legs=(), why=why)


def with_fewer_legs(path: Path, tolerance: float, planner: Planner, most_energy: float | None) -> Path:
    """A path thinned, or as it is where fewer legs would break what else was asked for."""
    rule = planner.rule if isinstance(planner, SurfacingPlanner) else Surfacing()
    bound = rule != Surfacing()
    stays = (lambda stop: bool(stop[2] >= -SURFACE)) if bound else (lambda stop: False)
    fewer = thin(path, tolerance, planner.connect, planner.fly, stays)
    keeps = rule.holds(fewer) and (most_energy is None or fewer.cost <= most_energy)
    return fewer if keeps else replace(path, unthinned=fewer.unthinned)


def polished(path: Path, planner: Planner) -> Path:
    """A path with its stops moved, its legs cut and its yos counted anew; as it is where that gains nothing.

    It keeps the planner's rule of surfacing: stops at the surface stay there. InputError in a flow that changes.
    """
    steady = is_steady(planner.problem.evaluator.flow)
    require(steady, "legs of this roadmap hold for one departure, and its current changes: it cannot be polished")
    if not path.legs:
        return path
    rule = planner.rule if isinstance(planner, SurfacingPlanner) else Surfacing()
    bound = rule != Surfacing()
    stays = (lambda stop: bool(stop[2] >= -SURFACE)) if bound else (lambda stop: False)
    polisher = Polisher(planner.problem, stays)
    kept = replace(path, unpolished=(len(path.legs), path.travel_time, path.cost))
    chain = polisher.chain_of(path)
    if chain is None:
        return kept
    better = replace(planner.fly(polisher.hops(improve(polisher, chain))), unpolished=kept.unpolished)
    return better if better.cost < path.cost and rule.holds(better) else kept
