"""Steering: Broyden steps from guesses to the controls that land on their targets, LANES problems at once."""

import math

import numpy as np
from numba import njit

from .control import glide_speed
from .motion import LANE_ROWS, LANES, H, T, U, V, W, X, Y, Z, rk4_lanes

LANDING_TOLERANCE = 0.005
"""A landing this close to its target [m] is a hit: half of what an edge may miss by."""
MAX_ITERATIONS = 14
GIVE_UP = 5
"""By this iteration a guess that leads anywhere has cut its miss to a quarter."""
MAX_TURN = 0.35
"""Longest step in glide angle and heading [rad]: beyond it the map is no longer the guess's."""

_ROWS = range(LANE_ROWS, LANE_ROWS + 25)
START_X, START_Y, START_Z, GOAL_X, GOAL_Y, GOAL_Z, ANGLE, HEADING, TIME, MISS, STATE = _ROWS[:11]
"""Rows of a lane beyond `motion`'s own: its ends [m], its control [rad], its time [s] and miss [m], its state."""
X_LO, X_HI, Y_LO, Y_HI = _ROWS[11:15]
"""The box [m] about where the steps of a lane's last flight began."""
INVERSE = _ROWS[15]
"""The first of four rows: d(angle, heading) / d(x, y) of the flow map near the guess, row by row."""
_OFF_X, _OFF_Y, _TURN_A, _TURN_H, _FIRST_MISS, _ITERATION = _ROWS[19:]
STEER_ROWS = _ROWS.stop
IDLE, OPEN, HIT, LOST = 0.0, 1.0, 2.0, 3.0
"""States: nothing to do; closing in; landed on the target within the horizon; it leads nowhere."""


@njit
def steering_lanes():
    """Lanes without anything to do: (STEER_ROWS, LANES)."""
    return np.zeros((STEER_ROWS, LANES))


@njit
def aim(lanes, n, x, y, z, x_q, y_q, z_q, angle, heading):
    """Give lane n a guess of the control [rad] from (x, y, z) to q [m]; rows from INVERSE on are the caller's."""
    lanes[START_X, n], lanes[START_Y, n], lanes[START_Z, n] = x, y, z
    lanes[GOAL_X, n], lanes[GOAL_Y, n], lanes[GOAL_Z, n] = x_q, y_q, z_q
    lanes[ANGLE, n], lanes[HEADING, n] = angle, heading
    lanes[STATE, n], lanes[_ITERATION, n] = OPEN, 0.0


@njit
def land_lanes(flow, polar, direction, t, dt, lanes):
    """Fly the open lanes' controls to their targets' depths, all left at t [s]: landings in rows X, Y.

    Steps of `dt` [s] and a last, shorter one, as `motion.trace`.
    """
    sign = 2.0 * direction - 1.0
    longest = 0.0
    for n in range(LANES):
        angle, heading = lanes[ANGLE, n], lanes[HEADING, n]
        speed = glide_speed(polar, direction, angle)
        along = speed * math.cos(angle)
        lanes[U, n] = along * math.cos(heading)
        lanes[V, n] = along * math.sin(heading)
        lanes[W, n] = speed * math.sin(sign * angle)
        lanes[X, n], lanes[Y, n] = lanes[START_X, n], lanes[START_Y, n]
        lanes[X_LO, n], lanes[X_HI, n] = lanes[X, n], lanes[X, n]
        lanes[Y_LO, n], lanes[Y_HI, n] = lanes[Y, n], lanes[Y, n]
        flies = lanes[STATE, n] == OPEN
        lanes[TIME, n] = (lanes[GOAL_Z, n] - lanes[START_Z, n]) / lanes[W, n] if flies else 0.0
        longest = max(longest, lanes[TIME, n])
    for step in range(math.ceil(longest / dt)):
        for n in range(LANES):
            lanes[X_LO, n], lanes[X_HI, n] = min(lanes[X_LO, n], lanes[X, n]), max(lanes[X_HI, n], lanes[X, n])
            lanes[Y_LO, n], lanes[Y_HI, n] = min(lanes[Y_LO, n], lanes[Y, n]), max(lanes[Y_HI, n], lanes[Y, n])
            lanes[T, n] = t + step * dt
            lanes[Z, n] = lanes[START_Z, n] + step * dt * lanes[W, n]
            lanes[H, n] = min(dt, max(0.0, lanes[TIME, n] - step * dt))
        rk4_lanes(flow, lanes)


@njit
def steer_lanes(flow, polar, direction, t, dt, horizon, lanes):
    """One flight of the open lanes, and for those that miss a Broyden step of the control: a new STATE."""
    low, high = polar.shallowest[direction], polar.steepest[direction]
    land_lanes(flow, polar, direction, t, dt, lanes)
    for n in range(LANES):
        if lanes[STATE, n] != OPEN:
            continue
        off_x, off_y = lanes[X, n] - lanes[GOAL_X, n], lanes[Y, n] - lanes[GOAL_Y, n]
        miss = math.hypot(off_x, off_y)
        lanes[MISS, n] = miss
        iteration = lanes[_ITERATION, n]
        if miss <= LANDING_TOLERANCE:
            lanes[STATE, n] = HIT if lanes[TIME, n] <= horizon else LOST
            lanes[HEADING, n] = math.atan2(math.sin(lanes[HEADING, n]), math.cos(lanes[HEADING, n]))
            continue
        astray = iteration == GIVE_UP and miss > 0.25 * lanes[_FIRST_MISS, n]
        if astray or iteration == MAX_ITERATIONS - 1 or not miss < math.inf:
            lanes[STATE, n] = LOST
            continue
        if iteration == 0:
            lanes[_FIRST_MISS, n] = miss
        else:
            _broyden(lanes, n, off_x - lanes[_OFF_X, n], off_y - lanes[_OFF_Y, n])
        lanes[_OFF_X, n], lanes[_OFF_Y, n] = off_x, off_y
        turn_a = -(lanes[INVERSE, n] * off_x + lanes[INVERSE + 1, n] * off_y)
        turn_h = -(lanes[INVERSE + 2, n] * off_x + lanes[INVERSE + 3, n] * off_y)
        shorten = min(1.0, MAX_TURN / max(abs(turn_a), abs(turn_h), MAX_TURN))
        angle = min(max(lanes[ANGLE, n] + shorten * turn_a, low), high)
        lanes[_TURN_A, n], lanes[_TURN_H, n] = angle - lanes[ANGLE, n], shorten * turn_h
        lanes[ANGLE, n] = angle
        lanes[HEADING, n] += shorten * turn_h
        lanes[_ITERATION, n] += 1.0
        if not (lanes[_TURN_A, n] != 0.0 or lanes[_TURN_H, n] != 0.0):
            lanes[STATE, n] = LOST


@njit(inline="always")
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
