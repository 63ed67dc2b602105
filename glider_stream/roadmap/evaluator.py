"""Edge evaluation for callers from Python: casts arrays, checks them, calls the kernels."""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Array, Bools, Index
from ..base.settings import require
from ..base.threads import in_parallel
from ..kernels import connect, control, edges, fan, flow, motion, reach, refine, terrain
from ..kernels.edges import Edge, Status
from ..vehicle.cost import Cost, TravelTime
from ..water.inspect import is_steady
from .bins import node_bins
from .steering import FlowMapMethod, IntegrationSettings, Method, StreamlineMethod

NODES_AT_ONCE = 16
"""Source nodes that a thread takes at once: few, since their work differs a hundredfold."""
MOST_LEGS = 1024
"""Legs of a node for which there is room at first."""


@dataclass(frozen=True)
class Evaluator:
    """Everything that decides an edge but its ends: flow, terrain, glide polar, steering, integration, cost."""

    flow: flow.Flow
    terrain: terrain.Terrain
    polar: control.Polar
    steering: Method
    integration: IntegrationSettings
    cost: Cost = TravelTime()  # noqa: RUF009  (frozen)

    def connect(
        self,
        position: ArrayLike,
        departure: ArrayLike,
        source: ArrayLike,
        indptr: ArrayLike,
        target: ArrayLike,
    ) -> Array:
        """Outcomes of all pairs (source[n], target[indptr[n]:indptr[n + 1]]): rows in the order of `Edge`.

        position (nodes, 3) [m]; departure (nodes,) [s] or one for all; source (n,), indptr (n + 1,),
        target (pairs,) node numbers. Status first (see `Status`); time [s], cost, glide angle, heading [rad],
        speed [m/s], miss [m], NaN where the pair is not connected.
        """
        # writeable arrays, always: Numba compiles read-only ones apart
        nodes = np.require(position, np.float64, ["C", "W"])
        require(nodes.ndim == 2 and nodes.shape[1] == 3, f"`position` must have shape (n, 3); got {nodes.shape}")
        require(bool(np.isfinite(nodes).all()), "`position` must be finite; got NaN or infinity")
        departs = np.full(len(nodes), departure, np.float64)
        sources, rows, targets = (np.require(a, np.int64, ["C", "W"]) for a in (source, indptr, target))
        fits = rows.size == sources.size + 1 and rows[0] == 0 and rows[-1] == targets.size
        require(bool(fits and (np.diff(rows) >= 0).all()), "`indptr` must rise from 0 to the number of targets")
        for name, index in (("source", sources), ("target", targets)):
            inside = index.size == 0 or (index.min() >= 0 and index.max() < len(nodes))
            require(inside, f"`{name}` must hold node numbers below {len(nodes)}; got others")
        pairs = nodes, departs, sources, rows, targets
        result: Array
        if isinstance(self.steering, FlowMapMethod):
            result = self._connect_by_fan(*pairs)
        else:
            result = np.empty((targets.size, 7))
            refines = isinstance(self.steering, StreamlineMethod) and self.steering.refine
            kernel = refine.refine_nodes if refines else connect.connect_nodes
            task = partial(kernel, self.medium, self.steering.kernel(), *pairs, result)
            in_parallel(task, sources.size, NODES_AT_ONCE)
        return result

    def _connect_by_fan(self, nodes: Array, departs: Array, sources: Index, rows: Index, targets: Index) -> Array:
        result = np.empty((targets.size, 7))
        quick = partial(reach.quick_statuses, self.medium, nodes, departs, sources, rows, targets, result)
        in_parallel(quick, sources.size, NODES_AT_ONCE)
        may = result[:, 0] == Status.NO_HIT
        wanted = np.concatenate([[0], np.cumsum(may)])[rows].astype(np.int64), targets[may]
        legs = self._reach(nodes, nodes[sources], departs[sources], False, *wanted, 0)
        in_parallel(partial(reach.answer, rows, targets, *legs, result), sources.size, NODES_AT_ONCE)
        return result

    @property
    def medium(self) -> edges.Medium:
        """As the kernels read it."""
        return edges.Medium(self.flow, self.terrain, self.polar, self.integration.kernel(), self.cost.kernel())

    @property
    def flies_backward(self) -> bool:
        """Whether one fan, flown back in time, finds all legs to a point."""
        return isinstance(self.steering, FlowMapMethod) and is_steady(self.flow)

    def by_fan(self) -> "Evaluator":
        """The same, steering by the flow map."""
        exact = isinstance(self.steering, FlowMapMethod)
        return self if exact else replace(self, steering=FlowMapMethod())

    def reach(
        self,
        position: Array,
        departure: float | Array,
        source: Index,
        limit: int,
        wanted: Bools | None = None,
    ) -> tuple[Index, Index, Array]:
        """The legs from each of the nodes `source` to whatever lies under its fan: (indptr, target, outcomes).

        `departure` [s], one for all or (sources,). Only the fastest `limit` of each vertical direction, all where
        it is 0; of all, those to the nodes `wanted` (sources, nodes). Targets rise within a row.
        """
        indptr = target = np.empty(0, np.int64)
        if wanted is not None:
            indptr = np.concatenate([[0], np.cumsum(wanted.sum(axis=1))]).astype(np.int64)
            target = np.nonzero(wanted)[1].astype(np.int64)
        departs = np.full(source.size, departure)
        return self._reach(position, position[source], departs, False, indptr, target, limit)

    def reach_point(self, position: Array, point: Array, departure: float, backward: bool) -> tuple[Index, Array]:
        """The nodes that lie under the fan of a `point` (3,) [m], and the legs to them: (nodes, outcomes).

        With `backward`, in a steady flow, those that reach it, and the legs from them.
        """
        nobody = np.empty(0, np.int64)
        departs = np.full(1, departure)
        return self._reach(position, np.reshape(point, (1, 3)), departs, backward, nobody, nobody, 0)[1:]

    def _reach(
        self,
        position: Array,
        origin: Array,
        departs: Array,
        backward: bool,
        indptr: Index,
        target: Index,
        limit: int,
    ) -> tuple[Index, Index, Array]:
        if len(position) == 0:
            return np.zeros(len(origin) + 1, np.int64), np.empty(0, np.int64), np.empty((0, 7))
        nodes, points = (np.require(a, np.float64, ["C", "W"]) for a in (position, origin))
        how = self.medium, self.steering.kernel(), node_bins(nodes)
        ends = nodes, points, departs, backward, indptr, target, limit
        room = 2 * limit if limit else min(len(nodes), MOST_LEGS)
        if indptr.size > 0:
            room = int(np.diff(indptr).max(initial=1))
        counts = np.zeros(len(points), np.int64)
        while True:
            found = np.empty((len(points), room, reach.ROW - 1))
            task = partial(reach.reach_points, *how, *ends, counts, found)
            # a search asks for few nodes at a time: all threads shall have some
            in_parallel(task, len(points), max(1, min(NODES_AT_ONCE, len(points) // NODES_AT_ONCE)))
            if counts.max(initial=0) <= room:
                break
            room = int(counts.max())
        rows = found[np.arange(room) < counts[:, None]]
        first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        return first, rows[:, 0].astype(np.int64), np.ascontiguousarray(rows[:, 1:])

    def connect_pair(self, start: ArrayLike, goal: ArrayLike, departure: float = 0.0) -> Edge:
        """The outcome of one pair of points (3,) [m]."""
        row = self.connect(np.array([start, goal], np.float64), departure, [0], [0, 1], [1])[0]
        return Edge(int(row[0]), *(float(value) for value in row[1:]))

    def trace(self, start: ArrayLike, edge: Edge, departure: float) -> Array:
        """The path of an edge from `start` (3,) [m]: rows [t, x, y, z] to its closest approach."""
        x, y, z = (float(value) for value in np.asarray(start, np.float64))
        along = edge.speed * math.cos(edge.glide_angle)
        u, v = along * math.cos(edge.heading), along * math.sin(edge.heading)
        w = edge.speed * math.sin(edge.glide_angle)
        rows: Array = motion.traced(self.flow, x, y, z, departure, u, v, w, edge.time, self.integration.dt)
        return rows

    def landings(
        self, start: ArrayLike, height: float, glide_angle: ArrayLike, heading: ArrayLike, departure: float = 0.0
    ) -> Array:
        """Where controls from `start` (3,) [m] land at a height [m]: the flow map, x, y (n, 2) [m].

        `glide_angle` (its magnitude) and `heading` [rad] (n,).
        """
        x, y, z = (float(value) for value in np.asarray(start, np.float64))
        require(height != z, f"a control cannot land at its own height; got {height:g} m for both")
        angles, headings = (np.require(a, np.float64, ["C", "W"]) for a in (glide_angle, heading))
        direction = control.CLIMB if height > z else control.DIVE
        where: Array = fan.landings(
            self.flow, self.polar, direction, x, y, z, departure, height, angles, headings, self.integration.dt
        )
        return where

    def control_line(self, start: ArrayLike, goal: ArrayLike, candidates: int, departure: float = 0.0) -> Array:
        """The pair's controls on its control line: magnitude of the glide angle and heading (n, 2) [rad]."""
        ends = [float(value) for value in (*np.ravel(start), *np.ravel(goal))]
        where: Array = connect.line_controls(self.medium, control.Streamline(candidates), *ends, departure)
        return where

    def allowed(self, points: Array, t: float = 0.0) -> NDArray[np.bool_]:
        """Which points (n, 3) [m] lie in the flow and in open water at time t [s]."""
        return np.array(
            [
                flow.contains(self.flow, x, y, t) and terrain.allowed(self.terrain, x, y, z)
                for x, y, z in np.asarray(points, np.float64)
            ],
            dtype=bool,
        )
