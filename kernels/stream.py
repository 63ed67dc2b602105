"""The stream value of a pair: the amount of flow that crosses the straight line between its ends."""

import math

import numpy as np

from .cache import kernel
from .flow import mean_velocity

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@kernel
def stream_value(flow, pair):
    """psi_c = integral of (u dy - v dx) [m^2/s] from p to q, in the 2.5-D mean flow when the leg leaves.

    Gauss-Legendre quadrature in panels no longer than the flow's own length scale.
    """
    p, q = pair
    dx = q.x - p.x
    dy = q.y - p.y
    panels = max(1, math.ceil(math.hypot(dx, dy) / flow.extent.length_scale))
    total = 0.0
    for panel in range(panels):
        for n in range(_POINTS.size):
            s = (panel + 0.5 * (1.0 + _POINTS[n])) / panels
            u, v = mean_velocity(flow, p.x + s * dx, p.y + s * dy, p.z, q.z, p.t)
            total += _WEIGHTS[n] * (u * dy - v * dx)
    return 0.5 * total / panels
