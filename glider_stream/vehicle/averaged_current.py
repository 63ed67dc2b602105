"""The depth-averaged current of a dive: the way over ground between two fixes, less the way through water.

A vehicle under water knows its heading and its speed through water, so it knows where it would be in water at
rest. The fix after the dive shows where it is. The difference, divided by the time, is the mean current of the
depths that the vehicle passed (Webb, Simonetti and Jones 2001, SLOCUM; Eriksen et al. 2001, Seaglider). All
vectors are (2,), in any frame of two axes at a right angle, such as east and north.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array
from ..base.checks import FASTEST
from ..base.settings import require


@dataclass(frozen=True)
class SensorErrors:
    """Standard errors of what a vehicle knows: 68 % of the values lie within them.

    `fix` [m]: of each coordinate of a position fix. `speed`: of the speed through water, as a share of it,
    because a model of the flight gives it. `heading` [rad]: of the compass, deviation included. `drift` [m/s]: of
    the current at the surface.
    """

    fix: float = 10.0
    speed: float = 0.05
    heading: float = math.radians(3.0)
    drift: float = 0.1

    def __post_init__(self) -> None:
        for name in ("fix", "speed", "heading", "drift"):
            value = getattr(self, name)
            require(0 <= value < math.inf, f"the error of `{name}` must be at least 0; got {value:g}")


class AveragedCurrent(NamedTuple):
    """A depth-averaged `current` (2,) [m/s], the standard error (2,) [m/s] of each component, the time `below`
    [s]."""

    current: Array
    error: Array
    below: float


def averaged_current(
    over_ground: Array,
    through_water: Array,
    below: float,
    *,
    surface: float = 0.0,
    drift: Array | None = None,
    errors: SensorErrors = SensorErrors(),
) -> AveragedCurrent:
    """Return the mean current of a dive.

    `over_ground` (2,) [m]: from the fix before the dive to the fix after it. `through_water` (2,) [m]: the way
    that the vehicle dead-reckoned. `below` [s]: the time under water. `surface` [s]: the time between the two
    fixes that the vehicle spent at the surface. There it is carried by `drift` (2,) [m/s], or if that is None, by
    the current that is asked for.

    The variance of a component is the sum of: two fixes; the speed, along the way through water; the heading,
    across it; and the drift at the surface.
    """
    require(0 < below < math.inf, f"a dive must last more than 0 s; got {below:g}")
    require(0 <= surface < math.inf, f"the time at the surface must be at least 0 s; got {surface:g}")
    carried = np.zeros(2) if drift is None else surface * np.asarray(drift, np.float64)
    time = below + surface if drift is None else below
    current = (np.asarray(over_ground, np.float64) - through_water - carried) / time
    speed = float(np.hypot(*current))
    require(
        speed <= FASTEST,
        f"the fixes and the way through water give a current of {speed:.3g} m/s; check them and the times",
    )
    along, across = np.asarray(through_water, np.float64), np.array([-through_water[1], through_water[0]])
    variance = 2 * errors.fix**2 + (errors.speed * along) ** 2 + (errors.heading * across) ** 2
    variance = variance + (surface * errors.drift) ** 2
    return AveragedCurrent(current, np.sqrt(variance) / time, below)


def dead_reckoned(time: Array, heading: Array, speed: Array) -> Array:
    """Return the way through water (2,) [m]: the integral of the horizontal `speed` (n,) [m/s] along the
    `heading`.

    `time` (n,) [s]; `heading` (n,) [rad], clockwise from the second axis, so that the result is east and north
    for bearings. Between two samples the velocity is linear in time.
    """
    velocity = np.stack([speed * np.sin(heading), speed * np.cos(heading)], axis=-1)
    return np.asarray(np.trapezoid(velocity, time, axis=0))


def horizontal_speed(vertical: Array, pitch: Array, attack: float) -> Array:
    """Return the horizontal speed (n,) [m/s] through water of a glider, from its depth and its pitch.

    `vertical` (n,) [m/s]: the vertical speed, positive upward. `pitch` (n,) [rad]: positive nose up. `attack`
    [rad]: the size of the angle between pitch and path; the path is steeper than the pitch. Where the nose and
    the motion disagree, as in a turn, or the pitch is nearly level, the speed is NaN.
    """
    steep = np.abs(pitch) + attack
    glides = (np.sign(vertical) == np.sign(pitch)) & (np.abs(pitch) > LEVEL)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(glides, np.abs(vertical) / np.tan(steep), np.nan))


LEVEL = math.radians(5.0)
"""A glider whose pitch is smaller than this does not glide: it turns, or lies at the surface."""
