"""Orders: what a pilot sends to the vehicle, a list of trims or a list of waypoints."""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Array
from ..search.path import SURFACE, Path


@dataclass(frozen=True)
class Trim:
    """One glide: signed `glide_angle` and `heading` [rad], `speed` [m/s], to the height `z` [m]."""

    glide_angle: float
    heading: float
    speed: float
    z: float


@dataclass(frozen=True)
class Trims:
    """The glides that are left, in order."""

    glides: tuple[Trim, ...]


@dataclass(frozen=True)
class Waypoints:
    """The places to head for, `stops` (n, 2) [m], with the yo towards each: its `depth` and `angle`, (n,) each.

    `depth` [m, downward]; `angle` [rad] is the magnitude of the glide angle.
    """

    stops: Array
    depth: Array
    angle: Array


Orders = Trims | Waypoints


def is_up(z: float) -> bool:
    """Return whether a vehicle at a height z [m] is at the surface."""
    return z >= -SURFACE


def trims_of(path: Path) -> Trims:
    """Return a plan's glides."""
    return Trims(tuple(Trim(leg.glide_angle, leg.heading, leg.speed, float(leg.end[2])) for leg in path.legs))


def waypoints_of(path: Path, angle: float) -> Waypoints:
    """Return the places where a plan comes up; a yo towards one goes as deep as the deepest leg before it.

    All yos have the same glide `angle` [rad], as a yo file has: legs between nodes are steeper only to meet them.
    """
    stops, depths = [], []
    deepest = 0.0
    for n, leg in enumerate(path.legs):
        deepest = min(deepest, float(leg.start[2]), float(leg.end[2]))
        if is_up(float(leg.end[2])) or n == len(path.legs) - 1:
            stops.append(leg.end[:2])
            depths.append(-deepest)
            deepest = 0.0
    return Waypoints(np.array(stops).reshape(-1, 2), np.array(depths), np.full(len(stops), angle))
