"""The map: the current given measurements, its standard deviation, and samples of it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Array
from ...base.settings import require
from .covariance import AT_ONCE, LEAST_NOISE, Nodes, covariance, noise_variance, pairs, separated, variance
from .features import Waves, draw
from .observations import Observations, thinned
from .scales import Scales, along, stretched

MOST_EXACT = 3000
"""An exact map uses at most this many measurements (6000 values): 0.3 GB, and some 10 s on one core."""


class Current(Protocol):
    """A current that can be evaluated anywhere: a map's mean or a sample."""

    def velocity(self, x: ArrayLike, y: ArrayLike, depth: ArrayLike, t: ArrayLike) -> Array:
        """Return u, v (m, 2) [m/s]."""
        ...

    def stream(self, x: ArrayLike, y: ArrayLike, depth: ArrayLike, t: ArrayLike) -> Array:
        """Return psi (m) [m^2/s]."""
        ...

    def on_grid(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """Return u, v (nt, nz, m, 2) [m/s]."""
        ...


def _places(x: ArrayLike, y: ArrayLike, depth: ArrayLike, t: ArrayLike) -> tuple[Array, Array, Array, Array]:
    x, y, depth, t = np.broadcast_arrays(*(np.asarray(part, dtype=np.float64) for part in (x, y, depth, t)))
    return x.ravel(), y.ravel(), depth.ravel(), t.ravel()


@dataclass(frozen=True)
class Pull:
    """What measurements add to the current: the sum of their nodes' covariances times `u`, `v` (m)."""

    scales: Scales
    nodes: Nodes
    u: Array
    v: Array

    @classmethod
    def of(cls, scales: Scales, rows: Observations, weights: Array) -> "Pull":
        """Return the pull of measurements with weights (2n)."""
        owner = rows.owner()
        u, v = (part[owner] * rows.weight for part in (weights[: rows.count], weights[rows.count :]))
        return cls(scales, rows.nodes, u, v)

    @property
    def constant(self) -> Array:
        """The constant current (2) [m/s]."""
        return self.scales.mean**2 * np.array([self.u.sum(), self.v.sum()])

    def _blocks(self, count: int) -> list[slice]:
        step = max(1, AT_ONCE // self.u.size)
        return [slice(n, n + step) for n in range(0, count, step)]

    def velocity(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """See Current."""
        found, at = np.empty((x.size, 2)), (x, y, stretched(depth), t)
        for part in self._blocks(x.size):
            here = (at[0][part], at[1][part], at[2][part], at[3][part])
            uu, uv, vv = pairs(self.scales, here, self.nodes)
            found[part, 0], found[part, 1] = uu @ self.u + uv @ self.v, uv @ self.u + vv @ self.v
        return found + self.constant

    def stream(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """See Current. cov(psi, e . V') = f (e x d) with d from the node to the place."""
        found, at = np.empty(x.size), (x, y, stretched(depth), t)
        for part in self._blocks(x.size):
            here = (at[0][part], at[1][part], at[2][part], at[3][part])
            dx, dy = (here[n][:, None] - self.nodes[n] for n in range(2))
            near = along(self.scales.kernel, dx**2 + dy**2, self.scales.length, False)
            factor = self.scales.speed**2 * near.f * separated(self.scales, here, self.nodes)
            found[part] = (factor * dy) @ self.u - (factor * dx) @ self.v
        return np.asarray(found + self.constant[0] * y - self.constant[1] * x)

    def on_grid(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """See Current. The kernel is a product: each place's part is found once for all depths and times."""
        found = np.empty((t.size, depth.size, x.size, 2))
        above = _above(self.scales, self.nodes, depth, t)
        for part in self._blocks(x.size):
            uu, uv, vv = _plane(self.scales, x[part], y[part], self.nodes)
            for n, pulled in enumerate((uu * self.u + uv * self.v, uv * self.u + vv * self.v)):
                found[:, :, part, n] = (above @ pulled.T).reshape(t.size, depth.size, -1)
        return found + self.constant


def _above(scales: Scales, nodes: Nodes, depth: Array, t: Array) -> Array:
    """Return the part of covariances that depth and time make (nt nz, nodes), for all depths at each time."""
    zero = np.zeros(1)
    found = np.ones((t.size, depth.size, nodes[0].size))
    flat = np.zeros_like(nodes[0])
    found *= separated(scales, (zero, zero, stretched(depth), zero), (flat, flat, nodes[2], flat))
    later = separated(scales, (zero, zero, zero, t), (flat, flat, flat, nodes[3]))
    found *= later[:, None, :] if isinstance(later, np.ndarray) else later
    return found.reshape(-1, nodes[0].size)


def _plane(scales: Scales, x: Array, y: Array, nodes: Nodes) -> tuple[Array, Array, Array]:
    """Return the part of `pairs` that the places x, y (m) make: (m, nodes) each."""
    here, there = ((at[0], at[1], np.zeros_like(at[0]), np.zeros_like(at[0])) for at in ((x, y), nodes))
    return pairs(scales, here, there)


@dataclass(frozen=True)
class Sample:
    """A current that may be, given the measurements: a draw of the prior, pulled to them (Matheron's rule)."""

    waves: Waves
    pull: Pull

    def velocity(self, x: ArrayLike, y: ArrayLike, depth: ArrayLike = 0.0, t: ArrayLike = 0.0) -> Array:
        """Return u, v (m, 2) [m/s]."""
        at = _places(x, y, depth, t)
        return self.waves.velocity(*at) + self.pull.velocity(*at)

    def stream(self, x: ArrayLike, y: ArrayLike, depth: ArrayLike = 0.0, t: ArrayLike = 0.0) -> Array:
        """Return psi (m) [m^2/s], of which u = d psi/dy and v = -d psi/dx."""
        at = _places(x, y, depth, t)
        return self.waves.stream(*at) + self.pull.stream(*at)

    def on_grid(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """Return u, v (nt, nz, m, 2) [m/s] at places x, y (m), each at all depths (nz) and times (nt)."""
        return self.waves.on_grid(x, y, depth, t) + self.pull.on_grid(x, y, depth, t)


@dataclass(frozen=True)
class CurrentMap:
    """The current given measurements `at`: Gaussian, with the mean `velocity` and the `deviation`.

    `inducing`: where an approximation is used, the measurements that stand for all (Snelson and Ghahramani's
    FITC); None where the map is exact.
    """

    scales: Scales
    at: Observations
    inducing: Observations | None = None

    @cached_property
    def _solved(self) -> "_Solved":
        return _solve(self.scales, self.at, self.inducing)

    @cached_property
    def mean(self) -> Pull:
        """The mean, as what the measurements add to a current of 0."""
        return self._pulled(self.at.values)

    def _pulled(self, values: Array) -> Pull:
        return Pull.of(self.scales, self.inducing or self.at, self._solved.weights(values))

    def velocity(self, x: ArrayLike, y: ArrayLike, depth: ArrayLike = 0.0, t: ArrayLike = 0.0) -> Array:
        """Return the mean u, v (m, 2) [m/s]."""
        return self.mean.velocity(*_places(x, y, depth, t))

    def stream(self, x: ArrayLike, y: ArrayLike, depth: ArrayLike = 0.0, t: ArrayLike = 0.0) -> Array:
        """Return the mean psi (m) [m^2/s], of which u = d psi/dy and v = -d psi/dx."""
        return self.mean.stream(*_places(x, y, depth, t))

    def on_grid(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """Return the mean u, v (nt, nz, m, 2) [m/s] at places x, y (m), at all depths (nz) and times (nt)."""
        return self.mean.on_grid(x, y, depth, t)

    def deviation(self, x: ArrayLike, y: ArrayLike, depth: ArrayLike = 0.0, t: ArrayLike = 0.0) -> Array:
        """Return the standard deviation of u and v (m, 2) [m/s], with the scales taken as right."""
        places = _places(x, y, depth, t)
        count, rows = places[0].size, self.inducing or self.at
        found = np.empty((count, 2))
        step = max(1, AT_ONCE // rows.x.size)
        for n in range(0, count, step):
            px, py, deep, when = (part[n : n + step] for part in places)
            every = pairs(self.scales, (px, py, stretched(deep), when), rows.nodes)
            uu, uv, vv = (rows.means(block.T) for block in every)
            found[n : n + step] = self._left(np.block([[uu, uv], [uv, vv]]))
        return found

    def deviation_on_grid(self, x: Array, y: Array, depth: Array, t: Array) -> Array:
        """Return the standard deviation (nt, nz, m, 2) [m/s], at the places of `on_grid`."""
        rows = self.inducing or self.at
        found = np.empty((t.size * depth.size, x.size, 2))
        above = _above(self.scales, rows.nodes, depth, t)
        step = max(1, AT_ONCE // rows.x.size)
        for n in range(0, x.size, step):
            part = slice(n, n + step)
            plane = _plane(self.scales, x[part], y[part], rows.nodes)
            for k, factor in enumerate(above):
                uu, uv, vv = (rows.means((block * factor).T) for block in plane)
                found[k, part] = self._left(np.block([[uu, uv], [uv, vv]]))
        return found.reshape(t.size, depth.size, x.size, 2)

    def _left(self, across: Array) -> Array:
        """Return the deviation (m, 2); `across` (2n, 2m): covariances, without the constant current."""
        half, places = across.shape[0] // 2, across.shape[1] // 2
        across[:half, :places] += self.scales.mean**2
        across[half:, places:] += self.scales.mean**2
        left = self.scales.speed**2 + self.scales.mean**2 - self._solved.explained(across)
        return np.sqrt(np.maximum(left, 0)).reshape(2, -1).T

    def samples(self, count: int, seed: int = 0) -> list[Sample]:
        """Return so many samples; the k-th depends on `seed` and k alone."""
        require(count >= 1, f"the number of samples must be at least 1; got {count}")
        found = []
        noise = np.sqrt(noise_variance(self.scales, self.at))
        for stream in np.random.SeedSequence(seed).spawn(count):
            generator = np.random.default_rng(stream)
            waves = draw(self.scales, generator)
            drawn = self.at.means(waves.velocity(self.at.x, self.at.y, self.at.depth, self.at.t))
            values = np.concatenate([drawn[:, 0], drawn[:, 1]]) + noise * generator.normal(size=noise.size)
            found.append(Sample(waves, self._pulled(self.at.values - values)))
        return found


@dataclass(frozen=True)
class _Solved:
    """The factors of a map. `root` of the measurements' covariance, or, with inducing measurements, of theirs.

    `inner`: then, the root of the posterior precision between them; `scaled` (2m, 2n): their covariance with the
    measurements over the variance that these keep.
    """

    root: Array
    inner: Array | None = None
    scaled: Array | None = None

    def weights(self, values: Array) -> Array:
        """Return the weights of the measurements, or of the inducing ones, for values (2n)."""
        from scipy.linalg import cho_solve

        if self.inner is None or self.scaled is None:
            return np.asarray(cho_solve((self.root, True), values, check_finite=False))
        return np.asarray(cho_solve((self.inner, True), self.scaled @ values, check_finite=False))

    def explained(self, with_targets: Array) -> Array:
        """Return the variance that is explained (k), from the covariance (2n, k) with targets."""
        from scipy.linalg import solve_triangular

        def of(root: Array) -> Array:
            half = solve_triangular(root, with_targets, lower=True, check_finite=False)
            return np.asarray((half**2).sum(axis=0))

        return of(self.root) if self.inner is None else of(self.root) - of(self.inner)


def _solve(scales: Scales, at: Observations, inducing: Observations | None) -> _Solved:
    from scipy.linalg import cholesky, solve_triangular

    noise = noise_variance(scales, at) + (LEAST_NOISE * scales.speed) ** 2
    if inducing is None:
        whole = covariance(scales, at, at)
        whole[np.diag_indices_from(whole)] += noise
        return _Solved(np.asarray(cholesky(whole, lower=True, overwrite_a=True, check_finite=False)))
    between = covariance(scales, inducing, inducing)
    between[np.diag_indices_from(between)] += (1e-4 * scales.speed) ** 2
    root = np.asarray(cholesky(between, lower=True, check_finite=False))
    across = covariance(scales, inducing, at)
    half = solve_triangular(root, across, lower=True, check_finite=False)
    kept = noise + np.maximum(variance(scales, at) - (half**2).sum(axis=0), 0)
    scaled = across / kept
    inner = between + scaled @ across.T
    return _Solved(root, np.asarray(cholesky(inner, lower=True, check_finite=False)), scaled)


def condition(at: Observations, scales: Scales, *, inducing: int | None = None) -> CurrentMap:
    """Return the map of measurements.

    It is exact for up to MOST_EXACT measurements. With more, `inducing` must say how many of them (600, say)
    stand for all: the mean stays free of divergence, but details finer than their spacing are lost and the
    deviation grows.
    """
    if inducing is None:
        require(
            at.count <= MOST_EXACT,
            f"an exact map takes at most {MOST_EXACT:,} measurements; got {at.count:,}: leave some out, or set "
            "`inducing`, such as 600, to let so many of them stand for all",
        )
        return CurrentMap(scales, at)
    require(inducing >= 1, f"`inducing` must be at least 1; got {inducing}")
    require(
        inducing <= MOST_EXACT, f"`inducing` must be at most {MOST_EXACT:,}; got {inducing:,}: make it smaller"
    )
    if inducing >= at.count:
        return condition(at, scales)
    return CurrentMap(scales, at, at.take(np.array(thinned(at, inducing))))
