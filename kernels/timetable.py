"""Timetables: the earliest arrivals over legs whose times are known at some departures, and between them."""

import math
from heapq import heapify, heappop, heappush

import numpy as np

from .cache import entry_point, kernel


@kernel
def time_between(when, early, time_early, late, time_late):
    """The time [s] of a leg that leaves between two departures, linear; inf is that of no leg.

    Of a leg that only one of them has, the nearer one decides.
    """
    if late == math.inf:
        return time_early
    share = (when - early) / (late - early)
    if time_early < math.inf and time_late < math.inf:
        return time_early + share * (time_late - time_early)
    return time_early if share < 0.5 else time_late


@kernel
def corrected(when, early, time_early, late, time_late, learnt, times, first, last):
    """`time_between` with what was learnt[first:last], departures rising, and the leg's times then."""
    for n in range(first, last):
        if learnt[n] < early or learnt[n] > late:
            continue
        if learnt[n] <= when:
            early, time_early = learnt[n], times[n]
        else:
            late, time_late = learnt[n], times[n]
            break
    return time_between(when, early, time_early, late, time_late)


@kernel
def all_known(known, block, first, last):
    """Whether all blocks that hold the edges from `first` to before `last` are known."""
    n = first // block
    while n * block < last:
        if not known[n]:
            return False
        n += 1
    return True


@entry_point(nogil=True)
def earliest_arrivals(
    departures, indptr, target, time, block, known, learnt_first, learnt_target, learnt, learnt_time, goal, least,
    latest, arrival, before, settled,
):  # fmt: skip
    """A* with the clock running: from the nodes whose `arrival` (nodes,) [s] is finite.

    Legs of node n at departures[k] (slices,) [s] are `target`, `time` [indptr[s]:indptr[s + 1]], for the row
    s = n slices + k, targets rising; linear between. What was learnt of the legs of each node, from
    `learnt_first` (nodes + 1,) on by target and departure, goes before. `least` (nodes,) [s] is what remains to
    the goal at the least, never less after a leg by more than the leg takes; nodes from which it cannot be
    reached by `latest` [s] are left out. Fills `arrival` and `before`, the node of each last leg; ends at
    the node `goal`, at none where it is -1. Exact where who leaves earlier does not arrive later.

    Of the edges only the blocks of `block` edges are read that are `known` (blocks,). Returns -1 at the end, or a
    node whose legs lie in another block: with that block known, the same arrays and `settled` (nodes,), which
    begins as false, the next call goes on as if all had been known from the start.
    """
    nodes, slices = arrival.size, departures.size
    # the nodes to look at next, soonest first; of equal ones the lower number
    waiting = [
        (arrival[n] + least[n], n) for n in range(nodes) if not settled[n] and arrival[n] + least[n] < math.inf
    ]
    heapify(waiting)
    while len(waiting) > 0:
        node = heappop(waiting)[1]
        if settled[node]:
            continue
        if node == goal:
            settled[node] = True
            break
        when = arrival[node]
        k = min(max(np.searchsorted(departures, when, side="right") - 1, 0), slices - 1)
        early, late = departures[k], departures[k + 1] if k + 1 < slices else math.inf
        when_there = max(when, early)  # before the first departure as at it
        a, a_last = indptr[node * slices + k], indptr[node * slices + k + 1]
        b, b_last = a_last, indptr[node * slices + k + 2] if k + 1 < slices else a_last
        if not all_known(known, block, a, b_last):
            return node
        settled[node] = True
        while a < a_last or b < b_last:
            to = min(target[a] if a < a_last else nodes, target[b] if b < b_last else nodes)
            time_early, time_late = math.inf, math.inf
            if a < a_last and target[a] == to:
                time_early = time[a]
                a += 1
            if b < b_last and target[b] == to:
                time_late = time[b]
                b += 1
            if settled[to]:
                continue
            first, last = learnt_first[node], learnt_first[node + 1]
            while first < last and learnt_target[first] != to:
                first += 1
            end = first
            while end < last and learnt_target[end] == to:
                end += 1
            takes = corrected(when_there, early, time_early, late, time_late, learnt, learnt_time, first, end)
            if when + takes < arrival[to] and when + takes + least[to] <= latest:
                arrival[to], before[to] = when + takes, node
                heappush(waiting, (when + takes + least[to], to))
    return -1
