"""Horizontal grids of ocean files: regular in longitude and latitude, or curved."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array, Bools
from ...base.checks import Range
from ...base.errors import InputError
from ...base.nearest import tree_of
from ...base.settings import require
from ..frame import LocalFrame, eastward, wrapped

Index = NDArray[np.intp]


class OutsideError(InputError):
    """The domain lies partly outside a grid."""


EARTH = 6_371_000.0
WIDE = 5.0
"""A spacing of more than this many times the usual spacing may be a gap. There is no data within a gap."""
STEEP = 3.0
"""It is a gap if it is also this many times the spacings beside it; a stretched axis grows more slowly."""
EDGE = 0.01
"""A point up to this far beyond the ends [cells] is on the grid, because degrees are rounded."""
EVEN = 1e-3
"""An axis is even if its spacings differ by less than this [cells]; degrees are rounded."""
MAP_ERROR = 1.0
"""The index map moves no point of the grid by more than this [m] ..."""
MAP_SIDE = 1025
"""... unless the map needs more than this many points on a side; then a hundredth of a cell is enough."""
NEWTON_STEPS = 12
"""At most this many Newton steps invert a cell; three are enough where cells are similar."""
SETTLED = 1e-10
"""Newton's method ends at a step smaller than this [cells]."""


def gaps(axis: Array) -> Bools:
    """Return which steps (n - 1) of a rising axis are gaps: far wider than the usual and the neighbouring steps.

    At most two steps in a row are gaps, around a single point; more steps are another spacing. The last step is a
    gap only with a second one beside it.
    """
    steps = np.diff(np.asarray(axis, np.float64))
    found = np.zeros(steps.size, dtype=bool)
    if steps.size < 3:
        return found
    wide = steps > WIDE * np.median(steps)
    at = 0
    while at < steps.size:
        end = at
        while end < steps.size and wide[end]:
            end += 1
        beside = [steps[n] for n in (at - 1, end) if 0 <= n < steps.size]
        few = end - at <= len(beside)
        if end > at and few and bool(steps[at:end].min() > STEEP * max(beside)):
            found[at:end] = True
        at = max(end, at + 1)
    return found


def unbroken(axis: Array, at: float) -> tuple[slice, str]:
    """Return the run without gaps that holds a value, or the nearest run, and a text on the gaps."""
    breaks = np.flatnonzero(gaps(axis)) + 1
    if not breaks.size:
        return slice(0, axis.size), ""
    edges = [0, *map(int, breaks), axis.size]
    runs = [slice(first, end) for first, end in pairwise(edges)]
    off = [max(axis[run.start] - at, at - axis[run.stop - 1], 0.0) for run in runs]
    between = " and ".join(f"{axis[n - 1]:.6g} to {axis[n]:.6g}" for n in breaks[:3])
    return runs[int(np.argmin(off))], f", with no data from {between}"


def unit_vectors(lon: Array, lat: Array) -> Array:
    """Return the positions on the unit sphere, (..., 3), where longitudes have no seam."""
    phi, lam = np.radians(lat), np.radians(lon)
    return np.stack([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)], axis=-1)


@dataclass(frozen=True)
class Cut:
    """A part of a grid: its rows, its columns (in the order of the part), and the grid of the part."""

    rows: slice
    columns: Index
    grid: "Grid"


@dataclass(frozen=True)
class LonLatGrid:
    """A regular grid: `lon` (nx) rises eastward, `lat` (ny) northward [degrees]."""

    lon: Array
    lat: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.lat.size, self.lon.size

    @property
    def bounds(self) -> tuple[Range, Range]:
        """West and east, south and north [degrees]."""
        return (float(self.lon[0]), float(self.lon[-1])), (float(self.lat[0]), float(self.lat[-1]))

    def mesh(self) -> tuple[Array, Array]:
        """Return longitude and latitude of each point (ny, nx) [degrees]."""
        lon, lat = np.meshgrid(self.lon, self.lat)
        return lon, lat

    def rim(self) -> tuple[Array, Array]:
        """Return positions along the edge, close together [degrees]."""
        share = np.linspace(0, 1, 65)
        lon = self.lon[0] + share * (self.lon[-1] - self.lon[0])
        lat = self.lat[0] + share * (self.lat[-1] - self.lat[0])
        west, east = (np.full(65, edge) for edge in self.lon[[0, -1]])
        south, north = (np.full(65, edge) for edge in self.lat[[0, -1]])
        return np.concatenate([lon, lon, west, east]), np.concatenate([south, north, lat, lat])

    def cell_sizes(self) -> tuple[Array, Array]:
        """Return the sizes of cells along a row and across rows [m]: the largest along each axis."""
        widest = np.cos(np.radians(np.abs(self.lat).min()))
        return (
            np.radians(np.diff(self.lon)) * widest * EARTH,
            np.radians(np.diff(self.lat)) * EARTH,
        )

    def nearest_place(self, lon: float, lat: float) -> tuple[float, float] | None:
        """Return the place, moved onto the grid if rounding put it beside; None if it lies outside."""
        _, lons = columns(self.lon, lon)
        lats = self.lat[unbroken(self.lat, lat)[0]]
        slack_lon, slack_lat = EDGE * np.diff(lons).max(initial=0), EDGE * np.diff(lats).max(initial=0)
        at_lon, at_lat = float(np.clip(lon, lons[0], lons[-1])), float(np.clip(lat, lats[0], lats[-1]))
        off = abs(at_lon - lon) > slack_lon or abs(at_lat - lat) > slack_lat
        return None if off else (at_lon, at_lat)

    def cut(self, name: str, lon: Range, lat: Range, centre: float, margin: int) -> Cut:
        """Return the part that a domain [degrees] needs, with a margin of cells; InputError outside."""
        which, lons = columns(self.lon, centre)
        west, east = eastward(lon)
        middle = float(wrapped((west + east) / 2, centre))
        half = (east - west) / 2
        lon = (middle - half, middle + half)
        run, no_lat = unbroken(self.lat, (lat[0] + lat[1]) / 2)
        lats, no_lon = self.lat[run], unbroken(self.lon, float(wrapped(middle, float(self.lon.mean()))))[1]
        for what, axis, bounds, note in (("longitude", lons, lon, no_lon), ("latitude", lats, lat, no_lat)):
            require(bounds[0] <= bounds[1], f"the domain's {what} must rise; got {bounds[0]:g} to {bounds[1]:g}")
            slack = EDGE * np.diff(axis).max() if axis.size > 1 else 0.0
            if not (axis.size > 1 and axis[0] - slack <= bounds[0] and bounds[1] <= axis[-1] + slack):
                raise OutsideError(
                    f"the domain's {what} {bounds[0]:g} to {bounds[1]:g} lies partly outside {name}, "
                    f"which holds {axis[0]:.6g} to {axis[-1]:.6g}{note}; move or narrow the domain"
                )
        across, within = span(lons, lon, margin), span(lats, lat, margin)
        rows = slice(within.start + run.start, within.stop + run.start)
        return Cut(rows, which[across], LonLatGrid(lons[across], self.lat[rows]))

    def indices(self, frame: LocalFrame, x: Array, y: Array) -> Array:
        """Return fractional indices (column, row), (..., 2), of places in a frame [m]; linear beyond the ends."""
        lon, lat = frame.to_lonlat(x, y)
        return np.stack([_fraction(self.lon, lon), _fraction(self.lat, lat)], axis=-1)


@dataclass(frozen=True)
class CurvedGrid:
    """A curved grid: `lon`, `lat` (ny, nx) [degrees]; points that are neighbours in the file are so at sea."""

    lon: Array
    lat: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.lon.shape[0], self.lon.shape[1]

    @property
    def bounds(self) -> tuple[Range, Range]:
        """West and east, south and north [degrees], of the smallest arc that holds all points."""
        lon = np.sort(self.lon.ravel() % 360)
        gaps = np.append(np.diff(lon), lon[0] + 360 - lon[-1])
        widest = int(gaps.argmax())
        west = float(wrapped(lon[(widest + 1) % lon.size], 0.0))
        return (west, west + 360 - float(gaps[widest])), (float(self.lat.min()), float(self.lat.max()))

    def mesh(self) -> tuple[Array, Array]:
        """See LonLatGrid."""
        return self.lon, self.lat

    def rim(self) -> tuple[Array, Array]:
        """See LonLatGrid."""
        edge = (np.s_[0, :], np.s_[-1, :], np.s_[:, 0], np.s_[:, -1])
        return np.concatenate([self.lon[e] for e in edge]), np.concatenate([self.lat[e] for e in edge])

    def cell_sizes(self) -> tuple[Array, Array]:
        """See LonLatGrid."""
        at = self._vectors
        return (
            EARTH * np.linalg.norm(np.diff(at, axis=1), axis=-1).ravel(),
            EARTH * np.linalg.norm(np.diff(at, axis=0), axis=-1).ravel(),
        )

    @cached_property
    def _vectors(self) -> Array:
        return unit_vectors(self.lon, self.lat)

    def nearest_place(self, lon: float, lat: float) -> tuple[float, float] | None:
        """See LonLatGrid."""
        near = self._box(np.array([lon]), np.array([lat]), 3)
        part = CurvedGrid(self.lon[near], self.lat[near])
        frame = LocalFrame(lon, lat)
        at = part.indices(frame, np.zeros(1), np.zeros(1))[0]
        last = np.array(part.shape[::-1]) - 1.0
        inside = bool((at >= -EDGE).all() and (at <= last + EDGE).all())
        inside &= bool(self._open(at, (near[0].start, near[1].start)))
        # the part reaches three cells around the place
        return (lon, lat) if inside else None

    @cached_property
    def _gaps(self) -> Bools:
        """Cells (ny - 1, nx - 1) with a side across which the file has no data."""
        at = self._vectors
        result = np.zeros((self.shape[0] - 1, self.shape[1] - 1), dtype=bool)
        for axis in (0, 1):
            steps = np.linalg.norm(np.diff(at, axis=axis), axis=-1)
            # one look along the middle row or column is enough: a gap crosses all of them
            middle = np.moveaxis(steps, axis, 0)[:, steps.shape[1 - axis] // 2]
            for n in np.flatnonzero(gaps(np.concatenate([[0.0], np.cumsum(middle)]))):
                result[(n, slice(None)) if axis == 0 else (slice(None), n)] = True
        return result

    def _open(self, at: Array, first: tuple[int, int]) -> Bools:
        """Return whether indices (..., 2) lie outside gaps; they count from `first` (row, column) of the grid."""
        cell = np.floor(at).astype(np.int64) + np.array(first[::-1])
        i, j = (np.clip(cell[..., n], 0, self.shape[1 - n] - 2) for n in range(2))
        return np.asarray(~self._gaps[j, i])

    def _box(self, lon: Array, lat: Array, margin: int) -> tuple[slice, slice]:
        """Return the rows and columns about the points nearest to some places."""
        tree = tree_of(self._vectors.reshape(-1, 3))
        nearest = np.asarray(tree.query(unit_vectors(lon, lat))[1])
        j, i = np.unravel_index(nearest, self.shape)
        rows, across = (
            slice(max(0, int(at.min()) - margin), min(size, int(at.max()) + margin + 1))
            for at, size in ((j, self.shape[0]), (i, self.shape[1]))
        )
        return rows, across

    def cut(self, name: str, lon: Range, lat: Range, centre: float, margin: int) -> Cut:
        """Return the part that a domain [degrees] needs, with a margin of cells; InputError outside.

        Columns are not joined across a seam of the file.
        """
        west, east = eastward(lon)
        require(lat[0] <= lat[1], f"the domain's latitude must rise; got {lat[0]:g} to {lat[1]:g}")
        at_lon, at_lat = np.meshgrid(np.linspace(west, east, 33), np.linspace(*lat, 33))
        rows, across = self._box(at_lon.ravel(), at_lat.ravel(), margin + 1)
        part = CurvedGrid(self.lon[rows, across], self.lat[rows, across])
        frame = LocalFrame.over(lon, lat)
        at = part.indices(frame, *frame.to_local(at_lon, at_lat)).reshape(-1, 2)
        last = np.array(part.shape[::-1]) - 1.0
        inside = bool((at >= -EDGE).all() and (at <= last + EDGE).all())
        own_lon, own_lat = self.bounds
        domain = f"the domain, longitude {lon[0]:g} to {lon[1]:g} and latitude {lat[0]:g} to {lat[1]:g}, lies"
        if not inside:
            raise OutsideError(
                f"{domain} partly outside {name} or across its seam; it holds longitude {own_lon[0]:.6g} to "
                f"{own_lon[1]:.6g}, latitude {own_lat[0]:.6g} to {own_lat[1]:.6g} along curved rows; move or "
                "narrow the domain"
            )
        if not self._open(at, (rows.start, across.start)).all():
            raise OutsideError(
                f"{domain} across a gap between the rows or columns of {name}, where it holds no data; move or "
                "narrow the domain"
            )
        return Cut(rows, np.arange(self.shape[1])[across], part)

    def indices(self, frame: LocalFrame, x: Array, y: Array) -> Array:
        """Return fractional indices (column, row), (..., 2), of places in a frame [m]; linear beyond the ends.

        Newton's method inverts the bilinear map of the cell.
        """
        shape = np.shape(x)
        to = np.stack([np.ravel(x), np.ravel(y)], axis=-1)
        at = np.stack(frame.to_local(self.lon, self.lat), axis=-1)
        last_j, last_i = (n - 2 for n in self.shape)
        nearest = np.asarray(tree_of(at.reshape(-1, 2)).query(to)[1])
        j, i = (part.astype(np.float64) for part in np.unravel_index(nearest, self.shape))
        for _ in range(NEWTON_STEPS):
            cell_j = np.clip(np.floor(j), 0, last_j).astype(np.intp)
            cell_i = np.clip(np.floor(i), 0, last_i).astype(np.intp)
            # beyond the rim the cell is extended straight: its twist would fold far away
            b, a = np.clip(j - cell_j, 0, 1)[:, None], np.clip(i - cell_i, 0, 1)[:, None]
            p00, p10 = at[cell_j, cell_i], at[cell_j + 1, cell_i]
            p01, p11 = at[cell_j, cell_i + 1], at[cell_j + 1, cell_i + 1]
            along = (p01 - p00) * (1 - b) + (p11 - p10) * b
            across = (p10 - p00) * (1 - a) + (p11 - p01) * a
            here = p00 * (1 - a) * (1 - b) + p01 * a * (1 - b) + p10 * (1 - a) * b + p11 * a * b
            here += along * ((i - cell_i)[:, None] - a) + across * ((j - cell_j)[:, None] - b)
            off = to - here
            area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
            area = np.where(np.abs(area) > 0, area, np.inf)  # a cell without area moves nothing
            step_i = (off[:, 0] * across[:, 1] - off[:, 1] * across[:, 0]) / area
            step_j = (off[:, 1] * along[:, 0] - off[:, 0] * along[:, 1]) / area
            i, j = i + step_i, j + step_j
            if max(np.abs(step_i).max(initial=0), np.abs(step_j).max(initial=0)) < SETTLED:
                break
        return np.stack([i, j], axis=-1).reshape(*shape, 2)


Grid = LonLatGrid | CurvedGrid


def grid_of(lon: Array, lat: Array) -> Grid:
    """Return a regular grid of axes (nx), (ny), or of positions (ny, nx) that are axes; else a curved grid."""
    if lon.ndim == 1:
        return LonLatGrid(lon, lat)
    if min(lon.shape) < 2:
        return CurvedGrid(lon, lat)
    first = wrapped(lon[0], float(lon[0, lon.shape[1] // 2]))
    step = max(float(np.abs(np.diff(first)).min()), 1e-9), max(float(np.abs(np.diff(lat[:, 0])).min()), 1e-9)
    off_lon = np.abs(wrapped(lon - lon[0], 0.0)).max() / step[0]
    off_lat = np.abs(lat - lat[:, :1]).max() / step[1]
    rising = bool((np.diff(first) > 0).all() and (np.diff(lat[:, 0]) > 0).all())
    if max(off_lon, off_lat) < EVEN and rising:
        return LonLatGrid(first, np.ascontiguousarray(lat[:, 0]))
    return CurvedGrid(lon, lat)


def columns(lon: Array, centre: float) -> tuple[Index, Array]:
    """Return indices and longitudes of the columns without gaps about `centre`, west to east, modulo 360.

    Longitudes are within 180 degrees of the centre; a file that circles the globe has no seam there.
    """
    turned = wrapped(lon, centre)
    order = np.argsort(turned, kind="stable")
    turned = turned[order]
    steps = np.diff(lon)
    breaks = np.flatnonzero(np.diff(turned) > 1.5 * steps[~gaps(lon)].max()) + 1
    runs = np.split(np.arange(lon.size), breaks)
    run = max(runs, key=lambda r: (bool(turned[r[0]] <= centre <= turned[r[-1]]), r.size))
    return order[run], turned[run]


def span(axis: Array, bounds: Range, margin: int) -> slice:
    """Return the points of the cells that hold the bounds, with a margin if there is one; at least two points."""
    first = max(0, min(int(np.searchsorted(axis, bounds[0], side="right")) - 1, axis.size - 2))
    last = max(first + 1, min(int(np.searchsorted(axis, bounds[1], side="left")), axis.size - 1))
    return slice(max(0, first - margin), min(axis.size, last + margin + 1))


def _fraction(axis: Array, at: Array) -> Array:
    """Return the fractional index of values on a rising axis; linear beyond its ends."""
    even = np.linspace(axis[0], axis[-1], axis.size)
    step = (axis[-1] - axis[0]) / (axis.size - 1)
    if np.abs(axis - even).max() <= EVEN * step:
        return np.asarray((at - axis[0]) / step)
    below = np.clip(np.searchsorted(axis, at, side="right") - 1, 0, axis.size - 2)
    return np.asarray(below + (at - axis[below]) / (axis[below + 1] - axis[below]))


@dataclass(frozen=True)
class IndexMap:
    """The file's fractional indices at even points of the frame, as `OceanGrid` describes them.

    `error` [m]: the largest error in position of a grid point that is read between the points.
    """

    index_map: Array
    per_x: float
    per_y: float
    x_lo: float
    x_hi: float
    y_lo: float
    y_hi: float
    error: float


def index_map(frame: LocalFrame, grid: Grid) -> IndexMap:
    """Return the map of a grid, as fine as MAP_ERROR asks."""
    x, y = frame.to_local(*grid.rim())
    # between the points above the rim may reach further out
    pad_x, pad_y = 0.01 * np.ptp(x), 0.01 * np.ptp(y)
    x_lo, x_hi, y_lo, y_hi = x.min() - pad_x, x.max() + pad_x, y.min() - pad_y, y.max() + pad_y
    along, across = grid.cell_sizes()
    cells = np.array([along.max(), across.max()])
    last = np.array(grid.shape[::-1]) - 1.0

    def indices(side: int, shift_x: float, shift_y: float) -> Array:
        px = x_lo + (np.arange(side) + shift_x) * (x_hi - x_lo) / (side - 1)
        py = y_lo + (np.arange(side) + shift_y) * (y_hi - y_lo) / (side - 1)
        return grid.indices(frame, *np.meshgrid(px, py, indexing="ij"))

    side = 9
    while True:
        known, error = indices(side, 0, 0), 0.0
        between_x = (known[1:, :] + known[:-1, :]) / 2
        between_y = (known[:, 1:] + known[:, :-1]) / 2
        for read, shift in (
            (between_x, (0.5, 0.0)),
            (between_y, (0.0, 0.5)),
            ((between_x[:, 1:] + between_x[:, :-1]) / 2, (0.5, 0.5)),
        ):
            exact = indices(side, *shift)[: read.shape[0], : read.shape[1]]
            inside = ((exact >= 0) & (exact <= last)).all(axis=-1)
            off = np.hypot(*np.moveaxis((read - exact) * cells, -1, 0))
            error = max(error, float(off[inside].max(initial=0)))
        if error <= MAP_ERROR or side >= MAP_SIDE:
            break
        side = 2 * side - 1
    require(
        error <= max(MAP_ERROR, 0.01 * cells.min()),
        f"the grid is too uneven or too near a pole for a flat frame: positions would be wrong by {error:.0f} m; "
        "plan in a smaller area",
    )
    return IndexMap(
        np.ascontiguousarray(known),
        (side - 1) / (x_hi - x_lo),
        (side - 1) / (y_hi - y_lo),
        float(x_lo),
        float(x_hi),
        float(y_lo),
        float(y_hi),
        error,
    )
