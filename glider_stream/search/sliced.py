"""Searches over slices: interpolates leg times between departures, then finds each leg of the answer exactly.

A search takes the time of a leg as linear between the departures of a roadmap. Then the legs of its route are
found exactly, one after another, each at the time at which it really leaves. These exact legs replace the
interpolated ones, and the search runs again, until it finds nothing better than a route that was flown.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.arrays import Array, Index
from ..base.settings import require
from ..kernels.edges import CONNECTED, STATUS, TIME, edge_of
from ..kernels.timetable import earliest_arrivals
from ..roadmap.pairs import Attached, NeighbourLegs
from ..roadmap.problem import Problem
from ..roadmap.provenance import check_unchanged
from ..roadmap.rows import FASTEST
from ..roadmap.slices import SlicedRoadmap
from ..roadmap.store import StoredRoadmap
from .least_time import BESIDE, fastest_sink
from .path import Hop

AGREES = 0.01
"""A search and a flight agree if their arrivals differ by at most this [s]."""
MOST_ROUNDS = 100
"""At most this many searches are made for one route."""
AHEAD = 512
"""When a search needs edges that are not read yet, they are read for this many nodes that come next."""
LAST_LEGS_AT_ONCE = 32
"""If the goal is not a node, the last legs from this many nodes are found together."""


@dataclass(frozen=True)
class Agreement:
    """The difference between the slices and exact legs.

    Over the `legs` that were flown, the times of the slices were wrong by at most `most` [s] and by `mean` [s] on
    average. `lost` legs of the slices do not exist at the time at which they should leave. `rounds` is the number
    of searches. `agreed`: the last search found nothing better than the route that was flown.
    """

    legs: int
    most: float
    mean: float
    lost: int
    rounds: int
    agreed: bool

    def __str__(self) -> str:
        searches = "1 search" if self.rounds == 1 else f"{self.rounds} searches"
        differences = (
            f"slices and truth differ by {self.most:.2g} s in a leg at most, {self.mean:.2g} s on average"
        )
        lost = f", and {self.lost} legs of the slices do not exist when they should leave" if self.lost else ""
        end = "" if self.agreed else "; they did not come to agree, and a better route may exist"
        return f"{differences}, in {self.legs} legs of {searches}{lost}{end}"


@dataclass
class _Learnt:
    """Exact legs between nodes, by source, target and departure [s]."""

    rows: dict[tuple[int, int, float], Array] = field(default_factory=dict)
    off: list[float] = field(default_factory=list)
    lost: int = 0

    def table(self, nodes: int) -> tuple[Index, Index, Array, Array]:
        """Return the exact legs as CSR rows, targets, departures [s] and times [s], for `earliest_arrivals`."""
        keys = sorted(self.rows)
        source = np.array([key[0] for key in keys], np.int64)
        target, when = np.array([key[1] for key in keys], np.int64), np.array([key[2] for key in keys])
        times = [self.rows[key][TIME] if self.rows[key][STATUS] == CONNECTED else math.inf for key in keys]
        return np.searchsorted(source, np.arange(nodes + 1)).astype(np.int64), target, when, np.array(times)


@dataclass(frozen=True)
class _Found:
    """The way that a search has found: its nodes, its arrival [s], and the last leg if the goal is not a node."""

    nodes: list[int]
    arrives: float
    last: Array | None = None


class SliceSearch:
    """Finds the fastest routes over a roadmap of slices, at any departure between its first and last."""

    def __init__(self, roadmap: SlicedRoadmap | StoredRoadmap, problem: Problem) -> None:
        """Raise InputError if the roadmap was built with another flow, terrain or glider.

        Of a roadmap that stays in its file, the edges are read that a search comes to; the routes are the same.
        """
        check_unchanged(roadmap, problem)
        assert roadmap.departures is not None
        self.position, self.departures, self.rows = roadmap.position, roadmap.departures, roadmap.rows(FASTEST)
        self.problem = problem

    def fastest(self, start: Array, goal: Array, departure: float) -> tuple[list[Hop] | None, Agreement]:
        """Return the legs of the fastest route between two points (3,) [m], or None, and the agreement.

        Points that are not nodes are attached by exact legs.
        """
        first, last = self.departures[[0, -1]]
        require(
            first <= departure <= last,
            f"the roadmap's departures are from {first:g} s to {last:g} s; got {departure:g} s",
        )
        learnt = _Learnt()
        query = _Query(self, start, goal, departure, learnt)
        best: list[Hop] | None = query.direct()
        arrives = math.inf if best is None else departure + best[0][2].time
        rounds, agreed = 0, False
        while rounds < MOST_ROUNDS and not agreed:
            rounds += 1
            found = query.search(arrives - AGREES)
            agreed = found is None
            if found is None:
                break
            hops, when = query.flown(found)
            if hops is not None and when < arrives:
                best, arrives = hops, when
            agreed = arrives <= found.arrives + AGREES
        off = learnt.off or [0.0]
        return best, Agreement(len(learnt.off), max(off), sum(off) / len(off), learnt.lost, rounds, agreed)


class _Query:
    """One query: its ends, and the exact legs that are known beside the slices."""

    def __init__(self, search: SliceSearch, start: Array, goal: Array, departure: float, learnt: _Learnt) -> None:
        self.departures, self.rows, self.departure, self.learnt = (
            search.departures,
            search.rows,
            departure,
            learnt,
        )
        self.start, self.goal = start, goal
        self.problem = replace(search.problem, departure=departure)
        self.position = position = search.position
        self.starts, self.goals = (np.flatnonzero((position == end).all(axis=1)) for end in (start, goal))
        self.legs = self.problem.legs(position)
        self.ends = self.problem.evaluator.flow.extent.t_hi
        self.away = None if self.starts.size else _arriving(self.legs.away(start), self.ends - departure)
        self.least = self._least(position)
        self._last: dict[tuple[int, float], Array] = {}

    def direct(self) -> list[Hop] | None:
        """Return the direct leg if start or goal is not a node, because no slice has it; else None."""
        if self.starts.size and self.goals.size:
            return None
        row = self._exact(self.start, self.goal, self.departure)
        return [(self.start, self.goal, edge_of(row))] if row[STATUS] == CONNECTED else None

    def search(self, latest: float) -> _Found | None:
        """Return the fastest way by the slices and the exact legs; None if no way arrives by `latest` [s]."""
        nodes = len(self.position)
        arrival, before = np.full(nodes, math.inf), np.full(nodes, -1, np.int64)
        if self.away is None:
            arrival[self.starts] = self.departure
        else:
            arrival[self.away.nodes] = self.departure + self.away.outcomes[:, TIME]
        goal = int(self.goals[0]) if self.goals.size else -1
        latest = min(latest, self.ends)
        self._arrivals(goal, latest, arrival, before)
        node, arrives, last = goal, math.inf, None
        if goal >= 0:
            arrives = float(arrival[goal])
        else:
            node, arrives, last = self._through(arrival, latest)
        if not math.isfinite(arrives) or arrives > latest:
            return None
        way = [node]
        while before[way[-1]] >= 0:
            way.append(int(before[way[-1]]))
        return _Found(way[::-1], arrives, last)

    def _arrivals(self, goal: int, latest: float, arrival: Array, before: Index) -> None:
        """Run `earliest_arrivals`; edges are read when it needs them."""
        rows, learnt = self.rows, self.learnt.table(arrival.size)
        settled = np.zeros(arrival.size, np.bool_)
        ends = goal, self.least, latest, arrival, before, settled
        edges = self.departures, rows.indptr, rows.target, rows.weight, rows.block
        while earliest_arrivals(*edges, rows.known, *learnt, *ends) >= 0:
            soonest = np.where(settled, math.inf, arrival + self.least)
            ahead = min(AHEAD, settled.size) - 1
            near = np.flatnonzero((soonest <= np.partition(soonest, ahead)[ahead]) & np.isfinite(soonest))
            slices = self._slice_of(arrival[near])
            last = slices + 1 == self.departures.size  # no row of this node follows
            rows.need(near[last] * self.departures.size + slices[last])
            rows.need(near[~last] * self.departures.size + slices[~last], following=2)

    def _slice_of(self, when: Array | float) -> Index:
        """Return the number of the slice at or before a time [s]; the first one before it."""
        number = np.searchsorted(self.departures, when, side="right") - 1
        return np.asarray(np.clip(number, 0, self.departures.size - 1))

    def flown(self, found: _Found) -> tuple[list[Hop] | None, float]:
        """Return the exact legs of a way and its arrival [s]; (None, inf) if a leg does not exist at its time."""
        position, when = self.position, self.departure
        hops: list[Hop] = []
        if self.away is not None:
            row = self.away.outcomes[np.flatnonzero(self.away.nodes == found.nodes[0])[0]]
            hops.append((self.start, position[found.nodes[0]], edge_of(row)))
            when += float(row[TIME])
        for a, b in zip(found.nodes, found.nodes[1:], strict=False):
            key = a, b, when
            if key not in self.learnt.rows:
                self.learnt.rows[key] = self._exact(position[a], position[b], when)
                self._compare(a, b, when)
            row = self.learnt.rows[key]
            if row[STATUS] != CONNECTED:
                return None, math.inf
            hops.append((position[a], position[b], edge_of(row)))
            when += float(row[TIME])
        if found.last is not None:
            row = self._last_leg(found.nodes[-1], when)
            if row[STATUS] != CONNECTED:
                return None, math.inf
            hops.append((position[found.nodes[-1]], self.goal, edge_of(row)))
            when += float(row[TIME])
        return hops, when

    def _compare(self, a: int, b: int, when: float) -> None:
        """Record the error of the slices for a leg that is now known exactly."""
        row = self.learnt.rows[a, b, when]
        if row[STATUS] != CONNECTED:
            self.learnt.lost += 1
            return
        number = int(self._slice_of(when))
        both = [number, min(number + 1, self.departures.size - 1)]
        times, ends = [self._slice_time(a, b, k) for k in both], self.departures[both]
        known = [time for time in times if math.isfinite(time)]
        by_slices = known[0] if len(known) == 1 else float(np.interp(when, ends, times))
        self.learnt.off.append(abs(by_slices - float(row[TIME])))

    def _slice_time(self, a: int, b: int, number: int) -> float:
        rows, row = self.rows, a * self.departures.size + number
        rows.need(np.array([row]))
        first, last = rows.indptr[row], rows.indptr[row + 1]
        at = first + int(np.searchsorted(rows.target[first:last], b))
        return float(rows.weight[at]) if at < last and rows.target[at] == b else math.inf

    def _exact(self, start: Array, goal: Array, when: float) -> Array:
        """Return the leg between two points that leaves at a time [s], a row of `Edge`.

        A leg that ends after the flow's last time has the status NaN.
        """
        evaluator = self.problem.evaluator
        row: Array = evaluator.connect(np.array([start, goal]), when, [0], [0, 1], [1])[0]
        if row[STATUS] == CONNECTED and when + row[TIME] > self.ends:
            row[STATUS] = math.nan
        return row

    def _last_leg(self, node: int, when: float) -> Array:
        key = node, when
        if key not in self._last:
            self._last[key] = self._exact(self.position[node], self.goal, when)
        return self._last[key]

    def _through(self, arrival: Array, latest: float) -> tuple[int, float, Array | None]:
        """Return the node from which the goal is reached first, the arrival [s], and the last leg.

        Nodes are tried in the order of their earliest possible arrival, until no node can be earlier.
        """
        position = self.position
        nodes = np.flatnonzero(np.isfinite(arrival) & (position[:, 2] != self.goal[2]))
        if isinstance(self.legs, NeighbourLegs):
            nodes = np.intersect1d(nodes, self.legs.neighbourhood.of(self.goal))
        soonest = arrival[nodes] + self.least[nodes]
        order = np.argsort(soonest, kind="stable")
        best, arrives, leg = -1, math.inf, None
        for first in range(0, order.size, LAST_LEGS_AT_ONCE):
            if soonest[order[first]] >= min(arrives, latest):
                break
            some = nodes[order[first : first + LAST_LEGS_AT_ONCE]]
            for node, row in zip(some, self._last_legs(some, arrival[some]), strict=True):
                if row[STATUS] == CONNECTED and arrival[node] + row[TIME] < arrives:
                    best, arrives, leg = int(node), float(arrival[node] + row[TIME]), row
        return best, arrives, leg

    def _last_legs(self, nodes: Index, when: Array) -> list[Array]:
        """Return the legs from some nodes to the goal; unknown legs are found together."""
        new = [n for n, at in zip(nodes, when, strict=True) if (int(n), float(at)) not in self._last]
        if new:
            times = dict(zip(nodes.tolist(), when.tolist(), strict=True))
            points = np.vstack([self.position[new], self.goal])
            departs = np.array([*(times[int(n)] for n in new), 0.0])
            count = len(new)
            rows = self.problem.evaluator.connect(
                points, departs, np.arange(count), np.arange(count + 1), np.full(count, count)
            )
            for n, row in zip(new, rows, strict=True):
                if row[STATUS] == CONNECTED and times[int(n)] + row[TIME] > self.ends:
                    row[STATUS] = math.nan
                self._last[int(n), times[int(n)]] = row
        return [self._last[int(n), float(at)] for n, at in zip(nodes, when, strict=True)]

    def _least(self, points: Array) -> Array:
        """Return a lower bound (n,) of the time [s] from points (n, 3) [m] to the goal by any number of legs."""
        evaluator = self.problem.evaluator
        if not evaluator.exact:  # each leg may end beside its target by as much as the tolerance
            return np.zeros(len(points))
        polar, flow = evaluator.polar, evaluator.flow
        sink = fastest_sink(polar, flow)
        away = np.hypot(*(points[:, :2] - self.goal[:2]).T)
        across = away / (float(polar.best_horizontal.max()) + flow.extent.max_speed)
        least = np.maximum(across, np.abs(points[:, 2] - self.goal[2]) / sink)
        return np.asarray(np.ascontiguousarray((1.0 - BESIDE) * least))


def _arriving(attached: Attached, most: float) -> Attached:
    """Return only the pairs that are connected by legs of at most `most` [s]."""
    kept = (attached.outcomes[:, STATUS] == CONNECTED) & (attached.outcomes[:, TIME] <= most)
    return Attached(attached.nodes[kept], attached.outcomes[kept])
