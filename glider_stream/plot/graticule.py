"""Longitudes and latitudes on a map that is drawn in metres."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import Array
from .canvas import INK
from .water import Frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEPS = (30.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
"""The allowed distances of two lines [degrees]."""
FINE = 120  # cells along the longer side


def round_degrees(low: float, high: float, most: int) -> Array:
    """Return round angles [degrees] from low to high, with the finest step that gives at most `most`."""
    fits = [step for step in STEPS if np.floor(high / step) - np.ceil(low / step) + 1 <= most]
    step = min(fits, default=STEPS[0])
    angles: Array = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    return np.round(angles, 6)


def named(angle: float, letters: str) -> str:
    """Return an angle [degrees] as text with the letter of its side; without a letter at 0 and 180."""
    angle = (angle + 180.0) % 360.0 - 180.0
    text = f"{round(abs(angle), 4):g}°"
    return text if abs(angle) < 1e-9 or abs(angle) == 180.0 else text + letters[int(angle < 0)]


def draw_graticule(ax: "Axes", frame: Frame) -> None:
    """Draw ticks where round longitudes and latitudes meet the map's lower and left side, and fine lines."""
    if frame.to_lonlat is None:
        return
    x, y = frame.mesh(FINE)
    lonlat = frame.to_lonlat(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])).reshape(*x.shape, 2)
    lon, lat = lonlat[..., 0], lonlat[..., 1]
    below, beside = (np.linspace(*side, 2 * FINE) for side in (frame.x, frame.y))
    south = frame.to_lonlat(np.column_stack([below, np.full_like(below, frame.y[0]), np.zeros_like(below)]))
    west = frame.to_lonlat(np.column_stack([np.full_like(beside, frame.x[0]), beside, np.zeros_like(beside)]))
    meridians, parallels = round_degrees(lon.min(), lon.max(), 4), round_degrees(lat.min(), lat.max(), 5)
    for angles, edge, along, axis, letters in (
        (meridians, south[:, 0], below, ax.xaxis, "EW"),
        (parallels, west[:, 1], beside, ax.yaxis, "NS"),
    ):
        visible = angles[(angles >= edge[0]) & (angles <= edge[-1])]
        ticks = np.interp(visible, edge, along) / frame.unit
        axis.set_ticks(ticks, [named(angle, letters) for angle in visible])
    look: dict[str, Any] = {"colors": INK, "linewidths": 0.4, "alpha": 0.25, "linestyles": "solid", "zorder": 3}
    for field, angles in ((lon, meridians), (lat, parallels)):
        within = angles[(angles > field.min()) & (angles < field.max())]
        if within.size:
            ax.contour(x / frame.unit, y / frame.unit, field, levels=within, **look)
