"""Places, and pairs of them: the ends of a leg."""

from typing import NamedTuple


class Place(NamedTuple):
    """A place x, y, z [m] in the local frame, z upward, and a time t [s]."""

    x: float
    y: float
    z: float
    t: float


class Velocity(NamedTuple):
    """A velocity through water [m/s] that does not belong to a control."""

    u: float
    v: float
    w: float


class Pair(NamedTuple):
    """Where and when a leg starts, and its goal. The goal's t is the start's: when the leg leaves."""

    start: Place
    goal: Place
