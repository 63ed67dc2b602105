"""Motion: a constant velocity through water, carried by the flow; RK4, closest approach, the trace."""

import math
from typing import Any, NamedTuple

import numpy as np

from .cache import entry_point, in_kernels, inlined, kernel, making, shared
from .flow import (
    LEGS,
    Flow,
    at_index,
    at_index_once,
    by_rise,
    carry,
    contains,
    current,
    has_ladder,
    has_one_time,
    index_on_map,
    is_mapped,
    longest_step,
    on_levels,
    on_times,
    rises,
    step_to_rung,
    velocity,
)
from .place import Place
from .terrain import allowed, open_in_box

CROSSED = 1e-7
"""A path has reached a height at this distance [m] from it."""
STRETCH = 8.0
"""A step on a flow's ladder lasts so many even steps at most."""
EMERGED = 1e-3
"""A path has left the water this far [m] above the surface."""


class Integration(NamedTuple):
    """`steps` RK4 steps of `dt` [s]; a hit is a miss below `tolerance` [m]."""

    dt: float
    steps: int
    tolerance: float


@inlined
def rk4_step(flow, at, through, dt):
    """One RK4 step of dx/dt = flow + (u, v, w), the velocity through water [m/s]; returns x, y [m].

    From a place `at`; `through` is a Control, or what has its u, v, w. Only for a flow without a vertical part,
    in which depth is linear in time; `step_on` is for any flow.
    """
    x, y, z, t = at.x, at.y, at.z, at.t
    u, v, w = through.u, through.v, through.w
    half = 0.5 * dt
    u1, v1 = velocity(flow, x, y, z, t)
    u2, v2 = velocity(flow, x + half * (u1 + u), y + half * (v1 + v), z + half * w, t + half)
    u3, v3 = velocity(flow, x + half * (u2 + u), y + half * (v2 + v), z + half * w, t + half)
    u4, v4 = velocity(flow, x + dt * (u3 + u), y + dt * (v3 + v), z + dt * w, t + dt)
    x_next = x + dt * (u + (u1 + 2.0 * (u2 + u3) + u4) / 6.0)
    y_next = y + dt * (v + (v1 + 2.0 * (v2 + v3) + v4) / 6.0)
    return x_next, y_next


@kernel
def rk4_rising(flow, at, through, dt):
    """The same for a flow with a vertical part; returns x, y, z [m]."""
    x, y, z, t = at.x, at.y, at.z, at.t
    u, v, w = through.u, through.v, through.w
    half = 0.5 * dt
    u1, v1, w1 = current(flow, x, y, z, t)
    u2, v2, w2 = current(flow, x + half * (u1 + u), y + half * (v1 + v), z + half * (w1 + w), t + half)
    u3, v3, w3 = current(flow, x + half * (u2 + u), y + half * (v2 + v), z + half * (w2 + w), t + half)
    u4, v4, w4 = current(flow, x + dt * (u3 + u), y + dt * (v3 + v), z + dt * (w3 + w), t + dt)
    x_next = x + dt * (u + (u1 + 2.0 * (u2 + u3) + u4) / 6.0)
    y_next = y + dt * (v + (v1 + 2.0 * (v2 + v3) + v4) / 6.0)
    return x_next, y_next, z + dt * (w + (w1 + 2.0 * (w2 + w3) + w4) / 6.0)


def _step_level(flow, at, through, dt):
    x, y = rk4_step(flow, at, through, dt)
    return x, y, at.z + dt * through.w


def step_on(flow: Flow, at: Place, through: Any, dt: float) -> tuple[float, float, float]:
    """One RK4 step in any flow, from a Place, with a velocity through water; returns x, y, z [m]."""
    x, y, z = _STEP[rises(flow)](flow, at, through, dt)
    return x, y, z


def _step_rising(flow, at, through, dt):
    return rk4_rising(flow, at, through, dt)


_STEP = (_step_level, _step_rising)
in_kernels(step_on, by_rise(*_STEP))


@kernel
def landing_in_step(flow, before, after_z, through, step, height):
    """Where and when [s after `before`] a path crosses a height [m] within one step: x, y, time.

    The step is shortened until its end is CROSSED [m] from the height at the most: by Newton's method, and by
    halving where that leaves the step.
    """
    side = 1.0 if after_z >= before.z else -1.0
    low, high = 0.0, step
    share = step * (height - before.z) / (after_z - before.z)
    x, y = before.x, before.y
    for _ in range(60):
        x, y, z = rk4_rising(flow, before, through, share)
        off = height - z
        if abs(off) <= CROSSED:
            break
        if off * side > 0.0:
            low = share
        else:
            high = share
        _, _, rise = current(flow, x, y, z, before.t + share)
        closer = share + off / (rise + through.w)
        inside = (closer - low) * (closer - high) < 0.0
        share = closer if inside else 0.5 * (low + high)
    return x, y, share


@inlined
def along_segment(a, b, q):
    """Share of the segment a -> b, from 0 to 1, and distance [m], at the point nearest to q; places all."""
    dx = b.x - a.x
    dy = b.y - a.y
    dz = b.z - a.z
    # a segment has length: w is never zero
    share = ((q.x - a.x) * dx + (q.y - a.y) * dy + (q.z - a.z) * dz) / (dx * dx + dy * dy + dz * dz)
    share = min(max(share, 0.0), 1.0)
    ex = a.x + share * dx - q.x
    ey = a.y + share * dy - q.y
    ez = a.z + share * dz - q.z
    return share, math.sqrt(ex * ex + ey * ey + ez * ez)


@kernel
def arrival_window(w, rise, tolerance):
    """First and last time [s] at which depth is within `tolerance` of the target, `rise` [m] above."""
    return max(0.0, (abs(rise) - tolerance) / abs(w)), (abs(rise) + tolerance) / abs(w)


def closest_approach(flow, pair, through, integration):
    """Miss [m] and time since departure [s] of the path's closest approach to its goal, along its segments.

    Equal to the literal loop over all steps wherever that loop hits: outside the arrival window the
    depth alone is further away than the tolerance. A path that leaves the flow ends; so does
    one that the flow, at its fastest, could no longer carry to the goal in time. inf is the miss of a path that
    never came into the window. In a flow with a vertical part the literal loop itself.
    """
    return _CLOSEST[rises(flow)](flow, pair, through, integration)


def _closest_level(flow, pair, through, integration):
    start, goal = pair
    dt, u, v, w = integration.dt, through.u, through.v, through.w
    first, last = arrival_window(w, goal.z - start.z, integration.tolerance)
    window_opens = int(first / dt)
    window_closes = min(integration.steps, int(last / dt) + 1)
    # the distance that the control adds between the window's ends, and the tolerance
    slack = math.hypot(u, v) * (window_closes * dt - first) + integration.tolerance
    carry_end = carry(flow, start.z + window_closes * dt * w)
    miss = math.inf
    duration = math.inf
    here = start
    for n in range(window_closes):
        if not contains(flow, here.x, here.y, here.t):
            break
        left = (window_closes - n) * dt
        off_x = goal.x - (here.x + u * left)
        off_y = goal.y - (here.y + v * left)
        far = abs((carry_end - carry(flow, here.z)) / w) + slack
        if off_x * off_x + off_y * off_y > far * far:
            break
        x, y = rk4_step(flow, here, through, dt)
        there = Place(x, y, start.z + (n + 1) * dt * w, start.t + (n + 1) * dt)
        if n >= window_opens:
            share, distance = along_segment(here, there, goal)
            if distance < miss:
                miss = distance
                duration = (n + share) * dt
        here = there
    return miss, duration


def _closest_rising(flow, pair, through, integration):
    here, goal = pair
    way = 1.0 if goal.z > here.z else -1.0
    miss, duration = math.inf, math.inf
    for n in range(integration.steps):
        # past its depth a leg has ended
        passed = (here.z - goal.z) * way > integration.tolerance
        if passed or not contains(flow, here.x, here.y, here.t):
            break
        x, y, z = rk4_rising(flow, here, through, integration.dt)
        there = Place(x, y, z, pair.start.t + (n + 1) * integration.dt)
        share, distance = along_segment(here, there, goal)
        if distance < miss:
            miss, duration = distance, (n + share) * integration.dt
        here = there
    return miss, duration


_CLOSEST = (_closest_level, _closest_rising)
in_kernels(closest_approach, by_rise(*_CLOSEST))


@shared
def most_step(flow: Flow, dt: float) -> float:
    """Return the longest step [s] of a leg on a flow's ladder; no shorter than the even step `dt` [s]."""
    return min(STRETCH * dt, max(dt, longest_step(flow)))


@making
def even_steps(duration, dt):
    """Rows [since the start, length] [s] of full steps of `dt`, and the last, shorter one; then the end and 0."""
    full = int(duration / dt)
    steps = np.empty((full + 2 if full * dt < duration else full + 1, 2))
    for n in range(steps.shape[0]):
        since = min(n * dt, duration)
        steps[n] = (since, min(dt, duration - since))
    return steps


@making
def steps_of(flow, z, w, duration, dt):
    """The steps of a leg from z [m] with w [m/s], as rows of `even_steps`; on the flow's ladder if it has one."""
    if not has_ladder(flow):
        return even_steps(duration, dt)
    longest, left, count = most_step(flow, dt), duration, 1
    while left > 0.0:
        left -= step_to_rung(flow, LEGS, z + (duration - left) * w, w, left, longest)
        count += 1
    steps, left = np.empty((count, 2)), duration
    for n in range(count - 1):
        since = duration - left
        steps[n] = (since, step_to_rung(flow, LEGS, z + since * w, w, left, longest))
        left -= steps[n, 1]
    steps[count - 1] = (duration, 0.0)
    return steps


@making
def path_in(flow, start, through, steps):
    """The path in some steps, of `steps_of` or `even_steps`, as rows [t, x, y, z]."""
    rows = np.empty((steps.shape[0], 4))
    x, y, z = start.x, start.y, start.z
    for n in range(rows.shape[0]):
        since, step = steps[n]
        if not rises(flow):
            z = start.z + since * through.w
        here = Place(x, y, z, start.t + since)
        rows[n] = (here.t, x, y, z)
        x, y, z = step_on(flow, here, through, step)
    return rows


@making
def trace(flow, start, through, duration, dt):
    """The path as rows [t, x, y, z]: after every step of a leg, to `duration`."""
    return path_in(flow, start, through, steps_of(flow, start.z, through.w, duration, dt))


@entry_point()
def traced(flow, start, through, duration, dt):
    """Return the result of `trace`, for Python code."""
    return trace(flow, start, through, duration, dt)


@making
def stays_inside(flow, start, through, duration, dt):
    """Return whether each even step of the leg begins where the flow is known."""
    rows = path_in(flow, start, through, even_steps(duration, dt))
    inside = True
    for n in range(rows.shape[0] - 1):
        t, x, y, _ = rows[n]
        inside &= contains(flow, x, y, t)
    return inside


@making
def is_clear(flow, terrain, start, through, duration, dt, spacing):
    """Return whether the whole leg stays where `terrain` allows a glider; it is checked every `spacing` [m].

    Where the flow rises, a leg may also not leave the water: the flow may lift a glider at first.
    """
    z_end = start.z + through.w * duration
    if not rises(flow) and open_in_box(terrain, -math.inf, math.inf, -math.inf, math.inf, min(start.z, z_end)):
        return True
    rows = path_in(flow, start, through, even_steps(duration, dt))
    for n in range(rows.shape[0] - 1):
        _, ax, ay, az = rows[n]
        _, bx, by, bz = rows[n + 1]
        if not rises(flow) and open_in_box(
            terrain, min(ax, bx), max(ax, bx), min(ay, by), max(ay, by), min(az, bz)
        ):
            continue
        looks = math.ceil(math.sqrt((bx - ax) ** 2 + (by - ay) ** 2 + (bz - az) ** 2) / spacing)
        for look in range(looks + 1):
            s = look / max(looks, 1)
            if rises(flow) and az + s * (bz - az) > EMERGED:
                return False
            if not allowed(terrain, ax + s * (bx - ax), ay + s * (by - ay), az + s * (bz - az)):
                return False
    return True


LANES = 32
"""Trajectories in flight together: enough to hide the latency of the grid's loads."""
LANE_X, LANE_Y, LANE_Z, LANE_T, LANE_U, LANE_V, LANE_W, LANE_STEP = range(8)
"""Rows of lanes (LANE_ROWS or more, LANES): place [m], time [s], velocity through water [m/s], step [s]."""
_U1, _V1, _U2, _V2, _U3, _V3, _XS, _YS = range(8, 16)
_W1, _W2, _W3, _ZS = range(16, 20)
_LEVEL, _UPPER, _TIME, _LATER = range(16, 20)
LANE_ROWS = 20
"""The rows above and the stages' own; a caller's lanes may have more."""


@inlined
def _find_slots(flow, flat, share):
    """Levels and times of all lanes, and their weights, at `share` of the step; into the rows of these names."""
    for n in range(LANES):
        along = share * flat[np.uintp(LANE_STEP * LANES + n)]
        level, flat[np.uintp(_UPPER * LANES + n)] = on_levels(
            flow, flat[np.uintp(LANE_Z * LANES + n)] + along * flat[np.uintp(LANE_W * LANES + n)]
        )
        flat[np.uintp(_LEVEL * LANES + n)] = level
        if not has_one_time(flow):
            time, flat[np.uintp(_LATER * LANES + n)] = on_times(flow, flat[np.uintp(LANE_T * LANES + n)] + along)
            flat[np.uintp(_TIME * LANES + n)] = time


@inlined
def _mapped_slopes(flow, flat, x, y, u, v):
    """As `_slopes`, after `_find_slots`: all indices first, into rows u, v, then all currents.

    Small loops keep more in registers. A question for each lane whether the flow has one time would cost more
    than it saves.
    """
    for n in range(LANES):
        flat[np.uintp(u * LANES + n)], flat[np.uintp(v * LANES + n)] = index_on_map(
            flow, flat[np.uintp(x * LANES + n)], flat[np.uintp(y * LANES + n)]
        )
    if has_one_time(flow):
        for n in range(LANES):
            flat[np.uintp(u * LANES + n)], flat[np.uintp(v * LANES + n)] = at_index_once(
                flow,
                flat[np.uintp(u * LANES + n)],
                flat[np.uintp(v * LANES + n)],
                (np.uintp(np.intp(flat[np.uintp(_LEVEL * LANES + n)])), flat[np.uintp(_UPPER * LANES + n)]),
            )
    else:
        for n in range(LANES):
            flat[np.uintp(u * LANES + n)], flat[np.uintp(v * LANES + n)] = at_index(
                flow,
                flat[np.uintp(u * LANES + n)],
                flat[np.uintp(v * LANES + n)],
                (np.uintp(np.intp(flat[np.uintp(_LEVEL * LANES + n)])), flat[np.uintp(_UPPER * LANES + n)]),
                (np.uintp(np.intp(flat[np.uintp(_TIME * LANES + n)])), flat[np.uintp(_LATER * LANES + n)]),
            )


@kernel
def _slopes(flow, flat, x, y, share, u, v, anew=True):
    """Currents of all lanes at rows x, y into rows u, v, at `share` of the step in depth and time.

    `anew`: whether the stage before had another share.
    """
    if is_mapped(flow):
        if anew:
            _find_slots(flow, flat, share)
        _mapped_slopes(flow, flat, x, y, u, v)
        return
    for n in range(LANES):
        along = share * flat[np.uintp(LANE_STEP * LANES + n)]
        flat[np.uintp(u * LANES + n)], flat[np.uintp(v * LANES + n)] = velocity(
            flow,
            flat[np.uintp(x * LANES + n)],
            flat[np.uintp(y * LANES + n)],
            flat[np.uintp(LANE_Z * LANES + n)] + along * flat[np.uintp(LANE_W * LANES + n)],
            flat[np.uintp(LANE_T * LANES + n)] + along,
        )


@kernel
def _move(flat, share, u, v):
    """Stage points into rows _XS, _YS: a `share` of the step along the slopes in rows u, v."""
    for n in range(LANES):
        along = share * flat[np.uintp(LANE_STEP * LANES + n)]
        flat[np.uintp(_XS * LANES + n)] = flat[np.uintp(LANE_X * LANES + n)] + along * (
            flat[np.uintp(u * LANES + n)] + flat[np.uintp(LANE_U * LANES + n)]
        )
        flat[np.uintp(_YS * LANES + n)] = flat[np.uintp(LANE_Y * LANES + n)] + along * (
            flat[np.uintp(v * LANES + n)] + flat[np.uintp(LANE_V * LANES + n)]
        )


@kernel
def _sum(flat, place, through, u1, u2, u3, u4):
    for n in range(LANES):
        flat[np.uintp(place * LANES + n)] += flat[np.uintp(LANE_STEP * LANES + n)] * (
            flat[np.uintp(through * LANES + n)]
            + (
                flat[np.uintp(u1 * LANES + n)]
                + 2.0 * (flat[np.uintp(u2 * LANES + n)] + flat[np.uintp(u3 * LANES + n)])
                + flat[np.uintp(u4 * LANES + n)]
            )
            / 6.0
        )


@kernel
def rk4_lanes(flow, lanes):
    """`rk4_step` for LANES trajectories at once, each with a step of its lane, in place; the same bits.

    A lane whose step is 0 stands still; one below 0 goes back in time. One flat array with constant offsets lets
    the compiler see that rows do not overlap: 1.6 times as fast as separate arrays.
    """
    flat = lanes.reshape(-1)
    _slopes(flow, flat, LANE_X, LANE_Y, 0.0, _U1, _V1)
    _move(flat, 0.5, _U1, _V1)
    _slopes(flow, flat, _XS, _YS, 0.5, _U2, _V2)
    _move(flat, 0.5, _U2, _V2)
    _slopes(flow, flat, _XS, _YS, 0.5, _U3, _V3, False)
    _move(flat, 1.0, _U3, _V3)
    _slopes(flow, flat, _XS, _YS, 1.0, _XS, _YS)
    _sum(flat, LANE_X, LANE_U, _U1, _U2, _U3, _XS)
    _sum(flat, LANE_Y, LANE_V, _V1, _V2, _V3, _YS)
    for n in range(LANES):
        flat[np.uintp(LANE_Z * LANES + n)] += (
            flat[np.uintp(LANE_STEP * LANES + n)] * flat[np.uintp(LANE_W * LANES + n)]
        )
        flat[np.uintp(LANE_T * LANES + n)] += flat[np.uintp(LANE_STEP * LANES + n)]


@kernel
def _rising_slopes(flow, flat, x, y, z, share, u, v, w):
    """As `_slopes`, with the vertical part, at places of their own height."""
    for n in range(LANES):
        along = share * flat[np.uintp(LANE_STEP * LANES + n)]
        (
            flat[np.uintp(u * LANES + n)],
            flat[np.uintp(v * LANES + n)],
            flat[np.uintp(w * LANES + n)],
        ) = current(
            flow,
            flat[np.uintp(x * LANES + n)],
            flat[np.uintp(y * LANES + n)],
            flat[np.uintp(z * LANES + n)],
            flat[np.uintp(LANE_T * LANES + n)] + along,
        )


@kernel
def _move_along(flat, share, place, through, slope, stage):
    """One coordinate of the stage points: a `share` of the step from `place` along slope and velocity."""
    for n in range(LANES):
        along = share * flat[np.uintp(LANE_STEP * LANES + n)]
        flat[np.uintp(stage * LANES + n)] = flat[np.uintp(place * LANES + n)] + along * (
            flat[np.uintp(slope * LANES + n)] + flat[np.uintp(through * LANES + n)]
        )


@kernel
def rising_lanes(flow, lanes):
    """`rk4_lanes` for a flow with a vertical part: the same bits as `rk4_rising`."""
    flat = lanes.reshape(-1)
    _rising_slopes(flow, flat, LANE_X, LANE_Y, LANE_Z, 0.0, _U1, _V1, _W1)
    _move(flat, 0.5, _U1, _V1)
    _move_along(flat, 0.5, LANE_Z, LANE_W, _W1, _ZS)
    _rising_slopes(flow, flat, _XS, _YS, _ZS, 0.5, _U2, _V2, _W2)
    _move(flat, 0.5, _U2, _V2)
    _move_along(flat, 0.5, LANE_Z, LANE_W, _W2, _ZS)
    _rising_slopes(flow, flat, _XS, _YS, _ZS, 0.5, _U3, _V3, _W3)
    _move(flat, 1.0, _U3, _V3)
    _move_along(flat, 1.0, LANE_Z, LANE_W, _W3, _ZS)
    _rising_slopes(flow, flat, _XS, _YS, _ZS, 1.0, _XS, _YS, _ZS)
    _sum(flat, LANE_X, LANE_U, _U1, _U2, _U3, _XS)
    _sum(flat, LANE_Y, LANE_V, _V1, _V2, _V3, _YS)
    _sum(flat, LANE_Z, LANE_W, _W1, _W2, _W3, _ZS)
    for n in range(LANES):
        flat[np.uintp(LANE_T * LANES + n)] += flat[np.uintp(LANE_STEP * LANES + n)]
