"""The pilot's chart: fronts reached every so many hours, the route by time, its profile, headings, currents."""

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import griddata
from scipy.spatial import KDTree

from ..kernels.flow import Flow
from ..kernels.terrain import Terrain
from ..settings import require
from .canvas import GREY, INK, Array, colours, frozen, new_figure, said_time, styled, time_unit
from .water import (
    LAND,
    SEABED,
    Frame,
    draw_current,
    draw_ends,
    frame_of,
    sample_bottom,
    sample_field,
    sample_water,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..path import Path
    from ..roadmap import Problem

PIXELS = 200
MOST_FRONTS = 60
DEGREES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""How far apart the lines of longitude and latitude may be."""


def plot_chart(
    flow: Flow,
    terrain: Terrain,
    problem: "Problem",
    position: Array,
    arrival: Array,
    path: "Path",
    hours: float,
    title: str = "",
) -> "Figure":
    """Draw a path, and the fronts that are reached every so many `hours` from its start.

    `arrival` (n,) [s]: when each node `position` (n, 3) [m] can be reached at the soonest, inf where it cannot.
    """
    require(len(path.legs) > 0, "a route to draw must have a leg; got a path without any")
    require(hours > 0, f"fronts must be more than 0 h apart; got {hours:g}")
    reached = float(arrival[np.isfinite(arrival)].max(initial=0.0))
    count = int(reached / (3600 * hours))
    require(count <= MOST_FRONTS, f"fronts every {hours:g} h would be {count}; choose more hours between them")
    with styled():
        from matplotlib.colors import Normalize

        rows = np.asarray(path.trajectory, np.float64)
        frame = frame_of(problem, rows[:, 1:])
        unit, name = time_unit(float(rows[-1, 0]))
        norm = Normalize(0.0, float(rows[-1, 0]) / unit)
        said = f"{len(path.legs)} legs, {said_time(path.travel_time)}; fronts every {hours:g} h"
        figure = new_figure(13.0, 9.6, f"{title}: {said}" if title else f"Route: {said}")
        grid = figure.add_gridspec(3, 2, width_ratios=(1.25, 1.0))
        chart = figure.add_subplot(grid[:, 0])
        image = draw_current(chart, flow, terrain, frame, frame.top, problem.departure, pale=0.45)
        figure.colorbar(
            image, ax=chart, label=f"Current speed at {frame.top:g} m (m/s)", aspect=40, pad=0.02, shrink=0.7
        )
        _draw_fronts(chart, terrain, frame, position, arrival, hours)
        _draw_graticule(chart, problem, frame)
        line = frame.scaled(rows[:, 1:])
        _draw_line(chart, line[:, :2], rows[:, 0] / unit, norm, 3.0)
        stops = np.array([path.legs[0].start, *(leg.end for leg in path.legs)])
        draw_ends(chart, frame.scaled(stops)[:, :2])
        chart.set_title(f"(a) The route by time, and fronts reached every {hours:g} h")
        panels: list[Any] = [figure.add_subplot(grid[n, 1]) for n in range(3)]
        for ax in panels[1:]:
            ax.sharex(panels[0])
        _draw_depths(panels[0], terrain, rows, unit, norm)
        _draw_headings(panels[1], path, unit)
        _draw_speeds(panels[2], flow, path, rows, problem.departure, unit)
        panels[2].set_xlabel(f"Time since departure ({name})")
        panels[0].set_xlim(0.0, rows[-1, 0] / unit)
        return frozen(figure)


def _draw_line(ax: "Axes", line: Array, time: Array, norm: Any, width: float) -> None:
    from matplotlib.collections import LineCollection

    ax.plot(*line.T, color="white", linewidth=width + 2, solid_capstyle="round", zorder=5)
    route = LineCollection(
        list(np.stack([line[:-1], line[1:]], axis=1)), cmap=colours("plasma", 0, 0.9), norm=norm
    )
    route.set(array=0.5 * (time[:-1] + time[1:]), linewidth=width, capstyle="round", zorder=6)
    ax.add_collection(route)


def _draw_fronts(
    ax: "Axes", terrain: Terrain, frame: Frame, position: Array, arrival: Array, hours: float
) -> None:
    """Lines of equal soonest arrival at any depth, in the water between nodes that can be reached."""
    known = np.isfinite(arrival)
    if known.sum() < 4:
        return
    places, times = position[known, :2], arrival[known]
    tree = KDTree(places)
    near = float(np.median(np.asarray(tree.query(places, k=min(5, len(places)))[0])[:, -1]))
    soonest = np.array([times[around].min() for around in tree.query_ball_point(places, 1.01 * near)])
    x, y = frame.mesh(PIXELS)
    field = griddata(places, soonest / 3600, (x, y), method="linear")
    field = np.where(sample_water(terrain, x, y, -frame.top), field, np.nan)
    levels = np.arange(hours, np.nanmax(field, initial=0.0) + 1e-9, hours)
    if levels.size:
        lines = ax.contour(
            x / frame.unit, y / frame.unit, field, levels=levels, colors=INK, linewidths=0.9, zorder=4
        )
        ax.clabel(lines, fmt=lambda value: f"{value:g} h", fontsize=7, inline=True)


def _draw_graticule(ax: "Axes", problem: "Problem", frame: Frame) -> None:
    """Lines of longitude and latitude, and their degrees at the edges, where there are any."""
    ax.set(xlabel=frame.labels[0], ylabel=frame.labels[1])
    if problem.to_lonlat is None:
        return
    x, y = frame.mesh(60)
    flat = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    lon, lat = (part.reshape(x.shape) for part in problem.to_lonlat(flat).T)
    for part, axis, edge in ((lon, "x", np.s_[0, :]), (lat, "y", np.s_[:, 0])):
        low, high = float(part.min()), float(part.max())
        step = next((step for step in DEGREES if (high - low) / step <= 7), DEGREES[-1])
        levels = np.arange(np.ceil(low / step), np.floor(high / step) + 0.5) * step
        if not levels.size:
            continue
        ax.contour(x / frame.unit, y / frame.unit, part, levels=levels, colors=GREY, linewidths=0.4, zorder=3)
        at = np.interp(levels, part[edge], (x if axis == "x" else y)[edge] / frame.unit)
        letters = "EW" if axis == "x" else "NS"
        shown = [f"{abs((v + 180) % 360 - 180 if axis == 'x' else v):.4g}°{letters[int(v < 0)]}" for v in levels]
        getattr(ax, f"set_{axis}ticks")(at, shown)
    ax.set(xlabel="Longitude", ylabel="Latitude")


def _draw_depths(ax: "Axes", terrain: Terrain, rows: Array, unit: float, norm: Any) -> None:
    time, depth = rows[:, 0] / unit, -rows[:, 3] + 0.0
    closed = -sample_bottom(terrain, rows[:, 1], rows[:, 2])
    deepest = 1.15 * max(float(depth.max()), 1.0)
    ax.fill_between(time, np.minimum(closed, deepest), deepest, color=SEABED, edgecolor=LAND, linewidth=0.8)
    _draw_line(ax, np.column_stack([time, depth]), time, norm, 1.6)
    ax.set(ylim=(deepest, -0.03 * deepest), ylabel="Depth (m)")
    ax.set_title(
        "(b) Depth; grey: seabed with its clearance, or too deep" if (closed < deepest).any() else "(b) Depth"
    )


def _draw_headings(ax: "Axes", path: "Path", unit: float) -> None:
    for leg in path.legs:
        ends = [leg.depart / unit, (leg.depart + leg.duration) / unit]
        colour = "#2563a8" if leg.glide_angle < 0 else "#c2410c"
        ax.plot(ends, [leg.compass] * 2, color=colour, linewidth=2.2, solid_capstyle="butt")
    ax.plot([], [], color="#2563a8", label="dive")
    ax.plot([], [], color="#c2410c", label="climb")
    ax.legend(loc="upper right", ncols=2, frameon=False, fontsize=8)
    ax.set(ylim=(0, 360), yticks=np.arange(0, 361, 90), ylabel="Heading (° true)")
    ax.grid(axis="y", color="#e6e6e6", linewidth=0.6)
    ax.set_title("(c) Heading through water")


def _draw_speeds(ax: "Axes", flow: Flow, path: "Path", rows: Array, departure: float, unit: float) -> None:
    u, v = sample_field(flow, rows[:, 1], rows[:, 2], rows[:, 3], rows[:, 0] + departure)
    ax.plot(rows[:, 0] / unit, np.hypot(u, v), color=GREY, linewidth=1.0, label="current on the way")
    for n, leg in enumerate(path.legs):
        ends = [leg.depart / unit, (leg.depart + leg.duration) / unit]
        way = np.hypot(*(leg.trajectory[-1, 1:3] - leg.trajectory[0, 1:3])) / max(leg.duration, 1e-9)
        ax.plot(
            ends,
            [way] * 2,
            color=INK,
            linewidth=2.0,
            solid_capstyle="butt",
            label="over ground" if n == 0 else None,
        )
    ax.set(ylim=(0, 1.25 * ax.dataLim.y1), ylabel="Speed (m/s)")
    ax.legend(loc="upper right", ncols=2, frameon=False, fontsize=8)
    ax.set_title("(d) Speed over ground, and of the current")
