"""A roadmap of several departures, in a double gyre that swings within an hour."""

import heapq
import math
from dataclasses import replace
from functools import cache

import numpy as np

from glider_stream.kernels.edges import CONNECTED, STATUS, TIME
from glider_stream.roadmap.builder import build_slices
from glider_stream.scenario import read_scenario

FEW_NODES = ["sampling.shape=[13,7,3]", "flow.period=6000.0"]
"""So many that some have legs enough to be followed, and some get fans."""
DEPARTURES = [*FEW_NODES, "departures.first=0", "departures.last=1800", "departures.every=600"]


def problem(*more):
    """The problem of four departures."""
    return read_scenario("swinging-gyre", [*DEPARTURES, *more]).problem()


@cache
def sliced():
    """Its roadmap, built once."""
    return build_slices(problem())


def keys(road):
    """Of the edges of one slice, a number each, by source and target."""
    nodes = len(road.position)
    return np.repeat(np.arange(nodes), np.diff(road.indptr)) * nodes + road.target


def arrival_by_labels(problem, position, start, goal, departure):
    """When the node `goal` is reached from the node `start` [s], each leg found at its own departure."""
    best, queue = {start: departure}, [(departure, start)]
    while queue:
        when, node = heapq.heappop(queue)
        if node == goal:
            return when
        if when > best[node]:
            continue
        found = replace(problem, departure=when, slices=()).legs(position).of(np.array([node]))
        for to, row in zip(found.target, found.outcomes, strict=True):
            if row[STATUS] == CONNECTED and when + row[TIME] < best.get(int(to), math.inf):
                best[int(to)] = when + row[TIME]
                heapq.heappush(queue, (when + row[TIME], int(to)))
    return math.inf
