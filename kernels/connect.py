"""Connecting pairs by candidate controls, the paper's methods: flown together, each to its closest approach."""

import math

import numpy as np

from .cache import entry_point, inlined, kernel
from .control import CLIMB, DIVE, NO_CONTROL, candidate_controls, control_towards
from .cost import edge_cost
from .edges import (
    BLOCKED,
    CLEARANCE_SPACING,
    CONNECTED,
    CURRENT_TOO_STRONG,
    NO_HIT,
    TOO_FAR,
    Edge,
    no_edge,
    quick_status,
    store,
)
from .flight import FLIGHT_ROWS, LAST, LEFT, advance, hangar, place, rest, stayed_inside, widen
from .flow import carry
from .motion import LANES, H, U, V, W, X, Y, Z, along_segment, arrival_window, closest_approach, is_clear

_ROWS = range(FLIGHT_ROWS, FLIGHT_ROWS + 18)
PAIR, CONTROL, ANGLE, HEADING = _ROWS[:4]
"""Rows of a lane beyond `flight`'s own: its pair, its control's number, magnitude of the angle, heading."""
START_X, START_Y, START_Z, START_T, GOAL_X, GOAL_Y, GOAL_Z = _ROWS[4:11]
STEP, STRIDE, OPENS, CLOSES = _ROWS[11:15]
"""Steps done; steps from the last look to the next; the steps at which the arrival window opens and closes."""
MISS, DURATION, SLACK = _ROWS[15:]
"""Closest approach so far [m], and when [s]; what the control and the tolerance add to the flow's carry [m]."""
BEFORE_X, BEFORE_Y, APPROACH_ROWS = _ROWS.stop, _ROWS.stop + 1, _ROWS.stop + 2
LOOK_EVERY = 12
"""Steps between looks at a path that is not yet in its arrival window."""
SOURCE, TARGET, NEXT, COUNT = range(4)
"""Where a batch of pairs stands: source, target, the next of its controls and how many there are."""


@kernel
def begin_pair(medium, steering, position, departure, p, q, controls, edge):
    """Fill in a pair's candidate controls, and why there is no edge so far; returns how many there are."""
    polar, integration = medium.polar, medium.integration
    x_p, y_p, z_p = position[p]
    x_q, y_q, z_q = position[q]
    t = departure[p]
    direction = CLIMB if z_q > z_p else DIVE
    status = quick_status(medium, direction, x_p, y_p, z_p, x_q, y_q, z_q, t)
    count = 0
    if status == CONNECTED:
        slowest = abs(z_q - z_p) / (integration.steps * integration.dt)
        count = candidate_controls(
            steering, medium.flow, polar, direction, x_p, y_p, z_p, x_q, y_q, z_q, t, slowest, controls
        )
        status = CURRENT_TOO_STRONG if count == NO_CONTROL else (TOO_FAR if count == 0 else NO_HIT)
    store(edge, no_edge(status))
    return max(count, 0)


@entry_point()
def line_controls(medium, steering, x_p, y_p, z_p, x_q, y_q, z_q, t):
    """The candidate controls of one pair, for callers from Python: angle's magnitude and heading (n, 2) [rad]."""
    controls = np.empty((steering.candidates, 2))
    ends = np.array([[x_p, y_p, z_p], [x_q, y_q, z_q]])
    count = begin_pair(medium, steering, ends, np.full(2, t), 0, 1, controls, np.empty(7))
    return controls[:count]


@kernel
def _out_of_reach(medium, lanes, n):
    """Whether the flow, at its fastest, can no longer carry lane n to its target in time."""
    dt = medium.integration.dt
    left = (lanes[CLOSES, n] - lanes[STEP, n]) * dt
    off_x = lanes[GOAL_X, n] - (lanes[X, n] + lanes[U, n] * left)
    off_y = lanes[GOAL_Y, n] - (lanes[Y, n] + lanes[V, n] * left)
    w = lanes[W, n]
    end = lanes[START_Z, n] + lanes[CLOSES, n] * dt * w
    carried = carry(medium.flow, end) - carry(medium.flow, lanes[START_Z, n] + lanes[STEP, n] * dt * w)
    far = abs(carried / w) + lanes[SLACK, n]
    return off_x * off_x + off_y * off_y > far * far


@kernel
def _launch(medium, steering, position, departure, source, indptr, target, controls, at, last, edges, lanes, n):
    """Send lane n off with the next control of the batch that may hit; False where there is none left."""
    integration = medium.integration
    dt = integration.dt
    while True:
        if at[NEXT] == at[COUNT]:
            at[TARGET] += 1
            while at[SOURCE] < last and at[TARGET] == indptr[at[SOURCE] + 1]:
                at[SOURCE] += 1
            if at[SOURCE] == last:
                return False
            p, k = source[at[SOURCE]], at[TARGET]
            at[NEXT] = 0
            at[COUNT] = begin_pair(medium, steering, position, departure, p, target[k], controls, edges[k])
            continue
        p, k = source[at[SOURCE]], at[TARGET]
        x, y, z = position[p]
        x_q, y_q, z_q = position[target[k]]
        angle, heading = controls[at[NEXT]]
        c = control_towards(medium.polar, CLIMB if z_q > z else DIVE, angle, heading)
        first, final = arrival_window(c.w, z_q - z, integration.tolerance)
        lanes[CONTROL, n] = at[NEXT]
        at[NEXT] += 1
        # controls come in order of arrival: from here on all are dearer
        if edges[k, 0] == CONNECTED and edge_cost(medium.cost, first) >= edges[k, 2]:
            at[NEXT] = at[COUNT]
            continue
        place(lanes, n, x, y, z, departure[p], c.u, c.v, c.w)
        lanes[PAIR, n], lanes[ANGLE, n], lanes[HEADING, n] = k, angle, heading
        lanes[START_X, n], lanes[START_Y, n], lanes[START_Z, n], lanes[START_T, n] = x, y, z, departure[p]
        lanes[GOAL_X, n], lanes[GOAL_Y, n], lanes[GOAL_Z, n] = x_q, y_q, z_q
        lanes[STEP, n], lanes[OPENS, n] = 0.0, math.floor(first / dt)
        lanes[CLOSES, n] = min(float(integration.steps), math.floor(final / dt) + 1.0)
        lanes[SLACK, n] = math.hypot(c.u, c.v) * (lanes[CLOSES, n] * dt - first) + integration.tolerance
        lanes[MISS, n], lanes[DURATION, n] = math.inf, math.inf
        if lanes[OPENS, n] >= lanes[CLOSES, n] or _out_of_reach(medium, lanes, n):
            continue
        lanes[H, n] = lanes[LAST, n] = dt
        _fly_on(lanes, n)
        return True


@inlined
def _fly_on(lanes, n):
    """Let lane n fly until it is worth a look: step by step where it may arrive."""
    lanes[BEFORE_X, n], lanes[BEFORE_Y, n] = lanes[X, n], lanes[Y, n]
    stride = max(1.0, min(float(LOOK_EVERY), lanes[OPENS, n] - lanes[STEP, n]))
    lanes[STRIDE, n] = lanes[LEFT, n] = stride


@kernel
def _look(medium, lanes, n):
    """Measure lane n's last steps against its target; whether its flight is over."""
    dt = medium.integration.dt
    x, y, z, t = lanes[START_X, n], lanes[START_Y, n], lanes[START_Z, n], lanes[START_T, n]
    x_q, y_q, z_q = lanes[GOAL_X, n], lanes[GOAL_Y, n], lanes[GOAL_Z, n]
    w = lanes[W, n]
    lanes[STEP, n] += lanes[STRIDE, n]
    step = lanes[STEP, n]
    if not stayed_inside(medium.flow, lanes, n, t, step * dt):
        # a path that leaves the flow ends: step by step, where does it?
        lanes[MISS, n], lanes[DURATION, n] = closest_approach(
            medium.flow, x, y, z, t, lanes[U, n], lanes[V, n], w, x_q, y_q, z_q, medium.integration
        )
        return True
    lanes[Z, n] = z + step * dt * w
    if step > lanes[OPENS, n]:
        before = z + (step - 1.0) * dt * w
        share, miss = along_segment(
            lanes[BEFORE_X, n], lanes[BEFORE_Y, n], before, lanes[X, n], lanes[Y, n], lanes[Z, n], x_q, y_q, z_q
        )
        if miss < lanes[MISS, n]:
            lanes[MISS, n], lanes[DURATION, n] = miss, (step - 1.0 + share) * dt
        if step == lanes[CLOSES, n]:
            return True
    if _out_of_reach(medium, lanes, n):
        return True
    _fly_on(lanes, n)
    return False


@kernel
def _settle(medium, lanes, n, edge, chosen):
    """Let lane n's closest approach be the edge, where it hits and is cheaper; returns the chosen control."""
    integration = medium.integration
    duration = lanes[DURATION, n]
    if lanes[MISS, n] >= integration.tolerance:
        return chosen
    cost = edge_cost(medium.cost, duration)
    if edge[0] == CONNECTED and (cost, lanes[CONTROL, n]) >= (edge[2], chosen):
        return chosen
    x, y, z, t = lanes[START_X, n], lanes[START_Y, n], lanes[START_Z, n], lanes[START_T, n]
    direction = CLIMB if lanes[W, n] > 0.0 else DIVE
    c = control_towards(medium.polar, direction, lanes[ANGLE, n], lanes[HEADING, n])
    ends = x, y, z, t, c.u, c.v, c.w, duration, integration.dt, CLEARANCE_SPACING
    if is_clear(medium.flow, medium.terrain, *ends):
        store(edge, Edge(CONNECTED, duration, cost, c.glide_angle, c.heading, c.speed, lanes[MISS, n]))
        return lanes[CONTROL, n]
    if edge[0] == NO_HIT:
        store(edge, no_edge(BLOCKED))
    return chosen


@entry_point(nogil=True)
def connect_nodes(medium, steering, position, departure, source, indptr, target, edges, first, last):
    """The cheapest legs to all targets of source[first:last] among the candidate controls of each pair.

    CSR by source in `indptr` (n + 1,) and `target` (pairs,); `position` (nodes, 3) [m], `departure` (nodes,)
    [s]; outcomes into `edges` (pairs, fields of Edge). Equal to `closest_approach` of every control: outcomes
    do not depend on which flights share the air.
    """
    lanes = hangar(APPROACH_ROWS)
    controls = np.empty((steering.candidates, 2))
    chosen = np.empty(indptr[last] - indptr[first])
    at = np.array([first, indptr[first] - 1, 0, 0])
    flying = 0
    for n in range(LANES):
        flying += _launch(
            medium, steering, position, departure, source, indptr, target, controls, at, last, edges, lanes, n
        )
    while flying > 0:
        advance(medium.flow, lanes)
        widen(lanes)
        for n in range(LANES):
            if lanes[LEFT, n] > 0.0 or not _look(medium, lanes, n):
                continue
            k = int(lanes[PAIR, n])
            one = k - indptr[first]
            chosen[one] = _settle(medium, lanes, n, edges[k], chosen[one])
            if not _launch(
                medium, steering, position, departure, source, indptr, target, controls, at, last, edges, lanes, n
            ):
                rest(lanes, n)
                flying -= 1
