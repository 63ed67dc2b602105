"""An ocean file, all conventions resolved."""

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
"""What a scenario counts from its epoch stays within the calendar that Python has, years 1 to 9999."""


@dataclass(frozen=True)
class OceanFile:
    """Currents as a file holds them: `u` east, `v` north (nt, nz, ny, nx) [m/s], NaN where there is no data.

    `grid` (ny, nx); `depth` (nz) rises downward [m]; `times` (nt) UTC, or None if unknown; `wet` (nz, ny, nx)
    where there is data at every time. `surface`: the file names no depth, or its one level is held at all;
    `depth` is [0]. `lower` (nz) [m]: how deep the value of each level holds; `top` [m]: how shallow the first.
    `seabed` (ny, nx) [m, downward]: of the model's own depth or of the deepest level with data, inf where the
    data go on to the last level. `took` says what was taken for what, `notes` what else to know.
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
    def words(self) -> tuple[str, ...]:
        """What was assumed of bottom, land, levels and times, for a roadmap to keep."""
        return tuple(
            f"{key}: {self.took[key]}" for key in ("bottom", "land", "levels", "stamps") if key in self.took
        )

    @property
    def steady(self) -> bool:
        """Whether it holds a single time."""
        return self.times is None or self.times.size == 1

    @property
    def time_range(self) -> str:
        """First and last time, for people."""
        if self.times is None:
            return "no time"
        return " to ".join(f"{t}Z" for t in np.unique(self.times[[0, -1]]).astype("datetime64[s]"))


def parse_time(text: str, what: str) -> np.datetime64:
    """An ISO 8601 text as UTC; without a zone it is UTC."""
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
