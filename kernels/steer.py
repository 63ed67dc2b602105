"""Steering: Broyden steps from a guess to the control that lands on a target, LANES problems at once."""

import math

import numpy as np
from numba import njit

from .control import glide_speed
from .motion import LANES, H, T, U, V, W, X, Y, Z, rk4_lanes

LANDING_TOLERANCE = 0.005
"""A landing this close to its target [m] is a hit: half of what an edge may miss by."""
MAX_ITERATIONS = 14
GIVE_UP = 5
"""By this iteration a guess that leads anywhere has cut its miss to a quarter."""
MAX_TURN = 0.35
"""Longest step in glide angle and heading [rad]: beyond it the map is no longer the guess's."""


TIME, MISS_X, MISS_Y, TURN_A, TURN_H, FIRST_MISS = range(16, 22)
"""Rows of a lanes array beyond `motion`'s own."""


@njit
def land_lanes(flow, polar, direction, origin, z_target, t, angle, heading, dt, lanes):
    """Where LANES controls land at their target depths: into rows X, Y of `lanes`; row TIME: how long [s].

    `origin` (3, LANES) [m], all left at time t [s]. Steps of `dt` and a last, shorter one, as `motion.trace`.
    """
    sign = 2.0 * direction - 1.0
    longest = 0.0
    for n in range(LANES):
        speed = glide_speed(polar, direction, angle[n])
        along = speed * math.cos(angle[n])
        lanes[U, n] = along * math.cos(heading[n])
        lanes[V, n] = along * math.sin(heading[n])
        lanes[W, n] = speed * math.sin(sign * angle[n])
        lanes[X, n], lanes[Y, n] = origin[0, n], origin[1, n]
        lanes[TIME, n] = (z_target[n] - origin[2, n]) / lanes[W, n]
        longest = max(longest, lanes[TIME, n])
    for step in range(math.ceil(longest / dt)):
        for n in range(LANES):
            lanes[T, n] = t + step * dt
            lanes[Z, n] = origin[2, n] + step * dt * lanes[W, n]
            lanes[H, n] = min(dt, max(0.0, lanes[TIME, n] - step * dt))
        rk4_lanes(flow, lanes)


@njit
def steer_lanes(flow, polar, direction, origin, target, t, angle, heading, inverse, dt, horizon, found, lanes):
    """Polish LANES guesses in place: `angle`, `heading` [rad], so that each lands on its target (3, LANES).

    `inverse` (4, LANES): d(angle, heading) / d(x, y) of the flow map near each guess, row by row.
    `found` (2, LANES): miss [m], inf where the steps did not close in or the horizon [s] is passed; time [s].
    """
    low, high = polar.shallowest[direction], polar.steepest[direction]
    time, first_miss = lanes[TIME], lanes[FIRST_MISS]
    miss_x, miss_y, da, dh = lanes[MISS_X], lanes[MISS_Y], lanes[TURN_A], lanes[TURN_H]
    open_lanes = np.ones(LANES, np.bool_)
    for n in range(LANES):
        found[0, n] = math.inf
    for iteration in range(MAX_ITERATIONS):
        land_lanes(flow, polar, direction, origin, target[2], t, angle, heading, dt, lanes)
        any_open = False
        for n in range(LANES):
            if not open_lanes[n]:
                continue
            rx = lanes[X, n] - target[0, n]
            ry = lanes[Y, n] - target[1, n]
            miss = math.hypot(rx, ry)
            if miss <= LANDING_TOLERANCE or not miss < math.inf:
                open_lanes[n] = False
                if miss <= LANDING_TOLERANCE and time[n] <= horizon:
                    found[0, n] = miss
                    found[1, n] = time[n]
                continue
            if iteration == GIVE_UP and miss > 0.25 * first_miss[n]:
                open_lanes[n] = False
                continue
            if iteration == 0:
                first_miss[n] = miss
            else:
                _broyden(inverse, n, da[n], dh[n], rx - miss_x[n], ry - miss_y[n])
            miss_x[n], miss_y[n] = rx, ry
            step_angle = -(inverse[0, n] * rx + inverse[1, n] * ry)
            step_heading = -(inverse[2, n] * rx + inverse[3, n] * ry)
            longest = max(abs(step_angle), abs(step_heading))
            if longest > MAX_TURN:
                step_angle *= MAX_TURN / longest
                step_heading *= MAX_TURN / longest
            next_angle = min(max(angle[n] + step_angle, low), high)
            da[n], dh[n] = next_angle - angle[n], step_heading
            if not (da[n] != 0.0 or dh[n] != 0.0):
                open_lanes[n] = False
                continue
            angle[n] = next_angle
            heading[n] += step_heading
            any_open = True
        if not any_open:
            break
    for n in range(LANES):
        heading[n] = math.atan2(math.sin(heading[n]), math.cos(heading[n]))


@njit(inline="always")
def _broyden(inverse, n, da, dh, dx, dy):
    """Broyden's update of the inverse Jacobian (Sherman-Morrison): it now maps (dx, dy) to (da, dh)."""
    ja = inverse[0, n] * dx + inverse[1, n] * dy
    jh = inverse[2, n] * dx + inverse[3, n] * dy
    # row vector s^T J^-1
    rx = da * inverse[0, n] + dh * inverse[2, n]
    ry = da * inverse[1, n] + dh * inverse[3, n]
    scale = da * ja + dh * jh
    if abs(scale) < 1e-30:
        return
    ea = (da - ja) / scale
    eh = (dh - jh) / scale
    inverse[0, n] += ea * rx
    inverse[1, n] += ea * ry
    inverse[2, n] += eh * rx
    inverse[3, n] += eh * ry
