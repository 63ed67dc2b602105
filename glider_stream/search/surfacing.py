"""Rules of surfacing: a vehicle must come up, for a fix and a call, after so many yos or hours."""

import math
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Array, Index
from ..base.checks import LONGEST
from ..base.settings import require
from .path import SURFACE, Path

BINS = 48
"""Parts of the longest time under water that are told apart; a leg's is rounded up, so the rule always holds."""
MOST_YOS = 100
LEAST_HOURS = 0.001
"""No vehicle comes up twice in four seconds; how often a leg exceeds far less time is too large a number."""


@dataclass(frozen=True)
class Surfacing:
    """At most so many yos (a dive and a climb), and so many hours, from one surfacing to the next.

    Examples:
        >>> rule = glider_stream.Surfacing(most_yos=1)
        >>> path = road.query(surfacing=rule)
        >>> rule.holds(path)
        True
    """

    most_yos: int | None = None
    most_hours: float | None = None

    def __post_init__(self) -> None:
        yos, hours = self.most_yos, self.most_hours
        fits = yos is None or 1 <= yos <= MOST_YOS
        require(fits, f"`most_yos` must be from 1 to {MOST_YOS}; got {yos}")
        least, most = LEAST_HOURS, LONGEST / 3600
        fits = hours is None or least <= hours <= most
        require(fits, f"`most_hours` must be from {least:g} to {most:,.0f} h; got {hours}")

    @property
    def counts(self) -> tuple[int, int]:
        """How many states of either measure there are: half-yos, in which it dives and climbs by turns; time."""
        return 1 if self.most_yos is None else 2 * self.most_yos, 1 if self.most_hours is None else BINS + 1

    def check_end(self, place: Array, name: str) -> None:
        """InputError where there is a rule, and an end of a route (3,) [m] is not at the surface."""
        up = self == Surfacing() or float(place[2]) >= -SURFACE
        require(
            up, f"a route with a rule of surfacings has its {name} at the surface; got a depth of {-place[2]:g} m"
        )

    def holds(self, path: Path) -> bool:
        """Whether a path keeps the rule, each leg's time as it is."""
        yos, hours, climbing = 0, 0.0, False
        for leg in path.legs:
            turns, climbing = leg.glide_angle > 0 and not climbing, leg.glide_angle > 0
            yos, hours = yos + turns, hours + leg.duration / 3600
            if yos > (self.most_yos or math.inf) or hours > (self.most_hours or math.inf):
                return False
            if leg.end[2] >= -SURFACE:
                yos, hours, climbing = 0, 0.0, False
        return True

    def steps(self, half: int, glide_angle: Array, time: Array) -> tuple[Index, Index]:
        """By how much legs (n,) use up either measure, in a half-yo (odd ones climb); time in parts."""
        none = np.zeros(len(time), np.int64)
        turns = none if self.most_yos is None else ((glide_angle > 0) != (half % 2 == 1)).astype(np.int64)
        if self.most_hours is None:
            return turns, none
        parts = np.ceil(np.nan_to_num(time) / (3600 * self.most_hours / BINS) - 1e-9)
        # a leg longer than all of it breaks the rule, however much longer it is
        return turns, np.minimum(parts, BINS + 1).astype(np.int64)
