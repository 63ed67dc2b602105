"""Labels: a search that keeps several ways to one place if each of them may lead to the best route.

A label holds a place and the values that matter there: the time, and if asked for the cost, whether a climb would
cost a turn, the half-yos since the last surfacing, and the time of that surfacing. A label is dropped if another
label at the same place is at least as good in every value, because every route on from it is then at least as
good, too. This assumes that a glider that leaves earlier never arrives later. Where that is false, labels in
different bins of time are kept side by side. The search always takes the label with the least sum of time or cost
so far and a lower bound of the rest (Hart, Nilsson and Raphael 1968; Martins 1984, On a multicriteria shortest
path problem). Each label is expanded at its time.
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
"""The least and the greatest number of labels that are expanded together. The least number is taken even if one
of these labels may later be improved by another."""
HOUR = 3600.0


@dataclass(frozen=True)
class Aim:
    """The aim of a search: the least time, or with `by_cost` the least cost; the cost must be below `cost_below`.

    With `front` the search finds every way to the goal for which no other way is better in both. Labels in
    different `bins` [s] of time are kept side by side. No label is later than `latest` [s]. The search ends
    `patience` [s] after the last time at which it comes to a place for the first time. Ways whose arrival [s], or
    cost if `by_cost`, is not less than `below` are dropped.
    """

    by_cost: bool = False
    cost_below: float = math.inf
    front: bool = False
    bins: float | None = None
    latest: float = math.inf
    patience: float = math.inf
    below: float = math.inf


class Bound(Protocol):
    """Lower bounds of the time and cost of a way."""

    @property
    def sink(self) -> float:
        """The greatest vertical speed of any glide [m/s]."""
        ...

    def between(self, place: int, others: Index | slice = slice(None)) -> Array:
        """Return a lower bound of the time (n,) [s] from one place to each of `others` (n,)."""
        ...

    def remaining(self, goals: Index, cost: Cost) -> tuple[Array, Array]:
        """Return lower bounds from each place to the nearest goal: of time (n,) [s], and of cost (n,)."""
        ...


@dataclass
class Tally:
    """The effort of a search: fans, the share of all nodes that were expanded, batches, labels that were kept."""

    fans: int = 0
    share: float = 0.0
    batches: int = 0
    labels: int = 0


@dataclass
class Label:
    """A way to a place: its `time` [s] and `cost`, whether a climb costs a turn, half-yos, last surfacing [s].

    The way continues the label with the number `before` by the leg `row`, which is a row of `Edge`.
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
    """A search over the legs of an expansion, from its start; `labels` holds all labels that were kept.

    `whole` is False if the search ended because the expansion was spent. No label later than `until` [s] is
    expanded.
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
        """Prepare a search to any of the places `goals`; if `goals` is empty, to all places."""
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
        self.until = departure + aim.patience
        self.late: list[tuple[float, float, int, int]] = []
        first = Label(expansion.start, departure, 0.0, True, 0, departure)
        self._keep(first, self._criteria(first.place, departure, 0.0, True, 0, departure))

    def settled(self) -> Iterator[int]:
        """Yield the numbers of labels when they become final; a label that is not at a goal is then expanded."""
        while self.queue:
            entry = heapq.heappop(self.queue)
            number = entry[-1]
            label = self.labels[number]
            if not label.open:
                continue
            if label.time > self.until:
                self.late.append(entry)
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
        """Return the legs that lead from the start to a label."""
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
        """Return the values by which labels are compared, (columns,) or (n, columns); less is better in each."""
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
        """Return a mask of the places to which a leg from a label may be useful, by lower bounds of the leg.

        Only the places that the expansion chooses by it are examined.
        """
        wanted = np.zeros(self.height.size, np.bool_)
        to = self._open_to(label)
        up = self.up[to]
        if not up.size:
            return wanted
        least = self.bound.between(label.place, to)
        time, cost = label.time + least, label.cost + self.per_leg + self.per_second * least
        some = time <= self.aim.latest
        some &= (cost + self.cost_left[to] if self.by_cost else time + self.left[to]) < self.below
        if self.priced:
            some &= cost + self.cost_left[to] < self.cost_below
        if self.aim.bins is None:
            surfaced, turns = np.where(up, math.inf, label.surfaced), np.zeros(up.size, np.bool_)
            at_best = self._criteria(0, time, cost, turns, np.where(up, 0, label.half), surfaced)
            some &= ~_any_beats(self.best[to], at_best)
        wanted[to] = some
        return wanted

    def _open_to(self, label: Label) -> Index:
        """Return the places to which a leg from a label may be useful if it took no time at all."""
        to = np.arange(self.height.size)[self.expansion.chosen]
        open_ = self.height[to] != self.height[label.place]
        if not self.by_cost:
            open_ &= label.time + self.left[to] < self.below
        if self.best.shape[2] == 1:  # time alone counts
            open_ &= self.best[to, :, 0].min(axis=1) > label.time
        return np.asarray(to[open_])

    def _fan(self, number: int) -> Fan:
        """Return the legs of a label; the legs of the labels that follow are found together with them."""
        if number not in self.fans:
            batch = self._batch(number)
            labels = [self.labels[n] for n in batch]
            place, time = np.array([label.place for label in labels]), np.array([label.time for label in labels])
            wanted = np.array([self._wanted(label) for label in labels])
            self.fans.update(zip(batch, self.expansion.fans(place, time, wanted), strict=True))
            self.expanded[place] = True
            self.tally.fans += len(batch)
            self.tally.batches += 1
            self.tally.share = float(self.expanded[: self.expansion.nodes].mean())
        return self.fans.pop(number)

    def _batch(self, number: int) -> list[int]:
        """Return a label and some labels that follow it and that no leg is short enough to improve.

        At least `AT_ONCE` labels are taken, so that all threads have work. The choice depends only on the search.
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
            waits &= label.time <= self.until
            if waits and label.place < self.expansion.nodes:
                chosen.append(entry[-1])
                seen.add(label.place)
                earliest = min(earliest, label.time)
        for entry in looked:
            heapq.heappush(self.queue, entry)
        return chosen

    def _relax(self, number: int, fan: Fan) -> None:
        """Make new labels from a label and the legs that leave it."""
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
            # a fan may hold two legs to one place: one of the roadmap and the direct leg from start to goal
            if np.all(self.best[to[n]] <= criteria[n], axis=1).any():
                continue
            new = Label(
                int(to[n]), float(time[n]), float(cost[n]), not climbs[n], int(half[n]), float(surfaced[n]),
                number, rows[n],
            )  # fmt: skip
            self._keep(new, criteria[n])

    def _keep(self, label: Label, criteria: Array) -> None:
        """Keep a label at its place, and drop the labels that are worse."""
        place, number = label.place, len(self.labels)
        if (self.holder[place] < 0).all():
            self._go_on_until(label.time + self.aim.patience)
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
            # other labels may be as good as the best so far, but no better
            self.below = min(self.below, key + 1e-9)
        heapq.heappush(self.queue, (key, label.time, place, number))

    def _go_on_until(self, time: float) -> None:
        """Let the search go on until `time` [s] if it would end before, and take the late labels back."""
        if time > self.until:
            self.until = time
            for entry in self.late:
                heapq.heappush(self.queue, entry)
            self.late = []


def _any_beats(held: Array, criteria: Array) -> Bools:
    """Return a mask (n,): does any held row (n, m, columns) beat or equal the new row (n, columns) everywhere?"""
    nowhere_worse = np.all(held <= criteria[:, None, :], axis=2)
    return np.asarray(np.any(nowhere_worse, axis=1), np.bool_)
