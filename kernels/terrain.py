"""Terrain: the places where a glider may be. Seabed and land are given as the height of the bottom."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from .cache import in_kernels
from .flow import Array, grid_index


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


def _open_between(terrain, z, z_end):
    return min(z, z_end) >= terrain.floor


def _unsure(terrain, z, z_end):
    return False


_OPEN_BETWEEN: dict[type, Callable[..., Any]] = {OpenWater: _open_between, Seabed: _unsure}


def open_between(terrain: Terrain, z: float, z_end: float) -> bool:
    """Return whether all water between two heights [m] is surely allowed; a quick check before an exact one."""
    return _OPEN_BETWEEN[type(terrain)](terrain, z, z_end)


in_kernels(open_between, _OPEN_BETWEEN)
