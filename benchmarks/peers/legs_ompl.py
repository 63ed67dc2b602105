"""OMPL's FMT on this project's exact legs: they are its motions, and their time is the cost.

300 samples in its box; a motion exists where a leg does. `timedPlannerTerminationCondition` of the 2.0.1 wheel
waits for ever while Python checks motions, so the planner is one that ends by itself.
"""

import math
from functools import cache
from itertools import pairwise

from harness import JOB, answer, finite, timed
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from glider_stream.kernels.edges import Status
from glider_stream.scenario import read_scenario

ou.setLogLevel(ou.LogLevel.LOG_ERROR)
problem = read_scenario(JOB["scenario"], ["steering.method=flow-map"]).problem()
found = []


@cache
def leg_time(start, end):
    edge = problem.evaluator.connect_pair(start, end, problem.departure)
    return edge.time if edge.status == Status.CONNECTED else math.inf


def between(a, b):
    return leg_time((a[0], a[1], a[2]), (b[0], b[1], b[2]))


class Legs(ob.MotionValidator):
    def checkMotion(self, a, b, *more):
        return math.isfinite(between(a, b))


class TravelTime(ob.OptimizationObjective):
    def stateCost(self, state):
        return ob.Cost(0.0)

    def motionCost(self, a, b):
        return ob.Cost(min(between(a, b), 1e9))

    def isSymmetric(self):
        return False


def route():
    leg_time.cache_clear()
    space, bounds = ob.RealVectorStateSpace(3), ob.RealVectorBounds(3)
    for n in range(3):
        bounds.setLow(n, float(problem.lo[n]))
        bounds.setHigh(n, float(problem.hi[n]))
    space.setBounds(bounds)
    info = ob.SpaceInformation(space)
    info.setStateValidityChecker(lambda state: True)
    validator, objective = Legs(info), TravelTime(info)
    info.setMotionValidator(validator)
    info.setup()
    start, goal = space.allocState(), space.allocState()
    for n in range(3):
        start[n], goal[n] = float(problem.start[n]), float(problem.goal[n])
    asked = ob.ProblemDefinition(info)
    asked.setStartAndGoalStates(start, goal)
    asked.setOptimizationObjective(objective)
    planner = og.FMT(info)
    planner.setNumSamples(300)
    planner.setProblemDefinition(asked)
    planner.setup()
    planner.solve(ob.plannerNonTerminatingCondition())
    way = asked.getSolutionPath()
    states = way.getStates() if way else []
    times = [between(a, b) for a, b in pairwise(states)]
    found.append(sum(times) if times else math.inf)


_, seconds = timed(route)
answer("ompl", seconds, routes_s=finite(found[1:]))
