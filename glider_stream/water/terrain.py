"""Places that gliders must not enter (seabed, land, keep-out polygons), as a raster of the local frame."""

import json
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..base.errors import InputError, InputWarning
from ..base.settings import require
from ..base.untrusted import check_file
from ..kernels.terrain import Seabed
from .frame import LocalFrame
from .ocean.bottom import Bottom
from .ocean.grid import Grid
from .ocean.names import Names

LAND = 0.0
"""Cells with this height [m] are closed at all depths."""
SIDE = 512
"""The raster has at most this many cells along its longer side."""
FINEST = 25.0
"""The cells are at least this large [m]; finer ones do not help, because legs are checked every 5 m."""
WALL = 10.0
"""The raster keeps this distance [m] from land and polygons.

It covers half the distance between two checks of a leg and the error of the map of a grid.
"""
MOST_TEXT = 50_000_000
"""A file of polygons may hold at most this many bytes."""
MOST_VERTICES = 200_000
"""A polygon may have at most this many vertices, and its rim at most this many pieces."""
MOST_CROSSED = 300
"""A polygon that crosses itself may have at most this many vertices.

Repairing it takes less than a second; with 3,000 vertices it took minutes and 3.7 GB.
"""
SEEN, POLE = 60.0, 0.1
"""Polygons are used within SEEN degrees of longitude of the frame's centre and up to POLE degrees from a pole."""
DENSE = 0.02
"""The edges of polygons are straight in degrees; in the frame they are drawn in pieces of this length [degrees].
"""


@dataclass(frozen=True)
class TerrainSettings:
    """The block [terrain]: closed areas in addition to the land and bottom of the current file.

    `bathymetry`: a file with the height of the bottom. `variable`, `positive` and `names` (lon, lat, units,
    group) are needed where the file does not give them. `clearance` [m]: distance above any seabed. `max_depth`
    [m]. `land_distance` [m]: distance from all land. `keep_out`: files of GeoJSON polygons.
    """

    bathymetry: str | None = None
    variable: str | None = None
    positive: str | None = None
    names: Names | None = None
    clearance: float = 0.0
    max_depth: float | None = None
    land_distance: float = 0.0
    keep_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("clearance", "land_distance"):
            value = getattr(self, name)
            require(value >= 0, f"`terrain.{name}` must be at least 0 m; got {value:g}")
        deep = self.max_depth
        require(deep is None or deep > 0, f"`terrain.max_depth` must be above 0 m; got {deep}")
        alone = self.bathymetry is not None or (self.variable, self.positive, self.names) == (None, None, None)
        require(
            alone,
            "`terrain.variable`, `terrain.positive` and `terrain.names` describe a bathymetry; also name its "
            "file as "
            "`bathymetry`",
        )


class Raster:
    """Square cells of the local frame; each cell keeps the highest bottom that any place in it may have."""

    def __init__(self, frame: LocalFrame, low: Array, high: Array) -> None:
        """Make the cells over the box from `low` to `high` (2,) [m]."""
        self.frame, self.low = frame, low
        self.step = max(float((high - low).max()) / SIDE, FINEST)
        self.count = np.ceil((high - low) / self.step).astype(np.int64) + 1
        self.ground = np.full(tuple(self.count), -np.inf)
        self.bottom = np.full(tuple(self.count), -np.inf)
        self.land = np.zeros(tuple(self.count), dtype=bool)

    def _indices(self, grid: Grid) -> tuple[Array, Array]:
        """Return the least and greatest fractional indices (ni, nj, 2) of a grid within WALL of each cell.

        Cells share their corners. Beyond a corner the indices go on as they change along the cell's sides.
        """
        x, y = (self.low[n] + self.step * (np.arange(self.count[n] + 1) - 0.5) for n in range(2))
        at = grid.indices(self.frame, *np.meshgrid(x, y, indexing="ij"))
        corners = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]])
        first, before, after, last = corners
        along_x = np.maximum(np.abs(after - first), np.abs(last - before))
        along_y = np.maximum(np.abs(before - first), np.abs(last - after))
        wall = WALL / self.step * (along_x + along_y)
        return corners.min(axis=0) - wall, corners.max(axis=0) + wall

    def add_bottom(self, bottom: Bottom) -> None:
        """Raise each cell to the highest point of the bottom that a place in it may read."""
        from scipy.ndimage import maximum_filter  # importing it takes 0.05 s, and few runs need it

        low, high = self._indices(bottom.grid)
        last = np.array(bottom.height.shape[::-1]) - 1
        first = np.floor(low if bottom.between else low + 0.5)
        end = np.ceil(high) if bottom.between else np.floor(high + 0.5)
        first, end = (np.clip(part, 0, last).astype(np.int64) for part in (first, end))
        unknown = ((high < -0.5) | (low > last + 0.5)).any(axis=-1)
        # all cells use one window about their middle, as large as the largest cell needs
        size = 2 * (int((end - first).max() + 1) // 2) + 1
        middle = (first + end) // 2

        def highest(values: Array) -> Array:
            here = maximum_filter(values, size=size, mode="nearest")[middle[..., 1], middle[..., 0]]
            return np.where(unknown, LAND, here)  # where the file has no data, the sea is closed

        ground = highest(bottom.height if bottom.ground is None else bottom.ground)
        self.ground = np.maximum(self.ground, ground)
        self.land |= ground >= LAND
        self.bottom = np.maximum(self.bottom, ground if bottom.ground is None else highest(bottom.height))

    def add_polygons(self, polygons: Sequence[Any]) -> None:
        """Close all depths in every cell that a polygon touches."""
        import shapely

        x, y = (self.low[n] + self.step * np.arange(self.count[n]) for n in range(2))
        reach = self.step * math.sqrt(0.5) + WALL
        for polygon in polygons:
            west, south, east, north = polygon.bounds
            i = np.flatnonzero((x >= west - reach) & (x <= east + reach))
            j = np.flatnonzero((y >= south - reach) & (y <= north + reach))
            if not i.size or not j.size:
                continue
            shapely.prepare(polygon)
            places = shapely.points(*np.meshgrid(x[i], y[j], indexing="ij"))
            touched = shapely.dwithin(polygon, places, reach)
            self.bottom[np.ix_(i, j)] = np.where(touched, np.inf, self.bottom[np.ix_(i, j)])

    def seabed(self, clearance: float, max_depth: float | None, land_distance: float) -> Seabed:
        """Return the bottom as the kernels read it; distances are in metres."""
        closed = self.land | (self.bottom >= LAND)
        if land_distance > 0 and self.land.any():
            from scipy.ndimage import distance_transform_edt

            # the distance counts from the edge of a cell, not from its middle
            near = distance_transform_edt(~self.land) * self.step - self.step * math.sqrt(0.5) <= land_distance
            closed |= near
        lowest = -np.inf if max_depth is None else -max_depth
        # the clearance counts from the seabed, not from the depth where a file's data end
        bottom = np.where(closed, LAND, np.maximum(np.maximum(self.ground + clearance, self.bottom), lowest))
        ends = self.count - 1.0
        corner = np.array([[[0.0, 0.0], [0.0, ends[1]]], [[ends[0], 0.0], [ends[0], ends[1]]]])
        per_x, per_y = 1 / (self.step * ends)
        x_lo, y_lo = map(float, self.low)
        bottom, ground = (np.ascontiguousarray(part) for part in (bottom, self.ground))
        return Seabed(bottom, 0.0, corner, float(per_x), float(per_y), x_lo, y_lo, ground)


def read_polygons(file: str | Path, frame: LocalFrame) -> list[Any]:
    """Return the polygons of a GeoJSON file in the frame [m]; InputError if the file holds anything else.

    An edge longer than 180 degrees is taken the short way, across the date line.
    """
    return [part for polygon in _polygons(file) for part in _in_frame(polygon, frame)]


def _polygons(file: str | Path) -> list[Any]:
    """Return the polygons and multipolygons of a file [degrees], as they are written."""
    try:
        import shapely
        import shapely.geometry
    except ImportError:
        raise InputError("polygons need shapely, which is missing: pip install glider-stream[ocean]") from None
    path = Path(file)
    check_file(path, "the file of polygons")
    require(path.is_file(), f"the file of polygons {path} does not exist")
    size = path.stat().st_size
    require(
        size <= MOST_TEXT,
        f"{path.name} holds {size:,} bytes, more than polygons need ({MOST_TEXT:,}); simplify it",
    )
    try:
        # some editors write a file with a byte order mark
        table = json.loads(path.read_text(encoding="utf-8-sig"))
        found = [shapely.geometry.shape(shape) for shape in _geometries(table)]
    except (
        OSError,
        ValueError,
        TypeError,
        KeyError,
        AttributeError,
        RecursionError,
        shapely.errors.ShapelyError,
    ) as error:
        message = " ".join(str(error).split())[:200]
        raise InputError(f"{path.name} is not a GeoJSON file of polygons: {message}; export it again") from None
    require(len(found) > 0, f"{path.name} holds no polygon; leave it out")
    for shape in found:
        kind = shape.geom_type
        require(kind in ("Polygon", "MultiPolygon"), f"{path.name} holds a {kind}: a keep-out area is a polygon")
        bounds = np.array(shape.bounds if not shape.is_empty else [np.nan] * 4)
        on_earth = bool((np.abs(bounds) <= [540, 90, 540, 90]).all())  # False for NaN, too
        require(on_earth, f"{path.name} holds a polygon that is empty or not in degrees; mend it")
    whole = (part for shape in found for part in getattr(shape, "geoms", [shape]))
    return [_simple(path.name, _the_short_way(path.name, part)) for part in whole]


def _the_short_way(name: str, polygon: Any) -> Any:
    """Return the polygon [degrees] with edges of at most 180 degrees of longitude; full circles stay."""
    import shapely

    rings = []
    for ring in (polygon.exterior, *polygon.interiors):
        at = np.asarray(ring.coords, np.float64)[:, :2]
        step = np.diff(at[:, 0])
        far = (np.abs(step) > 180) & (np.abs(step) < 360)
        lon = at[0, 0] + np.concatenate([[0.0], np.cumsum(np.where(far, step - np.sign(step) * 360, step))])
        require(
            abs(lon[-1] - lon[0]) < 1.0,
            f"{name} holds a polygon that goes around a pole, from longitude {at[0, 0]:g}; cut it at a meridian",
        )
        rings.append(np.stack([lon, at[:, 1]], axis=-1))
    outer = rings[0][:, 0]
    for hole in rings[1:]:
        hole[:, 0] += 360 * np.round((outer.min() + outer.max() - hole[:, 0].min() - hole[:, 0].max()) / 720)
    return shapely.Polygon(rings[0], rings[1:])


def _in_frame(polygon: Any, frame: LocalFrame) -> list[Any]:
    """Return the parts of a polygon [degrees] that lie near the frame, as polygons in metres."""
    import shapely
    import shapely.affinity

    flat = shapely.make_valid(polygon)
    # a flat frame cannot show the other side of the globe
    near = shapely.box(frame.lon - SEEN, -90 + POLE, frame.lon + SEEN, 90 - POLE)
    result = []
    for turn in (-720, -360, 0, 360, 720):
        part = shapely.affinity.translate(flat, turn, 0).intersection(near)
        fits = part.length / DENSE <= MOST_VERTICES
        require(fits, f"a keep-out polygon has a rim of {part.length:,.0f} degrees; simplify it")
        part = shapely.segmentize(part, DENSE)
        if not part.is_empty:
            local = shapely.transform(part, lambda at: np.stack(frame.to_local(at[:, 0], at[:, 1]), axis=-1))
            result.append(shapely.make_valid(local))
    return result


def _simple(name: str, polygon: Any) -> Any:
    """Return the polygon if it can be made valid in short time, else raise InputError."""
    import shapely

    count = int(shapely.get_num_coordinates(polygon))
    fits = count <= MOST_VERTICES
    require(fits, f"{name} holds a polygon of {count:,} vertices; simplify it to {MOST_VERTICES:,}")
    if count <= MOST_CROSSED or shapely.is_valid(polygon):
        return polygon
    # each crossing of two edges becomes a vertex, so the work grows with the square of their number
    few = f"with {count:,} vertices, too many to be mended here; mend it, or give at most {MOST_CROSSED}"
    raise InputError(f"{name} holds a polygon that crosses itself, {few}")


def _count_inside(file: str, polygons: Sequence[Any], frame: LocalFrame, domain: tuple[Array, Array]) -> str:
    """Return a text with the number of polygons in a domain [m] and their area; warn if no polygon lies in it."""
    import shapely

    box = shapely.box(*domain[0][:2], *domain[1][:2])
    inside = [part for polygon in polygons for part in _in_frame(polygon, frame) if part.intersects(box)]
    name = Path(file).name
    if inside:
        area = shapely.union_all(inside).intersection(box).area / 1e6
        return f"keep-out polygons of {name}: {len(inside)} of {len(polygons)} in the domain, {area:.3g} km2"
    message = f"warning: the keep-out polygons of {name} do not touch the domain"
    swapped = [polygon for polygon in polygons if np.abs(np.asarray(polygon.bounds)[[0, 2]]).max() <= 90]
    turned = [shapely.transform(polygon, lambda at: at[:, ::-1]) for polygon in swapped]
    if any(part.intersects(box) for polygon in turned for part in _in_frame(polygon, frame)):
        message += ": are longitude and latitude swapped? If swapped back, they lie in it"
    warnings.warn(message.removeprefix("warning: "), InputWarning, stacklevel=3)
    return message


def _geometries(table: Any) -> list[Any]:
    kind = table["type"]
    if kind == "FeatureCollection":
        return [geometry for feature in table["features"] for geometry in _geometries(feature)]
    if kind == "Feature":
        return [] if table["geometry"] is None else _geometries(table["geometry"])
    if kind == "GeometryCollection":
        return [geometry for part in table["geometries"] for geometry in _geometries(part)]
    return [table]


def raster_terrain(
    settings: TerrainSettings,
    frame: LocalFrame,
    low: Array,
    high: Array,
    bottoms: Sequence[Bottom],
    domain: tuple[Array, Array] | None = None,
) -> tuple[Seabed, str]:
    """Return the terrain over a box of the frame from `low` to `high` (2,) [m], and a description of it.

    `bottoms` and the polygons of `settings` are combined. `domain`: the corners [m] of the planned part, if it is
    smaller than the box.
    """
    raster = Raster(frame, low, high)
    description = []
    for bottom in bottoms:
        raster.add_bottom(bottom)
        description.append(bottom.description)
    for file in settings.keep_out:
        polygons = _polygons(file)
        raster.add_polygons([part for polygon in polygons for part in _in_frame(polygon, frame)])
        description.append(_count_inside(file, polygons, frame, domain or (low, high)))
    for what, value in (("clearance", settings.clearance), ("distance from land", settings.land_distance)):
        description += [f"{what} {value:g} m"] if value else []
    description += [] if settings.max_depth is None else [f"no deeper than {settings.max_depth:g} m"]
    seabed = raster.seabed(settings.clearance, settings.max_depth, settings.land_distance)
    return seabed, ", ".join([*description, f"in cells of {raster.step:.0f} m"])
