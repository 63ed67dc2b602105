"""A search in bins goes on as long as it comes to new places, and ends some time after the last of them."""

import math

import numpy as np

from glider_stream.kernels.edges import COST, EDGE_COLUMNS, GLIDE_ANGLE, STATUS, TIME
from glider_stream.search.expansion import Fan
from glider_stream.search.labels import Aim, LabelSearch
from glider_stream.search.surfacing import Surfacing
from glider_stream.vehicle.cost import TravelTime

LEG, BIN = 30.0, 1.0


class Chain:
    """Places one after another, a leg apart, and a loop at the start that never ends."""

    nodes, start, spent, chosen = 5, 0, False, slice(None)

    def __init__(self, *, reaches):
        self.places = np.array([[100.0 * n, 0.0, -100.0 * (n % 2)] for n in range(self.nodes)])
        self.reaches, self.asked = reaches, []

    def fans(self, place, time, wanted):
        """From each place to the next, and from the second one back to the first."""
        self.asked += time.tolist()
        return [self.fan(int(at)) for at in place]

    def fan(self, at):
        target = sorted({min(at + 1, self.reaches), max(at - 1, 0)} - {at})
        rows = np.zeros((len(target), EDGE_COLUMNS))
        rows[:, STATUS], rows[:, TIME], rows[:, COST], rows[:, GLIDE_ANGLE] = 0.0, LEG, LEG, 0.5
        return Fan(np.array(target), rows)


class NoBound:
    """Knows nothing of times."""

    sink = 1.0

    def between(self, place, others):
        return np.zeros(Chain.nodes)[others]

    def remaining(self, goals, cost):
        return np.zeros(Chain.nodes), np.zeros(Chain.nodes)


def searched(reaches, patience, latest=10_000.0):
    chain = Chain(reaches=reaches)
    aim = Aim(bins=BIN, latest=latest, patience=patience)
    search = LabelSearch(chain, TravelTime(), Surfacing(), NoBound(), np.array([4]), 0.0, aim)
    found = next((n for n in search.settled() if search.is_goal[search.labels[n].place]), None)
    return (None if found is None else search.labels[found].time), search, chain


def test_each_new_place_gives_more_time():
    """The goal is four legs away, more than the patience: each leg leads to a new place."""
    found, search, _ = searched(4, LEG + 1.0)
    assert found == 4 * LEG
    assert search.until == 5 * LEG + 1.0


def test_without_new_places_the_search_ends():
    found, search, chain = searched(2, 5 * LEG)
    assert found is None
    assert search.whole
    # the last new place is two legs away
    assert search.until == 2 * LEG + 5 * LEG
    assert max(chain.asked) == search.until


def test_without_patience_only_the_latest_time_ends_it():
    found, _, chain = searched(2, math.inf, latest=20 * LEG)
    assert found is None
    assert max(chain.asked) == 20 * LEG
