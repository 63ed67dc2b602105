"""The currents of an ocean file after all its conventions are resolved."""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array, Bools
from ...base.errors import InputError
from ...base.settings import require
from .grid import Grid

Times = NDArray[np.datetime64]
YEARS = 1000, 8999
"""The epoch must lie in these years, so that later times stay within Python's calendar, years 1 to 9999."""


@dataclass(frozen=True)
class OceanFile:
    """Currents of a file: `u` east and `v` north (nt, nz, ny, nx) [m/s], NaN where there is no data.

    `grid` (ny, nx): positions. `depth` (nz) [m, downward] rises. `times` (nt) in UTC, or None if unknown. `wet`
    (nz, ny, nx): points with data at every time. `surface`: the file has no depth, or its one level is held at
    all depths; then `depth` is [0]. `lower` (nz) [m]: the depth down to which each level holds. `top` [m]: the
    depth where the first level begins to hold. `seabed` (ny, nx) [m, downward]: from the model's own depth or
    from the deepest level with data; inf where data go on to the last level. `took`: which variables were taken
    for what. `notes`: warnings.
    """

    name: str
    grid: Grid
    depth: Array
    times: Times | None
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    wet: Bools
    surface: bool
    took: dict[str, str]
    notes: tuple[str, ...]
    seabed: Array
    lower: Array
    top: float

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What was assumed about bottom, land, levels and times; a roadmap keeps these texts."""
        return tuple(
            f"{key}: {self.took[key]}" for key in ("bottom", "land", "levels", "stamps") if key in self.took
        )

    @property
    def steady(self) -> bool:
        """Whether it holds a single time."""
        return self.times is None or self.times.size == 1

    @property
    def time_range(self) -> str:
        """The first and the last time, as a text for people."""
        if self.times is None:
            return "no time"
        return " to ".join(f"{t}Z" for t in np.unique(self.times[[0, -1]]).astype("datetime64[s]"))


def parse_time(text: str, what: str) -> np.datetime64:
    """Return an ISO 8601 text as a time in UTC; a text without a zone is in UTC."""
    try:
        when = datetime.fromisoformat(text.strip())
    except (ValueError, AttributeError):
        raise InputError(f"{what} must be a time such as 2024-11-20T12:00:00; got {text!r}") from None
    first, last = YEARS
    fits = first <= when.year <= last
    require(fits, f"{what} must lie in the years {first} to {last}; got {text!r}")
    if when.tzinfo is not None:
        when = when.astimezone(UTC).replace(tzinfo=None)
    return np.datetime64(when, "ms")
