"""A map of the probability to reach each place by a time."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...roadmap.builder import node_positions
from ...search.path import SURFACE
from ...search.query import Planner
from ...search.time_dependent import ClockPlanner
from .candidates import Search


@dataclass(frozen=True)
class Reach:
    """The share (n,) of the members in which a way of glides leads to each place (n, 3) [m] `by` a time [s].

    In each member the way is the fastest in that member's current, so no pilot, who does not know the current,
    reaches a place more often: the shares are an upper bound. The vehicle errs in nothing.
    """

    by: float
    place: Array
    share: Array
    lonlat: Array | None

    def as_dict(self) -> dict[str, Any]:
        """Return the same for JSON."""
        where = self.place if self.lonlat is None else np.column_stack([self.lonlat, 0.0 - self.place[:, 2]])
        name = "place_m" if self.lonlat is None else "lon_lat_depth"
        return {"by_s": self.by, name: where.tolist(), "share_of_members": self.share.tolist()}

    def __str__(self) -> str:
        always, never = int((self.share == 1.0).sum()), int((self.share == 0.0).sum())
        return (
            f"of {len(self.place):,} places, {always:,} can be reached by {self.by / 3600:.2f} h in all members, "
            f"{never:,} in none, by who knows the current"
        )


def reach_of(search: Search, by: float) -> Reach:
    """Return the map for the nodes at the surface; for all nodes if fewer than three lie there."""
    problem = search.ensemble.forecast
    shared = search.shared
    position = node_positions(problem) if shared is None else shared.forecast.position
    count = np.zeros(len(position))
    for n, member in enumerate(search.ensemble.each("reach")):
        if shared is None:
            arrives = ClockPlanner(member, position).arrivals()
        else:
            arrives = Planner(shared.members[n], member).arrivals()
        count += arrives <= by
    up = position[:, 2] >= -SURFACE
    up = up if up.sum() > 2 else np.ones(len(position), bool)
    place = position[up]
    lonlat = None if problem.to_lonlat is None else problem.to_lonlat(place)
    return Reach(by, place, count[up] / search.ensemble.count, lonlat)
