"""Samplers: in the box, as many as asked, the same for the same seed, never on land, evenly spread."""

import math
from dataclasses import replace

import numpy as np
import pytest

from glider_stream.base.errors import InputError
from glider_stream.roadmap.nodes import (
    SAMPLERS,
    GridSampler,
    HaltonSampler,
    RandomSampler,
    SobolSampler,
    YoSampler,
)

LO, HI = np.array([-300.0, 50.0, -200.0]), np.array([100.0, 250.0, 0.0])
every_random = pytest.mark.parametrize("sampler", [RandomSampler, SobolSampler, HaltonSampler])


def everywhere(points):
    return np.ones(len(points), bool)


def west(points):
    return points[:, 0] < -200.0


@every_random
@pytest.mark.parametrize("count", [1, 2, 100, 257])
def test_as_many_as_asked_in_the_box(sampler, count):
    points = sampler(count, 3).nodes(LO, HI, everywhere)
    assert points.shape == (count, 3)
    assert ((points >= LO) & (points <= HI)).all()
    assert len(np.unique(points, axis=0)) == count


@every_random
def test_a_seed_is_a_set_of_nodes(sampler):
    first, again, other = (sampler(64, seed).nodes(LO, HI, everywhere) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()


@every_random
def test_land_is_drawn_again(sampler):
    points = sampler(100, 3).nodes(LO, HI, west)
    assert points.shape == (100, 3)
    assert west(points).all()
    # those that were in the water anyway come first
    free = sampler(100, 3).nodes(LO, HI, everywhere)
    kept = free[west(free)]
    np.testing.assert_array_equal(points[: len(kept)], kept)
    assert 5 < len(kept) < 60


@every_random
def test_a_box_of_land_is_refused(sampler):
    with pytest.raises(InputError, match=r"only 0 of \d+ points .*`sampling.count` = 5 needs more"):
        sampler(5, 3).nodes(LO, HI, lambda points: np.zeros(len(points), bool))


@pytest.mark.parametrize("count", [64, 256])
def test_sobol_is_balanced(count):
    shares = (SobolSampler(count, 5).nodes(LO, HI, everywhere) - LO) / (HI - LO)
    octants = np.histogramdd(shares, [2, 2, 2], [(0, 1)] * 3)[0]
    assert (octants == count / 8).all()
    for axis in range(3):
        assert (np.histogram(shares[:, axis], count, (0, 1))[0] == 1).all()


@pytest.mark.parametrize("sampler", [SobolSampler, HaltonSampler])
def test_low_discrepancy_spreads_more_evenly_than_chance(sampler):
    def worst(kind):
        shares = (kind(512, 5).nodes(LO, HI, everywhere) - LO) / (HI - LO)
        return np.abs(np.histogramdd(shares, [4, 4, 4], [(0, 1)] * 3)[0] - 8).max()

    assert worst(sampler) < 0.6 * worst(RandomSampler)


def test_uniform_fills_the_box():
    points = RandomSampler(20_000, 5).nodes(LO, HI, everywhere)
    np.testing.assert_allclose(points.mean(axis=0), (LO + HI) / 2, atol=0.01 * np.max(HI - LO))
    np.testing.assert_allclose(points.std(axis=0), (HI - LO) / np.sqrt(12), rtol=0.02)


def test_grid_is_cell_centred_with_levels_from_end_to_end():
    points = GridSampler((4, 2, 3)).nodes(LO, HI, everywhere)
    assert points.shape == (24, 3)
    assert sorted(set(points[:, 0])) == [-250.0, -150.0, -50.0, 50.0]
    assert sorted(set(points[:, 1])) == [100.0, 200.0]
    np.testing.assert_array_equal(points[:4, 2], [0.0, -100.0, -200.0, 0.0])
    np.testing.assert_array_equal(points[0], [-250.0, 100.0, 0.0])
    assert len(np.unique(points, axis=0)) == 24


def test_the_papers_grid():
    points = GridSampler((16, 16, 4)).nodes(
        np.array([-450.0, -450.0, -300.0]), np.array([450.0, 450.0, 0.0]), everywhere
    )
    assert len(points) == 1024
    assert sorted(set(points[:, 2])) == [-300.0, -200.0, -100.0, 0.0]
    assert np.abs(points[:, :2]).max() == 450.0 - 900 / 32


def test_grid_leaves_land_out():
    points = GridSampler((4, 2, 3)).nodes(LO, HI, west)
    assert set(points[:, 0]) == {-250.0}
    assert len(points) == 6


def test_grid_of_one_level_lies_at_the_top():
    assert (GridSampler((2, 2, 1)).nodes(LO, HI, everywhere)[:, 2] == 0.0).all()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: RandomSampler(0, 0), "`sampling.count` must be from 1 to 10,000,000; got 0"),
        (lambda: HaltonSampler(5, -1), "`sampling.seed` must be at least 0; got -1"),
        (lambda: GridSampler((3, 0, 1)), r"`sampling.shape` must be at least 1 each way; got \[3, 0, 1\]"),
    ],
)
def test_unusable_samplers_are_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_every_sampler_has_a_name():
    assert set(SAMPLERS.values()) == {GridSampler, RandomSampler, SobolSampler, HaltonSampler, YoSampler}


def test_yo_nodes_lie_where_yos_turn_as_dense_as_legs_are_long():
    lo, hi = np.array([-5000.0, -3000.0, -700.0]), np.array([5000.0, 3000.0, 0.0])
    sampler = YoSampler((0.0, 600.0), per_leg=2.0, jitter=False).for_glide(math.radians(37.5))
    leg = 600.0 / math.tan(math.radians(37.5))
    assert sampler.spacing == pytest.approx(leg / 2)
    nodes = sampler.nodes(lo, hi, lambda points: points[:, 0] < 4000.0)
    assert set(nodes[:, 2]) == {0.0, -600.0}
    assert nodes[:, 0].max() < 4000.0
    for n in range(2):
        steps = np.diff(np.unique(nodes[:, n]))
        assert steps.min() > leg / 2 * 0.9
        assert steps.max() < leg / 2 * 1.1
    loose = replace(sampler, jitter=True).nodes(lo, hi, lambda points: points[:, 0] < 4000.0)
    assert set(loose[:, 2]) == {0.0, -600.0}
    assert abs(len(loose) / len(nodes) - 1) < 0.1
    assert len(np.unique(loose[:, 0])) == len(loose)
    for wrong, words in (
        ({"depths": (0.0, 600.0)}, "one of them"),
        ({"depths": (0.0, 600.0), "spacing": 5.0, "per_leg": 1.0}, "one of them"),
        ({"depths": (600.0,), "spacing": 5.0}, "two or more"),
        ({"depths": (600.0, 0.0), "spacing": 5.0}, "rising"),
        ({"depths": (0.0, 600.0), "spacing": 0.0}, "above 0"),
    ):
        with pytest.raises(InputError, match=words):
            YoSampler(**wrong)
    with pytest.raises(InputError, match="reach 900 m, the domain 700 m"):
        YoSampler((0.0, 900.0), spacing=500.0).nodes(lo, hi, lambda points: points[:, 0] < 1)
    with pytest.raises(InputError, match="take fewer"):
        YoSampler((0.0, 600.0), spacing=0.001).nodes(lo, hi, lambda points: points[:, 0] < 1)
