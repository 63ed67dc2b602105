"""Routes of least energy against exact ones, found by extremals: as they are found, polished, and refined.

The currents are alike at all depths and the pump's energy is k |z|. So no route from surface to surface takes
less than the integral of L = P + k |w| / 2, P the hotel load, |w| the vertical speed: each metre down is pumped
for once or more. One dive and one climb take just that. What is left is a problem in the plane, which
Pontryagin's maximum principle solves. Along a best route

    H = q . u + max over the glide angle of (|q| Vh - L) = 0,  dq/dt = -(grad u)^T q,  heading along q,

so one heading at the start gives one extremal. A fan of them is flown, the headings that pass the goal are found
to a millimetre, and the cheapest is the reference. Nothing of it reads the project's legs or searches. In an even
current it must agree with a closed form, which `closed_form` gives.

    python benchmarks/energy_routes.py -o benchmarks/records/energy_routes.json
"""

import argparse
import math
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from experiment import random_vortices
from numpy.typing import NDArray
from record import keep, machine
from scipy.optimize import brentq, minimize_scalar

import glider_stream
from glider_stream.base.threads import threads
from glider_stream.base.toml import to_toml
from glider_stream.kernels.flow import velocities
from glider_stream.roadmap.builder import build_roadmap
from glider_stream.roadmap.problem import Problem
from glider_stream.scenario import scenario_from_text, shipped_scenarios
from glider_stream.vehicle.cost import GRAVITY

Floats = NDArray[np.float64]
HOTEL, VOLUME, SHARE, DENSITY = 0.5, 20.0, 0.3, 1025.0
"""Hotel load [W], pumped volume [cc], the pump's efficiency, density [kg/m^3]: a best glide that is neither the
polar's shallowest nor its fastest."""
FAN, STEP, LATEST = 5760, 2.0, 3000.0
"""Headings of the first fan, and the time step and the end of an extremal [s]."""
NEAR = 100.0
"""Headings that pass the goal nearer than this [m], and nearer than those beside them, are searched again."""
ROUNDS, FINER = 6, 41
"""They are searched so many times, by so many headings each."""
BESIDE = 0.01
"""The gradient of the current is measured over this distance [m], to each side."""
SLOWER = 0.45
"""The vortices' speeds are multiplied by this: no weaker with depth, they would else scatter the extremals."""
WAYS: dict[str, dict[str, Any]] = {
    "found": {},
    "polished": {"polish": True},
    "refined": {"polish": True, "within": 0.005},
}


class Glide:
    """The polar [m/s] as the plane's problem sees it: of a momentum m, the best Vh, L, and m Vh - L."""

    def __init__(self, problem: Problem) -> None:
        polar = problem.evaluator.polar
        angle = np.linspace(polar.shallowest[0], polar.steepest[0], 4001)
        knots = np.linspace(polar.shallowest[0], polar.steepest[0], polar.speed.shape[1])
        speed = np.interp(angle, knots, polar.speed[0])
        self.angle, self.level, sink = angle, speed * np.cos(angle), speed * np.sin(angle)
        pump = DENSITY * GRAVITY * VOLUME * 1e-6 / SHARE
        self.rate = HOTEL + pump * sink / 2
        self.momenta = np.linspace(0.0, 20.0, 4001)
        self.best = np.array([np.argmax(m * self.level - self.rate) for m in self.momenta])

    def at(self, m: Floats) -> tuple[Floats, Floats]:
        """Vh and L at momenta."""
        return np.interp(m, self.momenta, self.level[self.best]), np.interp(m, self.momenta, self.rate[self.best])

    def most(self, m: float) -> float:
        """m Vh - L at its greatest."""
        return float((m * self.level - self.rate).max())

    def momentum(self, along: float) -> float:
        """The m for which H is zero, with a current of `along` [m/s] in the heading; NaN if there is none."""
        last = float(self.momenta[-1])
        none = last * along + self.most(last) <= 0
        return math.nan if none else float(brentq(lambda m: m * along + self.most(m), 0.0, last, xtol=1e-14))


class Plane:
    """The extremals of a problem, from its start."""

    def __init__(self, problem: Problem) -> None:
        assert problem.start is not None
        assert problem.goal is not None
        self.flow, self.glide = problem.evaluator.flow, Glide(problem)
        self.start, self.goal = problem.start[:2], problem.goal[:2]

    def current(self, x: Floats, y: Floats) -> Floats:
        """u, v (2, n) [m/s]."""
        return np.array(velocities(self.flow, x, y, np.full(x.size, -1.0), np.zeros(x.size))).T

    def slope(self, state: Floats) -> Floats:
        """The rates of x, y, q and the cost, all (5, n)."""
        x, y, *q = state[:4]
        m = np.hypot(*q)
        level, rate = self.glide.at(m)
        ahead, behind = (
            [self.current(x + s * dx, y + s * dy) for dx, dy in ((BESIDE, 0), (0, BESIDE))] for s in (1, -1)
        )
        by_x, by_y = ((a - b) / (2 * BESIDE) for a, b in zip(ahead, behind, strict=True))
        u = self.current(x, y)
        return np.array([
            u[0] + level * q[0] / m, u[1] + level * q[1] / m,
            -(by_x[0] * q[0] + by_x[1] * q[1]), -(by_y[0] * q[0] + by_y[1] * q[1]), rate,
        ])  # fmt: skip

    def passes(self, headings: Floats) -> tuple[Floats, Floats]:
        """How near each extremal comes to the goal [m], and its cost there [J]."""
        u = self.current(*self.start[:, None])[:, 0]
        m = np.array([self.glide.momentum(float(u @ [math.cos(h), math.sin(h)])) for h in headings])
        count = np.full(headings.size, 1.0)
        state = np.array([
            self.start[0] * count, self.start[1] * count, m * np.cos(headings), m * np.sin(headings), 0 * count
        ])  # fmt: skip
        state[:, np.isnan(m)] = math.nan
        near, cost = np.full(headings.size, np.inf), np.full(headings.size, np.inf)
        box = self.flow.extent
        for _ in range(int(LATEST / STEP)):
            one = self.slope(state)
            two = self.slope(state + STEP / 2 * one)
            three = self.slope(state + STEP / 2 * two)
            after = state + STEP / 6 * (one + 2 * two + 2 * three + self.slope(state + STEP * three))
            way, off = after[:2] - state[:2], self.goal[:, None] - state[:2]
            share = np.clip((way * off).sum(axis=0) / (way * way).sum(axis=0), 0.0, 1.0)
            miss = np.hypot(*(off - share * way))
            better = miss < near
            near = np.where(better, miss, near)
            cost = np.where(better, state[4] + share * (after[4] - state[4]), cost)
            inside = (after[0] > box.x_lo) & (after[0] < box.x_hi) & (after[1] > box.y_lo) & (after[1] < box.y_hi)
            state = np.where(inside & (after[4] < 1.2 * cost[near < 1.0].min(initial=np.inf)), after, math.nan)
            if not np.isfinite(state[0]).any():
                break
        return near, cost

    def least(self) -> float:
        """The least energy [J] of all extremals that meet the goal."""
        headings: Floats = np.linspace(-math.pi, math.pi, FAN, endpoint=False)
        near, _ = self.passes(headings)
        low = (near <= np.roll(near, 1)) & (near <= np.roll(near, -1)) & (near < NEAR)
        best: Floats = headings[low]
        span = 2 * math.pi / FAN
        cost: Floats = np.full(best.size, np.inf)
        for _ in range(ROUNDS):
            fans = best[:, None] + np.linspace(-span, span, FINER)
            near, cost = (values.reshape(fans.shape) for values in self.passes(fans.ravel()))
            at = np.arange(best.size), near.argmin(axis=1)
            best, near, cost, span = fans[at], near[at], cost[at], 2 * span / (FINER - 1)
        return float(cost[near < 1e-3].min())


def closed_form(problem: Problem, current: Floats) -> float:
    """The least energy [J] in an even current: at each glide angle the time is the root of |way - c T| = Vh T."""
    assert problem.start is not None
    assert problem.goal is not None
    glide, way = Glide(problem), (problem.goal - problem.start)[:2]

    def energy(angle: float) -> float:
        level, rate = np.interp(angle, glide.angle, glide.level), np.interp(angle, glide.angle, glide.rate)
        a, b = level**2 - current @ current, current @ way
        return float(rate * (-b + math.sqrt(b * b + a * (way @ way))) / a)

    return float(minimize_scalar(energy, bounds=glide.angle[[0, -1]].tolist(), method="bounded").fun)


def problems() -> dict[str, dict[str, Any]]:
    """Tables of scenarios: an even current, a gyre that turns the wrong way, fourteen vortices."""
    box = tomllib.loads(shipped_scenarios()["seed-box"].read_text())
    box["neighbours"], box["steering"] = {"kind": "reachable"}, {"method": "flow-map"}
    box["cost"] = {"kind": "energy", "hotel": HOTEL, "trim": 0.0, "volume": VOLUME, "density": DENSITY}
    box["cost"]["efficiency"] = [[100.0, SHARE]]
    sides = {"x": [-600.0, 600.0], "y": [-600.0, 600.0]}
    flat = [
        {n: SLOWER * v if n == "speed" else v for n, v in row.items() if n not in ("depth", "thickness")}
        for row in random_vortices(1)
    ]
    flows = {
        "even current": {"kind": "uniform", "u": 0.3, "v": 0.25},
        "gyre": {"kind": "single-gyre", "amplitude": 0.4, "length": 1000.0}
        | {side: [-150.0, 1150.0] for side in "xy"},
        "vortices": {"kind": "vortices", "vortex": flat} | sides,
    }
    tables = {name: box | {"flow": flow} for name, flow in flows.items()}
    tables["gyre"] |= {
        "domain": {"x": [0.0, 1000.0], "y": [0.0, 1000.0], "z": [-300.0, 0.0]},
        "query": {"start": [200.0, 200.0, 0.0], "goal": [800.0, 500.0, 0.0]},
    }
    return tables


def compared(name: str, table: dict[str, Any]) -> dict[str, Any]:
    """A problem's reference [J] and its routes' energies, with shares above the reference."""
    problem = scenario_from_text(to_toml(table)).problem()
    reference = Plane(problem).least()
    row: dict[str, Any] = {"problem": name, "reference_j": round(reference, 3)}
    if table["flow"]["kind"] == "uniform":
        row["closed_form_j"] = round(closed_form(problem, np.array([table["flow"]["u"], table["flow"]["v"]])), 3)
    print(row, file=sys.stderr, flush=True)
    road = glider_stream.open(build_roadmap(problem))
    for way, asked in WAYS.items():
        path = road.query(**asked)
        over = round(100 * (path.cost / reference - 1), 3)
        row[way] = {"energy_j": round(path.cost, 3), "over_percent": over, "legs": len(path.legs)}
    return row


def main() -> None:
    """Read the arguments, compare, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", action="append", help="a problem; again for more")
    parser.add_argument("-o", "--output", type=Path, help="a JSON file to keep the result in")
    args = parser.parse_args()
    rows = []
    with threads(None) as count:
        for name, table in problems().items():
            if not args.only or name in args.only:
                rows.append(compared(name, table))
                print(rows[-1], file=sys.stderr, flush=True)
    print(keep({"machine": machine(count), "routes": rows}, args.output))


if __name__ == "__main__":
    main()
