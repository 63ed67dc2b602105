"""Polishing: moves a route's stops, cuts its legs and changes its number of yos, until no route near is better.

A route is defined by its stops. The leg between two stops is the exact glide that joins them. Its time is a
smooth function T(p, q, t) of its ends and its departure. The cost of the route is the sum of the costs of its
legs; each leg leaves when the leg before it arrives. Newton's method makes this cost least. The second
derivatives are blocks along the diagonal, because a stop touches only two legs. Every step of the method is a
route that can be flown.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array
from ..kernels.edges import Edge, Status
from ..roadmap.problem import Problem
from .glides import Air, Glides, Slopes, air_of
from .path import Hop, Path

LEAST_RISE = 0.05
"""A polished leg changes its depth by at least this share of the domain's depth, or by SHORTER times the smallest
change of depth in the old route. Without this limit a route would stay at the depth of the best current by very
small yos, which no vehicle flies."""
SHORTER = 0.5
"""See LEAST_RISE."""
BARRIERS = (1e-4, 5e-6)
"""The weights of the barrier, one after the other, in shares of the route's cost. The barrier keeps legs away
from the ends of the glide polar, from the horizon and from the least rise. It moves an optimum away from such a
limit by about this share."""
ROOM = 1e-7
"""A leg at a limit counts as this far away from it, as a share."""
NEARER = 0.1
"""One step may reduce the distance of a leg to such a limit at most to this share of it."""
CURVED = (20.0, 20.0, 8.0)
"""A stop is moved by this much along x, y, z [m] to measure second derivatives. The step is wide enough to pass
over the kinks of a grid, where first derivatives jump."""
SMALL_STEPS = 2
"""Polishing ends after this many small steps in a row; a single small step may come from a kink."""
SHORTENED = 6
"""A step is shortened at most this many times if its route cannot be flown or gains nothing."""
DAMPED, FREED = 10.0, 0.1
"""The damping is multiplied by the first factor after a step that fails, and by the second after any other."""
STIFF = 1e3
"""With this damping a step moves almost nothing, so polishing ends."""
SHIFTS = 40
"""The diagonal of second derivatives is raised at most this many times, twice as much each time, until they are
positive definite; then a step is zero."""
FAR = 0.5
"""In one step a stop moves at most by this share of the longer of its two legs."""


class Effort(NamedTuple):
    """How long a route is polished.

    `moves` is the greatest number of steps for each barrier. A step that gains less than the share `enough` of
    the cost counts as small. Only the first of BARRIERS are used, as many as `barriers` says.
    """

    moves: int = 30
    enough: float = 3e-5
    barriers: int = len(BARRIERS)


class Chain(NamedTuple):
    """A route in polishing: its stops (n + 1, 3) [m], the n legs between them, its cost."""

    stops: Array
    glides: Glides
    cost: float


@dataclass(frozen=True)
class Polisher:
    """Improves the routes of a problem.

    `stays` says whether a stop (3,) [m] keeps its depth. `frozen`: every leg meets the current of the departure.
    `single_yos`: yos with a top under water may be added to single legs. `least_rise` [m] is the least change of
    depth of a leg.
    """

    problem: Problem
    stays: Callable[[Array], bool] = lambda stop: False
    frozen: bool = False
    single_yos: bool = True
    least_rise: float = 1.0

    @classmethod
    def of(cls, problem: Problem, path: Path, **how: Any) -> "Polisher":
        """Make a polisher with the least rise that fits a path."""
        shortest = min(abs(float(leg.end[2] - leg.start[2])) for leg in path.legs)
        depth = float(problem.hi[2] - problem.lo[2])
        return cls(problem, least_rise=min(LEAST_RISE * depth, SHORTER * shortest), **how)

    @property
    def air(self) -> Air:
        """The object that computes legs."""
        return air_of(self.problem.evaluator)

    def glide(self, stops: Array, angle: Array, heading: Array) -> Glides:
        """Return the legs between stops; each leaves when the one before arrives, if frozen at the departure."""
        departs = self.problem.departure
        left = np.full(len(angle), departs) if self.frozen else departs
        return self.air.glide(stops[:-1], stops[1:], angle, heading, left)

    def chain(self, stops: Array, angle: Array, heading: Array) -> Chain | None:
        """Return the route through stops, from a guess of its controls (n,) [rad]; None if it cannot be flown."""
        glides = self.glide(stops, angle, heading)
        if not (glides.exact.all() and self._within(stops, glides).all()):
            return None
        return Chain(stops, glides, self.cost(stops, glides))

    def chain_of(self, path: Path) -> Chain | None:
        """Return a path as a chain with exact legs; None if it cannot be flown.

        A leg that passes its stop within the tolerance may be too steep to end there. Then the legs meet where
        they were flown to.
        """
        stops = np.array([path.legs[0].start, *(leg.end for leg in path.legs)])
        angle = np.array([abs(leg.glide_angle) for leg in path.legs])
        heading = np.array([leg.heading for leg in path.legs])
        found = self.chain(stops, angle, heading)
        if found is None and len(path.legs) > 1:
            flown = [leg.trajectory[-1, 1:] for leg in path.legs[:-1]]
            stops[1:-1] = [old if self.stays(old) else new for old, new in zip(stops[1:-1], flown, strict=True)]
            found = self.chain(stops, angle, heading)
        return found

    def hops(self, chain: Chain) -> list[Hop]:
        """Return the legs of a route in the form from which a path is made."""
        stops, glides, price = chain.stops, chain.glides, self.problem.evaluator.cost.kernel()
        climbs = np.diff(stops[:, 2]) > 0
        speed = self.air.speed(glides.angle, climbs)
        legs = []
        for n, time in enumerate(glides.time.tolist()):
            angle = float(glides.angle[n] if climbs[n] else -glides.angle[n])
            heading = math.remainder(float(glides.heading[n]), math.tau)
            cost = price.per_second * time + price.per_leg
            control = angle, heading, float(speed[n]), float(glides.miss[n])
            legs.append((stops[n], stops[n + 1], Edge(int(Status.CONNECTED), time, cost, *control)))
        return legs

    def cost(self, stops: Array, glides: Glides) -> float:
        """Return the scenario's cost of a route, with the cost of its turns."""
        price = self.problem.evaluator.cost.kernel()
        legs = price.per_second * float(glides.time.sum()) + price.per_leg * len(glides.time)
        return legs + float(self._pumped(stops[:-1, 2])[self._turns(stops)].sum())

    def worth(self, slopes: Slopes) -> Array:
        """Return the cost (n,) of one second more of each leg of a route: the legs after it leave later."""
        price = self.problem.evaluator.cost.kernel().per_second
        late = np.zeros(len(slopes.time) + 1)
        for n in range(len(slopes.time) - 1, -1, -1):
            by_delay = 0.0 if self.frozen else slopes.time[n, 6]
            late[n] = late[n + 1] + (price + late[n + 1]) * by_delay
        return price + late[1:]

    def polish(self, chain: Chain, effort: Effort = Effort()) -> Chain:  # noqa: B008  (frozen)
        """Improve the stops between start and goal by Newton's method."""
        first = chain
        for weight in BARRIERS[: effort.barriers]:
            damping, small = 1e-3, 0
            for _ in range(effort.moves if len(chain.stops) > 2 else 0):
                better, damping = self._step(chain, weight * chain.cost, damping)
                if better is None:
                    break
                gain, chain = chain.cost - better.cost, better
                small = small + 1 if abs(gain) < effort.enough * chain.cost else 0
                if small == SMALL_STEPS:
                    break
        return min(first, chain, key=lambda route: route.cost)  # the barrier may have made it worse

    def _step(self, chain: Chain, weight: float, damping: float) -> tuple[Chain | None, float]:
        """Make a Newton step; return a better route, None if no damping gives one, and the next damping."""
        step = _Step.of(self, chain, weight)
        while damping < STIFF:
            better = self._along(chain, step, step.move(damping), weight)
            if better is not None:
                return better, max(damping * FREED, 1e-6)
            damping *= DAMPED
        return None, damping

    def merit(self, chain: Chain, weight: float) -> float:
        """Return the cost of a route plus its barrier."""
        room, _ = self._room(chain.stops, chain.glides, None)
        return chain.cost - weight * float(np.log(room).sum())

    def _along(self, chain: Chain, step: "_Step", move: Array, weight: float) -> Chain | None:
        """Return a better route along a move (n + 1, 3) [m] of the stops; None if no part of the move gives one.

        Stops whose legs cannot be flown move less.
        """
        before, share = self.merit(chain, weight), np.ones(len(chain.stops))
        room = self._room(chain.stops, chain.glides, None)[0]
        for _ in range(SHORTENED):
            stops = self._held(chain.stops + share[:, None] * move)
            stops = np.where((share > 0)[:, None], stops, chain.stops)
            shift = stops - chain.stops
            turned = self._flips(stops, chain.stops)
            if turned.any():  # a dive has become a climb, or a climb a dive
                share = np.where(_at_ends(turned), 0.4 * share, share)
                continue
            both = np.concatenate([shift[:-1], shift[1:]], axis=1)
            guess = self.air.aimed(stops[:-1], stops[1:], chain.glides, step.slopes, both)
            glides = self.glide(stops, guess.angle, guess.heading)
            bad = ~self._within(stops, glides)
            bad |= (self._room(stops, glides, None)[0] < NEARER * room).any(axis=1)
            if bad.any():
                share = np.where(_at_ends(bad), 0.4 * share, share)
                continue
            after = Chain(stops, glides, self.cost(stops, glides))
            if self.merit(after, weight) < before:
                return after
            share *= 0.4
        return None

    def _flips(self, stops: Array, before: Array) -> NDArray[np.bool_]:
        """Return a mask (n,) of the legs that changed from a dive to a climb, or from a climb to a dive."""
        return np.asarray(np.diff(stops[:, 2]) * np.diff(before[:, 2]) <= 0, np.bool_)

    def _held(self, stops: Array) -> Array:
        stops = stops.copy()
        stops[1:-1, 2] = np.clip(stops[1:-1, 2], self.problem.lo[2], min(0.0, float(self.problem.hi[2])))
        return stops

    def _within(self, stops: Array, glides: Glides) -> NDArray[np.bool_]:
        """Return a mask (n,) of the legs that may be flown: in open water, within the horizon, not too short."""
        short = np.abs(np.diff(stops[:, 2])) < self.least_rise
        late = self._too_long(glides)
        late |= glides.departs + glides.time > self.problem.evaluator.flow.extent.t_hi
        fits = glides.exact & ~short & ~late & np.isfinite(glides.time)
        return self.air.fit(stops[:-1], stops[1:], glides) if fits.all() else np.asarray(fits, np.bool_)

    def _too_long(self, glides: Glides) -> NDArray[np.bool_]:
        """Return a mask (n,) of the legs that last longer than the horizon."""
        integration = self.problem.evaluator.integration
        return np.asarray(glides.time > integration.dt * integration.steps, np.bool_)

    def _room(self, stops: Array, glides: Glides, slopes: Slopes | None) -> tuple[Array, Array]:
        """Return how far legs are from their four limits (n, 4), as shares, and its slopes (n, 4, 6) by ends."""
        rise = np.diff(stops[:, 2])
        climbs = rise > 0
        lowest, highest = self.air.angles(climbs)
        span = highest - lowest
        horizon = self.problem.evaluator.integration.dt * self.problem.evaluator.integration.steps
        depth = float(self.problem.hi[2] - self.problem.lo[2])
        room = np.stack(
            [
                (glides.angle - lowest) / span,
                (highest - glides.angle) / span,
                1 - glides.time / horizon,
                (np.abs(rise) - self.least_rise) / depth,
            ],
            axis=1,
        )
        by = np.zeros((len(rise), 4, 6))
        if slopes is not None:
            by[:, 0] = slopes.angle[:, :6] / span[:, None]
            by[:, 1] = -by[:, 0]
            by[:, 2] = -slopes.time[:, :6] / horizon
            by[:, 3, 2], by[:, 3, 5] = -np.sign(rise) / depth, np.sign(rise) / depth
        return np.maximum(room, 0.0) + ROOM, by

    def _turns(self, stops: Array) -> NDArray[np.bool_]:
        """Return a mask (n,) of the legs that climb after a dive; a route begins as if it had dived."""
        climbs = np.diff(stops[:, 2]) > 0
        return np.asarray(climbs & ~np.concatenate([[False], climbs[:-1]]), np.bool_)

    def _pumped(self, z: Array) -> Array:
        pumped = self.problem.evaluator.cost.inflection(z)
        return np.zeros(len(z)) if pumped is None else np.asarray(pumped, np.float64)


def _at_ends(legs: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a mask (n + 1,) of the stops at the ends of the marked legs (n,)."""
    at = np.zeros(len(legs) + 1, np.bool_)
    at[:-1] |= legs
    at[1:] |= legs
    return at


@dataclass(frozen=True)
class _Step:
    """Derivatives of a route's cost by its inner stops: `gradient` (n - 1, 3), and second derivatives as a band.

    `free` (n - 1, 3) marks the coordinates that may move, `longest` (n - 1,) [m] is how far stops may move, and
    `slopes` are the derivatives of the legs.
    """

    gradient: Array
    band: Array
    free: NDArray[np.bool_]
    longest: Array
    slopes: Slopes

    @classmethod
    def of(cls, polisher: Polisher, chain: Chain, weight: float) -> "_Step":
        """Compute the derivatives of a route, with a barrier of this weight."""
        stops, glides = chain.stops, chain.glides
        slopes = polisher.air.slopes(stops[:-1], stops[1:], glides)
        worth = polisher.worth(slopes)
        room, by = polisher._room(stops, glides, slopes)
        leg = worth[:, None] * slopes.time[:, :6] - weight * (by / room[:, :, None]).sum(axis=1)
        bent = worth[:, None, None] * cls._curvature(polisher, stops, glides, slopes)
        bent = bent + weight * np.einsum("nci,ncj->nij", by / room[:, :, None] ** 2, by)
        turns = polisher._turns(stops)
        up, down = (polisher._pumped(stops[:-1, 2] + sign) for sign in (1.0, -1.0))
        leg[:, 2] += np.where(turns, (up - down) / 2, 0.0)
        gradient = leg[1:, :3] + leg[:-1, 3:]
        band = np.zeros((6, gradient.size))  # the lower band, in the form of LAPACK
        block, below = bent[:-1, 3:, 3:] + bent[1:, :3, :3], bent[1:-1, 3:, :3]
        for i in range(3):
            for j in range(3):
                if i >= j:
                    band[i - j, j::3] = block[:, i, j]
                band[3 + i - j, j:-3:3] = below[:, i, j]
        lowest, highest = polisher.problem.lo[2], min(0.0, float(polisher.problem.hi[2]))
        between, free = stops[1:-1], np.ones_like(gradient, np.bool_)
        lies, floats = between[:, 2] <= lowest + 1e-9, between[:, 2] >= highest - 1e-9
        free[:, 2] = ~((lies & (gradient[:, 2] > 0)) | (floats & (gradient[:, 2] < 0)))
        free[:, 2] &= ~np.array([polisher.stays(stop) for stop in between], np.bool_)
        length = np.abs(np.diff(stops, axis=0))
        reach = np.maximum(np.linalg.norm(length[:-1], axis=1), np.linalg.norm(length[1:], axis=1))
        return cls(gradient, band, free, FAR * reach, slopes)

    @staticmethod
    def _curvature(polisher: Polisher, stops: Array, glides: Glides, slopes: Slopes) -> Array:
        """Return second derivatives (n, 6, 6) of each leg's time by its ends, from differences of the first."""
        ends, count = np.concatenate([stops[:-1], stops[1:]], axis=1), len(stops) - 1
        rise, climbs = np.abs(np.diff(stops[:, 2])), np.diff(stops[:, 2]) > 0
        moved, steps = np.tile(ends, (6, 1, 1)), np.empty((6, count))
        for n in range(6):
            steps[n] = CURVED[n % 3]
            if n % 3 == 2:
                # the ends move apart in depth, not together, so a dive stays a dive and a climb a climb
                steps[n] = np.where(climbs == (n == 5), 1.0, -1.0) * np.minimum(steps[n], 0.2 * rise)
            moved[n, :, n] += steps[n]
        shifted = moved[..., :3].reshape(-1, 3), moved[..., 3:].reshape(-1, 3)
        # the leg and the six beside it are computed alike, so the errors of their first derivatives cancel
        all_begin, all_end = (
            np.concatenate([at, six]) for at, six in zip((stops[:-1], stops[1:]), shifted, strict=True)
        )
        repeated = Glides(*(np.tile(values, 7) for values in glides))
        wide = Slopes(*(np.tile(values, (7, 1)) for values in slopes))
        shift = np.concatenate([ends, moved.reshape(-1, 6)]) - np.tile(ends, (7, 1))
        beside = polisher.air.aimed(all_begin, all_end, repeated, wide, shift)
        first = polisher.air.slopes(all_begin, all_end, beside, one_sided=True).time[:, :6].reshape(7, count, 6)
        change = (first[1:] - first[0]) / steps[..., None]
        bent = np.where(np.isfinite(change), change, 0.0).transpose(1, 0, 2)
        return np.asarray(0.5 * (bent + bent.transpose(0, 2, 1)))

    def move(self, damping: float) -> Array:
        """Return the step (n + 1, 3) [m] of all stops; steps that are too long are shortened."""
        from scipy.linalg.lapack import dpbsv  # importing it takes 0.03 s, which a query without it does not need

        band, free = self.band.copy(), self.free.ravel()
        gradient = np.where(free, self.gradient.ravel(), 0.0)
        for n in range(1, 6):
            both = free[n:] & free[:-n] if len(free) > n else np.zeros(0, np.bool_)
            band[n, : len(both)] = np.where(both, band[n, : len(both)], 0.0)
        scale = np.abs(self.band[0])
        band[0] = np.where(free, band[0] + damping * np.maximum(scale, scale.mean()), 1.0)
        step = np.zeros_like(gradient)
        for n in range(SHIFTS):
            _, solved, failed = dpbsv(band, -gradient, lower=1)
            if not failed:
                step = solved
                break
            # the band is not positive definite
            band[0] = np.where(free, band[0] + 2**n * 1e-2 * np.maximum(scale, scale.mean()), 1.0)
        move: Array = step.reshape(-1, 3)
        length = np.linalg.norm(move, axis=1)
        move = move * np.minimum(1.0, self.longest / np.maximum(length, 1e-12))[:, None]
        return np.concatenate([np.zeros((1, 3)), move, np.zeros((1, 3))])
