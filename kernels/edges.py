"""Edges: what determines an edge, the status of a pair, and quick checks before any control is flown."""

import math
from enum import IntEnum
from typing import NamedTuple

from .cache import inlined, kernel
from .control import Polar, direction_of, vertical_speed
from .cost import CostRates
from .flow import Array, Flow, contains, max_rise
from .motion import Integration
from .terrain import Terrain


class Status(IntEnum):
    """The result of the evaluation of a pair; every evaluated pair has exactly one status."""

    CONNECTED = 0
    SAME_DEPTH = 1
    CURRENT_TOO_STRONG = 2
    TOO_FAR = 3
    NO_HIT = 4
    BLOCKED = 5
    OUTSIDE_FLOW = 6
    CARRIED_AWAY = 7


CONNECTED = int(Status.CONNECTED)
SAME_DEPTH = int(Status.SAME_DEPTH)
CURRENT_TOO_STRONG = int(Status.CURRENT_TOO_STRONG)
TOO_FAR = int(Status.TOO_FAR)
NO_HIT = int(Status.NO_HIT)
BLOCKED = int(Status.BLOCKED)
OUTSIDE_FLOW = int(Status.OUTSIDE_FLOW)
CARRIED_AWAY = int(Status.CARRIED_AWAY)

CLEARANCE_SPACING = 5.0
"""A leg is checked for land and seabed at places this far apart [m]."""


class Medium(NamedTuple):
    """Everything that determines an edge, except its ends and the steering."""

    flow: Flow
    terrain: Terrain
    polar: Polar
    integration: Integration
    cost: CostRates


class Edge(NamedTuple):
    """A pair's outcome: status; time [s], cost, signed glide angle, heading [rad], speed [m/s], miss [m]."""

    status: int
    time: float
    cost: float
    glide_angle: float
    heading: float
    speed: float
    miss: float


STATUS, TIME, COST, GLIDE_ANGLE, HEADING, SPEED, MISS = range(len(Edge._fields))
"""Columns of an outcome; they are the fields of `Edge`."""
EDGE_COLUMNS = len(Edge._fields)


@inlined
def no_edge(status):
    """Return an edge that does not exist, with the status that says why."""
    return Edge(status, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


@inlined
def store(row, edge):
    """Write the fields of an edge into `row` (EDGE_COLUMNS,)."""
    row[STATUS] = edge.status
    row[TIME] = edge.time
    row[COST] = edge.cost
    row[GLIDE_ANGLE] = edge.glide_angle
    row[HEADING] = edge.heading
    row[SPEED] = edge.speed
    row[MISS] = edge.miss


def edge_of(row: Array) -> Edge:
    """Return the `Edge` of an outcome, for Python code."""
    return Edge(int(row[STATUS]), *(float(value) for value in row[TIME:]))


@kernel
def quick_status(medium, pair):
    """Return the status of a pair that is known before any control is tried; CONNECTED if nothing forbids it."""
    flow, polar, integration = medium.flow, medium.polar, medium.integration
    p, q = pair
    if not (contains(flow, p.x, p.y, p.t) and contains(flow, q.x, q.y, p.t)):
        return OUTSIDE_FLOW
    if p.z == q.z:
        return SAME_DEPTH
    direction = direction_of(pair)
    horizon = integration.steps * integration.dt
    fastest = vertical_speed(polar, direction, polar.steepest[direction]) + max_rise(flow)
    if fastest * horizon < abs(q.z - p.z):
        return TOO_FAR
    reach = (polar.best_horizontal[direction] + flow.extent.max_speed) * horizon + integration.tolerance
    if math.hypot(q.x - p.x, q.y - p.y) > reach:
        return TOO_FAR
    return CONNECTED
