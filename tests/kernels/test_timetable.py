"""Earliest arrivals over legs whose times change with the departure, against a queue of labels in Python."""

import heapq
import math

import numpy as np
import pytest

from glider_stream.kernels.timetable import corrected, earliest_arrivals, time_between

NOBODY = np.empty(0, np.int64)
NO_BOUND = np.zeros(30)


def table(seed, nodes=30, slices=4):
    """Random legs: departures, indptr, target, time; who leaves earlier arrives no later."""
    rng = np.random.default_rng(seed)
    departures = np.cumsum(rng.uniform(50, 100, slices))
    present = rng.random((nodes, slices, nodes)) < 0.3
    present[np.arange(nodes), :, np.arange(nodes)] = False
    slowest = rng.uniform(10, 300, (nodes, 1, nodes))
    times = slowest + rng.uniform(0, 40, (nodes, slices, nodes))
    degree = present.sum(axis=2).ravel()
    target = np.nonzero(present)[2].astype(np.int32)
    return departures, np.concatenate([[0], np.cumsum(degree)]), target, times[present]


def arrivals(legs, learnt, *ends):
    """Run the search with all edges known; `ends` are goal, least, latest, arrival, before."""
    everything = max(legs[2].size, 1), np.ones(1, bool)
    assert earliest_arrivals(*legs, *everything, *learnt, *ends, np.zeros(30, bool)) == -1


def leg_time(departures, indptr, target, time, node, to, when):
    """The time of a leg by the rules, inf where there is none."""
    slices = departures.size
    known = []
    for k in range(slices):
        row = slice(indptr[node * slices + k], indptr[node * slices + k + 1])
        at = np.flatnonzero(target[row] == to)
        known.append(float(time[row][at[0]]) if at.size else math.inf)
    if when >= departures[-1]:
        return known[-1]
    k = max(int(np.searchsorted(departures, when, side="right")) - 1, 0)
    when = max(when, departures[0])
    share = (when - departures[k]) / (departures[k + 1] - departures[k])
    if math.isfinite(known[k]) and math.isfinite(known[k + 1]):
        return known[k] + share * (known[k + 1] - known[k])
    return known[k] if share < 0.5 else known[k + 1]


def by_labels(legs, start, when):
    nodes = (len(legs[1]) - 1) // legs[0].size
    best = {start: when}
    queue = [(when, start)]
    while queue:
        now, node = heapq.heappop(queue)
        if now > best[node]:
            continue
        for to in range(nodes):
            there = now + leg_time(*legs, node, to, now)
            if there < best.get(to, math.inf):
                best[to] = there
                heapq.heappush(queue, (there, to))
    return [best.get(node, math.inf) for node in range(nodes)]


@pytest.mark.parametrize("when", [0.0, 120.0, 1e4])
@pytest.mark.parametrize("seed", [1, 2])
def test_arrivals_are_those_of_labels(seed, when):
    legs = table(seed)
    arrival, before = np.full(30, np.inf), np.full(30, -1)
    arrival[4] = when
    nothing = np.zeros(31, np.int64), NOBODY, np.empty(0), np.empty(0)
    arrivals(legs, nothing, -1, NO_BOUND, math.inf, arrival, before)
    assert arrival == pytest.approx(by_labels(legs, 4, when))
    for node in np.flatnonzero(before >= 0):
        left = arrival[before[node]]
        assert arrival[node] == pytest.approx(left + leg_time(*legs, before[node], node, left))
    to_one = np.full(30, np.inf)
    to_one[4] = when
    goal = int(np.flatnonzero(before == 4)[0])
    arrivals(legs, nothing, goal, NO_BOUND, math.inf, to_one, before)
    assert to_one[goal] == arrival[goal]


def test_edges_that_become_known_on_the_way_change_nothing():
    departures, indptr, target, time = table(7)
    nothing = np.zeros(31, np.int64), NOBODY, np.empty(0), np.empty(0)
    goal, found = 20, []
    for known in (np.ones(-(-target.size // 5), bool), np.zeros(-(-target.size // 5), bool)):
        ends = np.full(30, np.inf), np.full(30, -1), np.zeros(30, bool)
        ends[0][4] = 60.0
        # what is not known is not read
        seen = np.where(np.repeat(known, 5)[: target.size], time, np.nan)
        edges = departures, indptr, target, seen, 5, known
        while (node := earliest_arrivals(*edges, *nothing, goal, NO_BOUND, math.inf, *ends)) >= 0:
            edge = int(indptr[node * 4 + np.searchsorted(departures, ends[0][node], side="right") - 1])
            block = next(n for n in range(edge // 5, known.size) if not known[n])
            known[block] = True
            seen[block * 5 : block * 5 + 5] = time[block * 5 : block * 5 + 5]
        found.append((*ends, known))
    for whole, later in zip(found[0][:3], found[1][:3], strict=True):
        assert whole.tobytes() == later.tobytes()
    assert 0.1 < found[1][3].mean() < 0.9


def test_a_bound_and_a_deadline_change_no_arrival():
    legs = table(5)
    nothing = np.zeros(31, np.int64), NOBODY, np.empty(0), np.empty(0)
    free = np.full(30, np.inf)
    free[4] = 0.0
    arrivals(legs, nothing, -1, NO_BOUND, math.inf, free, np.full(30, -1))
    goal = int(np.argsort(free)[15])
    # every leg takes 10 s at the least
    least = np.where(np.arange(30) == goal, 0.0, 9.9)
    for latest, arrives in ((math.inf, free[goal]), (free[goal], free[goal]), (free[goal] - 0.1, math.inf)):
        bound, before = np.full(30, np.inf), np.full(30, -1)
        bound[4] = 0.0
        arrivals(legs, nothing, goal, least, latest, bound, before)
        assert bound[goal] == arrives
        assert (bound[np.isfinite(bound)] >= free[np.isfinite(bound)]).all()


def test_what_was_learnt_goes_before_the_slices():
    departures, indptr, target, time = table(3)
    arrival, before = np.full(30, np.inf), np.full(30, -1)
    arrival[0] = departures[1]
    to = int(target[indptr[1]])
    learnt = np.ones(31, np.int64), np.array([to]), departures[[1]].copy(), np.array([1.5])
    learnt[0][0] = 0
    arrivals((departures, indptr, target, time), learnt, -1, NO_BOUND, math.inf, arrival, before)
    assert arrival[to] == departures[1] + 1.5
    assert before[to] == 0


def test_a_leg_that_one_departure_has_belongs_to_the_nearer_half():
    assert time_between(4.0, 0.0, 10.0, 10.0, math.inf) == 10.0
    assert time_between(6.0, 0.0, 10.0, 10.0, math.inf) == math.inf
    assert time_between(6.0, 0.0, math.inf, 10.0, 8.0) == 8.0
    assert time_between(2.5, 0.0, 10.0, 10.0, 20.0) == 12.5
    assert time_between(99.0, 0.0, 10.0, math.inf, math.inf) == 10.0


def test_corrections_are_met_where_they_were_made():
    ends = 0.0, 10.0, 10.0, 20.0
    learnt, times = np.array([4.0, 8.0]), np.array([30.0, math.inf])
    assert corrected(4.0, *ends, learnt, times, 0, 2) == 30.0
    assert corrected(2.0, *ends, learnt, times, 0, 2) == 20.0
    assert corrected(8.0, *ends, learnt, times, 0, 2) == math.inf
    assert corrected(5.0, *ends, learnt, times, 0, 2) == 30.0
    assert corrected(9.5, *ends, learnt, times, 0, 2) == 20.0
