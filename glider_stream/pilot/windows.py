"""Windows: the area of a vehicle in each stretch of time, which vessel traffic services ask for."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..base.settings import require
from ..search.path import Path
from ..water.frame import wrapped

HOURS = 12.0
"""The default length of a window [h]."""
FINEST = 1e6
"""Edges of windows are rounded to this part of a degree."""
MOST_WINDOWS = 100_000


@dataclass(frozen=True)
class Window:
    """A window: the box and the depths [m] of the vehicle from `start` to `end` [s since departure].

    `west`, `south`, `east` and `north` are in degrees if the route is geographic; then east is greater than west
    even across the date line. Otherwise they are x, y [m].
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
        """Return west, south, east, north within [-180, 180] degrees: two boxes at the date line, else one.

        They are rounded outward by at most 0.1 m, so that no box is empty. If the route is not geographic, the
        box is unchanged.
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
    """Yield the windows of a route, each of `hours`; the last one ends with the route."""
    require(0 < hours < math.inf, f"a window must last more than 0 h; got {hours:g}")
    rows = path.trajectory
    if not len(rows):
        return
    at = rows[:, 1:3]
    if path.lonlat is not None:
        tracks = [leg.track for leg in path.legs if leg.track is not None]
        require(len(tracks) == len(path.legs), "the route does not hold its longitudes; query it again")
        at = np.concatenate(tracks)
        at = np.column_stack([wrapped(at[:, 0], float(at[0, 0])), at[:, 1]])
    needed = rows[-1, 0] / (3600 * hours)
    require(
        needed <= MOST_WINDOWS,
        f"windows of {hours:g} h are more than {MOST_WINDOWS:,} on this route; choose longer windows",
    )
    count = max(1, math.ceil(needed - 1e-9))
    for n in range(count):
        start, end = 3600 * hours * n, min(3600 * hours * (n + 1), float(rows[-1, 0]))
        inside = (rows[:, 0] >= start) & (rows[:, 0] <= end)
        # a window begins and ends between two rows of the trajectory
        edges = [[np.interp(t, rows[:, 0], column) for column in (*at.T, rows[:, 3])] for t in (start, end)]
        places = np.vstack([np.column_stack([at, rows[:, 3]])[inside], edges])
        low, high = places.min(axis=0), places.max(axis=0)
        (west, south, bottom), (east, north, top) = low.tolist(), high.tolist()
        # a leg may pass the surface by the tolerance, but a vehicle does not leave the water
        top, bottom = min(top, 0.0), min(bottom, 0.0)
        yield Window(start, end, west, south, east, north, 0.0 - top, 0.0 - bottom, path.lonlat is not None)
