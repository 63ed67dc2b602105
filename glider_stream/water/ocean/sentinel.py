"""No data that a chart does not declare: a number that stands for it, told by how it lies among the others."""

import numpy as np

from ...base.arrays import Array, Bools

DEEPEST = 11_100.0
"""No sea is as deep [m], nor any land as high: whatever lies beyond is no data."""
CODES = frozenset({999.0, 9999.0, 10_000.0, 99_999.0, 32_767.0, 32_768.0, 8888.0, 7777.0})
"""Numbers, of either sign, that stand for no data in files; or for depths, where they lie among such."""
CLIFF = 5000.0
"""No seabed falls as far everywhere from one cell to the next [m]."""
BESIDE = 3.0
"""A code lies so many times further from its neighbours than others do from theirs ..."""
LEAST = 50.0
"""... and at least this far [m]."""
FLAT = 0.2
"""A chart with a smaller share of equal neighbours is not flat: a block of one number in it was put there."""


def _pairs(values: Array) -> tuple[Array, Array]:
    """Neighbours along rows and across them, (n,) each."""
    first = np.concatenate([values[:, :-1].ravel(), values[:-1].ravel()])
    second = np.concatenate([values[:, 1:].ravel(), values[1:].ravel()])
    both = np.isfinite(first) & np.isfinite(second)
    return first[both], second[both]


def _stands_apart(value: float, first: Array, second: Array, values: Array) -> bool:
    """Whether a number lies among others as no depth does."""
    one, other = first == value, second == value
    edge, away = one ^ other, ~(one | other)
    jumps, usual = np.abs(first - second)[edge], np.abs(first - second)[away]
    if not edge.any():
        # nothing but this number: only where no sea is as deep
        return abs(value) >= 9999.0
    typical = float(np.quantile(usual, 0.9)) if usual.size else 0.0
    least = float(np.quantile(jumps, 0.1))
    if abs(value) in CODES and least > max(LEAST, BESIDE * typical):
        return True
    if least > max(CLIFF, BESIDE * typical):
        return True
    equal = float((usual == 0).mean()) if usual.size else 1.0
    here = values == value
    block = bool((here[:-2, :-2] & here[2:, 2:] & here[1:-1, 1:-1] & here[2:, :-2] & here[:-2, 2:]).any())
    return abs(value) in CODES and block and equal < FLAT


def undeclared(values: Array) -> tuple[Bools, list[float]]:
    """Where a chart (ny, nx) [its unit, metres] holds no data without saying so, and the numbers that say it.

    Numbers deeper than any sea or higher than any land; and one number, repeated, that stands apart: a code
    such as -9999 that is far from what lies beside it, or any that falls further than a seabed can.
    """
    known = np.isfinite(values)
    beyond = known & (np.abs(values) > DEEPEST)
    found = [float(value) for value in np.unique(values[beyond])[:4]]
    rest = np.where(beyond, np.nan, values)
    held = np.unique(rest[np.isfinite(rest)])
    candidates = [float(value) for value in held if abs(value) in CODES]
    candidates += [float(value) for value in held[[0, -1]] if held.size and float(value) not in candidates]
    for value in candidates:
        here = rest == value
        # most of a chart is sea; a code may be all that a domain holds
        few = abs(value) in CODES or 2 * int(here.sum()) < int(np.isfinite(rest).sum())
        if few and _stands_apart(value, *_pairs(rest), rest):
            rest = np.where(here, np.nan, rest)
            found.append(value)
    return known & np.isnan(rest), found
