"""Reach: the exact legs between a point and the nodes under its fan; guesses polished, the cheapest kept."""

import math

import numpy as np
from numba import njit

from . import steer
from .cache import entry_point
from .control import CLIMB, angle_of_vertical_speed, control_towards, horizontal_speed, vertical_speed
from .cost import edge_cost
from .edges import BLOCKED, CLEARANCE_SPACING, CONNECTED, NO_HIT, Edge, no_edge, quick_status, store
from .fan import ANGLE, HEADING, INVERSE, NODE, OUTSIDE, fan_guesses
from .flow import contains, contains_box
from .motion import LANES, is_clear, stays_inside
from .steer import HIT, IDLE, OPEN, STATE, TIME, aim, steer_lanes, steering_lanes

MAX_TRIES = 12
"""Guesses that are polished for one node."""
FAN_STEP = 3.0
"""Steps of a fan, in steps of a leg: it gives first guesses."""
INSIDE = 1e-9
"""A guess this little outside its triangle is inside."""
ROW = 8
"""A row of what is found: the node, then the fields of Edge."""


@njit
def ranks(keys):
    """The order of keys, rising; of equal ones the first."""
    return np.argsort(keys, kind="mergesort")


@njit
def checked_leg(flow, terrain, polar, integration, direction, x, y, z, x_q, y_q, z_q, t, lanes, n):
    """The leg that lane n has found, if it stays where the flow is known and where the terrain allows."""
    c = control_towards(polar, direction, lanes[steer.ANGLE, n], lanes[steer.HEADING, n])
    time = lanes[TIME, n]
    if not (contains(flow, x, y, t) and contains(flow, x_q, y_q, t)):
        return no_edge(NO_HIT)
    x_lo, x_hi = lanes[steer.X_LO, n], lanes[steer.X_HI, n]
    y_lo, y_hi = lanes[steer.Y_LO, n], lanes[steer.Y_HI, n]
    inside = contains_box(flow, x_lo, x_hi, y_lo, y_hi, t, t + time)
    if not inside and not stays_inside(flow, x, y, z, t, c.u, c.v, c.w, time, integration.dt):
        return no_edge(NO_HIT)
    if not is_clear(flow, terrain, x, y, z, t, c.u, c.v, c.w, time, integration.dt, CLEARANCE_SPACING):
        return no_edge(BLOCKED)
    return Edge(CONNECTED, time, edge_cost(time), c.glide_angle, c.heading, c.speed, lanes[steer.MISS, n])


@njit
def polish(
    flow, terrain, polar, integration, position, direction, backward, x, y, z, t, guesses, count, horizon, lanes
):  # fmt: skip
    """The cheapest exact leg for each node among first guesses, between it and (x, y, z): rows (nodes, ROW).

    Of a node's guesses those inside a cell go first, earliest first, then those outside, nearest first. A lane
    whose guess is settled takes the next one, so that all are always busy; none knows of the others.
    """
    key = np.empty(count)
    time = np.empty(count)
    for n in range(count):
        rise = abs(position[int(guesses[n, NODE]), 2] - z)
        time[n] = rise / vertical_speed(polar, direction, guesses[n, ANGLE])
        outside = guesses[n, OUTSIDE]
        rank = time[n] / (4.0 * horizon) if outside <= INSIDE else 0.5 + 0.5 * min(outside, 0.9)
        key[n] = guesses[n, NODE] + min(rank, 0.99)
    order = ranks(key)
    begin = np.empty(count + 1, np.int64)
    groups = 0
    for n in range(count):
        if n == 0 or guesses[order[n], NODE] != guesses[order[n - 1], NODE]:
            begin[groups] = n
            groups += 1
    begin[groups] = count
    result = np.empty((groups, ROW))
    earliest = np.empty(groups)
    for g in range(groups):
        result[g, 0] = guesses[order[begin[g]], NODE]
        store(result[g, 1:], no_edge(NO_HIT))
        earliest[g] = time[order[begin[g]]]
    # flights of about the same length go together
    queue = ranks(earliest)
    following = begin[:groups].copy()
    group = np.zeros(LANES, np.int64)
    lanes[STATE] = IDLE
    taken = 0
    while True:
        busy = False
        for n in range(LANES):
            if lanes[STATE, n] == IDLE and taken < groups:
                group[n] = queue[taken]
                taken += 1
                _take(position, backward, x, y, z, guesses[order[following[group[n]]]], lanes, n)
            busy |= lanes[STATE, n] == OPEN
        if not busy:
            return result
        steer_lanes(flow, polar, direction, t, integration.dt, horizon, lanes)
        for n in range(LANES):
            if lanes[STATE, n] == OPEN or lanes[STATE, n] == IDLE:
                continue
            g = group[n]
            known = result[g, 1] == CONNECTED
            if lanes[STATE, n] == HIT and not (known and edge_cost(lanes[TIME, n]) >= result[g, 3]):
                x_q, y_q, z_q = position[int(result[g, 0])]
                if backward:
                    edge = checked_leg(
                        flow, terrain, polar, integration, direction, x_q, y_q, z_q, x, y, z, t, lanes, n
                    )
                else:
                    edge = checked_leg(
                        flow, terrain, polar, integration, direction, x, y, z, x_q, y_q, z_q, t, lanes, n
                    )
                if edge.status == CONNECTED or (edge.status == BLOCKED and not known):
                    store(result[g, 1:], edge)
                    known = edge.status == CONNECTED
            following[g] += 1
            lanes[STATE, n] = IDLE
            if following[g] == begin[g + 1] or following[g] - begin[g] == MAX_TRIES:
                continue
            guess = order[following[g]]
            if known and (guesses[guess, OUTSIDE] > INSIDE or edge_cost(time[guess]) >= result[g, 3]):
                continue
            _take(position, backward, x, y, z, guesses[guess], lanes, n)


@njit
def _take(position, backward, x, y, z, guess, lanes, n):
    x_q, y_q, z_q = position[int(guess[NODE])]
    if backward:
        aim(lanes, n, x_q, y_q, z_q, x, y, z, guess[ANGLE], guess[HEADING])
    else:
        aim(lanes, n, x, y, z, x_q, y_q, z_q, guess[ANGLE], guess[HEADING])
    for m in range(4):
        lanes[steer.INVERSE + m, n] = -guess[INVERSE + m] if backward else guess[INVERSE + m]


@njit
def first_deadline(bins, polar, direction, z, outward, limit, horizon):
    """A time [s] in which a fan may pass over `limit` nodes: a share of the horizon, halved while that is enough.

    In still water a fan sweeps, at a height, the ring between its shallowest and its steepest glide; a current
    without divergence moves and bends it.
    """
    bin_area = 1.0 / (bins.per_bin * bins.per_bin)
    steep = polar.steepest[direction]
    across = horizontal_speed(polar, direction, steep) / vertical_speed(polar, direction, steep)
    deadline = horizon
    while deadline > horizon / 512.0:
        expected = 0.0
        for layer in range(bins.levels.size):
            rise = (bins.levels[layer] - z) * (2.0 * outward - 1.0)
            angle = angle_of_vertical_speed(polar, direction, rise / (0.5 * deadline))
            if rise <= 0.0 or math.isnan(angle):
                continue
            slow = vertical_speed(polar, direction, angle)
            outer, inner = rise * horizontal_speed(polar, direction, angle) / slow, rise * across
            row = layer * bins.nx * bins.ny
            nodes = bins.first[row + bins.nx * bins.ny] - bins.first[row]
            expected += math.pi * (outer * outer - inner * inner) * nodes / (bins.nx * bins.ny * bin_area)
        if expected < limit:
            break
        deadline *= 0.5
    return deadline


@njit
def reach(
    flow, terrain, polar, steering, bins, integration, position, wanted, x, y, z, t, backward, limit, found
):  # fmt: skip
    """The cheapest exact legs between (x, y, z) and the wanted nodes, diving and climbing, into rows of `found`.

    With a `limit`, a fan is cut at a deadline, which is doubled until that many of its legs arrive before it;
    the fastest so many are kept of each direction. Returns how many legs there are, `found` full or not.
    """
    horizon = integration.dt * integration.steps
    lanes = steering_lanes()
    lowest, highest = -math.inf, math.inf
    if wanted.size > 0:
        lowest, highest = z, z
        for n in range(wanted.size):
            if wanted[n]:
                lowest, highest = min(lowest, position[n, 2]), max(highest, position[n, 2])
    count = 0
    for direction in range(2):
        outward = 1 - direction if backward else direction
        deepest = highest if outward == CLIMB else lowest
        deadline = horizon
        if limit > 0:
            deadline = first_deadline(bins, polar, direction, z, outward, limit, horizon)
        while True:
            guesses, guessed = fan_guesses(
                flow, polar, steering, bins, position, wanted, direction, backward, x, y, z, t, deepest,
                integration.dt * FAN_STEP, deadline, lanes,
            )  # fmt: skip
            rows = polish(
                flow, terrain, polar, integration, position, direction, backward, x, y, z, t, guesses, guessed,
                deadline, lanes,
            )  # fmt: skip
            arrived = 0
            for n in range(rows.shape[0]):
                arrived += rows[n, 1] == CONNECTED
            if arrived >= limit or deadline >= horizon:
                break
            deadline = min(2.0 * deadline, horizon)
        # NaN, the cost of what is not connected, sorts last
        kept = ranks(rows[:, 3].copy())
        last = min(limit, rows.shape[0]) if limit > 0 else rows.shape[0]
        for n in range(last):
            if count < found.shape[0]:
                found[count] = rows[kept[n]]
            count += 1
    return count


@entry_point(nogil=True)
def reach_points(
    flow, terrain, polar, steering, bins, integration, position, origin, departure, backward, indptr, target,
    limit, counts, found, first, last,
):  # fmt: skip
    """The legs from the points origin[first:last] [m], left at `departure` [s], to nodes under their fans.

    To the nodes `target[indptr[n]:indptr[n + 1]]`, or to all where `indptr` is empty; with `backward` from
    them. Into rows of `found` (n, capacity, ROW); a count above the capacity says how much is needed.
    """
    wanted = np.zeros(position.shape[0] if indptr.size > 0 else 0, np.bool_)
    for n in range(first, last):
        x, y, z = origin[n]
        t = departure[n]
        counts[n] = 0
        if not contains(flow, x, y, t):
            continue
        if indptr.size > 0:
            wanted[:] = False
            for k in range(indptr[n], indptr[n + 1]):
                wanted[target[k]] = True
        counts[n] = reach(
            flow, terrain, polar, steering, bins, integration, position, wanted, x, y, z, t, backward, limit,
            found[n],
        )  # fmt: skip


@entry_point()
def quick_statuses(flow, polar, integration, position, departure, source, indptr, target):
    """`quick_status` of all pairs, as `connect_all` takes them; NO_HIT where nothing forbids a leg: (pairs,)."""
    statuses = np.empty(target.size)
    for n in range(source.size):
        x_p, y_p, z_p = position[source[n]]
        for k in range(indptr[n], indptr[n + 1]):
            x_q, y_q, z_q = position[target[k]]
            direction = 1 if z_q > z_p else 0
            t = departure[source[n]]
            status = quick_status(flow, polar, direction, x_p, y_p, z_p, x_q, y_q, z_q, t, integration)
            statuses[k] = NO_HIT if status == CONNECTED else status
    return statuses
