import math

import numpy as np
import pytest

from glider_stream.kernels.cache import entry_point
from glider_stream.kernels.flight import FLIGHT_ROWS, LANE_LEFT, advance, fly_for, hangar, place
from glider_stream.kernels.interpolate import pair_between
from glider_stream.kernels.motion import LANE_X, LANE_Y, LANES, traced
from glider_stream.kernels.place import Place, Velocity


@entry_point()
def landings(flow, starts, through, durations, t, dt):
    """Where flights that share the air end, one lane each."""
    lanes = hangar(FLIGHT_ROWS)
    landed = np.full((len(starts), 2), np.nan)
    for n in range(len(starts)):
        x, y, z = starts[n]
        u, v, w = through[n]
        place(lanes, n, Place(x, y, z, t), Velocity(u, v, w))
        fly_for(lanes, n, durations[n], dt)
    for _ in range(1000):
        advance(flow, lanes)
        for n in range(len(starts)):
            if lanes[LANE_LEFT, n] == 0.0:
                landed[n] = lanes[LANE_X, n], lanes[LANE_Y, n]
    return landed


def flights(count):
    rng = np.random.default_rng(4)
    starts = np.column_stack([rng.uniform(-150, 150, (count, 2)), np.zeros(count)])
    heading, durations = rng.uniform(0, 2 * math.pi, count), rng.uniform(0.5, 300, count)
    durations[0] = 35.0  # whole steps
    through = np.column_stack([0.8 * np.cos(heading), 0.8 * np.sin(heading), np.full(count, -0.4)])
    return starts, through, durations


def test_a_flight_ends_where_its_trace_does(vortices):
    starts, through, durations = flights(LANES)
    landed = landings(vortices, starts, through, durations, 0.0, 5.0)
    for n in range(LANES):
        alone = traced(vortices, Place(*starts[n], 0.0), Velocity(*through[n]), durations[n], 5.0)[-1, 1:3]
        np.testing.assert_allclose(landed[n], alone, rtol=0, atol=1e-9)


def test_flights_know_nothing_of_each_other(vortices):
    starts, through, durations = flights(LANES)
    together = landings(vortices, starts, through, durations, 0.0, 5.0)
    for n in (0, 7, LANES - 1):
        one = slice(n, n + 1)
        np.testing.assert_array_equal(
            landings(vortices, starts[one], through[one], durations[one], 0.0, 5.0)[0], together[n]
        )


def test_a_flight_back_in_time_returns(vortices):
    starts, through, durations = flights(8)
    there = np.column_stack([landings(vortices, starts, through, durations, 0.0, 5.0), -0.4 * durations])
    back = landings(vortices, there, through, -durations, 0.0, 5.0)
    np.testing.assert_allclose(back, starts[:, :2], rtol=0, atol=2e-3)


@entry_point()
def pair_between_compiled(values, cell, weight):
    """`pair_between` as kernels see it."""
    return pair_between(values, cell, weight)


@pytest.mark.parametrize("axes", [2, 3, 4])
def test_interpolation_is_exact_for_what_is_linear_along_every_axis(axes):
    rng = np.random.default_rng(axes)
    shape = rng.integers(3, 6, axes)
    slopes = rng.uniform(-1, 1, (2, axes))
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    values = np.ascontiguousarray(np.stack([np.prod(1 + index * s, axis=-1) for s in slopes], axis=-1))
    for _ in range(20):
        cell, weight = rng.integers(0, shape - 1), rng.random(axes)
        exact = np.prod(1 + (cell + weight) * slopes, axis=1)
        ends = values, tuple(np.uintp(c) for c in cell), tuple(weight)
        np.testing.assert_allclose(pair_between(*ends), exact, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(pair_between_compiled(*ends), exact, rtol=1e-12, atol=1e-12)


def test_an_axis_without_a_weight_is_read_at_its_cell():
    rng = np.random.default_rng(7)
    values = rng.uniform(-1, 1, (3, 4, 5, 2))
    cell, weight = tuple(map(np.uintp, (2, 1, 3))), (0.3, 0.6)
    exact = pair_between(values[2], cell[1:], weight)
    assert pair_between(values, cell, weight) == exact
    np.testing.assert_allclose(pair_between_compiled(values, cell, weight), exact, rtol=1e-14)
