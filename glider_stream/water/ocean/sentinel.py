"""Finds undeclared numbers for "no data" in a chart by comparing each number with its neighbours."""

import numpy as np

from ...base.arrays import Array, Bools

DEEPEST = 11_100.0
"""No sea is as deep as this [m] and no land as high; numbers beyond it are no data."""
CODES = frozenset({999.0, 9999.0, 10_000.0, 99_999.0, 32_767.0, 32_768.0, 8888.0, 7777.0})
"""Numbers, of either sign, that files use for no data. They may also be depths among similar depths."""
CLIFF = 5000.0
"""No seabed falls this far [m] from one cell to the next at all its borders."""
BESIDE = 3.0
"""A code differs from its neighbours by this many times the usual difference ..."""
LEAST = 50.0
"""... and at least this far [m]."""
FLAT = 0.2
"""A chart with a smaller share of equal neighbours is not flat: a block of one number in it is artificial."""


def _pairs(values: Array) -> tuple[Array, Array]:
    """Return the pairs of neighbours along and across the rows, (n,) each."""
    first = np.concatenate([values[:, :-1].ravel(), values[:-1].ravel()])
    second = np.concatenate([values[:, 1:].ravel(), values[1:].ravel()])
    both = np.isfinite(first) & np.isfinite(second)
    return first[both], second[both]


def _stands_apart(value: float, first: Array, second: Array, values: Array) -> bool:
    """Return whether a number differs from its neighbours as no depth does."""
    in_first, in_second = first == value, second == value
    edge, away = in_first ^ in_second, ~(in_first | in_second)
    jumps, usual = np.abs(first - second)[edge], np.abs(first - second)[away]
    if not edge.any():
        # the chart holds only this number: it is a code only if no sea is as deep
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
    """Return where a chart (ny, nx) [m] holds undeclared no data, and the numbers that mark it.

    These are numbers deeper than any sea or higher than any land, and one repeated number that stands apart: a
    code such as -9999 that is far from its neighbours, or a number that falls further than a seabed can.
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
        # most of a chart is sea, but a domain may hold nothing but a code
        few = abs(value) in CODES or 2 * int(here.sum()) < int(np.isfinite(rest).sum())
        if few and _stands_apart(value, *_pairs(rest), rest):
            rest = np.where(here, np.nan, rest)
            found.append(value)
    return known & np.isnan(rest), found
