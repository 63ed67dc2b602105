"""Orders: what a pilot sends to the vehicle, a list of trims or a list of waypoints."""

import math
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


def waypoints_of(path: Path) -> Waypoints:
    """Return the places where a plan comes up, with the yo that stands for the legs before each.

    A yo goes down to the deepest of those legs; its angle is that of a vehicle that goes as far through water,
    and as far up and down, as they do.
    """
    stops, depths, angles = [], [], []
    deepest = down = across = 0.0
    for n, leg in enumerate(path.legs):
        deepest = min(deepest, float(leg.start[2]), float(leg.end[2]))
        rise = abs(float(leg.end[2] - leg.start[2]))
        down, across = down + rise, across + rise / math.tan(abs(leg.glide_angle))
        if is_up(float(leg.end[2])) or n == len(path.legs) - 1:
            stops.append(leg.end[:2])
            depths.append(-deepest)
            angles.append(math.atan2(down, across))
            deepest = down = across = 0.0
    return Waypoints(np.array(stops).reshape(-1, 2), np.array(depths), np.array(angles))
