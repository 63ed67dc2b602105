"""Routes of a glider that may also hold its depth: what very small yos would reach.

A glider that turns often moves, on average, at any vertical speed between its dive's and its climb's, and hardly
slower than its best horizontal speed. With this freedom the time of a leg is a smooth function of its ends, even
if these lie at one depth. So Newton's method finds the best way through the water, whatever the number of yos.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array
from .glides import ANGLE, HEADING, STEPS, Z_END, Air, Glides, Slopes, Z
from .polish import ROOM, Chain, Polisher

POINTS = 64
"""The polar is read at this many glide angles from its fastest to its steepest, in each direction."""
LONGEST_CHANGE = 0.3
"""A Newton step changes the duration of a leg at most by this share."""


@dataclass(frozen=True)
class FreeAir(Air):
    """Computes legs as `Air` does, for a glider that may hold its depth; the control is not the glide angle.

    The `angle` of a leg is here its duration [s]. Its vertical speed is even, its horizontal speed the greatest
    that goes with it.
    """

    steps = np.where(np.arange(7) == ANGLE, 0.02, STEPS)

    @cached_property
    def speeds(self) -> tuple[Array, Array]:
        """The vertical speeds (n,), rising from the steepest dive to the steepest climb, and horizontal ones."""
        polar = self.evaluator.polar
        rows = []
        for way in range(2):
            angle = np.linspace(polar.best_angle[way], polar.steepest[way], POINTS)
            climbs = np.full(POINTS, bool(way))
            rows.append((self.sinking(angle, climbs), self.speed(angle, climbs) * np.cos(angle)))
        (sink, level), (rise, level_up) = rows
        return np.concatenate([sink[::-1], rise]), np.concatenate([level[::-1], level_up])

    def times(self, begin: Array, end: Array, angle: Array) -> Array:
        """Return the durations (n,) [s]."""
        return angle

    def limits(self, begin: Array, end: Array) -> tuple[Array, Array]:
        """Return the least durations (n,) [s]; there is no greatest."""
        rise, (vertical, _) = end[:, 2] - begin[:, 2], self.speeds
        return rise / np.where(rise > 0, vertical[-1], vertical[0]), np.full(len(rise), np.inf)

    def _longest(self, angle: Array) -> Array | float:
        return LONGEST_CHANGE * angle

    def _time_slopes(self, begin: Array, end: Array, glides: Glides, angle: Array) -> Array:
        return angle

    def _flights(self, row: Array) -> tuple[Array, Array]:
        time, heading = row[:, ANGLE], row[:, HEADING]
        vertical = (row[:, Z_END] - row[:, Z]) / time
        level = np.interp(vertical, *self.speeds)
        return np.stack([level * np.cos(heading), level * np.sin(heading), vertical], axis=-1), time

    def drift(self, begin: Array, end: Array, glides: Glides) -> Array:
        """Return the mean current (n, 2) [m/s] of legs: what the glide does not explain of a leg's way."""
        through, time = self._flights(self._rows(begin, end, glides))
        return (end - begin)[:, :2] / time[:, None] - through[:, :2]


@dataclass(frozen=True)
class FreePolisher(Polisher):
    """Improves routes that may hold their depth."""

    @cached_property
    def air(self) -> FreeAir:
        """The object that computes legs."""
        return FreeAir(self.problem.evaluator)

    def from_route(self, polisher: Polisher, chain: Chain, pieces: int) -> Chain | None:
        """Return a route of real glides, cut into about this many pieces, as one that may hold its depth."""
        time = chain.glides.time
        counts = np.maximum(1, np.round(time / time.sum() * pieces).astype(np.int64))
        part = np.concatenate([np.arange(1, count + 1) / count for count in counts.tolist()])
        begin, end = (np.repeat(stops, counts, axis=0) for stops in (chain.stops[:-1], chain.stops[1:]))
        many = Glides(*(np.repeat(values, counts) for values in chain.glides))
        stops = polisher.air.along(begin, end, many, part)
        stops[part == 1.0] = chain.stops[1:]
        return self.chain(np.vstack([chain.stops[:1], stops]), np.repeat(time / counts, counts), many.heading)

    def _flips(self, stops: Array, before: Array) -> NDArray[np.bool_]:
        return np.zeros(len(stops) - 1, np.bool_)

    def _too_long(self, glides: Glides) -> NDArray[np.bool_]:
        return np.zeros(len(glides.time), np.bool_)

    def _room(self, stops: Array, glides: Glides, slopes: Slopes | None) -> tuple[Array, Array]:
        """Return how far legs are from the steepest glide (n, 1), as shares, and the slopes (n, 1, 6) by ends."""
        rise, (vertical, _) = np.diff(stops[:, 2]), self.air.speeds
        depth = float(self.problem.hi[2] - self.problem.lo[2])
        fastest = np.where(rise > 0, vertical[-1], -vertical[0])
        room = (fastest * glides.time - np.abs(rise)) / depth
        by = np.zeros((len(rise), 1, 6))
        if slopes is not None:
            by[:, 0] = slopes.time[:, :6] * fastest[:, None] / depth
            by[:, 0, 2] += np.sign(rise) / depth
            by[:, 0, 5] -= np.sign(rise) / depth
        return np.maximum(room, 0.0)[:, None] + ROOM, by
