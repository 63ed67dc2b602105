"""Coast and seabed of a figure, found by asking the terrain itself where it ends: any terrain will do."""

import math

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array
from ..kernels.flow import Flow
from ..kernels.terrain import Seabed, Terrain
from .water import sample_water

DEEPEST = -12000.0
"""No seabed is lower [m]."""
HALVINGS = 20
"""That bring the seabed to EXACT."""
EXACT = 0.02  # m


def without_clearance(terrain: Terrain) -> Terrain:
    """The terrain as it is, rather than as near as a glider may come."""
    bare: Terrain = terrain._replace(clearance=0.0) if isinstance(terrain, Seabed) else terrain
    return bare


def known_until(flow: Flow, terrain: Terrain) -> float:
    """The height [m] below which no seabed is known; -inf where all of it is.

    Columns of a current file that are wet to the last level that was read end there, whatever lies below.
    """
    levels, bottom = getattr(flow, "levels", None), getattr(terrain, "bottom", None)
    if levels is None or bottom is None or not bottom.min() < levels.min():
        return -math.inf
    return float(bottom.min())


def sample_bottom(terrain: Terrain, x: ArrayLike, y: ArrayLike, known: float = -math.inf) -> Array:
    """Height of the seabed [m] at x, y [m], broadcast: 0 on land, -inf where no seabed lies above `known` [m].

    By halving between surface and DEEPEST, so water under an overhang counts as ground.
    """
    bare = without_clearance(terrain)
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    low, high = np.full(x.shape, DEEPEST), np.zeros(x.shape)
    none, land = sample_water(bare, x, y, low), ~sample_water(bare, x, y, high)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        wet = sample_water(bare, x, y, middle)
        low, high = np.where(wet, low, middle), np.where(wet, middle, high)
    bottom = 0.5 * (low + high)
    return np.where(land, 0.0, np.where(none | (bottom < known + EXACT), -np.inf, bottom))
