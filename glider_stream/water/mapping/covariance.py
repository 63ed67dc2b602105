"""Covariances between measurements, and between places and measurements."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ...base.arrays import Array
from .observations import Observations
from .scales import Scales, alike, along

AT_ONCE = 2_000_000
"""Covariances are found for at most this many pairs of nodes at a time, to bound the memory."""
LEAST_NOISE = 1e-6
"""The least standard deviation of noise, in shares of the speed, that keeps the equations well-posed."""
SCALES = ("length", "depth", "time")
"""The scales on which covariances depend other than as a factor."""

Nodes = tuple[Array, Array, Array, Array]
"""x, y [m], stretched depth [m] and t [s] of places, (m) each."""


def pairs(scales: Scales, a: Nodes, b: Nodes) -> tuple[Array, Array, Array]:
    """Return cov(u, u'), cov(u, v') and cov(v, v') (m, m') between places, without the constant current."""
    dx, dy = (a[n][:, None] - b[n] for n in range(2))
    near = along(scales.kernel, dx**2 + dy**2, scales.length, False)
    factor = scales.speed**2 * separated(scales, a, b)
    f, h = factor * near.f, factor * near.h
    return f - h * dy**2, h * dx * dy, f - h * dx**2


def separated(scales: Scales, a: Nodes, b: Nodes) -> Array | float:
    """Return how alike currents are that lie apart in depth and time."""
    factor: Array | float = 1.0
    for n, order in ((2, "depth"), (3, "time")):
        if np.isfinite(getattr(scales, order)):
            factor = factor * alike(a[n][:, None] - b[n], getattr(scales, order), False)[0]
    return factor


def slopes(scales: Scales, a: Nodes, b: Nodes, of: Sequence[str]) -> Iterator[tuple[Array, Array, Array]]:
    """Yield `pairs`, then its derivatives by the logarithm of each of the scales `of`, of SCALES."""
    dx, dy = (a[n][:, None] - b[n] for n in range(2))
    xx, xy, yy = dx * dx, dx * dy, dy * dy
    near = along(scales.kernel, xx + yy, scales.length, True)
    apart = {
        order: alike(a[n][:, None] - b[n], getattr(scales, order), True)
        for n, order in ((2, "depth"), (3, "time"))
        if np.isfinite(getattr(scales, order))
    }
    for name in (None, *of):
        factor: Array | float = scales.speed**2
        for order, (value, slope) in apart.items():
            factor = factor * (slope if name == order else value)
        f, h = (near.f_slope, near.h_slope) if name == "length" else (near.f, near.h)
        f, h = factor * f, factor * h
        yield f - h * yy, h * xy, f - h * xx


def _blocks(rows: Observations, width: int) -> Iterator[tuple[slice, Observations]]:
    """Yield runs of measurements whose nodes make at most AT_ONCE pairs with `width` others."""
    most = max(1, AT_ONCE // max(width, 1))
    ends = np.append(rows.first, rows.x.size)
    begin = 0
    while begin < rows.count:
        end = max(begin + 1, int(np.searchsorted(ends, ends[begin] + most, side="right")) - 1)
        yield slice(begin, end), rows.take(np.arange(begin, end)) if end - begin < rows.count else rows
        begin = end


def covariance(scales: Scales, rows: Observations, columns: Observations) -> Array:
    """Return the covariance (2n, 2n') of all u, then all v, of two sets of measurements, without their noise."""
    (result,) = _covariances(scales, rows, columns, None)
    return result


def covariance_and_slopes(scales: Scales, rows: Observations, of: Sequence[str]) -> list[Array]:
    """Return the covariance (2n, 2n) and its derivatives by the logarithm of each of the scales `of`, of SCALES.

    A scale that is infinite cannot be among them.
    """
    return _covariances(scales, rows, rows, of)


def _covariances(
    scales: Scales, rows: Observations, columns: Observations, of: Sequence[str] | None
) -> list[Array]:
    n, m = rows.count, columns.count
    results = [np.empty((2 * n, 2 * m)) for _ in range(1 if of is None else 1 + len(of))]
    for which, part in _blocks(rows, columns.x.size):
        a = slice(which.start, which.stop)
        b = slice(n + which.start, n + which.stop)
        every: Iterable[tuple[Array, Array, Array]]
        if of is None:
            every = [pairs(scales, part.nodes, columns.nodes)]
        else:
            every = slopes(scales, part.nodes, columns.nodes, of)
        for result, found in zip(results, every, strict=True):
            uu, uv, vv = (columns.means(part.means(block).T).T for block in found)
            result[a, :m], result[a, m:], result[b, :m], result[b, m:] = uu, uv, uv, vv
    if scales.mean > 0:
        results[0][:n, :m] += scales.mean**2
        results[0][n:, m:] += scales.mean**2
    return results


def variance(scales: Scales, rows: Observations) -> Array:
    """Return the variance of all u, then all v (2n), of measurements, without their noise."""
    found = np.full(2 * rows.count, scales.speed**2 + scales.mean**2)
    if rows.plain:
        return found
    n = rows.count
    for k in range(n):
        whole = covariance(scales, rows.take(np.array([k])), rows.take(np.array([k])))
        found[k], found[n + k] = whole[0, 0], whole[1, 1]
    return found


def noise_variance(scales: Scales, rows: Observations) -> Array:
    """Return the variance of the noise of all u, then all v (2n)."""
    return np.tile(rows.error**2 + scales.noise**2, 2)
