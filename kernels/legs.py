"""Flies legs with given controls: each leg has its place, its time and its duration."""

from .cache import entry_point, inlined, kernel
from .edges import CLEARANCE_SPACING
from .flight import FLIGHT_ROWS, LANE_LEFT, advance, fly_to, hangar, place, rest
from .motion import LANE_T, LANE_X, LANE_Y, LANES, is_clear, stays_inside
from .place import Place, Velocity

_LEG = FLIGHT_ROWS
"""The row of a lane that says which leg it flies."""


@inlined
def _leg_of(start, through, leg):
    """Return the place where a leg begins, and its velocity through water."""
    x, y, z, t = start[leg]
    u, v, w = through[leg]
    return Place(x, y, z, t), Velocity(u, v, w)


@kernel
def _take_off(flow, start, through, duration, height, longest, dt, leg, lanes, n):
    """Start lane n on a leg."""
    at, velocity = _leg_of(start, through, leg)
    place(lanes, n, at, velocity)
    fly_to(flow, lanes, n, height[leg], duration[leg], longest, dt)
    lanes[_LEG, n] = leg


@entry_point(nogil=True)
def fly_legs(flow, start, through, duration, height, longest, dt, end, first, last):
    """Where and when legs first..last - 1 end: x, y [m] and the time since their departure [s] into `end` (n, 3).

    `start` (n, 4): x, y, z [m] and departure [s]; `through` (n, 3): velocity through water [m/s]; `duration`
    (n,) [s], above 0. In a flow that rises a leg ends where it reaches its `height` (n,) [m], within
    `longest` [s], and not after its duration. Steps as `motion.trace` takes them; a leg's end does not depend on
    its company.
    """
    lanes = hangar(FLIGHT_ROWS + 1)
    waiting, flying = first, 0
    for n in range(LANES):
        if waiting < last:
            _take_off(flow, start, through, duration, height, longest, dt, waiting, lanes, n)
            waiting, flying = waiting + 1, flying + 1
    while flying > 0:
        advance(flow, lanes)
        for n in range(LANES):
            if lanes[LANE_LEFT, n] > 0.0:
                continue
            leg = int(lanes[_LEG, n])
            end[leg, 0], end[leg, 1] = lanes[LANE_X, n], lanes[LANE_Y, n]
            end[leg, 2] = lanes[LANE_T, n] - start[leg, 3]
            if waiting < last:
                _take_off(flow, start, through, duration, height, longest, dt, waiting, lanes, n)
                waiting += 1
            else:
                rest(lanes, n)
                flying -= 1


@entry_point(nogil=True)
def legs_fit(medium, start, through, duration, fits, first, last):
    """Whether legs first..last - 1 stay where the flow is known and where the terrain allows: `fits` (n,).

    Arguments as in `fly_legs`.
    """
    dt = medium.integration.dt
    for leg in range(first, last):
        at, velocity = _leg_of(start, through, leg)
        fits[leg] = stays_inside(medium.flow, at, velocity, duration[leg], dt) and is_clear(
            medium.flow, medium.terrain, at, velocity, duration[leg], dt, CLEARANCE_SPACING
        )
