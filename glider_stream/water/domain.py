"""Domains: the box in which nodes are placed, in metres or in degrees."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import Array
from ..base.checks import Range, check_range
from ..base.settings import from_table, require

if TYPE_CHECKING:
    from .frame import LocalFrame

Point = tuple[float, float, float]


ROUNDED = 1e-9
"""Rounding error [degrees] of a place that was converted to the frame's metres and back."""


def _within(value: float, bounds: Range) -> bool:
    return bounds[0] <= value <= bounds[1]


@dataclass(frozen=True)
class BoxDomain:
    """A domain in metres: x, y and z are [lo, hi]; z points upward and the surface is at z = 0."""

    x: Range
    y: Range
    z: Range

    def __post_init__(self) -> None:
        for name in ("x", "y", "z"):
            check_range(getattr(self, name), f"domain.{name}")
        require(self.z[1] <= 0, f"`domain.z` must end at 0 (the surface) or below; got {self.z[1]:g}")

    def frame(self) -> None:
        """None: a domain in metres has no longitude and latitude."""
        return

    def box(self) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) [m]."""
        low, high = zip(self.x, self.y, self.z, strict=True)
        return np.array(low), np.array(high)

    def point(self, values: Point) -> Array:
        """Return the point x, y, z of this domain in the local frame, (3,) [m]."""
        return np.array(values)

    def outside(self, x: float, y: float) -> str:
        """Return a message if the place x, y [m] lies outside the domain, else an empty text.

        The message says whether the place would lie inside with x and y swapped.
        """
        if _within(x, self.x) and _within(y, self.y):
            return ""
        bounds = f"x from {self.x[0]:g} to {self.x[1]:g} m and y from {self.y[0]:g} to {self.y[1]:g} m"
        swapped = _within(y, self.x) and _within(x, self.y)
        cure = (
            "with x and y swapped it would lie inside: give X,Y,Z"
            if swapped
            else "move it inside, or widen [domain]"
        )
        return f"outside the domain, {bounds}; {cure}"


@dataclass(frozen=True)
class GeographicDomain:
    """A domain in degrees: lon and lat are [lo, hi] in degrees, depth is [lo, hi] in metres, downward.

    The nodes lie in the largest upright rectangle of the local frame that fits within these bounds. Points are
    given as lon, lat, depth.
    """

    lon: Range
    lat: Range
    depth: Range

    def __post_init__(self) -> None:
        for name in ("lat", "depth"):
            check_range(getattr(self, name), f"domain.{name}")
        top = self.depth[0]
        require(top >= 0, f"`domain.depth` must begin at 0 (the surface) or deeper; got {top:g}")
        poleward = max(abs(bound) for bound in self.lat)
        require(poleward <= 85, f"`domain.lat` must stay within 85 degrees of the equator; got {poleward:g}")
        width = self.width
        require(0 < width < 90, f"`domain.lon` must span 0 to 90 degrees eastward; got {list(self.lon)}")

    @property
    def width(self) -> float:
        """Width of the domain [degrees of longitude], from west to east; a domain may cross the date line."""
        span = self.lon[1] - self.lon[0]
        return span + 360 if span < -180 else span

    def frame(self) -> "LocalFrame":
        """The local frame, centred on the domain."""
        from .frame import LocalFrame

        return LocalFrame(lon=self.lon[0] + self.width / 2, lat=sum(self.lat) / 2)

    def box(self) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) [m]."""
        frame, share = self.frame(), np.linspace(0, 1, 65)
        lon, lat = self.lon[0] + share * self.width, self.lat[0] + share * (self.lat[1] - self.lat[0])
        west, east = (frame.to_local(np.full(65, edge), lat)[0] for edge in (lon[0], lon[-1]))
        south, north = (frame.to_local(lon, np.full(65, edge))[1] for edge in self.lat)
        low = [west.max(), south.max(), -self.depth[1]]
        return np.array(low), np.array([east.min(), north.min(), 0.0 - self.depth[0]])

    def point(self, values: Point) -> Array:
        """Return the point lon, lat, depth of this domain in the local frame, (3,) [m]."""
        lon, lat, depth = values
        on_earth = abs(lat) < 90 and abs(lon) <= 360
        swapped = abs(lon) < 90 and abs(lat) <= 360 and self._holds(lat, lon)
        hint = "; with longitude and latitude swapped it would lie inside the domain" if swapped else ""
        cure = f"give LON,LAT,DEPTH{hint}"
        require(on_earth, f"{lon:g}, {lat:g} are not a longitude and a latitude in degrees; {cure}")
        require(0 <= depth < math.inf, f"the depth must be at least 0 m, downward; got {depth:g}")
        x, y = self.frame().to_local(np.array([lon]), np.array([lat]))
        return np.array([x[0], y[0], 0.0 - depth])

    def _holds(self, lon: float, lat: float) -> bool:
        """Whether the place [degrees] lies in the domain."""
        east = (lon - self.lon[0] + ROUNDED) % 360
        return east <= self.width + 2 * ROUNDED and self.lat[0] - ROUNDED <= lat <= self.lat[1] + ROUNDED

    def outside(self, lon: float, lat: float) -> str:
        """Return a message if the place [degrees] lies outside the domain, else an empty text.

        The message says whether the place would lie inside with longitude and latitude swapped.
        """
        if self._holds(lon, lat):
            return ""
        (west, east), (south, north) = self.lon, self.lat
        bounds = f"longitude {west:g} to {east:g} and latitude {south:g} to {north:g} degrees"
        cure = "move it inside, or widen [domain]"
        if self._holds(lat, lon):
            cure = "with longitude and latitude swapped it would lie inside: give LON,LAT,DEPTH"
        return f"outside the domain, {bounds}; {cure}"


def domain_from_table(table: Mapping[str, Any]) -> BoxDomain | GeographicDomain:
    """Return the domain of a scenario; it is geographic if the table has lon, lat or depth."""
    geographic = bool({"lon", "lat", "depth"} & set(table))
    kind: type[BoxDomain | GeographicDomain] = GeographicDomain if geographic else BoxDomain
    return from_table(kind, table, "domain")
