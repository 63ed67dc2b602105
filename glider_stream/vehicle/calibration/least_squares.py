"""Fits: values of a vehicle by least squares, with their standard errors."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array
from ..models import Glider
from .dives import Dives
from .instruments import Flown, distances

SPEED_ERROR, ANGLE_ERROR = 0.01, math.radians(1.0)
"""The assumed errors of a recorded speed [m/s] and angle [rad], if the dives do not show their ratio."""
FINEST = 0.01
"""The smallest scatter that is assumed, as a share of these errors."""
REWEIGHTED = 10
"""The weights of the instruments are computed again at most this many times."""
STEP = 1e-5
"""The step of a logarithm for the Jacobian: far above the precision of the models."""
CLOSE = 1e-7
"""A fit is found when logarithms and the sum of squares change by less than this share."""
FURTHEST_MAIN = 3.5
FURTHEST = {"induced_drag": 3.0, "drag_alpha2": 3.0, "lift": 1.5, "lift_alpha": 1.5}
"""The bounds of |ln(value / preset's value)|: first of a buoyancy or a parasite drag, then of the others."""


@dataclass(frozen=True)
class Fit:
    """The result: logarithms of values over the preset's, standard errors, and which are at their bound."""

    names: tuple[str, ...]
    logs: Array
    errors: Array
    bound: NDArray[np.bool_]


@dataclass(frozen=True)
class FitProblem:
    """The problem of a fit: `dives`, and the preset with its `volume` off neutral [cc].

    `kinds`: the instruments. `groups` (n,): dives that share an unknown volume; or `recorded` (n,): the volumes
    [cc] of the dives.
    """

    dives: Dives
    base: Glider
    volume: float
    kinds: tuple[str, ...]
    groups: dict[str, NDArray[np.bool_]]
    recorded: Array | None

    def flown(self, names: tuple[str, ...], logs: Array) -> Flown:
        """Return the records of the vehicle with fitted values."""
        ratio = dict(zip(names, np.exp(logs), strict=True))
        volumes = np.full(self.dives.vertical.size, self.volume) if self.recorded is None else self.recorded
        for name, group in self.groups.items():
            volumes = np.where(group, self.volume * ratio[name], volumes)
        return Flown(self.base, self.values(ratio), volumes)

    def flat(self, fit: Fit) -> NDArray[np.bool_]:
        """Return which dives (n,) are flatter than the fitted vehicle can glide."""
        flown = self.flown(fit.names, fit.logs)
        return np.asarray(flown.angle(self.dives) <= flown.flattest)

    def values(self, ratio: dict[str, float]) -> dict[str, float]:
        """Return coefficients of the model from their ratios to the preset's."""
        return {name: getattr(self.base, name) * float(x) for name, x in ratio.items() if name not in self.groups}

    def fit(self, names: tuple[str, ...], start: dict[str, float]) -> Fit:
        """Return the least-squares fit of the distances, in units of the instruments' errors.

        If a dive has three records, speeds and angles are weighted by their own scatter (Förstner 1979); two
        records do not show which of them is wrong. The fit starts at `start`, logarithms by name. If it starts at
        the best fit of fewer values, it is never worse for having more.
        """
        from scipy.optimize import least_squares

        angles = np.array([kind in ("glide_angle", "pitch") for kind in self.kinds])
        finest = np.where(angles, ANGLE_ERROR, SPEED_ERROR)
        scale, logs = finest.copy(), np.array([start.get(name, 0.0) for name in names])
        far = np.array([FURTHEST.get(name, FURTHEST_MAIN) for name in names])
        blocks = [angles, ~angles] if angles.any() and len(self.kinds) > 2 else []
        for _ in range(REWEIGHTED if blocks else 1):

            def residuals(logs: Array, scale: Array = scale) -> Array:
                return distances(self.flown(names, logs), self.kinds, self.dives, scale)[0].ravel()

            steps = np.full(len(names), STEP)
            found = least_squares(
                residuals, logs, bounds=(-far, far), x_scale=0.1, diff_step=steps, xtol=CLOSE, ftol=CLOSE
            )
            logs, jac = np.asarray(found.x), np.asarray(found.jac)
            off, tangent = distances(self.flown(names, logs), self.kinds, self.dives, scale)
            # the part of each residual that remains after the dive's angle and the parameters are fitted
            left = 1 - tangent**2 / (tangent**2).sum(axis=1, keepdims=True)
            left -= (np.linalg.qr(jac)[0] ** 2).sum(axis=1).reshape(off.shape)
            before = scale.copy()
            for block in blocks:
                spread = math.sqrt((off[:, block] ** 2).sum() / max(left[:, block].sum(), 1e-3))
                scale[block] = np.maximum(scale[block] * spread, FINEST * finest[block])
            if np.abs(scale / before - 1).max() < 0.01:
                break
        free = off.size - off.shape[0] - len(names)
        _, singular, rows = np.linalg.svd(jac, full_matrices=False)
        spread = math.sqrt(float((off**2).sum()) / free)
        errors = spread * np.linalg.norm(rows.T / np.maximum(singular, 1e-12), axis=1)
        return Fit(names, logs, errors, np.abs(logs) > 0.999 * far)
