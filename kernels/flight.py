"""Flights: LANES trajectories are computed together, each for its own time; a lane that ends takes the next."""

import math

import numpy as np

from .cache import in_kernels, inlined, kernel, making
from .flow import LEGS, Array, Flow, by_rise, contains_box, has_ladder, rises, step_to_rung
from .motion import (
    LANE_ROWS,
    LANE_STEP,
    LANE_T,
    LANE_U,
    LANE_V,
    LANE_W,
    LANE_X,
    LANE_Y,
    LANE_Z,
    LANES,
    landing_in_step,
    most_step,
    rising_lanes,
    rk4_lanes,
)
from .place import Pair, Place, Velocity
from .terrain import open_in_box

_ROWS = range(LANE_ROWS, LANE_ROWS + 22)
LANE_LEFT, LANE_LAST = _ROWS[:2]
"""Rows of a lane beyond `motion`'s: steps that are left, and the length of the last one [s]; on a ladder 1, and
the time that is left [s]."""
LANE_X_LO, LANE_X_HI, LANE_Y_LO, LANE_Y_HI = _ROWS[2:6]
"""The box [m] about the places that `widen` has seen."""
START_X, START_Y, START_Z, START_T, GOAL_X, GOAL_Y, GOAL_Z, GOAL_T = _ROWS[6:14]
"""The ends of the flight's leg, where it has one: `keep_ends` writes them, `ends_of` reads them."""
LANE_TO, LANE_WAY = _ROWS[14:16]
"""The height [m] at which a flight in a flow that rises ends, and the way there: 1 up, -1 down, 0 for none."""
_BEFORE_X, _BEFORE_Y, _BEFORE_Z, _BEFORE_T = _ROWS[16:20]
_LONGEST, _USE = _ROWS[20:]
"""Of a flight on a ladder: its longest step [s], and which ladder it uses."""
FLIGHT_ROWS = _ROWS.stop


@making
def hangar(rows):
    """Return lanes (rows, LANES), all at rest."""
    lanes = np.zeros((rows, LANES))
    lanes[LANE_LEFT] = math.inf
    return lanes


@inlined
def place(lanes, n, at, through):
    """Put lane n at a Place, with a control's velocity through water."""
    lanes[LANE_X, n], lanes[LANE_Y, n], lanes[LANE_Z, n], lanes[LANE_T, n] = at.x, at.y, at.z, at.t
    lanes[LANE_U, n], lanes[LANE_V, n], lanes[LANE_W, n] = through.u, through.v, through.w
    lanes[LANE_X_LO, n], lanes[LANE_X_HI, n], lanes[LANE_Y_LO, n], lanes[LANE_Y_HI, n] = at.x, at.x, at.y, at.y


@inlined
def keep_ends(lanes, n, pair):
    """Store the ends of lane n's leg."""
    p, q = pair
    lanes[START_X, n], lanes[START_Y, n], lanes[START_Z, n], lanes[START_T, n] = p.x, p.y, p.z, p.t
    lanes[GOAL_X, n], lanes[GOAL_Y, n], lanes[GOAL_Z, n], lanes[GOAL_T, n] = q.x, q.y, q.z, q.t


@inlined
def ends_of(lanes, n):
    """Return the ends of lane n's leg."""
    start = Place(lanes[START_X, n], lanes[START_Y, n], lanes[START_Z, n], lanes[START_T, n])
    return Pair(start, Place(lanes[GOAL_X, n], lanes[GOAL_Y, n], lanes[GOAL_Z, n], lanes[GOAL_T, n]))


@inlined
def fly_for(lanes, n, duration, dt):
    """Let lane n fly for a duration [s] in steps of `dt` [s] and a shorter last step; below 0 back in time."""
    step = math.copysign(dt, duration)
    full = math.ceil(duration / step) - 1.0
    lanes[LANE_LAST, n] = duration - full * step
    lanes[LANE_LEFT, n] = full + 1.0
    lanes[LANE_STEP, n] = step if full > 0.0 else lanes[LANE_LAST, n]


@inlined
def fly_to(flow, lanes, n, height, duration, longest, dt, use=LEGS):
    """Let lane n fly until it reaches a height [m], in steps of `dt` [s] and a shorter last step, or on a ladder.

    That takes a `duration` [s] where the flow has no vertical part; below 0 it flies back in time. In a flow that
    rises the lane ends where its path crosses the height, or after `longest` [s], with NaN as its place.
    """
    if rises(flow):
        fly_for(lanes, n, math.copysign(math.ceil(longest / dt) * dt, duration), dt)
        lanes[LANE_LAST, n] = lanes[LANE_STEP, n] = math.copysign(dt, duration)
        lanes[LANE_TO, n] = height
        lanes[LANE_WAY, n] = 1.0 if height > lanes[LANE_Z, n] else -1.0
    elif has_ladder(flow):
        most = most_step(flow, dt) if use == LEGS else dt
        lanes[LANE_LEFT, n], lanes[LANE_LAST, n], lanes[_LONGEST, n], lanes[_USE, n] = 1.0, duration, most, use
        lanes[LANE_STEP, n] = step_to_rung(flow, use, lanes[LANE_Z, n], lanes[LANE_W, n], duration, most)
    else:
        fly_for(lanes, n, duration, dt)


@inlined
def rest(lanes, n):
    """End the flight of lane n."""
    lanes[LANE_LEFT, n], lanes[LANE_STEP, n] = math.inf, 0.0


@inlined
def _count_down(flat):
    """Count the steps of all lanes; the last one has its own length."""
    for n in range(LANES):
        left = flat[np.uintp(LANE_LEFT * LANES + n)] - 1.0
        flat[np.uintp(LANE_LEFT * LANES + n)] = left
        # the compiler makes a selection of this, not a branch
        flat[np.uintp(LANE_STEP * LANES + n)] = (
            flat[np.uintp(LANE_LAST * LANES + n)] if left == 1.0 else flat[np.uintp(LANE_STEP * LANES + n)]
        )


@inlined
def _climb(flow, lanes):
    """Choose the next step of every lane on the flow's ladder; a lane without a step is at rest."""
    for n in range(LANES):
        step = lanes[LANE_STEP, n]
        if step == 0.0:
            continue
        left = lanes[LANE_LAST, n] - step
        lanes[LANE_LAST, n] = left
        if left == 0.0:
            lanes[LANE_LEFT, n], lanes[LANE_STEP, n] = 0.0, 0.0
        else:
            use = np.uintp(lanes[_USE, n])
            z, w, most = lanes[LANE_Z, n], lanes[LANE_W, n], lanes[_LONGEST, n]
            lanes[LANE_STEP, n] = step_to_rung(flow, use, z, w, left, most)


def advance(flow: Flow, lanes: Array) -> None:
    """Make one RK4 step of every lane in flight; a lane whose LANE_LEFT is 0 has ended."""
    _ADVANCE[rises(flow)](flow, lanes)


def _advance_level(flow, lanes):
    rk4_lanes(flow, lanes)
    if has_ladder(flow):
        _climb(flow, lanes)
    else:
        _count_down(lanes.reshape(-1))


def _advance_rising(flow, lanes):
    for n in range(LANES):
        lanes[_BEFORE_X, n], lanes[_BEFORE_Y, n] = lanes[LANE_X, n], lanes[LANE_Y, n]
        lanes[_BEFORE_Z, n], lanes[_BEFORE_T, n] = lanes[LANE_Z, n], lanes[LANE_T, n]
    rising_lanes(flow, lanes)
    for n in range(LANES):
        to, way = lanes[LANE_TO, n], lanes[LANE_WAY, n]
        if (lanes[LANE_Z, n] - to) * way >= 0.0 and (lanes[_BEFORE_Z, n] - to) * way < 0.0:
            _land(flow, lanes, n)
        elif lanes[LANE_LEFT, n] == 1.0 and way != 0.0:
            lanes[LANE_X, n] = lanes[LANE_Y, n] = math.nan
    _count_down(lanes.reshape(-1))


_ADVANCE = (_advance_level, _advance_rising)
in_kernels(advance, by_rise(*_ADVANCE))


@kernel
def _land(flow, lanes, n):
    """End the flight of lane n where its last step crossed its height."""
    before = Place(lanes[_BEFORE_X, n], lanes[_BEFORE_Y, n], lanes[_BEFORE_Z, n], lanes[_BEFORE_T, n])
    through = Velocity(lanes[LANE_U, n], lanes[LANE_V, n], lanes[LANE_W, n])
    height = lanes[LANE_TO, n]
    x, y, since = landing_in_step(flow, before, lanes[LANE_Z, n], through, lanes[LANE_STEP, n], height)
    lanes[LANE_X, n], lanes[LANE_Y, n], lanes[LANE_Z, n] = x, y, height
    lanes[LANE_T, n] = before.t + since
    lanes[LANE_LEFT, n] = 1.0


@kernel
def widen(lanes):
    """Extend the boxes to the places where the lanes are."""
    for n in range(LANES):
        x, y = lanes[LANE_X, n], lanes[LANE_Y, n]
        lanes[LANE_X_LO, n], lanes[LANE_X_HI, n] = min(lanes[LANE_X_LO, n], x), max(lanes[LANE_X_HI, n], x)
        lanes[LANE_Y_LO, n], lanes[LANE_Y_HI, n] = min(lanes[LANE_Y_LO, n], y), max(lanes[LANE_Y_HI, n], y)


@kernel
def stretch(lanes, n, margin):
    """Extend the box of lane n by a margin [m] on all sides."""
    lanes[LANE_X_LO, n], lanes[LANE_X_HI, n] = lanes[LANE_X_LO, n] - margin, lanes[LANE_X_HI, n] + margin
    lanes[LANE_Y_LO, n], lanes[LANE_Y_HI, n] = lanes[LANE_Y_LO, n] - margin, lanes[LANE_Y_HI, n] + margin


@kernel
def stayed_inside(flow, lanes, n, t, duration):
    """Return whether the flow is surely known in all of lane n's box from time t [s] on."""
    x_lo, x_hi = lanes[LANE_X_LO, n], lanes[LANE_X_HI, n]
    return contains_box(flow, x_lo, x_hi, lanes[LANE_Y_LO, n], lanes[LANE_Y_HI, n], t, t + duration)


@kernel
def stayed_open(flow, terrain, lanes, n, z, z_end):
    """Return whether the terrain surely allows all of lane n's box between two heights [m].

    Of a flow with a vertical part that is not known: its path may go higher or deeper than its ends.
    """
    if rises(flow):
        return False
    x_lo, x_hi = lanes[LANE_X_LO, n], lanes[LANE_X_HI, n]
    return open_in_box(terrain, x_lo, x_hi, lanes[LANE_Y_LO, n], lanes[LANE_Y_HI, n], min(z, z_end))
