"""A figure of several routes of one problem: on a map, in space, and as depth against time, with their times."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.flow import Flow
from ..kernels.terrain import Terrain
from ..water.inspect import is_steady
from .canvas import INK, STILL, frozen, new_figure, styled, time_text, time_unit
from .scene import draw_current, draw_ends, draw_space, stretch
from .water import checked_depths, frame_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..roadmap.problem import Problem
    from ..search.path import Path

LOOKS = (("#d55e00", (0, (4.0, 1.2))), ("#0072b2", "-"), ("#009e73", (0, (6, 1, 1, 1))), (INK, ":"))
"""Colour and line of each route: they differ in print and for people who see few colours (Okabe, Ito 2008)."""

LABEL_WIDTH, LABEL_HEIGHT = 0.3, 28.0
"""An arrival's label takes so much of the panel's width at the most, and is so high [points]."""


def plot_routes(
    flow: Flow,
    terrain: Terrain,
    problem: "Problem",
    position: Array,
    paths: Mapping[str, "Path"],
    depth: float | None = None,
) -> "Figure":
    """Draw two to four named paths among the nodes `position` (n, 3) [m], over the current at a `depth` [m].

    Without a depth it is the middle of the box. Of `problem` the box `lo`, `hi` [m], the `departure` [s], which
    is the time of the map, and `to_lonlat` are read.
    """
    fits = 2 <= len(paths) <= len(LOOKS)
    require(fits, f"a comparison shows 2 to {len(LOOKS)} routes; got {len(paths)}")
    for name, path in paths.items():
        require(len(path.legs) > 0, f"a route to draw must have a leg; the path {name} has no leg")
    rows = {name: np.asarray(path.trajectory, np.float64) for name, path in paths.items()}
    frame = frame_of(problem, np.vstack([row[:, 1:] for row in rows.values()]))
    level = 0.5 * (frame.top + frame.bottom) if depth is None else float(checked_depths([depth], frame)[0])
    with styled():
        still = [name for name, path in paths.items() if path.frozen]
        told = f"; {', '.join(still)}: {STILL}" if still else ""
        figure = new_figure(13.0, 9.4, f"Routes side by side{told}")
        grid = figure.add_gridspec(2, 2, height_ratios=(2.0, 1.0))
        space = figure.add_subplot(grid[0, 0], projection="3d")
        draw_space(space, terrain, frame, position)
        space.set_title(f"(a) In space, {stretch(frame)}", loc="left")
        chart = figure.add_subplot(grid[0, 1])
        image = draw_current(chart, flow, terrain, frame, level, problem.departure, pale=0.45)
        when = "" if is_steady(flow) else f", t = {time_text(problem.departure)}"
        chart.set_title(f"(b) From above, over the current at {level:.4g} m{when}")
        chart.set(xlabel=frame.labels[0], ylabel=frame.labels[1])
        figure.colorbar(image, ax=chart, label="Current speed (m/s)", aspect=35, pad=0.02)
        profile = figure.add_subplot(grid[1, :])
        _draw_profile(profile, paths, rows)
        for (name, path), (colour, line) in zip(paths.items(), LOOKS, strict=False):
            look: dict[str, Any] = {"color": colour, "linestyle": line, "zorder": 6}
            legs = f"{len(path.legs)} leg{'s' * (len(path.legs) > 1)}"
            drawn, stops = frame.scaled(rows[name][:, 1:]), frame.scaled(_stops(path))
            for axes, columns in ((space, 3), (chart, 2)):
                axes.plot(*drawn[:, :columns].T, color="white", linewidth=4.6, zorder=5)
                label = f"{name}: {legs}, {_seconds(path.travel_time)}" if columns == 3 else None
                axes.plot(*drawn[:, :columns].T, linewidth=2.4, label=label, **look)
            chart.scatter(
                stops[1:-1, 0], stops[1:-1, 1], s=15, color="white", edgecolors=colour, linewidths=1.1, zorder=7
            )
            draw_ends(space, stops)
            draw_ends(chart, stops[:, :2])
        handles, labels = space.get_legend_handles_labels()
        named = [n for n, label in enumerate(labels) if label not in ("start", "goal")]
        named += [labels.index("start"), labels.index("goal")]
        figure.legend(
            [handles[n] for n in named], [labels[n] for n in named], loc="upper right", ncols=len(named),
            frameon=False, bbox_to_anchor=(0.995, 0.995), fontsize=10, handlelength=3.4,
        )  # fmt: skip
        return frozen(figure)


def _stops(path: "Path") -> Array:
    """Return the ends of all legs (n + 1, 3) [m]."""
    return np.array([path.legs[0].start, *(leg.end for leg in path.legs)], np.float64)


def _seconds(time: float) -> str:
    """Return a travel time as text in seconds, and also in a longer unit if it is long."""
    _, name = time_unit(time)
    return f"{time:,.0f} s" if name == "s" else f"{time:,.0f} s ({time_text(time)})"


def _label_levels(ends: Sequence[float]) -> list[int]:
    """Return how high each label at an end (a share of the panel's width) is put, so that none covers another."""
    levels = [0] * len(ends)
    order = sorted(range(len(ends)), key=lambda n: ends[n])
    for before, after in pairwise(order):
        levels[after] = levels[before] + 1 if ends[after] - ends[before] < LABEL_WIDTH else 0
    return levels


def _draw_profile(ax: Any, paths: Mapping[str, "Path"], rows: Mapping[str, Array]) -> None:
    """Draw depth against time, and the time at which each route ends."""
    last = max(path.travel_time for path in paths.values())
    unit, unit_name = time_unit(last)
    deepest = max(float(-row[:, 3].min()) for row in rows.values())
    levels = _label_levels([path.travel_time / last for path in paths.values()])
    look: dict[str, Any]
    for (name, path), (colour, line), level in zip(paths.items(), LOOKS, levels, strict=False):
        time, depth = rows[name][:, 0] / unit, -rows[name][:, 3] + 0.0
        ax.plot(time, depth, color=colour, linestyle=line, linewidth=2.2, zorder=5)
        end = path.travel_time / unit
        ax.axvline(end, color=colour, linewidth=0.9, zorder=3)
        ax.scatter(
            [end], depth[-1:], marker="*", s=150, color="white", edgecolors=colour, linewidths=1.3, zorder=7
        )
        late = end > 0.85 * last / unit
        look = {
            "xytext": (-5 if late else 5, 4 + level * LABEL_HEIGHT),
            "textcoords": "offset points",
            "color": colour,
        }
        look |= {"ha": "right" if late else "left", "va": "bottom"}
        text = f"{name} arrives\nafter {_seconds(path.travel_time)}"
        ax.annotate(text, (end, 1.12 * deepest), **look)
    ax.set(xlim=(0.0, 1.02 * last / unit), ylim=(1.12 * max(deepest, 1.0), -0.1 * max(deepest, 1.0)))
    ax.set(xlabel=f"Time since departure ({unit_name})", ylabel="Depth (m)")
    ax.grid(axis="y", color="#e6e6e6", linewidth=0.6)
    ax.set_title("(c) Depth against time")
