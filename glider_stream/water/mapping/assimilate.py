"""Corrects a forecast by measurements: its error is a Gaussian process on the stream function."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array
from ...base.checks import Range
from ...base.errors import InputError
from ...base.settings import require
from ...kernels.flow import velocities
from ..frame import LocalFrame
from ..ocean.file import OceanFile
from ..ocean.flow import ocean_flow
from ..ocean.grid import OutsideError
from ..ocean.reader import LIMIT
from .conditioned import Current, CurrentMap, condition
from .fitting import Fit, fit_scales
from .measured import Measurements, turned_back, within
from .observations import Observations

REACH = 8.0
"""Further than this many lengths from all measurements a correction is below 1e-5 of them: it is left out."""

WIDEST = 20.0
"""Further than this [degrees] from the measurements the frame's lengths are wrong by more than 3 %."""

Values = NDArray[np.float32]


@dataclass(frozen=True)
class Corrected:
    """A forecast corrected by measurements.

    `forecast` as it was, or a calm in place of one (`calm`); `frame`: the plane of the map; `map`: of the
    forecast's error; `fit`: its scales; `before` and `after` [m/s]: the rms difference of the measurements from
    the forecast and from the corrected current; `notes`: what was left out.
    """

    forecast: OceanFile
    frame: LocalFrame
    map: CurrentMap
    fit: Fit
    before: float
    after: float
    notes: tuple[str, ...]
    calm: bool = False

    @cached_property
    def file(self) -> OceanFile:
        """The corrected current, on the forecast's grid, levels and times; land stays land."""
        return self._added(self.map, self._reach, "corrected by measurements")

    def members(self, count: int, seed: int = 0) -> list[OceanFile]:
        """Return so many currents that may be, given the measurements."""
        need = count * (self.forecast.u.nbytes + self.forecast.v.nbytes)
        require(
            need <= LIMIT,
            f"{count} members would take {need / 1e9:.1f} GB, more than {LIMIT / 1e9:.0f}; ask for fewer, or cut "
            "the currents",
        )
        samples = self.map.samples(count, seed)
        return [self._added(sample, np.inf, f"member {n}") for n, sample in enumerate(samples)]

    def updated(self, more: Sequence[Measurements]) -> "Corrected":
        """Return the forecast corrected by further measurements, too, with the same scales."""
        fresh, notes = compared(self.forecast, self.frame, more, self.calm)
        every = Observations.joined([self.map.at, fresh])
        inducing = None if self.map.inducing is None else self.map.inducing.count
        return corrected(self.forecast, self.frame, every, self.fit, inducing, (*self.notes, *notes), self.calm)

    def deviation(self) -> tuple[Values, Values]:
        """Return the standard deviation toward east and north (nt, nz, ny, nx) [m/s]; NaN on land."""
        far = float(np.hypot(self.map.scales.speed, self.map.scales.mean))
        east, north = (np.full(self.forecast.u.shape, far, np.float32) for _ in range(2))
        near, lon, lat, x, y = self._near(self._reach)
        for n, when in enumerate(moments(self.forecast)):
            found = self.map.deviation_on_grid(x, y, self.forecast.depth, np.array([when]))[0]
            # the prior is the same in all directions, and its turn by a few degrees hardly changes what is left
            turn = self.frame.convergence(lon, lat)
            variance = found**2
            cos, sin = np.cos(turn) ** 2, np.sin(turn) ** 2
            east[n][:, near] = np.sqrt(variance[..., 0] * cos + variance[..., 1] * sin)
            north[n][:, near] = np.sqrt(variance[..., 0] * sin + variance[..., 1] * cos)
        land = np.isnan(self.forecast.u)
        east[land] = north[land] = np.nan
        return east, north

    def __str__(self) -> str:
        lines = [
            f"{self.forecast.name}, {'of' if self.calm else 'corrected by'} {self.map.at.count:,} measurements: "
            f"their rms difference from it was {self.before:.3f} m/s and is {self.after:.3f} m/s",
            str(self.fit),
        ]
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as a dictionary for JSON."""
        return {
            "forecast": self.forecast.name,
            "measurements": self.map.at.count,
            "rms_before_mps": self.before,
            "rms_after_mps": self.after,
            "fit": self.fit.as_dict(),
            "notes": list(self.notes),
        }

    @property
    def _reach(self) -> float:
        """How far the correction reaches [lengths]."""
        return REACH if self.map.scales.mean == 0 else np.inf

    def _near(self, reach: float) -> tuple[Any, Array, Array, Array, Array]:
        """Return which columns (ny, nx) lie within so many lengths of the measurements, and where they are."""
        lon, lat = self.forecast.grid.mesh()
        near = _within_reach(self.frame, self.map, lon, lat, reach)
        x, y = self.frame.to_local(lon[near], lat[near])
        return near, lon[near], lat[near], x, y

    def _added(self, correction: Current, reach: float, what: str) -> OceanFile:
        """Return the forecast with a current of the frame added."""
        u, v = self.forecast.u.copy(), self.forecast.v.copy()
        near, lon, lat, x, y = self._near(reach)
        for n, when in enumerate(moments(self.forecast)):
            found = correction.on_grid(x, y, self.forecast.depth, np.array([when]))[0]
            east, north = turned_back(self.frame, lon, lat, found[..., 0], found[..., 1])
            u[n][:, near] += east.astype(np.float32)
            v[n][:, near] += north.astype(np.float32)
        return replace(self.forecast, name=f"{self.forecast.name}, {what}", u=u, v=v)


def _within_reach(frame: LocalFrame, of: CurrentMap, lon: Array, lat: Array, reach: float) -> NDArray[np.bool_]:
    away = np.hypot((np.mod(lon - frame.lon + 180, 360) - 180) * np.cos(np.radians(lat)), lat - frame.lat)
    near = np.asarray(away < WIDEST)
    if not np.isfinite(reach):
        require(
            bool(near.all()),
            f"the currents reach {away.max():.0f} degrees from the measurements, too far for one flat frame; "
            f"cut them to {WIDEST:g} degrees",
        )
        return near
    x, y = frame.to_local(lon[near], lat[near])
    nodes, far = of.at.nodes, reach * of.scales.length
    inside = (x > nodes[0].min() - far) & (x < nodes[0].max() + far)
    inside &= (y > nodes[1].min() - far) & (y < nodes[1].max() + far)
    near[near] = inside
    return near


def moments(file: OceanFile) -> Array:
    """Return the file's times in seconds from its first; 0 where it is steady."""
    if file.times is None or file.steady:
        return np.zeros(1)
    return np.asarray((file.times - file.times[0]) / np.timedelta64(1, "ms") / 1000.0)


def assimilate(
    forecast: OceanFile,
    measurements: Sequence[Measurements],
    scales: Mapping[str, float] | None = None,
    *,
    kernel: str = "matern",
    inducing: int | None = None,
    seed: int = 0,
) -> Corrected:
    """Return a forecast corrected by measurements of its time and area.

    `scales`: those of the forecast's error that are known, see `fit_scales`; the others are fitted. Its error has
    no constant part: it fades with distance from the measurements. A measurement outside the forecast's area or
    times is left out, and a note says so.
    """
    require(len(measurements) > 0, "a correction needs measurements; got none: add dives, points or drifters")
    known = dict(scales or {})
    require(
        known.get("mean", 0.0) == 0.0,
        "the error of a forecast has no constant current; leave `mean` out, or correct it in the file",
    )
    frame = frame_of(measurements)
    observations, notes = compared(forecast, frame, measurements)
    fit = fit_for(forecast, observations, known | {"mean": 0.0}, kernel, seed)
    held = fit.held | {"mean": "the error of a forecast fades with distance"}
    return corrected(forecast, frame, observations, replace(fit, held=held), inducing, notes)


def fit_for(on: OceanFile, at: Observations, known: Mapping[str, float], kernel: str, seed: int) -> Fit:
    """Return the fitted scales of a current on the levels of a file: one level is held at all depths."""
    if not on.surface or "depth" in known:
        return fit_scales(at, known, kernel=kernel, seed=seed)
    fit = fit_scales(at, {**known, "depth": np.inf}, kernel=kernel, seed=seed)
    return replace(fit, held=fit.held | {"depth": f"{on.name} has one level, which is held at all depths"})


def frame_of(measurements: Sequence[Measurements]) -> LocalFrame:
    """Return the frame about the middle of measurements, also across the date line."""
    lon, lat = (np.concatenate(parts) for parts in zip(*(part.places for part in measurements), strict=True))
    turn = np.exp(1j * np.radians(lon)).sum()
    return LocalFrame(float(np.degrees(np.angle(turn))), float(np.mean(lat)))


def corrected(
    forecast: OceanFile,
    frame: LocalFrame,
    observations: Observations,
    fit: Fit,
    inducing: int | None,
    notes: tuple[str, ...],
    calm: bool = False,
) -> Corrected:
    """Return a forecast corrected by what measurements differ by from it, with fitted scales."""
    found = condition(observations, fit.scales, inducing=inducing)
    at = (observations.x, observations.y, observations.depth, observations.t)
    left = observations.less(found.velocity(*at)).values
    rms = [float(np.sqrt((part**2).sum() / observations.count)) for part in (observations.values, left)]
    return Corrected(forecast, frame, found, fit, rms[0], rms[1], notes, calm)


def compared(
    forecast: OceanFile, frame: LocalFrame, measurements: Sequence[Measurements], calm: bool = False
) -> tuple[Observations, tuple[str, ...]]:
    """Return what the measurements differ by from the forecast, and notes on those that are left out.

    Of a `calm` they may lie outside, too.
    """
    notes: list[str] = []
    parts: list[Observations] = []
    steady = forecast.times is None or (forecast.steady and not calm)
    epoch = None if steady or forecast.times is None else forecast.times[0]
    if calm:
        every = [part.observations(frame, epoch) for part in measurements]
        return Observations.joined(every), tuple(note for part in measurements for note in part.notes)
    for part in measurements:
        notes += part.notes
        inside, missed = _inside(forecast, part)
        notes += missed
        if inside.any():
            parts.append(part.take(inside).observations(frame, epoch))
    if not parts:
        why = "; ".join(notes) or "none was given"
        raise InputError(f"no measurement can be compared with {forecast.name}: {why}")
    if epoch is None and any(part.times is not None for part in measurements):
        notes.append(f"{forecast.name} holds a single time: the times of measurements are not used")
    joined = Observations.joined(parts)
    deepest = float(forecast.depth[-1])
    if not forecast.surface and (joined.depth > deepest).any():
        notes.append(
            f"measurements reach {joined.depth.max():.0f} m: below {deepest:.0f} m, where {forecast.name} ends, "
            "its deepest level is used"
        )
    return joined.less(_forecast_at(forecast, frame, joined, epoch)), tuple(dict.fromkeys(notes))


def _inside(forecast: OceanFile, part: Measurements) -> tuple[NDArray[np.bool_], list[str]]:
    """Return which measurements lie in the forecast's area and times, and notes on the others."""
    lon, lat = (values.reshape(-1, part.count) for values in part.places)
    on = np.array([[forecast.grid.nearest_place(*at) is not None for at in zip(*ends, strict=True)]
                   for ends in zip(lon, lat, strict=True)]).all(axis=0)  # fmt: skip
    notes = []
    if not on.all():
        notes.append(f"{int((~on).sum())} of {part.count} measurements lie outside the area of {forecast.name}")
    times = part.times
    if forecast.times is not None and not forecast.steady:
        require(
            times is not None,
            f"{forecast.name} changes with time, {forecast.time_range}: give the time of each measurement",
        )
        assert times is not None
        during = within(times, forecast.times[0], forecast.times[-1])
        if not during.all():
            notes.append(
                f"{int((~during).sum())} of {part.count} measurements lie outside the times of {forecast.name}, "
                f"{forecast.time_range}"
            )
        on &= during
    return np.asarray(on), notes


def _forecast_at(forecast: OceanFile, frame: LocalFrame, at: Observations, epoch: np.datetime64 | None) -> Array:
    """Return the forecast's current (m, 2) at the nodes of measurements, in the frame's directions [m/s]."""
    lon, lat = frame.to_lonlat(at.x, at.y)
    deepest = 0.0 if forecast.surface else float(forecast.depth[-1])
    depth = np.clip(at.depth, 0.0 if forecast.surface else forecast.top, deepest)
    start = None if epoch is None else str(epoch)
    try:
        flow, _ = ocean_flow(forecast, frame, _range(lon), _range(lat), _range(depth), start)
    except OutsideError as error:
        raise InputError(f"measurements lie at the rim of {forecast.name}: {error}") from None
    when = np.clip(at.t, *_range(moments(forecast)))
    return np.asarray(velocities(flow, at.x, at.y, -depth, when))


def _range(values: Array) -> Range:
    return float(values.min()), float(values.max())
