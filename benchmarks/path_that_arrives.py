"""The quickest path that arrives, of a glider that may change heading and glide angle at even times.

A bound of the least time from above, independent of legs, edges, steering and level sets: of the project it
reads the current alone, and the polar. PIECES headings and vertical speeds are each held for an equal part of the
time. A vertical speed below that of the fastest glide stands for dives and climbs of no length; it costs no speed
across. SLSQP makes the time least, from several random guesses; meanwhile the path is flown by RK4, and once at
the end by DOP853. Beyond the surface and the floor the water goes on as its mirror image, in which a glider that
dives counts as one that climbs: so a path, folded back, stays in the box, and no limit of depth is needed. The
vertical current must be 0 at both, and dives and climbs must be alike.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

from glider_stream.base.settings import require
from glider_stream.kernels.flow import current, currents
from glider_stream.roadmap.problem import Problem

PIECES = 40
STEPS = 3
"""RK4 steps to a piece."""
GUESSES = 4
TILT = 1e-5
SCALE = 100.0
"""Misses [m] are given to SLSQP in this unit."""
MISS = 0.01
"""A path arrives if it misses the goal by less [m]."""
STILL = 1e-6
"""Vertical currents [m/s] below this count as 0 at the surface and the floor."""


@dataclass(frozen=True)
class Arriving:
    """The `time` [s] of the path; by how much [m] DOP853 `misses` the goal; places (PIECES, 3) [m], folded back.

    `times` [s] of all guesses: they show whether there are several best paths.
    """

    time: float
    misses: float
    places: Any
    times: tuple[float, ...]


@njit
def folded(z, lo, hi):
    """Return a height in the box, and -1 where it is a mirror image's, else 1."""
    at = (z - lo) % (2.0 * (hi - lo))
    return (lo + at, 1.0) if at <= hi - lo else (2.0 * hi - lo - at, -1.0)


@njit
def slopes(flow, box, through, x, y, z, t):
    """Return dx/dt, dy/dt, dz/dt [m/s] of a glider with a velocity through water (u, v, w)."""
    height, sign = folded(z, *box)
    u, v, w = current(flow, x, y, height, t)
    return through[0] + u, through[1] + v, through[2] + sign * w


@njit
def fly(flow, box, hull, controls, time, start, places):
    """Return where controls (2 n,), headings [rad] and vertical speeds [m/s], lead in a time [s].

    Write the ends (n, 3) [m] of all pieces into `places`.
    """
    count = controls.size // 2
    dt = time / count / STEPS
    x, y, z, t = start
    for n in range(count):
        level, heading = np.interp(abs(controls[count + n]), hull[0], hull[1]), controls[n]
        through = (level * math.cos(heading), level * math.sin(heading), controls[count + n])
        for _ in range(STEPS):
            a = slopes(flow, box, through, x, y, z, t)
            b = slopes(flow, box, through, x + dt / 2 * a[0], y + dt / 2 * a[1], z + dt / 2 * a[2], t + dt / 2)
            c = slopes(flow, box, through, x + dt / 2 * b[0], y + dt / 2 * b[1], z + dt / 2 * b[2], t + dt / 2)
            d = slopes(flow, box, through, x + dt * c[0], y + dt * c[1], z + dt * c[2], t + dt)
            x += dt / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            y += dt / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
            z += dt / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2])
            t += dt
        places[n] = x, y, z
    return places[-1]


@njit
def derivatives(flow, box, hull, unknown, usual, start):
    """Return the derivatives (3, 2 n + 1) of the end by controls and time, the time in shares of `usual` [s]."""
    count = (unknown.size - 1) // 2
    places, found = np.empty((count, 3)), np.empty((3, unknown.size))
    end = fly(flow, box, hull, unknown[:-1], unknown[-1] * usual, start, places).copy()
    for n in range(unknown.size):
        beside = unknown.copy()
        beside[n] += TILT
        found[:, n] = (fly(flow, box, hull, beside[:-1], beside[-1] * usual, start, places) - end) / TILT
    return found


def hull_of(polar: Any) -> Any:
    """Return the vertical speeds (n,) [m/s] from 0 to the steepest glide's, and the greatest horizontal ones."""
    require(bool(np.allclose(*polar.speed)), "the glider dives and climbs by different polars")
    knots = np.linspace(polar.shallowest[0], polar.steepest[0], polar.speed.shape[1])
    angle = np.linspace(polar.best_angle[0], polar.steepest[0], 400)
    speed = np.interp(angle, knots, polar.speed[0])
    level = speed * np.cos(angle)
    return np.array([np.r_[0.0, speed * np.sin(angle)], np.r_[level[0], level]])


def arriving(problem: Problem, guesses: int = GUESSES, seed: int = 0) -> Arriving:
    """Return the best path from start to goal that the guesses lead to."""
    assert problem.start is not None
    assert problem.goal is not None
    flow, hull = problem.evaluator.flow, hull_of(problem.evaluator.polar)
    box = float(problem.lo[2]), min(0.0, float(problem.hi[2]))
    start, goal = np.array(problem.start, float), np.array(problem.goal, float)
    begins = (*start.tolist(), problem.departure)
    usual = math.dist(start[:2], goal[:2]) / float(hull[1][0])
    rng, found = np.random.default_rng(seed), []
    for height in box:
        across = rng.uniform([*problem.lo[:2]], [*problem.hi[:2]], (1000, 2))
        at = (np.ascontiguousarray(across[:, 0]), np.ascontiguousarray(across[:, 1]))
        most = float(np.abs(currents(flow, *at, np.full(1000, height), np.zeros(1000))[:, 2]).max())
        require(most < STILL, f"the vertical current must be 0 at {height:g} m; got {most:g} m/s")
    for guess in range(guesses):
        # the second guess ends at the goal's image in the surface, the third at that in the floor
        target = goal.copy()
        target[2] = (goal[2], 2 * box[1] - goal[2], 2 * box[0] - goal[2])[guess % 3]
        unknown = first_guess(rng, hull, start, target, usual)

        def off(at: Any, target: Any = target) -> Any:
            places = np.empty((PIECES, 3))
            return (fly(flow, box, hull, at[:-1], at[-1] * usual, begins, places) - target) / SCALE

        last = np.eye(unknown.size)[-1]
        best = minimize(
            lambda at: at[-1],
            unknown,
            jac=lambda at, last=last: last,
            method="SLSQP",
            bounds=[(None, None)] * PIECES + [(-hull[0][-1], hull[0][-1])] * PIECES + [(0.3, 3.0)],
            constraints=[
                {
                    "type": "eq",
                    "fun": off,
                    "jac": lambda at: derivatives(flow, box, hull, at, usual, begins) / SCALE,
                }
            ],
            options={"maxiter": 300, "ftol": 1e-7},
        ).x
        if SCALE * np.linalg.norm(off(best)) < MISS:
            found.append((float(best[-1] * usual), best, target))
    require(bool(found), "no guess leads to a path that arrives")
    time, best, target = min(found, key=lambda one: one[0])
    places = np.empty((PIECES, 3))
    fly(flow, box, hull, best[:-1], time, begins, places)
    places[:, 2] = [folded(z, *box)[0] for z in places[:, 2]]
    misses = float(np.linalg.norm(flown(flow, box, hull, best[:-1], time, begins) - target))
    return Arriving(time, misses, places, tuple(sorted(one[0] for one in found)))


def first_guess(rng: Any, hull: Any, start: Any, target: Any, usual: float) -> Any:
    """Return headings, vertical speeds and 1: about straight to the target, through random heights."""
    count = int(rng.integers(1, 7))
    heights = np.r_[start[2], start[2] + rng.uniform(-1, 1, count) * 300.0, target[2]]
    along = np.interp(np.linspace(0, 1, PIECES + 1), np.linspace(0, 1, count + 2), heights)
    most = 0.9 * hull[0][-1]
    heading = math.atan2(target[1] - start[1], target[0] - start[0]) + rng.normal(0, 0.1, PIECES)
    return np.concatenate([heading, np.clip(np.diff(along) / (usual / PIECES), -most, most), [1.0]])


def flown(flow: Any, box: Any, hull: Any, controls: Any, time: float, begins: Any) -> Any:
    """Return where the controls lead by DOP853 (3,) [m]."""
    place, each = np.array(begins[:3]), time / PIECES
    for n in range(PIECES):
        rise, heading = controls[PIECES + n], controls[n]
        level = np.interp(abs(rise), *hull)
        through = np.array([level * math.cos(heading), level * math.sin(heading), rise])

        def rate(t: float, at: Any, through: Any = through) -> Any:
            height, sign = folded(at[2], *box)
            x, y, z, when = (np.array([value]) for value in (at[0], at[1], height, t))
            return through + currents(flow, x, y, z, when)[0] * (1.0, 1.0, sign)

        since = begins[3] + n * each
        place = solve_ivp(rate, (since, since + each), place, method="DOP853", rtol=1e-8, atol=1e-8).y[:, -1]
    return place
