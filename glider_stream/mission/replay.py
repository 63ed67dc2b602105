"""A flown run as a path, for the drawings and the page that show paths."""

import math

import numpy as np

from ..roadmap.problem import Problem
from ..search.path import Leg, Path
from ..water.inspect import is_steady
from .run import Flight


def path_of(flight: Flight, problem: Problem) -> Path:
    """Return the path that a run has flown: its dives, climbs and drifts as legs; `miss` is NaN.

    `problem` is the problem of the true current.
    """
    start = problem.departure
    legs = []
    for phase in flight.phases:
        rows = phase.rows - [start, 0.0, 0.0, 0.0]
        begin, end = (np.ascontiguousarray(row[1:]) for row in (rows[0], rows[-1]))
        times = float(rows[0, 0]), float(rows[-1, 0] - rows[0, 0])
        legs.append(Leg(begin, end, phase.glide_angle, phase.heading, phase.speed, *times, math.nan, rows))
    begin, end = (np.empty(3), np.empty(3)) if not legs else (legs[0].start, legs[-1].end)
    departure = None if is_steady(problem.evaluator.flow) else start
    return Path(begin, end, flight.outcome.time, tuple(legs), departs=problem.departs, departure=departure)
