"""The trade of time against energy for one query: every path that no other beats in both."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ..base.arrays import Array, Bools, Index
from ..base.clock import span
from ..kernels.edges import COST, EDGE_COLUMNS, GLIDE_ANGLE, TIME, Edge, Status
from ..roadmap.roadmap import EDGE_FIELDS, Roadmap
from ..vehicle.cost import Cost
from .expansion import Fan
from .path import FROZEN, Path

NO_LEGS = Fan(np.empty(0, np.int64), np.empty((0, EDGE_COLUMNS)))
WHOLE = "the whole front: no path is better than one of these in both"
IN_PART = (
    "no path among those that come to each node soonest, or for less energy, is better than one of these in "
    "both; set query.bins (seconds) to follow later ones, too"
)


@dataclass(frozen=True)
class TradeOff:
    """`paths` by rising time and falling energy: all that there are of which no other is better in both.

    One path that is not found where there is none. Not `whole`: in a flow that changes, ways that come to a node
    later, and for no less energy, were not followed; one of them may go on better.
    """

    paths: tuple[Path, ...]
    whole: bool = True

    def within(self, energy: float) -> Path:
        """The fastest of them that uses at most so much energy [J]; where there is none, why."""
        found = next((path for path in self.paths if path.cost <= energy), None)
        return found or none_within(self.paths[-1], energy)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: each path's time, energy and number of legs."""
        rows = [(path.travel_time, path.cost, len(path.legs)) for path in self.paths]
        still = {} if self.paths[0].departure is None else {"frozen": self.paths[0].frozen}
        return {
            "trade_off": [{"travel_time_s": t, "energy_j": e, "legs": n} for t, e, n in rows],
            "whole": self.whole,
            **still,
        }

    def __str__(self) -> str:
        lines = ["   time                energy   legs"]
        lines += [
            f"{span(path.travel_time):>20} {path.cost / 1000:9,.2f} kJ  {len(path.legs):4}" for path in self.paths
        ]
        still = [FROZEN] if self.paths[0].frozen else []
        last = WHOLE if self.whole else IN_PART
        return "\n".join([*lines, last, *still])


def none_within(least: Path, energy: float) -> Path:
    """The honest no to a bound on energy [J], below that of the path that uses the least."""
    if not least.found:
        return least
    why = f"the least that one takes is {least.cost:,.0f} J, more than {energy:,.0f}"
    return replace(least, cost=math.inf, legs=(), why=why)


class RoadmapExpansion:
    """The legs of a roadmap whose edges hold at any time, and of its ends, as `expansion.Expansion` has them."""

    def __init__(self, road: Roadmap, ends: "RoadmapEnds") -> None:
        """Number the places: the nodes, the goal and the start where they are none."""
        self.road, self.ends = road, ends
        beside = [] if ends.goal_legs is None else [ends.goal]
        apart = [] if ends.start_legs is None else [ends.start]
        self._places = np.vstack([road.position, *beside, *apart])
        self.edges = np.column_stack(
            [np.full(road.target.size, float(Status.CONNECTED)), *(getattr(road, name) for name in EDGE_FIELDS)]
        )

    @property
    def places(self) -> Array:
        """As Expansion says."""
        return self._places

    @property
    def nodes(self) -> int:
        """As Expansion says."""
        return len(self.road.position)

    @property
    def start(self) -> int:
        """As Expansion says."""
        return int(self.ends.start_nodes[0]) if self.ends.start_legs is None else len(self._places) - 1

    @property
    def goals(self) -> Index:
        """The places of the goal."""
        return self.ends.goal_nodes if self.ends.goal_legs is None else np.array([self.nodes])

    @property
    def spent(self) -> bool:
        """As Expansion says: never."""
        return False

    def fans(self, place: Index, time: Array, wanted: Bools) -> list[Fan]:
        """As Expansion says: all of them, at any time."""
        return [self._fan(int(one)) for one in place]

    def _fan(self, place: int) -> Fan:
        fan = NO_LEGS
        if place < self.nodes:
            row = slice(self.road.indptr[place], self.road.indptr[place + 1])
            fan = Fan(self.road.target[row].astype(np.int64), self.edges[row])
        elif self.ends.start_legs is not None and place == self.start:
            fan = self.ends.start_legs
        last: list[Fan] = []
        if self.ends.goal_legs is not None and place < self.nodes:
            here = self.ends.goal_legs.target == place
            last = [Fan(np.full(int(here.sum()), self.nodes), self.ends.goal_legs.rows[here])]
        if place == self.start and self.ends.direct.status == Status.CONNECTED:
            last.append(Fan(self.goals[:1], np.array([self.ends.direct], np.float64)))
        if not last:
            return fan
        target, rows = zip(fan, *last, strict=True)
        return Fan(np.concatenate(target), np.concatenate(rows))


@dataclass(frozen=True)
class RoadmapEnds:
    """Start and goal (3,) [m] of a query of a roadmap: the nodes there, or the legs of an end that is no node.

    `direct`: the leg from end to end, where one of them is no node.
    """

    start: Array
    goal: Array
    start_nodes: Index
    goal_nodes: Index
    start_legs: Fan | None
    goal_legs: Fan | None
    direct: Edge


class LeftInRoadmap:
    """What a way to the goal takes at the least by a roadmap's legs: exact but for a turn at its beginning."""

    def __init__(self, expansion: RoadmapExpansion, sink: float) -> None:
        """`sink` [m/s]: no glide changes its depth faster."""
        self.expansion, self.sink = expansion, sink

    def between(self, place: int) -> Array:
        """As labels.Bound says; a roadmap's legs are at hand, so there is nothing to leave out."""
        return np.zeros(len(self.expansion.places))

    def remaining(self, goals: Index, cost: Cost) -> tuple[Array, Array]:
        """As labels.Bound says, by Dijkstra's algorithm from the goals, backward over time, then over cost."""
        fans = [self.expansion._fan(place) for place in range(len(self.expansion.places))]
        source = np.repeat(np.arange(len(fans)), [fan.target.size for fan in fans])
        target = np.concatenate([fan.target for fan in fans])
        rows = np.concatenate([fan.rows for fan in fans])
        climbs = rows[:, GLIDE_ANGLE] > 0
        time = _backward(target, source, rows[:, TIME], goals, len(fans))
        turn = cost.inflection(self.expansion.places[:, 2])
        if turn is None:
            return time, _backward(target, source, rows[:, COST], goals, len(fans))
        # twice each place: come to by a dive (even), from where a climb costs a turn, and by a climb (odd)
        ends = np.concatenate([2 * target + climbs, 2 * target + climbs])
        begins = np.concatenate([2 * source, 2 * source + 1])
        costs = np.concatenate([rows[:, COST] + np.where(climbs, turn[source], 0.0), rows[:, COST]])
        both = _backward(ends, begins, costs, np.concatenate([2 * goals, 2 * goals + 1]), 2 * len(fans))
        return time, np.asarray(both.reshape(-1, 2).min(axis=1))


def _backward(begin: Index, end: Index, weight: Array, goals: Index, count: int) -> Array:
    """The least sums from each of `count` places to one of the goals, over legs turned round."""
    graph = csr_array((weight, (begin, end)), shape=(count, count))
    found: Array = dijkstra(graph, directed=True, indices=goals, min_only=True)
    return found * (1 - 1e-12)  # sums in another order must not come out above
