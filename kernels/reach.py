"""Reach: the exact legs between points and the nodes under their fans; guesses polished, the cheapest kept."""

import math

import numpy as np

from . import steer
from .cache import entry_point, kernel, making
from .control import CLIMB, angle_of_vertical_speed, control_towards, horizontal_speed, vertical_speed
from .cost import edge_cost
from .edges import BLOCKED, CLEARANCE_SPACING, CONNECTED, NO_HIT, Edge, no_edge, quick_status, store
from .fan import FAN_ROWS, fan_guesses
from .flight import LEFT, advance, hangar, rest, stayed_inside, widen
from .flow import contains
from .motion import LANES, is_clear, stays_inside
from .patch import ANGLE, GUESS_COLUMNS, HEADING, INVERSE, NODE, OUTSIDE, TASK, bin_range
from .steer import HIT, OPEN, STATE, STEER_ROWS, TIME, aim, correct

MAX_TRIES = 12
"""Guesses that are polished for one node."""
FAN_STEP = 8.0
"""Steps of a fan, in steps of a leg: it gives first guesses."""
SPARE, LONGER = 1.3, 1.2
"""A deadline should suffice for SPARE times the limit; each is at least LONGER times the one before."""
LATEST = 1.1
"""A guess that arrives later, in deadlines, is not polished."""
SURE = 2.0
"""A flight is given up that is late even if its next step changes its time SURE times as much as the last."""
INSIDE = 1e-9
"""A guess this little outside its triangle is inside."""
ORIGIN, DIRECTION, DEADLINE, DONE = range(4)
"""Columns of a task: the point it is for, its direction, by when its legs arrive [s], whether it is done."""
ROW = 9
"""A row of what is polished: the task, the node, the fields of Edge. What is found lacks the task."""


@making
def ranks(keys):
    """The order of keys, rising; of equal ones the first."""
    return np.argsort(keys, kind="mergesort")


@kernel
def checked_leg(medium, lanes, n):
    """The leg that lane n has found, if it stays where the flow is known and where the terrain allows."""
    flow, dt = medium.flow, medium.integration.dt
    direction = int(lanes[steer.DIRECTION, n])
    c = control_towards(medium.polar, direction, lanes[steer.ANGLE, n], lanes[steer.HEADING, n])
    x, y, z = lanes[steer.START_X, n], lanes[steer.START_Y, n], lanes[steer.START_Z, n]
    t, time = lanes[steer.START_T, n], lanes[TIME, n]
    if not (contains(flow, x, y, t) and contains(flow, lanes[steer.GOAL_X, n], lanes[steer.GOAL_Y, n], t)):
        return no_edge(NO_HIT)
    if not (stayed_inside(flow, lanes, n, t, time) or stays_inside(flow, x, y, z, t, c.u, c.v, c.w, time, dt)):
        return no_edge(NO_HIT)
    if not is_clear(flow, medium.terrain, x, y, z, t, c.u, c.v, c.w, time, dt, CLEARANCE_SPACING):
        return no_edge(BLOCKED)
    return Edge(
        CONNECTED, time, edge_cost(medium.cost, time), c.glide_angle, c.heading, c.speed, lanes[steer.MISS, n]
    )


@making
def polish(medium, position, origin, departure, backward, tasks, guesses, count, lanes):
    """The cheapest exact leg between each task's point and each node among first guesses: rows (pairs, ROW).

    Of a node's guesses those inside a cell go first, earliest first, then those outside, nearest first. A lane
    whose guess is settled takes the next one, so that all are always busy; none knows of the others.
    """
    nodes = position.shape[0]
    key = np.empty(count)
    time = np.empty(count)
    late = 0
    for n in range(count):
        task = tasks[int(guesses[n, TASK])]
        rise = abs(position[int(guesses[n, NODE]), 2] - origin[int(task[ORIGIN]), 2])
        time[n] = rise / vertical_speed(medium.polar, int(task[DIRECTION]), guesses[n, ANGLE])
        outside = guesses[n, OUTSIDE]
        rank = time[n] / (4.0 * task[DEADLINE]) if outside <= INSIDE else 0.5 + 0.5 * min(outside, 0.9)
        key[n] = guesses[n, TASK] * nodes + guesses[n, NODE] + min(rank, 0.99)
        if time[n] > LATEST * task[DEADLINE]:
            key[n] = math.inf
            late += 1
    order = ranks(key)
    count -= late
    begin = np.empty(count + 1, np.int64)
    groups = 0
    for n in range(count):
        if n == 0 or math.floor(key[order[n]]) != math.floor(key[order[n - 1]]):
            begin[groups] = n
            groups += 1
    begin[groups] = count
    result = np.empty((groups, ROW))
    for g in range(groups):
        first = guesses[order[begin[g]]]
        result[g, 0], result[g, 1] = first[TASK], first[NODE]
        store(result[g, 2:], no_edge(NO_HIT))
    # in the order of the nodes: lanes side by side fly through the same water
    following = begin[:groups].copy()
    group = np.zeros(LANES, np.int64)
    taken = 0
    flying = 0
    lanes[LEFT] = math.inf
    for n in range(LANES):
        if taken < groups:
            group[n] = taken
            _take(medium, position, origin, departure, backward, tasks, guesses[order[begin[taken]]], lanes, n)
            taken += 1
            flying += 1
    while flying > 0:
        advance(medium.flow, lanes)
        widen(lanes)
        for n in range(LANES):
            if lanes[LEFT, n] > 0.0:
                continue
            before = lanes[TIME, n]
            correct(medium.polar, lanes, n, medium.integration.dt)
            g = group[n]
            row = result[g, 2:]
            known = row[0] == CONNECTED
            deadline = tasks[int(result[g, 0]), DEADLINE]
            if lanes[STATE, n] == OPEN and lanes[TIME, n] - SURE * abs(lanes[TIME, n] - before) <= deadline:
                continue
            arrives = lanes[STATE, n] == HIT and lanes[TIME, n] <= deadline
            if arrives and not (known and edge_cost(medium.cost, lanes[TIME, n]) >= row[2]):
                edge = checked_leg(medium, lanes, n)
                if edge.status == CONNECTED or (edge.status == BLOCKED and not known):
                    store(row, edge)
                    known = edge.status == CONNECTED
            following[g] += 1
            more = following[g] < begin[g + 1] and following[g] - begin[g] < MAX_TRIES
            if more and known:
                guess = order[following[g]]
                more = guesses[guess, OUTSIDE] <= INSIDE and edge_cost(medium.cost, time[guess]) < row[2]
            if not more:
                if taken == groups:
                    rest(lanes, n)
                    flying -= 1
                    continue
                g = taken
                group[n] = g
                taken += 1
            _take(medium, position, origin, departure, backward, tasks, guesses[order[following[g]]], lanes, n)
    return result


@kernel
def _take(medium, position, origin, departure, backward, tasks, guess, lanes, n):
    """Aim lane n by a first guess."""
    task = tasks[int(guess[TASK])]
    x, y, z = origin[int(task[ORIGIN])]
    x_q, y_q, z_q = position[int(guess[NODE])]
    sign = 1.0
    if backward:
        x, y, z, x_q, y_q, z_q = x_q, y_q, z_q, x, y, z
        sign = -1.0
    for m in range(4):
        lanes[steer.INVERSE + m, n] = sign * guess[INVERSE + m]
    t, dt = departure[int(task[ORIGIN])], medium.integration.dt
    control = guess[ANGLE], guess[HEADING]
    aim(medium.polar, lanes, n, task[DIRECTION], x, y, z, t, x_q, y_q, z_q, *control, dt)


@kernel
def nodes_near(bins, layer, x, y, radius):
    """How many nodes of a layer may lie within a square around (x, y) [m]: its share of the bins that hold it."""
    i_first, i_last = bin_range(x - radius, x + radius, bins.x_lo, bins.per_bin, bins.nx)
    j_first, j_last = bin_range(y - radius, y + radius, bins.y_lo, bins.per_bin, bins.ny)
    count = 0
    for i in range(i_first, i_last + 1):
        row = (layer * bins.nx + i) * bins.ny
        count += bins.first[row + j_last + 1] - bins.first[row + j_first]
    i, j, r = (x - bins.x_lo) * bins.per_bin, (y - bins.y_lo) * bins.per_bin, radius * bins.per_bin
    across = min(i + r, i_last + 1.0) - max(i - r, float(i_first))
    up = min(j + r, j_last + 1.0) - max(j - r, float(j_first))
    share = across * up / ((i_last - i_first + 1.0) * (j_last - j_first + 1.0))
    return count * max(share, 0.0)


@kernel
def nodes_swept(bins, polar, direction, x, y, z, outward, deadline):
    """How many nodes a fan may pass over before the deadline [s].

    In still water a fan sweeps, at a height, the ring between its shallowest and its steepest glide; a current
    without divergence moves and bends it.
    """
    steep = polar.steepest[direction]
    across = horizontal_speed(polar, direction, steep) / vertical_speed(polar, direction, steep)
    swept = 0.0
    for layer in range(bins.levels.size):
        rise = (bins.levels[layer] - z) * (2.0 * outward - 1.0)
        angle = angle_of_vertical_speed(polar, direction, rise / deadline)
        if rise <= 0.0 or math.isnan(angle):
            continue
        slow = vertical_speed(polar, direction, angle)
        outer, inner = rise * horizontal_speed(polar, direction, angle) / slow, rise * across
        ring = 0.25 * math.pi * (1.0 - (inner / outer) ** 2)
        swept += ring * nodes_near(bins, layer, x, y, outer)
    return swept


@kernel
def time_to_sweep(bins, polar, direction, x, y, z, outward, nodes, horizon):
    """The time [s] in which a fan may pass over so many nodes, within the horizon [s]."""
    early, late = 0.0, horizon
    for _ in range(8):
        middle = 0.5 * (early + late)
        if nodes_swept(bins, polar, direction, x, y, z, outward, middle) < nodes:
            early = middle
        else:
            late = middle
    return late


@kernel
def later_deadline(bins, polar, direction, x, y, z, outward, deadline, arrived, limit, horizon):
    """A deadline [s] that should suffice for `limit` nodes, where `arrived` of them have met an earlier one."""
    share = max(arrived, 1) / max(nodes_swept(bins, polar, direction, x, y, z, outward, deadline), 1.0)
    enough = time_to_sweep(bins, polar, direction, x, y, z, outward, SPARE * limit / share, horizon)
    return min(max(enough, LONGER * deadline), horizon)


@kernel
def end_of(rows, task, begin):
    """Where the rows of a task end that begin at `begin`."""
    end = begin
    while end < rows.shape[0] and rows[end, 0] == task:
        end += 1
    return end


@entry_point(nogil=True)
def reach_points(
    medium, steering, bins, position, origin, departure, backward, indptr, target, limit, counts, found, first,
    last,
):  # fmt: skip
    """The cheapest exact legs from the points origin[first:last] [m], left at `departure` [s], to nodes.

    To the nodes `target[indptr[n]:indptr[n + 1]]`, or to all where `indptr` is empty; with `backward` from
    them. With a `limit`, a fan is cut at a deadline, which is put off until that many of its legs arrive before
    it; the fastest so many are kept of each direction. Into rows of `found` (n, capacity, node and fields of
    Edge), by rising node; a count above the capacity says how much is needed.
    """
    horizon = medium.integration.dt * medium.integration.steps
    lanes = hangar(max(STEER_ROWS, FAN_ROWS))
    wanted = np.zeros(position.shape[0] if indptr.size > 0 else 0, np.bool_)
    tasks = np.zeros((2 * (last - first), 4))
    for task in range(tasks.shape[0]):
        n, direction = first + task // 2, task % 2
        counts[n] = 0
        tasks[task, ORIGIN], tasks[task, DIRECTION], tasks[task, DEADLINE] = n, direction, horizon
        if not contains(medium.flow, origin[n, 0], origin[n, 1], departure[n]):
            tasks[task, DONE] = 1.0
        elif limit > 0:
            outward = 1 - direction if backward else direction
            x, y, z = origin[n]
            tasks[task, DEADLINE] = time_to_sweep(
                bins, medium.polar, direction, x, y, z, outward, SPARE * limit, horizon
            )
    guesses = np.empty((1024, GUESS_COLUMNS))
    settled = np.empty((0, ROW))
    while True:
        count = np.int64(0)  # not a literal: what takes it is compiled once
        begin = 0
        for task in range(tasks.shape[0]):
            if tasks[task, DONE]:
                continue
            end = end_of(settled, task, begin)
            n, direction = int(tasks[task, ORIGIN]), int(tasks[task, DIRECTION])
            x, y, z = origin[n]
            lowest, highest = -math.inf, math.inf
            if indptr.size > 0:
                lowest, highest = z, z
                for k in range(indptr[n], indptr[n + 1]):
                    wanted[target[k]] = True
                    lowest, highest = min(lowest, position[target[k], 2]), max(highest, position[target[k], 2])
            for k in range(begin, end):
                wanted[int(settled[k, 1])] = False
            deepest = highest if (direction == CLIMB) != backward else lowest
            guesses, count = fan_guesses(
                medium, steering, bins, position, wanted, task, direction, backward, x, y, z, departure[n],
                deepest, tasks[task, DEADLINE], medium.integration.dt * FAN_STEP, guesses, count, lanes,
            )  # fmt: skip
            if indptr.size > 0:
                for k in range(indptr[n], indptr[n + 1]):
                    wanted[target[k]] = False
            for k in range(begin, end):
                wanted[int(settled[k, 1])] = True
            begin = end
        rows = np.concatenate(
            (settled, polish(medium, position, origin, departure, backward, tasks, guesses, count, lanes))
        )
        rows = rows[ranks(rows[:, 0].copy())]
        is_settled = np.zeros(rows.shape[0], np.bool_)
        begin = 0
        for task in range(tasks.shape[0]):
            end = end_of(rows, task, begin)
            if not tasks[task, DONE]:
                arrived = np.count_nonzero(rows[begin:end, 2] == CONNECTED)
                if arrived >= limit or tasks[task, DEADLINE] >= horizon:
                    _keep(rows[begin:end], limit, counts, found, int(tasks[task, ORIGIN]))
                    tasks[task, DONE] = 1.0
                else:
                    n, direction = int(tasks[task, ORIGIN]), int(tasks[task, DIRECTION])
                    outward = 1 - direction if backward else direction
                    x, y, z = origin[n]
                    tasks[task, DEADLINE] = later_deadline(
                        bins, medium.polar, direction, x, y, z, outward, tasks[task, DEADLINE], arrived, limit,
                        horizon,
                    )  # fmt: skip
                    is_settled[begin:end] = rows[begin:end, 2] == CONNECTED
            begin = end
        if np.all(tasks[:, DONE] == 1.0):
            break
        settled = rows[is_settled]
        if indptr.size == 0:
            wanted = np.ones(position.shape[0], np.bool_)
    for n in range(first, last):
        legs = found[n, : min(counts[n], found.shape[1])]
        legs[:] = legs[ranks(legs[:, 0].copy())]


@making
def _keep(rows, limit, counts, found, n):
    """The rows of one task, the cheapest `limit` of them if there is one, into found[n]."""
    # NaN, the cost of what is not connected, sorts last
    kept = ranks(rows[:, 4].copy())
    last = min(limit, rows.shape[0]) if limit > 0 else rows.shape[0]
    for k in range(last):
        if counts[n] < found.shape[1]:
            found[n, counts[n]] = rows[kept[k], 1:]
        counts[n] += 1


@entry_point(nogil=True)
def quick_statuses(medium, position, departure, source, indptr, target, outcomes, first, last):
    """`quick_status` of all pairs of source[first:last], NO_HIT where nothing forbids a leg: outcomes[:, 0]."""
    for n in range(first, last):
        x_p, y_p, z_p = position[source[n]]
        for k in range(indptr[n], indptr[n + 1]):
            x_q, y_q, z_q = position[target[k]]
            direction = 1 if z_q > z_p else 0
            t = departure[source[n]]
            status = quick_status(medium, direction, x_p, y_p, z_p, x_q, y_q, z_q, t)
            store(outcomes[k], no_edge(NO_HIT if status == CONNECTED else status))


@entry_point(nogil=True)
def answer(indptr, target, found_indptr, found_target, found, outcomes, first, last):
    """The legs that were found, rising by target within a row, as outcomes of the pairs that asked for them."""
    for n in range(first, last):
        have = found_target[found_indptr[n] : found_indptr[n + 1]]
        for k in range(indptr[n], indptr[n + 1]):
            at = np.searchsorted(have, target[k])
            if outcomes[k, 0] == NO_HIT and at < have.size and have[at] == target[k]:
                outcomes[k] = found[found_indptr[n] + at]
