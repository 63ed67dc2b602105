"""Components on points of their own brought together, and turned toward true east and north."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...base.arrays import Array
from ...base.settings import require
from ..frame import wrapped
from .grid import unit_vectors

Values = NDArray[np.float32]
MATCHES = 0.1
"""Points this close, in cells, are the same."""
SQUARE = np.radians(10.0)
"""Rows and columns cross at right angles within this, or an angle does not say where v points."""
AGREES = np.radians(5.0)
"""An angle that a file holds may differ from the grid's own by this much."""


def _middles(at: Array, axis: int) -> Array:
    first = at[:, :-1] if axis == 1 else at[:-1]
    second = at[:, 1:] if axis == 1 else at[1:]
    return np.asarray((first + second) / 2)


def _mean(values: Values, axis: int) -> Values:
    """Of two neighbours along the rows (-1) or across them (-2); of one where the other is missing."""
    ahead = np.s_[..., 1:] if axis == -1 else np.s_[..., 1:, :]
    behind = np.s_[..., :-1] if axis == -1 else np.s_[..., :-1, :]
    a, b = values[behind], values[ahead]
    return np.where(np.isnan(a), b, np.where(np.isnan(b), a, (a + b) / 2)).astype(np.float32)


def _places(at: Array) -> tuple[Array, Array]:
    """Longitude and latitude [degrees] of vectors from the Earth's centre (..., 3)."""
    return np.degrees(np.arctan2(at[..., 1], at[..., 0])), np.degrees(
        np.arctan2(at[..., 2], np.hypot(at[..., 0], at[..., 1]))
    )


def same_points(a: tuple[Array, Array], b: tuple[Array, Array]) -> bool:
    """Whether two sets of longitudes and latitudes (ny, nx) are the same points."""
    if a[0].shape != b[0].shape:
        return False
    first, second = unit_vectors(*a), unit_vectors(*b)
    cell = np.linalg.norm(np.diff(first, axis=1), axis=-1).max(initial=0.0)
    return bool(np.linalg.norm(first - second, axis=-1).max() < 0.01 * cell)


def collocated(
    name: str, u_at: tuple[Array, Array], v_at: tuple[Array, Array], u: Values, v: Values
) -> tuple[Array, Array, Values, Values]:
    """u and v (nt, nz, ny, nx) of a C-grid at its centres: (lon, lat, u, v).

    A centre lies between two neighbouring u along a row and two neighbouring v across rows; where the model
    counts these from is seen from where they lie. InputError where u and v make no such grid.
    """
    along, across = _middles(unit_vectors(*u_at), 1), _middles(unit_vectors(*v_at), 0)
    refusal = (
        f"{name}: the currents are on different points that make no staggered grid; "
        "bring them onto one grid first, or name `lon` and `lat` in `names`"
    )
    require(min(along.shape[:2]) > 1 and min(across.shape[:2]) > 1, refusal)
    j, i = along.shape[0] // 2, along.shape[1] // 2
    nearest = int(KDTree(across.reshape(-1, 3)).query(along[j, i])[1])
    shift_j, shift_i = nearest // across.shape[1] - j, nearest % across.shape[1] - i
    rows = slice(max(0, -shift_j), min(along.shape[0], across.shape[0] - shift_j))
    cols = slice(max(0, -shift_i), min(along.shape[1], across.shape[1] - shift_i))
    require(rows.stop - rows.start > 1 and cols.stop - cols.start > 1, refusal)
    there = (slice(rows.start + shift_j, rows.stop + shift_j), slice(cols.start + shift_i, cols.stop + shift_i))
    cell = np.linalg.norm(np.diff(along, axis=1), axis=-1).max()
    off = np.linalg.norm(along[rows, cols] - across[there], axis=-1).max()
    require(bool(off < MATCHES * cell), refusal)
    centres = along[rows, cols] + across[there]
    lon, lat = _places(centres)
    return lon, lat, _mean(u, -1)[..., rows, cols], _mean(v, -2)[..., there[0], there[1]]


def half_a_cell_on(at: tuple[Array, Array], u: Values, v: Values) -> tuple[Array, Array, Values, Values]:
    """As `collocated`, where u lies half a cell along the rows beyond the points `at`, v half across: NEMO's."""
    lon, lat = (part[1:, 1:] for part in at)
    return lon, lat, _mean(u, -1)[..., 1:, :], _mean(v, -2)[..., 1:]


def _direction(lon: Array, lat: Array, axis: int) -> Array:
    """Angle [rad], counter-clockwise from east, of the way to the next point along an axis (ny, nx)."""
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
        # from one side alone the bearing is that of half a cell on: carried on from within
        inside = inner / np.abs(inner)
        turn = np.take(inside, [min(1, size - 3)], axis) / np.take(inside, [0], axis)
        back = np.take(inside, [size - 3], axis) / np.take(inside, [max(0, size - 4)], axis)
        first, last = np.take(inside, [0], axis) / turn, np.take(inside, [-1], axis) * back
    return np.asarray(np.angle(np.concatenate([first, inner, last], axis=axis)))


def row_angle(name: str, lon: Array, lat: Array, signs: tuple[int, int] = (1, 1)) -> Array:
    """Angle [rad] from true east to the way of the rows (ny, nx), by the geometry of the grid.

    `signs`: -1 where the file counts a plane's x or y downward. InputError where rows and columns do not
    cross at right angles, counter-clockwise, so that the angle would not say where v points.
    """
    along = _direction(lon, lat, 1) + (np.pi if signs[0] < 0 else 0.0)
    across = _direction(lon, lat, 0) + (np.pi if signs[1] < 0 else 0.0)
    bent = np.angle(np.exp(1j * (across - along - np.pi / 2)))
    require(
        float(np.median(np.abs(bent))) < SQUARE,
        f"{name}: its currents run along the grid, whose columns do not stand upright on its rows: "
        'rotate them first, or name `rotate` in `names`: "none" if these are toward east and north',
    )
    return np.asarray(np.angle(np.exp(1j * along)))


def turned(u: Values, v: Values, angle: Array) -> tuple[Values, Values]:
    """East and north of components along rows that leave east by an angle [rad]."""
    cos, sin = np.cos(angle).astype(np.float32), np.sin(angle).astype(np.float32)
    return u * cos - v * sin, u * sin + v * cos
