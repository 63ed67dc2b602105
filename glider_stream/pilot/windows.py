"""Windows: where a vehicle will be in each stretch of time, as vessel traffic services ask."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..base.settings import require
from ..search.path import Path
from ..water.frame import wrapped

HOURS = 12.0
"""A window, unless said otherwise."""
FINEST = 1e6
"""Parts of a degree in which the edge of a window is said."""
MOST_WINDOWS = 100_000


@dataclass(frozen=True)
class Window:
    """From `start` to `end` [s since departure]: the box `west`, `south`, `east`, `north`, and depths [m].

    Degrees where the route is geographic, and east is then above west even across the date line; else x, y [m].
    """

    start: float
    end: float
    west: float
    south: float
    east: float
    north: float
    shallowest: float
    deepest: float
    geographic: bool = False

    def outline(self) -> list[tuple[float, float, float, float]]:
        """West, south, east, north of what it covers within [-180, 180] degrees: two boxes at the date line.

        Rounded outward, by 0.1 m at most, so that no box is empty. As they are where it is not geographic.
        """
        if not self.geographic:
            return [(self.west, self.south, self.east, self.north)]
        west, south = (math.floor(bound * FINEST) / FINEST for bound in (self.west, self.south))
        east, north = ((math.floor(bound * FINEST) + 1) / FINEST for bound in (self.east, self.north))
        turn = float(wrapped(west, 0.0)) - west
        west, east = round(west + turn, 6), round(east + turn, 6)
        if east <= 180:
            return [(west, south, east, north)]
        return [(west, south, 180.0, north), (-180.0, south, round(east - 360, 6), north)]


def windows(path: Path, hours: float = HOURS) -> Iterator[Window]:
    """The boxes of a route, one for each stretch of so many hours; the last one ends where the route does."""
    require(0 < hours < math.inf, f"a window must last more than 0 h; got {hours:g}")
    rows = path.trajectory
    if not len(rows):
        return
    at = rows[:, 1:3]
    if path.lonlat is not None:
        tracks = [leg.track for leg in path.legs if leg.track is not None]
        require(len(tracks) == len(path.legs), "the route does not know its longitudes; query it again")
        at = np.concatenate(tracks)
        at = np.column_stack([wrapped(at[:, 0], float(at[0, 0])), at[:, 1]])
    asked = rows[-1, 0] / (3600 * hours)
    require(
        asked <= MOST_WINDOWS, f"windows of {hours:g} h are more than {MOST_WINDOWS:,} on this route; take longer"
    )
    count = max(1, math.ceil(asked - 1e-9))
    for n in range(count):
        start, end = 3600 * hours * n, min(3600 * hours * (n + 1), float(rows[-1, 0]))
        inside = (rows[:, 0] >= start) & (rows[:, 0] <= end)
        # where the window begins and ends lies between two rows
        edges = [[np.interp(t, rows[:, 0], column) for column in (*at.T, rows[:, 3])] for t in (start, end)]
        places = np.vstack([np.column_stack([at, rows[:, 3]])[inside], edges])
        low, high = places.min(axis=0), places.max(axis=0)
        (west, south, bottom), (east, north, top) = low.tolist(), high.tolist()
        # a leg may miss the surface by the tolerance, and a vehicle does not leave the water
        top, bottom = min(top, 0.0), min(bottom, 0.0)
        yield Window(start, end, west, south, east, north, 0.0 - top, 0.0 - bottom, path.lonlat is not None)
