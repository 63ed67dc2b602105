"""Rules of surfacing: a vehicle must come up for a position fix and a call after some yos or hours."""

import math
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Array, Index
from ..base.checks import LONGEST
from ..base.settings import require
from .path import SURFACE, Path

BINS = 48
"""The longest time under water is divided into this many parts. The time of a leg is rounded up to whole parts,
so the rule always holds."""
MOST_YOS = 100
"""The greatest number of yos between two surfacings that a rule may allow."""
LEAST_HOURS = 0.001
"""The smallest limit of hours: no vehicle comes up twice in four seconds, and smaller limits overflow
integers."""


@dataclass(frozen=True)
class Surfacing:
    """At most `most_yos` yos (a dive and a climb) and at most `most_hours` hours from one surfacing to the next.

    None means that there is no limit.

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
        """The number of states of half-yos (dives and climbs in turn), and the number of states of time."""
        return 1 if self.most_yos is None else 2 * self.most_yos, 1 if self.most_hours is None else BINS + 1

    def check_end(self, place: Array, name: str) -> None:
        """Raise InputError if there is a rule and an end of a route (3,) [m] is not at the surface."""
        up = self == Surfacing() or float(place[2]) >= -SURFACE
        require(
            up, f"a route with a rule of surfacings has its {name} at the surface; got a depth of {-place[2]:g} m"
        )

    def holds(self, path: Path) -> bool:
        """Return whether a path keeps the rule; the times of legs are not rounded."""
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
        """Return the half-yos (n,) and the parts of time (n,) that legs use up.

        `half` is the number of the half-yo in which the legs begin; in odd half-yos the glider climbs.
        """
        unused = np.zeros(len(time), np.int64)
        turns = unused if self.most_yos is None else ((glide_angle > 0) != (half % 2 == 1)).astype(np.int64)
        if self.most_hours is None:
            return turns, unused
        parts = np.ceil(np.nan_to_num(time) / (3600 * self.most_hours / BINS) - 1e-9)
        # a leg that is longer than all parts breaks the rule; how much longer does not matter
        return turns, np.minimum(parts, BINS + 1).astype(np.int64)
