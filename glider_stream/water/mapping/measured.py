"""Measurements as people have them: in degrees, with dates, toward east and north."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array, Bools, Index
from ...base.settings import require
from ..frame import LocalFrame
from ..ocean.file import Times
from .observations import Observations, at_points, dive_averages, drifts

METRES_PER_DEGREE = 111e3
"""Of latitude, roughly: enough to find a wrong fix."""
FASTEST = 5.0
"""A measured current above this [m/s] is an error of the file."""


class Measurements(Protocol):
    """Measurements of one kind."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out or assumed."""
        ...

    @property
    def places(self) -> tuple[Array, Array]:
        """Longitudes and latitudes of all places [degrees]."""
        ...

    @property
    def times(self) -> tuple[Times, Times] | None:
        """When each measurement begins and ends (n), or None if unknown."""
        ...

    @property
    def count(self) -> int:
        """The number of measurements."""
        ...

    def take(self, which: Index | Bools) -> "Measurements":
        """Return some of the measurements."""
        ...

    def observations(self, frame: LocalFrame, epoch: np.datetime64 | None) -> Observations:
        """Return the measurements in a frame, with times counted from `epoch`; without it, all at t = 0."""
        ...


def seconds(times: Times, epoch: np.datetime64 | None) -> Array:
    """Return times in seconds from `epoch`, or zeros without it."""
    if epoch is None:
        return np.zeros(times.size)
    return np.asarray((times - epoch) / np.timedelta64(1, "ms") / 1000.0)


def turned(frame: LocalFrame, lon: Array, lat: Array, east: Array, north: Array) -> tuple[Array, Array]:
    """Return currents toward east and north in the frame's directions."""
    turn = frame.convergence(lon, lat)
    return east * np.cos(turn) - north * np.sin(turn), east * np.sin(turn) + north * np.cos(turn)


def turned_back(frame: LocalFrame, lon: Array, lat: Array, u: Array, v: Array) -> tuple[Array, Array]:
    """Return currents in the frame's directions toward east and north."""
    turn = frame.convergence(lon, lat)
    return u * np.cos(turn) + v * np.sin(turn), v * np.cos(turn) - u * np.sin(turn)


class _Table:
    """Rows of equally long columns: all fields but the settings."""

    settings = ("notes", "yos")

    def take(self, which: Index | Bools) -> Self:
        """Return some of the rows."""
        columns: dict[str, Any] = {
            part.name: getattr(self, part.name)
            if part.name in self.settings or getattr(self, part.name) is None
            else getattr(self, part.name)[which]
            for part in fields(self)  # type: ignore[arg-type]
        }
        return type(self)(**columns)


@dataclass(frozen=True)
class Points(_Table):
    """Currents at points: `lon`, `lat` [degrees], `depth` [m], `time` (UTC); `east`, `north`, `error` [m/s]."""

    lon: Array
    lat: Array
    depth: Array
    time: Times | None
    east: Array
    north: Array
    error: Array
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _check("a point", self.lon, self.lat, self.east, self.north)

    @property
    def count(self) -> int:
        """See Measurements."""
        return self.lon.size

    @property
    def places(self) -> tuple[Array, Array]:
        """See Measurements."""
        return self.lon, self.lat

    @property
    def times(self) -> tuple[Times, Times] | None:
        """See Measurements."""
        return None if self.time is None else (self.time, self.time)

    def observations(self, frame: LocalFrame, epoch: np.datetime64 | None) -> Observations:
        """See Measurements."""
        u, v = turned(frame, self.lon, self.lat, self.east, self.north)
        t = np.zeros(self.count) if self.time is None else seconds(self.time, epoch)
        return at_points(*frame.to_local(self.lon, self.lat), self.depth, u, v, t=t, error=self.error)


@dataclass(frozen=True)
class _Ways(_Table):
    """Ways from one place and time to another."""

    lon: Array
    lat: Array
    lon_end: Array
    lat_end: Array
    start: Times
    end: Times

    @property
    def count(self) -> int:
        """See Measurements."""
        return self.lon.size

    @property
    def places(self) -> tuple[Array, Array]:
        """See Measurements."""
        return np.concatenate([self.lon, self.lon_end]), np.concatenate([self.lat, self.lat_end])

    @property
    def times(self) -> tuple[Times, Times] | None:
        """See Measurements."""
        return self.start, self.end

    def _ends(self, frame: LocalFrame) -> tuple[Array, Array]:
        """Return where the ways begin and end (n, 2) [m] in a frame."""
        begin = np.stack(frame.to_local(self.lon, self.lat), axis=-1)
        return begin, np.stack(frame.to_local(self.lon_end, self.lat_end), axis=-1)


@dataclass(frozen=True)
class Dives(_Ways):
    """Currents averaged over dives, `east`, `north` and `error` [m/s], as gliders compute them at the surface.

    From `lon`, `lat` to `lon_end`, `lat_end` [degrees], from `start` to `end` (UTC), to the depth `bottom` [m]
    and back, with so many `yos`.
    """

    bottom: Array
    east: Array
    north: Array
    error: Array
    yos: int = 1
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _check("a dive", self.lon, self.lat, self.east, self.north)
        _check("a dive", self.lon_end, self.lat_end, self.east, self.north)
        self._check_ways()

    def _check_ways(self) -> None:
        """Raise InputError if a dive ends before it starts, or too far away for its time."""
        lasting = (self.end - self.start) / np.timedelta64(1, "s")
        back = np.flatnonzero(lasting < 0)
        when = f"the dive of {self.start[back[0]]} ends before, at {self.end[back[0]]}" if back.size else ""
        require(not back.size, f"{when}; mend its times")
        # dives of files that give one time, that of their middle or end, have a place for each end
        known = np.flatnonzero(lasting > 0)
        middle = np.radians((self.lat + self.lat_end) / 2)
        east = ((self.lon_end - self.lon + 180) % 360 - 180) * np.cos(middle)
        speed = METRES_PER_DEGREE * np.hypot(east, self.lat_end - self.lat)[known] / lasting[known]
        if speed.size and speed.max() > FASTEST:
            n = known[speed.argmax()]
            ends = f"the dive of {self.start[n]} ends {speed.max() * lasting[n] / 1000:,.0f} km from its start"
            require(False, f"{ends}, at {speed.max():.1f} m/s, faster than any glider; mend its fixes or times")

    def observations(self, frame: LocalFrame, epoch: np.datetime64 | None) -> Observations:
        """See Measurements."""
        begin, finish = self._ends(frame)
        u, v = turned(frame, self.lon, self.lat, self.east, self.north)
        times = seconds(self.start, epoch), seconds(self.end, epoch)
        return dive_averages(begin, finish, self.bottom, u, v, times=times, error=self.error, yos=self.yos)


@dataclass(frozen=True)
class Drifters(_Ways):
    """Displacements of drifters, each from `lon`, `lat` [degrees] at `start` (UTC) to the next fix at `end`.

    `depth` [m]: of the drogue; `error` [m/s]: of the mean current. Between fixes the path is taken as straight
    and its speed as even.
    """

    depth: Array
    error: Array
    notes: tuple[str, ...] = ()

    @classmethod
    def from_fixes(
        cls,
        drifter: Sequence[str],
        lon: Array,
        lat: Array,
        time: Times,
        depth: Array,
        error: Array,
    ) -> "Drifters":
        """Return the displacements between the fixes (n) of drifters; `drifter` (n) names each fix's drifter."""
        names = np.array(drifter)
        order = np.lexsort((time, names))
        ahead = [(a, b) for a, b in pairwise(order) if names[a] == names[b]]
        require(len(ahead) > 0, "drifters need at least two fixes of one drifter; got none")
        first, second = np.array(ahead).T
        same = time[first] == time[second]
        require(not same.any(), f"drifter {names[first[same]][:1]} has two fixes at one time; leave one out")
        ends = (lon[second], lat[second], time[first], time[second])
        return cls(lon[first], lat[first], *ends, depth[first], error[first])

    def observations(self, frame: LocalFrame, epoch: np.datetime64 | None) -> Observations:
        """See Measurements."""
        begin, finish = self._ends(frame)
        # the times of a steady map are all 0, but a displacement takes its time
        lasting = seconds(self.end, self.start[0]) - seconds(self.start, self.start[0])
        fastest = float((np.hypot(*(finish - begin).T) / lasting).max())
        require(
            fastest <= FASTEST, f"a drifter moves at {fastest:.1f} m/s, faster than any current; mend its fixes"
        )
        since = seconds(self.start, epoch)
        parts = [
            drifts(
                np.array([a[0], b[0]]),
                np.array([a[1], b[1]]),
                np.array([0.0, long]),
                float(deep),
                error=float(error),
            )
            for a, b, long, deep, error in zip(begin, finish, lasting, self.depth, self.error, strict=True)
        ]
        joined = Observations.joined(parts)
        when = joined.t + since[joined.owner()] if epoch is not None else np.zeros_like(joined.t)
        at = (joined.first, joined.x, joined.y, joined.depth, when, joined.weight)
        return Observations(joined.u, joined.v, joined.error, *at)


def _check(what: str, lon: Array, lat: Array, east: Array, north: Array) -> None:
    require(bool((np.abs(lon) <= 720).all()), f"{what} has no longitude in degrees; mend it, or leave it out")
    require(bool((np.abs(lat) <= 90).all()), f"{what} has a latitude beyond a pole; mend it, or swap it with lon")
    fastest = float(np.hypot(east, north).max(initial=0.0))
    require(fastest <= FASTEST, f"{what} has a current of {fastest:.3g} m/s, above {FASTEST:g}; give m/s")


def within(times: tuple[Times, Times], first: np.datetime64, last: np.datetime64) -> NDArray[np.bool_]:
    """Return which measurements begin and end between two times."""
    return np.asarray((times[0] >= first) & (times[1] <= last))
