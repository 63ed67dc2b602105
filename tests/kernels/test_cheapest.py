"""Cheapest ways by A*, over edges that may be read on the way, against scipy's Dijkstra over all of them."""

import math

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from glider_stream.kernels.cheapest import Ahead, Rows, cheapest_ways
from glider_stream.search.least_time import NOTHING_AHEAD

NODES, BLOCK = 60, 7


def network(seed):
    """Places on a line and three depths, legs whose whole seconds make many ways equally long, costs of turns."""
    rng = np.random.default_rng(seed)
    position = np.column_stack([rng.integers(0, 12, NODES), np.zeros(NODES), -rng.integers(0, 3, NODES)]).astype(
        float
    )
    linked = (rng.random((NODES, NODES)) < 0.2) & (position[:, None, 2] != position[:, 2])
    source, target = np.nonzero(linked)
    apart = np.abs(position[source] - position[target]).max(axis=1)
    weight = apart + rng.integers(0, 3, target.size)
    indptr = np.concatenate([[0], np.cumsum(linked.sum(axis=1))])
    return position, indptr, target.astype(np.int32), weight, rng.integers(0, 4, NODES).astype(float)


def states_of(position, indptr, target, weight, turn):
    """The same legs, each once for every state of its node, for a search that knows no turns: CSR."""
    source = np.repeat(np.arange(NODES), np.diff(indptr))
    climbs = position[target, 2] > position[source, 2]
    rows = [
        (2 * source + phase, np.where(climbs & (phase == 0), weight + turn[source], weight)) for phase in (0, 1)
    ]
    begins, adds = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    ends = np.tile(2 * target + climbs, 2)
    return csr_array((adds, (begins, ends)), shape=(2 * NODES, 2 * NODES))


def bound(position, goal):
    """No leg is faster than a metre a second along the line, or down."""
    line = np.arange(-1.0, 14.0)
    goals = np.array([position[goal, 0], -position[goal, 0]])
    return Ahead(
        np.array([[1.0, -1.0], [0.0, 0.0]]), np.array([-1.0, -13.0]), 1.0, np.stack([line, line - 12.0]), goals,
        position[goal, 2], 1.0, 1.0, 0.0,
    )  # fmt: skip


def search(position, indptr, target, weight, turn, start, goal, ahead, block):
    """What each state takes and the state before it; which blocks were read."""
    states = NODES * (2 if turn.size else 1)
    spent, before, last = np.full(states, np.inf), np.full(states, states), np.full(states, np.inf)
    spent[start * states // NODES] = 0.0
    if goal is not None:
        last[goal * states // NODES : (goal + 1) * states // NODES] = 0.0
    known = np.zeros(-(-target.size // block), bool)
    seen, ends = (
        np.full(weight.size, np.nan),
        (last, np.full(NODES, np.nan), spent, before, np.zeros(states, bool)),
    )
    wanted = np.empty(3, np.int64)
    edges = indptr, target, seen, block
    while count := cheapest_ways(Rows(*edges, known.copy()), position, turn, ahead, *ends, wanted):
        for node in wanted[:count]:
            for n in range(indptr[node] // block, (indptr[node + 1] - 1) // block + 1):
                known[n] = True
                seen[n * block :][:block] = weight[n * block :][:block]
    return spent, before, known


def way(before, state):
    """The states of a way, backward; the last one is beyond all states."""
    found = [int(state)]
    while found[-1] < before.size:
        found.append(int(before[found[-1]]))
    return found


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("turns", [False, True])
def test_ways_are_those_of_dijkstra_whatever_is_read_and_bounded(seed, turns):
    """Bit by bit; of equally good predecessors, the one reached sooner, then the lower number."""
    position, indptr, target, weight, turn = network(seed)
    turn = turn if turns else np.empty(0)
    graph = csr_array((weight, target, indptr), shape=(NODES, NODES))
    graph = states_of(position, indptr, target, weight, turn) if turns else graph
    phases, legs = 1 + turns, graph.tocoo()
    best, direct = dijkstra(graph, indices=[0], return_predecessors=True)
    best, direct, ties = best[0], direct[0], 0
    spent, before, _ = search(position, indptr, target, weight, turn, 0, None, NOTHING_AHEAD, weight.size)
    assert spent.tobytes() == best.tobytes()
    for state in np.flatnonzero(np.isfinite(best)):
        into = legs.col == state
        good = legs.row[into][best[legs.row[into]] + legs.data[into] == best[state]]
        ties += good.size > 1
        if good.size and state:
            assert before[state] == min(good, key=lambda one: (best[one], one))
            assert good.size > 1 or before[state] == direct[state]
    assert ties > 5
    read = []
    for goal in np.flatnonzero(np.isfinite(best.reshape(-1, phases).min(axis=1)))[1:]:
        state = phases * goal + int(np.argmin(best[phases * goal : phases * (goal + 1)]))
        for ahead in (NOTHING_AHEAD, bound(position, goal)):
            some, ways, known = search(position, indptr, target, weight, turn, 0, goal, ahead, BLOCK)
            assert some[state] == best[state]
            assert way(ways, state) == way(before, state)
            read.append(known.mean())
    assert np.mean(read[1::2]) < np.mean(read[::2]) < 1.0


def test_a_last_leg_to_a_goal_beside_the_nodes_ends_the_search():
    position, indptr, target, weight, none = *network(0)[:4], np.empty(0)
    spent, before, last = np.full(NODES, np.inf), np.full(NODES, NODES), np.full(NODES, np.inf)
    spent[[3, 8]] = 2.0, 1.0  # a start beside the nodes, with two legs to them
    last[3] = 0.5
    ends = last, np.full(NODES, np.nan), spent, before, np.zeros(NODES, bool)
    rows = Rows(indptr, target, weight, weight.size, np.ones(1, bool))
    assert cheapest_ways(rows, position, none, NOTHING_AHEAD, *ends, np.empty(1, np.int64)) == 0
    assert spent[3] + last[3] == 2.5
    settled = ends[-1]
    assert settled[8]
    assert not settled[spent > 2.5].any()
    assert math.isinf(spent[~np.isin(np.arange(NODES), [3, 8, *target[indptr[8] : indptr[9]]])].max())
