"""Cheapest ways over legs that are the same at any time: A*, over rows of edges that may be read on the way."""

import math
from heapq import heapify, heappop, heappush
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cache import entry_point, kernel
from .flow import Array
from .timetable import all_known

ROUNDING = 1.0 + 1e-9
"""A search goes on past its best way by this factor, so that no sum of rounded numbers ends it too soon."""


class Rows(NamedTuple):
    """Edges in CSR form by node; only the blocks of `block` edges are read that are `known` (blocks,)."""

    indptr: NDArray[np.int64]
    target: NDArray[np.int32]
    weight: Array
    block: int
    known: NDArray[np.bool_]


class Ahead(NamedTuple):
    """A lower bound of what a way from a place to the goal adds up; see `search.least_time`.

    Along each of `directions` (2, n) the potential [s] is `time` (n, places), linear between places that lie
    `size` [m] apart from `first` (n,) [m] on; `goal` (n,) [s] are those of the goal, at `height` [m]. No glider
    sinks or climbs faster than `sink` [m/s]. The bound is `per_second` times the least time, plus `per_leg`.
    """

    directions: Array
    first: Array
    size: float
    time: Array
    goal: Array
    height: float
    sink: float
    per_second: float
    per_leg: float


@kernel
def remaining(ahead, place):
    """A lower bound of what a way from a place (3,) [m], which is not the goal, to the goal adds up."""
    most, last = abs(place[2] - ahead.height) / ahead.sink, ahead.time.shape[1] - 1
    for n in range(ahead.goal.size):
        at = (place[0] * ahead.directions[0, n] + place[1] * ahead.directions[1, n] - ahead.first[n]) / ahead.size
        at = min(max(at, 0.0), float(last))  # outside the potentials are constant
        cell = min(int(at), last - 1)
        share = at - cell
        here = (1.0 - share) * ahead.time[n, cell] + share * ahead.time[n, cell + 1]
        most = max(most, ahead.goal[n] - here)
    return ahead.per_second * most + ahead.per_leg


@kernel
def soonest(ahead, position, least, spent, state, phases):
    """The least sum of a way through a state to the goal; `least` (nodes,) keeps bounds, NaN for none yet."""
    node = state // phases
    if math.isnan(least[node]):
        least[node] = remaining(ahead, position[node])
    return spent[state] + least[node]


@kernel
def sooner(spent, one, other):
    """Whether the first of two states counts, from which a place is reached equally well.

    It is the one that is reached sooner, then the lower number. A start that is no node counts before all others.
    """
    if other >= spent.size:
        return False
    return spent[one] < spent[other] or (spent[one] == spent[other] and one < other)


@entry_point(nogil=True)
def cheapest_ways(rows, position, turn, ahead, last, least, spent, before, settled, wanted):
    """A* from the states of which `spent` (states,), what a way to them adds up, is finite.

    Without the costs `turn` (nodes,) of a turn from dive to climb a state is a node. With them state 2 n is node
    n reached by a dive, state 2 n + 1 by a climb; a leg climbs if its target lies higher. `position` (nodes, 3)
    [m]. `last` (states,) is what the last leg from a state to the goal adds, inf if no leg leads there. Fills
    `spent` and `before`, the state from which each was reached; of equally good ones the one that `sooner` tells,
    so that neither the bound `ahead` nor the order of reading changes a way. Ends when nothing better can come,
    or, without a goal, when all that can be reached is reached.

    Returns 0 at the end, or how many nodes it has written to `wanted`: the search comes to them next, each with
    edges in another block that is not known. With these known, and with the same arrays, the next call goes on;
    `least` (nodes,) begins as NaN, `settled` (states,) as false. It also writes to `known`.
    """
    phases = 1 if turn.size == 0 else 2
    best = math.inf
    for s in range(spent.size):
        best = min(best, spent[s] + last[s])
    waiting = [
        (soonest(ahead, position, least, spent, s, phases), s)
        for s in range(spent.size)
        if spent[s] < math.inf and not settled[s]
    ]
    heapify(waiting)
    lacking = 0
    while len(waiting) > 0 and lacking < wanted.size:
        key, state = heappop(waiting)
        if key > best * ROUNDING:
            break
        if settled[state]:
            continue
        node = state // phases
        first, end = rows.indptr[node], rows.indptr[node + 1]
        if not all_known(rows.known, rows.block, first, end):
            rows.known[first // rows.block : (end - 1) // rows.block + 1] = True
            wanted[lacking] = node
            lacking += 1
        if lacking > 0:
            continue  # what is reached later may pass here
        settled[state] = True
        here = spent[state]
        for e in range(first, end):
            to, adds = rows.target[e], rows.weight[e]
            if phases == 2:
                climbs = position[to, 2] > position[node, 2]
                if climbs and state % 2 == 0:
                    adds = adds + turn[node]
                to = 2 * to + (1 if climbs else 0)
            there = here + adds
            if there < spent[to]:
                spent[to], before[to], settled[to] = there, state, False
                best = min(best, there + last[to])
                heappush(waiting, (soonest(ahead, position, least, spent, to, phases), to))
            elif there == spent[to] and here < there and sooner(spent, state, before[to]):
                before[to] = state
    return lacking
