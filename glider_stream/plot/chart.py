"""A chart of a route for its pilot: coast, fronts, and depth, heading and speeds against time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.flow import Flow
from ..kernels.terrain import Terrain
from ..water.inspect import is_steady
from .along import Along, along
from .canvas import (
    GREY,
    INK,
    PASSING,
    STILL,
    colours,
    departs_text,
    draw_dates,
    frozen,
    new_figure,
    styled,
    time_text,
    time_unit,
    when_text,
)
from .fronts import Fronts, draw_fronts
from .scene import KEY_PAD, SEABED, draw_current, draw_ends, draw_scale, draw_waypoints
from .seabed import sample_bottom
from .water import Frame, checked_depths, frame_of, passing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..roadmap.problem import Problem
    from ..search.path import Path

DEEP = 2.5
"""A seabed deeper than this many times the route's depth is not drawn, since the route would look too small."""
TIME_MAP = "plasma"
TURNS = (5, 15, 30, 45, 90, 180, 360)
"""The allowed distances of two angles on an axis [degrees], so that 0 is among them."""
THROUGH, OVER, CURRENT = "#0072b2", INK, "#d55e00"


class _Clock(NamedTuple):
    """The time axis that all panels share: the unit [s] and its name, and the colours of times."""

    unit: float
    name: str
    norm: Any


def plot_chart(
    flow: Flow,
    terrain: Terrain,
    problem: "Problem",
    path: "Path",
    depths: Sequence[float] | None = None,
    fronts: tuple[Fronts, float] | None = None,
    title: str = "",
) -> "Figure":
    """Draw a path on a chart of the current at one depth [m] (None: the top), and its course against time.

    `fronts`: the fronts and the hours between them, or None. Of `problem` the box `lo`, `hi` [m], the `departure`
    [s] and `to_lonlat` are read.
    """
    require(len(path.legs) > 0, "a route to draw must have a leg; got a path without any")
    require(depths is None or len(depths) == 1, f"a chart is drawn at one depth; got {list(depths or ())}")
    with styled():
        from matplotlib.colors import Normalize

        rows = np.asarray(path.trajectory, np.float64)
        stops = np.array([path.legs[0].start, *(leg.end for leg in path.legs)], np.float64)
        frame = frame_of(problem, np.vstack([rows[:, 1:], stops]))
        depth = frame.top if depths is None else float(checked_depths(depths, frame)[0])
        unit, name = time_unit(float(rows[-1, 0]))
        clock = _Clock(unit, name, Normalize(0.0, float(rows[-1, 0]) / unit))
        text = f"{len(path.legs)} leg{'s' * (len(path.legs) > 1)}, {time_text(path.travel_time)}"
        text += departs_text(path.departs, path.travel_time)
        still = path.frozen or (fronts is not None and fronts[0].frozen)
        text += f"; {STILL}" if still else ""
        figure = new_figure(14.0, 8.6, f"{title}: {text}" if title else f"Route: {text}")
        halves: Any = figure.subfigures(1, 2, width_ratios=(1.0, 1.05), wspace=0.02)
        left, right = halves
        ax, at = left.add_subplot(), passing(path, problem.departure)
        image = draw_current(ax, flow, terrain, frame, depth, at, pale=0.55, arrows=22, key=True)
        draw_scale(ax, frame)
        left.colorbar(image, ax=ax, label="Current speed (m/s)", location="bottom", aspect=45, pad=0.01)
        if fronts is not None:
            draw_fronts(ax, frame, *fronts)
        when = PASSING if path.clock_runs else when_text(is_steady(flow), problem.departure, problem.departs)
        # on a line of its own: a long title would run into the next panel's
        every = "" if fronts is None else f",\nand what is reached every {fronts[1]:g} h{fronts[0].ways}"
        ax.set_title(f"(a) The route over the current at {depth:.4g} m{when}{every}", pad=KEY_PAD)
        ax.set(xlabel=frame.labels[0], ylabel=frame.labels[1])
        line = _draw_route(ax, frame, rows, stops, clock)
        draw_waypoints(ax, frame, stops)
        look = {"location": "bottom", "aspect": 45, "pad": 0.01}
        left.colorbar(line, ax=ax, label=f"Time since departure ({name})", **look)
        panels = right.subplots(3, 1, sharex=True, height_ratios=(1.25, 1.0, 1.0))
        _draw_depth(panels[0], terrain, rows, clock)
        draw_dates(panels[0], path.departs, float(rows[-1, 0]), clock.unit)
        steps = along(path)
        _draw_heading(panels[1], steps, clock)
        _draw_speeds(panels[2], steps, clock)
        return frozen(figure)


def _by_time(line: Array, time: Array, clock: _Clock, width: float) -> Any:
    """Return a line (n, 2) coloured by time [s]."""
    from matplotlib.collections import LineCollection

    look = {"cmap": colours(TIME_MAP, 0.0, 0.9), "norm": clock.norm, "linewidths": width, "capstyle": "round"}
    route = LineCollection(list(np.stack([line[:-1], line[1:]], axis=1)), zorder=6, **look)
    route.set_array(0.5 * (time[:-1] + time[1:]) / clock.unit)
    return route


def _draw_route(ax: "Axes", frame: Frame, rows: Array, stops: Array, clock: _Clock) -> Any:
    line = frame.scaled(rows[:, 1:])[:, :2]
    ax.plot(*line.T, color="white", linewidth=4.6, solid_capstyle="round", zorder=5)
    route = ax.add_collection(_by_time(line, rows[:, 0], clock, 2.6))
    ends = frame.scaled(stops)[:, :2]
    ax.scatter(ends[1:-1, 0], ends[1:-1, 1], s=5, color="white", edgecolors=INK, linewidths=0.4, zorder=7)
    draw_ends(ax, ends)
    return route


def _draw_depth(ax: "Axes", terrain: Terrain, rows: Array, clock: _Clock) -> None:
    time, depth = rows[:, 0] / clock.unit, -rows[:, 3] + 0.0
    seabed = -sample_bottom(terrain, rows[:, 1], rows[:, 2])
    deepest, near = max(float(depth.max()), 1.0), float(seabed.min())
    shown = np.isfinite(seabed).any() and near < DEEP * deepest
    end = 1.12 * deepest
    if shown:
        end = max(end, 1.06 * min(float(seabed[np.isfinite(seabed)].max()), DEEP * deepest))
        ground = np.minimum(seabed, 2.0 * end)
        ax.fill_between(time, ground, 2.0 * end, color=SEABED, linewidth=0, zorder=1)
        ax.plot(time, ground, color=INK, linewidth=0.9, zorder=2)
    ax.axhline(0.0, color=GREY, linewidth=0.7, zorder=1)
    ax.plot(time, depth, color="white", linewidth=3.6, zorder=4)
    ax.add_collection(_by_time(np.column_stack([time, depth]), rows[:, 0], clock, 2.0))
    ax.set(xlim=(time[0], time[-1]), ylim=(end, -0.05 * end), ylabel="Depth (m)")
    text = "over the seabed" if shown else "no seabed on the way"
    if not shown and np.isfinite(near):
        text = f"the seabed lies at {near:,.0f} m or deeper"
    ax.set_title(f"(b) Depth, {text}")


def _draw_heading(ax: "Axes", steps: Along, clock: _Clock) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MultipleLocator

    # a heading that passes north must not jump across the panel
    first = np.flatnonzero(np.diff(steps.leg, prepend=-1))
    unwrapped = np.unwrap(steps.heading[first], period=360.0)
    heading = unwrapped[np.searchsorted(first, np.arange(steps.leg.size), side="right") - 1]
    course = heading + (steps.course - steps.heading + 180.0) % 360.0 - 180.0
    time = steps.time / clock.unit
    ax.scatter(time, course, s=4, color=GREY, linewidths=0, zorder=3, rasterized=True)
    last = np.append(first[1:], steps.leg.size) - 1
    ax.hlines(unwrapped, time[first], time[last], color=THROUGH, linewidth=2.2, zorder=4)
    low, high = float(min(heading.min(), course.min())), float(max(heading.max(), course.max()))
    pad = max(10.0, 0.08 * (high - low))
    ax.set(ylim=(low - pad, high + pad), ylabel="Clockwise from north (°)")
    turn = next((turn for turn in TURNS if 6 * turn >= high - low), TURNS[-1])
    ax.yaxis.set_major_locator(MultipleLocator(turn))
    ax.yaxis.set_major_formatter(lambda angle, _: f"{angle % 360:g}")
    ax.grid(axis="y", color="#e6e6e6", linewidth=0.6)
    ax.set_title("(c) Heading through water, course over ground")
    marks = [
        Line2D([], [], color=THROUGH, linewidth=2.2, label="heading"),
        Line2D([], [], color=GREY, marker="o", markersize=3, linestyle="", label="course"),
    ]
    _legend(ax, marks)


def _draw_speeds(ax: "Axes", steps: Along, clock: _Clock) -> None:
    time = steps.time / clock.unit
    current = np.hypot(steps.u, steps.v)
    lines = [
        *ax.plot(time, steps.speed, color=OVER, linewidth=1.5, label="over ground"),
        *ax.plot(time, steps.through, color=THROUGH, linewidth=1.2, linestyle="--", label="through water"),
        *ax.plot(time, current, color=CURRENT, linewidth=1.2, linestyle="-.", label="current"),
    ]
    top = float(max(steps.speed.max(), steps.through.max(), current.max()))
    ax.set(ylim=(0.0, 1.1 * top or 1.0), ylabel="Horizontal speed (m/s)")
    ax.set(xlabel=f"Time since departure ({clock.name})")
    ax.grid(axis="y", color="#e6e6e6", linewidth=0.6)
    ax.set_title("(d) Speed over ground and current")
    _legend(ax, lines)


def _legend(ax: "Axes", lines: list[Any]) -> None:
    """Draw the legend above the panel at its right; inside it would hide the lines."""
    look: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.985), "frameon": False}
    look |= {"fontsize": 8, "borderaxespad": 0.1, "handlelength": 1.6, "columnspacing": 1.2}
    ax.legend(handles=lines, ncols=len(lines), **look)
