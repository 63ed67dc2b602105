"""The trade of time against energy for one query: every path for which no other path is better in both."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

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
    """All `paths` for which no other path is better both in time and in energy; time rises and energy falls.

    If no path exists, `paths` holds one path that is not found. If `whole` is False, the flow changes with time
    and ways that reach a node later with no less energy were not followed; such a way may continue better.
    """

    paths: tuple[Path, ...]
    whole: bool = True

    def within(self, energy: float) -> Path:
        """Return the fastest path that uses at most `energy` [J]; if no path does, it says why."""
        found = next((path for path in self.paths if path.cost <= energy), None)
        return found or none_within(self.paths[-1], energy)

    def as_dict(self) -> dict[str, Any]:
        """Return a table for JSON: time, energy and number of legs of each path."""
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
    """Return the answer that no path uses at most `energy` [J]; `least` is the path that uses the least."""
    if not least.found:
        return least
    why = f"the least that one takes is {least.cost:,.0f} J, more than {energy:,.0f}"
    return replace(least, cost=math.inf, legs=(), why=why)


class RoadmapExpansion:
    """An `Expansion` of a roadmap's legs, which are the same at any time, and of the legs of start and goal."""

    def __init__(self, road: Roadmap, ends: "RoadmapEnds") -> None:
        """Number the places: the nodes, then the goal and the start if they are not nodes."""
        self.road, self.ends = road, ends
        beside = [] if ends.goal_legs is None else [ends.goal]
        apart = [] if ends.start_legs is None else [ends.start]
        self._places = np.vstack([road.position, *beside, *apart])
        self.edges = np.column_stack(
            [np.full(road.target.size, float(Status.CONNECTED)), *(getattr(road, name) for name in EDGE_FIELDS)]
        )

    @property
    def places(self) -> Array:
        """The positions of all places (n, 3) [m]."""
        return self._places

    @property
    def nodes(self) -> int:
        """The number of nodes; the nodes are the first places."""
        return len(self.road.position)

    @property
    def start(self) -> int:
        """The number of the start among the places."""
        return int(self.ends.start_nodes[0]) if self.ends.start_legs is None else len(self._places) - 1

    @property
    def goals(self) -> Index:
        """The numbers of the places at the goal."""
        return self.ends.goal_nodes if self.ends.goal_legs is None else np.array([self.nodes])

    @property
    def spent(self) -> bool:
        """Always False: this expansion has no limit."""
        return False

    @property
    def chosen(self) -> Index | slice:
        """No place: it does not matter which legs are wanted."""
        return np.empty(0, np.int64)

    def fans(self, place: Index, time: Array, wanted: Bools) -> list[Fan]:
        """Return all legs from places `place` (n,); they do not depend on `time`, and `wanted` is ignored."""
        return [self._fan(int(number)) for number in place]

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
    """Start and goal (3,) [m] of a query of a roadmap, with the nodes at each, or its legs if it is not a node.

    `direct` is the leg from start to goal; it is not connected if both are nodes.
    """

    start: Array
    goal: Array
    start_nodes: Index
    goal_nodes: Index
    start_legs: Fan | None
    goal_legs: Fan | None
    direct: Edge


class LeftInRoadmap:
    """Lower bounds of time and cost to the goal by a roadmap's legs; they are exact except for the first turn."""

    def __init__(self, expansion: RoadmapExpansion, sink: float) -> None:
        """Keep the expansion; `sink` [m/s] is the greatest vertical speed of any glide."""
        self.expansion, self.sink = expansion, sink

    def between(self, place: int, others: Index | slice = slice(None)) -> Array:
        """Return the bound 0 (n,) [s] for `others`: a roadmap's legs are known, so none need be left out."""
        return np.zeros(len(self.expansion.places[others]))

    def remaining(self, goals: Index, cost: Cost) -> tuple[Array, Array]:
        """Return lower bounds from each place to the nearest goal: of time (n,) [s], and of cost (n,).

        Dijkstra's algorithm runs backward from the goals, once over time and once over cost.
        """
        fans = [self.expansion._fan(place) for place in range(len(self.expansion.places))]
        source = np.repeat(np.arange(len(fans)), [fan.target.size for fan in fans])
        target = np.concatenate([fan.target for fan in fans])
        rows = np.concatenate([fan.rows for fan in fans])
        climbs = rows[:, GLIDE_ANGLE] > 0
        time = _backward(target, source, rows[:, TIME], goals, len(fans))
        turn = cost.inflection(self.expansion.places[:, 2])
        if turn is None:
            return time, _backward(target, source, rows[:, COST], goals, len(fans))
        # each place has two states: even if reached by a dive, so that a climb costs a turn; odd if by a climb
        ends = np.concatenate([2 * target + climbs, 2 * target + climbs])
        begins = np.concatenate([2 * source, 2 * source + 1])
        costs = np.concatenate([rows[:, COST] + np.where(climbs, turn[source], 0.0), rows[:, COST]])
        both = _backward(ends, begins, costs, np.concatenate([2 * goals, 2 * goals + 1]), 2 * len(fans))
        return time, np.asarray(both.reshape(-1, 2).min(axis=1))


def _backward(begin: Index, end: Index, weight: Array, goals: Index, count: int) -> Array:
    """Return the least sums (count,) from each place to one of the goals, over reversed legs."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    graph = csr_array((weight, (begin, end)), shape=(count, count))
    found: Array = dijkstra(graph, directed=True, indices=goals, min_only=True)
    return found * (
        1 - 1e-12
    )  # sums in another order have rounding errors and must not be smaller than the bound
