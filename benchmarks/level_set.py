"""A bound below every travel time of a scenario: the time-optimal path, by a level-set method.

No route of legs can be faster than a glider whose glide angle and heading may change at every instant. The
set that such a glider can have reached is a front; V_t + max over the controls of f . grad V = 0 moves it,
with f = (u + Vh cos heading, v + Vh sin heading, ±w) and (Vh, w) on the glide polar or between two of its
points. hj-reachability solves that (WENO5, local Lax-Friedrichs, TVD Runge-Kutta 3). Nothing here reads the
project's legs, edges or steering: only the flow as the planner reads it, the polar and the two points.

- Start. V(., 0) is the time tau [s] that a glider in still water needs from the start, as sqrt(tau^2 + SOFT^2)
  - SOFT, which moves alike and has no tip. V(goal, t) tells the tau for which a glider begun somewhere within
  tau of the start first reaches the goal at t. A glider from the start itself needs tau / (1 + m / Vh) or more
  to get out of there, m the greatest current within tau, Vh the greatest horizontal speed, and t from then on:
  t + tau / (1 + m / Vh) is a bound below. One run gives every tau; large ones bound loosely where the current
  near the start is strong, and within four cells or so the front is smeared and late. --tau says which counts.
- Either end. In a steady flow the front may as well begin at the goal, in the opposite flow. The runs that
  count begin at the end with the smaller m; all grids but the finest are run from the other end too, as a check.
- A flow that changes with time is read anew at the middle of every STEP; the front then begins at the start
  alone, and there is no path from above.
- Surface and floor. The field goes on beyond both as its mirror image. A path there, folded back, dives where
  it climbed, which a polar alike in both allows (else the script refuses): the mirror is exact. It lets gliders
  slide along the surface and hold a depth at the best horizontal speed, as dives and climbs of no length do.
- Sides. Nothing comes in through the sides of the flow's box, and no leg may leave it.
- Grids. Their nodes should be among those of a sampled flow or halve its cells, or the scheme sees another flow.
- From above. The best path, traced through the first run, becomes a first guess of headings and vertical
  speeds, changed at even times, and SLSQP shortens it: a path that arrives, flown by RK4 in the same flow.

So every error but the scheme's own puts the bound below the optimum. `error_s` estimates the scheme's and
proves nothing: the most of what the finest grid differs by from the next and between tau, what the ends differ
by on the finest grid run from both, and what the finest grid is above the path that arrives. `bound_s` is the
finest grid's bound less that. A leg that ends short of its node by up to the tolerance gains as much way on it;
flow-map legs end within 0.01 m.

It needs an environment of its own (JAX): python -m venv hj; hj/bin/pip install hj-reachability scipy -e .
Then: hj/bin/python benchmarks/level_set.py seed-box -o benchmarks/records/level_set_seed_box.json
"""

import argparse
import importlib.metadata
import json
import math
import os
import platform
import sys
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("JAX_PLATFORMS", "cpu")

import hj_reachability as hj
import jax.numpy as jnp
import numpy as np
from hj_reachability.boundary_conditions import extrapolate_away_from_zero
from numba import njit
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import map_coordinates
from scipy.optimize import minimize

from glider_stream.base.errors import InputError
from glider_stream.base.settings import require
from glider_stream.kernels.flow import rises, velocities
from glider_stream.kernels.motion import rk4_step
from glider_stream.kernels.place import Place, Velocity
from glider_stream.roadmap.problem import Problem
from glider_stream.scenario import read_scenario
from glider_stream.water.inspect import is_steady

GRIDS = ("51,51,31", "101,101,61", "201,201,61")
TAUS = (40, 60, 80, 100)
"""Sizes [s] of the set that the front begins at."""
SOFT = 60.0
STEP = 4.0
"""Between readings [s]; the solver's own steps are shorter."""
SLOPES = 512
PIECES = 80
"""Controls of the path from above."""


class Waters:
    """What the bound reads of a problem: flow, two ends, box [m], and the polar's hull.

    `support` (SLOPES + 1,) is the greatest (1 - a) Vh + a w [m/s] for a from 0 to 1; `sink`, `level` are the
    hull's edge, the greatest Vh [m/s] at |w|.
    """

    def __init__(self, problem: Problem) -> None:
        flow, polar = problem.evaluator.flow, problem.evaluator.polar
        require(problem.start is not None, "the scenario has no [query]: it names the start and the goal")
        require(bool(np.allclose(*polar.speed)), "the glider dives and climbs by different polars")
        self.flow, self.departure, self.steady = flow, problem.departure, is_steady(flow)
        self.ends = np.array(problem.start, float), np.array(problem.goal, float)
        self.lo = np.array([flow.extent.x_lo, flow.extent.y_lo, problem.lo[2]])
        self.hi = np.array([flow.extent.x_hi, flow.extent.y_hi, problem.hi[2]])
        borders = bool(np.isfinite([self.lo, self.hi]).all())
        require(borders, "the flow has no borders; give `flow.x` and `flow.y`")
        knots = np.linspace(polar.shallowest[0], polar.steepest[0], polar.speed.shape[1])
        angle = np.linspace(knots[0], knots[-1], 20_001)
        speed = np.interp(angle, knots, polar.speed[0])
        level, sink = speed * np.cos(angle), speed * np.sin(angle)
        self.fastest, self.steepest, best = float(level.max()), float(sink.max()), level.argmax()
        # convex in a: the table, linear between, errs towards faster
        self.share = np.linspace(0.0, 1.0, SLOPES + 1)
        self.support = np.array([((1 - a) * level + a * sink).max() for a in self.share])
        self.sink, self.level = np.r_[0.0, sink[best:]], np.r_[level[best], level[best:]]

    def current(self, at: np.ndarray, since: float = 0.0) -> np.ndarray:
        """Current (u, v) [m/s] at points (..., 3), `since` [s] after departure."""
        x, y, z = np.ascontiguousarray(at.reshape(-1, 3).T, dtype=np.float64)
        uv = velocities(self.flow, x, y, z, np.full(x.size, self.departure + since))
        return np.asarray(uv).reshape(*at.shape[:-1], 2)

    def still_water_time(self, away: np.ndarray) -> np.ndarray:
        """Time [s] over distances (..., 3) [m] in still water."""
        across, along = np.hypot(away[..., 0], away[..., 1]), np.abs(away[..., 2])
        result = np.zeros_like(across)
        for a, support in zip(self.share, self.support, strict=True):
            result = np.maximum(result, ((1 - a) * across + a * along) / support)
        return result

    def quickening(self, end: np.ndarray, tau: float) -> float:
        """1 + m / Vh, m the greatest current within `tau` [s] of an end."""
        reach = tau * np.array([self.fastest, self.fastest, self.steepest])
        away = np.stack(np.meshgrid(*(np.linspace(-r, r, 61) for r in reach), indexing="ij"), axis=-1)
        at = np.clip(end + away[self.still_water_time(away) <= 1.05 * tau], self.lo, self.hi)
        return 1.0 + float(np.linalg.norm(self.current(at), axis=-1).max()) / self.fastest


class Glide(hj.dynamics.Dynamics):
    """The library's view of a glider in a flow; a state is x, y, z and the current u, v there."""

    def __init__(self, waters: Waters) -> None:
        self.support, self.most = jnp.asarray(waters.support), (waters.fastest, waters.steepest)

    def __call__(self, state: Any, control: Any, disturbance: Any, time: Any) -> Any:
        """Not needed: the Hamiltonian is given."""
        raise NotImplementedError

    optimal_control_and_disturbance = __call__

    def hamiltonian(self, state: Any, time: Any, value: Any, grad_value: Any) -> Any:
        """u p_x + v p_y + max over the hull of Vh |p_xy| + w |p_z|."""
        across, along = jnp.hypot(grad_value[0], grad_value[1]), jnp.abs(grad_value[2])
        size = across + along
        at = SLOPES * along / jnp.maximum(size, 1e-20)
        below = jnp.minimum(at.astype(jnp.int32), SLOPES - 1)
        low, high = self.support[below], self.support[below + 1]
        reach = size * (low + (at - below) * (high - low))
        return state[3] * grad_value[0] + state[4] * grad_value[1] + reach

    def partial_max_magnitudes(self, state: Any, time: Any, value: Any, grad_value_box: Any) -> Any:
        """Largest speed along each axis."""
        level, sink = self.most
        return jnp.stack([jnp.abs(state[3]) + level, jnp.abs(state[4]) + level, jnp.asarray(sink, state.dtype)])


def mirror(values: Any, width: int) -> Any:
    """The library's boundary condition at the surface and the floor: a mirror in the last node."""
    return jnp.pad(values, ((width, width),), mode="reflect")


class Front:
    """One run, from the start or, `backwards`, from the goal; `frames`, V at every STEP, if kept.

    By tau [s]: `touch`, when the far end is first touched; `bound`, below the travel time.
    """

    def __init__(
        self, waters: Waters, shape: tuple[int, ...], backwards: bool, latest: float, keep: bool
    ) -> None:
        began = time.perf_counter()
        self.shape, self.backwards = shape, backwards
        self.source, self.far = waters.ends[::-1] if backwards else waters.ends
        sides = (extrapolate_away_from_zero, extrapolate_away_from_zero, mirror)
        box = hj.sets.Box(waters.lo, waters.hi)
        grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(box, shape, sides)
        self.axes = [np.linspace(a, b, n) for a, b, n in zip(waters.lo, waters.hi, shape, strict=True)]
        nodes = np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1)
        places, sign = grid.states, -1 if backwards else 1

        def in_current(since: float) -> Any:
            uv = jnp.asarray(sign * waters.current(nodes, since), places.dtype)
            return grid.replace(states=jnp.concatenate([places, uv], axis=-1))

        moving = in_current(0.0)
        tau = waters.still_water_time(nodes - self.source)
        values = jnp.asarray(np.hypot(tau, SOFT) - SOFT, grid.states.dtype)
        settings = hj.SolverSettings.with_accuracy(
            "very_high", artificial_dissipation_scheme=hj.artificial_dissipation.local_local_lax_friedrichs
        )
        dynamics, now, left = Glide(waters), 0.0, math.inf
        self.frames, self.touch = [np.asarray(values)] if keep else [], dict.fromkeys(TAUS, math.nan)
        # the path needs frames until the front has arrived
        while left > (5 if keep else min(TAUS)) and now < latest:
            if not waters.steady:
                moving = in_current(now + STEP / 2)
            values = hj.step(settings, dynamics, moving, now, values, now + STEP, progress_bar=False)
            now, before, left = now + STEP, left, self._tau(np.asarray(values))
            for one in TAUS:
                if left <= one < before:
                    self.touch[one] = now - STEP * (one - left) / (before - left)
            if keep:
                self.frames.append(np.asarray(values))
        self.bound = {t: at + t / waters.quickening(self.source, t) for t, at in self.touch.items()}
        self.wall = time.perf_counter() - began

    def _tau(self, values: np.ndarray) -> float:
        """tau [s] at the far end, cubic in the nodes around it; 0 where V has sunk below its least value."""
        place = [(c - axis[0]) / (axis[1] - axis[0]) for c, axis in zip(self.far, self.axes, strict=True)]
        first = [min(max(int(p) - 5, 0), n - 12) for p, n in zip(place, self.shape, strict=True)]
        patch = values[tuple(slice(f, f + 12) for f in first)].astype(np.float64)
        value = map_coordinates(patch, [[p - f] for p, f in zip(place, first, strict=True)], mode="mirror")[0]
        return math.sqrt(max(value + SOFT, SOFT) ** 2 - SOFT**2)

    def trace(self, waters: Waters) -> np.ndarray:
        """The best path from start to goal, points (n, 3), through every second frame."""
        heading = np.linspace(-math.pi, math.pi, 180, endpoint=False)
        sink = np.linspace(-waters.steepest, waters.steepest, 41)[:, None]
        level = np.interp(np.abs(sink), waters.sink, waters.level)
        parts = (level * np.cos(heading), level * np.sin(heading), sink + 0 * heading)
        control, path, sign = np.stack(parts, axis=-1).reshape(-1, 3), [self.far], 1 if self.backwards else -1

        def moved(at: np.ndarray, seconds: float) -> np.ndarray:
            drift = control + np.pad(waters.current(at), ((0, 0), (0, 1)))
            return np.clip(path[-1] + sign * seconds * drift, waters.lo, waters.hi)

        for frame in self.frames[-3::-2]:
            points = moved(moved(np.broadcast_to(path[-1], control.shape), STEP), 2 * STEP)
            path.append(points[RegularGridInterpolator(self.axes, frame)(points).argmin()])
        return np.stack([*path, self.source][::sign])


@njit
def fly(flow, sinks, levels, heading, sink, duration, start, t):
    """Where the controls lead, each held for an equal part of `duration` [s]: points (n, 3) at their ends."""
    steps = max(4, int(duration / heading.size / 2.0))
    dt = duration / heading.size / steps
    x, y, z = start
    path = np.empty((heading.size, 3))
    for n in range(heading.size):
        level, w = np.interp(abs(sink[n]), sinks, levels), sink[n]
        through = Velocity(level * math.cos(heading[n]), level * math.sin(heading[n]), w)
        for _ in range(steps):
            x, y = rk4_step(flow, Place(x, y, z, t), through, dt)
            z += dt * w
        path[n] = x, y, z
    return path


def shorten(waters: Waters, path: np.ndarray, duration: float) -> dict[str, float]:
    """The quickest path near a first guess: its duration [s], by how much [m] it misses the goal and the box."""
    start, goal = waters.ends
    parts = np.linspace(0, len(path) - 1, PIECES + 1)
    knots = np.stack([np.interp(parts, np.arange(len(path)), column) for column in path.T], axis=-1)
    needed = np.diff(knots, axis=0) / (duration / PIECES)
    water = needed[:, :2] - waters.current(0.5 * (knots[1:] + knots[:-1]))
    heading = np.unwrap(np.arctan2(water[:, 1], water[:, 0]))
    guess = np.concatenate([heading, np.clip(needed[:, 2], -waters.steepest, waters.steepest), [1.0]])

    def flown(c: np.ndarray) -> np.ndarray:
        parts = (c[:PIECES], c[PIECES:-1], c[-1] * duration)
        return np.asarray(fly(waters.flow, waters.sink, waters.level, *parts, tuple(start), waters.departure))

    def room(c: np.ndarray) -> np.ndarray:
        depth = flown(c)[:-1, 2]
        return np.concatenate([waters.hi[2] - depth, depth - waters.lo[2]])

    found = minimize(
        lambda c: c[-1],
        guess,
        method="SLSQP",
        bounds=[(None, None)] * PIECES + [(-waters.steepest, waters.steepest)] * PIECES + [(0.5, 2.0)],
        constraints=[
            {"type": "eq", "fun": lambda c: (flown(c)[-1] - goal) / 100},
            {"type": "ineq", "fun": lambda c: room(c) / 100},
        ],
        options={"maxiter": 400, "ftol": 1e-8},
    ).x
    path = flown(found)
    return {
        "travel_time_s": round(float(found[-1] * duration), 3),
        "miss_m": round(float(np.linalg.norm(path[-1] - goal)), 6),
        "outside_m": round(float(np.maximum(waters.lo - path, path - waters.hi).max(initial=0.0)), 6),
    }


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Every grid, coarse to fine; the path from above; what they say together."""
    problem = read_scenario(args.scenario, args.set).problem()
    level = not rises(problem.evaluator.flow)
    require(level, "the current has a vertical part, which this script leaves out; use `glider-stream bound`")
    waters = Waters(problem)
    slower = [waters.quickening(end, args.tau) for end in waters.ends]
    backwards = waters.steady and slower[1] < slower[0]
    shapes = [tuple(int(n) for n in text.split(",")) for text in args.grid or GRIDS]
    runs: list[dict[str, Any]] = []
    above: dict[str, float] = {}
    for shape in shapes:
        for way in (backwards, not backwards)[: 1 if shape is shapes[-1] or not waters.steady else 2]:
            front = Front(waters, shape, way, args.latest, keep=waters.steady and not runs)
            runs.append({
                "grid": list(shape),
                "spacing_m": [round(float(axis[1] - axis[0]), 3) for axis in front.axes],
                "from": "goal" if way else "start",
                "bound_s": {str(tau): round(bound, 2) for tau, bound in front.bound.items()},
                "touch_plus_tau_s": {str(tau): round(at + tau, 2) for tau, at in front.touch.items()},
                "wall_s": round(front.wall, 1),
            })  # fmt: skip
            print(runs[-1], file=sys.stderr, flush=True)
            if front.frames and math.isfinite(front.touch[args.tau]):
                above = shorten(waters, front.trace(waters), front.touch[args.tau] + args.tau)
                print(f"a path that arrives: {above}", file=sys.stderr, flush=True)
    packages = ", ".join(f"{n} {importlib.metadata.version(n)}" for n in ("hj-reachability", "jax", "numpy"))
    processor = f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"
    found = {**conclude(runs, above, str(args.tau)), "path_that_arrives": above, "runs": runs}
    return {
        "command": " ".join(["python", "benchmarks/level_set.py", *sys.argv[1:]]),
        "machine": processor,
        **found,
    }


def conclude(runs: list[dict[str, Any]], above: dict[str, float], tau: str) -> dict[str, Any]:
    """The finest grid's bound [s], the estimate of its error, and the one less the other."""
    finest, at = runs[-1], [one["bound_s"][tau] for one in runs]
    coarser = [one for one in runs if one["grid"] != finest["grid"]]
    if not coarser:
        return {"finest_s": at[-1], "error_s": None, "bound_s": None}
    next_grid = [one for one in coarser if one["grid"] == coarser[-1]["grid"]]
    same_way = next(one for one in next_grid if one["from"] == finest["from"])
    differences = {
        "next_grid": abs(at[-1] - same_way["bound_s"][tau]),
        "ends": float(np.ptp([one["touch_plus_tau_s"][tau] for one in next_grid])),
        "tau": float(np.ptp(list(runs[-1]["touch_plus_tau_s"].values()))),
        "above_the_path": max(0.0, at[-1] - above.get("travel_time_s", math.inf)),
    }
    differences = {name: round(value, 2) for name, value in differences.items()}
    error = max(differences.values())
    return {
        "finest_s": at[-1],
        "differences_s": differences,
        "error_s": error,
        "bound_s": round(at[-1] - error, 2),
    }


def main() -> None:
    """Read the arguments, run, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario", help="a scenario with a [query]")
    parser.add_argument("--grid", action="append", metavar="NX,NY,NZ", help="again for more, coarse to fine")
    parser.add_argument("--tau", type=int, choices=TAUS, default=60, help="the bound is read at this size [s]")
    parser.add_argument("--latest", type=float, default=7200.0, help="give up at this time [s]")
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE")
    parser.add_argument("-o", "--output", type=Path, help="a JSON file to keep the result in")
    args = parser.parse_args()
    try:
        text = json.dumps(run(args), indent=1)
    except InputError as error:
        parser.error(str(error))
    if args.output:
        args.output.write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
