"""Maps currents where no forecast exists: on a grid of longitudes and latitudes, from measurements alone."""

from collections.abc import Mapping, Sequence

import numpy as np

from ...base.arrays import Array
from ...base.checks import Range
from ...base.settings import require
from ..frame import MAX_SCALE_ERROR, eastward
from ..ocean.file import OceanFile, Times, parse_time
from ..ocean.grid import EARTH, LonLatGrid
from ..ocean.levels import held_above
from .assimilate import Corrected, compared, corrected, fit_for, frame_of
from .measured import Measurements

MOST_POINTS = 20_000_000
"""A map may have at most this many points: columns times depths times times."""
FAR = 3.0
"""So many scales of time off, a current is alike by less than 4 %."""


def map_currents(
    measurements: Sequence[Measurements],
    lon: Range,
    lat: Range,
    spacing: float,
    depth: Sequence[float] = (0.0,),
    times: Sequence[str] = (),
    scales: Mapping[str, float] | None = None,
    *,
    kernel: str = "matern",
    inducing: int | None = None,
    seed: int = 0,
) -> Corrected:
    """Return a map of the current over `lon`, `lat` [degrees], every `spacing` [m] at most, from measurements.

    At depths [m], and at `times` (ISO 8601, UTC), which are needed where the measurements are of several times. A
    single depth of 0 is held at all depths, and the current is then the same at all of them, unless the scale
    `depth` is given. Far from all measurements the map is the constant current that they have in common, and its
    deviation says how little that means. It knows no land and no bottom.
    """
    require(len(measurements) > 0, "a map needs measurements; got none: add dives, points or drifters")
    moments = np.array([parse_time(text, "`times`") for text in times], dtype="datetime64[ms]")
    timed = [part.times is not None for part in measurements]
    require(all(timed) or not any(timed), "some measurements have a time and others do not; give all of them one")
    if not moments.size and all(timed):
        every = np.concatenate([end for part in measurements for end in part.times or ()])
        require(
            bool((every == every[0]).all()) or not np.isfinite((scales or {}).get("time", 0.0)),
            f"the measurements are of {every.min().astype('datetime64[s]')}Z to "
            f"{every.max().astype('datetime64[s]')}Z: say for which `times` to make the map, or set the scale "
            "`time` to inf if the current is steady",
        )
        moments = every[:1]
    require(
        not moments.size or all(timed), "`times` need measurements with times; leave them out, or add the times"
    )
    calm = _calm(lon, lat, spacing, np.array(depth, dtype=np.float64), moments)
    frame = frame_of(measurements)
    error = frame.scale_error(lon, lat)
    require(
        error <= MAX_SCALE_ERROR,
        f"the map is too wide for a flat frame about its measurements, whose lengths would be wrong by "
        f"{100 * error:.1f} %; make it smaller",
    )
    observations, notes = compared(calm, frame, measurements, calm=True)
    fit = fit_for(calm, observations, dict(scales or {}), kernel, seed)
    notes = (*notes, *_far_in_time(moments, measurements, fit.scales.time))
    return corrected(calm, frame, observations, fit, inducing, notes, calm=True)


def _far_in_time(moments: Times, measurements: Sequence[Measurements], scale: float) -> list[str]:
    """Return a note for each time of a map that lies FAR scales [s] or more from all measurements."""
    every = [end for part in measurements for end in part.times or ()]
    notes = []
    for moment in moments if every and np.isfinite(scale) else ():
        off = float(np.abs((np.concatenate(every) - moment) / np.timedelta64(1, "ms")).min()) / 1000.0
        if off >= FAR * scale:
            far = f"{off / 86_400:.3g} days off, {off / scale:.1f} times the scale `time`"
            what = f"the map of {moment.astype('datetime64[s]')}Z knows hardly anything"
            notes.append(f"{what}: its nearest measurement is {far}")
    return notes


def _calm(lon: Range, lat: Range, spacing: float, depth: Array, times: Times) -> OceanFile:
    """Return a current of 0 on the grid of a map."""
    west, east = eastward(lon)
    require(west < east and lat[0] < lat[1], f"a map's area must rise; got lon {list(lon)}, lat {list(lat)}")
    require(max(map(abs, lat)) < 85, f"a map must stay within 85 degrees of the equator; got {list(lat)}")
    require(spacing > 0, f"`spacing` must be above 0 m; got {spacing:g}")
    require(
        depth.size > 0 and bool((np.diff(depth) > 0).all()) and float(depth[0]) >= 0,
        f"the depths of a map must rise from 0 or below; got {depth.tolist()}",
    )
    require(bool((times[1:] > times[:-1]).all()), "the times of a map must rise; sort them")
    widest = float(np.cos(np.radians(0.0 if lat[0] * lat[1] < 0 else min(map(abs, lat)))))
    degree = EARTH * np.pi / 180
    points = [(east - west) * degree * widest / spacing + 1, (lat[1] - lat[0]) * degree / spacing + 1]
    total = float(np.prod(points)) * depth.size * max(times.size, 1)
    require(
        total <= MOST_POINTS,
        f"the map would have {total:.3g} points, more than {MOST_POINTS:,}; widen `spacing`, or leave out depths "
        "or times",
    )
    nx, ny = (max(2, int(np.ceil(count - 1e-9))) for count in points)
    grid = LonLatGrid(np.linspace(west, east, nx), np.linspace(*lat, ny))
    shape = (max(times.size, 1), depth.size, ny, nx)
    surface = depth.size == 1 and float(depth[0]) == 0
    return OceanFile(
        name="a map",
        grid=grid,
        depth=depth,
        times=times if times.size else None,
        u=np.zeros(shape, np.float32),
        v=np.zeros(shape, np.float32),
        wet=np.ones(shape[1:], dtype=bool),
        surface=surface,
        took={},
        notes=(),
        seabed=np.full((ny, nx), np.inf),
        lower=np.array([np.inf]) if surface else depth,
        top=0.0 if surface else held_above(depth),
    )
