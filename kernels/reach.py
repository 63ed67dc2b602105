"""Reach: finds the exact legs between points and the nodes under their fans, and keeps the cheapest of each."""

import math
from typing import NamedTuple

import numpy as np

from .cache import entry_point, inlined, kernel, making
from .connect import pair_at
from .control import CLIMB, angle_of_vertical_speed, horizontal_speed, vertical_speed
from .cost import edge_cost
from .edges import (
    BLOCKED,
    CLEARANCE_SPACING,
    CONNECTED,
    COST,
    EDGE_COLUMNS,
    NO_HIT,
    STATUS,
    Edge,
    no_edge,
    quick_status,
    store,
)
from .fan import FAN_ROWS, Launch, Sweep, fan_guesses, outward_of
from .flight import LANE_LEFT, advance, ends_of, hangar, rest, stayed_inside, stayed_open, stretch, widen
from .flow import FANS, Array, Numbers, cell_size, contains, has_ladder, rises
from .motion import LANES, is_clear, most_step, stays_inside
from .patch import (
    GUESS_ANGLE,
    GUESS_COLUMNS,
    GUESS_HEADING,
    GUESS_INVERSE,
    GUESS_NODE,
    GUESS_OUTSIDE,
    GUESS_TASK,
    GUESS_TIME,
    Guesses,
    Nodes,
    bin_range,
)
from .place import Pair, Place
from .steer import (
    AIM_INVERSE,
    AIM_MISS,
    AIM_ROWS,
    AIM_STATE,
    AIM_TIME,
    FLOWN,
    HIT,
    OPEN,
    aim,
    control_in,
    correct,
)

MAX_TRIES = 12
"""At most this many guesses are polished for one node."""
FAN_STEP = 8.0
"""The step of a fan as a multiple of the step of a leg; it may be longer, because a fan gives only first
guesses."""
FAN_SHARE = 0.125
"""In a file's grid a fan's step may last as long as the fastest glider takes for this share of a cell."""
LADDER_SHARE = 0.25
"""On a ladder, whose rungs lie where the currents bend, for this share."""
SPARE, LONGER = 1.3, 1.2
"""A deadline should suffice for SPARE times the limit; each is at least LONGER times the one before."""
LATEST = 1.1
"""A guess is not polished if it takes longer than this multiple of the deadline."""
SURE = 2.0
"""A flight is given up that is late even if its next step changes its time SURE times as much as the last."""
INSIDE = 1e-9
"""A guess that lies outside its triangle by less than this counts as inside."""
TASK_ORIGIN, TASK_DIRECTION, TASK_DEADLINE, TASK_DONE = range(4)
"""Columns of a task: the point it is for, its direction, by when its legs arrive [s], whether it is done."""
TASK_COLUMNS = 4
FOUND_TASK, FOUND_NODE, FOUND_EDGE = range(3)
"""Columns of what is found for a task and a node: from FOUND_EDGE on the fields of Edge."""
FOUND_COLUMNS = FOUND_EDGE + EDGE_COLUMNS
LEG_NODE, LEG_EDGE = range(2)
"""Columns of a leg that is handed over: what is found, without the task."""
LEG_COLUMNS = LEG_EDGE + EDGE_COLUMNS


class Points(NamedTuple):
    """Points that legs set off from, or with `backward` arrive at, and the nodes that each asks for.

    `position` (n, 3) [m], left at `departure` (n,) [s]; of point n `target[indptr[n]:indptr[n + 1]]`, or all
    nodes where `indptr` is empty.
    """

    position: Array
    departure: Array
    backward: bool
    indptr: Numbers
    target: Numbers


class Legs(NamedTuple):
    """Room for what is found: `rows` (points, capacity, LEG_COLUMNS), `counts` (points,) how many of each.

    A count above the capacity says how much is needed.
    """

    counts: Numbers
    rows: Array


class Turns(NamedTuple):
    """The order in which guesses are tried: those of a task and a node are order[begin[g]:begin[g + 1]].

    `time` (guesses,) [s]: how long each one's leg takes.
    """

    order: Numbers
    begin: Numbers
    time: Array


@making
def ranks(keys):
    """Return the order that sorts keys; equal keys keep their order."""
    return np.argsort(keys, kind="mergesort")


@kernel
def place_of(points, n):
    """Return point n and the time at which legs leave it."""
    x, y, z = points.position[n]
    return Place(x, y, z, points.departure[n])


@kernel
def checked_leg(medium, lanes, n):
    """Return the leg of lane n; without an edge if it leaves the known flow or the terrain blocks it."""
    flow, dt = medium.flow, medium.integration.dt
    c, time = control_in(medium.polar, lanes, n), lanes[AIM_TIME, n]
    start, goal = ends_of(lanes, n)
    if has_ladder(flow):
        # between its steps it may have been further out
        stretch(lanes, n, 0.5 * most_step(flow, dt) * flow.extent.max_speed)
    if not (contains(flow, start.x, start.y, start.t) and contains(flow, goal.x, goal.y, start.t)):
        return no_edge(NO_HIT)
    if not (stayed_inside(flow, lanes, n, start.t, time) or stays_inside(flow, start, c, time, dt)):
        return no_edge(NO_HIT)
    open_water = stayed_open(flow, medium.terrain, lanes, n, start.z, start.z + c.w * time)
    if not (open_water or is_clear(flow, medium.terrain, start, c, time, dt, CLEARANCE_SPACING)):
        return no_edge(BLOCKED)
    return Edge(
        CONNECTED, time, edge_cost(medium.cost, time), c.glide_angle, c.heading, c.speed, lanes[AIM_MISS, n]
    )


@kernel
def _ranked(medium, position, points, tasks, guess):
    """How long a guess's leg takes [s], and its rank among those of its task and node; inf where it is too late.

    Those inside a cell go first, earliest first, then those outside, nearest first.
    """
    task = tasks[int(guess[GUESS_TASK])]
    deadline = task[TASK_DEADLINE]
    rise = abs(position[int(guess[GUESS_NODE]), 2] - points.position[int(task[TASK_ORIGIN]), 2])
    time = rise / vertical_speed(medium.polar, int(task[TASK_DIRECTION]), guess[GUESS_ANGLE])
    if rises(medium.flow):
        time = max(guess[GUESS_TIME], 0.0)
    outside = guess[GUESS_OUTSIDE]
    if time > LATEST * deadline:
        return time, math.inf
    if outside <= INSIDE:
        return time, time / (4.0 * deadline)
    return time, 0.5 + 0.5 * min(outside, 0.9)


@kernel
def _sort_few(order, rank):
    """Sort a few guesses by their rank, those of equal rank as they are."""
    for n in range(1, order.size):
        one = order[n]
        m = n
        while m > 0 and rank[order[m - 1]] > rank[one]:
            order[m] = order[m - 1]
            m -= 1
        order[m] = one


@making
def in_turn(medium, position, points, tasks, guesses):
    """The order in which guesses are tried: by task and node, and among those by rank; the late ones left out."""
    rows, count = guesses
    time, rank, pair = np.empty(count), np.empty(count), np.empty(count)
    late = 0
    for n in range(count):
        time[n], rank[n] = _ranked(medium, position, points, tasks, rows[n])
        pair[n] = rows[n, GUESS_TASK] * position.shape[0] + rows[n, GUESS_NODE]
        if rank[n] == math.inf:
            pair[n] = math.inf
            late += 1
    order = ranks(pair)
    count -= late
    begin = np.empty(count + 1, np.int64)
    pairs = 0
    for n in range(count):
        if n == 0 or pair[order[n]] != pair[order[n - 1]]:
            begin[pairs] = n
            pairs += 1
    begin[pairs] = count
    for g in range(pairs):
        _sort_few(order[begin[g] : begin[g + 1]], rank)
    return Turns(order, begin[: pairs + 1], time)


@kernel
def _aim_at(medium, position, points, tasks, guess, lanes, n):
    """Start lane n with the control of a first guess."""
    task = tasks[int(guess[GUESS_TASK])]
    start = place_of(points, int(task[TASK_ORIGIN]))
    x, y, z = position[int(guess[GUESS_NODE])]
    goal = Place(x, y, z, start.t)
    pair = Pair(goal, start) if points.backward else Pair(start, goal)
    sign = -1.0 if points.backward else 1.0
    for m in range(4):
        lanes[AIM_INVERSE + m, n] = sign * guess[GUESS_INVERSE + m]
    control = guess[GUESS_ANGLE], guess[GUESS_HEADING]
    aim(medium, lanes, n, int(task[TASK_DIRECTION]), pair, *control)


@kernel
def _correct(medium, lanes, n, deadline):
    """Correct the control of lane n after its landing, so that it flies again; False if its guess is finished."""
    before = lanes[AIM_TIME, n]
    correct(medium, lanes, n)
    time = lanes[AIM_TIME, n]
    return lanes[AIM_STATE, n] == OPEN and time - SURE * abs(time - before) <= deadline


@kernel
def _keep_cheaper(medium, lanes, n, deadline, edge):
    """Make the leg of lane n the edge if it arrives in time, is cheaper and passes the checks."""
    known, time = edge[STATUS] == CONNECTED, lanes[AIM_TIME, n]
    if lanes[AIM_STATE, n] != HIT or time > deadline or (known and edge_cost(medium.cost, time) >= edge[COST]):
        return
    leg = checked_leg(medium, lanes, n)
    if leg.status == CONNECTED or (leg.status == BLOCKED and not known):
        store(edge, leg)


@kernel
def _is_worth_trying(cost, turns, g, at, rows, edge):
    """Return whether the guess at a place of the order may still improve the edge of pair g."""
    if at >= turns.begin[g + 1] or at - turns.begin[g] >= MAX_TRIES:
        return False
    guess = turns.order[at]
    if edge[STATUS] != CONNECTED:
        return True
    return rows[guess, GUESS_OUTSIDE] <= INSIDE and edge_cost(cost, turns.time[guess]) < edge[COST]


@making
def nothing_found(turns, rows):
    """Of each pair that has guesses a row of what is found: nothing so far."""
    found = np.empty((turns.begin.size - 1, FOUND_COLUMNS))
    for g in range(found.shape[0]):
        first = rows[turns.order[turns.begin[g]]]
        found[g, FOUND_TASK], found[g, FOUND_NODE] = first[GUESS_TASK], first[GUESS_NODE]
        store(found[g, FOUND_EDGE:], no_edge(NO_HIT))
    return found


@making
def polish(medium, position, points, tasks, guesses, lanes):
    """The cheapest exact leg between each task's point and each node among first guesses: rows of what is found.

    By task and node. A lane whose guess is settled takes the next one, so that all are always busy; none knows
    of the others.
    """
    turns = in_turn(medium, position, points, tasks, guesses)
    rows = guesses.rows
    found = nothing_found(turns, rows)
    # in the order of the nodes, so that neighbouring lanes fly through the same water
    following = turns.begin[:-1].copy()
    group = np.zeros(LANES, np.int64)
    lanes[LANE_LEFT] = math.inf
    taken = min(LANES, found.shape[0])
    for n in range(taken):
        group[n] = n
        _aim_at(medium, position, points, tasks, rows[turns.order[following[n]]], lanes, n)
    flying = taken
    while flying > 0:
        advance(medium.flow, lanes)
        widen(lanes)
        for n in range(LANES):
            if lanes[LANE_LEFT, n] > 0.0:
                continue
            g = group[n]
            deadline = tasks[int(found[g, FOUND_TASK]), TASK_DEADLINE]
            if _correct(medium, lanes, n, deadline):
                continue
            edge = found[g, FOUND_EDGE:]
            _keep_cheaper(medium, lanes, n, deadline, edge)
            following[g] += 1
            if not _is_worth_trying(medium.cost, turns, g, following[g], rows, edge):
                if taken == found.shape[0]:
                    rest(lanes, n)
                    flying -= 1
                    continue
                g = group[n] = taken
                taken += 1
            _aim_at(medium, position, points, tasks, rows[turns.order[following[g]]], lanes, n)
    return found


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
def nodes_swept(bins, polar, launch, backward, deadline):
    """Return the number of nodes that a fan may pass over before the deadline [s].

    In still water a fan sweeps, at a height, the ring between its shallowest and its steepest glide; a current
    without divergence moves and bends it.
    """
    origin, direction = launch.origin, launch.direction
    upward = 2.0 * outward_of(direction, backward) - 1.0
    steep = polar.steepest[direction]
    across = horizontal_speed(polar, direction, steep) / vertical_speed(polar, direction, steep)
    swept = 0.0
    for layer in range(bins.levels.size):
        rise = (bins.levels[layer] - origin.z) * upward
        angle = angle_of_vertical_speed(polar, direction, rise / deadline)
        if rise <= 0.0 or math.isnan(angle):
            continue
        slow = vertical_speed(polar, direction, angle)
        outer, inner = rise * horizontal_speed(polar, direction, angle) / slow, rise * across
        ring = 0.25 * math.pi * (1.0 - (inner / outer) ** 2)
        swept += ring * nodes_near(bins, layer, origin.x, origin.y, outer)
    return swept


@kernel
def time_to_sweep(bins, polar, launch, backward, nodes, horizon):
    """The time [s] in which a fan may pass over so many nodes, within the horizon [s]."""
    early, late = 0.0, horizon
    for _ in range(8):
        middle = 0.5 * (early + late)
        if nodes_swept(bins, polar, launch, backward, middle) < nodes:
            early = middle
        else:
            late = middle
    return late


@kernel
def later_deadline(bins, polar, launch, backward, deadline, arrived, limit, horizon):
    """A deadline [s] that should suffice for `limit` nodes, where `arrived` of them have met an earlier one."""
    share = max(arrived, 1) / max(nodes_swept(bins, polar, launch, backward, deadline), 1.0)
    enough = time_to_sweep(bins, polar, launch, backward, SPARE * limit / share, horizon)
    return min(max(enough, LONGER * deadline), horizon)


@kernel
def end_of(rows, task, begin):
    """Return the end of the rows of the task whose rows begin at `begin`."""
    end = begin
    while end < rows.shape[0] and rows[end, FOUND_TASK] == task:
        end += 1
    return end


@kernel
def horizon_of(medium):
    """Return the longest time [s] that a leg may take."""
    return medium.integration.dt * medium.integration.steps


@kernel
def launch_of(medium, points, task):
    """Return the fan of a task, with the steps of a fan."""
    origin, direction = place_of(points, int(task[TASK_ORIGIN])), int(task[TASK_DIRECTION])
    fastest = medium.flow.extent.max_speed + medium.polar.best_horizontal[direction]
    share = LADDER_SHARE if has_ladder(medium.flow) else FAN_SHARE
    step = max(medium.integration.dt * FAN_STEP, share * cell_size(medium.flow) / fastest)
    return Launch(origin, direction, step, FLOWN * task[TASK_DEADLINE], FANS)


@making
def first_tasks(medium, bins, points, limit, first, last):
    """A dive and a climb for each of the points first..last - 1, with their first deadlines."""
    horizon = horizon_of(medium)
    tasks = np.zeros((2 * (last - first), TASK_COLUMNS))
    for n in range(tasks.shape[0]):
        task = tasks[n]
        task[TASK_ORIGIN], task[TASK_DIRECTION], task[TASK_DEADLINE] = first + n // 2, n % 2, horizon
        launch = launch_of(medium, points, task)
        if not contains(medium.flow, launch.origin.x, launch.origin.y, launch.origin.t):
            task[TASK_DONE] = 1.0
        elif limit > 0:
            nodes = SPARE * limit
            task[TASK_DEADLINE] = time_to_sweep(bins, medium.polar, launch, points.backward, nodes, horizon)
    return tasks


@kernel
def deepest_asked(nodes, points, n, upward):
    """Return the height [m] of the highest, or lowest, node that a point asks for; inf if it asks for all."""
    if points.indptr.size == 0:
        return math.inf if upward else -math.inf
    furthest = points.position[n, 2]
    for k in range(points.indptr[n], points.indptr[n + 1]):
        z = nodes.position[points.target[k], 2]
        furthest = max(furthest, z) if upward else min(furthest, z)
    return furthest


@kernel
def want(wanted, points, n, value):
    """Mark the nodes that point n asks for as wanted, or remove the marks; nothing if it asks for all nodes."""
    if points.indptr.size > 0:
        for k in range(points.indptr[n], points.indptr[n + 1]):
            wanted[points.target[k]] = value


@inlined
def guesses_of_tasks(medium, steering, nodes, points, tasks, settled, lanes):
    """Find first guesses for the tasks that are not done, except for nodes whose legs are final."""
    guesses = Guesses(np.empty((1024, GUESS_COLUMNS)), 0)
    begin = 0
    for n in range(tasks.shape[0]):
        if tasks[n, TASK_DONE]:
            continue
        point, launch = int(tasks[n, TASK_ORIGIN]), launch_of(medium, points, tasks[n])
        end = end_of(settled, n, begin)
        want(nodes.wanted, points, point, True)
        for k in range(begin, end):
            nodes.wanted[int(settled[k, FOUND_NODE])] = False
        upward = outward_of(launch.direction, points.backward) == CLIMB
        deepest = deepest_asked(nodes, points, point, upward)
        sweep = Sweep(launch, n, points.backward, deepest, tasks[n, TASK_DEADLINE])
        guesses = fan_guesses(medium, steering, nodes, sweep, guesses, lanes)
        want(nodes.wanted, points, point, False)
        for k in range(begin, end):
            nodes.wanted[int(settled[k, FOUND_NODE])] = True
        begin = end
    return guesses


@kernel
def settle_tasks(medium, bins, points, tasks, rows, limit, legs, is_settled):
    """Hand over what is found for the tasks that have enough; put off the deadlines of the others.

    `rows` by task; of the others `is_settled` (rows,) says what need not be found again.
    """
    horizon = horizon_of(medium)
    begin = 0
    for n in range(tasks.shape[0]):
        end = end_of(rows, n, begin)
        task, found = tasks[n], rows[begin:end]
        if not task[TASK_DONE]:
            arrived = 0
            for k in range(end - begin):
                arrived += found[k, FOUND_EDGE + STATUS] == CONNECTED
            if arrived >= limit or task[TASK_DEADLINE] >= horizon:
                keep_cheapest(found, limit, legs, int(task[TASK_ORIGIN]))
                task[TASK_DONE] = 1.0
            else:
                task[TASK_DEADLINE] = later_deadline(
                    bins, medium.polar, launch_of(medium, points, task), points.backward, task[TASK_DEADLINE],
                    arrived, limit, horizon,
                )  # fmt: skip
                for k in range(begin, end):
                    is_settled[k] = rows[k, FOUND_EDGE + STATUS] == CONNECTED
        begin = end


@making
def keep_cheapest(found, limit, legs, n):
    """What is found for one task, the cheapest `limit` if there is one, into the legs of point n."""
    # NaN is the cost of pairs that are not connected; it sorts last
    kept = ranks(found[:, FOUND_EDGE + COST].copy())
    last = min(limit, found.shape[0]) if limit > 0 else found.shape[0]
    for k in range(last):
        if legs.counts[n] < legs.rows.shape[1]:
            legs.rows[n, legs.counts[n]] = found[kept[k], FOUND_NODE:]
        legs.counts[n] += 1


@entry_point(nogil=True)
def reach_points(medium, steering, nodes, points, limit, legs, first, last):
    """Write the cheapest exact legs between the points first..last - 1 and nodes into `legs`, by rising node.

    With a `limit`, a fan is cut at a deadline, which is put off until that many of its legs arrive before
    it; the fastest so many are kept of each direction. `nodes.wanted` is made here.
    """
    lanes = hangar(max(AIM_ROWS, FAN_ROWS))
    legs.counts[first:last] = 0
    tasks = first_tasks(medium, nodes.bins, points, limit, first, last)
    wanted = np.zeros(nodes.position.shape[0] if points.indptr.size > 0 else 0, np.bool_)
    settled = np.empty((0, FOUND_COLUMNS))
    while True:
        sought = Nodes(nodes.position, nodes.bins, wanted)
        guesses = guesses_of_tasks(medium, steering, sought, points, tasks, settled, lanes)
        rows = np.concatenate((settled, polish(medium, nodes.position, points, tasks, guesses, lanes)))
        rows = rows[ranks(rows[:, FOUND_TASK].copy())]
        is_settled = np.zeros(rows.shape[0], np.bool_)
        settle_tasks(medium, nodes.bins, points, tasks, rows, limit, legs, is_settled)
        if np.all(tasks[:, TASK_DONE] == 1.0):
            break
        settled = rows[is_settled]
        if points.indptr.size == 0:
            wanted = np.ones(nodes.position.shape[0], np.bool_)
    for n in range(first, last):
        mine = legs.rows[n, : min(legs.counts[n], legs.rows.shape[1])]
        mine[:] = mine[ranks(mine[:, LEG_NODE].copy())]


@entry_point(nogil=True)
def quick_statuses(medium, pairs, outcomes, first, last):
    """`quick_status` of all pairs of source[first:last] into outcomes, NO_HIT where nothing forbids a leg."""
    for n in range(first, last):
        for k in range(pairs.indptr[n], pairs.indptr[n + 1]):
            status = quick_status(medium, pair_at(pairs, n, k))
            store(outcomes[k], no_edge(NO_HIT if status == CONNECTED else status))


@entry_point(nogil=True)
def answer(pairs, found_indptr, found_target, found, outcomes, first, last):
    """The legs that were found, rising by target within a row, as outcomes of the pairs that asked for them."""
    for n in range(first, last):
        have = found_target[found_indptr[n] : found_indptr[n + 1]]
        for k in range(pairs.indptr[n], pairs.indptr[n + 1]):
            at = np.searchsorted(have, pairs.target[k])
            if outcomes[k, STATUS] == NO_HIT and at < have.size and have[at] == pairs.target[k]:
                outcomes[k] = found[found_indptr[n] + at]
