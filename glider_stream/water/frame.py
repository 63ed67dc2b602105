"""The local frame: metres around a centre on the globe; x points east and y north at the centre."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array
from ..base.checks import Range
from ..base.errors import InputError
from ..base.settings import require

MAX_SCALE_ERROR = 0.01
"""The frame's lengths may be wrong by at most this share. A domain of some 2500 km reaches it."""


def wrapped(lon: ArrayLike, centre: float) -> Array:
    """Return the longitudes moved into [centre - 180, centre + 180) degrees."""
    return centre + (np.asarray(lon, dtype=np.float64) - centre + 180) % 360 - 180


def eastward(lon: Range) -> Range:
    """Return a rising range of longitudes: [179, -179] crosses the date line and becomes [179, 181]."""
    west, east = lon
    return (west, east) if east >= west else (west, west + (east - west) % 360)


@lru_cache(maxsize=16)
def _projection(lon: float, lat: float) -> Any:
    try:
        from pyproj import Proj
    except ImportError:
        raise InputError(
            "longitudes and latitudes need pyproj, which is missing: pip install glider-stream[ocean]"
        ) from None
    return Proj(proj="sterea", lat_0=lat, lon_0=lon, k=1, ellps="WGS84")


@dataclass(frozen=True)
class LocalFrame:
    """Oblique stereographic frame on WGS84 about `lon`, `lat` [degrees]; it is conformal.

    Angles between currents stay true. Lengths grow by (r/2R)^2 at a distance r from the centre, where R is the
    Earth's radius: 0.15 % at 500 km.
    """

    lon: float
    lat: float

    def __post_init__(self) -> None:
        require(math.isfinite(self.lon), f"the frame's longitude must be a number of degrees; got {self.lon}")
        require(abs(self.lat) <= 90, f"the frame's latitude must be within [-90, 90]; got {self.lat}")

    @classmethod
    def over(cls, lon: Range, lat: Range) -> "LocalFrame":
        """Return the frame about the middle of a domain [degrees]; the domain may cross the date line."""
        return cls(lon=sum(eastward(lon)) / 2, lat=sum(lat) / 2)

    def to_local(self, lon: ArrayLike, lat: ArrayLike) -> tuple[Array, Array]:
        """Return x, y [m] of longitudes and latitudes [degrees]; longitudes may have any convention."""
        x, y = _projection(self.lon, self.lat)(
            wrapped(lon, self.lon), np.asarray(lat, dtype=np.float64), errcheck=True
        )
        return np.asarray(x), np.asarray(y)

    def to_lonlat(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Return longitude and latitude [degrees] of x, y [m]; longitudes lie within 180 degrees of `lon`."""
        lon, lat = _projection(self.lon, self.lat)(
            np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64), inverse=True
        )
        return wrapped(lon, self.lon), np.asarray(lat)

    def convergence(self, lon: ArrayLike, lat: ArrayLike) -> Array:
        """Return the angle g [rad], counter-clockwise, from the frame's +y to true north.

        The components of an (east, north) vector in the frame are (east cos g - north sin g, east sin g + north
        cos g).
        """
        return np.asarray(np.radians(self._factors(lon, lat).meridian_convergence))

    def scale_error(self, lon: Range, lat: Range) -> float:
        """Return the largest relative error of the frame's lengths in a domain [degrees]."""
        west, east = eastward(lon)
        grid = np.meshgrid(np.linspace(west, east, 17), np.linspace(*lat, 17))
        return float(np.abs(np.asarray(self._factors(*grid).meridional_scale) - 1).max())

    def _factors(self, lon: ArrayLike, lat: ArrayLike) -> Any:
        return _projection(self.lon, self.lat).get_factors(
            wrapped(lon, self.lon), np.asarray(lat, dtype=np.float64)
        )


def true_north(to_lonlat: Callable[[Array], Array], point: Array) -> float:
    """Return the direction of true north at a point: an angle [rad], counter-clockwise from the frame's +y."""
    ends = to_lonlat(np.stack([point, point + np.array([0.0, 1.0, 0.0])]))
    east, north = (ends[1] - ends[0]) * [math.cos(math.radians(ends[0, 1])), 1.0]
    return math.atan2(east, north)
