"""The water of a figure: current and land on a map, the box in space."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import map_coordinates

from ..kernels.cache import entry_point
from ..kernels.flow import Flow, contains, velocity
from ..kernels.terrain import OpenWater, Terrain, allowed
from ..settings import require
from .canvas import GREY, INK, Array, Side, colours, length_unit, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..roadmap import Problem

PIXELS = 240  # along the longer side of a map
MAX_NODES = 4000
HEIGHT = 0.55  # of a box in space, to its longer side
LAND, SEABED = "#8c8c8c", "#cfcfcf"


@entry_point()
def _sample_field(flow, x, y, z, t, u, v):  # type: ignore[no-untyped-def]
    for n in range(x.size):
        if contains(flow, x[n], y[n], t[n]):
            u[n], v[n] = velocity(flow, x[n], y[n], z[n], t[n])


@entry_point()
def _sample_water(terrain, x, y, z, wet):  # type: ignore[no-untyped-def]
    for n in range(x.size):
        wet[n] = allowed(terrain, x[n], y[n], z[n])


def sample_field(flow: Flow, x: ArrayLike, y: ArrayLike, z: ArrayLike, t: ArrayLike) -> tuple[Array, Array]:
    """The current u, v [m/s] at points x, y, z [m] and times t [s], broadcast; NaN where it is not known."""
    points = np.broadcast_arrays(*(np.asarray(a, np.float64) for a in (x, y, z, t)))
    u, v = np.full(points[0].size, np.nan), np.full(points[0].size, np.nan)
    _sample_field(flow, *(p.flatten() for p in points), u, v)
    return u.reshape(points[0].shape), v.reshape(points[0].shape)


def sample_water(terrain: Terrain, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> NDArray[np.bool_]:
    """Whether a glider may be at points x, y, z [m], broadcast."""
    points = np.broadcast_arrays(*(np.asarray(a, np.float64) for a in (x, y, z)))
    wet = np.zeros(points[0].size, np.bool_)
    _sample_water(terrain, *(p.flatten() for p in points), wet)
    return wet.reshape(points[0].shape)


def sample_bottom(terrain: Terrain, x: Array, y: Array) -> Array:
    """How deep a glider may go at places [m]: the height below which the terrain closes the water, upward."""
    if isinstance(terrain, OpenWater):
        return np.full(np.shape(x), terrain.floor)
    at = np.stack(
        [(np.asarray(x) - terrain.x_lo) * terrain.per_x, (np.asarray(y) - terrain.y_lo) * terrain.per_y]
    )
    i, j = (map_coordinates(terrain.index_map[..., n], at, order=1, mode="nearest") for n in range(2))
    count = terrain.bottom.shape
    rows, columns = (np.clip(np.rint(k), 0, n - 1).astype(np.intp) for k, n in zip((i, j), count, strict=True))
    return np.asarray(np.minimum(terrain.bottom[rows, columns] + terrain.clearance, 0.0))


class Frame(NamedTuple):
    """The box of a figure: sides x, y [m], depths `top` and `bottom` [m] downward, the unit of length.

    `labels` of the axes toward east and north: from where, in degrees, where the scenario is geographic.
    """

    x: Side
    y: Side
    top: float
    bottom: float
    unit: float
    name: str
    labels: tuple[str, str]

    def mesh(self, count: int) -> tuple[Array, Array]:
        """Cell centres, `count` along the longer side, in square cells."""
        longer = max(side[1] - side[0] for side in (self.x, self.y))
        sides = []
        for low, high in (self.x, self.y):
            cells = max(2, round(count * (high - low) / longer))
            sides.append(low + (np.arange(cells) + 0.5) / cells * (high - low))
        x, y = np.meshgrid(*sides)
        return x, y

    def scaled(self, points: Array) -> Array:
        """Points (n, 3), x, y, z [m], as they are drawn: in the unit of length, depth [m] downward."""
        drawn: Array = np.asarray(points, np.float64) / [self.unit, self.unit, -1.0] + 0.0
        return drawn


def frame_of(problem: "Problem", points: Array) -> Frame:
    """The frame that holds a problem's box and the points (n, 3) [m]."""
    low, high = np.minimum(problem.lo, points.min(axis=0)), np.maximum(problem.hi, points.max(axis=0))
    x, y = (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))
    top, bottom = float(-high[2]) + 0.0, float(-low[2])
    unit, name = length_unit(x, y)
    labels = f"East ({name})", f"North ({name})"
    if problem.to_lonlat is not None:
        lon, lat = problem.to_lonlat(np.zeros((1, 3)))[0]
        labels = f"East of {degrees(lon, 'EW')} ({name})", f"North of {degrees(lat, 'NS')} ({name})"
    return Frame(x, y, top, max(bottom, top + 1e-9), unit, name, labels)


def degrees(angle: float, letters: str) -> str:
    """An angle [degrees] with the letter of its side, as on a chart."""
    return f"{abs(angle):.4f}° {letters[int(angle < 0)]}"


def checked_depths(depths: Sequence[float], frame: Frame) -> Array:
    """Depths [m] of maps; InputError where the scenario knows no current: above the surface, below its box."""
    for depth in depths:
        fits = 0.0 <= depth <= frame.bottom
        require(fits, f"`depth` must be from 0 m to {frame.bottom:g} m, the domain's deepest; got {depth:g}")
    return np.asarray(depths, np.float64)


def draw_land(ax: "Axes", terrain: Terrain, frame: Frame, depth: float) -> bool:
    """Land in dark grey, seabed above a depth [m] in light grey, outlined; whether there is any."""
    from matplotlib.colors import ListedColormap

    x, y = frame.mesh(PIXELS)
    dry = (~sample_water(terrain, x, y, -depth)).astype(np.float64)
    dry += ~sample_water(terrain, x, y, -frame.top)
    ends = [side / frame.unit for side in (*frame.x, *frame.y)]
    grey = ListedColormap(["white", SEABED, LAND])
    ax.imshow(dry, cmap=grey, vmin=0, vmax=2, origin="lower", extent=(ends[0], ends[1], ends[2], ends[3]))
    if not dry.any():
        return False
    # in print, dark water and land are the same grey: only an outline tells them apart
    ax.contour(x / frame.unit, y / frame.unit, dry > 0, levels=[0.5], colors=INK, linewidths=0.7)
    return True


def draw_current(
    ax: "Axes",
    flow: Flow,
    terrain: Terrain,
    frame: Frame,
    depth: float,
    t: float,
    pale: float = 0.15,
    arrows: int = 15,
) -> Any:
    """The current at a depth [m] and time t [s]: speed as colour, direction as arrows; returns the image.

    `pale` is the share of white in the colours, `arrows` their number along the longer side.
    """

    def current(count: int) -> tuple[Array, Array, Array, Array]:
        x, y = frame.mesh(count)
        u, v = sample_field(flow, x, y, -depth, t)
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
    # lengths by the square root: slow water stays readable next to fast
    length = 1.0 / np.sqrt(np.maximum(speed * np.nanmax(speed, initial=1e-12), 1e-12))
    look: dict[str, Any] = {
        "scale_units": "width",
        "scale": arrows * 1.15,
        "width": 0.07 / arrows,
        "pivot": "mid",
    }
    ax.quiver(x, y, u * length, v * length, angles="xy", color=INK, alpha=0.55, **look)
    ax.set(xlim=ends[:2], ylim=ends[2:], aspect="equal")
    ax.locator_params(nbins=5, steps=[1, 2, 5, 10])
    return image


def draw_ends(ax: Any, points: Array, size: float = 1.0) -> None:
    """Start and goal, told apart by shape: colour alone is lost in print."""
    for row, marker, area, label in ((0, "o", 70, "start"), (-1, "*", 190, "goal")):
        place = [points[row, k : k + 1] for k in range(points.shape[1])]
        look = {"edgecolors": INK, "facecolors": "white", "linewidths": 1.4, "zorder": 9, "clip_on": False}
        ax.scatter(*place, marker=marker, s=area * size, label=label, **look)


def draw_space(ax: Any, terrain: Terrain, frame: Frame, nodes: Array, ticks: int = 5, **look: Any) -> Any:
    """Dress a 3-D panel, depth downward, with its nodes (n, 3) [m]; returns their marks."""
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
    """How many times depth is stretched in `draw_space`, in words."""
    times = HEIGHT * max(frame.x[1] - frame.x[0], frame.y[1] - frame.y[0]) / (frame.bottom - frame.top)
    return f"depth stretched {times:.2g} times" if times > 1.05 else "depth to scale"
