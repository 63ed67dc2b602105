"""Nodes in bins, for the flow map: depth layers, each a grid of square bins."""

import math

import numpy as np
from numpy.typing import NDArray

from ..kernels.patch import MAX_LEVELS, NodeBins

NODES_PER_BIN = 2.0
"""A bin holds about this many nodes on average."""


def node_bins(position: NDArray[np.float64]) -> NodeBins:
    """Return bins for nodes (n, 3) [m]: one layer for each depth if the depths are few, else even layers."""
    z = position[:, 2]
    depths = np.unique(z)
    aligned = depths.size <= MAX_LEVELS
    if not aligned:
        # the top level lies above every node, so that each layer is [lower, upper)
        depths = np.linspace(z.min(), np.nextafter(z.max(), math.inf) + 1e-6, MAX_LEVELS)
    layer = np.clip(np.searchsorted(depths, z, side="right") - 1, 0, depths.size - 1)
    lo, hi = position[:, :2].min(axis=0), position[:, :2].max(axis=0)
    area = max(float(np.prod(hi - lo)), 1e-6 * float(((hi - lo) ** 2).max()), 1e-12)
    bins = max(1.0, len(position) / depths.size / NODES_PER_BIN)
    size = math.sqrt(area / bins)
    nx, ny = (int(span / size) + 1 for span in hi - lo)
    i, j = (np.minimum(((position[:, m] - lo[m]) / size).astype(np.int64), (nx, ny)[m] - 1) for m in range(2))
    where = (layer * nx + i) * ny + j
    first = np.searchsorted(where, np.arange(depths.size * nx * ny + 1), sorter=np.argsort(where, kind="stable"))
    return NodeBins(
        levels=depths,
        aligned=aligned,
        x_lo=float(lo[0]),
        y_lo=float(lo[1]),
        per_bin=1 / size,
        nx=nx,
        ny=ny,
        first=first.astype(np.int64),
        node=np.argsort(where, kind="stable").astype(np.int64),
    )
