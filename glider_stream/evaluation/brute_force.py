"""Brute force: finds every connection of a pair by a scan of all controls and Newton from each local minimum."""

import math

import numpy as np
from numba import njit

from ..kernels.cache import entry_point
from ..kernels.control import control_towards
from ..kernels.flow import contains
from ..kernels.motion import rk4_step
from ..kernels.place import Place


@njit
def land(flow, polar, direction, x, y, z, z_q, t, angle, heading, dt):
    """Return where and when a control that starts at t [s] reaches a depth.

    x, y [m], duration [s], and whether the flow is known on the way.
    """
    c = control_towards(polar, direction, angle, heading)
    duration = (z_q - z) / c.w
    known = True
    n = 0
    while n * dt < duration:
        known &= contains(flow, x, y, t + n * dt)
        here = Place(x, y, z + n * dt * c.w, t + n * dt)
        x, y = rk4_step(flow, here, c, min(dt, duration - n * dt))
        n += 1
    return x, y, duration, known


@njit
def newton(flow, polar, direction, x, y, z, t, x_q, y_q, z_q, angle, heading, dt, horizon):
    """Return the travel time [s] of the solution that damped Newton steps find; inf if they do not converge."""
    low, high = polar.shallowest[direction], polar.steepest[direction]
    for _ in range(30):
        x_0, y_0, duration, known = land(flow, polar, direction, x, y, z, z_q, t, angle, heading, dt)
        off_x, off_y = x_0 - x_q, y_0 - y_q
        miss = math.hypot(off_x, off_y)
        if miss < 0.002:
            return duration if known and duration <= horizon else math.inf
        e = 1e-5 if angle + 1e-5 < high else -1e-5
        x_a, y_a, _, _ = land(flow, polar, direction, x, y, z, z_q, t, angle + e, heading, dt)
        x_h, y_h, _, _ = land(flow, polar, direction, x, y, z, z_q, t, angle, heading + 1e-5, dt)
        a, c, b, d = (x_a - x_0) / e, (y_a - y_0) / e, (x_h - x_0) / 1e-5, (y_h - y_0) / 1e-5
        det = a * d - b * c
        if det == 0.0:
            return math.inf
        turn_a, turn_h = -(d * off_x - b * off_y) / det, -(a * off_y - c * off_x) / det
        share = min(1.0, 0.2 / max(abs(turn_a), abs(turn_h), 1e-12))
        for _ in range(8):
            next_angle = min(max(angle + share * turn_a, low), high)
            next_heading = heading + share * turn_h
            x_n, y_n, _, _ = land(flow, polar, direction, x, y, z, z_q, t, next_angle, next_heading, dt)
            if math.hypot(x_n - x_q, y_n - y_q) < miss:
                break
            share *= 0.5
        else:
            return math.inf
        angle, heading = next_angle, next_heading
    return math.inf


@njit
def scan(flow, polar, direction, position, source, target, t, angles, headings, dt):
    """Return the distance [m] between each target and all landings at its depth: (targets, angles, headings).

    There is one flight for each control: it does the work of `land` for all targets on its way.
    """
    low, high = polar.shallowest[direction], polar.steepest[direction]
    order = np.argsort(np.abs(position[target, 2] - position[source, 2]))
    off = np.empty((target.size, angles, headings))
    for i in range(angles):
        angle = low + (high - low) * i / (angles - 1)
        for j in range(headings):
            c = control_towards(polar, direction, angle, 2 * math.pi * j / headings)
            x, y, z = position[source]
            n = 0
            for k in order:
                x_q, y_q, z_q = position[target[k]]
                duration = (z_q - z) / c.w
                while (n + 1) * dt <= duration:
                    x, y = rk4_step(flow, Place(x, y, z + n * dt * c.w, t + n * dt), c, dt)
                    n += 1
                here = Place(x, y, z + n * dt * c.w, t + n * dt)
                x_1, y_1 = rk4_step(flow, here, c, duration - n * dt)
                off[k, i, j] = math.hypot(x_1 - x_q, y_1 - y_q)
    return off


@njit
def is_lowest(off, i, j):
    """Return whether a control lands no further off than its neighbours."""
    angles, headings = off.shape
    for di in range(-1, 2):
        for dj in range(-1, 2):
            if 0 <= i + di < angles and off[i + di, (j + dj) % headings] < off[i, j]:
                return False
    return True


@entry_point(nogil=True)
def fastest_legs(flow, polar, position, source, target, t, angles, headings, dt, horizon):
    """Return the least travel time [s] of every pair (source, target) from t [s] on; inf if none is found."""
    best = np.full((source.size, target.size), np.inf)
    for s in range(source.size):
        x, y, z = position[source[s]]
        for direction in range(2):
            low, high = polar.shallowest[direction], polar.steepest[direction]
            ahead = (position[target, 2] - z) * (2.0 * direction - 1.0) > 0.0
            column = np.flatnonzero(ahead)
            off = scan(flow, polar, direction, position, source[s], target[column], t, angles, headings, dt)
            for k in range(column.size):
                x_q, y_q, z_q = position[target[column[k]]]
                for i in range(angles):
                    for j in range(headings):
                        if not is_lowest(off[k], i, j):
                            continue
                        angle, heading = low + (high - low) * i / (angles - 1), 2 * math.pi * j / headings
                        found = newton(
                            flow, polar, direction, x, y, z, t, x_q, y_q, z_q, angle, heading, dt, horizon
                        )
                        best[s, column[k]] = min(best[s, column[k]], found)
    return best
