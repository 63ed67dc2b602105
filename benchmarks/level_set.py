"""A bound below every travel time of a scenario: the time-optimal path, by a level-set method.

No route of legs can be faster than a glider whose glide angle and heading may change at every instant. The
set that such a glider can have reached is a front; the Hamilton-Jacobi equation V_t + max over the controls
of f . grad V = 0 moves it, with f = (u + Vh cos heading, v + Vh sin heading, ±w) and (Vh, w) on the glide
polar. hj-reachability solves that (WENO5, local Lax-Friedrichs, TVD Runge-Kutta 3). Nothing here reads
the project's legs, edges or steering: only the flow, the polar and the two points.

- Start. V(., 0) is the time tau [s] that a glider in still water needs from the start, so that V(goal, t) = tau
  is the first touching of the goal by a front begun at all points within tau of the start: t is a bound below,
  t + tau the arrival time as tau falls to 0. One run gives all tau; below three cells the numbers are smeared.
  V is kept as sqrt(tau^2 + SOFT^2) - SOFT, which moves alike and has no tip.
- Surface and floor. The field goes on beyond both as its mirror image. A path there, folded back, dives
  where it climbed: with a polar that is the same for both (else the faster of the two is taken for both, still
  a bound below) the fold is a path within the depths, so the mirror is exact. It lets gliders slide along the
  surface and hold a depth, at the best horizontal speed: what dives and climbs of no length come to.
- Sides. The front may leave the flow's box and return (slopes go on): a bound below.
- Check from above. The best path, traced back through the coarsest run, becomes a first guess of headings
  and vertical speeds, changed at even times, and SLSQP shortens it: a path that arrives, in the same flow by
  another method. The optimum lies below its time.

A route's legs may end as far from their node as the tolerance, and gain that much way on this bound.

It needs an environment of its own (JAX): python -m venv hj; hj/bin/pip install hj-reachability -e .
Then: hj/bin/python benchmarks/level_set.py data/seed-box.toml -o benchmarks/records/level_set_seed_box.json
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
from hj_reachability import boundary_conditions
from numba import njit
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import map_coordinates
from scipy.optimize import minimize

from glider_stream.errors import InputError
from glider_stream.flow import is_steady
from glider_stream.kernels.flow import velocities, velocity
from glider_stream.roadmap import Problem
from glider_stream.scenario import read_scenario
from glider_stream.settings import require

GRIDS = ("61,61,31", "81,81,41", "101,101,51", "121,121,61")
TAUS = (160.0, 120.0, 100.0, 80.0, 60.0)
"""Sizes [s] of the set that the front begins at; the arrival is read at HEADLINE, the others tell its error."""
HEADLINE = 80.0
SOFT = 60.0
STEP = 4.0
"""Between readings [s]; the solver's own steps are shorter."""
SLOPES = 256
PIECES = 60
"""Controls of the path that is shortened."""


class Wing:
    """What the polar allows: `support` over slopes, and the hull's edge, `level` [m/s] at |w| `sink` [m/s]."""

    def __init__(self, problem: Problem) -> None:
        polar = problem.evaluator.polar
        angle = np.linspace(polar.shallowest, polar.steepest, polar.speed.shape[1], axis=1)
        level, sink = polar.speed * np.cos(angle), polar.speed * np.sin(angle)
        self.symmetric = bool(np.allclose(level[0], level[1]) and np.allclose(sink[0], sink[1]))
        self.fastest, self.steepest = float(level.max()), float(sink.max())
        # support at (1 - a, a): convex in a, so that the table, linear between, errs towards faster
        a = np.linspace(0.0, 1.0, SLOPES + 1)
        self.support = np.array([((1 - s) * level + s * sink).max() for s in a])
        best = level[0].argmax()
        self.sink = np.concatenate([[0.0], sink[0, best:]])
        self.level = np.concatenate([level[0, best : best + 1], level[0, best:]])

    def still_water_time(self, horizontal: np.ndarray, vertical: np.ndarray) -> np.ndarray:
        """Time [s] over distances [m] in still water, holding depth allowed."""
        result = np.zeros_like(horizontal)
        for a, support in zip(np.linspace(0.0, 1.0, SLOPES + 1), self.support, strict=True):
            result = np.maximum(result, ((1 - a) * horizontal + a * vertical) / support)
        return result


class Glide(hj.dynamics.Dynamics):
    """The library's view of a glider in a flow; a state is x, y, z and the current u, v there."""

    def __init__(self, wing: Wing) -> None:
        self.support, self.most = jnp.asarray(wing.support), (wing.fastest, wing.steepest)

    def __call__(self, state: Any, control: Any, disturbance: Any, time: Any) -> Any:
        """Not needed: the Hamiltonian is given."""
        raise NotImplementedError

    optimal_control_and_disturbance = __call__

    def hamiltonian(self, state: Any, time: Any, value: Any, grad_value: Any) -> Any:
        """u p_x + v p_y + max over the glide angle of Vh |p_xy| + w |p_z|."""
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


def currents(problem: Problem, at: np.ndarray) -> np.ndarray:
    """Current (u, v) [m/s] at points (n, 3)."""
    x, y, z = np.ascontiguousarray(at.T, dtype=np.float64)
    return np.asarray(velocities(problem.evaluator.flow, x, y, z, np.full(len(at), problem.departure)))


def box(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Corners [m]: the flow's box, the domain's depths."""
    flow = problem.evaluator.flow
    return np.array([flow.x_lo, flow.y_lo, problem.lo[2]]), np.array([flow.x_hi, flow.y_hi, problem.hi[2]])


class Front:
    """One run: `arrivals`, for each of TAUS the first touching [s]; `frames`, V at every STEP, if kept."""

    def __init__(self, problem: Problem, wing: Wing, shape: tuple[int, ...], latest: float, keep: bool) -> None:
        began = time.perf_counter()
        self.shape, (lo, hi) = shape, box(problem)
        sides = (boundary_conditions.extrapolate_away_from_zero,) * 2 + (mirror,)
        grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(hj.sets.Box(lo, hi), shape, sides)
        self.axes = [np.linspace(a, b, n) for a, b, n in zip(lo, hi, shape, strict=True)]
        nodes = np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1).reshape(-1, 3)
        uv = jnp.asarray(currents(problem, nodes).reshape(*shape, 2), grid.states.dtype)
        grid = grid.replace(states=jnp.concatenate([grid.states, uv], axis=-1))
        away = nodes - np.asarray(problem.start)
        tau = wing.still_water_time(np.hypot(away[:, 0], away[:, 1]), np.abs(away[:, 2]))
        values = jnp.asarray((np.hypot(tau, SOFT) - SOFT).reshape(shape), grid.states.dtype)
        settings = hj.SolverSettings.with_accuracy(
            "very_high", artificial_dissipation_scheme=hj.artificial_dissipation.local_local_lax_friedrichs
        )
        dynamics, now, left = Glide(wing), 0.0, math.inf
        self.frames, self.arrivals = [np.asarray(values)] if keep else [], dict.fromkeys(TAUS, math.nan)
        while left > min(TAUS) / (4 if keep else 1) and now < latest:
            values = hj.step(settings, dynamics, grid, now, values, now + STEP, progress_bar=False)
            now, before, left = now + STEP, left, self._tau(np.asarray(values), problem.goal)
            for one in TAUS:
                if left <= one < before:
                    self.arrivals[one] = now - STEP * (one - left) / (before - left)
            if keep:
                self.frames.append(np.asarray(values))
        self.wall = time.perf_counter() - began

    def _tau(self, values: np.ndarray, at: Any) -> float:
        """tau [s] at a point: cubic in the nodes around it, 0 where the front has passed."""
        place = [(c - axis[0]) / (axis[1] - axis[0]) for c, axis in zip(at, self.axes, strict=True)]
        first = [min(max(int(p) - 5, 0), n - 12) for p, n in zip(place, self.shape, strict=True)]
        patch = values[tuple(slice(f, f + 12) for f in first)].astype(np.float64)
        value = map_coordinates(patch, [[p - f] for p, f in zip(place, first, strict=True)], mode="mirror")[0]
        return math.sqrt(max(value + SOFT, SOFT) ** 2 - SOFT**2)

    def trace(self, problem: Problem, wing: Wing) -> np.ndarray:
        """The best path backwards from the goal, points (n, 3) at every second frame, start first."""
        lo, hi = box(problem)
        heading = np.linspace(-math.pi, math.pi, 180, endpoint=False)
        sink = np.linspace(-wing.steepest, wing.steepest, 41)
        level = np.interp(np.abs(sink), wing.sink, wing.level)[:, None]
        parts = (level * np.cos(heading), level * np.sin(heading), np.repeat(sink[:, None], heading.size, axis=1))
        control, path = np.stack(parts, axis=-1).reshape(-1, 3), [np.asarray(problem.goal)]

        def inside(at: np.ndarray) -> np.ndarray:
            return np.clip(at, lo, hi)

        def drift(at: np.ndarray) -> np.ndarray:
            return control + np.pad(currents(problem, inside(at)), ((0, 0), (0, 1)))

        for frame in self.frames[-3::-2]:
            here = np.repeat(path[-1][None], len(control), axis=0)
            back = inside(here - 2 * STEP * drift(here - STEP * drift(here)))
            path.append(back[RegularGridInterpolator(self.axes, frame)(back).argmin()])
        return np.stack([np.asarray(problem.start), *path[::-1]])


@njit
def fly(flow, sinks, levels, heading, sink, duration, x, y, z, t):
    """Where the controls lead, each held for an equal part of `duration` [s]: RK4, four steps or more each."""
    steps = max(4, int(duration / heading.size / 2.0))
    dt = duration / heading.size / steps
    for n in range(heading.size):
        level = np.interp(abs(sink[n]), sinks, levels)
        a, b, c = level * math.cos(heading[n]), level * math.sin(heading[n]), sink[n]
        for _ in range(steps):
            u1, v1 = velocity(flow, x, y, z, t)
            u2, v2 = velocity(flow, x + dt / 2 * (u1 + a), y + dt / 2 * (v1 + b), z + dt / 2 * c, t)
            u3, v3 = velocity(flow, x + dt / 2 * (u2 + a), y + dt / 2 * (v2 + b), z + dt / 2 * c, t)
            u4, v4 = velocity(flow, x + dt * (u3 + a), y + dt * (v3 + b), z + dt * c, t)
            x += dt * (a + (u1 + 2 * u2 + 2 * u3 + u4) / 6)
            y += dt * (b + (v1 + 2 * v2 + 2 * v3 + v4) / 6)
            z += dt * c
    return x, y, z


def shorten(problem: Problem, wing: Wing, path: np.ndarray, duration: float) -> dict[str, float]:
    """The quickest path near a first guess: its duration [s], and by how much [m] it misses the goal."""
    start, goal = np.asarray(problem.start, float), np.asarray(problem.goal, float)
    parts, unit = np.linspace(0, len(path) - 1, PIECES + 1), duration
    knots = np.stack([np.interp(parts, np.arange(len(path)), column) for column in path.T], axis=-1)
    needed = np.diff(knots, axis=0) / (duration / PIECES)
    water = needed[:, :2] - currents(problem, 0.5 * (knots[1:] + knots[:-1]))
    heading = np.unwrap(np.arctan2(water[:, 1], water[:, 0]))
    guess = np.concatenate([heading, np.clip(needed[:, 2], -wing.steepest, wing.steepest), [1.0]])
    sums = np.tril(np.ones((PIECES, PIECES)))[:-1] / PIECES
    shifts = 1e-6 * np.eye(guess.size)

    def miss(c: np.ndarray) -> np.ndarray:
        parts = (c[:PIECES], c[PIECES:-1], c[-1] * unit)
        flow = problem.evaluator.flow
        return np.array(fly(flow, wing.sink, wing.level, *parts, *start, problem.departure)) - goal

    def slope(c: np.ndarray) -> np.ndarray:
        return np.stack([(miss(c + one) - miss(c - one)) / 2e-6 for one in shifts], axis=-1) / 100

    def room(c: np.ndarray) -> np.ndarray:
        depth = start[2] + c[-1] * unit * (sums @ c[PIECES:-1])
        return np.concatenate([problem.hi[2] - depth, depth - problem.lo[2]]) / 100

    def room_slope(c: np.ndarray) -> np.ndarray:
        by_sink, by_time = c[-1] * unit * sums, unit * (sums @ c[PIECES:-1])
        rows = np.concatenate([np.zeros((PIECES - 1, PIECES)), by_sink, by_time[:, None]], axis=1)
        return np.concatenate([-rows, rows]) / 100

    last = np.eye(guess.size)[-1]
    found = minimize(
        lambda c: c[-1],
        guess,
        jac=lambda c: last,
        method="SLSQP",
        bounds=[(None, None)] * PIECES + [(-wing.steepest, wing.steepest)] * PIECES + [(0.5, 2.0)],
        constraints=[
            {"type": "eq", "fun": lambda c: miss(c) / 100, "jac": slope},
            {"type": "ineq", "fun": room, "jac": room_slope},
        ],
        options={"maxiter": 400, "ftol": 1e-8},
    ).x
    return {
        "travel_time_s": round(float(found[-1] * unit), 3),
        "miss_m": round(float(np.abs(miss(found)).max()), 6),
        "beyond_depths_m": round(max(0.0, -100 * float(room(found).min())), 6),
    }


def machine() -> str:
    """Processor, cores and versions; no names."""
    names = [line.split(":")[1].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name")]
    packages = ", ".join(f"{n} {importlib.metadata.version(n)}" for n in ("hj-reachability", "jax", "numpy"))
    processor = names[0] if names else platform.processor() or platform.machine()
    return f"{processor}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"


def _lines(path: str) -> list[str]:
    return Path(path).read_text().splitlines() if Path(path).is_file() else []


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Every grid, coarse to fine; the check from above; what they say together."""
    problem = read_scenario(args.scenario, args.set).problem()
    require(problem.start is not None, "the scenario has no [query]: it names the start and the goal")
    require(is_steady(problem.evaluator.flow), "the flow changes with time; this script takes steady flows")
    require(bool(np.isfinite(box(problem)).all()), "the flow has no borders; give `flow.x` and `flow.y`")
    wing, runs, check = Wing(problem), [], None
    for text in args.grid or GRIDS:
        front = Front(problem, wing, tuple(int(n) for n in text.split(",")), args.latest, keep=not runs)
        totals = {f"{tau:g}": round(tau + at, 2) for tau, at in front.arrivals.items()}
        runs.append({
            "grid": list(front.shape),
            "spacing_m": [round(float(axis[1] - axis[0]), 3) for axis in front.axes],
            "arrival_s": totals[f"{HEADLINE:g}"],
            "first_touch_plus_tau_s": totals,
            "wall_s": round(front.wall, 1),
        })  # fmt: skip
        print(f"grid {text}: arrival after {totals[f'{HEADLINE:g}']} s ({front.wall:.0f} s of work)", flush=True)
        if check is None and math.isfinite(front.arrivals[HEADLINE]):
            path = front.trace(problem, wing)
            check = shorten(problem, wing, path, HEADLINE + front.arrivals[HEADLINE])
            print(f"a path that arrives: {check['travel_time_s']} s", flush=True)
    result = {
        "command": " ".join(["python", "benchmarks/level_set.py", *sys.argv[1:]]),
        "machine": machine(),
        "symmetric_polar": wing.symmetric,
        "tau_s": HEADLINE,
        **conclude(runs),
        "path_that_arrives": check,
        "runs": runs,
    }
    return result


def conclude(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """The arrival time in the limit of fine grids [s], and its error."""
    at = np.array([one["arrival_s"] for one in runs])
    spacing = np.array([one["spacing_m"][0] for one in runs])
    if len(runs) < 2:
        return {"arrival_s": float(at[-1]), "error_s": None, "bound_s": None}
    # front methods lie between first and second order
    limits = [np.polyfit(spacing**order, at, 1)[1] for order in (1, 2)]
    spread = np.ptp(list(runs[-1]["first_touch_plus_tau_s"].values()))
    middle = float(np.mean(limits))
    error = float(max(abs(at[-1] - middle), np.ptp(limits), spread))
    return {
        "arrival_s": round(middle, 2),
        "error_s": round(error, 2),
        "bound_s": round(middle - error, 2),
    }


def main() -> None:
    """Read the arguments, run, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario", help="a scenario with a steady flow and a [query]")
    parser.add_argument("--grid", action="append", metavar="NX,NY,NZ", help="again for more, coarse to fine")
    parser.add_argument("--latest", type=float, default=7200.0, help="give up at this time [s]")
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE")
    parser.add_argument("-o", "--output", type=Path, help="a JSON file to keep the result in")
    args = parser.parse_args()
    try:
        result = run(args)
    except InputError as error:
        parser.error(str(error))
    text = json.dumps(result, indent=1)
    if args.output:
        args.output.parent.mkdir(parents=True, exist_ok=True)
        args.output.write_text(text + "\n")
    for key in ("arrival_s", "error_s", "bound_s", "machine"):
        print(f"{key}: {result[key]}")


if __name__ == "__main__":
    main()
