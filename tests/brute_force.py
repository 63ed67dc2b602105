"""Brute force: every connection of a pair, by a scan of all controls and Newton from each local minimum."""

import math

import numpy as np
from numba import njit

from glider_stream.kernels.cache import entry_point
from glider_stream.kernels.control import glide_speed
from glider_stream.kernels.motion import rk4_step


@njit
def land(flow, polar, direction, x, y, z, z_q, angle, heading, dt):
    """Where and when a control lands at a depth: x, y [m], t [s]."""
    speed = glide_speed(polar, direction, angle)
    u = speed * math.cos(angle) * math.cos(heading)
    v = speed * math.cos(angle) * math.sin(heading)
    w = (2.0 * direction - 1.0) * speed * math.sin(angle)
    duration = (z_q - z) / w
    n = 0
    while n * dt < duration:
        step = min(dt, duration - n * dt)
        x, y = rk4_step(flow, x, y, z + n * dt * w, n * dt, u, v, w, step)
        n += 1
    return x, y, duration


@njit
def newton(flow, polar, direction, x, y, z, x_q, y_q, z_q, angle, heading, dt, horizon):
    """Travel time of the solution that damped Newton steps lead to [s]; inf where they do not close in."""
    low, high = polar.shallowest[direction], polar.steepest[direction]
    for _ in range(30):
        x_0, y_0, duration = land(flow, polar, direction, x, y, z, z_q, angle, heading, dt)
        off_x, off_y = x_0 - x_q, y_0 - y_q
        miss = math.hypot(off_x, off_y)
        if miss < 0.002:
            return duration if duration <= horizon else math.inf
        e = 1e-5 if angle + 1e-5 < high else -1e-5
        x_a, y_a, _ = land(flow, polar, direction, x, y, z, z_q, angle + e, heading, dt)
        x_h, y_h, _ = land(flow, polar, direction, x, y, z, z_q, angle, heading + 1e-5, dt)
        a, c, b, d = (x_a - x_0) / e, (y_a - y_0) / e, (x_h - x_0) / 1e-5, (y_h - y_0) / 1e-5
        det = a * d - b * c
        if det == 0.0:
            return math.inf
        turn_a, turn_h = -(d * off_x - b * off_y) / det, -(a * off_y - c * off_x) / det
        share = min(1.0, 0.2 / max(abs(turn_a), abs(turn_h), 1e-12))
        for _ in range(8):
            next_angle = min(max(angle + share * turn_a, low), high)
            next_heading = heading + share * turn_h
            x_n, y_n, _ = land(flow, polar, direction, x, y, z, z_q, next_angle, next_heading, dt)
            if math.hypot(x_n - x_q, y_n - y_q) < miss:
                break
            share *= 0.5
        else:
            return math.inf
        angle, heading = next_angle, next_heading
    return math.inf


@entry_point()
def fastest_legs(flow, polar, position, source, target, angles, headings, dt, horizon):
    """Least travel time of every pair (source, target) [s], inf where none is found: (sources, targets)."""
    best = np.full((source.size, target.size), np.inf)
    off = np.empty((angles, headings))
    for s in range(source.size):
        x, y, z = position[source[s]]
        for k in range(target.size):
            x_q, y_q, z_q = position[target[k]]
            if z_q == z:
                continue
            direction = 1 if z_q > z else 0
            low, high = polar.shallowest[direction], polar.steepest[direction]
            for i in range(angles):
                for j in range(headings):
                    angle = low + (high - low) * i / (angles - 1)
                    x_1, y_1, _ = land(
                        flow, polar, direction, x, y, z, z_q, angle, 2 * math.pi * j / headings, dt
                    )
                    off[i, j] = math.hypot(x_1 - x_q, y_1 - y_q)
            for i in range(angles):
                for j in range(headings):
                    lowest = True
                    for di in range(-1, 2):
                        for dj in range(-1, 2):
                            if 0 <= i + di < angles and off[i + di, (j + dj) % headings] < off[i, j]:
                                lowest = False
                    if lowest:
                        angle = low + (high - low) * i / (angles - 1)
                        found = newton(
                            flow, polar, direction, x, y, z, x_q, y_q, z_q, angle, 2 * math.pi * j / headings,
                            dt, horizon,
                        )  # fmt: skip
                        best[s, k] = min(best[s, k], found)
    return best
