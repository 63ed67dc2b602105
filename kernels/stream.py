"""The stream value of a pair: how much flow crosses the straight line between its ends."""

import math

import numpy as np

from .cache import kernel
from .flow import mean_velocity

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@kernel
def stream_value(flow, x_p, y_p, z_p, x_q, y_q, z_q, t):
    """psi_c = integral of (u dy - v dx) [m^2/s] from p to q, in the 2.5-D mean flow at time t.

    Gauss-Legendre quadrature in panels no longer than the flow's own length scale.
    """
    dx = x_q - x_p
    dy = y_q - y_p
    panels = max(1, math.ceil(math.hypot(dx, dy) / flow.length_scale))
    total = 0.0
    for panel in range(panels):
        for n in range(_POINTS.size):
            s = (panel + 0.5 * (1.0 + _POINTS[n])) / panels
            u, v = mean_velocity(flow, x_p + s * dx, y_p + s * dy, z_p, z_q, t)
            total += _WEIGHTS[n] * (u * dy - v * dx)
    return 0.5 * total / panels
