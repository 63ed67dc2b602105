"""When to leave: travel time and arrival against departure."""

from collections.abc import Callable
from datetime import UTC
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.settings import require
from ..search.departures import Departures, leaving
from ..search.path import Path
from .canvas import INK, frozen, new_figure, styled, time_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TRAVEL, ARRIVAL, BEST, LATEST = "#0072b2", INK, "#d55e00", "#7a1f6b"
LINE = {"marker": "o", "markersize": 3.5, "linewidth": 1.4}


def plot_departures(found: Departures, title: str = "") -> "Figure":
    """Draw the travel time and below it the arrival of each departure; there are gaps where no path exists."""
    any_path = any(path.found for path in found.paths)
    require(any_path, "no departure has a path, so there is nothing to draw; try other departures")
    with styled():
        leaves = np.array([leaving(path) for path in found.paths])
        travel = np.array([path.travel_time if path.found else np.nan for path in found.paths])
        unit, name = time_unit(float(np.nanmax(travel)))
        figure = new_figure(9.0, 6.4, title or "When to leave")
        axes: Any = figure.subplots(2, 1, sharex=True)
        top, bottom = axes
        shown, where = _clock(found.paths[0])
        top.plot(shown(leaves), travel / unit, color=TRAVEL, **LINE)
        top.set(ylabel=f"Travel time ({name})", title="(a) How long it takes")
        bottom.plot(shown(leaves), shown(leaves + travel), color=ARRIVAL, **LINE)
        bottom.set(xlabel=f"Departure ({where})", ylabel=f"Arrival ({where})", title="(b) When it arrives")
        for path, colour, marker, label in (
            (found.best, BEST, "*", "costs the least"),
            (found.latest, LATEST, "D", "leaves last and arrives in time"),
        ):
            if path is not None and path.found:
                at = np.array([leaving(path)])
                look: dict[str, Any] = {"color": colour, "marker": marker, "s": 90, "zorder": 5, "label": label}
                top.scatter(shown(at), [path.travel_time / unit], **look)
                bottom.scatter(shown(at), shown(at + path.travel_time), **look)
        if found.by is not None:
            bottom.axhline(shown(np.array([found.by]))[0], color=LATEST, linewidth=1.0, linestyle="--")
        top.legend(loc="best", frameon=False)
        for ax in (top, bottom):
            ax.grid(color="#e6e6e6", linewidth=0.6)
        return frozen(figure)


def _clock(path: Path) -> tuple[Callable[[Any], Any], str]:
    """Return a function from seconds of the flow to values on the axes, and the unit: dates (UTC), else hours."""
    departs = path.departs
    if departs is None:
        return lambda seconds: seconds / 3600.0, "h"
    start = np.datetime64(departs.astimezone(UTC).replace(tzinfo=None), "ms")

    def dates(seconds: Any) -> Any:
        since = 1e3 * (seconds - leaving(path))
        known = np.isfinite(since)
        result = start + np.where(known, since, 0.0).astype("timedelta64[ms]")
        result[~known] = np.datetime64("NaT")
        return result

    return dates, "UTC"
