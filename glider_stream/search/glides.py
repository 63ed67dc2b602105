"""Glides that join given stops: the control of each leg, exact, and what its time changes by; many at once."""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array
from ..base.threads import in_parallel
from ..kernels.legs import fly_legs, legs_fit
from ..roadmap.evaluator import Evaluator

LEGS_AT_ONCE = 1024
"""Legs that a thread flies at once, for some milliseconds: fewer would wait for threads to begin."""
CLOSE = 1e-5
"""A leg that ends this near its stop [m] is exact: hundreds of legs together then miss by no millimetre."""
MOST_STEPS = 12
"""Newton steps from a guess; from a near one it takes two or three."""
LONGEST_TURN = 0.3
"""A Newton step's most in glide angle and heading [rad]: beyond, the leg's linear model says nothing."""
X, Y, Z, T, Z_END, ANGLE, HEADING = range(7)
"""What a leg's end depends on: start [m], departure [s], the height it ends at [m], its control [rad]."""
STEPS = np.array([0.5, 0.5, 0.2, 1.0, 0.2, 2e-4, 2e-4])
"""By how much each is changed to measure derivatives, forth and back: small beside the scale of currents, so that
the differences are good to six digits, and far above rounding."""


class Glides(NamedTuple):
    """Exact legs between stops: magnitude of the glide angle, heading [rad] (n,), duration, departure [s] (n,).

    `miss` (n,) [m]: how far from its stop a leg ends.
    """

    angle: Array
    heading: Array
    time: Array
    departs: Array
    miss: Array

    @property
    def exact(self) -> NDArray[np.bool_]:
        """Which legs (n,) end at their stops."""
        return self.miss <= CLOSE


class Slopes(NamedTuple):
    """What a leg's time and control change by: `time` (n, 7) [s], glide `angle` and `heading` (n, 7) [rad].

    By start x, y, z, end x, y, z [m] and departure [s].
    """

    time: Array
    angle: Array
    heading: Array


@dataclass(frozen=True)
class Air:
    """The water and the vehicle, for legs that join `begin` and `end` (n, 3) [m], n of them at once."""

    evaluator: Evaluator

    def glide(self, begin: Array, end: Array, angle: Array, heading: Array, departs: float | Array) -> Glides:
        """The exact legs, from a guess of their controls [rad].

        `departs` [s] of each (n,), or of the first of a route, whose every leg leaves when the last one arrives.
        """
        angle, heading = angle.copy(), heading.copy()
        climbs = end[:, 2] > begin[:, 2]
        lowest, highest = self.angles(climbs)
        left: Array | float = departs
        for _ in range(MOST_STEPS):
            time = (end[:, 2] - begin[:, 2]) / self.sinking(angle, climbs)
            if np.ndim(departs) == 0:
                left = departs + np.concatenate([[0.0], np.cumsum(time)[:-1]])
            of = np.column_stack([begin, left, end[:, 2], angle, heading])
            ends = self._ends(np.stack([of, *(of + _step(n) for n in (ANGLE, HEADING))]), climbs)
            off = end[:, :2] - ends[0]
            miss = np.hypot(*off.T)
            if (miss <= CLOSE).all() or not np.isfinite(miss).any():
                break
            by_angle, by_heading = ((ends[1 + n] - ends[0]) / STEPS[ANGLE + n] for n in range(2))
            turn = _solve(by_angle, by_heading, off)
            turn = np.where(np.isfinite(turn), turn, 0.0)
            longest = np.abs(turn).max(axis=1, initial=0.0)
            turn *= np.minimum(1.0, LONGEST_TURN / np.maximum(longest, LONGEST_TURN))[:, None]
            angle, heading = np.clip(angle + turn[:, 0], lowest, highest), heading + turn[:, 1]
        return Glides(angle, heading, time, np.asarray(left), miss)

    def slopes(self, begin: Array, end: Array, glides: Glides, one_sided: bool = False) -> Slopes:
        """The derivatives of exact legs, by flights beside them and the implicit function theorem.

        With `one_sided` by half the flights, and off by half a step: enough where two of them are compared.
        """
        climbs = end[:, 2] > begin[:, 2]
        of = np.column_stack([begin, glides.departs, end[:, 2], glides.angle, glides.heading])
        if one_sided:
            ends = self._ends(np.stack([of, *(of + _step(n) for n in range(7))]), climbs)
            by = (ends[1:] - ends[0]) / STEPS[:, None, None]
        else:
            beside = [of + sign * _step(n) for n in range(7) for sign in (1.0, -1.0)]
            ends = self._ends(np.stack(beside), climbs)
            by = (ends[0::2] - ends[1::2]) / (2 * STEPS[:, None, None])  # (7, n, 2)
        # a leg ends at its stop: what moves its end otherwise, the control takes back
        moved = np.zeros((7, len(of), 2))
        moved[0], moved[1], moved[2], moved[5], moved[6] = -by[X], -by[Y], -by[Z], -by[Z_END], -by[T]
        moved[3, :, 0], moved[4, :, 1] = 1.0, 1.0
        control = np.stack([_solve(by[ANGLE], by[HEADING], off) for off in moved], axis=1)
        angle = control[..., 0]
        sinks = self.sinking(glides.angle, climbs)
        ahead, behind = (self.sinking(glides.angle + sign * STEPS[ANGLE], climbs) for sign in (1.0, -1.0))
        change = (ahead - behind) / (2 * STEPS[ANGLE])
        time = -(glides.time * change / sinks)[:, None] * angle
        time[:, 2] -= 1 / sinks
        time[:, 5] += 1 / sinks
        return Slopes(time, angle, control[..., 1])

    def aimed(self, begin: Array, end: Array, glides: Glides, slopes: Slopes, moved: Array) -> Glides:
        """Legs to ends that have `moved` (n, 6) [m], to first order: guesses, which end near their stops."""
        climbs = end[:, 2] > begin[:, 2]
        lowest, highest = self.angles(climbs)
        angle = glides.angle + (slopes.angle[:, :6] * moved).sum(axis=1)
        heading = glides.heading + (slopes.heading[:, :6] * moved).sum(axis=1)
        known = np.isfinite(angle) & np.isfinite(heading)
        angle = np.clip(np.where(known, angle, glides.angle), lowest, highest)
        heading = np.where(known, heading, glides.heading)
        time = (end[:, 2] - begin[:, 2]) / self.sinking(angle, climbs)
        return Glides(angle, heading, time, glides.departs, np.zeros(len(angle)))

    def fit(self, begin: Array, end: Array, glides: Glides) -> NDArray[np.bool_]:
        """Which legs (n,) stay in the flow and in open water."""
        fits = np.zeros(len(glides.time), np.bool_)
        start = np.column_stack([begin, glides.departs])
        through = self._through(glides.angle, glides.heading, end[:, 2] > begin[:, 2])
        task = partial(legs_fit, self.evaluator.medium, start, through, glides.time, fits)
        in_parallel(task, len(fits), LEGS_AT_ONCE)
        return fits

    def along(self, begin: Array, end: Array, glides: Glides, share: float) -> Array:
        """Where legs are (n, 3) [m] after a share of their times."""
        climbs, height = end[:, 2] > begin[:, 2], begin[:, 2] + share * (end[:, 2] - begin[:, 2])
        of = np.column_stack([begin, glides.departs, height, glides.angle, glides.heading])
        return np.column_stack([self._ends(of[None], climbs)[0], height])

    def angles(self, climbs: NDArray[np.bool_]) -> tuple[Array, Array]:
        """The shallowest and the steepest glide of each leg [rad]."""
        way = climbs.astype(np.intp)
        return self.evaluator.polar.shallowest[way], self.evaluator.polar.steepest[way]

    def speed(self, angle: Array, climbs: NDArray[np.bool_]) -> Array:
        """V [m/s] at glide angles [rad], as `kernels.control.glide_speed` has it."""
        polar, way = self.evaluator.polar, climbs.astype(np.intp)
        last = polar.speed.shape[1] - 1
        lowest, highest = self.angles(climbs)
        at = np.clip((angle - lowest) / (highest - lowest) * last, 0.0, last)
        below = np.minimum(at.astype(np.intp), last - 1)
        low = polar.speed[way, below]
        return np.asarray(low + (at - below) * (polar.speed[way, below + 1] - low))

    def sinking(self, angle: Array, climbs: NDArray[np.bool_]) -> Array:
        """The vertical speed [m/s], below 0 in a dive."""
        return np.asarray(self.speed(angle, climbs) * np.sin(angle) * np.where(climbs, 1.0, -1.0))

    def _through(self, angle: Array, heading: Array, climbs: NDArray[np.bool_]) -> Array:
        along = self.speed(angle, climbs) * np.cos(angle)
        return np.stack([along * np.cos(heading), along * np.sin(heading), self.sinking(angle, climbs)], axis=-1)

    def _ends(self, of: Array, climbs: NDArray[np.bool_]) -> Array:
        """Where legs of parameters (m, n, 7) end: (m, n, 2) [m]."""
        many = np.broadcast_to(climbs, of.shape[:2]).ravel()
        row = of.reshape(-1, 7)
        through = self._through(row[:, ANGLE], row[:, HEADING], many)
        time = (row[:, Z_END] - row[:, Z]) / through[:, 2]
        start = np.ascontiguousarray(row[:, [X, Y, Z, T]])
        ends = np.full((len(row), 2), np.nan)
        task = partial(fly_legs, self.evaluator.flow, start, through, time, self.evaluator.integration.dt, ends)
        in_parallel(task, len(row), LEGS_AT_ONCE)
        return ends.reshape(*of.shape[:2], 2)


def _step(n: int) -> Array:
    """The change of one of the seven that a leg's end depends on."""
    step = np.zeros(7)
    step[n] = STEPS[n]
    return step


def _solve(by_first: Array, by_second: Array, off: Array) -> Array:
    """The two unknowns (n, 2) with by_first * a + by_second * b = off, all (n, 2)."""
    det = by_first[:, 0] * by_second[:, 1] - by_second[:, 0] * by_first[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        a = (by_second[:, 1] * off[:, 0] - by_second[:, 0] * off[:, 1]) / det
        b = (by_first[:, 0] * off[:, 1] - by_first[:, 1] * off[:, 0]) / det
    return np.stack([a, b], axis=-1)
