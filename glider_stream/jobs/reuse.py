"""Reuse after a change of the water: finds the nodes of an older roadmap that the change cannot affect."""

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates, maximum_filter
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ..base.arrays import Array, Bools
from ..base.settings import require
from ..kernels.flow import Flow, Grid, OceanGrid, fields_of, same_steps
from ..kernels.reach import LATEST
from ..kernels.terrain import Seabed
from ..roadmap.builder import node_positions
from ..roadmap.pairs import NeighbourLegs
from ..roadmap.problem import Problem
from ..roadmap.provenance import provenance_of
from ..roadmap.roadmap import Roadmap
from ..roadmap.slices import SlicedRoadmap

SIDE = 480
"""Times are bounded on a lattice with this many cells along its longer side."""
DETOUR = 1.0824
"""A path over eight neighbours is at most this many times the straight distance: 1 / cos(22.5 degrees)."""
STEPS = 17
"""The speeds of cells are rounded up to this many steps."""
VALUES = {"values", "max_speed", "level_speed", "level_carry", "bottom", "ground"}
"""The fields that may differ between two flows, or seabeds, on one grid."""


def untouched(old: Roadmap | SlicedRoadmap, before: Problem, now: Problem) -> Bools:
    """Return which nodes (n,) keep all edges and pairs of the roadmap `old`, although the flow has changed.

    No path from such a node meets the changed water within the horizon, not even if the fastest current of each
    place carries it along. InputError if more than the water has changed.
    """
    position = node_positions(now)
    made, wanted = old.provenance, provenance_of(now, position)
    what = {
        "nodes": (made.nodes_sha256, wanted.nodes_sha256),
        "glider": (made.glider_sha256, wanted.glider_sha256),
        "kernels": (made.kernel_digest, wanted.kernel_digest),
        "steering": (before.evaluator.steering, now.evaluator.steering),
        "integration": (before.evaluator.integration, now.evaluator.integration),
        "neighbours": (before.law, now.law),
        "departure": (before.departures, now.departures),
    }
    unlike = [name for name, (made_with, asked) in what.items() if made_with != asked]
    require(
        not unlike,
        f"the older roadmap differs in {', '.join(unlike)}, not only in the flow; build without --from",
    )
    counts = old.row_counts if isinstance(old, SlicedRoadmap) else old.node_counts
    require(
        counts is not None,
        "the older roadmap does not hold the pair counts of each node; build without --from",
    )
    lattice = _Lattice(before, now, position)
    changed = lattice.changed()
    if changed is None:
        return np.zeros(len(position), dtype=bool)
    if not changed.any():
        return np.ones(len(position), dtype=bool)
    return lattice.away_from(changed)


def _same(before: Any, after: Any) -> bool:
    return after is not None and np.array_equal(before, after)


class _Lattice:
    """Square cells over all the water that paths from the nodes can reach."""

    def __init__(self, before: Problem, now: Problem, position: Array) -> None:
        self.before, self.now, self.position = before, now, position
        self._known: dict[int, tuple[Any, Any]] = {}
        integration = now.evaluator.integration
        # legs that are followed are flown to this much later, before they are known to be too late
        later = LATEST if len(now.departures) > 1 else 1.0
        self.horizon = later * integration.dt * integration.steps
        self.glide = float(now.evaluator.polar.best_horizontal.max())
        self.flows: tuple[Flow, Flow] = before.evaluator.flow, now.evaluator.flow
        self.fastest = max(flow.extent.max_speed for flow in self.flows)
        low, high = position[:, :2].min(axis=0), position[:, :2].max(axis=0)
        reach = (self.glide + self.fastest) * self.horizon
        # no path continues outside the flow
        known = self.flows[1].extent
        box = np.array([known.x_lo, known.y_lo]), np.array([known.x_hi, known.y_hi])
        low, high = np.maximum(low - reach, box[0]), np.minimum(high + reach, box[1])
        self.step = float((high - low).max()) / SIDE
        self.count = np.maximum(np.ceil((high - low) / self.step).astype(np.int64), 1)
        self.low = low

    def changed(self) -> Bools | None:
        """Return the cells where flow or terrain differ; None if they cannot be compared point by point."""
        found = np.zeros(tuple(self.count), dtype=bool)
        if not same_steps(*self.flows):
            return None
        terrains = self.before.evaluator.terrain, self.now.evaluator.terrain
        for before, after in (self.flows, terrains):
            now = fields_of(after)
            unlike = {name for name, value in fields_of(before).items() if not _same(value, now.get(name))}
            if type(before) is type(after) and not unlike:
                continue
            if type(before) is not type(after) or not unlike <= VALUES:
                return None
            if isinstance(after, (Grid, OceanGrid)) and isinstance(before, (Grid, OceanGrid)):
                unlike = self._in_time(after, (before.values != after.values).any(axis=-1))
                found |= self._touched(after, unlike.any(axis=tuple(range(unlike.ndim - 2))))
            elif isinstance(after, Seabed) and isinstance(before, Seabed):
                found |= self._touched(after, before.bottom != after.bottom)
            else:
                return None
        return found

    def _in_time(self, flow: Grid | OceanGrid, values: Any) -> Any:
        """Return the values, by time first, that are read between the first departure and the last horizon."""
        if isinstance(flow, Grid):
            return values
        start, last = self.now.departures[0], self.now.departures[-1]
        first = max(int(np.searchsorted(flow.times, start, side="right")) - 1, 0)
        return values[first : int(np.searchsorted(flow.times, last + self.horizon)) + 1]

    def _touched(self, grid: Grid | OceanGrid | Seabed, points: Bools) -> Bools:
        """Return the cells that read one of the grid's `points` (ni, nj)."""
        (i, j), (k, m) = self._reads(grid, points.shape)
        sums = np.pad(points.astype(np.int64).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
        return np.asarray(sums[k, m] - sums[i, m] - sums[k, j] + sums[i, j] > 0)

    def _reads(self, grid: Grid | OceanGrid | Seabed, shape: tuple[int, ...]) -> tuple[Any, Any]:
        """Return the first grid point that each cell reads, and the point after the last, (2, ni, nj) each."""
        if id(grid) in self._known:
            return self._known[id(grid)]
        axes = (self.low[n] + self.step * np.arange(self.count[n] + 1) for n in range(2))
        x, y = np.meshgrid(*axes, indexing="ij")
        corner = grid if isinstance(grid, Seabed) else grid.extent
        at = np.stack([(x - corner.x_lo) * grid.per_x, (y - corner.y_lo) * grid.per_y])
        if not isinstance(grid, Grid):
            at = np.stack(
                [map_coordinates(grid.index_map[..., n], at, order=1, mode="nearest") for n in range(2)]
            )
        corners = np.stack([at[:, :-1, :-1], at[:, 1:, :-1], at[:, :-1, 1:], at[:, 1:, 1:]])
        # a point is read in the cells around it; one more cell covers the curvature of the map between corners
        most = np.array(shape)[:, None, None] - 1
        low = np.clip(np.floor(corners.min(axis=0)).astype(np.int64) - 1, 0, most)
        high = np.clip(np.ceil(corners.max(axis=0)).astype(np.int64) + 1, 0, most) + 1
        self._known[id(grid)] = low, high
        return low, high

    def away_from(self, changed: Bools) -> Bools:
        """Return the nodes from which no path within the horizon meets a changed cell and no pair reads one."""
        at = np.clip(((self.position[:, :2] - self.low) / self.step).astype(np.int64), 0, self.count - 1)
        soonest = self._soonest(changed)[at[:, 0], at[:, 1]]
        safe = soonest > self.horizon
        straight = not self.now.evaluator.exact
        # the stream value is read along the straight line
        gap = distance_transform_edt(~changed)[at[:, 0], at[:, 1]] * self.step - 2 * self.step
        legs = self.now.legs(self.position)
        near, far = (
            (self.glide + speed) * self.horizon for speed in sorted(flow.extent.max_speed for flow in self.flows)
        )
        if not isinstance(legs, NeighbourLegs):
            return np.asarray(safe & (gap > far) if straight else safe)
        hit = self.now.evaluator.integration.tolerance + 1.0
        for node in np.flatnonzero(safe):
            others = self.position[legs.neighbourhood.of(self.position[node]), :2]
            away = np.linalg.norm(others - self.position[node, :2], axis=1)
            safe[node] = not straight or gap[node] > away.max(initial=0.0)
            # the fastest current anywhere decides which pairs are too far
            safe[node] &= near == far or not bool(((away > near - hit) & (away < far + hit)).any())
        return np.asarray(safe)

    def _soonest(self, changed: Bools) -> Array:
        """Return a lower bound of the time [s] until a path from each cell can meet a changed cell.

        On every part of the way it takes the fastest current there.
        """
        speed = self.glide + maximum_filter(self._speeds(), size=3, mode="nearest")
        number = np.arange(changed.size).reshape(changed.shape)
        rows, cols, costs = [], [], []
        for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = (slice(None, -di or None), slice(max(0, -dj), None if dj <= 0 else -dj))
            shifted = (slice(di, None), slice(max(0, dj), None if dj >= 0 else dj))
            between = np.maximum(speed[here], speed[shifted])
            rows.append(number[here].ravel())
            cols.append(number[shifted].ravel())
            costs.append((self.step * np.hypot(di, dj) / between).ravel())
        graph = csr_array(
            (np.concatenate(costs), (np.concatenate(rows), np.concatenate(cols))),
            shape=(changed.size, changed.size),
        )
        time = dijkstra(graph, directed=False, indices=number[changed], min_only=True)
        # a node and the changed water may lie anywhere in their cells
        slack = 1.5 * self.step / float(speed.min())
        return np.asarray((time / DETOUR - slack).reshape(changed.shape))

    def _speeds(self) -> Array:
        """Return a bound of the fastest current in each cell, at any depth and time."""
        flow = self.flows[1]
        result = np.full(tuple(self.count), flow.extent.max_speed)
        if not isinstance(flow, (Grid, OceanGrid)):
            return result
        speeds = np.hypot(*np.moveaxis(self._in_time(flow, flow.values), -1, 0))
        fastest = speeds.max(axis=tuple(range(speeds.ndim - 2)))
        steps = np.quantile(fastest, np.linspace(0, 1, STEPS))
        result[:] = steps[0]
        for low, high in pairwise(steps):
            result[self._touched(flow, fastest > low)] = high
        return result
