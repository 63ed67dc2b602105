"""What one file says of one component, on points of its own."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...base.arrays import Array
from .file import Times
from .grid import Grid, unit_vectors
from .land import Evidence
from .levels import Levels

Values = NDArray[np.float32]


@dataclass(frozen=True)
class Part:
    """One component out of one file, on points of its own: `values` (nt, nz, ny, nx) [m/s].

    `levels`: those that were read. `deeper` (1, n, ny, nx): what the levels below them hold, at the first time
    or, where that is zero, at the time of the fastest. `way`: "east", "grid" or "unsure", along what it runs.
    `signs`: of the plane's axes that the file counts downward. `fields`: what the file says at places of their
    own: `angle`, `seabed`. `zeros`: what the file's zeros look like.
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
    """Numbers (n,) at places (n,) [degrees], under a variable's name."""

    name: str
    lon: Array
    lat: Array
    values: Array

    def at(self, lon: Array, lat: Array) -> Array | None:
        """The values at other points (ny, nx), where these are the field's own; else None."""
        points = unit_vectors(lon, lat)
        tree = KDTree(unit_vectors(self.lon, self.lat))
        off, nearest = map(np.asarray, tree.query(points.reshape(-1, 3)))
        cell = np.linalg.norm(np.diff(points, axis=1), axis=-1).max(initial=0.0)
        return self.values[nearest].reshape(lon.shape) if float(off.max()) < 0.2 * cell else None

    def least(self, lon: Array, lat: Array) -> Array:
        """The value at each of other points (ny, nx), or the least of those around it; NaN where none is near."""
        points = unit_vectors(lon, lat)
        cell = np.linalg.norm(np.diff(points, axis=1), axis=-1).max(initial=0.0)
        if self.lon.size == 0:
            return np.full(lon.shape, np.nan)
        tree = KDTree(unit_vectors(self.lon, self.lat))
        off, near = map(np.asarray, tree.query(points.reshape(-1, 3), k=min(4, self.lon.size)))
        off, near = off.reshape(lon.size, -1), near.reshape(lon.size, -1)
        around = np.where(off <= 1.2 * cell, self.values[near], np.inf)
        # land among the points around is no depth: only where the point itself has none, there is none
        around = np.where(np.isnan(around), np.inf, around).min(axis=1)
        own = self.values[near[:, 0]]
        value = np.where(off[:, 0] < 0.2 * cell, own, np.where(np.isinf(around), np.nan, around))
        return np.asarray(value.reshape(lon.shape))
