"""Steering: Broyden steps lead from a guess to the control that lands on its target; many guesses together."""

import math

from .cache import inlined, kernel
from .control import control_towards, heading_of
from .flight import FLIGHT_ROWS, START_T, ends_of, fly_to, keep_ends, place, rest
from .flow import has_ladder, rises
from .motion import LANE_T, LANE_X, LANE_Y

LANDING_TOLERANCE = 0.009
"""A landing this close to its target [m] is a hit, if it is also within the scenario's tolerance."""
FIRST_STEP = 3.0
"""Steps of a guess's first flight, in steps of a leg: where it lands is corrected anyway. On a ladder
they are those of a leg."""
MAX_ITERATIONS = 14
GIVE_UP = 5
"""A guess is given up if it has not reduced its miss to a quarter by this iteration."""
SLOWER = 3
"""In a flow that rises it may take so many times the iterations: where a path turns, the map is as a root is."""
FLOWN = 1.25
"""In a flow that rises a control flies for this multiple of the horizon at most."""
STEEPER, STEEPENED = 0.03, 4.0
"""In a flow that rises a first guess that never reaches its target's depth is made steeper by this much [rad], so
many times at most; a later control goes half the way back to the one before it."""
MAX_TURN = 0.35
"""Longest step in glide angle and heading [rad]: beyond it the map is no longer the guess's."""

_ROWS = range(FLIGHT_ROWS, FLIGHT_ROWS + 16)
AIM_DIRECTION, AIM_ANGLE, AIM_HEADING, AIM_TIME, AIM_MISS, AIM_STATE = _ROWS[:6]
"""Rows of a lane beyond `flight`'s: its control [rad], its time [s] and miss [m], its state."""
AIM_INVERSE = _ROWS[6]
"""The first of four rows: d(angle, heading) / d(x, y) of the flow map near the guess, row by row."""
AIM_OFF_X, AIM_OFF_Y, AIM_TURN_A, AIM_TURN_H, _FIRST_MISS, _ITERATION = _ROWS[10:]
AIM_ROWS = _ROWS.stop
OPEN, HIT, LOST = 1.0, 2.0, 3.0
"""States: still improving; landed on the target; given up."""


@kernel
def aim(medium, lanes, n, direction, pair, angle, heading):
    """Send lane n off on a guess of the control [rad] that leads from the pair's start to its goal.

    The rows from AIM_INVERSE on are the caller's.
    """
    keep_ends(lanes, n, pair)
    lanes[AIM_DIRECTION, n], lanes[AIM_ANGLE, n], lanes[AIM_HEADING, n] = direction, angle, heading
    lanes[AIM_STATE, n], lanes[_ITERATION, n] = OPEN, 0.0
    lanes[AIM_TIME, n] = 0.0
    longer = 1.0 if has_ladder(medium.flow) else FIRST_STEP
    take_off(medium, lanes, n, longer * medium.integration.dt)


@inlined
def control_in(polar, lanes, n):
    """Return the control of lane n."""
    return control_towards(polar, int(lanes[AIM_DIRECTION, n]), lanes[AIM_ANGLE, n], lanes[AIM_HEADING, n])


@kernel
def take_off(medium, lanes, n, dt):
    """Lane n's control, flown from its start to its goal's depth; steps as `motion.trace` takes them.

    Its time is that of this flight; where the flow rises that is known after the landing, see `note_time`.
    """
    c = control_in(medium.polar, lanes, n)
    start, goal = ends_of(lanes, n)
    place(lanes, n, start, c)
    time = (goal.z - start.z) / c.w
    if not rises(medium.flow):
        lanes[AIM_TIME, n] = time
    longest = FLOWN * medium.integration.dt * medium.integration.steps
    fly_to(medium.flow, lanes, n, goal.z, time, longest, dt)


@inlined
def note_time(flow, lanes, n):
    """Lane n has landed; in a flow that rises its time is known only now."""
    if rises(flow):
        lanes[AIM_TIME, n] = lanes[LANE_T, n] - lanes[START_T, n]


@kernel
def correct(medium, lanes, n):
    """Lane n has landed: on its target, HIT; nowhere near, LOST; else a Broyden step, and it flies again."""
    polar, integration = medium.polar, medium.integration
    note_time(medium.flow, lanes, n)
    direction = int(lanes[AIM_DIRECTION, n])
    _, goal = ends_of(lanes, n)
    off_x, off_y = lanes[LANE_X, n] - goal.x, lanes[LANE_Y, n] - goal.y
    miss = math.hypot(off_x, off_y)
    lanes[AIM_MISS, n] = miss
    iteration = lanes[_ITERATION, n]
    patience = 1
    if rises(medium.flow):
        if not miss < math.inf and turned_back(medium, lanes, n, iteration):
            return
        iteration = iteration if iteration >= 1.0 else 0.0
        lanes[_ITERATION, n] = iteration
        patience = SLOWER
    exact = iteration > 0.0 or has_ladder(medium.flow)
    if miss <= LANDING_TOLERANCE and miss < integration.tolerance and exact:
        lanes[AIM_HEADING, n] = heading_of(math.cos(lanes[AIM_HEADING, n]), math.sin(lanes[AIM_HEADING, n]))
        lanes[AIM_STATE, n] = HIT
        rest(lanes, n)
        return
    if iteration == 0.0:
        lanes[_FIRST_MISS, n] = miss
    else:
        broyden(lanes, n, off_x - lanes[AIM_OFF_X, n], off_y - lanes[AIM_OFF_Y, n])
        if rises(medium.flow) and miss > math.hypot(lanes[AIM_OFF_X, n], lanes[AIM_OFF_Y, n]):
            # go on from the control before, with what has been learnt
            off_x, off_y = lanes[AIM_OFF_X, n], lanes[AIM_OFF_Y, n]
            lanes[AIM_ANGLE, n] -= lanes[AIM_TURN_A, n]
            lanes[AIM_HEADING, n] -= lanes[AIM_TURN_H, n]
    lanes[AIM_OFF_X, n], lanes[AIM_OFF_Y, n] = off_x, off_y
    turn_a = -(lanes[AIM_INVERSE, n] * off_x + lanes[AIM_INVERSE + 1, n] * off_y)
    turn_h = -(lanes[AIM_INVERSE + 2, n] * off_x + lanes[AIM_INVERSE + 3, n] * off_y)
    shorten = min(1.0, MAX_TURN / max(abs(turn_a), abs(turn_h), MAX_TURN))
    low, high = polar.shallowest[direction], polar.steepest[direction]
    angle = min(max(lanes[AIM_ANGLE, n] + shorten * turn_a, low), high)
    lanes[AIM_TURN_A, n], lanes[AIM_TURN_H, n] = angle - lanes[AIM_ANGLE, n], shorten * turn_h
    # give up after a second step beyond the end of the glide polar, or if there is no step
    stuck = iteration > 0.0 and lanes[AIM_TURN_A, n] == 0.0 and (turn_a != 0.0 or turn_h == 0.0)
    astray = iteration == patience * GIVE_UP and miss > 0.25 * lanes[_FIRST_MISS, n]
    if stuck or astray or iteration == patience * MAX_ITERATIONS - 1 or not miss < math.inf:
        lanes[AIM_STATE, n] = LOST
        rest(lanes, n)
        return
    lanes[AIM_ANGLE, n] = angle
    lanes[AIM_HEADING, n] += shorten * turn_h
    lanes[_ITERATION, n] += 1.0
    take_off(medium, lanes, n, integration.dt)


@kernel
def turned_back(medium, lanes, n, iteration):
    """Send lane n, which the water has kept from its target's depth, off on a control that is more likely there.

    False if enough of them have been tried.
    """
    if iteration >= 1.0:
        lanes[AIM_TURN_A, n], lanes[AIM_TURN_H, n] = 0.5 * lanes[AIM_TURN_A, n], 0.5 * lanes[AIM_TURN_H, n]
        lanes[AIM_ANGLE, n] -= lanes[AIM_TURN_A, n]
        lanes[AIM_HEADING, n] -= lanes[AIM_TURN_H, n]
        lanes[_ITERATION, n] = iteration + 1.0
    else:
        steepest = medium.polar.steepest[int(lanes[AIM_DIRECTION, n])]
        if lanes[AIM_ANGLE, n] >= steepest:
            return False
        lanes[AIM_ANGLE, n] = min(lanes[AIM_ANGLE, n] + STEEPER, steepest)
        lanes[_ITERATION, n] = iteration + 1.0 / (STEEPENED + 1.0)
    if lanes[_ITERATION, n] > SLOWER * MAX_ITERATIONS - 1.0 or (iteration < 1.0 <= lanes[_ITERATION, n] + 1e-9):
        return False
    take_off(medium, lanes, n, medium.integration.dt)
    return True


@inlined
def broyden(lanes, n, dx, dy):
    """Broyden's update of the inverse Jacobian (Sherman-Morrison): it now maps (dx, dy) to the last turn."""
    da, dh = lanes[AIM_TURN_A, n], lanes[AIM_TURN_H, n]
    ja = lanes[AIM_INVERSE, n] * dx + lanes[AIM_INVERSE + 1, n] * dy
    jh = lanes[AIM_INVERSE + 2, n] * dx + lanes[AIM_INVERSE + 3, n] * dy
    # row vector s^T J^-1
    rx = da * lanes[AIM_INVERSE, n] + dh * lanes[AIM_INVERSE + 2, n]
    ry = da * lanes[AIM_INVERSE + 1, n] + dh * lanes[AIM_INVERSE + 3, n]
    scale = da * ja + dh * jh
    if abs(scale) < 1e-30:
        return
    ea = (da - ja) / scale
    eh = (dh - jh) / scale
    lanes[AIM_INVERSE, n] += ea * rx
    lanes[AIM_INVERSE + 1, n] += ea * ry
    lanes[AIM_INVERSE + 2, n] += eh * rx
    lanes[AIM_INVERSE + 3, n] += eh * ry
