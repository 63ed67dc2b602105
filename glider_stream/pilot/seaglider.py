"""Seaglider's `targets` file: a route's waypoints, each naming the next."""

from ..base.settings import require
from ..search.path import Path
from ..water.frame import wrapped
from .waypoints import degrees_and_minutes, waypoints

RADIUS = 200
"""A target counts as reached this near [m]."""


def targets(path: Path, name: str) -> dict[str, str]:
    """A route as a targets file; the last target is held."""
    places = waypoints(path)
    require(len(places) <= 999, f"{len(places)} targets are more than 999; plan fewer surfacings")
    names = [f"WP{n:03}" for n in range(1, len(places) + 1)]
    lines = [
        f"{here} lat={degrees_and_minutes(at.lat)} lon={degrees_and_minutes(float(wrapped(at.lon, 0.0)))} "
        f"radius={RADIUS} goto={after}"
        for here, after, at in zip(names, [*names[1:], names[-1]], places, strict=True)
    ]
    return {name: "\n".join(["/ a route of glider-stream", *lines]) + "\n"}
