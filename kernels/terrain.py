"""Terrain: the places where a glider may be. Seabed and land are given as the height of the bottom."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from .cache import in_kernels
from .flow import ROUNDING, Array, grid_index, index_ranges

MOST_CELLS = 1024
"""A quick look at a box reads at most so many cells of a seabed; a larger box is left to the exact look."""
HEIGHT_ROUNDING = 1e-6
"""A quick look asks for this much more water [m] than the exact look, whose heights are rounded."""


class OpenWater(NamedTuple):
    """No land and no seabed above `floor` [m, upward]."""

    floor: float


class Seabed(NamedTuple):
    """The bottom's height [m, upward; >= 0 is land] in each cell around a grid point: shape (ni, nj).

    A glider keeps `clearance` [m] above it. `index_map` as in `flow.OceanGrid`. `ground` (ni, nj): the seabed
    itself, for figures: -inf where it is not known, though `bottom` closes what lies below.
    """

    bottom: Array
    clearance: float
    index_map: Array
    per_x: float
    per_y: float
    x_lo: float
    y_lo: float
    ground: Array


Terrain = OpenWater | Seabed


def _open_water(terrain, x, y, z):
    return z >= terrain.floor


def _seabed(terrain, x, y, z):
    at_i, at_j = grid_index(terrain.index_map, x, y, terrain.x_lo, terrain.y_lo, terrain.per_x, terrain.per_y)
    i = min(max(np.intp(at_i + 0.5), 0), terrain.bottom.shape[0] - 1)
    j = min(max(np.intp(at_j + 0.5), 0), terrain.bottom.shape[1] - 1)
    bottom = terrain.bottom[i, j]
    return bottom < 0.0 and z >= bottom + terrain.clearance


_ALLOWED: dict[type, Callable[..., Any]] = {OpenWater: _open_water, Seabed: _seabed}


def allowed(terrain: Terrain, x: float, y: float, z: float) -> bool:
    """Return whether a glider may be at (x, y, z) [m]."""
    return _ALLOWED[type(terrain)](terrain, x, y, z)


in_kernels(allowed, _ALLOWED)


def _open_water_in_box(terrain, x_lo, x_hi, y_lo, y_hi, z):
    return z >= terrain.floor


def _seabed_below_box(terrain, x_lo, x_hi, y_lo, y_hi, z):
    if not x_hi - x_lo + y_hi - y_lo < math.inf:
        return False
    i_lo, i_hi, j_lo, j_hi = index_ranges(
        terrain.index_map, x_lo, x_hi, y_lo, y_hi, terrain.x_lo, terrain.y_lo, terrain.per_x, terrain.per_y
    )
    ni, nj = terrain.bottom.shape
    i_first, i_last = max(int(i_lo + 0.5 - ROUNDING), 0), min(int(i_hi + 0.5 + ROUNDING), ni - 1)
    j_first, j_last = max(int(j_lo + 0.5 - ROUNDING), 0), min(int(j_hi + 0.5 + ROUNDING), nj - 1)
    i_first, j_first = min(i_first, ni - 1), min(j_first, nj - 1)
    i_last, j_last = max(i_last, 0), max(j_last, 0)
    if (i_last - i_first + 1) * (j_last - j_first + 1) > MOST_CELLS:
        return False
    for i in range(i_first, i_last + 1):
        for j in range(j_first, j_last + 1):
            bottom = terrain.bottom[i, j]
            if bottom >= 0.0 or z - HEIGHT_ROUNDING < bottom + terrain.clearance:
                return False
    return True


_OPEN_IN_BOX: dict[type, Callable[..., Any]] = {OpenWater: _open_water_in_box, Seabed: _seabed_below_box}


def open_in_box(terrain: Terrain, x_lo: float, x_hi: float, y_lo: float, y_hi: float, z: float) -> bool:
    """Return whether all water in a box [m] above z [m] is surely allowed; a quick look before an exact one.

    Without a box, from -inf to inf, a `Seabed` is not sure.
    """
    return _OPEN_IN_BOX[type(terrain)](terrain, x_lo, x_hi, y_lo, y_hi, z)


in_kernels(open_in_box, _OPEN_IN_BOX)
