"""Edges: is there a control from p to q? One pair, one node's targets, many nodes."""

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from .cache import entry_point
from .control import (
    CLIMB,
    DIVE,
    NO_CONTROL,
    Polar,
    candidate_controls,
    control_towards,
    vertical_speed,
)
from .cost import edge_cost
from .flow import Flow, contains
from .motion import Integration, arrival_window, closest_approach, is_clear
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
    """Everything that decides an edge but its ends and the steering: flow, terrain, glide polar, integration."""

    flow: Flow
    terrain: Terrain
    polar: Polar
    integration: Integration


class Edge(NamedTuple):
    """A pair's outcome: status; time [s], cost, signed glide angle, heading [rad], speed [m/s], miss [m]."""

    status: int
    time: float
    cost: float
    glide_angle: float
    heading: float
    speed: float
    miss: float


@njit(inline="always")
def no_edge(status):
    """An edge that is not there, and why."""
    return Edge(status, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


@njit(inline="always")
def store(row, edge):
    """The fields of an edge into `row` (7,)."""
    row[0] = edge.status
    row[1] = edge.time
    row[2] = edge.cost
    row[3] = edge.glide_angle
    row[4] = edge.heading
    row[5] = edge.speed
    row[6] = edge.miss


@njit
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


@njit
def connect(medium, steering, x_p, y_p, z_p, x_q, y_q, z_q, t, controls):
    """The cheapest leg from p, left at t [s], to q among the candidate controls (scratch: `controls`)."""
    flow, polar, integration = medium.flow, medium.polar, medium.integration
    direction = CLIMB if z_q > z_p else DIVE
    status = quick_status(medium, direction, x_p, y_p, z_p, x_q, y_q, z_q, t)
    if status != CONNECTED:
        return no_edge(status)
    slowest = abs(z_q - z_p) / (integration.steps * integration.dt)
    count = candidate_controls(
        steering, flow, polar, direction, x_p, y_p, z_p, x_q, y_q, z_q, t, slowest, controls
    )
    if count == NO_CONTROL:
        return no_edge(CURRENT_TOO_STRONG)
    if count == 0:
        return no_edge(TOO_FAR)
    best = no_edge(NO_HIT)
    for n in range(count):
        c = control_towards(polar, direction, controls[n, 0], controls[n, 1])
        first, _ = arrival_window(c.w, z_q - z_p, integration.tolerance)
        # controls come in order of arrival: from here on all are dearer
        if best.status == CONNECTED and edge_cost(first) >= best.cost:
            break
        miss, time = closest_approach(flow, x_p, y_p, z_p, t, c.u, c.v, c.w, x_q, y_q, z_q, integration)
        if miss >= integration.tolerance or (best.status == CONNECTED and edge_cost(time) >= best.cost):
            continue
        terrain = medium.terrain
        if is_clear(flow, terrain, x_p, y_p, z_p, t, c.u, c.v, c.w, time, integration.dt, CLEARANCE_SPACING):
            best = Edge(CONNECTED, time, edge_cost(time), c.glide_angle, c.heading, c.speed, miss)
        elif best.status == NO_HIT:
            best = no_edge(BLOCKED)
    return best


@njit
def connect_node(medium, steering, position, departure, node, targets, edges):
    """All targets of one source node, into rows of `edges` (targets, fields of Edge)."""
    controls = np.empty((steering.candidates, 2))
    x_p, y_p, z_p = position[node]
    for n in range(targets.size):
        x_q, y_q, z_q = position[targets[n]]
        store(edges[n], connect(medium, steering, x_p, y_p, z_p, x_q, y_q, z_q, departure[node], controls))


@entry_point(nogil=True)
def connect_nodes(medium, steering, position, departure, source, indptr, target, edges, first, last):
    """All targets of source[first:last], CSR by source in `indptr` (n + 1,) and `target` (pairs,).

    `position` (nodes, 3) [m], `departure` (nodes,) [s]; outcomes into `edges` (pairs, fields of Edge).
    """
    for n in range(first, last):
        row = slice(indptr[n], indptr[n + 1])
        connect_node(medium, steering, position, departure, source[n], target[row], edges[row])
