"""The steps of a route: speed over ground, course, and the current in which it was planned."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array
from ..search.path import Path

if TYPE_CHECKING:
    pass

SHORTEST = 1e-3
"""A step shorter than this [s] is the remainder of an integration; its speed would be noise."""


class Along(NamedTuple):
    """The steps of a route, (m,) each: `time` [s] of their middles and the `leg` of each.

    `speed` over ground and `through` water, both horizontal [m/s]; `course` over ground and `heading` through
    water, clockwise from true north [degrees]; the current `u` toward east and `v` toward north [m/s].
    """

    time: Array
    leg: NDArray[np.intp]
    speed: Array
    through: Array
    course: Array
    heading: Array
    u: Array
    v: Array


def along(path: Path) -> Along:
    """Return the steps of a path; the current is the motion over ground less the own speed, R - V cos(gamma)."""
    parts = []
    for n, leg in enumerate(path.legs):
        step = np.diff(leg.trajectory, axis=0)
        whole = step[:, 0] > SHORTEST
        moved = step[whole, 1:3] / step[whole, :1]
        forward = leg.speed * math.cos(leg.glide_angle)
        current = moved - forward * np.array([math.cos(leg.heading), math.sin(leg.heading)])
        c, s = math.cos(leg.north), math.sin(leg.north)
        turn = np.array([[c, -s], [s, c]])  # from the frame's axes to true east and north
        (east, north), (u, v) = (moved @ turn).T, (current @ turn).T
        middle = (leg.trajectory[:-1, 0] + 0.5 * step[:, 0])[whole]
        full = np.full(middle.size, 1.0)
        course = np.degrees(np.arctan2(east, north)) % 360.0
        columns = [middle, n * full, np.hypot(east, north), forward * full, course, leg.compass * full, u, v]
        parts.append(np.stack(columns))
    time, number, *rest = np.concatenate([np.empty((8, 0)), *parts], axis=1)
    return Along(time, number.astype(np.intp), *rest)
