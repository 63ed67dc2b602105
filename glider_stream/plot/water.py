"""The water of a figure: its box, and the kernels' current and land in it."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.cache import entry_point
from ..kernels.flow import Flow, contains, velocity
from ..kernels.terrain import Terrain, allowed
from .canvas import Side, length_unit

if TYPE_CHECKING:
    from ..roadmap.problem import Problem
    from ..search.path import Path


@entry_point()
def _sample_field(flow, x, y, z, t, u, v):  # type: ignore[no-untyped-def]
    for n in range(x.size):
        if contains(flow, x[n], y[n], t[n]):
            u[n], v[n] = velocity(flow, x[n], y[n], z[n], t[n])


@entry_point()
def _sample_water(terrain, x, y, z, wet):  # type: ignore[no-untyped-def]
    for n in range(x.size):
        wet[n] = allowed(terrain, x[n], y[n], z[n])


def sample_field(flow: Flow, x: ArrayLike, y: ArrayLike, z: ArrayLike, t: ArrayLike) -> tuple[Array, Array]:
    """Return the current u, v [m/s] at points x, y, z [m] and times t [s], broadcast; NaN where unknown."""
    points = np.broadcast_arrays(*(np.asarray(a, np.float64) for a in (x, y, z, t)))
    u, v = np.full(points[0].size, np.nan), np.full(points[0].size, np.nan)
    _sample_field(flow, *(p.flatten() for p in points), u, v)
    return u.reshape(points[0].shape), v.reshape(points[0].shape)


def sample_water(terrain: Terrain, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> NDArray[np.bool_]:
    """Return whether a glider may be at points x, y, z [m], broadcast."""
    points = np.broadcast_arrays(*(np.asarray(a, np.float64) for a in (x, y, z)))
    wet = np.zeros(points[0].size, np.bool_)
    _sample_water(terrain, *(p.flatten() for p in points), wet)
    return wet.reshape(points[0].shape)


Time = float | Callable[[Array, Array], Array]
"""The time [s] of a map's current: one number, or a function of the place x, y [m]."""


def passing(path: "Path", departure: float) -> Time:
    """Return the time of a route's map: at each place, when the route passes nearest to it.

    It is the `departure` [s] if the clock does not run or the flow is steady.
    """
    if not path.clock_runs:
        return departure
    from scipy.spatial import KDTree

    begins, rows = departure if path.departure is None else path.departure, path.trajectory
    tree = KDTree(rows[:, 1:3])

    def nearest(x: Array, y: Array) -> Array:
        _, row = tree.query(np.column_stack([x.ravel(), y.ravel()]))
        return np.asarray(begins + rows[row, 0]).reshape(x.shape)

    return nearest


class Frame(NamedTuple):
    """The box of a figure: sides x, y [m], depths `top` and `bottom` [m, downward], the unit of length.

    The `labels` of a map's axes are in degrees if the scenario is geographic; `to_lonlat` computes them.
    """

    x: Side
    y: Side
    top: float
    bottom: float
    unit: float
    name: str
    labels: tuple[str, str]
    to_lonlat: Callable[[Array], Array] | None = None

    def mesh(self, count: int) -> tuple[Array, Array]:
        """Return the centres of square cells, `count` along the longer side."""
        longer = max(side[1] - side[0] for side in (self.x, self.y))
        sides = []
        for low, high in (self.x, self.y):
            cells = max(2, round(count * (high - low) / longer))
            sides.append(low + (np.arange(cells) + 0.5) / cells * (high - low))
        x, y = np.meshgrid(*sides)
        return x, y

    def scaled(self, points: Array) -> Array:
        """Return points (n, 3), x, y, z [m], as they are drawn: in the unit of length, depth [m] downward."""
        drawn: Array = np.asarray(points, np.float64) / [self.unit, self.unit, -1.0] + 0.0
        return drawn


def frame_of(problem: "Problem", points: Array) -> Frame:
    """Return the frame that holds a problem's box and the points (n, 3) [m]."""
    low, high = np.minimum(problem.lo, points.min(axis=0)), np.maximum(problem.hi, points.max(axis=0))
    x, y = (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))
    # a path that surfaces may end above it by a rounding error
    top, bottom = max(0.0, float(-high[2])), float(-low[2])
    unit, name = length_unit(x, y)
    labels = (f"East ({name})", f"North ({name})")
    if problem.to_lonlat is not None:
        labels = ("Longitude (°)", "Latitude (°)")
    return Frame(x, y, top, max(bottom, top + 1e-9), unit, name, labels, problem.to_lonlat)


def checked_depths(depths: Sequence[float], frame: Frame) -> Array:
    """Return the depths [m] of maps; InputError above the surface or below the box, where no current is known."""
    for depth in depths:
        fits = 0.0 <= depth <= frame.bottom
        require(fits, f"`depth` must be from 0 m to {frame.bottom:g} m, the domain's deepest; got {depth:g}")
    return np.asarray(depths, np.float64)
