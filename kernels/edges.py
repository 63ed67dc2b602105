"""Edges: is there a control from p to q? One pair, one node's targets, all nodes in parallel."""

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit, prange

from .cache import entry_point
from .control import (
    CLIMB,
    DIVE,
    NO_CONTROL,
    candidate_controls,
    control_towards,
    vertical_speed,
)
from .cost import edge_cost
from .fan import fan_guesses
from .flow import contains
from .motion import LANE_ROWS, LANES, arrival_window, closest_approach, is_clear, stays_inside
from .steer import steer_lanes


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
MAX_TRIES = 12
"""Guesses that are polished for one target."""
FAN_STEP = 2.0
"""Steps of a fan, in steps of a leg: it gives first guesses."""
INSIDE = 1e-9
"""A guess this little outside its triangle is inside."""


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


@njit
def quick_status(flow, polar, direction, x_p, y_p, z_p, x_q, y_q, z_q, t, integration):
    """What can be told of a pair before any control is looked at; CONNECTED where nothing forbids it."""
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
def connect(flow, terrain, polar, steering, integration, x_p, y_p, z_p, x_q, y_q, z_q, t, controls):
    """The cheapest leg from p, left at t [s], to q among the candidate controls (scratch: `controls`)."""
    direction = CLIMB if z_q > z_p else DIVE
    status = quick_status(flow, polar, direction, x_p, y_p, z_p, x_q, y_q, z_q, t, integration)
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
        if is_clear(flow, terrain, x_p, y_p, z_p, t, c.u, c.v, c.w, time, integration.dt, CLEARANCE_SPACING):
            best = Edge(CONNECTED, time, edge_cost(time), c.glide_angle, c.heading, c.speed, miss)
        elif best.status == NO_HIT:
            best = no_edge(BLOCKED)
    return best


@njit
def connect_node(flow, terrain, polar, steering, integration, position, departure, node, targets, edges):
    """All targets of one source node, into rows of `edges` (targets, fields of Edge)."""
    controls = np.empty((steering.candidates, 2))
    x_p, y_p, z_p = position[node]
    for n in range(targets.size):
        x_q, y_q, z_q = position[targets[n]]
        edge = connect(
            flow,
            terrain,
            polar,
            steering,
            integration,
            x_p,
            y_p,
            z_p,
            x_q,
            y_q,
            z_q,
            departure[node],
            controls,
        )
        _store(edges, n, edge)


@njit(inline="always")
def _store(edges, n, edge):
    edges[n] = (
        float(edge.status),
        edge.time,
        edge.cost,
        edge.glide_angle,
        edge.heading,
        edge.speed,
        edge.miss,
    )


@entry_point(parallel=True)
def connect_all(flow, terrain, polar, steering, integration, position, departure, source, indptr, target):
    """All targets of the nodes `source` (n,), CSR by source in `indptr` (n + 1,) and `target` (pairs,).

    `position` (nodes, 3) [m], `departure` (nodes,) [s]. Returns (pairs, fields of Edge).
    """
    edges = np.empty((target.size, 7))
    for n in prange(source.size):
        row = slice(indptr[n], indptr[n + 1])
        connect_node(
            flow,
            terrain,
            polar,
            steering,
            integration,
            position,
            departure,
            source[n],
            target[row],
            edges[row],
        )
    return edges


@njit
def polish(
    flow, terrain, polar, integration, position, direction, backward, x, y, z, t, guesses, count, limit, lanes
):
    """The cheapest exact leg for each node among first guesses, between it and (x, y, z).

    Of a node's guesses those inside a cell go first, earliest first, then those outside, nearest first.
    `limit` > 0: only the fastest so many legs. Returns rows (nodes, 1 + fields of Edge), the node first.
    """
    horizon = integration.dt * integration.steps
    time = np.empty(count)
    key = np.empty(count)
    for n in range(count):
        time[n] = abs(position[int(guesses[n, 0]), 2] - z) / vertical_speed(polar, direction, guesses[n, 1])
        rank = time[n] / (4.0 * horizon) if guesses[n, 3] <= INSIDE else 0.5 + 0.5 * min(guesses[n, 3], 0.9)
        key[n] = guesses[n, 0] + min(rank, 0.99)
    order = np.argsort(key, kind="mergesort")
    begin = np.empty(count + 1, np.int64)
    groups = 0
    for n in range(count):
        if n == 0 or guesses[order[n], 0] != guesses[order[n - 1], 0]:
            begin[groups] = n
            groups += 1
    begin[groups] = count
    result = np.empty((groups, 8))
    earliest = np.empty(groups)
    for g in range(groups):
        result[g, 0] = guesses[order[begin[g]], 0]
        _store(result[:, 1:], g, no_edge(NO_HIT))
        earliest[g] = time[order[begin[g]]]
    if limit == 0:
        polish_groups(
            flow, terrain, polar, integration, position, direction, backward, x, y, z, t, guesses, time, order,
            begin, np.arange(groups), result, lanes,
        )  # fmt: skip
        return result
    # the earliest first, until `limit` legs are found that none of the rest can beat
    queue = np.argsort(earliest, kind="mergesort")
    done = 0
    while done < groups:
        block = queue[done : done + limit]
        polish_groups(
            flow, terrain, polar, integration, position, direction, backward, x, y, z, t, guesses, time, order,
            begin, block.copy(), result, lanes,
        )  # fmt: skip
        done += block.size
        costs = np.sort(result[queue[:done], 3])
        found = np.sum(result[queue[:done], 1] == CONNECTED)
        if found >= limit and done < groups and costs[limit - 1] <= edge_cost(earliest[queue[done]]):
            break
    looked = np.sort(queue[:done])
    kept = result[looked]
    # NaN, the cost of what is not connected, sorts last
    by_cost = np.argsort(kept[:, 3], kind="mergesort")
    return kept[np.sort(by_cost[:limit])] if by_cost.size > limit else kept


@njit
def polish_groups(
    flow, terrain, polar, integration, position, direction, backward, x, y, z, t, guesses, time, order, begin,
    pending, result, lanes,
):  # fmt: skip
    """Polish the guesses of the groups `pending` (its order is lost), LANES at a time, into rows of `result`."""
    horizon = integration.dt * integration.steps
    cursor = begin[:-1].copy()
    origin = np.empty((3, LANES))
    target = np.empty((3, LANES))
    angle = np.empty(LANES)
    heading = np.empty(LANES)
    inverse = np.empty((4, LANES))
    found = np.empty((2, LANES))
    while pending.size > 0:
        for first in range(0, pending.size, LANES):
            used = min(LANES, pending.size - first)
            for n in range(LANES):
                g = pending[first + min(n, used - 1)]
                guess = guesses[order[cursor[g]]]
                node = int(guess[0])
                near, far = (target, origin) if backward else (origin, target)
                near[0, n], near[1, n], near[2, n] = x, y, z
                far[0, n], far[1, n], far[2, n] = position[node]
                angle[n], heading[n] = guess[1], guess[2]
                for m in range(4):
                    inverse[m, n] = -guess[4 + m] if backward else guess[4 + m]
            steer_lanes(
                flow, polar, direction, origin, target, t, angle, heading, inverse,
                integration.dt, horizon, found, lanes,
            )  # fmt: skip
            for n in range(used):
                g = pending[first + n]
                cursor[g] += 1
                known = result[g, 1] == CONNECTED
                if found[0, n] == math.inf or (known and edge_cost(found[1, n]) >= result[g, 3]):
                    continue
                c = control_towards(polar, direction, angle[n], heading[n])
                if not stays_inside(
                    flow, origin[0, n], origin[1, n], origin[2, n], t, c.u, c.v, c.w, found[1, n], integration.dt
                ):
                    continue
                clear = is_clear(
                    flow, terrain, origin[0, n], origin[1, n], origin[2, n], t, c.u, c.v, c.w, found[1, n],
                    integration.dt, CLEARANCE_SPACING,
                )  # fmt: skip
                if clear:
                    cost = edge_cost(found[1, n])
                    edge = Edge(CONNECTED, found[1, n], cost, c.glide_angle, c.heading, c.speed, found[0, n])
                    _store(result[:, 1:], g, edge)
                elif not known:
                    result[g, 1] = BLOCKED
        left = 0
        for n in range(pending.size):
            g = pending[n]
            if cursor[g] == begin[g + 1] or cursor[g] - begin[g] == MAX_TRIES:
                continue
            following = order[cursor[g]]
            if result[g, 1] == CONNECTED and (
                guesses[following, 3] > INSIDE or edge_cost(time[following]) >= result[g, 3]
            ):
                continue
            pending[left] = g
            left += 1
        pending = pending[:left]


@njit
def connect_by_fan(
    flow, terrain, polar, steering, bins, integration, position, wanted, backward, x, y, z, t, limit, lanes
):
    """The cheapest exact legs between (x, y, z) and the wanted nodes, in both directions.

    Rows as `polish` has them; `limit` holds for each direction.
    """
    horizon = integration.dt * integration.steps
    lowest, highest = z, z
    for n in range(position.shape[0]):
        if wanted[n]:
            lowest = min(lowest, position[n, 2])
            highest = max(highest, position[n, 2])
    found = np.empty((0, 8))
    for direction in range(2):
        outward = 1 - direction if backward else direction
        deepest = highest if outward == CLIMB else lowest
        guesses, count = fan_guesses(
            flow, polar, steering, bins, position, wanted, direction, backward, x, y, z, t, deepest,
            integration.dt * FAN_STEP, horizon, lanes,
        )  # fmt: skip
        rows = polish(
            flow, terrain, polar, integration, position, direction, backward, x, y, z, t, guesses, count, limit,
            lanes,
        )  # fmt: skip
        found = np.concatenate((found, rows))
    return found


@njit
def _wanted_all(position, z):
    wanted = np.zeros(position.shape[0], np.int64)
    for n in range(position.shape[0]):
        wanted[n] = position[n, 2] != z
    return wanted


@entry_point(parallel=True)
def connect_all_by_fan(
    flow, terrain, polar, steering, bins, integration, position, departure, source, indptr, target
):
    """As `connect_all`, by the flow map: one fan per source node and direction serves all its targets."""
    edges = np.empty((target.size, 7))
    for n in prange(source.size):
        node = source[n]
        x, y, z = position[node]
        t = departure[node]
        wanted = np.zeros(position.shape[0], np.int64)
        for k in range(indptr[n], indptr[n + 1]):
            q = target[k]
            direction = CLIMB if position[q, 2] > z else DIVE
            status = quick_status(
                flow,
                polar,
                direction,
                x,
                y,
                z,
                position[q, 0],
                position[q, 1],
                position[q, 2],
                t,
                integration,
            )
            _store(edges, k, no_edge(NO_HIT if status == CONNECTED else status))
            if status == CONNECTED:
                wanted[q] = k + 1
        rows = connect_by_fan(
            flow, terrain, polar, steering, bins, integration, position, wanted, False, x, y, z, t, 0,
            np.zeros((LANE_ROWS, LANES)),
        )  # fmt: skip
        for r in range(rows.shape[0]):
            edges[wanted[int(rows[r, 0])] - 1] = rows[r, 1:]
    return edges


@entry_point(parallel=True)
def connect_reachable(
    flow, terrain, polar, steering, bins, integration, position, departure, point, t, backward, source, limit,
    capacity,
):  # fmt: skip
    """The legs from each of the nodes `source` (n,) to every node that lies under its fan, rows as `polish`.

    Where `source` is empty: the legs from `point` (3,) [m] at time t [s], or with `backward` those to it.
    Returns counts (n,) and rows (n, capacity, 8); a count above `capacity` says how much room is needed.
    """
    here = source.size == 0
    nodes = 1 if here else source.size
    counts = np.zeros(nodes, np.int64)
    found = np.empty((nodes, capacity, 8))
    for n in prange(nodes):
        if here:
            x, y, z = point
            when = t
        else:
            x, y, z = position[source[n]]
            when = departure[source[n]]
        if contains(flow, x, y, when):
            rows = connect_by_fan(
                flow, terrain, polar, steering, bins, integration, position, _wanted_all(position, z), backward,
                x, y, z, when, limit, np.zeros((LANE_ROWS, LANES)),
            )  # fmt: skip
            counts[n] = rows.shape[0]
            rows = rows[np.argsort(rows[:, 0])]
            for r in range(min(rows.shape[0], capacity)):
                found[n, r] = rows[r]
    return counts, found
