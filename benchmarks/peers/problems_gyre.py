"""The gyres of the surface problems, for scripts in environments that have NumPy alone."""

from typing import Any

import numpy as np

LENGTH, SPEED, SWING, PERIOD = 22_000.0, 0.25, 0.25, 86_400.0
"""Length [m], greatest speed [m/s]; how far and in which time [s] they swing."""
MIDDLE = (18.25, 38.0)
"""The centre [degrees]."""
EAST_METRE, NORTH_METRE = 1.0 / 87_833.0, 1.0 / 110_995.7
"""Degrees in a metre at the centre, on WGS84."""


def to_metres(lon: Any, lat: Any) -> tuple[Any, Any]:
    """Metres east and north of the centre; wrong by 0.3 % where the box ends."""
    return (lon - MIDDLE[0]) / EAST_METRE, (lat - MIDDLE[1]) / NORTH_METRE


def to_lonlat(x: Any, y: Any) -> tuple[Any, Any]:
    """Degrees of places [m]."""
    return MIDDLE[0] + x * EAST_METRE, MIDDLE[1] + y * NORTH_METRE


def gyres(lon: Any, lat: Any, since: Any, swings: bool) -> tuple[Any, Any]:
    """Shadden's double gyre on the globe: u, v [m/s] at places [degrees] and times [s] since the departure."""
    along, across = to_metres(lon, lat)
    x, y = 1.0 + along / LENGTH, 0.5 + across / LENGTH
    a = SWING * np.sin(2.0 * np.pi * since / PERIOD) if swings else 0.0 * since
    f, slope = a * x * x + (1.0 - 2.0 * a) * x, 2.0 * a * (x - 1.0) + 1.0
    u = -SPEED * np.sin(np.pi * f) * np.cos(np.pi * y)
    return u, SPEED * np.cos(np.pi * f) * np.sin(np.pi * y) * slope
