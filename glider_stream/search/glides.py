"""Exact glides between given stops: the control of each leg and the derivatives of its time, for many legs."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array
from ..base.threads import in_parallel
from ..kernels.flow import rises
from ..kernels.legs import fly_legs, legs_fit
from ..kernels.steer import FLOWN
from ..roadmap.evaluator import Evaluator

LEGS_AT_ONCE = 1024
"""A thread flies this many legs at a time, which takes milliseconds; with fewer the threads' start costs more."""
CLOSE = 1e-5
"""A leg that ends within this distance [m] of its stop is exact: hundreds of legs add up to a few millimetres."""
AGREED = 1e-6
"""Legs of a route in a flow that rises have found their times when these change by less [s]."""
MOST_STEPS = 12
"""At most this many Newton steps are made from a guess; a near guess needs two or three."""
PATIENCE = 2
"""A leg is given up after this many steps in a row, none of them shortened, that do not halve its least miss.
Most would have to be steeper or shallower than the polar allows, and stay at that limit."""
LONGEST_TURN = 0.3
"""A Newton step changes glide angle and heading by at most this [rad]; beyond it the linear model is wrong."""
X, Y, Z, T, Z_END, ANGLE, HEADING = range(7)
"""The columns of a leg's parameters: start x, y, z [m], departure [s], height of its end [m], control [rad]."""
STEPS = np.array([0.5, 0.5, 0.2, 1.0, 0.2, 2e-4, 2e-4])
"""Each parameter is changed by this much, up and down, to measure derivatives. The steps are small against the
scale of currents, so six digits of the differences are right, and large against rounding errors."""


class Glides(NamedTuple):
    """Legs between stops: size of the glide `angle`, `heading` [rad], duration `time`, departure `departs` [s].

    All arrays are (n,). `miss` [m] is the distance from its stop at which a leg ends.
    """

    angle: Array
    heading: Array
    time: Array
    departs: Array
    miss: Array

    @property
    def exact(self) -> NDArray[np.bool_]:
        """Mask (n,) of the legs that end at their stops."""
        return self.miss <= CLOSE


class Slopes(NamedTuple):
    """Derivatives of each leg's `time` (n, 7) [s] and of its glide `angle` and `heading` (n, 7) [rad].

    The seven columns are the derivatives by start x, y, z, end x, y, z [m] and departure [s].
    """

    time: Array
    angle: Array
    heading: Array


@dataclass(frozen=True)
class Air:
    """Computes legs from `begin` to `end` (n, 3) [m] in the water of an evaluator, n legs at once."""

    evaluator: Evaluator
    steps: ClassVar[Array] = STEPS
    most_steps: ClassVar[int] = MOST_STEPS

    def glide(self, begin: Array, end: Array, angle: Array, heading: Array, departs: float | Array) -> Glides:
        """Return the legs by Newton's method, from a guess of their controls (n,) [rad].

        `departs` [s] is the departure of each leg (n,), or one number: the departure of the first leg of a route,
        in which each leg leaves when the leg before it arrives.
        """
        angle, heading = angle.copy(), heading.copy()
        lowest, highest = self.limits(begin, end)
        left: Array | float = departs
        flown: Array | None = None
        least, waited = np.full(len(angle), np.inf), np.zeros(len(angle), np.int64)
        limited = np.zeros(len(angle), np.bool_)
        rows = np.empty((3, len(angle), 7))
        rows[:, :, :T], rows[:, :, Z_END] = begin, end[:, 2]
        for _ in range(self.most_steps):
            time, before = self._expected(begin, end, angle, flown), left
            if np.ndim(departs) == 0:
                left = departs + np.concatenate([[0.0], np.cumsum(time)[:-1]])
            rows[:, :, T], rows[:, :, ANGLE], rows[:, :, HEADING] = left, angle, heading
            rows[1, :, ANGLE] += self.steps[ANGLE]
            rows[2, :, HEADING] += self.steps[HEADING]
            landings = self._landings(rows)
            ends, flown = landings[..., :2], landings[0, :, 2]
            off = end[:, :2] - ends[0]
            miss = np.hypot(off[:, 0], off[:, 1])
            least = self._least(least, left, before)
            waited = np.where((miss < 0.5 * least) | limited, 0, waited + 1)
            least = np.fmin(least, miss)
            lost = (waited >= PATIENCE) & ~(miss <= CLOSE)
            if ((miss <= CLOSE) | lost).all() and (lost.any() or self._settled(time, flown)):
                break
            by_angle, by_heading = ((ends[1 + n] - ends[0]) / self.steps[ANGLE + n] for n in range(2))
            turn = _solve(by_angle, by_heading, off)
            turn[~np.isfinite(turn)] = 0.0
            longest = np.maximum(np.abs(turn[:, 0]) / self._longest(angle), np.abs(turn[:, 1]) / LONGEST_TURN)
            turn /= np.maximum(1.0, longest)[:, None]
            limited = longest > 1.0
            angle, heading = np.clip(angle + turn[:, 0], lowest, highest), heading + turn[:, 1]
        return Glides(angle, heading, time, np.asarray(left), miss)

    def slopes(self, begin: Array, end: Array, glides: Glides, one_sided: bool = False) -> Slopes:
        """Return the derivatives of exact legs, by flights beside them and the implicit function theorem.

        `one_sided` uses half the flights and is less accurate; that is enough to compare two derivatives.
        """
        of, away = self._rows(begin, end, glides), np.diag(self.steps)[:, None, :]
        if one_sided:
            ends = self._landings(np.concatenate([of[None], of + away]))
            by = (ends[1:] - ends[0]) / self.steps[:, None, None]
        else:
            ends = self._landings(np.concatenate([of + away, of - away]))
            by = (ends[:7] - ends[7:]) / (2 * self.steps[:, None, None])  # (7, n, 3)
        by, later = by[..., :2], by[..., 2]
        # the leg must end at its stop, so the control undoes every other change of the leg's end
        moved = np.zeros((7, len(of), 2))
        moved[0], moved[1], moved[2], moved[5], moved[6] = -by[X], -by[Y], -by[Z], -by[Z_END], -by[T]
        moved[3, :, 0], moved[4, :, 1] = 1.0, 1.0
        angle, heading = np.moveaxis(_solve(by[ANGLE], by[HEADING], moved), (0, 2), (2, 0))
        return Slopes(self._time_slopes(begin, end, glides, (angle, heading, later)), angle, heading)

    def _time_slopes(self, begin: Array, end: Array, glides: Glides, by: tuple[Array, Array, Array]) -> Array:
        """Return the derivatives (n, 7) of the times.

        `by`: those of the controls, angle and heading (n, 7), and those of the flights' times (7, n) by the
        columns of a leg's parameters.
        """
        angle = by[0]
        climbs = end[:, 2] > begin[:, 2]
        sinks = self.sinking(glides.angle, climbs)
        ahead, behind = (self.sinking(glides.angle + sign * STEPS[ANGLE], climbs) for sign in (1.0, -1.0))
        change = (ahead - behind) / (2 * STEPS[ANGLE])
        time = -(glides.time * change / sinks)[:, None] * angle
        time[:, 2] -= 1 / sinks
        time[:, 5] += 1 / sinks
        return np.asarray(time)

    def aimed(self, begin: Array, end: Array, glides: Glides, slopes: Slopes, moved: Array) -> Glides:
        """Return guesses of legs, to first order, after their starts and ends have `moved` (n, 6) [m]."""
        angle = glides.angle + (slopes.angle[:, :6] * moved).sum(axis=1)
        heading = glides.heading + (slopes.heading[:, :6] * moved).sum(axis=1)
        known = np.isfinite(angle) & np.isfinite(heading)
        angle = np.clip(np.where(known, angle, glides.angle), *self.limits(begin, end))
        heading = np.where(known, heading, glides.heading)
        return Glides(angle, heading, self.times(begin, end, angle), glides.departs, np.zeros(len(angle)))

    def fit(self, begin: Array, end: Array, glides: Glides) -> NDArray[np.bool_]:
        """Return a mask (n,) of the legs that stay in the flow and in open water."""
        fits = np.zeros(len(glides.time), np.bool_)
        start = np.column_stack([begin, glides.departs])
        through, _ = self._flights(self._rows(begin, end, glides))
        task = partial(legs_fit, self.evaluator.medium, start, through, glides.time, fits)
        in_parallel(task, len(fits), LEGS_AT_ONCE)
        return fits

    def along(self, begin: Array, end: Array, glides: Glides, share: float | Array) -> Array:
        """Return the positions (n, 3) [m] of legs after a share of their vertical way, one for all or (n,)."""
        height = begin[:, 2] + share * (end[:, 2] - begin[:, 2])
        of = np.column_stack([begin, glides.departs, height, glides.angle, glides.heading])
        return np.column_stack([self._ends(of[None])[0], height])

    def angles(self, climbs: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return the shallowest and the steepest glide angle of each leg, (n,) each [rad]."""
        way = climbs.astype(np.intp)
        return self.evaluator.polar.shallowest[way], self.evaluator.polar.steepest[way]

    def speed(self, angle: Array, climbs: NDArray[np.bool_]) -> Array:
        """Return the speed V (n,) [m/s] at glide angles [rad], equal to `kernels.control.glide_speed`."""
        polar, way = self.evaluator.polar, climbs.astype(np.intp)
        last = polar.speed.shape[1] - 1
        lowest, highest = self.angles(climbs)
        at = np.minimum(np.maximum((angle - lowest) / (highest - lowest) * last, 0.0), last)
        below = np.minimum(at.astype(np.intp), last - 1)
        row, table = way * (last + 1) + below, polar.speed.ravel()
        low = table[row]
        return np.asarray(low + (at - below) * (table[row + 1] - low))

    def sinking(self, angle: Array, climbs: NDArray[np.bool_]) -> Array:
        """Return the vertical speed (n,) [m/s] at glide angles [rad]; it is negative in a dive."""
        return np.asarray(self.speed(angle, climbs) * np.sin(angle) * np.where(climbs, 1.0, -1.0))

    def through(self, angle: Array, heading: Array, climbs: NDArray[np.bool_]) -> Array:
        """Return the velocities through water (n, 3) [m/s] of controls (n,) [rad]."""
        speed = self.speed(angle, climbs)
        along, found = speed * np.cos(angle), np.empty((len(angle), 3))
        found[:, 0], found[:, 1] = along * np.cos(heading), along * np.sin(heading)
        found[:, 2] = speed * np.sin(angle) * np.where(climbs, 1.0, -1.0)
        return found

    def _expected(self, begin: Array, end: Array, angle: Array, flown: Array | None) -> Array:
        """Return the times (n,) [s] of legs that fly next; they took `flown` (n,) [s] before, if they flew."""
        return self.times(begin, end, angle)

    def _settled(self, expected: Array, flown: Array) -> bool:
        """Return whether legs have taken the times that the departures of those after them count on."""
        return True

    def _least(self, least: Array, left: Array | float, before: Array | float) -> Array:
        """Return the least misses (n,) [m] so far of legs that leave now [s]; `before`: when they left before."""
        return least

    def times(self, begin: Array, end: Array, angle: Array) -> Array:
        """Return the times (n,) [s] of legs with glide angles (n,) [rad]."""
        rise = end[:, 2] - begin[:, 2]
        return np.asarray(rise / self.sinking(angle, rise > 0))

    def limits(self, begin: Array, end: Array) -> tuple[Array, Array]:
        """Return the least and the greatest glide angle of each leg, (n,) each [rad]."""
        return self.angles(end[:, 2] > begin[:, 2])

    def _longest(self, angle: Array) -> Array | float:
        """Return by how much a Newton step may change the glide angles."""
        return LONGEST_TURN

    def _rows(self, begin: Array, end: Array, glides: Glides) -> Array:
        """Return the parameters (n, 7) of legs."""
        return np.column_stack([begin, glides.departs, end[:, 2], glides.angle, glides.heading])

    def _flights(self, row: Array) -> tuple[Array, Array]:
        """Return the velocities through water (n, 3) [m/s] and the times (n,) [s] of legs with parameters (n, 7).

        A step that changes a height never turns a dive into a climb: it is shorter than any leg's rise.
        """
        rise = row[:, Z_END] - row[:, Z]
        through = self.through(row[:, ANGLE], row[:, HEADING], rise > 0)
        return through, rise / through[:, 2]

    def _ends(self, of: Array) -> Array:
        """Return the ends x, y (m, n, 2) [m] of legs with parameters (m, n, 7)."""
        return self._landings(of)[..., :2]

    def _landings(self, of: Array) -> Array:
        """Return the ends and the times x, y [m], t [s] (m, n, 3) of legs with parameters (m, n, 7)."""
        row = of.reshape(-1, 7)
        through, time = self._flights(row)
        start, height = np.ascontiguousarray(row[:, : T + 1]), np.ascontiguousarray(row[:, Z_END])
        ends = np.full((len(row), 3), np.nan)
        integration = self.evaluator.integration
        longest = FLOWN * integration.dt * integration.steps
        how = self.evaluator.flow, start, through, time, height, longest, integration.dt
        in_parallel(partial(fly_legs, *how, ends), len(row), LEGS_AT_ONCE)
        return ends.reshape(*of.shape[:2], 3)


@dataclass(frozen=True)
class RisingAir(Air):
    """Computes legs as `Air` does, in a flow with a vertical part: the times of legs are known after they fly.

    So the legs of a route change their departures from step to step, and need more of them.
    """

    most_steps = 4 * MOST_STEPS

    def _expected(self, begin: Array, end: Array, angle: Array, flown: Array | None) -> Array:
        guess = self.times(begin, end, angle)
        return guess if flown is None else np.where(np.isfinite(flown), flown, guess)

    def _settled(self, expected: Array, flown: Array) -> bool:
        return bool((np.abs(flown - expected) <= AGREED).all())

    def _least(self, least: Array, left: Array | float, before: Array | float) -> Array:
        # a leg that leaves at another time begins anew
        return np.where(np.abs(np.subtract(left, before)) > AGREED, np.inf, least)

    def _time_slopes(self, begin: Array, end: Array, glides: Glides, by: tuple[Array, Array, Array]) -> Array:
        angle, heading, later = by
        time = later[ANGLE][:, None] * angle + later[HEADING][:, None] * heading
        for column, parameter in ((0, X), (1, Y), (2, Z), (5, Z_END), (6, T)):
            time[:, column] += later[parameter]
        return np.asarray(time)


def air_of(evaluator: Evaluator) -> Air:
    """Return the object that computes legs in the water of an evaluator."""
    return RisingAir(evaluator) if rises(evaluator.flow) else Air(evaluator)


def _solve(by_first: Array, by_second: Array, off: Array) -> Array:
    """Return the unknowns (a, b), (..., 2), of by_first * a + by_second * b = off; all inputs are (..., 2)."""
    det = by_first[..., 0] * by_second[..., 1] - by_second[..., 0] * by_first[..., 1]
    found = np.empty(np.broadcast_shapes(by_first.shape, off.shape))
    with np.errstate(divide="ignore", invalid="ignore"):
        found[..., 0] = (by_second[..., 1] * off[..., 0] - by_second[..., 0] * off[..., 1]) / det
        found[..., 1] = (by_first[..., 0] * off[..., 1] - by_first[..., 1] * off[..., 0]) / det
    return found
