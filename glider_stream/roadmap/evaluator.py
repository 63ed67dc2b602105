"""Edge evaluation for Python code: converts arrays, checks them, calls the kernels."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Array, Bools, Index
from ..base.settings import require
from ..base.threads import in_parallel
from ..kernels import connect, control, edges, fan, flow, motion, terrain
from ..kernels.connect import Pairs
from ..kernels.edges import EDGE_COLUMNS, STATUS, Edge, Status, edge_of
from ..kernels.patch import Nodes
from ..kernels.place import Pair, Place
from ..kernels.reach import LEG_COLUMNS, LEG_EDGE, LEG_NODE, Legs, Points, answer, quick_statuses, reach_points
from ..vehicle.cost import Cost, TravelTime
from ..water.inspect import is_steady
from .bins import node_bins
from .steering import FlowMapMethod, IntegrationSettings, Method

NODES_AT_ONCE = 16
"""A thread takes this many source nodes at a time: only few, because their work differs by a factor of 100."""
MOST_LEGS = 1024
"""At first there is room for at most this many legs of a node."""


@dataclass(frozen=True)
class Evaluator:
    """Everything that determines an edge, except its ends: flow, terrain, polar, steering, integration, cost."""

    flow: flow.Flow
    terrain: terrain.Terrain
    polar: control.Polar
    steering: Method
    integration: IntegrationSettings
    cost: Cost = TravelTime()  # noqa: RUF009  (frozen)

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "steering", self.steering.in_flow(self.flow, self.integration.dt * self.integration.steps)
        )
        ladder = flow.ladder_in(self.flow)
        needless = ladder.shift == 0.0 and ladder.longest <= self.integration.dt
        # a method that tries controls one by one counts even steps
        if self.steering.counts_steps or needless:
            object.__setattr__(self, "flow", flow.on_even_steps(self.flow))

    def on_even_steps(self) -> "Evaluator":
        """Return the same evaluator in a flow without a ladder, so that all its steps last `integration.dt`."""
        return replace(self, flow=flow.on_even_steps(self.flow))

    def connect(
        self,
        position: ArrayLike,
        departure: ArrayLike,
        source: ArrayLike,
        indptr: ArrayLike,
        target: ArrayLike,
    ) -> Array:
        """Return the outcomes (pairs, 7) of all pairs (source[n], target[indptr[n]:indptr[n + 1]]).

        position (nodes, 3) [m]; departure (nodes,) [s] or one value for all; source (n,), indptr (n + 1,) and
        target (pairs,) with node numbers. The columns are the fields of `Edge`: status (see `Status`), time [s],
        cost, glide angle, heading [rad], speed [m/s], miss [m]. All but the status are NaN if a pair is not
        connected.
        """
        # arrays are always writeable, because Numba would compile the kernels again for read-only arrays
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
        pairs = Pairs(nodes, departs, sources, rows, targets)
        connector = self.steering.connector
        if connector is None:
            return self._explained(pairs, self._connect_by_fan(pairs))
        if flow.rises(self.flow) and connector is connect.connect_nodes:
            connector = connect.connect_rising
        result = np.empty((targets.size, EDGE_COLUMNS))
        task = partial(connector, self.medium, self.steering.kernel(), pairs, result)
        in_parallel(task, sources.size, NODES_AT_ONCE)
        return self._explained(pairs, result)

    def _explained(self, pairs: Pairs, outcomes: Array) -> Array:
        """Say of pairs without a leg where the water alone forbids one: in a flow that rises."""
        if flow.rises(self.flow):
            task = partial(connect.carried_away, self.medium, pairs, outcomes)
            in_parallel(task, pairs.source.size, NODES_AT_ONCE)
        return outcomes

    def _connect_by_fan(self, pairs: Pairs) -> Array:
        source, result = pairs.source, np.empty((pairs.target.size, EDGE_COLUMNS))
        in_parallel(partial(quick_statuses, self.medium, pairs, result), source.size, NODES_AT_ONCE)
        may = result[:, STATUS] == Status.NO_HIT
        indptr = np.concatenate([[0], np.cumsum(may)])[pairs.indptr].astype(np.int64)
        ends = pairs.position[source], pairs.departure[source]
        legs = self._reach(pairs.position, Points(*ends, False, indptr, pairs.target[may]), 0)
        in_parallel(partial(answer, pairs, *legs, result), source.size, NODES_AT_ONCE)
        return result

    @property
    def medium(self) -> edges.Medium:
        """The same values in the form that the kernels read."""
        return edges.Medium(self.flow, self.terrain, self.polar, self.integration.kernel(), self.cost.kernel())

    @property
    def exact(self) -> bool:
        """Whether all legs of a node are found together, under its fan."""
        return self.steering.connector is None

    @property
    def flies_backward(self) -> bool:
        """Whether one fan that is flown back in time can find all legs to a point.

        Not in a flow that rises: there a path may pass the depth of its start again, where the fan would end it.
        """
        return self.exact and is_steady(self.flow) and not flow.rises(self.flow)

    def by_fan(self) -> "Evaluator":
        """Return the same evaluator with steering by the flow map."""
        return self if self.exact else replace(self, steering=FlowMapMethod())

    def reach(
        self,
        position: Array,
        departure: float | Array,
        source: Index,
        limit: int,
        wanted: Bools | None = None,
    ) -> tuple[Index, Index, Array]:
        """Return the legs from each node `source` to all nodes under its fan: (indptr, target, outcomes).

        `departure` [s] is one value or (sources,). Only the fastest `limit` legs of each vertical direction are
        returned, all legs if `limit` is 0. Only legs to the nodes marked in `wanted` (sources, nodes) are
        searched, if it is given. Targets rise within a row.
        """
        points = _asking_for_all(position[source], departure, False)
        if wanted is not None:
            indptr = np.concatenate([[0], np.cumsum(wanted.sum(axis=1))]).astype(np.int64)
            points = points._replace(indptr=indptr, target=np.nonzero(wanted)[1].astype(np.int64))
        return self._reach(position, points, limit)

    def reach_point(self, position: Array, point: Array, departure: float, backward: bool) -> tuple[Index, Array]:
        """Return the nodes under the fan of a `point` (3,) [m] and the legs to them: (nodes, outcomes).

        With `backward`, in a steady flow, return the nodes that reach the point and the legs from them.
        """
        return self._reach(position, _asking_for_all(np.reshape(point, (1, 3)), departure, backward), 0)[1:]

    def _reach(self, position: Array, points: Points, limit: int) -> tuple[Index, Index, Array]:
        count = len(points.position)
        if len(position) == 0:
            return np.zeros(count + 1, np.int64), np.empty(0, np.int64), np.empty((0, EDGE_COLUMNS))
        where = np.require(position, np.float64, ["C", "W"])
        nodes = Nodes(where, node_bins(where), np.empty(0, np.bool_))
        room = 2 * limit if limit else min(len(where), MOST_LEGS)
        if points.indptr.size > 0:
            room = int(np.diff(points.indptr).max(initial=1))
        counts = np.zeros(count, np.int64)
        while True:
            legs = Legs(counts, np.empty((count, room, LEG_COLUMNS)))
            task = partial(reach_points, self.medium, self.steering.kernel(), nodes, points, limit, legs)
            # a search asks for few nodes at a time; each thread gets some of them
            in_parallel(task, count, max(1, min(NODES_AT_ONCE, count // NODES_AT_ONCE)))
            if counts.max(initial=0) <= room:
                break
            room = int(counts.max())
        rows = legs.rows[np.arange(room) < counts[:, None]]
        first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        targets = rows[:, LEG_NODE].astype(np.int64)
        return first, targets, np.ascontiguousarray(rows[:, LEG_EDGE:])

    def connect_pair(self, start: ArrayLike, goal: ArrayLike, departure: float = 0.0) -> Edge:
        """Return the outcome of one pair of points (3,) [m]."""
        return edge_of(self.connect(np.array([start, goal], np.float64), departure, [0], [0, 1], [1])[0])

    def trace(self, start: ArrayLike, edge: Edge, departure: float) -> Array:
        """Return the path of an edge from `start` (3,) [m]: rows [t, x, y, z] up to its closest approach."""
        through = control.control_of(edge.speed, edge.glide_angle, edge.heading)
        rows: Array = motion.traced(self.flow, _place(start, departure), through, edge.time, self.integration.dt)
        return rows

    def landings(
        self, start: ArrayLike, height: float, glide_angle: ArrayLike, heading: ArrayLike, departure: float = 0.0
    ) -> Array:
        """Return the places x, y (n, 2) [m] where controls from `start` (3,) [m] reach a height [m].

        `glide_angle` is the magnitude of the angle, (n,) [rad]; `heading` (n,) [rad].
        """
        origin = _place(start, departure)
        require(height != origin.z, f"a control cannot land at its own height; got {height:g} m for both")
        angles, headings = (np.require(a, np.float64, ["C", "W"]) for a in (glide_angle, heading))
        direction = control.CLIMB if height > origin.z else control.DIVE
        horizon = self.integration.dt * self.integration.steps
        launch = fan.Launch(origin, direction, self.integration.dt, horizon, flow.LEGS)
        where: Array = fan.landings(self.medium, launch, float(height), angles, headings)
        return where

    def control_line(self, start: ArrayLike, goal: ArrayLike, candidates: int, departure: float = 0.0) -> Array:
        """Return a pair's controls on its control line: magnitude of the glide angle and heading (n, 2) [rad]."""
        pair = Pair(_place(start, departure), _place(goal, departure))
        where: Array = connect.line_controls(self.medium, control.Streamline(candidates), pair)
        return where

    def allowed(self, points: Array, t: float = 0.0) -> NDArray[np.bool_]:
        """Return a mask (n,) of the points (n, 3) [m] that lie in the flow and in open water at time t [s]."""
        return np.array(
            [
                flow.contains(self.flow, x, y, t) and terrain.allowed(self.terrain, x, y, z)
                for x, y, z in np.asarray(points, np.float64)
            ],
            dtype=bool,
        )


def _place(point: ArrayLike, t: float) -> Place:
    x, y, z = (float(value) for value in np.asarray(point, np.float64))
    return Place(x, y, z, float(t))


def _asking_for_all(position: Array, departure: float | Array, backward: bool) -> Points:
    """Return points from `position` (n, 3) [m] that ask for all nodes under their fans."""
    nobody = np.empty(0, np.int64)
    places = np.require(position, np.float64, ["C", "W"])
    return Points(places, np.full(len(places), departure, np.float64), backward, nobody, nobody)
