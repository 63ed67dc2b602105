"""Quick looks at a whole box say yes only where a look at each of its places does."""

import math

import numpy as np
import pytest

from glider_stream.kernels.cache import entry_point
from glider_stream.kernels.flow import contains, contains_box, grid_index, index_ranges
from glider_stream.kernels.terrain import OpenWater, Seabed, allowed, open_in_box

SIDE = 400.0


def bent_map(seed, side=5):
    """The indices of a turned and bent grid of some 8 by 8 cells, at points of the frame."""
    rng = np.random.default_rng(seed)
    p, q = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side), indexing="ij")
    i = 8.0 * p + 1.5 * q + rng.uniform(-0.2, 0.2, p.shape) - 0.6
    j = 8.0 * q - 1.5 * p + rng.uniform(-0.2, 0.2, p.shape) + 0.9
    return np.stack([i, j], axis=-1), (side - 1) / SIDE


def boxes(count, largest, seed=1):
    """Boxes x_lo, x_hi, y_lo, y_hi [m], some of them beyond the map, some without area."""
    rng = np.random.default_rng(seed)
    low, size = (
        rng.uniform(-220, 200, (count, 2)),
        rng.uniform(0, largest, (count, 2)) * rng.integers(0, 2, (count, 1)),
    )
    return np.column_stack([low[:, 0], low[:, 0] + size[:, 0], low[:, 1], low[:, 1] + size[:, 1]])


def places(box, count=9):
    """Places on a mesh over a box, with its corners."""
    x, y = np.meshgrid(np.linspace(*box[:2], count), np.linspace(*box[2:], count))
    return zip(x.ravel(), y.ravel(), strict=True)


@entry_point()
def _looks(flow, terrain, boxes, z, known, open_):
    for n in range(boxes.shape[0]):
        x_lo, x_hi, y_lo, y_hi = boxes[n]
        known[n] = contains_box(flow, x_lo, x_hi, y_lo, y_hi, 0.0, 100.0)
        open_[n] = open_in_box(terrain, x_lo, x_hi, y_lo, y_hi, z[n])


def looks(flow, terrain, boxes, z):
    known, open_ = np.zeros(len(boxes), np.bool_), np.zeros(len(boxes), np.bool_)
    _looks(flow, terrain, boxes, z, known, open_)
    return known, open_


@pytest.mark.parametrize("seed", [0, 1])
def test_index_ranges_hold_the_indices_of_all_places(seed):
    index_map, per = bent_map(seed)
    frame = -200.0, -200.0, per, per
    for box in boxes(60, 150.0):
        i_lo, i_hi, j_lo, j_hi = index_ranges(index_map, *box, *frame)
        i, j = np.array([grid_index(index_map, x, y, *frame) for x, y in places(box)]).T
        assert i_lo - 1e-12 <= i.min() <= i.max() <= i_hi + 1e-12
        assert j_lo - 1e-12 <= j.min() <= j.max() <= j_hi + 1e-12
        # no looser than one map cell's own bend
        assert i_hi - i_lo <= i.max() - i.min() + 0.4


@pytest.mark.parametrize("seed", [0, 1])
def test_quick_looks_are_right_and_mostly_sure(ocean_of, seed):
    flow = ocean_of(lambda i, j, z, t: (0.0 * i, 0.0 * j))
    index_map, per = bent_map(seed)
    flow = flow._replace(index_map=index_map, per_x=per, per_y=per)
    rng = np.random.default_rng(seed)
    bottom = np.where(rng.random((8, 10)) < 0.1, 5.0, rng.uniform(-400, -150, (8, 10)))
    seabed = Seabed(bottom, 20.0, index_map, per, per, -200.0, -200.0, bottom)
    some, z = boxes(150, 90.0), rng.uniform(-200, -1, 150)
    known, open_ = looks(flow, seabed, some, z)
    for n, box in enumerate(some):
        inside = all(contains(flow, x, y, t) for x, y in places(box) for t in (0.0, 100.0))
        free = all(allowed(seabed, x, y, z[n]) for x, y in places(box))
        # a mesh may miss the corner of a cell, so only what is quickly sure must hold
        assert inside or not known[n]
        assert free or not open_[n]
    assert known.mean() > 0.2
    assert open_.mean() > 0.2


def test_what_has_no_box_is_unsure(ocean_of):
    flow = ocean_of(lambda i, j, z, t: (0.0 * i, 0.0 * j))
    bottom = np.full((2, 2), -1e4)
    seabed = Seabed(bottom, 0.0, flow.index_map, flow.per_x, flow.per_y, -200.0, -200.0, bottom)
    everywhere = np.array([[-math.inf, math.inf, -math.inf, math.inf], [math.nan, 1.0, 0.0, 1.0]])
    known, open_ = looks(flow, seabed, everywhere, np.zeros(2))
    assert not known.any()
    assert not open_.any()
    assert open_in_box(OpenWater(-10.0), *everywhere[0], -10.0)
    assert not open_in_box(OpenWater(-10.0), *everywhere[0], -10.1)
