"""Which planner answers: over a roadmap's legs where these hold at any time, else with the clock running."""

from ..roadmap.builder import node_positions
from ..roadmap.problem import Problem
from ..roadmap.provenance import check_unchanged
from ..roadmap.roadmap import Roadmap
from ..water.inspect import is_steady
from .layered import SurfacingPlanner
from .query import Planner
from .surfacing import Surfacing
from .time_dependent import ClockPlanner

AnyPlanner = Planner | ClockPlanner


def planner_of(problem: Problem, road: Roadmap | None, rule: Surfacing) -> AnyPlanner:
    """A planner whose paths keep a rule, over a roadmap, or over the scenario's nodes where there is none.

    In a flow that changes a roadmap gives its nodes alone, but where the problem is `frozen`.
    """
    if road is None:
        return ClockPlanner(problem, node_positions(problem), rule, problem.frozen)
    if not is_steady(problem.evaluator.flow) and not problem.frozen:
        check_unchanged(road, problem)
        return ClockPlanner(problem, road.position, rule)
    return Planner(road, problem) if rule == Surfacing() else SurfacingPlanner(road, problem, rule)
