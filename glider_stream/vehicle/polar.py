"""The glide polar: the speeds of a model as a table for the kernels."""

import hashlib
import math
from typing import Protocol

import numpy as np

from ..base.arrays import Array
from ..base.errors import InputError
from ..base.settings import require
from ..kernels.control import Polar

POLAR_TOLERANCE = 1e-7
"""The relative error of a speed from the table, which is linear between its angles."""

POLAR_STEPS = (256, 65536)
"""The fewest and the most steps that a table may have."""

ROUNDING = 8 * np.finfo(np.float64).eps
"""A relative error that is larger than the rounding error of the kernels' interpolation."""


class SteadyModel(Protocol):
    """The model of steady glides that a polar is made from; see `models`."""

    @property
    def angles(self) -> tuple[float, float]:
        """Return the range of |gamma| [degrees]."""
        ...

    def speed(self, gamma: Array | float) -> Array:
        """Return the speed through water [m/s] at signed glide angles [rad]."""
        ...

    def feasible_limits(self) -> tuple[float, float]:
        """Return the shallowest steady dive (< 0) and climb (> 0) [rad]."""
        ...


def polar(model: SteadyModel) -> Polar:
    """Return the kernels' table of V [m/s] over |gamma|, with as many steps as POLAR_TOLERANCE needs."""
    low, high = np.radians(model.angles)
    steps, most = POLAR_STEPS
    while True:
        # twice as fine as the table: every second angle is the middle of a step, where the error is greatest
        angle = np.linspace(low, high, 2 * steps + 1)
        speed = np.stack([model.speed(-angle), model.speed(angle)])
        chord = 0.5 * (speed[:, :-2:2] + speed[:, 2::2])
        if np.max(np.abs(chord / speed[:, 1::2] - 1.0)) < 0.9 * POLAR_TOLERANCE:
            break
        steps *= 2
        if steps > most:
            limits = np.degrees(np.abs(model.feasible_limits()))
            raise InputError(
                f"`glider.angles` = {list(model.angles)} begins too near the limit of a steady glide, "
                f"{limits.max():.4f} degrees, for a table of {most} steps: choose a steeper first angle"
            )
    angle, speed = angle[::2], np.ascontiguousarray(speed[:, ::2])
    fastest = np.array([_fastest(angle, row) for row in speed])
    return Polar(np.full(2, low), np.full(2, high), speed, fastest[:, 0].copy(), fastest[:, 1].copy())


def _fastest(angle: Array, speed: Array) -> tuple[float, float]:
    """Return the angle [rad] and the value [m/s] of the greatest V cos(angle).

    V is linear between the rows of the table. InputError unless V cos rises up to this angle and falls after it,
    and V sin rises throughout: the kernels use bisection.
    """
    slope = np.diff(speed) / np.diff(angle)
    ends, values = np.stack([angle[:-1], angle[1:]]), np.stack([speed[:-1], speed[1:]])
    # derivatives at both ends of every step
    sinking = slope * np.sin(ends) + values * np.cos(ends)
    rising = (slope * np.cos(ends) - values * np.sin(ends) > 0.0).T.ravel()
    count = int(np.count_nonzero(rising))
    where = f"within `glider.angles` = {np.degrees(angle[[0, -1]]).round(4).tolist()}"
    require(bool(np.all(sinking > 0.0)), f"the vertical speed must rise with the glide angle {where}")
    require(bool(np.all(rising[:count])), f"the horizontal speed must have one maximum {where}")
    step = count // 2
    best = float(angle[step])
    if count % 2:  # Newton's method, since the derivative is nearly linear within the step
        for _ in range(5):
            along = speed[step] + slope[step] * (best - angle[step])
            sine, cosine = math.sin(best), math.cos(best)
            best += float((slope[step] * cosine - along * sine) / (2.0 * slope[step] * sine + along * cosine))
    # rounded up: no control may be faster than the lowest-speed test assumes
    return best, float(np.interp(best, angle, speed) * math.cos(best) * (1.0 + ROUNDING))


def glider_sha256(polar: Polar) -> str:
    """Return a digest of the polar's numbers for the roadmap file: the same glider has the same digest."""
    digest = hashlib.sha256()
    for array in polar:
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()
