"""Waypoints: the places where a route surfaces, and how they are written in vehicles' files."""

import math
from dataclasses import dataclass
from itertools import pairwise

from ..base.settings import require
from ..search.path import SURFACE, Path


@dataclass(frozen=True)
class Waypoint:
    """A place to fly to: longitude and latitude [degrees]."""

    lon: float
    lat: float


def waypoints(path: Path) -> list[Waypoint]:
    """Return the places where a geographic route surfaces, and its goal."""
    require(path.lonlat is not None, "waypoints need longitude and latitude; plan in a geographic scenario")
    assert path.lonlat is not None
    ends = [(leg.lonlat[1], leg.end[2]) for leg in path.legs[:-1] if leg.lonlat is not None]
    places = [place for place, z in ends if z >= -SURFACE]
    return [Waypoint(float(lon), float(lat)) for lon, lat in (*places, path.lonlat[1])]


def skipped(path: Path, radius: float) -> list[str]:
    """Return a sentence if a vehicle would count waypoints as reached as soon as it heads for them.

    `radius` [m]: at this distance a waypoint counts as reached.
    """
    ends = [path.start, *(leg.end for leg in path.legs[:-1] if leg.end[2] >= -SURFACE), path.goal]
    apart = [math.dist(a[:2], b[:2]) for a, b in pairwise(ends)]
    near = sum(distance <= radius for distance in apart)
    if not near:
        return []
    cure = "set a smaller --arrival-radius, or plan fewer surfacings"
    lie = f"{near} of the {len(apart)} waypoints {'lies' if near == 1 else 'lie'} within the arrival radius of"
    return [f"{lie} {radius:g} m of the one before, or of the start, so a vehicle does not fly to them; {cure}"]


def plain_number(text: str) -> float:
    """Return the number in a vehicle's file; ValueError if only Python reads it as one, such as 1_8."""
    if "_" in text:
        raise ValueError(f"{text} is no number that a vehicle reads")
    return float(text)


def degrees_and_minutes(degrees: float) -> str:
    """Return degrees as DDDMM.mmmm, which vehicles read: 74 degrees 11.587 minutes west are -7411.5870.

    The sign belongs to the whole number; 59.99999 minutes round up to the next degree.
    """
    minutes = round(abs(degrees) * 60, 4)
    packed = 100 * int(minutes // 60) + minutes % 60
    return f"{'-' if degrees < 0 and minutes > 0 else ''}{packed:.4f}"


def from_degrees_and_minutes(text: str) -> float:
    """Return the degrees of a text DDDMM.mmmm; ValueError if it is not such a number."""
    packed = plain_number(text)
    whole, minutes = divmod(abs(packed), 100)
    if not minutes < 60 or whole > 180:
        raise ValueError(f"{text} has {minutes:g} minutes or too many degrees")
    return (whole + minutes / 60) * (-1 if text.strip().startswith("-") else 1)
