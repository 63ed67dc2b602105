"""Edges that are read when they are needed, against the whole arrays."""

import numpy as np
import pytest

from glider_stream.base.errors import InputError
from glider_stream.roadmap.rows import EdgeRows

EDGES, BLOCK = 95, 10


class Source:
    """Edges in memory, which counts what is read and refuses NaN."""

    def __init__(self):
        random = np.random.default_rng(0)
        self.indptr = np.concatenate([[0, 0], np.sort(random.integers(0, EDGES, 28)), [EDGES]])
        self.target, self.time = random.integers(0, 30, EDGES).astype(np.int32), random.uniform(0, 9, EDGES)
        self.spans, self.checked = [], []

    def read(self, spans, target, time):
        self.spans += spans
        for first, last in spans:
            target[first:last], time[first:last] = self.target[first:last], self.time[first:last]

    def check(self, span, indptr, target, time):
        self.checked.append(span)
        if np.isnan(time[slice(*span)]).any():
            raise InputError("damaged")


def test_rows_are_read_once_and_as_they_are():
    source = Source()
    rows = EdgeRows.on_demand(source.indptr, BLOCK, source)
    assert not rows.known.any()
    for wanted, following in (
        (np.array([3, 20]), 1),
        (np.array([3]), 2),
        (np.arange(30), 1),
        (np.array([29]), 2),
    ):
        rows.need(wanted, following)
        for row in wanted:
            edges = slice(source.indptr[row], source.indptr[min(row + following, 30)])
            assert rows.target[edges].tobytes() == source.target[edges].tobytes()
            assert rows.weight[edges].tobytes() == source.time[edges].tobytes()
    read = np.concatenate([np.arange(*span) for span in source.spans])
    assert np.array_equal(np.sort(read), np.arange(EDGES))
    assert rows.known.all()


def test_a_check_reaches_into_the_blocks_beside():
    source = Source()
    rows = EdgeRows.on_demand(np.array([0, 5, 15, 25, EDGES]), BLOCK, source)
    rows.need(np.array([0]))
    rows.need(np.array([2]))
    assert source.spans == [(0, 10), (10, 30)]
    assert source.checked == [(0, 10), (0, 30)]


def test_what_is_damaged_stays_unknown():
    source = Source()
    source.time[12] = np.nan
    rows = EdgeRows.on_demand(np.array([0, 5, 15, EDGES]), BLOCK, source)
    rows.need(np.array([0]))
    for _ in range(2):
        with pytest.raises(InputError, match="damaged"):
            rows.need(np.array([1]))
    assert rows.known.tolist() == [True] + 9 * [False]


def test_edges_in_memory_are_all_known():
    empty = np.empty(0, np.int32), np.empty(0)
    for target, time in ((np.arange(3, dtype=np.int32), np.arange(3.0)), empty):
        rows = EdgeRows.whole(np.array([0, target.size]), target, time)
        rows.need(np.array([0]))
        assert rows.weight is time
        assert rows.known.all()
