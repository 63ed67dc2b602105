"""Fronts: lines of equal arrival time between a roadmap's nodes, one for each number of hours."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.terrain import Terrain
from .seabed import without_clearance
from .water import Frame, sample_water

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

MOST = 100
"""At most this many lines are drawn; more would be a grey area."""
STRETCHED = 3.0
"""A triangle with a side of this many times the median side is left out: it covers water without nodes."""
EDGE, APART = 0.035, 0.08
"""Labels lie so far from the map's edge and from each other, as shares of its sides."""
HOUR = 3600.0
FRONT = "#7a1f6b"


class Fronts(NamedTuple):
    """Places x, y (n,) [m], the earliest arrival there [s] at any depth, and triangles (m, 3) between them.

    `ways` is a text on the ways that were followed; `frozen`: they meet the current of the departure.
    """

    x: Array
    y: Array
    time: Array
    triangles: NDArray[np.intp]
    ways: str = ""
    frozen: bool = False


def fronts_of(position: Array, arrival: Array, terrain: Terrain) -> Fronts:
    """Return the places of nodes (n, 3) [m] that are reached; `arrival` (n,) [s] is inf if a node is not."""
    from scipy.spatial import Delaunay, QhullError

    known = np.isfinite(arrival)
    places, which = np.unique(np.round(position[known, :2], 3), axis=0, return_inverse=True)
    time = np.full(len(places), math.inf)
    np.minimum.at(time, which.ravel(), arrival[known])
    x, y = places[:, 0], places[:, 1]
    triangles = np.empty((0, 3), np.intp)
    if len(places) >= 3:
        try:
            triangles = Delaunay(places).simplices.astype(np.intp)
        except QhullError:  # all points are on one line
            return Fronts(x, y, time, triangles)
        corners = places[triangles]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        middle = corners.mean(axis=1)
        wet = sample_water(without_clearance(terrain), middle[:, 0], middle[:, 1], 0.0)
        triangles = triangles[wet & (sides.max(axis=1) <= STRETCHED * np.median(sides))]
    return Fronts(x, y, time, triangles)


def front_times(fronts: Fronts, hours: float) -> Array:
    """Return the times [s] of fronts, one every `hours`; InputError if `hours` is far too small."""
    require(0.0 < hours < math.inf, f"`fronts` must be a number of hours above 0; got {hours:g}")
    last = float(fronts.time.max(initial=0.0)) / HOUR
    lines = last / hours
    least = f"give {last / MOST:.2g} hours or more"
    require(
        lines < MOST + 1,
        f"`fronts` every {hours:g} hours would be {lines:.0f} lines until {last:.3g} hours; {least}",
    )
    count = math.floor(lines)
    return np.asarray(np.arange(1, count + 1) * (hours * HOUR), np.float64)


def draw_fronts(ax: "Axes", frame: Frame, fronts: Fronts, hours: float) -> None:
    """Draw the fronts on a map, with labels in hours."""
    levels = front_times(fronts, hours)
    if not levels.size or not fronts.triangles.size:
        return
    from matplotlib.tri import Triangulation

    mesh = Triangulation(fronts.x / frame.unit, fronts.y / frame.unit, fronts.triangles)
    lines: Any = ax.tricontour(
        mesh, fronts.time / HOUR, levels=levels / HOUR, colors=FRONT, linewidths=0.9, zorder=3
    )
    texts = ax.clabel(lines, fmt=lambda level: f"{level:g} h", fontsize=7.5, inline=False)
    for text in texts:
        text.set_bbox({"facecolor": "white", "alpha": 0.75, "pad": 0.6, "linewidth": 0.0})
    _keep_apart(texts, frame)


def _keep_apart(texts: "Sequence[Text]", frame: Frame) -> None:
    """Remove labels that would lie over the map's edge or over another label."""
    low, high = (np.array([frame.x[n], frame.y[n]]) / frame.unit for n in range(2))
    kept: list[Array] = []
    for text in texts:
        place = (np.array(text.get_position()) - low) / (high - low)
        inside = min(place.min(), (1.0 - place).min()) > EDGE
        if inside and all(np.hypot(*(place - other)) > APART for other in kept):
            kept.append(place)
        else:
            text.remove()
