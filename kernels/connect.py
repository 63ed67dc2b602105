"""Connects pairs by candidate controls (the paper's methods); each control is flown to its closest approach."""

import math
from typing import NamedTuple

import numpy as np

from .cache import entry_point, inlined, kernel, making
from .control import NO_CONTROL, candidate_controls, control_of, control_towards, direction_of
from .cost import edge_cost
from .edges import (
    BLOCKED,
    CARRIED_AWAY,
    CLEARANCE_SPACING,
    CONNECTED,
    COST,
    CURRENT_TOO_STRONG,
    EDGE_COLUMNS,
    NO_HIT,
    STATUS,
    TOO_FAR,
    Edge,
    no_edge,
    quick_status,
    store,
)
from .flight import (
    FLIGHT_ROWS,
    LANE_LAST,
    LANE_LEFT,
    advance,
    ends_of,
    hangar,
    keep_ends,
    place,
    rest,
    stayed_inside,
    stayed_open,
    widen,
)
from .flow import Array, Numbers, carry, max_rise
from .motion import (
    LANE_STEP,
    LANE_T,
    LANE_U,
    LANE_V,
    LANE_W,
    LANE_X,
    LANE_Y,
    LANE_Z,
    LANES,
    along_segment,
    arrival_window,
    closest_approach,
    is_clear,
    step_on,
)
from .place import Pair, Place

_ROWS = range(FLIGHT_ROWS, FLIGHT_ROWS + 14)
TRY_PAIR, TRY_CONTROL, TRY_GLIDE_ANGLE, TRY_HEADING, TRY_SPEED = _ROWS[:5]
"""Rows of a lane after those of `flight`: its pair, the number of its control, and that control."""
TRY_STEP, TRY_STRIDE, TRY_OPENS, TRY_CLOSES = _ROWS[5:9]
"""Steps done; steps between the last check and the next; the steps at which the arrival window opens and
closes."""
TRY_MISS, TRY_DURATION, TRY_SLACK = _ROWS[9:12]
"""Closest approach so far [m], its time [s], and the distance [m] that control and tolerance add to the
flow's."""
TRY_BEFORE_X, TRY_BEFORE_Y = _ROWS[12:]
"""The place of the lane at the last check [m]."""
TRY_ROWS = _ROWS.stop
HEADINGS = 8
"""So many headings are flown before a pair counts as carried away."""
LOOK_EVERY = 12
"""A path that is not yet in its arrival window is checked after this many steps."""


class Pairs(NamedTuple):
    """Pairs of nodes to evaluate, in CSR form by source.

    `position` (nodes, 3) [m], `departure` (nodes,) [s]; from `source` (n,) to `target[indptr[n]:indptr[n + 1]]`.
    """

    position: Array
    departure: Array
    source: Numbers
    indptr: Numbers
    target: Numbers


@kernel
def pair_at(pairs, n, k):
    """Return the two ends of the pair from source[n] to target[k]."""
    p = pairs.source[n]
    x, y, z = pairs.position[p]
    x_q, y_q, z_q = pairs.position[pairs.target[k]]
    t = pairs.departure[p]
    return Pair(Place(x, y, z, t), Place(x_q, y_q, z_q, t))


class Queue(NamedTuple):
    """The controls of a batch of pairs, one after another.

    `at` (4,): the source, the target, the next of its controls and how many there are; `controls` (candidates,
    2): those of the pair at hand; `last`: the source at which the batch ends.
    """

    at: Numbers
    controls: Array
    last: int


AT_SOURCE, AT_TARGET, AT_NEXT, AT_COUNT = range(4)


@kernel
def begin_pair(medium, steering, pair, controls, edge):
    """Fill in a pair's candidate controls and the status without an edge; return the number of candidates."""
    integration = medium.integration
    status = quick_status(medium, pair)
    count = 0
    if status == CONNECTED:
        slowest = abs(pair.goal.z - pair.start.z) / (integration.steps * integration.dt)
        slowest -= max_rise(medium.flow)
        count = candidate_controls(steering, medium.flow, medium.polar, pair, slowest, controls)
        status = CURRENT_TOO_STRONG if count == NO_CONTROL else (TOO_FAR if count == 0 else NO_HIT)
    store(edge, no_edge(status))
    return max(count, 0)


@entry_point()
def line_controls(medium, steering, pair):
    """Return the candidate controls of one pair, for Python: magnitude of the angle and heading (n, 2) [rad]."""
    controls = np.empty((steering.candidates, 2))
    count = begin_pair(medium, steering, pair, controls, np.empty(EDGE_COLUMNS))
    return controls[:count]


@kernel
def _out_of_reach(medium, lanes, n):
    """Return whether even the fastest flow can no longer carry lane n to its target in time."""
    dt = medium.integration.dt
    start, goal = ends_of(lanes, n)
    left = (lanes[TRY_CLOSES, n] - lanes[TRY_STEP, n]) * dt
    off_x = goal.x - (lanes[LANE_X, n] + lanes[LANE_U, n] * left)
    off_y = goal.y - (lanes[LANE_Y, n] + lanes[LANE_V, n] * left)
    w = lanes[LANE_W, n]
    end = start.z + lanes[TRY_CLOSES, n] * dt * w
    carried = carry(medium.flow, end) - carry(medium.flow, start.z + lanes[TRY_STEP, n] * dt * w)
    far = abs(carried / w) + lanes[TRY_SLACK, n]
    return off_x * off_x + off_y * off_y > far * far


@kernel
def _next_control(medium, steering, pairs, queue, edges):
    """Move the queue to the next control, or to the next pair after the last control; False at the end."""
    at = queue.at
    while at[AT_NEXT] == at[AT_COUNT]:
        at[AT_TARGET] += 1
        while at[AT_SOURCE] < queue.last and at[AT_TARGET] == pairs.indptr[at[AT_SOURCE] + 1]:
            at[AT_SOURCE] += 1
        if at[AT_SOURCE] == queue.last:
            return False
        k = at[AT_TARGET]
        at[AT_NEXT] = 0
        at[AT_COUNT] = begin_pair(medium, steering, pair_at(pairs, at[AT_SOURCE], k), queue.controls, edges[k])
    return True


@kernel
def _may_hit(medium, pair, c, lanes, n):
    """Put lane n at the start of a control; return whether it may come near its goal."""
    integration = medium.integration
    dt = integration.dt
    first, final = arrival_window(c.w, pair.goal.z - pair.start.z, integration.tolerance)
    place(lanes, n, pair.start, c)
    keep_ends(lanes, n, pair)
    lanes[TRY_GLIDE_ANGLE, n], lanes[TRY_HEADING, n], lanes[TRY_SPEED, n] = c.glide_angle, c.heading, c.speed
    lanes[TRY_STEP, n], lanes[TRY_OPENS, n] = 0.0, math.floor(first / dt)
    lanes[TRY_CLOSES, n] = min(float(integration.steps), math.floor(final / dt) + 1.0)
    lanes[TRY_SLACK, n] = math.hypot(c.u, c.v) * (lanes[TRY_CLOSES, n] * dt - first) + integration.tolerance
    lanes[TRY_MISS, n], lanes[TRY_DURATION, n] = math.inf, math.inf
    return lanes[TRY_OPENS, n] < lanes[TRY_CLOSES, n] and not _out_of_reach(medium, lanes, n)


@kernel
def _launch(medium, steering, pairs, queue, edges, lanes, n):
    """Start lane n with the next control of the queue that may hit; False if no control is left."""
    at = queue.at
    while _next_control(medium, steering, pairs, queue, edges):
        k, number = at[AT_TARGET], at[AT_NEXT]
        at[AT_NEXT] += 1
        pair = pair_at(pairs, at[AT_SOURCE], k)
        angle, heading = queue.controls[number]
        c = control_towards(medium.polar, direction_of(pair), angle, heading)
        first, _ = arrival_window(c.w, pair.goal.z - pair.start.z, medium.integration.tolerance)
        # controls come in order of arrival, so all later ones cost more
        if edges[k, STATUS] == CONNECTED and edge_cost(medium.cost, first) >= edges[k, COST]:
            at[AT_NEXT] = at[AT_COUNT]
            continue
        if not _may_hit(medium, pair, c, lanes, n):
            continue
        lanes[TRY_PAIR, n], lanes[TRY_CONTROL, n] = k, number
        lanes[LANE_STEP, n] = lanes[LANE_LAST, n] = medium.integration.dt
        _fly_on(lanes, n)
        return True
    return False


@inlined
def _control_in(lanes, n):
    """Return the control of lane n."""
    return control_of(lanes[TRY_SPEED, n], lanes[TRY_GLIDE_ANGLE, n], lanes[TRY_HEADING, n])


@inlined
def _fly_on(lanes, n):
    """Let lane n fly until its next check; where it may arrive, it is checked after each step."""
    lanes[TRY_BEFORE_X, n], lanes[TRY_BEFORE_Y, n] = lanes[LANE_X, n], lanes[LANE_Y, n]
    stride = max(1.0, min(float(LOOK_EVERY), lanes[TRY_OPENS, n] - lanes[TRY_STEP, n]))
    lanes[TRY_STRIDE, n] = lanes[LANE_LEFT, n] = stride


@kernel
def _look(medium, lanes, n):
    """Measure the distance of lane n's last steps from its target; return whether its flight is over."""
    dt = medium.integration.dt
    pair = ends_of(lanes, n)
    start, goal = pair
    w = lanes[LANE_W, n]
    lanes[TRY_STEP, n] += lanes[TRY_STRIDE, n]
    step = lanes[TRY_STEP, n]
    if not stayed_inside(medium.flow, lanes, n, start.t, step * dt):
        # a path ends where it leaves the flow; find that place step by step
        c = _control_in(lanes, n)
        lanes[TRY_MISS, n], lanes[TRY_DURATION, n] = closest_approach(medium.flow, pair, c, medium.integration)
        return True
    lanes[LANE_Z, n] = start.z + step * dt * w
    if step > lanes[TRY_OPENS, n]:
        earlier = lanes[LANE_T, n] - dt
        before = Place(lanes[TRY_BEFORE_X, n], lanes[TRY_BEFORE_Y, n], start.z + (step - 1.0) * dt * w, earlier)
        now = Place(lanes[LANE_X, n], lanes[LANE_Y, n], lanes[LANE_Z, n], lanes[LANE_T, n])
        share, miss = along_segment(before, now, goal)
        if miss < lanes[TRY_MISS, n]:
            lanes[TRY_MISS, n], lanes[TRY_DURATION, n] = miss, (step - 1.0 + share) * dt
        if step == lanes[TRY_CLOSES, n]:
            return True
    if _out_of_reach(medium, lanes, n):
        return True
    _fly_on(lanes, n)
    return False


@kernel
def _settle(medium, lanes, n, edge, chosen):
    """Make lane n's closest approach the edge if it hits and is cheaper; return the chosen control."""
    integration = medium.integration
    duration = lanes[TRY_DURATION, n]
    # a glider that is nearest at its start moves away from its goal; a leg must take time
    if lanes[TRY_MISS, n] >= integration.tolerance or duration == 0.0:
        return chosen
    cost = edge_cost(medium.cost, duration)
    if edge[STATUS] == CONNECTED and (cost, lanes[TRY_CONTROL, n]) >= (edge[COST], chosen):
        return chosen
    c = _control_in(lanes, n)
    start, _ = ends_of(lanes, n)
    flow, terrain, z_end = medium.flow, medium.terrain, start.z + c.w * duration
    if stayed_open(flow, terrain, lanes, n, start.z, z_end) or is_clear(
        flow, terrain, start, c, duration, integration.dt, CLEARANCE_SPACING
    ):
        store(edge, Edge(CONNECTED, duration, cost, c.glide_angle, c.heading, c.speed, lanes[TRY_MISS, n]))
        return lanes[TRY_CONTROL, n]
    if edge[STATUS] == NO_HIT:
        store(edge, no_edge(BLOCKED))
    return chosen


@entry_point(nogil=True)
def connect_nodes(medium, steering, pairs, edges, first, last):
    """Find the cheapest leg of each pair of source[first:last] among the candidate controls of the pair.

    Outcomes into `edges` (pairs, EDGE_COLUMNS). Equal to `closest_approach` of every control: outcomes
    do not depend on which flights share the air.
    """
    lanes = hangar(TRY_ROWS)
    before = pairs.indptr[first]
    chosen = np.empty(pairs.indptr[last] - before)
    queue = Queue(np.array([first, before - 1, 0, 0]), np.empty((steering.candidates, 2)), last)
    flying = 0
    for n in range(LANES):
        flying += _launch(medium, steering, pairs, queue, edges, lanes, n)
    while flying > 0:
        advance(medium.flow, lanes)
        widen(lanes)
        for n in range(LANES):
            if lanes[LANE_LEFT, n] > 0.0 or not _look(medium, lanes, n):
                continue
            k = int(lanes[TRY_PAIR, n])
            chosen[k - before] = _settle(medium, lanes, n, edges[k], chosen[k - before])
            if not _launch(medium, steering, pairs, queue, edges, lanes, n):
                rest(lanes, n)
                flying -= 1


@entry_point(nogil=True)
def connect_rising(medium, steering, pairs, edges, first, last):
    """As `connect_nodes`, in a flow with a vertical part: one control after another.

    When a path reaches a depth is not known before it is flown, so no control is left out beforehand.
    """
    controls = np.empty((steering.candidates, 2))
    for n in range(first, last):
        for k in range(pairs.indptr[n], pairs.indptr[n + 1]):
            pair, edge = pair_at(pairs, n, k), edges[k]
            count = begin_pair(medium, steering, pair, controls, edge)
            for m in range(count):
                angle, heading = controls[m]
                c = control_towards(medium.polar, direction_of(pair), angle, heading)
                miss, duration = closest_approach(medium.flow, pair, c, medium.integration)
                cost = edge_cost(medium.cost, duration)
                known = edge[STATUS] == CONNECTED
                if not miss < medium.integration.tolerance or duration == 0.0 or (known and cost >= edge[COST]):
                    continue
                if _stays_clear(medium, pair.start, c, duration):
                    found = Edge(CONNECTED, duration, cost, c.glide_angle, c.heading, c.speed, miss)
                    store(edge, found)
                elif edge[STATUS] == NO_HIT:
                    store(edge, no_edge(BLOCKED))


@making
def _stays_clear(medium, start, through, duration):
    """Return whether a leg stays where the terrain allows."""
    dt = medium.integration.dt
    return is_clear(medium.flow, medium.terrain, start, through, duration, dt, CLEARANCE_SPACING)


@entry_point(nogil=True)
def carried_away(medium, pairs, edges, first, last):
    """Set CARRIED_AWAY, instead of NO_HIT, for pairs of source[first:last] whose depth no steep glide reaches.

    Of the steepest glide HEADINGS headings are flown for the horizon.
    """
    flow, polar, dt = medium.flow, medium.polar, medium.integration.dt
    for n in range(first, last):
        for k in range(pairs.indptr[n], pairs.indptr[n + 1]):
            if edges[k, STATUS] != NO_HIT:
                continue
            pair = pair_at(pairs, n, k)
            direction = direction_of(pair)
            way = 2.0 * direction - 1.0
            arrives = False
            for m in range(HEADINGS):
                c = control_towards(polar, direction, polar.steepest[direction], 2.0 * math.pi * m / HEADINGS)
                here = pair.start
                for step in range(medium.integration.steps):
                    x, y, z = step_on(flow, here, c, dt)
                    here = Place(x, y, z, pair.start.t + (step + 1) * dt)
                    if (z - pair.goal.z) * way >= 0.0:
                        arrives = True
                        break
                if arrives:
                    break
            if not arrives:
                store(edges[k], no_edge(CARRIED_AWAY))
