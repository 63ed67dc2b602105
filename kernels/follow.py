"""Following: the exact legs of a node at one departure are first guesses of its legs at the next.

A leg changes little from one departure to the next, so its control, moved on as it moved before, lands metres
from the target; a few coarse flights find it again, and where these are not good enough a fine one. Each leg that
is found is a first guess, too, for the nodes near its target: so what the current brings into reach is found
without a fan.
"""

import math

import numpy as np

from .cache import entry_point, kernel, making
from .control import CLIMB, DIVE, heading_of, horizontal_speed, vertical_speed
from .edges import BLOCKED, CONNECTED, NO_HIT, no_edge, store
from .flight import (
    LANE_LEFT,
    advance,
    ends_of,
    hangar,
    keep_ends,
    rest,
    stretch,
    widen,
)
from .flow import current, rises
from .motion import LANE_X, LANE_Y, LANES
from .patch import longer
from .place import Pair, Place
from .reach import LATEST, LEG_COLUMNS, LEG_EDGE, LEG_NODE, checked_leg, horizon_of, ranks
from .steer import (
    AIM_ANGLE,
    AIM_DIRECTION,
    AIM_HEADING,
    AIM_INVERSE,
    AIM_MISS,
    AIM_OFF_X,
    AIM_OFF_Y,
    AIM_ROWS,
    AIM_STATE,
    AIM_TIME,
    AIM_TURN_A,
    AIM_TURN_H,
    HIT,
    LANDING_TOLERANCE,
    LOST,
    MAX_TURN,
    OPEN,
    broyden,
    note_time,
    take_off,
)

LEG_STATUS, LEG_TIME, LEG_COST, LEG_ANGLE, LEG_HEADING, LEG_SPEED, LEG_MISS = range(LEG_EDGE, LEG_COLUMNS)
"""Columns of a followed leg, after its target: the fields of `Edge`."""
_COLUMNS = range(LEG_COLUMNS, LEG_COLUMNS + 10)
LEG_INVERSE = _COLUMNS[0]
"""The first of four: d(angle, heading) / d(x, y) of the flow map there."""
LEG_COARSE_X, LEG_COARSE_Y = _COLUMNS[4:6]
"""The distance [m] between the ends of its coarse flight and of its fine flight."""
LEG_RATE_A, LEG_RATE_H = _COLUMNS[6:8]
"""The rate at which its control changes with the departure [rad/s]."""
LEG_KNOWN, LEG_CHOSEN = _COLUMNS[8:]
"""Whether the columns from LEG_INVERSE on are known; whether it is one of the node's edges, not only followed."""
FOLLOWED_COLUMNS = _COLUMNS.stop
GUESS_ORIGIN, GUESS_SLOT, GUESS_TURN = range(FOLLOWED_COLUMNS, FOLLOWED_COLUMNS + 3)
"""Columns of a guess beyond those of a leg: its node's place in the batch, its leg's, how far it was turned."""
GUESS_COLUMNS = FOLLOWED_COLUMNS + 3
SLOT_NODE, SLOT_TRIES, SLOT_PENDING = range(3)
"""Of each leg of a batch: its node's place there, guesses that were flown for it, the guess that waits for it."""
NOBODYS, NOT_ASKED = -1, -2
"""Two values instead of the number of a leg: no leg to this node was searched yet; none may be searched."""

COARSE_STEP = 6.0
"""Steps of a coarse flight, in steps of a leg: where it lands is corrected by how far off it was before."""
COARSE_TOLERANCE = 0.05
"""A coarse flight that lands so near its target [m], corrected by as little, needs no fine one."""
FORESEEN = 0.02
"""Nor does a step need a flight, from a miss of NEAR at most, if no more than that [m] is left when it shrinks
the miss as the step before did. From further a step is less like the one before: 0.4 m were left of 1.5 m."""
NEAR = 0.3
"""From a miss below this [m] the next step lands on the target."""
MOST_COARSE, MOST_FINE = 7, 4
GIVE_UP = 3
"""A guess is given up if it has not reduced its miss to a quarter by this coarse flight, counted from 0."""
TILT = 1e-3
"""A control is changed by this much [rad] to measure the derivatives of the flow map."""
MOST_TRIES = 3
"""For a target at most this many guesses from its neighbours are flown."""
FURTHEST = 1.0
"""A guess from a neighbour is dropped if its control was turned by more than this [rad]."""
BEYOND, BENT = 0.04, 0.25
"""A guess so far [rad] beyond the glide polar's end is flown from its end, and BENT times its turn squared."""
SPREADS = 1.05
"""A guess from a neighbour is dropped if it may take longer than this multiple of the slowest edge's time."""
HELD = 1.1
"""Legs slower than the slowest edge are followed too, to so many times its time, where edges have a limit."""

_ROWS = range(AIM_ROWS, AIM_ROWS + 11)
_MODE, _COUNT, _FIRST, _LAST, _SHIFT_X, _SHIFT_Y = _ROWS[:6]
_BASE_X, _BASE_Y, _BY_A_X, _BY_A_Y, _TILT_A = _ROWS[6:]
FOLLOW_ROWS = _ROWS.stop
_BASE, _TILTED_A, _TILTED_H, _COARSE, _FINE = 0.0, 1.0, 2.0, 3.0, 4.0


@kernel
def _send(medium, position, source, departure, since, guess, lanes, n):
    """Aim lane n by a guess; where its flow map is not known, first where it was right, `since` [s] before."""
    x, y, z = position[source[int(guess[GUESS_ORIGIN])]]
    x_q, y_q, z_q = position[int(guess[LEG_NODE])]
    t = departure if guess[LEG_KNOWN] else departure - since
    keep_ends(lanes, n, Pair(Place(x, y, z, t), Place(x_q, y_q, z_q, t)))
    lanes[AIM_DIRECTION, n] = CLIMB if guess[LEG_ANGLE] > 0.0 else DIVE
    lanes[AIM_ANGLE, n], lanes[AIM_HEADING, n] = abs(guess[LEG_ANGLE]), guess[LEG_HEADING]
    for m in range(4):
        lanes[AIM_INVERSE + m, n] = guess[LEG_INVERSE + m]
    lanes[_SHIFT_X, n], lanes[_SHIFT_Y, n] = guess[LEG_COARSE_X], guess[LEG_COARSE_Y]
    lanes[AIM_STATE, n], lanes[_COUNT, n] = OPEN, 0.0
    lanes[_MODE, n] = _COARSE if guess[LEG_KNOWN] else _BASE
    take_off(medium, lanes, n, COARSE_STEP * medium.integration.dt)


@kernel
def _turned(polar, lanes, n, off_x, off_y):
    """Turn lane n's control to remove its miss [m]; False if the glide polar ends before that."""
    direction = int(lanes[AIM_DIRECTION, n])
    lanes[AIM_OFF_X, n], lanes[AIM_OFF_Y, n] = off_x, off_y
    turn_a = -(lanes[AIM_INVERSE, n] * off_x + lanes[AIM_INVERSE + 1, n] * off_y)
    turn_h = -(lanes[AIM_INVERSE + 2, n] * off_x + lanes[AIM_INVERSE + 3, n] * off_y)
    if not abs(turn_a) + abs(turn_h) < math.inf:
        return False
    shorten = min(1.0, MAX_TURN / max(abs(turn_a), abs(turn_h), MAX_TURN))
    low, high = polar.shallowest[direction], polar.steepest[direction]
    angle = min(max(lanes[AIM_ANGLE, n] + shorten * turn_a, low), high)
    lanes[AIM_TURN_A, n], lanes[AIM_TURN_H, n] = angle - lanes[AIM_ANGLE, n], shorten * turn_h
    if lanes[AIM_TURN_A, n] == 0.0 and turn_a != 0.0 and lanes[_COUNT, n] > 0.0:
        return False
    lanes[AIM_ANGLE, n] = angle
    lanes[AIM_HEADING, n] += shorten * turn_h
    return True


@kernel
def _measure(medium, lanes, n, off_x, off_y, since):
    """Lane n has flown for its flow map's derivatives, and for its shift: on to the next flight."""
    mode = lanes[_MODE, n]
    if mode == _BASE:
        lanes[_BASE_X, n], lanes[_BASE_Y, n] = off_x, off_y
        steepest = medium.polar.steepest[int(lanes[AIM_DIRECTION, n])]
        lanes[_TILT_A, n] = TILT if lanes[AIM_ANGLE, n] + TILT <= steepest else -TILT
        lanes[AIM_ANGLE, n] += lanes[_TILT_A, n]
        lanes[_MODE, n] = _TILTED_A
    elif mode == _TILTED_A:
        lanes[_BY_A_X, n] = (off_x - lanes[_BASE_X, n]) / lanes[_TILT_A, n]
        lanes[_BY_A_Y, n] = (off_y - lanes[_BASE_Y, n]) / lanes[_TILT_A, n]
        lanes[AIM_ANGLE, n] -= lanes[_TILT_A, n]
        lanes[AIM_HEADING, n] += TILT
        lanes[_MODE, n] = _TILTED_H
    else:
        x_h, y_h = (off_x - lanes[_BASE_X, n]) / TILT, (off_y - lanes[_BASE_Y, n]) / TILT
        x_a, y_a = lanes[_BY_A_X, n], lanes[_BY_A_Y, n]
        lanes[AIM_HEADING, n] -= TILT
        det = x_a * y_h - x_h * y_a
        lanes[AIM_INVERSE, n], lanes[AIM_INVERSE + 1, n] = y_h / det, -x_h / det
        lanes[AIM_INVERSE + 2, n], lanes[AIM_INVERSE + 3, n] = -y_a / det, x_a / det
        lanes[_SHIFT_X, n], lanes[_SHIFT_Y, n] = lanes[_BASE_X, n], lanes[_BASE_Y, n]
        start, goal = ends_of(lanes, n)
        t = start.t + since
        keep_ends(lanes, n, Pair(Place(start.x, start.y, start.z, t), Place(goal.x, goal.y, goal.z, t)))
        lanes[_MODE, n] = _COARSE
    take_off(medium, lanes, n, COARSE_STEP * medium.integration.dt)


@kernel
def _meet(integration, lanes, n, miss):
    """End lane n with a miss [m]: its state is HIT if the miss is below the tolerance, else LOST."""
    lanes[AIM_MISS, n] = miss
    lanes[AIM_HEADING, n] = heading_of(math.cos(lanes[AIM_HEADING, n]), math.sin(lanes[AIM_HEADING, n]))
    lanes[AIM_STATE, n] = HIT if miss < integration.tolerance else LOST
    rest(lanes, n)


@kernel
def _landed(medium, since, lanes, n):
    """Decide on lane n after its landing: HIT on its target, LOST far from it; else turn it and fly again."""
    polar, integration, dt = medium.polar, medium.integration, medium.integration.dt
    note_time(medium.flow, lanes, n)
    _, goal = ends_of(lanes, n)
    off_x, off_y = lanes[LANE_X, n] - goal.x, lanes[LANE_Y, n] - goal.y
    lanes[AIM_STATE, n] = OPEN
    if lanes[_MODE, n] < _COARSE:
        _measure(medium, lanes, n, off_x, off_y, since)
        return
    fine = lanes[_MODE, n] == _FINE
    if not fine:
        off_x, off_y = off_x - lanes[_SHIFT_X, n], off_y - lanes[_SHIFT_Y, n]
    miss = math.hypot(off_x, off_y)
    shift = math.hypot(lanes[_SHIFT_X, n], lanes[_SHIFT_Y, n])
    coarse_is_enough = not fine and shift <= COARSE_TOLERANCE and integration.tolerance > 2.0 * COARSE_TOLERANCE
    if rises(medium.flow):  # a coarse flight does not know its time well enough
        coarse_is_enough = False
    count = lanes[_COUNT, n]
    first_fine = fine and count == 0.0
    if first_fine:
        # the coarse flight with this control would have landed on the target, its shift taken off
        lanes[_SHIFT_X, n], lanes[_SHIFT_Y, n] = lanes[_SHIFT_X, n] - off_x, lanes[_SHIFT_Y, n] - off_y
    if fine and miss <= LANDING_TOLERANCE:
        _meet(integration, lanes, n, miss)
        return
    if coarse_is_enough and miss <= COARSE_TOLERANCE:
        _meet(integration, lanes, n, miss + shift)
        return
    if count == 0.0:
        lanes[_FIRST, n] = miss
    elif not first_fine:
        broyden(lanes, n, off_x - lanes[AIM_OFF_X, n], off_y - lanes[AIM_OFF_Y, n])
    left = miss * miss / lanes[_LAST, n] if count > 0.0 else math.inf
    lanes[_LAST, n] = miss
    astray = not fine and count == GIVE_UP and miss > 0.25 * lanes[_FIRST, n]
    late = count == (MOST_FINE if fine else MOST_COARSE) - 1.0
    if astray or late or not miss < math.inf or not _turned(polar, lanes, n, off_x, off_y):
        lanes[AIM_STATE, n] = LOST
        rest(lanes, n)
        return
    if coarse_is_enough and miss <= NEAR and left <= FORESEEN:
        start, goal = ends_of(lanes, n)
        direction = int(lanes[AIM_DIRECTION, n])
        lanes[AIM_TIME, n] = abs(goal.z - start.z) / vertical_speed(polar, direction, lanes[AIM_ANGLE, n])
        _meet(integration, lanes, n, left + shift)
        return
    lanes[_COUNT, n] += 1.0
    if not fine and miss <= NEAR and not coarse_is_enough:
        lanes[_MODE, n], lanes[_COUNT, n] = _FINE, 0.0
        fine = True
    take_off(medium, lanes, n, dt if fine else COARSE_STEP * dt)


@making
def _fly(medium, position, source, departure, since, guesses, count, legs, lanes):
    """Fly all guesses to their ends; a guess that reaches its target becomes the leg."""
    flying = np.zeros(LANES, np.int64)
    horizon = horizon_of(medium)
    following, busy = 0, 0
    lanes[LANE_LEFT] = math.inf
    for n in range(LANES):
        if following < count:
            flying[n] = following
            _send(medium, position, source, departure, since, guesses[following], lanes, n)
            following += 1
            busy += 1
    while busy > 0:
        advance(medium.flow, lanes)
        widen(lanes)
        for n in range(LANES):
            if lanes[LANE_LEFT, n] > 0.0:
                continue
            _landed(medium, since, lanes, n)
            if lanes[AIM_STATE, n] == OPEN and lanes[AIM_TIME, n] <= LATEST * horizon:
                continue
            if lanes[AIM_STATE, n] == HIT and lanes[AIM_TIME, n] <= horizon:
                _take(medium, lanes, n, legs[int(guesses[flying[n], GUESS_SLOT])])
            if following < count:
                flying[n] = following
                _send(medium, position, source, departure, since, guesses[following], lanes, n)
                following += 1
            else:
                rest(lanes, n)
                busy -= 1


@kernel
def _take(medium, lanes, n, leg):
    """Make a leg from the result of lane n if it passes the checks."""
    if lanes[_MODE, n] == _COARSE:
        # between its steps it may have been a little further out
        between = 0.5 * COARSE_STEP * medium.integration.dt
        between *= medium.flow.extent.max_speed + medium.polar.best_horizontal[int(lanes[AIM_DIRECTION, n])]
        stretch(lanes, n, between)
    edge = checked_leg(medium, lanes, n)
    if edge.status != CONNECTED and edge.status != BLOCKED:
        return
    store(leg[LEG_STATUS:LEG_INVERSE], edge)
    if edge.status == BLOCKED:  # its control is followed all the same: the way may open
        climbs = lanes[AIM_DIRECTION, n] == CLIMB
        leg[LEG_ANGLE] = lanes[AIM_ANGLE, n] if climbs else -lanes[AIM_ANGLE, n]
        leg[LEG_HEADING] = lanes[AIM_HEADING, n]
    for m in range(4):
        leg[LEG_INVERSE + m] = lanes[AIM_INVERSE + m, n]
    leg[LEG_COARSE_X], leg[LEG_COARSE_Y], leg[LEG_KNOWN] = lanes[_SHIFT_X, n], lanes[_SHIFT_Y, n], 1.0


@kernel
def _neighbours_guess(medium, position, z_p, leg, over, r, guess):
    """A first guess for the target r out of a leg to another, into `guess`; its time [s], inf where it is none.

    The leg, which began at the height z_p [m], is flown on, or less far, to r's depth at its last velocity over
    ground, `over` [m/s], and turned by what it then misses.
    """
    polar = medium.polar
    direction = CLIMB if leg[LEG_ANGLE] > 0.0 else DIVE
    x, y, z = position[int(leg[LEG_NODE])]
    x_r, y_r, z_r = position[r]
    angle, heading = abs(leg[LEG_ANGLE]), leg[LEG_HEADING]
    since = (2.0 * direction - 1.0) * (z_r - z) / vertical_speed(polar, direction, angle)
    if rises(medium.flow):
        since = (z_r - z) / over[2]
    off_x, off_y = x + since * over[0] - x_r, y + since * over[1] - y_r
    turn_a = -(leg[LEG_INVERSE] * off_x + leg[LEG_INVERSE + 1] * off_y)
    turn_h = -(leg[LEG_INVERSE + 2] * off_x + leg[LEG_INVERSE + 3] * off_y)
    turn = max(abs(turn_a), abs(turn_h))
    low, high = polar.shallowest[direction], polar.steepest[direction]
    beyond = BEYOND + BENT * turn * turn
    if not turn < FURTHEST or angle + turn_a < low - beyond or angle + turn_a > high + beyond:
        return math.inf
    angle = min(max(angle + turn_a, low), high)
    for m in range(FOLLOWED_COLUMNS):  # not a slice, which makes a copy
        guess[m] = leg[m]
    guess[LEG_NODE], guess[GUESS_TURN] = r, turn
    guess[LEG_ANGLE], guess[LEG_HEADING] = (angle if direction == CLIMB else -angle), heading + turn_h
    if rises(medium.flow):
        return _time_of(medium, position, z_p, leg) + since
    return abs(z_r - z_p) / vertical_speed(polar, direction, angle)


@kernel
def _time_of(medium, position, z_p, leg):
    """Return how long a leg takes [s]; of a blocked one in a flow that rises, about how long."""
    if rises(medium.flow) and not math.isnan(leg[LEG_TIME]):
        return leg[LEG_TIME]
    direction, z = CLIMB if leg[LEG_ANGLE] > 0.0 else DIVE, position[int(leg[LEG_NODE]), 2]
    return abs(z - z_p) / vertical_speed(medium.polar, direction, abs(leg[LEG_ANGLE]))


@kernel
def _over_ground(medium, position, z_p, departure, leg):
    """Return the velocity over ground [m/s] at the end of a leg."""
    direction = CLIMB if leg[LEG_ANGLE] > 0.0 else DIVE
    x, y, z = position[int(leg[LEG_NODE])]
    angle = abs(leg[LEG_ANGLE])
    u, v, w = current(medium.flow, x, y, z, departure + _time_of(medium, position, z_p, leg))
    along = horizontal_speed(medium.polar, direction, angle)
    w += (2.0 * direction - 1.0) * vertical_speed(medium.polar, direction, angle)
    return u + along * math.cos(leg[LEG_HEADING]), v + along * math.sin(leg[LEG_HEADING]), w


@making
def _slowest_edges(legs, slots, count, nodes, limit, horizon):
    """By when [s] the edges of each node and direction arrive, (nodes, 2): the horizon but for a limit."""
    cut = np.full((nodes, 2), horizon)
    if limit == 0:
        return cut
    met = np.zeros((nodes, 2), np.int64)
    for k in ranks(legs[:count, LEG_TIME].copy()):
        n, direction = slots[k, SLOT_NODE], CLIMB if legs[k, LEG_ANGLE] > 0.0 else DIVE
        if legs[k, LEG_STATUS] == CONNECTED:
            met[n, direction] += 1
            if met[n, direction] == limit:
                cut[n, direction] = legs[k, LEG_TIME]
    return cut


@making
def _neighbours_guesses(
    medium, position, near, source, departure, before, cut, where, legs, slots, count, guesses
):  # fmt: skip
    """Guesses for the nodes near the targets of legs that were NO_HIT `before`, the nearest guess of each.

    Returns (legs, slots, count, guesses, asked): a target that nobody has looked at gets its leg, NO_HIT.
    """
    asked = 0
    for k in range(count):
        slots[k, SLOT_PENDING] = -1
    for k in range(before.size):
        n, direction = slots[k, SLOT_NODE], CLIMB if legs[k, LEG_ANGLE] > 0.0 else DIVE
        new = legs[k, LEG_STATUS] != NO_HIT and before[k] == NO_HIT
        if not new or legs[k, LEG_TIME] > HELD * cut[n, direction]:
            continue
        z_p = position[source[n], 2]
        over = _over_ground(medium, position, z_p, departure, legs[k])
        for m in range(near.shape[1]):
            r = near[int(legs[k, LEG_NODE]), m]
            slot = where[n, r]
            if (2.0 * direction - 1.0) * (position[r, 2] - z_p) <= 0.0 or slot == NOT_ASKED:
                continue
            if slot >= 0 and (slots[slot, SLOT_TRIES] >= MOST_TRIES or legs[slot, LEG_STATUS] != NO_HIT):
                continue
            guesses = longer(guesses, asked + 1)
            guess = guesses[asked]
            time = _neighbours_guess(medium, position, z_p, legs[k], over, r, guess)
            if not time <= SPREADS * cut[n, direction]:
                continue
            if slot < 0:
                slot = count
                count += 1
                legs, slots = longer(legs, count), longer(slots, count)
                store(legs[slot, LEG_STATUS:LEG_INVERSE], no_edge(NO_HIT))
                legs[slot, LEG_INVERSE:] = 0.0
                legs[slot, LEG_NODE], legs[slot, LEG_ANGLE] = r, legs[k, LEG_ANGLE]
                slots[slot, SLOT_NODE], slots[slot, SLOT_TRIES], slots[slot, SLOT_PENDING] = n, 0, -1
                where[n, r] = slot
            guess[GUESS_ORIGIN], guess[GUESS_SLOT] = n, slot
            other = slots[slot, SLOT_PENDING]
            if other < 0:
                slots[slot, SLOT_PENDING] = asked
                asked += 1
            elif guess[GUESS_TURN] < guesses[other, GUESS_TURN]:
                guesses[other] = guess
    for k in range(asked):
        slots[int(guesses[k, GUESS_SLOT]), SLOT_TRIES] += 1
    return legs, slots, count, guesses, asked


@making
def _asked_for(indptr, target, first, last, nodes):
    """Which leg is to which node, (last - first, nodes): NOBODYS, or NOT_ASKED if `indptr` does not name it."""
    where = np.full((last - first, nodes), NOBODYS if indptr.size == 0 else NOT_ASKED, np.int32)
    if indptr.size > 0:
        for n in range(first, last):
            for k in range(indptr[n], indptr[n + 1]):
                where[n - first, target[k]] = NOBODYS
    return where


@entry_point(nogil=True)
def follow_nodes(
    medium, position, near, source, departure, since, indptr, target, limit, held, holds, counts, found, first,
    last,
):  # fmt: skip
    """The legs from the nodes source[first:last] at a departure [s], by those that they had `since` [s] before.

    `near` (nodes, k): nodes beside each, to which its legs lead on. `held` (n, any, FOLLOWED_COLUMNS), `holds`
    (n,) legs of each. To the nodes `target[indptr[n]:indptr[n + 1]]`, or to all where `indptr` is empty; with a
    `limit` the fastest so many of each direction are LEG_CHOSEN. All pairs that were looked at, by rising node,
    into rows of `found` (n, capacity, FOLLOWED_COLUMNS); a count above the capacity says how much is needed.
    """
    horizon = horizon_of(medium)
    lanes = hangar(FOLLOW_ROWS)
    where = _asked_for(indptr, target, first, last, position.shape[0])
    followed = np.sum(holds[first:last])
    legs = np.empty((2 * followed + 1, FOLLOWED_COLUMNS))
    slots = np.zeros((2 * followed + 1, 3), np.int64)
    guesses = np.empty((followed + 1, GUESS_COLUMNS))
    count = 0
    for n in range(last - first):
        for k in range(holds[first + n]):
            guesses[count, :FOLLOWED_COLUMNS] = held[first + n, k]
            guesses[count, GUESS_ORIGIN], guesses[count, GUESS_SLOT] = n, count
            _moved_on(medium.polar, guesses[count], since)
            legs[count] = held[first + n, k]
            store(legs[count, LEG_STATUS:LEG_INVERSE], no_edge(NO_HIT))
            legs[count, LEG_ANGLE] = held[first + n, k, LEG_ANGLE]
            slots[count, SLOT_NODE] = n
            where[n, int(legs[count, LEG_NODE])] = count
            count += 1
    asked = count
    cut = np.full((last - first, 2), horizon)
    while asked > 0:
        before = legs[:count, LEG_STATUS].copy()
        _fly(medium, position, source[first:last], departure, since, guesses, asked, legs, lanes)
        cut = _slowest_edges(legs, slots, count, last - first, limit, horizon)
        legs, slots, count, guesses, asked = _neighbours_guesses(
            medium, position, near, source[first:last], departure, before, cut, where, legs, slots, count, guesses
        )
    _note_rates(legs, since, held, holds, first, last)
    _hand_over(legs, slots, count, limit, cut, counts, found, first, last)


@kernel
def _moved_on(polar, guess, since):
    """Change a leg's control at the same rate as before."""
    climbs = guess[LEG_ANGLE] > 0.0
    direction = CLIMB if climbs else DIVE
    low, high = polar.shallowest[direction], polar.steepest[direction]
    angle = min(max(abs(guess[LEG_ANGLE]) + since * guess[LEG_RATE_A], low), high)
    guess[LEG_ANGLE] = angle if climbs else -angle
    guess[LEG_HEADING] += since * guess[LEG_RATE_H]


@kernel
def _note_rates(legs, since, held, holds, first, last):
    """Measure the rates at which the controls of the followed legs have changed with the departure."""
    at = 0
    for n in range(first, last):
        for k in range(holds[n]):
            leg, before = legs[at], held[n, k]
            turn_a = abs(leg[LEG_ANGLE]) - abs(before[LEG_ANGLE])
            turn_h = leg[LEG_HEADING] - before[LEG_HEADING]
            turn_h = math.atan2(math.sin(turn_h), math.cos(turn_h))
            leg[LEG_RATE_A], leg[LEG_RATE_H] = 0.0, 0.0
            # further it is another leg, and not the same, moved on
            if abs(turn_a) < MAX_TURN and abs(turn_h) < MAX_TURN:
                leg[LEG_RATE_A], leg[LEG_RATE_H] = turn_a / since, turn_h / since
            at += 1


@making
def _hand_over(legs, slots, count, limit, cut, counts, found, first, last):
    """Which of the legs are edges, and all by rising node into `found`."""
    chosen = np.zeros((last - first, 2), np.int64)
    # costs rise with times; NaN, of what is not connected, sorts last
    for k in ranks(legs[:count, LEG_TIME].copy()):
        n, direction = slots[k, SLOT_NODE], CLIMB if legs[k, LEG_ANGLE] > 0.0 else DIVE
        legs[k, LEG_CHOSEN] = 1.0 if limit == 0 or chosen[n, direction] < limit else 0.0
        chosen[n, direction] += 1
    counts[first:last] = 0
    for k in ranks(legs[:count, LEG_NODE].copy()):
        n, direction = slots[k, SLOT_NODE], CLIMB if legs[k, LEG_ANGLE] > 0.0 else DIVE
        if legs[k, LEG_CHOSEN] == 0.0 and not legs[k, LEG_TIME] <= HELD * cut[n, direction]:
            continue
        if counts[first + n] < found.shape[1]:
            found[first + n, counts[first + n]] = legs[k]
        counts[first + n] += 1
