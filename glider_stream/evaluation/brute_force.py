"""Brute force: finds every connection of a pair by a scan of all controls and Newton from each local minimum."""

import math

import numpy as np
from numba import njit

from ..kernels.cache import entry_point, in_kernels
from ..kernels.control import control_towards
from ..kernels.flow import by_rise, contains, rises
from ..kernels.motion import rk4_step, step_on
from ..kernels.place import Place

HALVINGS = 30
"""A step is halved so often to find where a path crosses a depth in a flow that rises."""
IN_WATER = 1e-3
"""A glider that the flow lifts higher than this [m] has left the water."""
LATER = 1.25
"""There a control flies for so many horizons before it counts as never arriving."""


@njit
def cross(flow, at, c, step, height):
    """Return where and when a path crosses a height [m] within one step, by halving it: x, y [m], time [s]."""
    way = 1.0 if height > at.z else -1.0
    low, high = 0.0, step
    x, y = at.x, at.y
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        x, y, z = step_on(flow, at, c, middle)
        if (z - height) * way >= 0.0:
            high = middle
        else:
            low = middle
    return x, y, high


def land(flow, polar, direction, x, y, z, z_q, t, angle, heading, dt, horizon):
    """Return where and when a control that starts at t [s] reaches a depth.

    x, y [m], duration [s], and whether the flow is known on the way, in the water; inf and NaN if it never does.
    """
    return _LAND[rises(flow)](flow, polar, direction, x, y, z, z_q, t, angle, heading, dt, horizon)


def _land_rising(flow, polar, direction, x, y, z, z_q, t, angle, heading, dt, horizon):
    c = control_towards(polar, direction, angle, heading)
    way = 1.0 if z_q > z else -1.0
    known = True
    n = 0
    while n * dt < LATER * horizon:
        known &= contains(flow, x, y, t + n * dt) and z <= IN_WATER
        here = Place(x, y, z, t + n * dt)
        x, y, z = step_on(flow, here, c, dt)
        if (z - z_q) * way >= 0.0:
            x, y, since = cross(flow, here, c, dt, z_q)
            return x, y, n * dt + since, known
        n += 1
    return math.nan, math.nan, math.inf, known


def _land_level(flow, polar, direction, x, y, z, z_q, t, angle, heading, dt, horizon):
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


_LAND = (_land_level, _land_rising)
in_kernels(land, by_rise(*_LAND))


@njit
def newton(flow, polar, direction, x, y, z, t, x_q, y_q, z_q, angle, heading, dt, horizon):
    """Return the travel time [s] of the solution that damped Newton steps find; inf if they do not converge."""
    low, high = polar.shallowest[direction], polar.steepest[direction]
    for _ in range(30):
        of = flow, polar, direction, x, y, z, z_q, t
        x_0, y_0, duration, known = land(*of, angle, heading, dt, horizon)
        off_x, off_y = x_0 - x_q, y_0 - y_q
        miss = math.hypot(off_x, off_y)
        if miss < 0.002:
            return duration if known and duration <= horizon else math.inf
        e = 1e-5 if angle + 1e-5 < high else -1e-5
        x_a, y_a, _, _ = land(*of, angle + e, heading, dt, horizon)
        x_h, y_h, _, _ = land(*of, angle, heading + 1e-5, dt, horizon)
        a, c, b, d = (x_a - x_0) / e, (y_a - y_0) / e, (x_h - x_0) / 1e-5, (y_h - y_0) / 1e-5
        det = a * d - b * c
        if det == 0.0 or math.isnan(det):
            return math.inf
        turn_a, turn_h = -(d * off_x - b * off_y) / det, -(a * off_y - c * off_x) / det
        share = min(1.0, 0.2 / max(abs(turn_a), abs(turn_h), 1e-12))
        for _ in range(8):
            next_angle = min(max(angle + share * turn_a, low), high)
            next_heading = heading + share * turn_h
            x_n, y_n, _, _ = land(*of, next_angle, next_heading, dt, horizon)
            if math.hypot(x_n - x_q, y_n - y_q) < miss:
                break
            share *= 0.5
        else:
            return math.inf
        angle, heading = next_angle, next_heading
    return math.inf


@njit
def miss_all(flow, c, position, source, target, order, t, dt, latest, off):
    """Write the distances [m] (targets,) between targets and one control's landings, in a flow that rises.

    `order` (targets,): by how far their depths are away. inf where the control does not arrive. A step is
    shortened once, to where its chord crosses a depth: centimetres beside, enough to begin Newton's method.
    """
    off[:] = np.inf
    x, y, z = position[source]
    n, at = 0, 0
    while at < order.size and n * dt < latest:
        here = Place(x, y, z, t + n * dt)
        x, y, z = step_on(flow, here, c, dt)
        crossed, x_1, y_1 = math.nan, x, y
        while at < order.size:
            x_q, y_q, z_q = position[target[order[at]]]
            if (z - z_q) * c.w < 0.0:
                break
            if z_q != crossed:
                crossed = z_q
                x_1, y_1, _ = step_on(flow, here, c, dt * (z_q - here.z) / (z - here.z))
            off[order[at]] = math.hypot(x_1 - x_q, y_1 - y_q)
            at += 1
        n += 1


@njit
def scan(flow, polar, direction, position, source, target, t, angles, headings, dt, latest):
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
            if rises(flow):
                miss_all(flow, c, position, source, target, order, t, dt, latest, off[:, i, j])
                continue
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
    if off[i, j] == np.inf:
        return False
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
            of = flow, polar, direction, position, source[s], target[column], t
            off = scan(*of, angles, headings, dt, LATER * horizon)
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
