"""The density of a roadmap, measured in lengths of the vehicle's legs."""

import math
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Array, Index
from ..base.nearest import tree_of
from .roadmap import BaseRoadmap

SECTORS = 36
"""Directions are counted in this many sectors of 10 degrees each."""
SAMPLED = 400
"""At most this many nodes are examined, evenly chosen by their numbers."""
AROUND = 8
"""The spacing of nodes is found from the distance to this neighbour: the eighth nearest."""
WIDEST = 1.15
"""If nodes lie further apart than this, in legs, routes take 7 % longer or more (table in docs/steering.md)."""
FEWEST = 9.0
"""A lattice has eight directions, and a route can only run along them. Fewer directions than this give a
warning."""


@dataclass(frozen=True)
class Density:
    """The mean number of `directions`, of 36, in which legs leave a node, and the spacing of nodes at one depth.

    `spacing` is in m. `legs` is the spacing as a multiple of a leg: the horizontal length of the fastest glide
    between the lowest and the highest node.
    """

    directions: float
    spacing: float
    legs: float

    @property
    def warning(self) -> str:
        """A sentence that says what is not dense enough and what to do; empty if all is dense enough."""
        found = []
        if self.legs > WIDEST:
            found.append(f"nodes lie {self.legs:.2g} legs apart, more than {WIDEST:g}")
        if round(self.directions) < FEWEST:  # as it is shown
            few = f"legs leave a node in {self.directions:.0f} directions of {SECTORS}"
            found.append(f"{few}, fewer than {FEWEST:.0f}")
        cure = (
            "a query finds a slower route than there is; add --polish or --within to it, or take more nodes here"
        )
        return f"{', and '.join(found)}: {cure}" if found else ""

    def __str__(self) -> str:
        return (
            f"nodes {self.spacing:,.0f} m apart at a depth, {self.legs:.2f} legs; legs in "
            f"{self.directions:.0f} of {SECTORS} directions from a node"
        )


def density_of(roadmap: BaseRoadmap, best_angle: float) -> Density:
    """Return the density of a roadmap; `best_angle` [rad] is the angle of the fastest glide."""
    position = roadmap.position
    some = np.unique(np.linspace(0, len(position) - 1, SAMPLED).astype(np.int64))
    directions = []
    rows = [np.arange(*roadmap.indptr[node : node + 2]) for node in some]
    targets = np.split(roadmap.targets(np.concatenate(rows)), np.cumsum([row.size for row in rows])[:-1])
    for node, target in zip(some, targets, strict=True):
        way = position[target, :2] - position[node, :2]
        if len(way):
            turn = np.arctan2(way[:, 1], way[:, 0]) / math.tau
            directions.append(np.unique(np.floor(turn * SECTORS).astype(int) % SECTORS).size)
    spacing = _spacing(position, some)
    depth = float(np.ptp(position[:, 2]))
    leg = depth / math.tan(best_angle)
    legs = spacing / leg if leg > 0 else math.inf
    return Density(float(np.mean(directions)) if directions else 0.0, spacing, legs)


def _spacing(position: Array, some: Index) -> float:
    """Return the spacing [m] of nodes (n, 3) [m]: the side of a square, or of a cube, that holds one node."""
    levels = np.unique(position[:, 2])
    layered = len(levels) < len(position) ** 0.5
    # put layers so far apart that nodes of other layers are never near
    scale = float(np.ptp(position[:, :2], axis=0).max()) + 1.0
    layer = np.searchsorted(levels, position[:, 2]) * 10 * scale if layered else position[:, 2]
    at = np.column_stack([position[:, :2], layer])
    count = min(AROUND + 1, len(position))
    far = np.asarray(tree_of(at).query(at[some], k=[count])[0])[:, 0]
    far = far[far < scale] if layered else far
    if not far.size:
        return scale
    middle = float(np.median(far))
    share = (math.pi / count) ** 0.5 if layered else (4 / 3 * math.pi / count) ** (1 / 3)
    return float(middle * share)
