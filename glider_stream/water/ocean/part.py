"""What one file says of one component, on points of its own."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...base.arrays import Array
from .grid import Grid, unit_vectors


@dataclass(frozen=True)
class Part:
    """One component out of one file, on points of its own.

    `way`: "east", "grid" or "unsure", along what it runs. `signs`: of the plane's axes that the file counts
    downward. `fields`: what the file says at places of their own: `angle`, `seabed`.
    """

    component: str
    variable: str
    grid: Grid
    depth: Array | None
    times: NDArray[np.datetime64] | None
    values: NDArray[np.float32]
    took: dict[str, str]
    notes: tuple[str, ...]
    way: str
    signs: tuple[int, int]
    levels_name: str
    fields: dict[str, "Field"]


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
