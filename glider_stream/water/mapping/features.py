"""Draws currents from the prior: sums of random waves, each without divergence."""

import math
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Array
from .covariance import AT_ONCE
from .scales import ROOT_5, Scales, stretched

WAVES = 2000
"""Waves in a sample. Over many samples their covariance is the prior's exactly; one sample is nearly Gaussian."""


@dataclass(frozen=True)
class Waves:
    """A sample of the prior: psi is the sum of `cos` cos(phase) + `sin` sin(phase), phase = k . (x, y, z, t).

    `k` (waves, 4) [rad/m, ..., rad/s], of which z is the stretched depth. `constant` (2): the constant current
    [m/s].
    """

    k: Array
    cos: Array
    sin: Array
    constant: Array

    def stream(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """Return psi (m) [m^2/s] at places (m)."""
        total = self.constant[0] * y - self.constant[1] * x
        for part, phase in self._phases(x, y, depth, t):
            total[part] += np.cos(phase) @ self.cos + np.sin(phase) @ self.sin
        return np.asarray(total)

    def velocity(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """Return u, v (m, 2) [m/s] at places (m)."""
        found = np.tile(self.constant, (x.size, 1))
        for part, phase in self._phases(x, y, depth, t):
            c, s = np.cos(phase), np.sin(phase)
            found[part, 0] += c @ (self.sin * self.k[:, 1]) - s @ (self.cos * self.k[:, 1])
            found[part, 1] -= c @ (self.sin * self.k[:, 0]) - s @ (self.cos * self.k[:, 0])
        return found

    def _phases(self, x: Array, y: Array, depth: Array, t: Array) -> "list[tuple[slice, Array]]":
        at = np.stack([x, y, stretched(depth), t], axis=-1)
        step = max(1, AT_ONCE // len(self.k))
        return [(slice(n, n + step), at[n : n + step] @ self.k.T) for n in range(0, len(at), step)]

    def on_grid(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """Return u, v (nt, nz, m, 2) [m/s] at places x, y (m), each at all depths (nz) and times (nt)."""
        found = np.empty((t.size, depth.size, x.size, 2))
        turn = np.exp(1j * (stretched(depth)[:, None] * self.k[:, 2]))
        later = np.exp(1j * (t[:, None] * self.k[:, 3]))
        above = (later[:, None, :] * turn).reshape(-1, len(self.k))
        step = max(1, AT_ONCE // len(self.k))
        for n in range(0, x.size, step):
            part = slice(n, n + step)
            plane = np.exp(1j * (x[part, None] * self.k[:, 0] + y[part, None] * self.k[:, 1]))
            # d/dy of cos cos(p) + sin sin(p) is the real part of k_y (sin + i cos) exp(i p)
            for component, along in ((0, self.k[:, 1]), (1, -self.k[:, 0])):
                weighted = (along * (self.sin + 1j * self.cos)) * plane
                values = (above @ weighted.T).real.reshape(t.size, depth.size, -1)
                found[:, :, part, component] = values + self.constant[component]
        return found


def draw(scales: Scales, generator: np.random.Generator, waves: int = WAVES) -> Waves:
    """Return a sample of the prior.

    Waves are drawn from the spectrum of the velocity rather than of psi, so that each carries as much current:
    with kappa their wavenumber, kappa^3 S(kappa) has kappa^2 length^2 / 2 distributed as Gamma(2) for the
    Gaussian kernel, and kappa^2 length^2 / 5 as BetaPrime(2, 3/2) for Matern's.
    """
    if scales.kernel == "gaussian":
        kappa = np.sqrt(2 * generator.gamma(2.0, size=waves)) / scales.length
    else:
        share = generator.beta(2.0, 1.5, size=waves)
        kappa = ROOT_5 / scales.length * np.sqrt(share / (1 - share))
    angle = generator.uniform(0, 2 * math.pi, waves)
    k = np.zeros((waves, 4))
    k[:, 0], k[:, 1] = kappa * np.cos(angle), kappa * np.sin(angle)
    for column, scale in ((2, scales.depth), (3, scales.time)):
        # the spectrum of Matern's kernel of order 3/2 is Student's t with 3 degrees of freedom
        t = generator.standard_t(3, size=waves)
        if math.isfinite(scale):
            k[:, column] = t / scale
    amplitude = scales.speed * math.sqrt(2 / waves) / kappa
    cos, sin = generator.normal(size=(2, waves)) * amplitude
    return Waves(k, cos, sin, generator.normal(size=2) * scales.mean)
