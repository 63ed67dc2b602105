"""The heights at which steps through a file's currents end, chosen by how the currents bend at the file's levels.

Between two levels a current is linear in height, and a step of RK4 makes next to no error. Over a level at which
its slope changes by b [1/s] a step from z to z + H makes an error of b H^2 K(s) / w [m] at the vertical speed w.
There s is the level's share of H, from its nearer end, and K(s) = |s^2 / 2 - s / 6| is the Peano kernel of
Simpson's rule.
"""

from itertools import pairwise

import numpy as np

from ...base.arrays import Array
from ...kernels.flow import FANS, LEGS, Ladder, OceanGrid

SHIFTS = {LEGS: 0.03, FANS: 4.0}
"""The errors of the steps through all levels may add up to this much [m^2/s], a distance times the vertical
speed."""
CELL_SHARE, TIME_SHARE = 1 / 30, 1 / 60
"""A step is so short that at FASTEST [m/s] it passes this share of a cell, and it lasts this share of the time
between two times of the file. Both are the same for all forecasts on one grid."""
FASTEST = 1.0
MOST_PASSED = 100
"""A step ends at one of so many next heights: files of more levels than that are fine enough."""
WORST_MIDDLE = 24.0
"""K(s) is at most one over this, in the middle of a step."""


def _greatest(change: Array) -> float:
    """Return the greatest length of vectors (..., 2)."""
    return float(np.sqrt((change**2).sum(axis=-1).max(initial=0.0)))


def bends(values: Array, levels: Array) -> Array:
    """Return the most by which the slope of a current changes at each level, (levels,) [1/s].

    `values` (times, levels, ni, nj, 2) [m/s]; above the last level, and below the first, the current is even.
    """
    found, below = np.zeros(levels.size), np.zeros_like(values[:, 0])
    for k in range(levels.size):
        last = k + 1 == levels.size
        above = np.zeros_like(below) if last else (values[:, k + 1] - values[:, k]) / (levels[k + 1] - levels[k])
        found[k] = _greatest(above - below)
        below = above
    return found


def step_errors(heights: Array, bend: Array) -> Array:
    """Return the error times the vertical speed of a step from each height to each higher one, (n, n) [m^2/s].

    inf where no step leads: to a height that is not higher, or that lies more than MOST_PASSED further on.
    """
    error = np.full((heights.size, heights.size), np.inf)
    for low in range(heights.size - 1):
        some = slice(low, low + MOST_PASSED + 1)
        along = heights[some] - heights[low]
        span = along[1:, None]
        share = np.clip(np.minimum(along / span, 1.0 - along / span), 0.0, None)
        kernel = np.abs(share**2 / 2 - share / 6)
        error[low, low + 1 : low + along.size] = (bend[some] * span**2 * kernel).sum(axis=-1)
    return error


def fewest_steps(error: Array, most: float) -> list[int]:
    """Return the indices, rising, of the heights at which steps end: as few as keep the sum of errors to `most`.

    Steps lead from the first height to the last one; `error` (n, n) as `step_errors` gives it.
    """
    n = len(error)
    least, before = np.full(n, np.inf), []
    least[0] = 0.0
    for _ in range(n - 1):  # so many steps, from each height to the next, err nowhere
        if least[-1] <= most:
            break
        total = least[:, None] + error
        before.append(total.argmin(axis=0))
        least = total.min(axis=0)
    path = [n - 1]
    for step in reversed(before):
        path.append(int(step[path[-1]]))
    return path[::-1]


def most_shift(error: Array, heights: Array, bend: Array, path: list[int]) -> float:
    """Return a bound of the sum of errors of all steps of a leg between any two heights [m^2/s].

    Its first step and its last one may begin and end anywhere, and a step that would take too long is cut.
    """
    total, part = 0.0, 0.0
    for low, high in pairwise(path):
        worst = float(bend[low + 1 : high].sum()) * (heights[high] - heights[low]) ** 2 / WORST_MIDDLE
        total += max(float(error[low, high]), worst / 4)
        part = max(part, worst)
    return total + 2 * part


def _bend_in_time(values: Array, times: Array) -> float:
    """Return the most by which the rate of change of a current changes at one of the times [m/s^2]."""
    most, before = 0.0, None
    for n in range(times.size - 1):
        rate = (values[n + 1] - values[n]) / (times[n + 1] - times[n])
        most, before = max(most, 0.0 if before is None else _greatest(rate - before)), rate
    return most


def _in_layers(rungs: Array, levels: Array) -> Array:
    """Return the next rung down and up from each layer, below the lowest level first, (levels + 1, 2) [m]."""
    low = np.concatenate([[-np.inf], levels])
    high = np.concatenate([levels, [np.inf]])
    ends = np.concatenate([[-np.inf], rungs, [np.inf]])
    down = ends[np.searchsorted(ends, low, side="right") - 1]
    return np.stack([down, ends[np.searchsorted(ends, high, side="left")]], axis=-1)


def ladder_of(values: Array, levels: Array, times: Array | None, spacing: float) -> Ladder:
    """Return the ladder of currents (times, levels, ni, nj, 2) [m/s] on rising levels [m], `spacing` [m] apart.

    `times` [s], or None where the currents are steady.
    """
    heights, bend = levels, bends(values, levels)
    if levels[-1] < 0.0:
        heights, bend = np.append(levels, 0.0), np.append(bend, 0.0)
    error = step_errors(heights, bend)
    chosen = [fewest_steps(error, SHIFTS[use]) for use in (LEGS, FANS)]
    rungs = np.stack([_in_layers(heights[each], levels) for each in chosen])
    longest = CELL_SHARE * spacing / FASTEST
    if times is not None:
        longest = min(longest, TIME_SHARE * float(np.diff(times).min()))
    return Ladder(rungs, longest, most_shift(error, heights, bend, chosen[LEGS]))


def kink_shift(flow: OceanGrid, step: float) -> float:
    """Return by how much a side of a cell, or a time of the file, may move the end of a step of `step` [s] [m].

    For a glider that is carried by the fastest current and goes at FASTEST through water.
    """
    fastest = FASTEST + flow.extent.max_speed
    most = max(_greatest(np.diff(now, 2, axis=axis)) for now in flow.values for axis in (1, 2))
    bent = fastest * most / flow.extent.length_scale
    if np.isfinite(flow.extent.t_lo):
        bent += _bend_in_time(flow.values, flow.times)
    return bent * step**2 / WORST_MIDDLE
