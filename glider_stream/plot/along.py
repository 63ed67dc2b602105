"""The steps of a route: speed over ground, course, and the current in which it was planned."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array
from ..search.path import Path
from ..water.frame import true_north

if TYPE_CHECKING:
    from ..roadmap.problem import Problem

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


def placed(path: Path, problem: "Problem") -> Path:
    """Return a path with the longitudes, latitudes and true north that a path file leaves out, if geographic."""
    to_lonlat = problem.to_lonlat
    if to_lonlat is None:
        return path
    legs = tuple(
        replace(
            leg,
            lonlat=to_lonlat(np.stack([leg.start, leg.end])),
            track=to_lonlat(leg.trajectory[:, 1:]),
            north=true_north(to_lonlat, leg.start),
        )
        for leg in path.legs
    )
    departs = path.departs or problem.departs
    return replace(path, legs=legs, lonlat=to_lonlat(np.stack([path.start, path.goal])), departs=departs)
