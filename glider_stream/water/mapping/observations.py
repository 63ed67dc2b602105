"""Measurements of a current: each is a mean of the current over a few places, depths and times."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Array, Bools, Index
from ...base.settings import require
from .scales import STRETCH, stretched

HALF_DIVE = 8
"""Gauss-Legendre nodes in the dive, and as many in the climb, over which a single yo is averaged.

With a depth scale of 60 m they are off by 1 mm/s in currents of 0.2 m/s, a tenth of what a glider measures.
"""
MANY_YOS = 3, 8
"""Gauss-Legendre nodes along the track, and of depth at each, over which many yos are averaged."""
DRIFT_NODES = 3
"""Gauss-Legendre nodes in each straight part of a drifter's path."""


@dataclass(frozen=True)
class Observations:
    """n measurements of both components of the current, each a weighted mean over some of m nodes.

    `u`, `v` (n): along x and y [m/s]. `error` (n): standard deviation of each component [m/s] as stated; what
    small eddies add is `Scales.noise`. `first` (n): index of each measurement's first node. `x`, `y` (m) [m],
    `depth` (m) [m, downward], `t` (m) [s] and `weight` (m), which adds up to 1 in each measurement.
    """

    u: Array
    v: Array
    error: Array
    first: Index
    x: Array
    y: Array
    depth: Array
    t: Array
    weight: Array

    def __post_init__(self) -> None:
        for name in ("u", "v", "error", "x", "y", "depth", "t"):
            finite = bool(np.isfinite(getattr(self, name)).all())
            require(finite, f"`{name}` of measurements must be finite numbers; leave out those that are not")
        require(self.u.size > 0, "a map needs at least one measurement; got none")
        require(bool((self.error >= 0).all()), f"an error must be 0 or more; got {self.error.min():g} m/s")
        require(
            bool((self.depth >= 0).all()), f"a depth counts downward; got {self.depth.min():g} m: turn its sign"
        )

    @property
    def count(self) -> int:
        """The number of measurements, of two components each."""
        return self.u.size

    @property
    def plain(self) -> bool:
        """Whether each measurement is at a single point."""
        return self.x.size == self.u.size

    @property
    def values(self) -> Array:
        """All u, then all v (2n) [m/s]."""
        return np.concatenate([self.u, self.v])

    @property
    def nodes(self) -> tuple[Array, Array, Array, Array]:
        """x, y, the stretched depth, and t of the nodes."""
        return self.x, self.y, stretched(self.depth), self.t

    def owner(self) -> Index:
        """Return the measurement that each node belongs to (m)."""
        lengths = np.diff(np.append(self.first, self.x.size))
        return np.repeat(np.arange(self.count), lengths)

    def means(self, values: Array) -> Array:
        """Return the measurements' means (n, ...) of values at their nodes (m, ...)."""
        weighted = values * self.weight.reshape(-1, *(1,) * (values.ndim - 1))
        return weighted if self.plain else np.add.reduceat(weighted, self.first, axis=0)

    def take(self, which: Index | Bools) -> "Observations":
        """Return some of the measurements, in the order given."""
        index = np.arange(self.count)[which]
        ends = np.append(self.first, self.x.size)
        nodes = [np.arange(ends[n], ends[n + 1]) for n in index]
        every = np.concatenate(nodes) if nodes else np.zeros(0, np.int64)
        lengths = np.array([part.size for part in nodes], dtype=np.int64)
        first = np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64)
        at = (self.x[every], self.y[every], self.depth[every], self.t[every], self.weight[every])
        return Observations(self.u[index], self.v[index], self.error[index], first, *at)

    def less(self, at_nodes: Array) -> "Observations":
        """Return what the measurements differ by from a current (m, 2) that is known at the nodes [m/s]."""
        mean = self.means(at_nodes)
        rest = (self.first, self.x, self.y, self.depth, self.t, self.weight)
        return Observations(self.u - mean[:, 0], self.v - mean[:, 1], self.error, *rest)

    @classmethod
    def joined(cls, parts: Sequence["Observations"]) -> "Observations":
        """Return several sets as one."""
        require(len(parts) > 0, "a map needs measurements; got none")
        starts = np.cumsum([0, *(part.x.size for part in parts)])
        first = np.concatenate([part.first + start for part, start in zip(parts, starts, strict=False)])
        names = ("u", "v", "error", "x", "y", "depth", "t", "weight")
        u, v, error, *at = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
        return cls(u, v, error, first, *at)


def _columns(count: int, **values: ArrayLike) -> list[Array]:
    """Return each value as an array (count) of float64."""
    found = []
    for name, value in values.items():
        array = np.asarray(value, dtype=np.float64)
        fits = array.ndim == 0 or array.shape == (count,)
        require(fits, f"`{name}` must be a number or have the shape ({count},); got {array.shape}")
        found.append(np.broadcast_to(array, (count,)).copy())
    return found


def at_points(
    x: ArrayLike,
    y: ArrayLike,
    depth: ArrayLike,
    u: ArrayLike,
    v: ArrayLike,
    *,
    t: ArrayLike = 0.0,
    error: ArrayLike = 0.0,
) -> Observations:
    """Return currents u, v (n) [m/s] measured at points x, y, `depth` [m] and times `t` [s]."""
    count = np.size(np.atleast_1d(np.asarray(x)))
    columns = _columns(count, u=u, v=v, error=error, x=x, y=y, depth=depth, t=t)
    u, v, error, x, y, depth, t = columns
    return Observations(u, v, error, np.arange(count), x, y, depth, t, np.ones(count))


def _gauss(count: int) -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes and weights on [0, 1]."""
    node, weight = np.polynomial.legendre.leggauss(count)
    return (node + 1) / 2, weight / 2


def _over_depth(top: Array, bottom: Array, count: int) -> tuple[Array, Array]:
    """Return depths (n, count) [m] and weights with sum 1 for the mean over depths; nodes are denser at the top.

    They are Gauss-Legendre nodes of the stretched depth, as currents change more in a metre near the surface.
    """
    node, weight = _gauss(count)
    low, high = stretched(top)[:, None], stretched(bottom)[:, None]
    depth = STRETCH * np.expm1((low + node * (high - low)) / STRETCH)
    weights = weight * (1 + depth / STRETCH)
    return depth, weights / weights.sum(axis=1, keepdims=True)


def _path(top: Array, bottom: Array, yos: int) -> tuple[Array, Array, Array]:
    """Return shares of the track, depths [m] and weights (n, nodes) of dives of so many yos."""
    if yos == 1:
        depth, weight = _over_depth(top, bottom, HALF_DIVE)
        down = (depth - top[:, None]) / (bottom - top)[:, None] / 2
        share = np.concatenate([down, 1 - down], axis=1)
        return share, np.tile(depth, 2), np.tile(weight / 2, 2)
    depth, weight = _over_depth(top, bottom, MANY_YOS[1])
    along, along_weight = _gauss(MANY_YOS[0])
    shares = np.tile(np.repeat(along, MANY_YOS[1]), (top.size, 1))
    return (
        shares,
        np.tile(depth, MANY_YOS[0]),
        np.repeat(along_weight, MANY_YOS[1]) * np.tile(weight, MANY_YOS[0]),
    )


def dive_averages(
    start: ArrayLike,
    end: ArrayLike,
    bottom: ArrayLike,
    u: ArrayLike,
    v: ArrayLike,
    *,
    top: ArrayLike = 0.0,
    times: tuple[ArrayLike, ArrayLike] = (0.0, 0.0),
    error: ArrayLike = 0.0,
    yos: int = 1,
) -> Observations:
    """Return currents u, v (n) [m/s] averaged over dives from the places `start` (n, 2) [m] to `end`.

    A dive goes from the depth `top` to `bottom` [m] and back, at an even vertical speed, along a straight track
    from the first to the second of `times` [s]. With several `yos`, all depths are averaged all along the track.
    """
    start, end = (np.atleast_2d(np.asarray(place, dtype=np.float64)) for place in (start, end))
    count = len(start)
    require(start.shape == end.shape == (count, 2), f"dives need places (n, 2); got {start.shape}, {end.shape}")
    require(yos >= 1, f"a dive has at least one yo; got {yos}")
    u, v, error, top, bottom = _columns(count, u=u, v=v, error=error, top=top, bottom=bottom)
    begin, finish = _columns(count, start_times=times[0], end_times=times[1])
    require(bool((bottom > top).all()), "a dive must go below its top; leave out those that do not")
    require(bool((finish >= begin).all()), "a dive must end after it starts; mend its times")
    share, depth, weight = _path(top, bottom, yos)
    x, y = (start[:, n, None] + share * (end - start)[:, n, None] for n in range(2))
    t = begin[:, None] + share * (finish - begin)[:, None]
    first = np.arange(count) * weight.shape[1]
    at = (part.ravel() for part in (x, y, depth, t, weight))
    return Observations(u, v, error, first, *at)


def drifts(x: ArrayLike, y: ArrayLike, t: ArrayLike, depth: float = 0.0, *, error: float = 0.0) -> Observations:
    """Return the displacements of one drifter, from each of its fixes x, y [m], t [s] (n + 1) to the next.

    Each is the mean of the current over time along the path, which is taken as straight and even between fixes.
    `depth` [m]: of its drogue. `error` [m/s]: of each mean current.
    """
    x, y, t = (np.atleast_1d(np.asarray(part, dtype=np.float64)) for part in (x, y, t))
    require(x.shape == y.shape == t.shape and x.size > 1, f"a drifter needs at least two fixes; got {x.size}")
    gap = np.diff(t)
    require(bool((gap > 0).all()), "the fixes of a drifter must follow each other in time; sort them")
    share, weight = _gauss(DRIFT_NODES)
    along_x, along_y = ((part[:-1, None] + share * np.diff(part)[:, None]).ravel() for part in (x, y))
    when = (t[:-1, None] + share * gap[:, None]).ravel()
    count = gap.size
    u, v = (np.diff(part) / gap for part in (x, y))
    first = np.arange(count) * weight.size
    deep = np.full(when.size, float(depth))
    errors, weights = np.full(count, float(error)), np.tile(weight, count)
    return Observations(u, v, errors, first, along_x, along_y, deep, when, weights)


def spread(at: Observations) -> tuple[float, float, float]:
    """Return how far the nodes reach in place [m], stretched depth [m] and time [s]."""
    x, y, z, t = at.nodes
    return float(np.hypot(np.ptp(x), np.ptp(y))), float(np.ptp(z)), float(np.ptp(t))


def thinned(at: Observations, most: int) -> list[int]:
    """Return at most `most` measurements that lie far from each other: each is the furthest from those before.

    Distances count in shares of the whole spread in place, depth and time.
    """
    if at.count <= most:
        return list(range(at.count))
    x, y, z, t = (at.means(part) for part in at.nodes)
    wide, deep, long = (part or 1.0 for part in spread(at))
    places = np.stack([x / wide, y / wide, z / deep / 2, t / long / 2], axis=-1)
    chosen = [int(np.argmin(((places - places.mean(axis=0)) ** 2).sum(axis=-1)))]
    off = np.full(at.count, np.inf)
    for _ in range(most - 1):
        off = np.minimum(off, ((places - places[chosen[-1]]) ** 2).sum(axis=-1))
        chosen.append(int(np.argmax(off)))
    return sorted(set(chosen))
