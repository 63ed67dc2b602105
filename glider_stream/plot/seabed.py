"""Coast and seabed of a figure: found by asking the kernels where water ends, so any terrain works."""

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array
from ..kernels.terrain import Seabed, Terrain
from .water import sample_water

DEEPEST = -12000.0
"""No seabed is lower than this [m]."""
HALVINGS = 20
"""This many halvings find the seabed within 2 cm."""


def without_clearance(terrain: Terrain) -> Terrain:
    """Return the terrain without the clearance that the kernels add."""
    bare: Terrain = terrain._replace(clearance=0.0) if isinstance(terrain, Seabed) else terrain
    return bare


def ground_of(terrain: Terrain) -> Terrain:
    """Return the seabed itself: without clearance, keep-out areas, depth limits, and the end of a file's data."""
    ground: Terrain = (
        terrain._replace(bottom=terrain.ground, clearance=0.0) if isinstance(terrain, Seabed) else terrain
    )
    return ground


def sample_bottom(terrain: Terrain, x: ArrayLike, y: ArrayLike) -> Array:
    """Return the height of the seabed [m] at x, y [m], broadcast: 0 on land, -inf where unknown.

    It is found by halving between surface and DEEPEST, so water under an overhang counts as ground.
    """
    ground = ground_of(terrain)
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    low, high = np.full(x.shape, DEEPEST), np.zeros(x.shape)
    unknown, land = sample_water(ground, x, y, low), ~sample_water(ground, x, y, high)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        wet = sample_water(ground, x, y, middle)
        low, high = np.where(wet, low, middle), np.where(wet, middle, high)
    return np.where(land, 0.0, np.where(unknown, -np.inf, 0.5 * (low + high)))
