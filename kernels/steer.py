"""Steering: Broyden steps from a guess to the control that lands on its target, many problems in the air."""

import math

from .cache import inlined, kernel
from .control import glide_speed
from .flight import FLIGHT_ROWS, fly_for, place, rest
from .motion import X, Y

LANDING_TOLERANCE = 0.009
"""A landing this close to its target [m] is a hit: a little less than what an edge may miss by."""
FIRST_STEP = 3.0
"""Steps of a guess's first flight, in steps of a leg: where it lands is corrected anyway."""
MAX_ITERATIONS = 14
GIVE_UP = 5
"""By this iteration a guess that leads anywhere has cut its miss to a quarter."""
MAX_TURN = 0.35
"""Longest step in glide angle and heading [rad]: beyond it the map is no longer the guess's."""

_ROWS = range(FLIGHT_ROWS, FLIGHT_ROWS + 23)
START_X, START_Y, START_Z, START_T, GOAL_X, GOAL_Y, GOAL_Z = _ROWS[:7]
"""Rows of a lane beyond `flight`'s own: its ends [m], and when it leaves [s]."""
DIRECTION, ANGLE, HEADING, TIME, MISS, STATE = _ROWS[7:13]
"""Its control [rad], its time [s] and miss [m], its state."""
INVERSE = _ROWS[13]
"""The first of four rows: d(angle, heading) / d(x, y) of the flow map near the guess, row by row."""
_OFF_X, _OFF_Y, _TURN_A, _TURN_H, _FIRST_MISS, _ITERATION = _ROWS[17:]
STEER_ROWS = _ROWS.stop
OPEN, HIT, LOST = 1.0, 2.0, 3.0
"""States: closing in; landed on the target; it leads nowhere."""


@kernel
def aim(polar, lanes, n, direction, x, y, z, t, x_q, y_q, z_q, angle, heading, dt):
    """Send lane n off on a guess of the control [rad] from (x, y, z) at t [s] to q [m].

    The rows from INVERSE on are the caller's.
    """
    lanes[START_X, n], lanes[START_Y, n], lanes[START_Z, n], lanes[START_T, n] = x, y, z, t
    lanes[GOAL_X, n], lanes[GOAL_Y, n], lanes[GOAL_Z, n] = x_q, y_q, z_q
    lanes[DIRECTION, n], lanes[ANGLE, n], lanes[HEADING, n] = direction, angle, heading
    lanes[STATE, n], lanes[_ITERATION, n] = OPEN, 0.0
    _take_off(polar, lanes, n, FIRST_STEP * dt)


@kernel
def _take_off(polar, lanes, n, dt):
    """Lane n's control, flown from its start to its goal's depth; steps as `motion.trace` takes them."""
    direction = int(lanes[DIRECTION, n])
    angle, heading = lanes[ANGLE, n], lanes[HEADING, n]
    speed = glide_speed(polar, direction, angle)
    along = speed * math.cos(angle)
    w = (2.0 * direction - 1.0) * speed * math.sin(angle)
    x, y, z = lanes[START_X, n], lanes[START_Y, n], lanes[START_Z, n]
    place(lanes, n, x, y, z, lanes[START_T, n], along * math.cos(heading), along * math.sin(heading), w)
    lanes[TIME, n] = (lanes[GOAL_Z, n] - z) / w
    fly_for(lanes, n, lanes[TIME, n], dt)


@kernel
def correct(polar, lanes, n, dt):
    """Lane n has landed: on its target, HIT; nowhere near, LOST; else a Broyden step, and it flies again."""
    direction = int(lanes[DIRECTION, n])
    off_x, off_y = lanes[X, n] - lanes[GOAL_X, n], lanes[Y, n] - lanes[GOAL_Y, n]
    miss = math.hypot(off_x, off_y)
    lanes[MISS, n] = miss
    iteration = lanes[_ITERATION, n]
    if miss <= LANDING_TOLERANCE and iteration > 0.0:
        lanes[HEADING, n] = math.atan2(math.sin(lanes[HEADING, n]), math.cos(lanes[HEADING, n]))
        lanes[STATE, n] = HIT
        rest(lanes, n)
        return
    if iteration == 0.0:
        lanes[_FIRST_MISS, n] = miss
    else:
        _broyden(lanes, n, off_x - lanes[_OFF_X, n], off_y - lanes[_OFF_Y, n])
    lanes[_OFF_X, n], lanes[_OFF_Y, n] = off_x, off_y
    turn_a = -(lanes[INVERSE, n] * off_x + lanes[INVERSE + 1, n] * off_y)
    turn_h = -(lanes[INVERSE + 2, n] * off_x + lanes[INVERSE + 3, n] * off_y)
    shorten = min(1.0, MAX_TURN / max(abs(turn_a), abs(turn_h), MAX_TURN))
    low, high = polar.shallowest[direction], polar.steepest[direction]
    angle = min(max(lanes[ANGLE, n] + shorten * turn_a, low), high)
    lanes[_TURN_A, n], lanes[_TURN_H, n] = angle - lanes[ANGLE, n], shorten * turn_h
    # a second step beyond the glide polar's end, or none at all
    stuck = iteration > 0.0 and lanes[_TURN_A, n] == 0.0 and (turn_a != 0.0 or turn_h == 0.0)
    astray = iteration == GIVE_UP and miss > 0.25 * lanes[_FIRST_MISS, n]
    if stuck or astray or iteration == MAX_ITERATIONS - 1 or not miss < math.inf:
        lanes[STATE, n] = LOST
        rest(lanes, n)
        return
    lanes[ANGLE, n] = angle
    lanes[HEADING, n] += shorten * turn_h
    lanes[_ITERATION, n] += 1.0
    _take_off(polar, lanes, n, dt)


@inlined
def _broyden(lanes, n, dx, dy):
    """Broyden's update of the inverse Jacobian (Sherman-Morrison): it now maps (dx, dy) to the last turn."""
    da, dh = lanes[_TURN_A, n], lanes[_TURN_H, n]
    ja = lanes[INVERSE, n] * dx + lanes[INVERSE + 1, n] * dy
    jh = lanes[INVERSE + 2, n] * dx + lanes[INVERSE + 3, n] * dy
    # row vector s^T J^-1
    rx = da * lanes[INVERSE, n] + dh * lanes[INVERSE + 2, n]
    ry = da * lanes[INVERSE + 1, n] + dh * lanes[INVERSE + 3, n]
    scale = da * ja + dh * jh
    if abs(scale) < 1e-30:
        return
    ea = (da - ja) / scale
    eh = (dh - jh) / scale
    lanes[INVERSE, n] += ea * rx
    lanes[INVERSE + 1, n] += ea * ry
    lanes[INVERSE + 2, n] += eh * rx
    lanes[INVERSE + 3, n] += eh * ry
