"""How dense a roadmap is, in the vehicle's own measure: legs."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from ..base.arrays import Array, Index
from .roadmap import Roadmap

SECTORS = 36
"""Directions that are told apart: 10 degrees each."""
SAMPLED = 400
"""Nodes that are looked at, evenly by their numbers."""
AROUND = 8
"""Nodes nearby, whose distance says how far nodes lie apart."""
WIDEST = 1.15
"""Nodes further apart, in legs, cost routes 7 % or more of their time (the table in docs/steering.md)."""
FEWEST = 9.0
"""Fewer directions than a lattice's eight, and one more: a route runs along them, and its fronts have corners."""


@dataclass(frozen=True)
class Density:
    """In how many `directions`, of 36, legs leave a node, and how far nodes at a depth lie apart.

    `spacing` [m]; `legs`: the same, in lengths of the fastest glide between the nodes' lowest and highest depth.
    """

    directions: float
    spacing: float
    legs: float

    @property
    def warning(self) -> str:
        """What is too little, and what to do; empty if nothing is."""
        found = []
        if self.legs > WIDEST:
            found.append(f"nodes lie {self.legs:.2g} legs apart, more than {WIDEST:g}")
        if self.directions < FEWEST:
            few = f"legs leave a node in {self.directions:.0f} directions of {SECTORS}"
            found.append(f"{few}, fewer than {FEWEST:.0f}")
        cure = "routes are slower than they could be; take more nodes, or query with --polish or --within"
        return f"{', and '.join(found)}: {cure}" if found else ""

    def __str__(self) -> str:
        return (
            f"nodes {self.spacing:,.0f} m apart at a depth, {self.legs:.2f} legs; legs in "
            f"{self.directions:.0f} of {SECTORS} directions from a node"
        )


def density_of(roadmap: Roadmap, best_angle: float) -> Density:
    """The density of a roadmap; `best_angle` [rad] is that of the fastest glide."""
    position = roadmap.position
    some = np.unique(np.linspace(0, len(position) - 1, SAMPLED).astype(np.int64))
    directions = []
    for node in some:
        row = slice(roadmap.indptr[node], roadmap.indptr[node + 1])
        way = position[roadmap.target[row], :2] - position[node, :2]
        if len(way):
            turn = np.arctan2(way[:, 1], way[:, 0]) / math.tau
            directions.append(np.unique(np.floor(turn * SECTORS).astype(int) % SECTORS).size)
    spacing = _spacing(position, some)
    depth = float(np.ptp(position[:, 2]))
    leg = depth / math.tan(best_angle)
    legs = spacing / leg if leg > 0 else math.inf
    return Density(float(np.mean(directions)) if directions else 0.0, spacing, legs)


def _spacing(position: Array, some: Index) -> float:
    """How far nodes (n, 3) [m] lie apart: the side of a square, or of a cube, that holds one."""
    levels = np.unique(position[:, 2])
    layered = len(levels) < len(position) ** 0.5
    # layers are put so far apart that no other one is near
    scale = float(np.ptp(position[:, :2], axis=0).max()) + 1.0
    layer = np.searchsorted(levels, position[:, 2]) * 10 * scale if layered else position[:, 2]
    at = np.column_stack([position[:, :2], layer])
    count = min(AROUND + 1, len(position))
    far = np.asarray(KDTree(at).query(at[some], k=[count])[0])[:, 0]
    far = far[far < scale] if layered else far
    if not far.size:
        return scale
    middle = float(np.median(far))
    share = (math.pi / count) ** 0.5 if layered else (4 / 3 * math.pi / count) ** (1 / 3)
    return float(middle * share)
