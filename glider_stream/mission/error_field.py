"""The error of a forecast: a random current without divergence, from a random stream function."""

import math
from typing import NamedTuple, Protocol

import numpy as np

from ..base.arrays import Array
from .settings import ForecastError

WAVES = 96
"""Waves in the sum: so many that it is nearly normal, and its correlation nearly the one that is asked for."""


class OnMesh(Protocol):
    """A current that can be put on a grid."""

    def on_mesh(self, x: Array, y: Array, z: Array, t: Array) -> Array:
        """Return the current (times, levels, points, 2) [m/s] at places x, y (points,), for all z and t."""
        ...


class ErrorField(NamedTuple):
    """A sum of waves: psi = sum of cos(kx x + ky y + kz z + w t + phase); the current is (d psi/dy, -d psi/dx).

    `kx`, `ky`, `kz` [rad/m], `w` [rad/s] and `phase` have shape (waves,). If kx and ky are normal with variance
    1/L^2, the correlation of psi is exp(-r^2 / 2 L^2); the same holds for depth and time (Rahimi and Recht 2007,
    random Fourier features). No wave has divergence, so the sum has none. `scale` [m^2/s] sets the speed.
    """

    kx: Array
    ky: Array
    kz: Array
    w: Array
    phase: Array
    scale: float

    def at(self, x: Array, y: Array, z: Array, t: Array) -> Array:
        """Return the current (n, 2) [m/s] at points x, y, z (n,) [m] and times t (n,) [s]."""
        waves = np.outer(x, self.kx) + np.outer(y, self.ky) + np.outer(z, self.kz) + np.outer(t, self.w)
        slope = self.scale * np.sin(waves + self.phase)
        return np.column_stack([_product(slope, -self.ky[:, None]), _product(slope, self.kx[:, None])])

    def on_mesh(self, x: Array, y: Array, z: Array, t: Array) -> Array:
        """Return the current (times, levels, points, 2) [m/s] at places x, y (points,), at each of all z and t.

        The sine of a sum is a sum of two products, so each wave is computed once for each place, and once for
        each depth and time.
        """
        then = t[:, None, None] * self.w + z[None, :, None] * self.kz + self.phase
        here = np.outer(self.kx, x) + np.outer(self.ky, y)
        moment = self.scale * np.concatenate([np.sin(then), np.cos(then)], axis=-1).reshape(-1, 2 * self.w.size)
        place = np.concatenate([np.cos(here), np.sin(here)])
        parts = [_product(moment * np.tile(side, 2), place) for side in (-self.ky, self.kx)]
        return np.stack(parts, axis=-1).reshape(t.size, z.size, x.size, 2)


def error_field(settings: ForecastError, random: np.random.Generator) -> ErrorField:
    """Return a random error with the scales of `settings`, and a speed that is still to be set: `scale` is 1."""
    lengths = settings.length_m, settings.length_m, settings.depth_m, settings.time_s
    kx, ky, kz, w = (
        random.standard_normal(WAVES) / (math.inf if isinstance(length, str) else length) for length in lengths
    )
    return ErrorField(kx, ky, kz, w, random.uniform(0.0, 2.0 * math.pi, WAVES), 1.0)


def _product(a: Array, b: Array) -> Array:
    """Return the matrix product; unlike `@`, whose library may split sums by threads, always the same bits."""
    return np.asarray(np.einsum("am,mb->ab", a, b))
