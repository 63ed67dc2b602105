"""A current of a map on a grid, as the planner's methods read it, and the error of the grid."""

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Array
from ...base.settings import require
from ...kernels.flow import OceanGrid, velocities
from ...kernels.terrain import Seabed
from ..ocean.flow import grid_flow
from .conditioned import Current

CHECKED = 4096
"""The error of a grid is the largest at this many points between its own."""


@dataclass(frozen=True)
class Gridded:
    """A current on a grid: `flow` and `seabed` for the kernels.

    `error` [m/s]: the largest difference from the current at CHECKED points of the box. `rms_error` [m/s].
    """

    flow: OceanGrid
    seabed: Seabed
    error: float
    rms_error: float


def gridded(current: Current, x: Array, y: Array, depth: Array, t: Array | None = None) -> Gridded:
    """Return a current of a map on a grid of even x (nx), y (ny) [m], depths (nz) [m] and times (nt) [s].

    It is interpolated linearly between its points, so it is free of divergence only as far as its spacing allows.
    Without times it is the current at t = 0, taken as steady.
    """
    depth = np.atleast_1d(np.asarray(depth, dtype=np.float64))
    times = np.zeros(1) if t is None else np.atleast_1d(np.asarray(t, dtype=np.float64))
    require(bool((depth >= 0).all()), f"a depth counts downward; got {depth.min():g} m: turn its sign")
    at_x, at_y = np.meshgrid(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
    values = current.on_grid(at_x.ravel(), at_y.ravel(), depth, times)
    u, v = (values[..., n].reshape(times.size, depth.size, *at_x.shape) for n in range(2))
    flow, seabed = grid_flow(x, y, -depth, u, v, None if t is None else times)
    share = np.random.default_rng(0).random((4, CHECKED))
    lows = [float(np.min(part)) for part in (x, y, depth, times)]
    highs = [float(np.max(part)) for part in (x, y, depth, times)]
    px, py, deep, when = (lo + part * (hi - lo) for lo, hi, part in zip(lows, highs, share, strict=True))
    read = velocities(flow, px, py, -deep, when)
    off = np.hypot(*(read - current.velocity(px, py, deep, when)).T)
    return Gridded(flow, seabed, float(off.max()), float(np.sqrt((off**2).mean())))
