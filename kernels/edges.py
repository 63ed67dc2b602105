"""Edges: what decides one, what becomes of a pair, what can be told of it before any control is flown."""

import math
from enum import IntEnum
from typing import NamedTuple

from .cache import inlined, kernel
from .control import Polar, vertical_speed
from .cost import Cost
from .flow import Flow, contains
from .motion import Integration
from .terrain import Terrain


class Status(IntEnum):
    """What became of a pair; every evaluated pair has exactly one."""

    CONNECTED = 0
    SAME_DEPTH = 1
    CURRENT_TOO_STRONG = 2
    TOO_FAR = 3
    NO_HIT = 4
    BLOCKED = 5
    OUTSIDE_FLOW = 6


CONNECTED = int(Status.CONNECTED)
SAME_DEPTH = int(Status.SAME_DEPTH)
CURRENT_TOO_STRONG = int(Status.CURRENT_TOO_STRONG)
TOO_FAR = int(Status.TOO_FAR)
NO_HIT = int(Status.NO_HIT)
BLOCKED = int(Status.BLOCKED)
OUTSIDE_FLOW = int(Status.OUTSIDE_FLOW)

CLEARANCE_SPACING = 5.0
"""How closely [m] a leg is looked at for land and seabed."""


class Medium(NamedTuple):
    """Everything that decides an edge but its ends and the steering."""

    flow: Flow
    terrain: Terrain
    polar: Polar
    integration: Integration
    cost: Cost


class Edge(NamedTuple):
    """A pair's outcome: status; time [s], cost, signed glide angle, heading [rad], speed [m/s], miss [m]."""

    status: int
    time: float
    cost: float
    glide_angle: float
    heading: float
    speed: float
    miss: float


@inlined
def no_edge(status):
    """An edge that is not there, and why."""
    return Edge(status, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


@inlined
def store(row, edge):
    """The fields of an edge into `row` (7,)."""
    row[0] = edge.status
    row[1] = edge.time
    row[2] = edge.cost
    row[3] = edge.glide_angle
    row[4] = edge.heading
    row[5] = edge.speed
    row[6] = edge.miss


@kernel
def quick_status(medium, direction, x_p, y_p, z_p, x_q, y_q, z_q, t):
    """What can be told of a pair before any control is looked at; CONNECTED where nothing forbids it."""
    flow, polar, integration = medium.flow, medium.polar, medium.integration
    if not (contains(flow, x_p, y_p, t) and contains(flow, x_q, y_q, t)):
        return OUTSIDE_FLOW
    if z_p == z_q:
        return SAME_DEPTH
    horizon = integration.steps * integration.dt
    if vertical_speed(polar, direction, polar.steepest[direction]) * horizon < abs(z_q - z_p):
        return TOO_FAR
    reach = (polar.best_horizontal[direction] + flow.max_speed) * horizon + integration.tolerance
    if math.hypot(x_q - x_p, y_q - y_p) > reach:
        return TOO_FAR
    return CONNECTED
