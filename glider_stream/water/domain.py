"""Domains: the box that nodes are placed in, in metres or in degrees."""

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


@dataclass(frozen=True)
class BoxDomain:
    """x, y, z [lo, hi] in metres; z upward, the surface at 0."""

    x: Range
    y: Range
    z: Range

    def __post_init__(self) -> None:
        for name in ("x", "y", "z"):
            check_range(getattr(self, name), f"domain.{name}")
        require(self.z[1] <= 0, f"`domain.z` must end at or below the surface, 0; got {self.z[1]:g}")

    def frame(self) -> None:
        """There is no geography in it."""
        return

    def box(self) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) [m]."""
        low, high = zip(self.x, self.y, self.z, strict=True)
        return np.array(low), np.array(high)

    def point(self, values: Point) -> Array:
        """A point of this domain's coordinates, x, y, z, in the local frame (3,) [m]."""
        return np.array(values)


@dataclass(frozen=True)
class GeographicDomain:
    """lon, lat [lo, hi] in degrees, depth [lo, hi] in metres, downward.

    The nodes' box is the largest upright rectangle of the local frame that lies within these bounds; its
    points are given as lon, lat, depth.
    """

    lon: Range
    lat: Range
    depth: Range

    def __post_init__(self) -> None:
        for name in ("lat", "depth"):
            check_range(getattr(self, name), f"domain.{name}")
        top = self.depth[0]
        require(top >= 0, f"`domain.depth` must begin at or below the surface, 0; got {top:g}")
        poleward = max(abs(bound) for bound in self.lat)
        require(poleward <= 85, f"`domain.lat` must stay within 85 degrees of the equator; got {poleward:g}")
        width = self.width
        require(0 < width < 90, f"`domain.lon` must span 0 to 90 degrees eastward; got {list(self.lon)}")

    @property
    def width(self) -> float:
        """Degrees of longitude from west to east; a domain may cross the date line."""
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
        """A point of this domain's coordinates, lon, lat, depth, in the local frame (3,) [m]."""
        lon, lat, depth = values
        on_earth = abs(lat) < 90 and abs(lon) <= 360
        require(on_earth, f"{lon:g}, {lat:g} is no longitude and latitude in degrees; give LON,LAT,DEPTH")
        require(0 <= depth < math.inf, f"the depth must be at least 0 m, downward; got {depth:g}")
        x, y = self.frame().to_local(np.array([lon]), np.array([lat]))
        return np.array([x[0], y[0], 0.0 - depth])


def domain_from_table(table: Mapping[str, Any]) -> BoxDomain | GeographicDomain:
    """The domain of a scenario: geographic where it speaks of lon, lat or depth."""
    geographic = bool({"lon", "lat", "depth"} & set(table))
    kind: type[BoxDomain | GeographicDomain] = GeographicDomain if geographic else BoxDomain
    return from_table(kind, table, "domain")
