"""The parts of figures: current and land on a map, the ends of a route, the box in space."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import Array
from ..kernels.flow import Flow
from ..kernels.terrain import Terrain
from ..search.path import SURFACE
from .canvas import GREY, INK, colours, thinned
from .graticule import draw_graticule
from .seabed import ground_of
from .water import Frame, Time, sample_field, sample_water

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PIXELS = 240  # along the longer side of a map
MAX_NODES = 4000
HEIGHT = 0.55  # of a box in space, to its longer side
LAND, SEABED = "#8c8c8c", "#cfcfcf"
COASTLINE = 1.2  # points
MAP_HEIGHTS = 1.0, 4.4
"""The least and greatest height of a map between other panels [inches]."""
KEY_PAD = 18.0
"""A title this far above its map [points] leaves room for the key of the arrows."""
MOST_WAYPOINTS = 14
"""So many numbers of waypoints are drawn on a map; more would hide the route."""


def draw_land(ax: "Axes", terrain: Terrain, frame: Frame, depth: float) -> bool:
    """Draw land in dark grey, water too shallow at a depth [m] in light grey, and the coast.

    Return whether there is any land.
    """
    from matplotlib.colors import ListedColormap

    x, y = frame.mesh(PIXELS)
    dry = (~sample_water(terrain, x, y, -depth)).astype(np.float64)
    land = ~sample_water(ground_of(terrain), x, y, 0.0)
    dry += land
    ends = [side / frame.unit for side in (*frame.x, *frame.y)]
    grey = ListedColormap(["white", SEABED, LAND])
    ax.imshow(dry, cmap=grey, vmin=0, vmax=2, origin="lower", extent=(ends[0], ends[1], ends[2], ends[3]))
    if not dry.any():
        return False
    # in print, dark water and land have the same grey: only an outline separates them
    for outlined, width in ((dry > 0, 0.5), (land, COASTLINE)):
        if outlined.any() and not outlined.all():
            ax.contour(
                x / frame.unit, y / frame.unit, outlined, levels=[0.5], colors=INK, linewidths=width, zorder=2.5
            )
    return True


def draw_current(
    ax: "Axes",
    flow: Flow,
    terrain: Terrain,
    frame: Frame,
    depth: float,
    t: Time,
    pale: float = 0.15,
    arrows: int = 15,
    key: bool = False,
) -> Any:
    """Draw the current at a depth [m] and a time t [s] (one, or one for each place); return the image.

    Colours are speeds, arrows are directions. `pale` is the share of white in the colours, `arrows` the number of
    arrows along the longer side. With `key` an arrow with its speed stands above the right corner: the title
    then needs a `pad` of KEY_PAD.
    """

    def current(count: int) -> tuple[Array, Array, Array, Array]:
        x, y = frame.mesh(count)
        u, v = sample_field(flow, x, y, -depth, t(x, y) if callable(t) else t)
        wet = sample_water(terrain, x, y, -depth)
        return x / frame.unit, y / frame.unit, np.where(wet, u, np.nan), np.where(wet, v, np.nan)

    draw_land(ax, terrain, frame, depth)
    _, _, u, v = current(PIXELS)
    ends = [side / frame.unit for side in (*frame.x, *frame.y)]
    colour = colours("cmo.speed", 0.0, 0.8, pale)
    extent = (ends[0], ends[1], ends[2], ends[3])
    image = ax.imshow(np.hypot(u, v), cmap=colour, vmin=0.0, origin="lower", extent=extent)
    x, y, u, v = current(arrows)
    speed = np.hypot(u, v)
    # lengths grow with the square root, so that slow water remains readable beside fast water
    length = 1.0 / np.sqrt(np.maximum(speed * np.nanmax(speed, initial=1e-12), 1e-12))
    look: dict[str, Any] = {
        "scale_units": "width",
        "scale": arrows * 1.15,
        "width": 0.07 / arrows,
        "pivot": "mid",
    }
    drawn = ax.quiver(x, y, u * length, v * length, angles="xy", color=INK, alpha=0.55, **look)
    if key and (fastest := float(np.nanmax(speed, initial=0.0))) > 0:
        shown = round_below(0.7 * fastest)
        put = {"labelpos": "W", "coordinates": "axes", "color": INK, "alpha": 1.0}
        put |= {"fontproperties": {"size": 8}, "zorder": 8}
        named = ax.quiverkey(drawn, 0.95, 1.025, float(np.sqrt(shown / fastest)), f"{shown:g} m/s", **put)
        named.text.set_path_effects(halo())
    ax.set(xlim=ends[:2], ylim=ends[2:], aspect="equal")
    ax.locator_params(nbins=5, steps=[1, 2, 5, 10])
    draw_graticule(ax, frame)
    return image


def halo() -> list[Any]:
    """Return the white edge by which text can be read over a map."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.5, foreground="white")]


def round_below(value: float) -> float:
    """Return the greatest of 1, 2 and 5 times a power of ten that is not above a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(k * power for k in (1.0, 2.0, 5.0) if k * power <= value * (1 + 1e-9)))


def legend_below(ax: "Axes", columns: int) -> None:
    """Put the legend of a map below the label of its axis, however flat the map is."""
    look: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 4.6}
    ax.legend(ncols=columns, frameon=False, fontsize=8, **look)


def map_height(frame: Frame, width: float) -> float:
    """Return the height of a map so wide [inches], within MAP_HEIGHTS."""
    high = (frame.y[1] - frame.y[0]) / (frame.x[1] - frame.x[0])
    return float(np.clip(width * high, *MAP_HEIGHTS))


def draw_scale(ax: "Axes", frame: Frame) -> None:
    """Draw a bar of a round length in the lower left corner of a map."""
    wide = frame.x[1] - frame.x[0]
    bar = round_below(0.25 * wide)
    text = f"{bar / 1000:g} km" if bar >= 1000 else f"{bar:g} m"
    begin = 0.04
    look: dict[str, Any] = {"transform": ax.transAxes, "solid_capstyle": "butt"}
    ends = [begin, begin + bar / wide]
    ax.plot(ends, [0.035, 0.035], color="white", linewidth=5.0, zorder=8, **look)
    ax.plot(ends, [0.035, 0.035], color=INK, linewidth=2.2, zorder=8.1, **look)
    place: dict[str, Any] = {"transform": ax.transAxes, "ha": "center", "va": "bottom", "fontsize": 8}
    ax.text(begin + 0.5 * bar / wide, 0.05, text, zorder=8.1, path_effects=halo(), **place)


def draw_waypoints(ax: "Axes", frame: Frame, stops: Array) -> None:
    """Number the places where a route surfaces, and its goal, as the files of vehicles do; not more than
    MOST_WAYPOINTS of them.

    `stops` (n, 3) [m]: the start and the ends of all legs.
    """
    up = [n for n in range(1, len(stops)) if stops[n, 2] >= -SURFACE or n == len(stops) - 1]
    step = -(-len(up) // MOST_WAYPOINTS)
    ends = frame.scaled(stops)[:, :2]
    look: dict[str, Any] = {"textcoords": "offset points", "xytext": (5, 4), "fontsize": 8, "zorder": 10}
    for number, n in enumerate(up, 1):
        # the goal's number must not lie on the one before
        if n == up[-1] or (number % step == 0 and len(up) - number > step // 2):
            ax.annotate(str(number), (ends[n, 0], ends[n, 1]), path_effects=halo(), **look)


def draw_ends(ax: Any, points: Array, size: float = 1.0) -> None:
    """Draw start and goal; their shapes differ, because print loses colours."""
    for row, marker, area, label in ((0, "o", 70, "start"), (-1, "*", 190, "goal")):
        place = [points[row, k : k + 1] for k in range(points.shape[1])]
        look = {"edgecolors": INK, "facecolors": "white", "linewidths": 1.4, "zorder": 9, "clip_on": False}
        ax.scatter(*place, marker=marker, s=area * size, label=label, **look)


def draw_space(ax: Any, terrain: Terrain, frame: Frame, nodes: Array, ticks: int = 5, **look: Any) -> Any:
    """Prepare a 3-D panel, depth downward, with its nodes (n, 3) [m]; return their marks."""
    sides = np.array([frame.x[1] - frame.x[0], frame.y[1] - frame.y[0]])
    ax.computed_zorder = False
    ax.set_proj_type("ortho")
    ax.view_init(elev=28, azim=-58)
    ax.set_box_aspect((*sides / sides.max(), HEIGHT), zoom=1.05)
    ends = [side / frame.unit for side in (*frame.x, *frame.y)]
    ax.set(xlim=ends[:2], ylim=ends[2:], zlim=(frame.bottom, frame.top))
    ax.set(xlabel=f"East ({frame.name})", ylabel=f"North ({frame.name})", zlabel="Depth (m)")
    ax.locator_params(nbins=ticks)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.pane.set(facecolor="white", edgecolor="#bbbbbb")
        axis._axinfo["grid"].update(color="#e6e6e6", linewidth=0.5)
    x, y = frame.mesh(PIXELS // 2)
    dry = ~sample_water(terrain, x, y, -frame.top)
    if dry.any():
        x, y = x / frame.unit, y / frame.unit
        ax.contourf(x, y, dry, levels=[0.5, 1.5], colors=LAND, offset=frame.top, alpha=0.6, zorder=1)
    drawn = frame.scaled(nodes[thinned(len(nodes), MAX_NODES)])
    faint = {"s": 5, "color": GREY, "alpha": 0.7, "linewidths": 0, "zorder": 2}
    return ax.scatter(*drawn.T, **(faint | look))


def stretch(frame: Frame) -> str:
    """Return as text how many times depth is stretched in `draw_space`."""
    times = HEIGHT * max(frame.x[1] - frame.x[0], frame.y[1] - frame.y[0]) / (frame.bottom - frame.top)
    text = f"{times:.0f}" if times >= 10.0 else f"{times:.2g}"
    return f"depth stretched {text} times" if times > 1.05 else "depth to scale"
