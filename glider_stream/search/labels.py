"""Labels: a search over ways, of which several to one place may each be worth going on with.

A label is a place and what counts there: the time, and where asked for the cost, whether a climb would cost a
turn, the half-yos since the last surfacing, and when that was. A label to which another at the same place is
nowhere worse is dropped: whatever follows, the other does as well. That takes for granted that who leaves
earlier arrives no later; where it does not hold, labels of different bins of time are kept side by side.
Labels are taken by the least of what is asked for, what remains at least to the goal included (Hart, Nilsson
and Raphael 1968; Martins 1984, On a multicriteria shortest path problem); each is expanded at its own time.
"""

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..base.arrays import Array, Bools, Index
from ..kernels.edges import COST, GLIDE_ANGLE, TIME, Edge, edge_of
from ..vehicle.cost import Cost
from .expansion import Expansion, Fan
from .path import SURFACE, Hop
from .surfacing import Surfacing

AT_ONCE, MOST_AT_ONCE = 16, 256
"""Labels that are expanded together: at least so many, though one of them may better another; at most so many."""
HOUR = 3600.0


@dataclass(frozen=True)
class Aim:
    """What a search is for: the least time, or with `by_cost` the least cost; a cost below `cost_below`.

    With `front`, every way to the goal that no other beats in both. `bins` [s]: labels of different bins are
    kept side by side; `latest` [s]: no label is later. `below`: ways that take as much, of what is made least
    (the time at which they arrive, or the cost), are of no use.
    """

    by_cost: bool = False
    cost_below: float = math.inf
    front: bool = False
    bins: float | None = None
    latest: float = math.inf
    below: float = math.inf


class Bound(Protocol):
    """What a way takes at the least; `sink` [m/s]: no glide changes its depth faster."""

    @property
    def sink(self) -> float:
        """As Bound says."""
        ...

    def between(self, place: int) -> Array:
        """From one of the places to each (n,) [s]."""
        ...

    def remaining(self, goals: Index, cost: Cost) -> tuple[Array, Array]:
        """From each of the places to the nearest of some: (n,) [s], and (n,) in the cost's unit."""
        ...


@dataclass
class Tally:
    """What a search took: fans, the share of all places that were expanded, batches, labels that were kept."""

    fans: int = 0
    share: float = 0.0
    batches: int = 0
    labels: int = 0


@dataclass
class Label:
    """A way to a place: `time` [s], `cost`, whether a climb costs a turn, half-yos, the last surfacing [s].

    `before` is the number of the label that it continues by the leg `row`, a row of `Edge`.
    """

    place: int
    time: float
    cost: float
    turns: bool
    half: int
    surfaced: float
    before: int = -1
    row: Array | None = None
    open: bool = True


class LabelSearch:
    """A search over the legs of an expansion, from its start; `labels` holds all that were kept, by number.

    `whole`: it did not end because the expansion was spent.
    """

    def __init__(
        self,
        expansion: Expansion,
        cost: Cost,
        rule: Surfacing,
        bound: Bound,
        goals: Index,
        departure: float,
        aim: Aim,
    ) -> None:
        """Prepare a search to any of the places `goals`, to all places where there are none."""
        self.expansion, self.rule, self.bound, self.aim = expansion, rule, bound, aim
        places = expansion.places
        self.height, self.up = places[:, 2], places[:, 2] >= -SURFACE
        self.is_goal = np.zeros(len(places), bool)
        self.is_goal[goals] = True
        self.inflection = cost.inflection(places[:, 2])
        self.per_second, self.per_leg = cost.kernel()
        self.priced = self.inflection is not None and (aim.by_cost or aim.front or math.isfinite(aim.cost_below))
        self.by_cost = aim.by_cost and self.priced
        self.left = self.cost_left = np.zeros(len(places))
        if goals.size:
            self.left, self.cost_left = bound.remaining(goals, cost)
        steps = np.diff(np.unique(self.height))
        self.shortest = float(steps.min(initial=0.0 if not steps.size else math.inf)) / bound.sink
        columns = 1 + 2 * self.priced + (rule.most_yos is not None) + (rule.most_hours is not None)
        columns += 2 * (aim.bins is not None)
        self.best = np.full((len(places), 1, columns), math.inf)
        self.holder = np.full((len(places), 1), -1)
        self.labels: list[Label] = []
        self.queue: list[tuple[float, float, int, int]] = []
        self.fans: dict[int, Fan] = {}
        self.expanded = np.zeros(len(places), bool)
        self.tally = Tally()
        self.whole = True
        self.below = aim.below
        self.cost_below = aim.cost_below
        self.began = departure
        first = Label(expansion.start, departure, 0.0, True, 0, departure)
        self._keep(first, self._criteria(first.place, departure, 0.0, True, 0, departure))

    def settled(self) -> Iterator[int]:
        """The labels as they become final, the goals' among them; each that is no goal's is then expanded."""
        while self.queue:
            _, _, _, number = heapq.heappop(self.queue)
            label = self.labels[number]
            if not label.open:
                continue
            label.open = False
            final = not self.is_goal[label.place]
            if self.aim.front and not final:
                if label.cost >= self.cost_below:
                    continue
                self.cost_below = label.cost
            yield number
            if final and number not in self.fans and self.expansion.spent:
                self.whole = False
                return
            if final and (label.place < self.expansion.nodes or label.place == self.expansion.start):
                self._relax(number, self._fan(number))

    def hops(self, number: int) -> list[Hop]:
        """The legs that lead to a label."""
        found: list[Hop] = []
        places, label = self.expansion.places, self.labels[number]
        while label.row is not None:
            earlier = self.labels[label.before]
            edge: Edge = edge_of(label.row)
            found.append((places[earlier.place], places[label.place], edge))
            label = earlier
        return found[::-1]

    def _key(self, label: Label) -> float:
        so_far, left = (label.cost, self.cost_left) if self.by_cost else (label.time, self.left)
        return so_far + float(left[label.place])

    def _criteria(
        self, place: "Index | int", time: "Array | float", cost: "Array | float", turns: "Bools | bool",
        half: "Index | int", surfaced: "Array | float",
    ) -> Array:  # fmt: skip
        """What counts of labels, (columns,) or (n, columns): less is better in each."""
        columns: list[Array | float] = [time]
        if self.priced:
            columns += [cost, np.asarray(turns, np.float64)]
        if self.rule.most_yos is not None:
            columns.append(np.asarray(half, np.float64))
        if self.rule.most_hours is not None:
            columns.append(-np.asarray(surfaced))
        if self.aim.bins is not None:
            number = np.floor((np.asarray(time) - self.began) / self.aim.bins)
            columns += [number, -number]
        return np.stack(np.broadcast_arrays(*columns), axis=-1).astype(np.float64)

    def _wanted(self, label: Label) -> Bools:
        """The places to which a leg from a label may be of use, by what it takes at the least."""
        least = self.bound.between(label.place)
        time, cost = label.time + least, label.cost + self.per_leg + self.per_second * least
        wanted = (self.height != self.height[label.place]) & (time <= self.aim.latest)
        wanted &= (cost + self.cost_left if self.by_cost else time + self.left) < self.below
        if self.priced:
            wanted &= cost + self.cost_left < self.cost_below
        if self.aim.bins is None:
            places = np.arange(self.height.size)
            half, surfaced = np.where(self.up, 0, label.half), np.where(self.up, math.inf, label.surfaced)
            at_best = self._criteria(places, time, cost, np.zeros(places.size, bool), half, surfaced)
            wanted &= ~_any_beats(self.best, at_best)
        return np.asarray(wanted)

    def _fan(self, number: int) -> Fan:
        """The legs of a label; those of the labels that follow are found with them."""
        if number not in self.fans:
            batch = self._batch(number)
            labels = [self.labels[n] for n in batch]
            place, time = np.array([one.place for one in labels]), np.array([one.time for one in labels])
            wanted = np.array([self._wanted(one) for one in labels])
            self.fans.update(zip(batch, self.expansion.fans(place, time, wanted), strict=True))
            self.expanded[place] = True
            self.tally.fans += len(batch)
            self.tally.batches += 1
            self.tally.share = float(self.expanded[: self.expansion.nodes].mean())
        return self.fans.pop(number)

    def _batch(self, number: int) -> list[int]:
        """A label and some that follow it: what they are now they stay if no leg is short enough to better them.

        A few are taken all the same, so that all threads have work. Which, depends on nothing but the search.
        """
        first = self.labels[number]
        chosen, seen, earliest = [number], {first.place}, first.time
        looked: list[tuple[float, float, int, int]] = []
        while self.queue and len(chosen) < MOST_AT_ONCE and len(looked) < 2 * MOST_AT_ONCE:
            entry = heapq.heappop(self.queue)
            label = self.labels[entry[-1]]
            if not label.open:
                continue
            looked.append(entry)
            sure = label.time <= earliest + self.shortest
            if entry[0] >= self.below or not (sure or len(chosen) < AT_ONCE):
                break
            waits = entry[-1] not in self.fans and label.place not in seen and not self.is_goal[label.place]
            if waits and label.place < self.expansion.nodes:
                chosen.append(entry[-1])
                seen.add(label.place)
                earliest = min(earliest, label.time)
        for entry in looked:
            heapq.heappush(self.queue, entry)
        return chosen

    def _relax(self, number: int, fan: Fan) -> None:
        """Go on from a label by its legs."""
        label, rows, to = self.labels[number], fan.rows, fan.target
        climbs = rows[:, GLIDE_ANGLE] > 0
        time, cost = label.time + rows[:, TIME], label.cost + rows[:, COST]
        if label.turns and self.inflection is not None:
            cost = cost + np.where(climbs, self.inflection[label.place], 0.0)
        half = label.half + (climbs != (label.half % 2 == 1))
        fits = time <= self.aim.latest
        if self.rule.most_yos is not None:
            fits &= half < 2 * self.rule.most_yos
        if self.rule.most_hours is not None:
            fits &= time - label.surfaced <= HOUR * self.rule.most_hours
        fits &= (cost + self.cost_left[to] if self.by_cost else time + self.left[to]) < self.below
        if self.priced:
            fits &= cost + self.cost_left[to] < self.cost_below
        half, surfaced = np.where(self.up[to], 0, half), np.where(self.up[to], time, label.surfaced)
        criteria = self._criteria(to, time, cost, ~climbs, half, surfaced)
        fits &= ~_any_beats(self.best[to], criteria)
        for n in np.flatnonzero(fits):
            # a fan may hold two legs to one place: its own, and that from end to end
            if np.all(self.best[to[n]] <= criteria[n], axis=1).any():
                continue
            new = Label(
                int(to[n]), float(time[n]), float(cost[n]), not climbs[n], int(half[n]), float(surfaced[n]),
                number, rows[n],
            )  # fmt: skip
            self._keep(new, criteria[n])

    def _keep(self, label: Label, criteria: Array) -> None:
        """Put a label in its place, and drop those that it beats."""
        place, number = label.place, len(self.labels)
        beaten = (criteria <= self.best[place]).all(axis=1)
        for other in self.holder[place][beaten & (self.holder[place] >= 0)]:
            self.labels[other].open = False
            self.fans.pop(int(other), None)
        self.best[place][beaten], self.holder[place][beaten] = math.inf, -1
        free = np.flatnonzero(self.holder[place] < 0)
        if not free.size:
            self.best = np.concatenate([self.best, np.full_like(self.best, math.inf)], axis=1)
            self.holder = np.concatenate([self.holder, np.full_like(self.holder, -1)], axis=1)
            free = np.flatnonzero(self.holder[place] < 0)
        self.best[place, free[0]], self.holder[place, free[0]] = criteria, number
        self.labels.append(label)
        self.tally.labels += 1
        key = self._key(label)
        if self.is_goal[place] and not self.aim.front:
            # others may tie with the best so far, none of them is better
            self.below = min(self.below, key + 1e-9)
        heapq.heappush(self.queue, (key, label.time, place, number))


def _any_beats(held: Array, criteria: Array) -> Bools:
    """Whether any row held at each place (n, m, columns) is nowhere worse than what comes (n, columns)."""
    nowhere_worse = np.all(held <= criteria[:, None, :], axis=2)
    return np.asarray(np.any(nowhere_worse, axis=1), np.bool_)
