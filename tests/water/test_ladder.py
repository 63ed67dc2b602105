"""The ladder of a file's currents: as few steps as its bound allows, and a bound that holds."""

import itertools

import numpy as np
import pytest

from glider_stream.kernels.flow import FANS, LEGS
from glider_stream.water.ocean.ladder import (
    MOST_PASSED,
    SHIFTS,
    bends,
    fewest_steps,
    ladder_of,
    most_shift,
    step_errors,
)

LEVELS = -np.array([260.0, 180.0, 130.0, 90.0, 55.0, 34.0, 21.0, 13.0, 8.0, 4.0, 1.5])


@pytest.fixture(scope="module")
def columns():
    """Profiles with a shallow jet: (times, levels, ni, nj, 2) [m/s]."""
    noise = np.random.default_rng(2).normal(0, 0.02, (2, LEVELS.size, 4, 5, 2))
    return noise + 0.3 * np.exp(-((LEVELS + 30) ** 2) / 200)[:, None, None, None]


def errors_of(columns, low, high):
    """Errors of Simpson's rule from one height to another, against exact sums of layers (..., 2) [m^2/s]."""

    def at(z):
        return np.apply_along_axis(lambda profile: np.interp(z, LEVELS, profile), 1, columns)

    ends = np.unique(np.concatenate([[low, high], LEVELS[(low < LEVELS) & (high > LEVELS)]]))
    exact = ((ends[1:] - ends[:-1])[:, None, None, None] * (at(ends)[:, 1:] + at(ends)[:, :-1]) / 2).sum(axis=1)
    first, middle, last = np.moveaxis(at(np.array([low, (low + high) / 2, high])), 1, 0)
    return (high - low) * (first + 4 * middle + last) / 6 - exact


def test_no_step_errs_by_more_than_its_bound(columns):
    bend = bends(columns, LEVELS)
    bound = step_errors(LEVELS, bend)
    for low, high in itertools.combinations(range(LEVELS.size), 2):
        off = np.hypot(*np.moveaxis(errors_of(columns, LEVELS[low], LEVELS[high]), -1, 0)).max()
        assert off <= bound[low, high] * (1 + 1e-9) + 1e-12
        assert high > low + 1 or off < 1e-12
    rng, ends = np.random.default_rng(5), None
    path = fewest_steps(bound, SHIFTS[FANS])
    most = most_shift(bound, LEVELS, bend, path)
    for _ in range(40):  # from anywhere to anywhere, by the rungs between
        low, high = np.sort(rng.uniform(LEVELS[0], LEVELS[-1], 2))
        rungs = LEVELS[path]
        ends = np.concatenate([[low], rungs[(rungs > low) & (rungs < high)], [high]])
        off = sum(errors_of(columns, *step) for step in itertools.pairwise(ends))
        assert np.hypot(*np.moveaxis(off, -1, 0)).max() <= most


def test_no_fewer_steps_keep_to_the_bound(columns):
    error = step_errors(LEVELS, bends(columns, LEVELS))
    for most in (0.001, 0.03, 0.3, 3.0):
        path = fewest_steps(error, most)
        assert sum(error[step] for step in itertools.pairwise(path)) <= most
        inner = range(1, LEVELS.size - 1)
        for chosen in itertools.combinations(inner, max(len(path) - 3, 0)):
            fewer = [0, *chosen, LEVELS.size - 1]
            assert len(fewer) >= len(path) or sum(error[step] for step in itertools.pairwise(fewer)) > most


def test_rungs_lead_from_each_layer_to_the_next_ones(columns):
    ladder = ladder_of(columns, LEVELS, np.array([0.0, 3600.0]), 5000.0)
    down, up = ladder.rungs[LEGS].T
    assert (down[0], up[-1], up[0]) == (-np.inf, np.inf, LEVELS[0])
    assert (down[1:] <= LEVELS).all()
    assert (up[:-1] >= LEVELS).all()
    assert up[-2] in (0.0, LEVELS[-1])
    assert len(np.unique(ladder.rungs[FANS])) < len(np.unique(ladder.rungs[LEGS]))


def test_cells_and_times_shorten_steps_whatever_the_currents_are(columns):
    longest = [ladder_of(columns, LEVELS, None, spacing).longest for spacing in (6000.0, 1500.0)]
    assert longest == [200.0, 50.0]
    times = np.array([0.0, 600.0])
    assert [ladder_of(each, LEVELS, times, 6000.0).longest for each in (columns, 2 * columns)] == [10.0, 10.0]


def test_of_many_levels_steps_pass_so_many_at_most():
    heights = np.linspace(-500.0, 0.0, 401)
    error = step_errors(heights, np.random.default_rng(4).uniform(0.0, 1e-6, heights.size))
    passed = np.arange(401)[None, :] - np.arange(401)[:, None]
    np.testing.assert_array_equal(np.isfinite(error), (passed > 0) & (passed <= MOST_PASSED))
    path = fewest_steps(error, 100.0)
    assert len(path) == 1 + 400 // MOST_PASSED
    assert fewest_steps(np.full((5, 5), np.nan), 1.0)  # ends, whatever the currents are
