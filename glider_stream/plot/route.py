"""A figure of a route like figure 4 of the paper: in space, over the current, and as depth against time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.flow import Flow, currents, rises
from ..kernels.terrain import Terrain
from ..search.path import SURFACE
from ..water.inspect import is_steady
from .canvas import (
    GREY,
    INK,
    PASSING,
    STILL,
    colours,
    frozen,
    new_figure,
    styled,
    time_text,
    time_unit,
    when_text,
)
from .scene import draw_current, draw_ends, draw_space, stretch
from .water import Frame, checked_depths, frame_of, passing, sample_field

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..roadmap.problem import Problem
    from ..search.path import Path

MAX_MAPS, MAX_NUMBERS, ARROWS = 4, 40, 44
MAPS_ROOM = 4.9, 5.6  # inches across and up
LONGEST_ARROW = 0.4  # inches, in the profile


def map_depths(position: Array, frame: Frame, depths: Sequence[float] | None) -> Array:
    """Return the depths [m] of the maps: the given ones, else those of the nodes if few, else even ones."""
    if depths is not None:
        require(1 <= len(depths) <= MAX_MAPS, f"`depths` must name 1 to {MAX_MAPS} depths; got {len(depths)}")
        return np.unique(checked_depths(depths, frame))
    levels = np.unique(np.round(-position[:, 2], 1) + 0.0)
    return levels if levels.size <= MAX_MAPS else np.round(np.linspace(frame.top, frame.bottom, MAX_MAPS))


def map_columns(count: int, frame: Frame) -> tuple[int, float]:
    """Return the number of columns in which `count` maps are largest, and the share of the width they fill."""
    width, height = frame.x[1] - frame.x[0], frame.y[1] - frame.y[0]
    across, up = MAPS_ROOM

    def scale(columns: int) -> float:
        return min(across / (columns * width), up / (-(-count // columns) * height))

    best = max(range(1, count + 1), key=scale)
    return best, scale(best) * best * width / across


def plot_route(
    flow: Flow,
    terrain: Terrain,
    problem: "Problem",
    position: Array,
    path: "Path",
    depths: Sequence[float] | None = None,
    title: str = "",
) -> "Figure":
    """Draw a path among the nodes `position` (n, 3) [m], over the current at up to four `depths` [m].

    Of `problem` the box `lo`, `hi` [m], the `departure` [s] and `to_lonlat` are read. If the clock runs, the maps
    show each place at the time when the route passes nearest to it, else at the departure.
    """
    require(len(path.legs) > 0, "a route to draw must have a leg; got a path without any")
    with styled():
        from matplotlib.colors import Normalize

        rows = np.asarray(path.trajectory, np.float64)
        stops = np.array([path.legs[0].start, *(leg.end for leg in path.legs)], np.float64)
        frame = frame_of(problem, np.vstack([rows[:, 1:], stops]))
        norm = Normalize(frame.top, frame.bottom)
        text = f"{len(path.legs)} leg{'s' * (len(path.legs) > 1)}, {time_text(path.travel_time)}"
        # a date beside each depth would cover the title of the next map
        when = when_text(is_steady(flow), problem.departure, problem.departs)
        dated = when if problem.departs is not None else ""
        if path.clock_runs:
            when = dated = PASSING
        text += f"; currents {'' if path.clock_runs else 'of '}{dated.removeprefix(', ')}" if dated else ""
        text += f"; {STILL}" if path.frozen else ""
        figure = new_figure(13.0, 9.8, f"{title}: {text}" if title else f"Route: {text}")
        levels, at = map_depths(position, frame, depths), passing(path, problem.departure)
        columns, filled = map_columns(levels.size, frame)
        right = 0.4 + 0.75 * filled
        grid = figure.add_gridspec(2, 3, height_ratios=(2.4, 1.0), width_ratios=(2.15 - right, 0.03, right))
        space = figure.add_subplot(grid[0, 0], projection="3d")
        draw_space(space, terrain, frame, position, label="node")
        _draw_flight(space, frame, rows, stops, norm)
        cells = grid[0, 2].subgridspec(-(-levels.size // columns), columns)
        maps = [figure.add_subplot(cells[n // columns, n % columns]) for n in range(levels.size)]
        for n, (ax, depth) in enumerate(zip(maps, levels, strict=True)):
            draw_current(ax, flow, terrain, frame, depth, at)
            ax.set_title(f"{'(b) ' if n == 0 else ''}Current at {depth:.4g} m{'' if dated else when}")
            below, left = n + columns >= levels.size, n % columns == 0
            ax.set(xlabel=frame.labels[0] * below, ylabel=frame.labels[1] * left)
            ax.tick_params(labelbottom=below, labelleft=left)
            _draw_track(ax, frame, rows, stops, depth, norm)
        _share_colours(figure, maps)
        _draw_profile(figure.add_subplot(grid[1, :]), flow, path, rows, problem.departure, norm)
        return frozen(figure)


def _route(line: Array, depth: Array, norm: Any, width: float) -> Any:
    """Return a line (n, 2) or (n, 3), coloured by depth."""
    from matplotlib.collections import LineCollection
    from mpl_toolkits.mplot3d.art3d import Line3DCollection  # type: ignore[import-untyped]

    kind = Line3DCollection if line.shape[1] == 3 else LineCollection
    route = kind(list(np.stack([line[:-1], line[1:]], axis=1)), cmap=colours("plasma_r", 0.22), norm=norm)
    route.set(array=0.5 * (depth[:-1] + depth[1:]), linewidth=width, capstyle="round", zorder=5)
    return route


def _draw_flight(ax: Any, frame: Frame, rows: Array, stops: Array, norm: Any) -> None:
    line, ends = frame.scaled(rows[:, 1:]), frame.scaled(stops)
    ax.plot(*line[:, :2].T, frame.bottom, color="#b0b0b0", linewidth=1.2, zorder=3, label="track below")
    ax.plot(*line.T, color="white", linewidth=4.2, zorder=4)
    ax.add_collection(_route(line, line[:, 2], norm, 2.6))
    between = ends[1:-1]
    up = between[:, 2] <= SURFACE
    for mask, marker, label in ((~up, "o", "end of a leg"), (up, "^", "surfacing")):
        if mask.any():
            look = {"edgecolors": INK, "facecolors": "white", "linewidths": 0.9, "depthshade": False}
            ax.scatter(*between[mask].T, marker=marker, s=26, label=label, zorder=6, **look)
    draw_ends(ax, ends)
    ax.plot([], [], color=INK, linewidth=3.2, label="near the depth of a map")
    ax.set_title(f"(a) The route in space, {stretch(frame)}", loc="left")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=4, frameon=False, fontsize=8)


def _draw_track(ax: "Axes", frame: Frame, rows: Array, stops: Array, depth: float, norm: Any) -> None:
    line = frame.scaled(rows[:, 1:])
    ax.plot(*line[:, :2].T, color="white", linewidth=2.9, solid_capstyle="round", zorder=4)
    ax.add_collection(_route(line[:, :2], line[:, 2], norm, 1.3))
    # a sixth: with four evenly spread maps, each part of the route is bold in just one of them
    far = np.abs(line[:, 2] - depth) > (frame.bottom - frame.top) / 6.0
    near = np.where(far[:, None], np.nan, line[:, :2])
    ax.plot(*near.T, color="white", linewidth=5.4, solid_capstyle="round", zorder=6)
    ax.plot(*near.T, color=INK, linewidth=3.2, solid_capstyle="round", zorder=7)
    draw_ends(ax, frame.scaled(stops)[:, :2], 0.7)


def _share_colours(figure: "Figure", maps: list[Any]) -> None:
    images = [ax.images[-1] for ax in maps]
    fastest = max(float(np.ma.filled(image.get_array(), 0.0).max()) for image in images)
    for image in images:
        image.set_clim(0.0, fastest or 1.0)
    figure.colorbar(images[0], ax=maps, label="Current speed (m/s)", aspect=35, pad=0.02)


def _draw_profile(ax: "Axes", flow: Flow, path: "Path", rows: Array, departure: float, norm: Any) -> None:
    unit, name = time_unit(float(rows[-1, 0] - rows[0, 0]))
    time, depth = rows[:, 0] / unit, -rows[:, 3] + 0.0
    span = max(float(np.ptp(depth)), 1.0)
    # room above for the leg numbers and below for the arrows of the deepest point
    ax.set(xlim=(time[0], time[-1]), ylim=(depth.max() + 0.32 * span, depth.min() - 0.4 * span))
    ax.axhline(0.0, color=GREY, linewidth=0.7, zorder=1)
    ax.plot(time, depth, color="white", linewidth=4.0, zorder=4)
    line = ax.add_collection(_route(np.column_stack([time, depth]), depth, norm, 2.4))
    look: dict[str, Any]
    step, last = -(-len(path.legs) // MAX_NUMBERS), -np.inf
    for n, leg in enumerate(path.legs):
        start, middle = leg.depart / unit, (leg.depart + 0.5 * leg.duration) / unit
        if n % 2 == 0:
            ax.axvspan(start, start + leg.duration / unit, color="#f0f0f0", linewidth=0, zorder=0)
        if n % step == 0 and middle - last > 0.02 * (time[-1] - time[0]):
            look = {"ha": "center", "va": "top", "color": "#555555", "fontsize": 8}
            ax.text(middle, 0.965, str(n + 1), transform=ax.get_xaxis_transform(), **look)
            last = middle
    at = np.linspace(rows[0, 0], rows[-1, 0], ARROWS)[1:-1]
    x, y, z = (np.interp(at, rows[:, 0], rows[:, k]) for k in (1, 2, 3))
    begins = departure if path.departure is None else path.departure
    when = begins + (0.0 * at if path.frozen else at)
    u, v = sample_field(flow, x, y, z, when)
    fastest = float(np.nanmax(np.hypot(u, v), initial=0.0)) or 1.0
    power = 10.0 ** np.floor(np.log10(fastest))
    key = max(k * power for k in (1.0, 2.0, 5.0) if k * power <= fastest)
    look = {"angles": "uv", "scale_units": "inches", "scale": fastest / LONGEST_ARROW, "width": 0.0016}
    arrows = ax.quiver(at / unit, -z, u, v, color=INK, headwidth=4.5, zorder=8, **look)
    ax.quiverkey(arrows, 0.95, 1.065, key, f"{key:g} m/s", labelpos="W", coordinates="axes")
    ax.set_yticks([tick for tick in ax.get_yticks() if 0.0 <= tick <= depth.max() + 0.3 * span])
    ax.set(xlabel=f"Time since departure ({name})", ylabel="Depth (m)")
    title = "(c) Depth against time, legs numbered; arrows: the horizontal current on the way, north up"
    if rises(flow):
        title += "; dotted: the vertical current, upward"
        _draw_rise(ax, at / unit, currents(flow, x, y, z, when)[:, 2])
    ax.set_title(title)
    bar = ax.figure.colorbar(line, ax=ax, label="Depth of the route (m)", aspect=12, pad=0.01)
    bar.ax.invert_yaxis()


def _draw_rise(ax: "Axes", time: Array, rise: Array) -> None:
    """Draw the vertical current on the way (n,) [m/s] over the profile, on an axis of its own."""
    beside = ax.twinx()
    most = 1.1 * float(np.abs(rise).max()) or 1.0
    beside.plot(time, rise, color=INK, linestyle=":", linewidth=1.4, zorder=9)
    beside.set(ylim=(-most, most), ylabel="Vertical current (m/s)")
