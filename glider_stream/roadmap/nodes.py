"""Node samplers: they choose the places of a roadmap's nodes in a box."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array
from ..base.settings import require

Allowed = Callable[[Array], NDArray[np.bool_]]
"""A function that returns a mask (n,) of the points (n, 3) [m] that may be nodes."""


MOST_NODES = 10_000_000
"""A roadmap with more nodes does not fit into memory."""
MOST_DRAWN = 4 * MOST_NODES
"""At most this many points are drawn to find open water, because all are in memory at once."""


def cells_along(lo: Array, hi: Array, spacing: Array) -> list[int]:
    """Return the number of equal cells, about `spacing` (d,) wide, along each axis of a box lo..hi (d,)."""
    return [max(1, round(float(wide / step))) for wide, step in zip(hi - lo, spacing, strict=True)]


def jittered(lo: Array, hi: Array, spacing: Array, random: np.random.Generator | None) -> Array:
    """Return points (n, d), one in each of the equal cells, about `spacing` (d,) wide, of a box lo..hi (d,).

    A point lies at a random place of its cell, or in the middle if `random` is None. Unlike the points of a
    lattice, random points lie in all directions from each other.
    """
    counts = cells_along(lo, hi, spacing)
    cells = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, len(counts))
    within = 0.5 if random is None else random.random(cells.shape)
    return np.asarray(lo + (cells + within) / counts * (hi - lo))


class Sampler(Protocol):
    """A way to place nodes; `seed` is 0 if it uses no random numbers."""

    @property
    def seed(self) -> int:
        """The seed of its random numbers."""
        ...

    def nodes(self, lo: Array, hi: Array, allowed: Allowed) -> Array:
        """Return the nodes (n, 3) [m] in the box lo..hi (3,) [m]."""
        ...


@dataclass(frozen=True)
class GridSampler:
    """A regular grid: the middles of cells in x and y, levels from top to bottom in z; no points on land."""

    shape: tuple[int, int, int]
    seed = 0

    def __post_init__(self) -> None:
        require(min(self.shape) >= 1, f"`sampling.shape` must be at least 1 each way; got {list(self.shape)}")
        size = math.prod(self.shape)
        fits = size <= MOST_NODES
        require(fits, f"`sampling.shape` = {list(self.shape)} is {size:,} nodes; take at most {MOST_NODES:,}")

    def nodes(self, lo: Array, hi: Array, allowed: Allowed) -> Array:
        """Return the nodes (n, 3) [m] in the box lo..hi: x varies slowest, z fastest, from the surface down."""
        nx, ny, nz = self.shape
        x = lo[0] + (np.arange(nx) + 0.5) / nx * (hi[0] - lo[0])
        y = lo[1] + (np.arange(ny) + 0.5) / ny * (hi[1] - lo[1])
        z = np.linspace(hi[2], lo[2], nz)
        points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
        return np.asarray(points[allowed(points)])


@dataclass(frozen=True)
class RandomSampler:
    """`count` points of a seeded random sequence; points on land are replaced by later points."""

    count: int
    seed: int

    def __post_init__(self) -> None:
        fits = 1 <= self.count <= MOST_NODES
        require(fits, f"`sampling.count` must be from 1 to {MOST_NODES:,}; got {self.count:,}")
        require(self.seed >= 0, f"`sampling.seed` must be at least 0; got {self.seed}")

    def draw(self, count: int) -> Array:
        """Return the first `count` points (count, 3) of the sequence in the unit cube."""
        return np.random.default_rng(self.seed).random((count, 3))

    def nodes(self, lo: Array, hi: Array, allowed: Allowed) -> Array:
        """Return the nodes (count, 3) [m] in the box lo..hi, in the order of the sequence."""
        drawn = self.count
        while True:
            points = lo + self.draw(drawn) * (hi - lo)
            points = points[allowed(points)]
            if len(points) >= self.count:
                return points[: self.count]
            drawn *= 2
            require(
                drawn <= min(256 * self.count, MOST_DRAWN),
                f"only {len(points)} of {drawn // 2} points drawn lie in open water, `sampling.count` = "
                f"{self.count} needs more; move the domain off the land",
            )


@dataclass(frozen=True)
class SobolSampler(RandomSampler):
    """A scrambled Sobol sequence."""

    def draw(self, count: int) -> Array:
        """Return the first `count` points (count, 3) of the sequence in the unit cube."""
        from scipy.stats import qmc  # the import takes half of a query's start-up time, and few scenarios need it

        powers = (count - 1).bit_length()
        return np.asarray(qmc.Sobol(3, rng=np.random.default_rng(self.seed)).random_base2(powers)[:count])


@dataclass(frozen=True)
class HaltonSampler(RandomSampler):
    """A scrambled Halton sequence."""

    def draw(self, count: int) -> Array:
        """Return the first `count` points (count, 3) of the sequence in the unit cube."""
        from scipy.stats import qmc

        return np.asarray(qmc.Halton(3, rng=np.random.default_rng(self.seed)).random(count))


@dataclass(frozen=True)
class YoSampler:
    """Nodes at the `depths` [m] at which yos turn, one every `spacing` [m], or `per_leg` nodes per leg.

    The length of a leg is that of the fastest glide between the two neighbouring depths that are furthest apart,
    dz / tan(gamma). With `jitter` a node lies at a random place of its cell, by `seed`, so that legs lead in all
    directions; otherwise it lies in the middle.
    """

    depths: tuple[float, ...]
    spacing: float | None = None
    per_leg: float | None = None
    jitter: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        require(self.seed >= 0, f"`sampling.seed` must be at least 0; got {self.seed}")
        fits = len(self.depths) >= 2 and self.depths[0] >= 0 and bool((np.diff(self.depths) > 0).all())
        require(fits, f"`sampling.depths` must be two or more, rising from 0 m or below; got {list(self.depths)}")
        given = [value for value in (self.spacing, self.per_leg) if value is not None]
        require(len(given) == 1, "`sampling` needs `spacing` [m] or `per_leg`, one of them")
        require(given[0] > 0, f"`sampling.spacing`, or `per_leg`, must be above 0; got {given[0]:g}")

    def for_glide(self, angle: float) -> "YoSampler":
        """Return the sampler with its spacing set; `angle` [rad] is the angle of the fastest glide."""
        if self.per_leg is None:
            return self
        leg = float(np.diff(self.depths).max()) / math.tan(angle)
        return replace(self, spacing=leg / self.per_leg, per_leg=None)

    def nodes(self, lo: Array, hi: Array, allowed: Allowed) -> Array:
        """Return the nodes (n, 3) [m] in the box lo..hi, depth by depth from the shallowest down."""
        assert self.spacing is not None
        deepest, most = max(self.depths), -float(lo[2])
        require(deepest <= most, f"`sampling.depths` reach {deepest:g} m, the domain {most:g} m; deepen it")
        lo, hi = lo[:2], hi[:2]
        spacing = np.full(2, self.spacing)
        size = math.prod(cells_along(lo, hi, spacing)) * len(self.depths)
        fits = size <= MOST_NODES
        require(fits, f"nodes every {self.spacing:g} m would be {size:,}, more than {MOST_NODES:,}; take fewer")
        random = np.random.default_rng(self.seed) if self.jitter else None
        layers = [(jittered(lo, hi, spacing, random), 0.0 - depth) for depth in self.depths]
        points = np.concatenate([np.column_stack([flat, np.full(len(flat), z)]) for flat, z in layers])
        return np.asarray(points[allowed(points)])


SAMPLERS: dict[str, type[GridSampler | RandomSampler | YoSampler]] = {
    "grid": GridSampler,
    "yo": YoSampler,
    "uniform": RandomSampler,
    "sobol": SobolSampler,
    "halton": HaltonSampler,
}
