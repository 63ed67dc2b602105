"""VF-RRT, a planner that the paper cites, on this project's legs: a random tree that leans on the current.

Ko, Kim and Park, A vector field-based path planning algorithm: VF-RRT (2014). The way of a new leg lies between
the way to a random place and the way of the current there, and takes the less effort against the current the
greater the gain is. The gain adapts to how often new places are of use. The tree ends at the first route: VF-RRT
has no way to better it.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.flow import currents
from ..roadmap.problem import Problem
from .fmt_star import Found, travel_times

GOAL = 0.05
"""The share of random places that are the goal."""
MEAN_OF = 1000
"""The mean speed of the current is that at so many random places."""
SAME = 0.1
"""A new place nearer to the tree than this share of a step is of no use."""
STILL = 1e-7
"""A slower current [m/s] has no direction."""


@dataclass
class Gain:
    """The gain lambda: after `every` draws it falls by the share of vain ones, and rises by `exploration`."""

    value: float = 1.0
    exploration: float = 0.7
    every: int = 100
    vain: int = 0
    draws: int = 0

    def tell(self, useful: bool) -> None:
        """Count a draw, and adapt."""
        self.draws += 1
        self.vain += not useful
        if self.draws == self.every:
            self.value *= 1.0 - self.vain / self.draws + self.exploration
            self.vain = self.draws = 0


def leaning(drawn: Array, carried: Array, gain: float) -> Array:
    """Return a unit vector between two, (3,) each: `carried` for a great gain, `drawn` for none.

    With sigma the upstream effort |drawn - carried|^2 / 4, its quantile in the density ~ exp(-gain z) on [0, 2]
    is the effort z of the result, at the distance sqrt(2 z) from `carried`.
    """
    effort = 0.25 * float(np.sum((drawn - carried) ** 2))
    if gain > 0.0:
        effort = -math.log1p(effort * math.expm1(-2.0 * gain)) / gain
    else:
        effort *= 2.0
    across = drawn - (drawn @ carried) * carried
    length = float(np.linalg.norm(across))
    if length < 1e-12:
        return drawn
    cosine = 1.0 - effort
    return np.asarray(cosine * carried + math.sqrt(max(1.0 - cosine**2, 0.0)) * across / length)


def vf_rrt(problem: Problem, reach: float, draws: int = 20_000, seed: int = 0) -> Found:
    """Return the route of VF-RRT from the scenario's start to its goal, with steps of up to `reach` [m].

    inf if `draws` random places do not lead to the goal.
    """
    require(reach > 0, f"`reach` must be above 0 m; got {reach:g}")
    require(draws >= 1, f"`draws` must be at least 1; got {draws}")
    require(problem.start is not None, "the scenario has no [query]: it names the start and the goal; add it")
    random, gain, goal = np.random.default_rng(seed), Gain(), np.asarray(problem.goal, float)
    anywhere = random.uniform(problem.lo, problem.hi, (MEAN_OF, 3))
    mean = float(np.linalg.norm(_currents(problem, anywhere, 0.0), axis=1).mean())
    places, arrival, parent = np.array([problem.start], float), [0.0], [-1]
    for _ in range(draws):
        toward = goal if random.random() < GOAL else random.uniform(problem.lo, problem.hi)
        near = int(np.argmin(np.linalg.norm(places - toward, axis=1)))
        away = float(np.linalg.norm(toward - places[near]))
        carried = _currents(problem, places[near][None], arrival[near])[0]
        new = places[near] + min(reach, away) * _turned((toward - places[near]) / away, carried, gain.value, mean)
        took = _leg(problem, places[near], new, arrival[near])
        apart = float(np.linalg.norm(places - new, axis=1).min())
        gain.tell(math.isfinite(took) and apart > SAME * reach)
        if math.isfinite(took):
            places = np.vstack([places, new])
            arrival.append(arrival[near] + took)
            parent.append(near)
            last = _leg(problem, new, goal, arrival[-1])
            if math.isfinite(last):
                return Found(arrival[-1] + last, np.vstack([places[_way(parent)], goal]), len(parent))
    return Found(math.inf, np.empty((0, 3)), len(parent))


def _currents(problem: Problem, places: Array, since: float) -> Array:
    x, y, z = np.ascontiguousarray(places.T)
    when = np.full(len(places), problem.departure + since)
    return np.asarray(currents(problem.evaluator.flow, x, y, z, when))


def _turned(drawn: Array, carried: Array, gain: float, mean: float) -> Array:
    speed = float(np.linalg.norm(carried))
    return drawn if speed < STILL else leaning(drawn, carried / speed, gain * speed / mean)


def _leg(problem: Problem, start: Array, end: Array, since: float) -> float:
    """The travel time [s] of a leg, inf where none exists or the end is outside the box."""
    if (end < problem.lo).any() or (end > problem.hi).any():
        return math.inf
    rows = [np.ones(1, np.int64)]
    return float(travel_times(problem, np.stack([start, end]), [0], np.array([since]), rows)[0])


def _way(parent: list[int]) -> list[int]:
    way = [len(parent) - 1]
    while parent[way[-1]] >= 0:
        way.append(parent[way[-1]])
    return way[::-1]
