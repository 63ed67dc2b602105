"""One component of the current from one file, on its own points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array
from ...base.nearest import tree_of
from .file import Times
from .grid import Grid, unit_vectors
from .land import Evidence
from .levels import Levels

Values = NDArray[np.float32]


@dataclass(frozen=True)
class Part:
    """One component of the current from one file, on its own points: `values` (nt, nz, ny, nx) [m/s].

    `levels`: the levels that were read. `deeper` (1, n, ny, nx): values of the levels below them, at the first
    time, or at the time of the fastest current where that is zero. `way`: the direction of the component, "east",
    "grid" or "unsure". `signs`: -1 for an axis of the plane that the file counts downward. `fields`: fields at
    other points, `angle` and `seabed`. `zeros`: how the file uses zeros.
    """

    component: str
    variable: str
    grid: Grid
    levels: Levels
    times: Times | None
    values: Values
    deeper: Values | None
    took: dict[str, str]
    notes: tuple[str, ...]
    way: str
    signs: tuple[int, int]
    fields: dict[str, "Field"]
    zeros: Evidence


@dataclass(frozen=True)
class Field:
    """Numbers (n,) at places (n,) [degrees], with the name of their variable."""

    name: str
    lon: Array
    lat: Array
    values: Array

    def at(self, lon: Array, lat: Array) -> Array | None:
        """Return the values at the points (ny, nx) if these are the field's own points, else None."""
        points = unit_vectors(lon, lat)
        tree = tree_of(unit_vectors(self.lon, self.lat))
        off, nearest = map(np.asarray, tree.query(points.reshape(-1, 3)))
        cell = np.linalg.norm(np.diff(points, axis=1), axis=-1).max(initial=0.0)
        return self.values[nearest].reshape(lon.shape) if float(off.max()) < 0.2 * cell else None

    def least(self, lon: Array, lat: Array) -> Array:
        """Return the value at each point (ny, nx), or the least of the values around it; NaN if none is near."""
        points = unit_vectors(lon, lat)
        cell = np.linalg.norm(np.diff(points, axis=1), axis=-1).max(initial=0.0)
        if self.lon.size == 0:
            return np.full(lon.shape, np.nan)
        tree = tree_of(unit_vectors(self.lon, self.lat))
        off, near = map(np.asarray, tree.query(points.reshape(-1, 3), k=min(4, self.lon.size)))
        off, near = off.reshape(lon.size, -1), near.reshape(lon.size, -1)
        around = np.where(off <= 1.2 * cell, self.values[near], np.inf)
        # land among the points around does not count: a point has no depth only if it is itself on land
        around = np.where(np.isnan(around), np.inf, around).min(axis=1)
        nearest = self.values[near[:, 0]]
        value = np.where(off[:, 0] < 0.2 * cell, nearest, np.where(np.isinf(around), np.nan, around))
        return np.asarray(value.reshape(lon.shape))
