"""OMPL's planners on this project's exact legs: they are its motions, and their time is the cost.

FMT minimises length: it takes the cost for the distance of its tree of neighbours, where a place stands twice,
and is freed twice, if the cost is no metric. OMPL 2.0.1 does so too, and constructs fewer planners.
"""

import math
import os
import time
from functools import cache
from itertools import pairwise

from harness import JOB, answer, finite, timed
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from glider_stream.kernels.edges import Status
from glider_stream.scenario import read_scenario

ou.setLogLevel(ou.LOG_ERROR)
ou.RNG.setSeed(1)
problem = read_scenario(JOB["scenario"], ["steering.method=flow-map"]).problem()
found, kept = [], []  # the wheel crashes when some of its objects are freed


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
        return ob.Cost(between(a, b))

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
    everywhere, motions = ob.StateValidityCheckerFn(lambda state: True), Legs(info)
    info.setStateValidityChecker(everywhere)
    info.setMotionValidator(motions)
    info.setup()
    start, goal = ob.State(space), ob.State(space)
    for n in range(3):
        start[n], goal[n] = float(problem.start[n]), float(problem.goal[n])
    asked = ob.ProblemDefinition(info)
    asked.setStartAndGoalStates(start, goal)
    cost = ob.PathLengthOptimizationObjective(info) if JOB["planner"] == "FMT" else TravelTime(info)
    asked.setOptimizationObjective(cost)
    planner = getattr(og, JOB["planner"])(info)
    for name, value in JOB["settings"].items():
        getattr(planner, name)(value)
    planner.setProblemDefinition(asked)
    planner.setup()
    latest = time.process_time() + JOB["seconds"]
    over = ob.PlannerTerminationConditionFn(lambda: time.process_time() > latest)
    planner.solve(ob.PlannerTerminationCondition(over))
    kept.append((space, info, everywhere, motions, asked, cost, planner, over, start, goal))
    states = list(asked.getSolutionPath().getStates()) if asked.hasExactSolution() else []
    times = [between(a, b) for a, b in pairwise(states)]
    found.append(sum(times) if times else math.inf)


_, seconds = timed(route)
answer("ompl", seconds, routes_s=finite(found[1:]))
os._exit(0)  # the wheel crashes when Python ends
