"""Controls: the glide polar; the control plane and its line; the control surface (the baseline).

A control is a glide angle and a heading, held for a whole leg. Directions: 0 dives, 1 climbs.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from .cache import in_kernels, kernel, shared
from .flow import Array, mean_velocity
from .stream import stream_value

DIVE, CLIMB = 0, 1
NO_CONTROL = -1
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


class Polar(NamedTuple):
    """The glide polar: speed V [m/s] at even steps of the glide angle's magnitude, for dive and climb.

    `speed` (2, n) runs from `shallowest` (2,) to `steepest` (2,) [rad], linear between. The horizontal
    speed V cos(gamma) has one maximum, `best_horizontal` (2,) [m/s] at `best_angle` (2,) [rad].
    """

    shallowest: Array
    steepest: Array
    speed: Array
    best_angle: Array
    best_horizontal: Array


class Control(NamedTuple):
    """Velocity through water (u, v, w) [m/s]; its glide angle (signed) and heading [rad], speed [m/s]."""

    u: float
    v: float
    w: float
    glide_angle: float
    heading: float
    speed: float


@kernel
def glide_speed(polar, direction, angle):
    """Return the speed V [m/s] at the magnitude of a glide angle [rad]."""
    last = polar.speed.shape[1] - 1
    span = polar.steepest[direction] - polar.shallowest[direction]
    at = min(max((angle - polar.shallowest[direction]) / span * last, 0.0), float(last))
    below = min(int(at), last - 1)
    low = polar.speed[direction, below]
    return low + (at - below) * (polar.speed[direction, below + 1] - low)


@kernel
def horizontal_speed(polar, direction, angle):
    """Return the horizontal speed V cos(gamma) [m/s]."""
    return glide_speed(polar, direction, angle) * math.cos(angle)


@kernel
def vertical_speed(polar, direction, angle):
    """Return the vertical speed V |sin(gamma)| [m/s]; it rises with the angle."""
    return glide_speed(polar, direction, angle) * math.sin(angle)


@kernel
def heading_of(x, y):
    """Return the heading [rad] of a direction, in [-pi, pi); -pi is west."""
    heading = math.atan2(y, x)
    return heading if heading < math.pi else -math.pi


@shared
def control_of(speed: float, glide_angle: float, heading: float) -> Control:
    """Return the control with a speed through water [m/s], a signed glide angle and a heading [rad]."""
    along = speed * math.cos(glide_angle)
    u, v = along * math.cos(heading), along * math.sin(heading)
    return Control(u, v, speed * math.sin(glide_angle), glide_angle, heading, speed)


@kernel
def control_towards(polar, direction, angle, heading):
    """Return the control with a magnitude of the glide angle and a heading [rad], at the polar's speed."""
    return control_of(glide_speed(polar, direction, angle), angle if direction == CLIMB else -angle, heading)


@kernel
def angle_of_horizontal_speed(polar, direction, speed, outer):
    """Return the angle [rad] at which V cos(gamma) = speed, between `outer`, an end of the range, and the best.

    It is `outer` if even that end is faster.
    """
    slow = outer
    fast = polar.best_angle[direction]
    if horizontal_speed(polar, direction, slow) >= speed:
        return slow
    for _ in range(52):
        middle = 0.5 * (slow + fast)
        if horizontal_speed(polar, direction, middle) < speed:
            slow = middle
        else:
            fast = middle
    return fast


@kernel
def angle_of_vertical_speed(polar, direction, speed):
    """Return the shallowest angle [rad] with at least this vertical speed [m/s]; NaN if no angle has it."""
    low = polar.shallowest[direction]
    high = polar.steepest[direction]
    if vertical_speed(polar, direction, high) < speed:
        return math.nan
    if vertical_speed(polar, direction, low) >= speed:
        return low
    for _ in range(52):
        middle = 0.5 * (low + high)
        if vertical_speed(polar, direction, middle) < speed:
            low = middle
        else:
            high = middle
    return high


@kernel
def direction_of(pair):
    """Return the direction of a leg between the pair: DIVE or CLIMB."""
    return CLIMB if pair.goal.z > pair.start.z else DIVE


class ControlPlane(NamedTuple):
    """A u + B v + C = 0: velocities through water that cancel the flow across the line p -> q.

    `lowest` [m/s] is the plane's distance from the origin, the lowest horizontal speed on it. Where q is
    straight above p there is no plane: A and B are zero, and (u, v) is the one velocity that cancels the
    mean flow there.
    """

    a: float
    b: float
    c: float
    lowest: float
    u: float
    v: float


@kernel
def control_plane(flow, pair):
    """The control plane of a pair (design, section 3, step 3): A = dy, B = -dx, C = psi_c."""
    p, q = pair
    a = q.y - p.y
    b = p.x - q.x
    length = math.hypot(a, b)
    if length == 0.0:
        u, v = mean_velocity(flow, p.x, p.y, p.z, q.z, p.t)
        return ControlPlane(0.0, 0.0, 0.0, math.hypot(u, v), -u, -v)
    c = stream_value(flow, pair)
    return ControlPlane(a, b, c, abs(c) / length, 0.0, 0.0)


class Streamline(NamedTuple):
    """The paper's method: `candidates` controls on the control line."""

    candidates: int


class Surface(NamedTuple):
    """The paper's baseline: `candidates` controls over the whole control surface."""

    candidates: int


Steering = Streamline | Surface


@kernel
def heading_on_line(plane, horizontal, branch):
    """Return the heading [rad] of the control on the plane at a horizontal speed >= V_min; branch is +1 or -1.

    u = (-A C + branch B S) / R, v = (-B C - branch A S) / R, S = sqrt(R Vh^2 - C^2); the paper prints the
    same sign on both, which leaves the plane.
    """
    r = plane.a * plane.a + plane.b * plane.b
    s = math.sqrt(max(0.0, r * horizontal * horizontal - plane.c * plane.c))
    u = (-plane.a * plane.c + branch * plane.b * s) / r
    v = (-plane.b * plane.c - branch * plane.a * s) / r
    return heading_of(u, v)


def _on_line(steering, flow, polar, pair, slowest, controls):
    direction = direction_of(pair)
    plane = control_plane(flow, pair)
    if plane.lowest > polar.best_horizontal[direction]:
        return NO_CONTROL
    # the part of the glide angles that is fast enough for the plane and for the depth
    shallow = angle_of_horizontal_speed(polar, direction, plane.lowest, polar.shallowest[direction])
    steep = angle_of_horizontal_speed(polar, direction, plane.lowest, polar.steepest[direction])
    needed = angle_of_vertical_speed(polar, direction, slowest)
    if not needed <= steep:
        return 0
    shallow = max(shallow, needed)
    if plane.a == 0.0 and plane.b == 0.0:
        count = min(2, steering.candidates)
        controls[0] = (steep, heading_of(plane.u, plane.v))
        controls[count - 1] = (shallow if count == 2 else steep, heading_of(plane.u, plane.v))
        return count
    count = steering.candidates
    angles = (count + 1) // 2
    for n in range(count):
        # steepest first: the earliest arrival
        angle = steep - (n // 2 + 0.5) / angles * (steep - shallow)
        branch = 1.0 - 2.0 * (n % 2)
        controls[n] = (angle, heading_on_line(plane, horizontal_speed(polar, direction, angle), branch))
    return count


def _on_surface(steering, flow, polar, pair, slowest, controls):
    direction = direction_of(pair)
    # a golden-ratio lattice: even in glide angle, even in heading, and in both together
    steep = polar.steepest[direction]
    span = steep - polar.shallowest[direction]
    count = steering.candidates
    for n in range(count):
        turn = (n + 0.5) * GOLDEN
        heading = 2.0 * math.pi * (turn - math.floor(turn)) - math.pi
        controls[n] = (steep - (n + 0.5) / count * span, heading)
    return count


_CANDIDATES: dict[type, Callable[..., Any]] = {Streamline: _on_line, Surface: _on_surface}


def candidate_controls(steering, flow, polar, pair, slowest, controls):
    """Fill `controls` (candidates, 2) with (angle's magnitude, heading) [rad], steepest first.

    `slowest` [m/s] is the vertical speed that reaches the depth at the horizon. Returns how many there
    are, or NO_CONTROL where the lowest-speed test fails.
    """
    return _CANDIDATES[type(steering)](steering, flow, polar, pair, slowest, controls)


in_kernels(candidate_controls, _CANDIDATES)
