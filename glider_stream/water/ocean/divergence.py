"""Measures how far a current is from one that has a stream function."""

import numpy as np

from ...base.arrays import Array
from .file import OceanFile
from .grid import EARTH, unit_vectors


def _central(values: Array, axis: int) -> Array:
    """Return half the difference of both neighbours, for all points but the rim (ny - 2, nx - 2, ...)."""
    ahead, behind = (slice(2, None), slice(1, -1)), (slice(None, -2), slice(1, -1))
    return np.asarray((values[ahead[:: 1 - 2 * axis]] - values[behind[:: 1 - 2 * axis]]) / 2)


def divergence_ratio(file: OceanFile, level: int | None = None) -> float:
    """Return rms horizontal divergence over rms vorticity in the wet inner cells of one level, or of all levels.

    The ratio is 0.05 to 0.3 in mesoscale fields and 0.45 to 0.8 in coastal and radar fields; NaN if no cell has
    neighbours. Let t_i, t_j be the tangents of rows and columns and t^i, t^j their duals. Then div = dV/di . t^i
    + dV/dj . t^j and curl = n . (t^i x dV/di + t^j x dV/dj), with V in space. This also holds on curved grids.
    """
    lon, lat = file.grid.mesh()
    if min(lon.shape) < 3:
        return float("nan")
    up = unit_vectors(lon, lat)
    lam, phi = np.radians(lon), np.radians(lat)
    east = np.stack([-np.sin(lam), np.cos(lam), np.zeros_like(lam)], axis=-1)
    north = np.stack([-np.sin(phi) * np.cos(lam), -np.sin(phi) * np.sin(lam), np.cos(phi)], axis=-1)
    tangent_j, tangent_i = EARTH * _central(up, 0), EARTH * _central(up, 1)
    normal = up[1:-1, 1:-1]
    area = np.sum(normal * np.cross(tangent_i, tangent_j), axis=-1, keepdims=True)
    dual_i, dual_j = np.cross(tangent_j, normal) / area, np.cross(normal, tangent_i) / area
    curl_i, curl_j = np.cross(normal, dual_i), np.cross(normal, dual_j)
    divergence = vorticity = 0.0
    levels = range(file.depth.size) if level is None else (level,)
    for u, v in ((file.u[n, k], file.v[n, k]) for n in range(len(file.u)) for k in levels):
        flow = u.astype(np.float64)[..., None] * east + v.astype(np.float64)[..., None] * north
        along, across = _central(flow, 1), _central(flow, 0)
        spread = np.sum(along * dual_i + across * dual_j, axis=-1)
        spin = np.sum(along * curl_i + across * curl_j, axis=-1)
        wet = np.isfinite(spread) & np.isfinite(spin) & np.isfinite(u[1:-1, 1:-1])
        divergence += float((spread[wet] ** 2).sum())
        vorticity += float((spin[wet] ** 2).sum())
    if vorticity == 0:
        return float("nan") if divergence == 0 else float("inf")
    return float(np.sqrt(divergence / vorticity))
