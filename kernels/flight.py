"""Flights: LANES trajectories in the air together, each for its own time; a lane that lands takes the next."""

import math

import numpy as np

from .cache import inlined, kernel, making
from .flow import contains_box
from .motion import LANE_ROWS, LANES, H, T, U, V, W, X, Y, Z, rk4_lanes

_ROWS = range(LANE_ROWS, LANE_ROWS + 6)
LEFT, LAST = _ROWS[:2]
"""Rows of a lane beyond `motion`'s own: steps that are left, and the length of the last one [s]."""
X_LO, X_HI, Y_LO, Y_HI = _ROWS[2:]
"""The box [m] about the places that `widen` has seen."""
FLIGHT_ROWS = _ROWS.stop


@making
def hangar(rows):
    """Lanes of `rows` rows, all at rest: (rows, LANES)."""
    lanes = np.zeros((rows, LANES))
    lanes[LEFT] = math.inf
    return lanes


@inlined
def place(lanes, n, x, y, z, t, u, v, w):
    """Put lane n at a place [m] and time [s], with a velocity through water [m/s]."""
    lanes[X, n], lanes[Y, n], lanes[Z, n], lanes[T, n] = x, y, z, t
    lanes[U, n], lanes[V, n], lanes[W, n] = u, v, w
    lanes[X_LO, n], lanes[X_HI, n], lanes[Y_LO, n], lanes[Y_HI, n] = x, x, y, y


@inlined
def fly_for(lanes, n, duration, dt):
    """Let lane n fly for a duration [s], steps of `dt` and a last, shorter one; below 0 back in time."""
    step = math.copysign(dt, duration)
    full = math.ceil(duration / step) - 1.0
    lanes[LAST, n] = duration - full * step
    lanes[LEFT, n] = full + 1.0
    lanes[H, n] = step if full > 0.0 else lanes[LAST, n]


@inlined
def rest(lanes, n):
    """Take lane n out of the air."""
    lanes[LEFT, n], lanes[H, n] = math.inf, 0.0


@kernel
def advance(flow, lanes):
    """One RK4 step of every lane in the air; a lane whose LEFT is 0 has landed."""
    rk4_lanes(flow, lanes)
    flat = lanes.reshape(-1)
    for n in range(LANES):
        left = flat[np.uintp(LEFT * LANES + n)] - 1.0
        flat[np.uintp(LEFT * LANES + n)] = left
        # the compiler makes a selection of this, not a branch
        flat[np.uintp(H * LANES + n)] = (
            flat[np.uintp(LAST * LANES + n)] if left == 1.0 else flat[np.uintp(H * LANES + n)]
        )


@kernel
def widen(lanes):
    """Let the boxes hold where the lanes are."""
    for n in range(LANES):
        lanes[X_LO, n], lanes[X_HI, n] = min(lanes[X_LO, n], lanes[X, n]), max(lanes[X_HI, n], lanes[X, n])
        lanes[Y_LO, n], lanes[Y_HI, n] = min(lanes[Y_LO, n], lanes[Y, n]), max(lanes[Y_HI, n], lanes[Y, n])


@kernel
def stayed_inside(flow, lanes, n, t, duration):
    """Whether lane n's box since t [s] is known to lie where the flow is known."""
    x_lo, x_hi, y_lo, y_hi = lanes[X_LO, n], lanes[X_HI, n], lanes[Y_LO, n], lanes[Y_HI, n]
    return contains_box(flow, x_lo, x_hi, y_lo, y_hi, t, t + duration)
