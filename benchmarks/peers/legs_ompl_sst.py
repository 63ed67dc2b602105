"""OMPL's SST: a control is a glide and a heading, held for 30 to 200 s; this project's legs fly it.

The clock is the state's second part, of weight 0, and the cost. The tree ends within 30 m of the goal; the exact
leg from there is added. OMPL 2.0.1 does not construct SST.
"""

import math
import os
import time

import numpy as np
from harness import JOB, answer, finite, timed
from ompl import base as ob
from ompl import control as oc
from ompl import util as ou

from glider_stream.kernels.edges import Status
from glider_stream.kernels.legs import fly_legs
from glider_stream.scenario import read_scenario

ou.setLogLevel(ou.LOG_ERROR)
ou.RNG.setSeed(1)
problem = read_scenario(JOB["scenario"], ["steering.method=flow-map"]).problem()
flow, polar, dt = problem.evaluator.flow, problem.evaluator.polar, problem.evaluator.integration.dt
found, kept, end = [], [], np.empty((1, 3))  # kept: the wheel crashes when some of its objects are freed


def propagate(state, control, lasting, result):
    way = int(control[0] > 0.0)
    low, high = polar.shallowest[way], polar.steepest[way]
    angle = low + abs(control[0]) * (high - low)
    speed = np.interp(angle, np.linspace(low, high, polar.speed.shape[1]), polar.speed[way])
    level, rise = speed * math.cos(angle), (2 * way - 1) * speed * math.sin(angle)
    at, clock = state[0], state[1][0]
    through = np.array([[level * math.cos(control[1]), level * math.sin(control[1]), rise]])
    begin = np.array([[at[0], at[1], at[2], problem.departure + clock]])
    height = np.array([at[2] + rise * lasting])
    fly_legs(flow, begin, through, np.array([lasting]), height, lasting, dt, end, 0, 1)
    result[0][0], result[0][1], result[0][2] = end[0, 0], end[0, 1], height[0]
    result[1][0] = clock + lasting


class Clock(ob.OptimizationObjective):
    def stateCost(self, state):
        return ob.Cost(0.0)

    def motionCost(self, a, b):
        return ob.Cost(b[1][0] - a[1][0])


def box(space, low, high):
    bounds = ob.RealVectorBounds(len(low))
    for n, ends in enumerate(zip(low, high, strict=True)):
        bounds.setLow(n, float(ends[0]))
        bounds.setHigh(n, float(ends[1]))
    space.setBounds(bounds)


def route():
    places, clock, space = ob.RealVectorStateSpace(3), ob.RealVectorStateSpace(1), ob.CompoundStateSpace()
    box(places, problem.lo, problem.hi)
    box(clock, [0.0], [1e5])
    space.addSubspace(places, 1.0)
    space.addSubspace(clock, 0.0)
    controls = oc.RealVectorControlSpace(space, 2)
    box(controls, [-1.0, -math.pi], [1.0, math.pi])
    info = oc.SpaceInformation(space, controls)
    valid, fly = ob.StateValidityCheckerFn(space.satisfiesBounds), oc.StatePropagatorFn(propagate)
    info.setStateValidityChecker(valid)
    info.setStatePropagator(fly)
    info.setPropagationStepSize(10.0)
    info.setMinMaxControlDuration(3, 20)
    info.setup()
    start, goal = ob.State(space), ob.State(space)
    for n in range(3):
        start()[0][n], goal()[0][n] = float(problem.start[n]), float(problem.goal[n])
    start()[1][0] = goal()[1][0] = 0.0
    asked = ob.ProblemDefinition(info)
    asked.setStartAndGoalStates(start, goal, 30.0)
    cost = Clock(info)
    asked.setOptimizationObjective(cost)
    planner = oc.SST(info)
    for name, value in JOB["settings"].items():
        getattr(planner, name)(value)
    planner.setProblemDefinition(asked)
    planner.setup()
    latest = time.process_time() + JOB["seconds"]
    over = ob.PlannerTerminationConditionFn(lambda: time.process_time() > latest)
    planner.solve(ob.PlannerTerminationCondition(over))
    kept.append((space, controls, info, valid, fly, asked, cost, planner, over, start, goal))
    found.append(math.inf)
    if asked.hasExactSolution():
        last = list(asked.getSolutionPath().getStates())[-1]
        edge = problem.evaluator.connect_pair([last[0][n] for n in range(3)], problem.goal, problem.departure)
        found[-1] = last[1][0] + edge.time if edge.status == Status.CONNECTED else math.inf


_, seconds = timed(route)
answer("ompl", seconds, routes_s=finite(found[1:]))
os._exit(0)  # the wheel crashes when Python ends
