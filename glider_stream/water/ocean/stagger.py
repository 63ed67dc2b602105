"""Brings components from different points to the same points and rotates them toward true east and north."""

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array
from ...base.nearest import tree_of
from ...base.settings import require
from ..frame import wrapped
from .grid import unit_vectors

Values = NDArray[np.float32]
MATCHES = 0.1
"""Points are the same if they are closer than this [cells]."""
SQUARE = np.radians(10.0)
"""Rows and columns must cross at right angles within this [rad], or the angle does not tell where v points."""
AGREES = np.radians(5.0)
"""An angle in a file may differ from the grid's own angle by this [rad]."""


def _middles(at: Array, axis: int) -> Array:
    first = at[:, :-1] if axis == 1 else at[:-1]
    second = at[:, 1:] if axis == 1 else at[1:]
    return np.asarray((first + second) / 2)


def _mean(values: Values, axis: int) -> Values:
    """Return the mean of two neighbours along the rows (-1) or across them (-2), or the one that has data."""
    ahead = np.s_[..., 1:] if axis == -1 else np.s_[..., 1:, :]
    behind = np.s_[..., :-1] if axis == -1 else np.s_[..., :-1, :]
    a, b = values[behind], values[ahead]
    return np.where(np.isnan(a), b, np.where(np.isnan(b), a, (a + b) / 2)).astype(np.float32)


def _places(at: Array) -> tuple[Array, Array]:
    """Return longitude and latitude [degrees] of vectors from the Earth's centre (..., 3)."""
    return np.degrees(np.arctan2(at[..., 1], at[..., 0])), np.degrees(
        np.arctan2(at[..., 2], np.hypot(at[..., 0], at[..., 1]))
    )


def same_points(a: tuple[Array, Array], b: tuple[Array, Array]) -> bool:
    """Return whether two sets of longitudes and latitudes (ny, nx) are the same points."""
    if a[0].shape != b[0].shape:
        return False
    first, second = unit_vectors(*a), unit_vectors(*b)
    cell = np.linalg.norm(np.diff(first, axis=1), axis=-1).max(initial=0.0)
    return bool(np.linalg.norm(first - second, axis=-1).max() < 0.01 * cell)


def collocated(
    name: str, u_at: tuple[Array, Array], v_at: tuple[Array, Array], u: Values, v: Values
) -> tuple[Array, Array, Values, Values]:
    """Return lon, lat, u, v at the cells' centres of a C-grid, from u and v (nt, nz, ny, nx).

    A centre lies between two neighbouring u along a row and two neighbouring v across rows. Their positions tell
    where the model begins to count. InputError if u and v do not form such a grid.
    """
    along, across = _middles(unit_vectors(*u_at), 1), _middles(unit_vectors(*v_at), 0)
    refusal = (
        f"{name}: the currents are on different points that make no staggered grid; "
        "bring them onto one grid first, or set `lon` and `lat` in `names`"
    )
    require(min(along.shape[:2]) > 1 and min(across.shape[:2]) > 1, refusal)
    j, i = along.shape[0] // 2, along.shape[1] // 2
    nearest = int(tree_of(across.reshape(-1, 3)).query(along[j, i])[1])
    shift_j, shift_i = nearest // across.shape[1] - j, nearest % across.shape[1] - i
    rows = slice(max(0, -shift_j), min(along.shape[0], across.shape[0] - shift_j))
    cols = slice(max(0, -shift_i), min(along.shape[1], across.shape[1] - shift_i))
    require(rows.stop - rows.start > 1 and cols.stop - cols.start > 1, refusal)
    in_v = (slice(rows.start + shift_j, rows.stop + shift_j), slice(cols.start + shift_i, cols.stop + shift_i))
    cell = np.linalg.norm(np.diff(along, axis=1), axis=-1).max()
    off = np.linalg.norm(along[rows, cols] - across[in_v], axis=-1).max()
    require(bool(off < MATCHES * cell), refusal)
    centres = along[rows, cols] + across[in_v]
    lon, lat = _places(centres)
    return lon, lat, _mean(u, -1)[..., rows, cols], _mean(v, -2)[..., in_v[0], in_v[1]]


def half_a_cell_on(at: tuple[Array, Array], u: Values, v: Values) -> tuple[Array, Array, Values, Values]:
    """Return lon, lat, u, v at the cells' centres `at`, for NEMO.

    u lies half a cell further along the rows than `at`, and v half a cell further across them.
    """
    lon, lat = (part[1:, 1:] for part in at)
    return lon, lat, _mean(u, -1)[..., 1:, :], _mean(v, -2)[..., 1:]


def _direction(lon: Array, lat: Array, axis: int) -> Array:
    """Return the direction to the next point along an axis (ny, nx): its angle [rad] from east."""
    from pyproj import Geod

    geod, size = Geod(ellps="WGS84"), lon.shape[axis]

    def bearing(start: int, end: int) -> Array:
        ends = [
            np.take(part, range(n, n + size - 1), axis)
            for n in (start, end)
            for part in (np.asarray(wrapped(lon, 0.0)), lat)
        ]
        azimuth = geod.inv(ends[0], ends[1], ends[2], ends[3])[0]
        return np.asarray(np.pi / 2 - np.radians(azimuth))

    ahead, behind = np.exp(1j * bearing(0, 1)), -np.exp(1j * bearing(1, 0))
    inner = np.take(ahead, range(1, size - 1), axis) + np.take(behind, range(size - 2), axis)
    if size < 3:
        first, last = np.take(ahead, [0], axis), np.take(behind, [-1], axis)
    else:
        # a bearing from one side belongs to a point half a cell further: extrapolate from the inner points
        inside = inner / np.abs(inner)
        turn = np.take(inside, [min(1, size - 3)], axis) / np.take(inside, [0], axis)
        back = np.take(inside, [size - 3], axis) / np.take(inside, [max(0, size - 4)], axis)
        first, last = np.take(inside, [0], axis) / turn, np.take(inside, [-1], axis) * back
    return np.asarray(np.angle(np.concatenate([first, inner, last], axis=axis)))


def row_angle(name: str, lon: Array, lat: Array, signs: tuple[int, int] = (1, 1)) -> Array:
    """Return the angle [rad] from true east to the rows (ny, nx), by the geometry of the grid.

    `signs`: -1 where the file counts a plane's x or y downward. InputError if rows and columns do not cross at
    right angles, counter-clockwise: then the angle does not tell where v points.
    """
    along = _direction(lon, lat, 1) + (np.pi if signs[0] < 0 else 0.0)
    across = _direction(lon, lat, 0) + (np.pi if signs[1] < 0 else 0.0)
    bent = np.angle(np.exp(1j * (across - along - np.pi / 2)))
    require(
        float(np.median(np.abs(bent))) < SQUARE,
        f"{name}: its currents run along the grid, whose columns are not at right angles to its rows: "
        'rotate them first, or set `rotate` in `names`: "none" if these are toward east and north',
    )
    return np.asarray(np.angle(np.exp(1j * along)))


def turned(u: Values, v: Values, angle: Array) -> tuple[Values, Values]:
    """Return the east and north components of u and v along rows at an angle [rad] from east."""
    cos, sin = np.cos(angle).astype(np.float32), np.sin(angle).astype(np.float32)
    return u * cos - v * sin, u * sin + v * cos
