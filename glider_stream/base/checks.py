"""Bounds that hold in every scenario, and checks that name the value that breaks them."""

from .settings import require

Range = tuple[float, float]

LONGEST = 1e9
"""The longest time [s] that a scenario may name: clocks cannot show microseconds beyond it."""

WIDEST = 1e9
"""The longest side [m] that a box may have."""

FASTEST = 100.0
"""The greatest speed [m/s] that can be a current; anything faster is an error of the input."""


def check_range(bounds: Range, where: str) -> None:
    """Raise InputError unless lo < hi and the range is not too wide."""
    require(bounds[0] < bounds[1], f"`{where}` must rise; got [{bounds[0]:g}, {bounds[1]:g}]")
    wide = bounds[1] - bounds[0] > WIDEST
    require(not wide, f"`{where}` must span {WIDEST:g} at most; got [{bounds[0]:g}, {bounds[1]:g}]")


def require_positive(value: float, where: str) -> None:
    """Raise InputError unless the value is above zero."""
    require(value > 0, f"`{where}` must be above 0; got {value:g}")
