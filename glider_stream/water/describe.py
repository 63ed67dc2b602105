"""A summary of a current file: what it holds and how the planner reads it. Read it before you trust a route."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.terminal import plain
from .frame import MAX_SCALE_ERROR, LocalFrame
from .ocean import LonLatGrid, Names, OceanFile, divergence_ratio, index_map, read_currents, sample
from .ocean.component import TooLargeError
from .ocean.grid import OutsideError

Place = tuple[float, float, float | None, str | None]

DEPTHS = (0.0, 50.0, 200.0, 500.0, 1000.0, 2000.0)
"""The summary shows the levels that are nearest to these depths [m]."""
LOOK = 2e8
"""A file that would take more memory than this [bytes] is read only around the points that the user gives."""
NEARLY_FREE = 0.35
"""Fields with a ratio of divergence to vorticity up to this value are mesoscale; coastal ones begin near 0.45."""


@dataclass(frozen=True)
class Level:
    """The current at one depth [m]: maximum and rms speed [m/s] and the ratio of divergence to vorticity.

    A value is None if the level holds no water.
    """

    depth: float
    max_speed: float | None
    rms_speed: float | None
    divergence_ratio: float | None


@dataclass(frozen=True)
class Point:
    """A place, a time and the current there [m/s], None where the file has no water or no data."""

    lon: float
    lat: float
    depth: float | None
    time: str | None
    u_east: float | None
    v_north: float | None


@dataclass(frozen=True)
class Description:
    """The currents of a file in a few numbers; `str` gives text for people, `as_dict` a dictionary for JSON."""

    file: OceanFile
    levels: tuple[Level, ...]
    divergence_ratio: float | None
    frame_error: float
    map_error: float | None
    points: tuple[Point, ...]

    @property
    def spacing(self) -> tuple[float, float, float, float]:
        """Median spacing in longitude and latitude [degrees], then along and across the rows [km]."""
        lon, lat = self.file.grid.mesh()
        steps = np.diff(lon % 360, axis=1), np.diff(lat, axis=0)
        east, north = (float(np.median(np.abs(step))) for step in steps)
        along, across = self.file.grid.cell_sizes()
        return east, north, float(np.median(along)) / 1000, float(np.median(across)) / 1000

    @property
    def shape_of_grid(self) -> str:
        """ "regular" if the rows follow parallels, else "curved"."""
        return "regular" if isinstance(self.file.grid, LonLatGrid) else "curved"

    @property
    def land(self) -> float:
        """Share of the columns that have no water at the top level."""
        return float(1 - self.file.wet[0].mean())

    def as_dict(self) -> dict[str, Any]:
        """Return the description as a dictionary for JSON."""
        file, spacing = self.file, self.spacing
        return {
            "file": file.name,
            "took": file.took,
            "grid": self.shape_of_grid,
            "lon": list(file.grid.bounds[0]),
            "lat": list(file.grid.bounds[1]),
            "shape": dict(zip(("time", "depth", "lat", "lon"), file.u.shape, strict=True)),
            "spacing_degrees": list(spacing[:2]),
            "spacing_km": list(spacing[2:]),
            "times": None if file.times is None else [f"{t}Z" for t in file.times.astype("datetime64[s]")],
            "depths_m": None if file.surface else [float(depth) for depth in file.depth],
            "land_share": self.land,
            "levels": [
                {
                    "depth_m": level.depth,
                    "max_speed": level.max_speed,
                    "rms_speed": level.rms_speed,
                    "divergence_ratio": level.divergence_ratio,
                }
                for level in self.levels
            ],
            "divergence_ratio": self.divergence_ratio,
            "frame_scale_error": self.frame_error,
            "index_map_error_m": self.map_error,
            "notes": list(file.notes),
            "points": [dict(vars(point)) for point in self.points],
        }

    def __str__(self) -> str:
        file, (dlon, dlat, east, north) = self.file, self.spacing
        nt, nz, ny, nx = file.u.shape
        lines = [plain(file.name), *(f"  {self._told(point)}" for point in self.points)]
        lines += [f"  {plain(key):<12}{plain(what)}" for key, what in file.took.items()]
        (west, east_end), (south, north_end) = file.grid.bounds
        lines.append(f"  extent      lon {west:.5g} to {east_end:.5g}, ")
        lines[-1] += f"lat {south:.5g} to {north_end:.5g}; {100 * self.land:.0f} % land"
        lines.append(
            f"  grid        {self.shape_of_grid}, {nx} x {ny} points, every {dlon:.4g} x {dlat:.4g} degrees"
        )
        lines[-1] += f", {east:.3g} x {north:.3g} km"
        lines.append(f"  times       {file.time_range}" + (f", {nt} of them" if nt > 1 else ""))
        levels = "not given" if file.surface else f"{file.depth[0]:.4g} to {file.depth[-1]:.6g} m, {nz} levels"
        lines.append(f"  depths      {levels}")
        for level in self.levels:
            speeds = "no water"
            if level.max_speed is not None:
                speeds = f"at most {level.max_speed:.2f} m/s, rms {level.rms_speed:.2f} m/s"
            lines.append(f"  at {f'{level.depth:.4g} m':<9}{speeds}")
        lines.append(f"  divergence  {self._meaning()}")
        lines.append(f"  flat map    {self._frame()}")
        return "\n".join([*lines, *(f"  note        {plain(note)}" for note in file.notes)])

    def _told(self, point: Point) -> str:
        """Return a place and the current there, for people."""
        (west, east), (south, north) = self.file.grid.bounds
        where = f"{point.lon:g}, {point.lat:g}"
        where += "" if point.depth is None else f", {point.depth:g} m"
        where += "" if point.time is None else f", {point.time}"
        if point.u_east is None or point.v_north is None:
            held = south <= point.lat <= north and (point.lon - west) % 360 <= east - west
            return f"{where}: " + ("no water, or no data" if held else "outside the file's extent")
        speed, toward = np.hypot(point.u_east, point.v_north), np.degrees(np.arctan2(point.u_east, point.v_north))
        whole = f"{speed:.3f} m/s toward compass {toward % 360:.0f} deg"
        return f"{where}: {point.u_east:+.5f} m/s east, {point.v_north:+.5f} m/s north; {whole}"

    def _meaning(self) -> str:
        ratio = self.divergence_ratio
        if ratio is None:
            return "unknown: no wet cell has wet neighbours that move"
        if ratio <= NEARLY_FREE:
            return f"small, {ratio:.2f} of vorticity: legs by any steering method fit"
        return (
            f"large, {ratio:.2f} of vorticity: the method streamline misses more often, because its stream value "
            "depends on the path; flow-map is not affected"
        )

    def _frame(self) -> str:
        if self.frame_error > MAX_SCALE_ERROR:
            return "the whole extent is too wide for one, on which plans are made: plan in a smaller area"
        off = f"off by up to {100 * self.frame_error:.3f} % in length"
        text = f"plans are made on one; over the whole extent it is {off}"
        return text if self.map_error is None else f"{text}, by {self.map_error:.2g} m in place"


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _level(file: OceanFile, k: int) -> Level:
    squared = file.u[:, k].astype(np.float64) ** 2 + file.v[:, k].astype(np.float64) ** 2
    squared = squared[np.isfinite(squared)]
    depth, ratio = float(file.depth[k]), _finite(divergence_ratio(file, k))
    if not squared.size:
        return Level(depth, None, None, ratio)
    return Level(depth, float(squared.max()) ** 0.5, float(squared.mean()) ** 0.5, ratio)


def describe(
    files: str | Path | Sequence[str | Path],
    at: Sequence[Place] = (),
    names: Names | Mapping[str, Any] | None = None,
) -> Description:
    """Return what the current files hold, and the current at some places (lon, lat, depth [m], time or None).

    The values are those that a planner reads. If a file has several times, each place needs a time.
    """
    file, points = _looked_at(files, at, names)
    near = dict.fromkeys(
        int(np.abs(file.depth - d).argmin()) for d in (*DEPTHS, file.depth[-1]) if d <= file.depth[-1]
    )
    lon, lat = file.grid.bounds
    frame = LocalFrame.over(lon, lat)
    # an extent of half the globe is too wide for any stereographic frame
    frame_error = 1.0 if lon[1] - lon[0] >= 180 else min(1.0, frame.scale_error(lon, lat))
    return Description(
        file=file,
        levels=tuple(_level(file, k) for k in near),
        divergence_ratio=_finite(divergence_ratio(file)),
        frame_error=frame_error,
        map_error=None if frame_error > MAX_SCALE_ERROR else index_map(frame, file.grid).error,
        points=points,
    )


def _looked_at(
    files: str | Path | Sequence[str | Path], at: Sequence[Place], names: Names | Mapping[str, Any] | None
) -> tuple[OceanFile, tuple[Point, ...]]:
    """Return the file and the current at some places; of a large file only the parts around them are read."""
    if not at:
        return read_currents(files, names), ()
    try:
        whole = read_currents(files, names, limit=LOOK)
        return whole, tuple(_point(whole, place) for place in at)
    except TooLargeError as error:
        size = str(error).partition(" (")[0]
    first, points = None, []
    for place in at:
        part = _about(files, names, place)
        points.append(Point(*place, None, None) if part is None else _point(part, place))
        first = first or part
    if first is None:
        return read_currents(files, names), tuple(points)
    note = f"{size}: only the parts around the given places were read; this summary is of the first part"
    return replace(first, notes=(*first.notes, note)), tuple(points)


def _about(
    files: str | Path | Sequence[str | Path], names: Names | Mapping[str, Any] | None, place: Place
) -> OceanFile | None:
    """Return the columns around a place, or None if the file does not cover it."""
    try:
        return read_currents(files, names, lon=(place[0], place[0]), lat=(place[1], place[1]))
    except OutsideError:
        return None


def _point(file: OceanFile, place: Place) -> Point:
    current = sample(file, *place)
    return Point(*place, *((None, None) if current is None else current))
