"""Where gliders may not be: seabed, land, keep-out polygons, as one raster of the local frame."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..base.errors import InputError
from ..base.settings import require
from ..kernels.terrain import Seabed
from .frame import LocalFrame
from .ocean.bottom import Bottom

LAND = 0.0
"""The height [m] of what no glider may enter at any depth."""
SIDE = 512
"""Cells of the raster along its longer side, at most."""
FINEST = 25.0
"""The smallest cells [m]; below, legs are looked at every 5 m."""
MARGIN = 10.0
"""The raster keeps this far [m] from what it stands for: half a look of a leg, and what a map of a grid errs."""
MOST_TEXT = 50_000_000
"""The most that a file of polygons may hold [bytes]."""
MOST_VERTICES = 200_000
"""Of one polygon, and pieces of its rim."""
MOST_CROSSED = 300
"""Vertices of a polygon that crosses itself: mended within a second; 3,000 took minutes and 3.7 GB."""
SEEN, POLE = 60.0, 0.1
"""Polygons are looked at within so many degrees of longitude, and but so far from the poles."""
DENSE = 0.02
"""Polygons' edges are straight in degrees; in the frame they are drawn in pieces as long as this [degrees]."""


@dataclass(frozen=True)
class TerrainSettings:
    """The block [terrain]: what is kept out of, beside what the current file says of its land and bottom.

    `bathymetry`: a file of the bottom, `variable` and `positive` as it does not say itself; `clearance` [m]
    above any seabed; `max_depth` [m]; `land_distance` [m] to all land; `keep_out`: files of GeoJSON polygons.
    """

    bathymetry: str | None = None
    variable: str | None = None
    positive: str | None = None
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
        alone = self.bathymetry is not None or (self.variable is None and self.positive is None)
        require(
            alone, "`terrain.variable` and `terrain.positive` are of a bathymetry; name the file `bathymetry`"
        )


class Raster:
    """Even cells of the local frame, each with the highest bottom that any place in it may have."""

    def __init__(self, frame: LocalFrame, low: Array, high: Array) -> None:
        """Cells over the box from `low` to `high` (2,) [m]."""
        self.frame, self.low = frame, low
        self.step = max(float((high - low).max()) / SIDE, FINEST)
        self.count = np.ceil((high - low) / self.step).astype(np.int64) + 1
        self.bottom = np.full(tuple(self.count), -np.inf)
        self.land = np.zeros(tuple(self.count), dtype=bool)

    def _corners(self) -> tuple[Array, Array]:
        """The corners of the cells about the points, MARGIN further out on either side: (2 ni, 2 nj)."""
        axes = []
        for n in range(2):
            middle = self.low[n] + self.step * np.arange(self.count[n])
            half = self.step / 2 + MARGIN
            axes.append(np.stack([middle - half, middle + half], axis=1).ravel())
        x, y = np.meshgrid(*axes, indexing="ij")
        return x, y

    def add_bottom(self, bottom: Bottom) -> None:
        """Take the highest of all points that a place in a cell may read."""
        from scipy.ndimage import maximum_filter  # a twentieth of a second, which few starts need

        at = bottom.grid.indices(self.frame, *self._corners())
        ni, nj = self.count
        at = at.reshape(ni, 2, nj, 2, 2).transpose(0, 2, 1, 3, 4).reshape(ni, nj, 4, 2)
        last = np.array(bottom.height.shape[::-1]) - 1
        low, high = at.min(axis=2), at.max(axis=2)
        first = np.floor(low if bottom.between else low + 0.5)
        end = np.ceil(high) if bottom.between else np.floor(high + 0.5)
        first, end = (np.clip(part, 0, last).astype(np.int64) for part in (first, end))
        unknown = ((high < -0.5) | (low > last + 0.5)).any(axis=-1)
        # one window for all cells, as large as the largest needs, about the middle of each
        size = int((end - first).max()) + 1
        highest = maximum_filter(bottom.height, size=2 * (size // 2) + 1, mode="nearest")
        middle = (first + end) // 2
        here = highest[middle[..., 1], middle[..., 0]]
        here = np.where(unknown, LAND, here)  # what a file does not hold, nobody flies over
        self.bottom = np.maximum(self.bottom, here)
        self.land |= here >= LAND

    def add_polygons(self, polygons: Sequence[Any]) -> None:
        """No depth is open in a cell that a polygon touches."""
        import shapely

        x, y = (self.low[n] + self.step * np.arange(self.count[n]) for n in range(2))
        reach = self.step * math.sqrt(0.5) + MARGIN
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
        """The bottom as the kernels read it."""
        closed = self.land | np.isposinf(self.bottom)
        if land_distance > 0 and self.land.any():
            from scipy.ndimage import distance_transform_edt

            # from the edge of a cell, not from its middle
            near = distance_transform_edt(~self.land) * self.step - self.step * math.sqrt(0.5) <= land_distance
            closed |= near
        lowest = -np.inf if max_depth is None else -max_depth
        bottom = np.where(closed, LAND, np.maximum(self.bottom + clearance, lowest))
        ends = self.count - 1.0
        corner = np.array([[[0.0, 0.0], [0.0, ends[1]]], [[ends[0], 0.0], [ends[0], ends[1]]]])
        per_x, per_y = 1 / (self.step * ends)
        return Seabed(
            np.ascontiguousarray(bottom), 0.0, corner, float(per_x), float(per_y), *map(float, self.low)
        )


def read_polygons(file: str | Path, frame: LocalFrame) -> list[Any]:
    """The polygons of a GeoJSON file in the frame [m]; InputError where it holds anything else."""
    try:
        import shapely
        import shapely.affinity
        import shapely.geometry
    except ImportError:
        raise InputError("polygons need shapely, which is missing: pip install glider-stream[ocean]") from None
    path = Path(file)
    require(path.is_file(), f"the file of polygons {path} does not exist")
    size = path.stat().st_size
    require(
        size <= MOST_TEXT,
        f"{path.name} holds {size:,} bytes, more than polygons need ({MOST_TEXT:,}); simplify it",
    )
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        found = [shapely.geometry.shape(one) for one in _geometries(table)]
    except (
        OSError,
        ValueError,
        TypeError,
        KeyError,
        AttributeError,
        RecursionError,
        shapely.errors.ShapelyError,
    ) as error:
        said = " ".join(str(error).split())[:200]
        raise InputError(f"{path.name} is no GeoJSON of polygons: {said}; export it again") from None
    require(len(found) > 0, f"{path.name} holds no polygon; leave it out")
    result = []
    for one in found:
        kind = one.geom_type
        require(kind in ("Polygon", "MultiPolygon"), f"{path.name} holds a {kind}: a keep-out area is a polygon")
        bounds = np.array(one.bounds if not one.is_empty else [np.nan] * 4)
        on_earth = bool((np.abs(bounds) <= [540, 90, 540, 90]).all())  # False for NaN, too
        require(on_earth, f"{path.name} holds a polygon that is empty or not in degrees; mend it")
        flat = _sound(path.name, shapely.force_2d(one))
        # what is on the other side of the globe has no place in a flat frame
        near = shapely.box(frame.lon - SEEN, -90 + POLE, frame.lon + SEEN, 90 - POLE)
        for turn in (-720, -360, 0, 360, 720):
            part = shapely.affinity.translate(flat, turn, 0).intersection(near)
            if part.is_empty:
                continue
            long = part.length / DENSE
            fits = long <= MOST_VERTICES
            require(fits, f"a polygon of {path.name} has a rim of {part.length:,.0f} degrees; simplify it")
            part = shapely.segmentize(part, DENSE)
            local = shapely.transform(part, lambda at: np.stack(frame.to_local(at[:, 0], at[:, 1]), axis=-1))
            result.append(shapely.make_valid(local))
    return result


def _sound(name: str, polygon: Any) -> Any:
    """A polygon that does not cross itself; InputError where to mend it would take for ever."""
    import shapely

    count = int(shapely.get_num_coordinates(polygon))
    fits = count <= MOST_VERTICES
    require(fits, f"{name} holds a polygon of {count:,} vertices; simplify it to {MOST_VERTICES:,}")
    if shapely.is_valid(polygon):
        return polygon
    # each crossing of two edges becomes a vertex, so their number grows with the square
    few = f"with {count:,} vertices, too many to be mended here; give one of at most {MOST_CROSSED}, or mend it"
    require(count <= MOST_CROSSED, f"{name} holds a polygon that crosses itself, {few}")
    return shapely.make_valid(polygon)


def _geometries(table: Any) -> list[Any]:
    kind = table["type"]
    if kind == "FeatureCollection":
        return [one for feature in table["features"] for one in _geometries(feature)]
    if kind == "Feature":
        return [] if table["geometry"] is None else _geometries(table["geometry"])
    if kind == "GeometryCollection":
        return [one for part in table["geometries"] for one in _geometries(part)]
    return [table]


def raster_terrain(
    settings: TerrainSettings, frame: LocalFrame, low: Array, high: Array, bottoms: Sequence[Bottom]
) -> tuple[Seabed, str]:
    """Terrain over a box of the frame, from `low` to `high` (2,) [m], of bottoms and polygons; words on it."""
    raster = Raster(frame, low, high)
    words = []
    for bottom in bottoms:
        raster.add_bottom(bottom)
        words.append(bottom.words)
    for file in settings.keep_out:
        polygons = read_polygons(file, frame)
        raster.add_polygons(polygons)
        words.append(f"keep-out polygons of {Path(file).name}")
    for what, value in (("clearance", settings.clearance), ("distance from land", settings.land_distance)):
        words += [f"{what} {value:g} m"] if value else []
    words += [] if settings.max_depth is None else [f"no deeper than {settings.max_depth:g} m"]
    seabed = raster.seabed(settings.clearance, settings.max_depth, settings.land_distance)
    return seabed, ", ".join([*words, f"in cells of {raster.step:.0f} m"])
