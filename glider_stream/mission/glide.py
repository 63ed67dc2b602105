"""One glide of a vehicle in the true current, with what the vehicle believes of it."""

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array
from ..kernels.cache import entry_point, in_kernels, kernel
from ..kernels.flow import Flow, by_rise, contains, rises
from ..kernels.motion import landing_in_step, rk4_rising, rk4_step
from ..kernels.place import Place, Velocity
from ..kernels.terrain import Terrain, allowed


class End(IntEnum):
    """How a glide ended."""

    DEPTH = 0
    """It came to its depth, or to its time if it stays at one depth."""
    REACHED = 1
    """The vehicle believes that it is at its last waypoint."""
    BLOCKED = 2
    """The terrain does not allow the next place."""
    OUTSIDE = 3
    """The current is not known there."""
    CARRIED = 4
    """The water rises or sinks so fast that it did not come to its depth in LATEST times the still time."""


DEPTH, REACHED, BLOCKED, OUTSIDE, CARRIED = (int(end) for end in End)
LATEST = 8.0
"""In water that rises a glide to a depth may take this many times what it takes in still water."""


class Motion(NamedTuple):
    """The true motion: `horizontal` speed and `w` through water [m/s], `turn` [rad] off the heading."""

    horizontal: float
    w: float
    turn: float


class Belief(NamedTuple):
    """What the vehicle believes: its place x, y [m], its `horizontal` speed and the current u, v [m/s]."""

    x: float
    y: float
    horizontal: float
    u: float
    v: float


class Aim(NamedTuple):
    """A fixed `heading` [rad], or waypoints `stops` (n, 2) [m] from number `first` on, reached at `radius` [m].

    With `stops` empty the heading holds. `ends`: whether the glide ends when the last waypoint is reached.
    """

    heading: float
    stops: Array
    first: int
    radius: float
    ends: bool


class Glided(NamedTuple):
    """A glide as it was flown: rows [t, x, y, z], how it `ended`, and what the vehicle believes afterwards.

    `x`, `y` [m]: its place by dead reckoning; `own_x`, `own_y` [m]: its way through water; `stop`: its waypoint.
    `true_x`, `true_y` [m]: its way through water in truth.
    """

    rows: Array
    ended: int
    x: float
    y: float
    own_x: float
    own_y: float
    stop: int
    true_x: float
    true_y: float


@entry_point()
def heading_to(x, y, u, v, speed):  # type: ignore[no-untyped-def]
    """Return the heading [rad] whose way over ground, in a current u, v [m/s], leads along x, y [m].

    If the current across is faster than the vehicle, it heads straight for the place.
    """
    away = math.hypot(x, y)
    if away == 0.0:
        return math.atan2(-v, -u)
    ex, ey = x / away, y / away
    across = v * ex - u * ey
    along = speed * speed - across * across
    if along <= 0.0:
        return math.atan2(ey, ex)
    along = math.sqrt(along)
    return math.atan2(ey * along - ex * across, ex * along + ey * across)


Stepped = tuple[float, float, float, float, bool]


def _step(flow: Flow, here: Place, through: Velocity, step: float, depth: float) -> Stepped:
    """Return the place x, y, z [m] after a step, its length [s], and whether the glide is at its depth."""
    return _STEP[rises(flow)](flow, here, through, step, depth)


def _step_level(flow: Flow, here: Place, through: Velocity, step: float, depth: float) -> Stepped:
    x, y = rk4_step(flow, here, through, step)
    return x, y, here.z + through.w * step, step, False


def _step_rising(flow: Flow, here: Place, through: Velocity, step: float, depth: float) -> Stepped:
    x, y, z = rk4_rising(flow, here, through, step)
    if through.w == 0.0:  # it stays at its depth
        return x, y, here.z, step, False
    way = 1.0 if through.w > 0.0 else -1.0
    if (z - depth) * way >= 0.0 and (here.z - depth) * way < 0.0:
        x, y, since = landing_in_step(flow, here, z, through, step, depth)
        return x, y, depth, since, True
    return x, y, min(z, 0.0), step, False  # nothing lifts a vehicle above the surface


_STEP = (_step_level, _step_rising)
in_kernels(_step, by_rise(*_STEP))


@kernel
def _longest(flow, start, depth, duration, w):  # type: ignore[no-untyped-def]
    """Return how long [s] a glide may last."""
    still = duration if w == 0.0 else max((depth - start.z) / w, 0.0)
    return LATEST * still if rises(flow) and w != 0.0 else still


@entry_point()
def fly(flow, terrain, start, depth, duration, motion, belief, aim, dt, rows):  # type: ignore[no-untyped-def]
    """Fly from `start` (a Place) to a height `depth` [m], or for a `duration` [s] if `motion.w` is 0.

    Write rows [t, x, y, z] and return their number, how it ended, and the fields of `Glided`.
    """
    here, count, ended, stop = start, 1, DEPTH, aim.first
    rows[0] = start.t, start.x, start.y, start.z
    x, y, own_x, own_y, true_x, true_y = belief.x, belief.y, 0.0, 0.0, 0.0, 0.0
    left = _longest(flow, start, depth, duration, motion.w)
    heading, steers = aim.heading, aim.stops.shape[0] > 0
    while left > 0.0:
        if steers:
            last = aim.stops.shape[0] - 1
            while stop < last and math.hypot(aim.stops[stop, 0] - x, aim.stops[stop, 1] - y) <= aim.radius:
                stop += 1
            off_x, off_y = aim.stops[stop, 0] - x, aim.stops[stop, 1] - y
            if aim.ends and stop == last and math.hypot(off_x, off_y) <= aim.radius:
                ended = REACHED
                break
            heading = heading_to(off_x, off_y, belief.u, belief.v, belief.horizontal)
        if not contains(flow, here.x, here.y, here.t):
            ended = OUTSIDE
            break
        step = min(dt, left)
        true = heading + motion.turn
        through = Velocity(motion.horizontal * math.cos(true), motion.horizontal * math.sin(true), motion.w)
        east, north, height, step, there = _step(flow, here, through, step, depth)
        left = 0.0 if there else left - step
        if left <= 0.0 and motion.w != 0.0 and not rises(flow):
            height = depth
        if not allowed(terrain, east, north, height):
            ended = BLOCKED
            break
        here = Place(east, north, height, here.t + step)
        forward_x, forward_y = belief.horizontal * math.cos(heading), belief.horizontal * math.sin(heading)
        true_x, true_y = true_x + through.u * step, true_y + through.v * step
        own_x, own_y = own_x + forward_x * step, own_y + forward_y * step
        x, y = x + (forward_x + belief.u) * step, y + (forward_y + belief.v) * step
        rows[count] = here.t, here.x, here.y, here.z
        count += 1
    if rises(flow) and ended == DEPTH and (depth - here.z) * motion.w > 0.0:
        ended = CARRIED
    return count, ended, x, y, own_x, own_y, stop, true_x, true_y


def glided(
    flow: Flow,
    terrain: Terrain,
    start: Place,
    depth: float,
    duration: float,
    motion: Motion,
    belief: Belief,
    aim: Aim,
    dt: float,
) -> Glided:
    """Return a glide as `fly` flies it; `dt` [s] is the longest step."""
    time = duration if motion.w == 0.0 else max((depth - start.z) / motion.w, 0.0)
    time *= LATEST if rises(flow) else 1.0
    rows = np.empty((int(time / dt) + 3, 4))
    count, *rest = fly(flow, terrain, start, depth, duration, motion, belief, aim, dt, rows)
    return Glided(rows[:count].copy(), *rest)
