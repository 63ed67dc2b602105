"""Motion: a constant velocity through water, carried by the flow; RK4, closest approach, the trace."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from .cache import entry_point
from .flow import contains, velocity
from .terrain import allowed


class Integration(NamedTuple):
    """`steps` RK4 steps of `dt` [s]; a hit is a miss below `tolerance` [m]."""

    dt: float
    steps: int
    tolerance: float


@njit(inline="always")
def rk4_step(flow, x, y, z, t, u, v, w, dt):
    """One RK4 step of dx/dt = flow + (u, v, w), the velocity through water [m/s]; returns x, y [m].

    Depth is linear in time, since the flow has no vertical part.
    """
    half = 0.5 * dt
    u1, v1 = velocity(flow, x, y, z, t)
    u2, v2 = velocity(flow, x + half * (u1 + u), y + half * (v1 + v), z + half * w, t + half)
    u3, v3 = velocity(flow, x + half * (u2 + u), y + half * (v2 + v), z + half * w, t + half)
    u4, v4 = velocity(flow, x + dt * (u3 + u), y + dt * (v3 + v), z + dt * w, t + dt)
    x_next = x + dt * (u + (u1 + 2.0 * (u2 + u3) + u4) / 6.0)
    y_next = y + dt * (v + (v1 + 2.0 * (v2 + v3) + v4) / 6.0)
    return x_next, y_next


@njit(inline="always")
def along_segment(ax, ay, az, bx, by, bz, x, y, z):
    """Share of the segment a -> b, from 0 to 1, and distance [m], at the point nearest to (x, y, z)."""
    dx = bx - ax
    dy = by - ay
    dz = bz - az
    # a segment has length: w is never zero
    share = ((x - ax) * dx + (y - ay) * dy + (z - az) * dz) / (dx * dx + dy * dy + dz * dz)
    share = min(max(share, 0.0), 1.0)
    ex = ax + share * dx - x
    ey = ay + share * dy - y
    ez = az + share * dz - z
    return share, math.sqrt(ex * ex + ey * ey + ez * ez)


@njit
def arrival_window(w, rise, tolerance):
    """First and last time [s] at which depth is within `tolerance` of the target, `rise` [m] above."""
    return max(0.0, (abs(rise) - tolerance) / abs(w)), (abs(rise) + tolerance) / abs(w)


@njit
def closest_approach(flow, x, y, z, t, u, v, w, x_q, y_q, z_q, integration):
    """Miss [m] and time since departure [s] of the path's closest approach to q, along its segments.

    Equal to the literal loop over all steps wherever that loop hits: outside the arrival window the
    depth alone is further away than the tolerance. A path that leaves the flow, or can no longer reach q
    in time, ends; inf is the miss of a path that never came into the window.
    """
    dt = integration.dt
    first, last = arrival_window(w, z_q - z, integration.tolerance)
    window_opens = int(first / dt)
    window_closes = min(integration.steps, int(last / dt) + 1)
    fastest = math.hypot(u, v) + flow.max_speed
    miss = math.inf
    duration = math.inf
    for n in range(window_closes):
        if not contains(flow, x, y, t + n * dt):
            break
        ahead = fastest * (window_closes - n) * dt + integration.tolerance
        if (x_q - x) * (x_q - x) + (y_q - y) * (y_q - y) > ahead * ahead:
            break
        z_now = z + n * dt * w
        x_next, y_next = rk4_step(flow, x, y, z_now, t + n * dt, u, v, w, dt)
        if n >= window_opens:
            share, distance = along_segment(x, y, z_now, x_next, y_next, z + (n + 1) * dt * w, x_q, y_q, z_q)
            if distance < miss:
                miss = distance
                duration = (n + share) * dt
        x, y = x_next, y_next
    return miss, duration


@njit
def trace(flow, x, y, z, t, u, v, w, duration, dt):
    """The path as rows [t, x, y, z]: every full step of `dt`, and the last, shorter one to `duration`."""
    full = int(duration / dt)
    rows = np.empty((full + 2 if full * dt < duration else full + 1, 4))
    for n in range(rows.shape[0]):
        since = min(n * dt, duration)
        rows[n] = (t + since, x, y, z + since * w)
        step = min(dt, duration - since)
        x, y = rk4_step(flow, x, y, z + since * w, t + since, u, v, w, step)
    return rows


@entry_point()
def traced(flow, x, y, z, t, u, v, w, duration, dt):
    """`trace`, for callers from Python."""
    return trace(flow, x, y, z, t, u, v, w, duration, dt)


@njit
def is_clear(flow, terrain, x, y, z, t, u, v, w, duration, dt, spacing):
    """Whether the whole leg stays where `terrain` allows a glider to be, looked at every `spacing` [m]."""
    rows = trace(flow, x, y, z, t, u, v, w, duration, dt)
    for n in range(rows.shape[0] - 1):
        _, ax, ay, az = rows[n]
        _, bx, by, bz = rows[n + 1]
        looks = math.ceil(math.sqrt((bx - ax) ** 2 + (by - ay) ** 2 + (bz - az) ** 2) / spacing)
        for look in range(looks + 1):
            s = look / max(looks, 1)
            if not allowed(terrain, ax + s * (bx - ax), ay + s * (by - ay), az + s * (bz - az)):
                return False
    return True


LANES = 8
"""Trajectories in flight together: one AVX-512 register of doubles."""


@njit
def rk4_lanes(flow, x, y, z, t, u, v, w, h, work):
    """`rk4_step` for LANES trajectories at once, each with its own step `h` [s], in place; same bits.

    A lane with h = 0 stands still; h < 0 goes back in time. `work` is scratch, (8, LANES).
    """
    u1, v1, u2, v2, u3, v3, xs, ys = work[0], work[1], work[2], work[3], work[4], work[5], work[6], work[7]
    for n in range(LANES):
        lane = np.uintp(n)
        half = 0.5 * h[lane]
        u1[lane], v1[lane] = velocity(flow, x[lane], y[lane], z[lane], t[lane])
        xs[lane] = x[lane] + half * (u1[lane] + u[lane])
        ys[lane] = y[lane] + half * (v1[lane] + v[lane])
    for n in range(LANES):
        lane = np.uintp(n)
        half = 0.5 * h[lane]
        u2[lane], v2[lane] = velocity(flow, xs[lane], ys[lane], z[lane] + half * w[lane], t[lane] + half)
        xs[lane] = x[lane] + half * (u2[lane] + u[lane])
        ys[lane] = y[lane] + half * (v2[lane] + v[lane])
    for n in range(LANES):
        lane = np.uintp(n)
        half = 0.5 * h[lane]
        u3[lane], v3[lane] = velocity(flow, xs[lane], ys[lane], z[lane] + half * w[lane], t[lane] + half)
        xs[lane] = x[lane] + h[lane] * (u3[lane] + u[lane])
        ys[lane] = y[lane] + h[lane] * (v3[lane] + v[lane])
    for n in range(LANES):
        lane = np.uintp(n)
        step = h[lane]
        u4, v4 = velocity(flow, xs[lane], ys[lane], z[lane] + step * w[lane], t[lane] + step)
        x[lane] += step * (u[lane] + (u1[lane] + 2.0 * (u2[lane] + u3[lane]) + u4) / 6.0)
        y[lane] += step * (v[lane] + (v1[lane] + 2.0 * (v2[lane] + v3[lane]) + v4) / 6.0)
        z[lane] += step * w[lane]
        t[lane] += step
