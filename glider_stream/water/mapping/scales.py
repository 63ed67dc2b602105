"""The prior of a map: how strong currents are, and how far they are alike in place, depth and time.

The stream function psi has the covariance speed^2 length^2 phi(r / length) k(|dz| / depth) k(|dt| / time), where
r is the horizontal distance. For the velocity this gives, with d the vector between two places and e, e' two
directions (in the plane, e x d = e_x d_y - e_y d_x),

    cov(e . V, e' . V') = k k [f(r) e . e' - h(r) (e x d) (e' x d)],    f = -phi'(r) / r,    h = -f'(r) / r,

which is the covariance of any isotropic flow without divergence: f along the line between the places, f + r f'
across it.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base.arrays import Array
from ...base.settings import require

STRETCH = 20.0
"""Depths are compared as STRETCH log(1 + depth / STRETCH) [m]: deep currents are alike over longer distances."""
KERNELS = ("matern", "gaussian")
"""Kernels of the stream function: Matern's of order 5/2, whose currents are rough, and the Gaussian's, smooth."""
ROOT_3, ROOT_5 = math.sqrt(3.0), math.sqrt(5.0)


@dataclass(frozen=True)
class Scales:
    """The scales of a map.

    `speed` [m/s]: the standard deviation of each component. `length` [m]: of the stream function. `depth` [m]: at
    the surface, growing as 1 + depth / STRETCH; inf where the current is the same at all depths. `time` [s]: inf
    for a current that does not change. `noise` [m/s]: the standard deviation of what measurements hold beside the
    current and their stated errors. `mean` [m/s]: the standard deviation of a constant current in each direction.
    `kernel`: see KERNELS.
    """

    speed: float
    length: float
    depth: float = math.inf
    time: float = math.inf
    noise: float = 0.0
    mean: float = 0.0
    kernel: str = "matern"

    def __post_init__(self) -> None:
        for name in ("speed", "length"):
            value = getattr(self, name)
            require(0 < value < math.inf, f"`{name}` must be above 0 and finite; got {value}")
        for name in ("depth", "time"):
            require(
                getattr(self, name) > 0, f"`{name}` must be above 0, inf if unused; got {getattr(self, name)}"
            )
        for name in ("noise", "mean"):
            value = getattr(self, name)
            require(0 <= value < math.inf, f"`{name}` must be 0 or more and finite; got {value}")
        require(self.kernel in KERNELS, f"`kernel` must be one of {', '.join(KERNELS)}; got {self.kernel!r}")

    def __str__(self) -> str:
        parts = [f"speed {self.speed:.3g} m/s", f"length {self.length / 1000:.3g} km"]
        parts += [f"depth {self.depth:.3g} m"] if math.isfinite(self.depth) else []
        parts += [f"time {self.time / 3600:.3g} h"] if math.isfinite(self.time) else []
        return ", ".join([*parts, f"noise {self.noise:.3g} m/s", f"constant current {self.mean:.3g} m/s"])


def stretched(depth: Array) -> Array:
    """Return depths [m] in the coordinate in which the kernel compares them."""
    return np.asarray(STRETCH * np.log1p(depth / STRETCH))


class Along(NamedTuple):
    """f, r^2-free h (see the module) and their derivatives by log(length), for velocities of variance 1."""

    f: Array
    h: Array
    f_slope: Array
    h_slope: Array


def along(kernel: str, squared: Array, length: float, slopes: bool) -> Along:
    """Return the horizontal covariance at squared distances [m^2]; `slopes`: also the derivatives."""
    if kernel == "gaussian":
        f = np.exp(-squared / (2 * length**2))
        h = f / length**2
        if not slopes:
            return Along(f, h, f, h)
        return Along(f, h, f * squared / length**2, h * (squared / length**2 - 2))
    a = ROOT_5 / length
    s = a * np.sqrt(squared)
    decay = np.exp(-s)
    f, h = (1 + s) * decay, a**2 * decay
    return Along(f, h, s**2 * decay, h * (s - 2)) if slopes else Along(f, h, f, h)


def alike(apart: Array, scale: float, slopes: bool) -> tuple[Array, Array]:
    """Return the correlation over depths or times that lie apart (Matern's kernel of order 3/2), and its slope.

    The slope is the derivative by log(scale). Profiles of currents are rough: smoother kernels put back worse
    what lies between levels.
    """
    s = ROOT_3 / scale * np.abs(apart)
    decay = np.exp(-s)
    return (1 + s) * decay, s**2 * decay if slopes else decay
