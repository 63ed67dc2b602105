"""Neighbour laws against naive versions: only other depths, ties to the lower number, the PRM* formulas."""

import math

import numpy as np
import pytest
from helpers import reference

from glider_stream.base.errors import InputError
from glider_stream.roadmap.neighbours import AllNodes, Nearest, Radius, as_csr

VOLUME = 600.0 * 600.0 * 300.0


def grid(shape=(5, 4, 3), spacing=(60.0, 60.0, 60.0)):
    lines = [step * np.arange(n) for n, step in zip(shape, spacing, strict=True)]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3) * [1, 1, -1]


def scattered(count=300, seed=0):
    return np.random.default_rng(seed).uniform([-300, -300, -300], [300, 300, 0], (count, 3))


def levelled(count=200, seed=1):
    position = scattered(count, seed)
    position[:, 2] = -100.0 * np.random.default_rng(seed).integers(0, 4, count)
    return position


NODES = {
    "even grid": grid(),
    "the paper's shape": grid((6, 6, 4), (56.25, 56.25, 100.0)),
    "flat grid": grid((4, 4, 3), (90.0, 90.0, 10.0)),
    "random": scattered(),
    "levels": levelled(),
}
every_set = pytest.mark.parametrize("position", NODES.values(), ids=NODES.keys())


@every_set
@pytest.mark.parametrize("k", [1, 2, 5, 12, 27])
def test_nearest_is_the_naive_one(position, k):
    law = Nearest(k).among(position, VOLUME)
    for point in position:
        np.testing.assert_array_equal(law.of(point), reference.nearest(position, point, k))


@every_set
def test_nearest_to_points_that_are_not_nodes(position):
    law = Nearest(9).among(position, VOLUME)
    # halfway between nodes: four and eight of them are as near
    for point in (position[0] + 30.0, position[7] + [30.0, 30.0, 0.0], np.array([55.0, 66.0, -77.0])):
        np.testing.assert_array_equal(law.of(point), reference.nearest(position, point, 9))


@every_set
@pytest.mark.parametrize("radius", [55.0, 65.0, 130.0])
def test_radius_is_the_naive_one(position, radius):
    law = Radius(radius).among(position, VOLUME)
    for point in position[::3]:
        np.testing.assert_array_equal(law.of(point), reference.within(position, point, radius))


@every_set
@pytest.mark.parametrize("law", [Nearest(8), Nearest("prm*"), Radius(150.0), Radius("prm*"), AllNodes()], ids=str)
def test_only_other_depths_rising_and_once(position, law):
    ready = law.among(position, VOLUME)
    for point in position[::5]:
        found = ready.of(point)
        assert (position[found, 2] != point[2]).all()
        assert (np.diff(found) > 0).all()


@every_set
def test_all_is_every_node_at_another_depth(position):
    law = AllNodes().among(position, VOLUME)
    for point in position[::5]:
        assert len(law.of(point)) == (position[:, 2] != point[2]).sum()


def test_fewer_where_there_are_fewer():
    position = grid((2, 1, 2))
    assert list(Nearest(9).among(position, VOLUME).of(position[0])) == [1, 3]
    flat = grid((3, 3, 1))
    for law in (Nearest(4), Radius(1e4), AllNodes()):
        assert law.among(flat, VOLUME).of(flat[0]).size == 0
    alone = np.zeros((1, 3))
    for law in (Nearest(4), Nearest("prm*"), Radius("prm*"), AllNodes()):
        assert law.among(alone, VOLUME).of(alone[0]).size == 0


@pytest.mark.parametrize(("count", "k"), [(2, 3), (10, 9), (300, 21), (1026, 26), (10_000, 34)])
def test_prm_star_number(count, k):
    assert math.ceil(math.e * (1 + 1 / 3) * math.log(count)) == k
    position = scattered(count)
    found = Nearest("prm*").among(position, VOLUME).of(np.array([0.0, 0.0, 5.0]))
    assert len(found) == min(k, count)


@pytest.mark.parametrize("count", [50, 1000])
def test_prm_star_radius(count):
    # gamma = 2 ((1 + 1/d) volume / zeta_d)^(1/d), r = gamma (ln n / n)^(1/d), d = 3
    gamma = 2 * ((1 + 1 / 3) * VOLUME / (4 / 3 * math.pi)) ** (1 / 3)
    radius = gamma * (math.log(count) / count) ** (1 / 3)
    position, centre = scattered(count), np.zeros(3)
    found = Radius("prm*").among(position, VOLUME).of(centre)
    np.testing.assert_array_equal(found, reference.within(position, centre, radius))
    assert len(found) != len(reference.within(position, centre, 0.95 * radius))
    assert len(found) != len(reference.within(position, centre, 1.05 * radius))


def test_rows_become_csr():
    indptr, target = as_csr([np.array([3, 4]), np.array([], np.int64), np.array([1])])
    np.testing.assert_array_equal(indptr, [0, 2, 2, 3])
    np.testing.assert_array_equal(target, [3, 4, 1])
    assert target.dtype == indptr.dtype == np.int64
    indptr, target = as_csr([])
    assert (list(indptr), target.size) == ([0], 0)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Nearest(0), r'`neighbours.k` must be at least 1, or "prm\*"; got 0'),
        (lambda: Radius(0.0), r'`neighbours.radius` must be above 0, or "prm\*"; got 0.0'),
    ],
)
def test_unusable_laws_are_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()
