"""The range of a variable's values that a file declares: what lies outside is no data."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float32]
WIDE = 2.0
"""A range that holds all currents up to this speed [m/s] is what its maker takes for possible. A narrower one is
often that of another day's file."""


def outside_range(variable: Any, values: Values, factor: float) -> tuple[Values, tuple[str, ...]]:
    """Values, NaN where they lie outside a wide `valid_range`, or `valid_min` and `valid_max`; a note on them.

    CF conventions, 2.5.1. `factor`: m/s in their unit. Of a narrow range only the note is given.
    """
    limits = _limits(variable)
    if limits is None:
        return values, ()
    low, high = limits
    # a packed limit, unpacked, may differ from the same packed value in its last bits
    slack = 1e-6 * max(abs(one) for one in limits if np.isfinite(one))
    with np.errstate(invalid="ignore"):
        beyond = (values < low - slack) | (values > high + slack)
    if not beyond.any():
        return values, ()
    told = f"values of `{variable.name}` lie outside the range that it declares, {low:.4g} to {high:.4g}: "
    if low * factor <= -WIDE and high * factor >= WIDE:
        return np.where(beyond, np.float32(np.nan), values), (told + "no data",)
    return values, (told + "believed, since the range is narrower than that of currents",)


def _limits(variable: Any) -> tuple[float, float] | None:
    """The declared range, in the unit of the unpacked values; None where there is none, or it makes no sense."""
    both = _numbers(variable, "valid_range")
    if both is not None and both.size == 2:
        low, high = both
    else:
        least, most = (_numbers(variable, key) for key in ("valid_min", "valid_max"))
        if least is None and most is None:
            return None
        low = -np.inf if least is None else least[0]
        high = np.inf if most is None else most[0]
    return (float(low), float(high)) if low < high else None


def _numbers(variable: Any, key: str) -> NDArray[np.float64] | None:
    """An attribute's numbers, unpacked where they are packed as the data are; None where it has none."""
    given = np.ravel(np.asarray(variable.attrs.get(key, [])))
    if given.size == 0 or given.dtype.kind not in "iuf":
        return None
    stored = np.dtype(variable.encoding.get("dtype", variable.dtype))
    packed = stored.kind in "iu" and given.dtype.kind in "iu"
    if packed and str(variable.encoding.get("_Unsigned", "")).lower() == "true":
        given = given.astype(stored).view(stored.str.replace("i", "u"))
    numbers = given.astype(np.float64)
    if packed:
        numbers = numbers * float(variable.encoding.get("scale_factor", 1.0)) + float(
            variable.encoding.get("add_offset", 0.0)
        )
    return numbers if bool(np.isfinite(numbers).all()) else None
