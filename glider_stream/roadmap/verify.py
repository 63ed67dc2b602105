"""Verification: checks a roadmap; its legs are flown again, by its own integrator and by another one."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ..base.arrays import Array, Bools, Index
from ..base.errors import InputError
from ..base.settings import require
from ..base.terminal import plain
from ..base.threads import in_parallel, threads
from ..kernels.cache import entry_point
from ..kernels.control import control_of, glide_speed
from ..kernels.edges import CONNECTED, GLIDE_ANGLE, HEADING, SPEED, TIME
from ..kernels.flow import currents, rises, velocities
from ..kernels.motion import trace
from ..kernels.place import Place
from .evaluator import Evaluator
from .problem import Problem
from .provenance import check_unchanged
from .roadmap import EDGE_FIELDS, BaseRoadmap
from .rows import FASTEST
from .slices import SlicedRoadmap
from .store import KeptRoadmap, StoredRoadmap, opened_roadmap

LEGS_AT_ONCE = 10
"""DOP853 flies this many legs together; its step must be small enough for the most curved of them."""
EDGES_AT_ONCE = 4096
"""A thread flies this many edges at a time."""
LOOKED_AT_ONCE = 1 << 19
"""So many edges are in memory at a time, 30 MB of them."""
SAMPLE = 200
"""As a rule this many edges are also flown by DOP853."""
SAME = 0.3
"""The same integrator must find the same miss within this distance [m]. A closest approach is measured on the
chord of a step, and the arc of a step of 13 m that turns by 0.15 rad is up to 0.24 m away from its chord."""
MOST_OFF = 0.1
"""The miss of DOP853 may differ by this share of the scenario's tolerance, because RK4 steps over the kinks of a
grid."""
WORST = 5
"""This many of the worst edges are shown."""
QUANTILES = (0.5, 0.9, 0.99, 1.0)


@dataclass(frozen=True)
class Verification:
    """The result of a verification: `edges` of all `held` were flown again, `sample` of them also by DOP853.

    `faults` are sentences; the tuple is empty if nothing is wrong. `differences` (sample,) [m] lie between
    DOP853's miss and the roadmap's. `worst` holds the worst edges: source, target, difference [m].
    """

    file: str
    edges: int
    sample: int
    faults: tuple[str, ...]
    differences: Array
    worst: tuple[tuple[int, int, float], ...]
    held: int

    @property
    def holds(self) -> bool:
        """Whether nothing is wrong."""
        return not self.faults

    def _quantiles(self) -> dict[str, float]:
        if not self.differences.size:
            return {}
        values = np.quantile(self.differences, QUANTILES)
        return {f"{share:.0%}": float(value) for share, value in zip(QUANTILES, values, strict=True)}

    def as_dict(self) -> dict[str, Any]:
        """Return the table that `verify --json` prints."""
        return {
            "file": self.file,
            "holds": self.holds,
            "faults": list(self.faults),
            "edges": self.edges,
            "edges_held": self.held,
            "sample": self.sample,
            "difference_m": self._quantiles(),
            "worst": [{"source": a, "target": b, "difference_m": off} for a, b, off in self.worst],
        }

    def __str__(self) -> str:
        lines = [f"{plain(self.file)}: {'verified' if self.holds else 'NOT what it says'}"]
        lines += [f"  fault: {plain(fault)}" for fault in self.faults]
        if self.edges:
            left = self.held - self.edges
            others = f"; the other {left:,} were not looked at" if left else ""
            lines.append(f"  {self.edges:,} edges flown again, {self.sample:,} of them by DOP853{others}")
        if self.differences.size:
            spread = ", ".join(f"{share} {1000 * off:.1f} mm" for share, off in self._quantiles().items())
            lines.append(f"  its misses differ by: {spread}")
            worst = ", ".join(f"{a} to {b} ({1000 * off:.1f} mm)" for a, b, off in self.worst)
            lines.append(f"  worst, from node to node: {worst}")
        return "\n".join(lines)


def replayed_misses(
    evaluator: Evaluator, departure: float | Array, position: Array, source: Index, target: Index, values: Array
) -> Array:
    """Return the distances (n,) [m] from their targets at which legs end when scipy's DOP853 flies them.

    The legs lead from `source` (n,) to `target` (n,), which are nodes of `position` (m, 3) [m]; `values` (n, 6)
    are in the order of EDGE_FIELDS. `departure` [s] is one time for all legs, or each leg's (n,).
    """
    departs = np.broadcast_to(departure, len(values))
    column = {name: n for n, name in enumerate(EDGE_FIELDS)}

    def rate(share: float, at: Array, z: Array, u: Array, v: Array, w: Array, duration: Array, t: Array) -> Array:
        along = share * duration
        flow_u, flow_v = velocities(evaluator.flow, *at.reshape(2, -1), z + along * w, t + along).T
        return np.concatenate([(flow_u + u) * duration, (flow_v + v) * duration])

    def rising(share: float, at: Array, u: Array, v: Array, w: Array, duration: Array, t: Array) -> Array:
        flow_uvw = currents(evaluator.flow, *at.reshape(3, -1), t + share * duration)
        return np.asarray(((flow_uvw.T + np.stack([u, v, w])) * duration).ravel())

    off = np.empty(len(values))
    how: dict[str, Any] = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-7, "max_step": 0.02}
    for first in range(0, len(values), LEGS_AT_ONCE):
        some = slice(first, first + LEGS_AT_ONCE)
        (x, y, z), goal, row = position[source[some]].T, position[target[some]].T, values[some].T
        angle, heading, speed = (row[column[name]] for name in ("glide_angle", "heading", "speed"))
        along, w, duration = speed * np.cos(angle), speed * np.sin(angle), row[column["time"]]
        through = along * np.cos(heading), along * np.sin(heading), w
        if rises(evaluator.flow):
            begin, args = np.concatenate([x, y, z]), (*through, duration, departs[some])
            end = tuple(solve_ivp(rising, (0, 1), begin, args=args, **how).y[:, -1].reshape(3, -1))
        else:
            begin, fixed = np.concatenate([x, y]), (z, *through, duration, departs[some])
            path = solve_ivp(rate, (0, 1), begin, args=fixed, **how)
            end = *path.y[:, -1].reshape(2, -1), z + duration * w
        off[some] = np.linalg.norm(np.array(end) - goal, axis=0)
    return off


@entry_point(nogil=True)
def _fly(medium, position, departure, source, target, edges, off, first, last):  # type: ignore[no-untyped-def]
    """Write to `off` (n, 2) the distance [m] of legs' ends from their targets, and their error of speed [m/s].

    `edges` (n, EDGE_COLUMNS) lead from node `source` (n,) to node `target` (n,).
    """
    dt = medium.integration.dt
    latest = dt * (medium.integration.steps + 1)
    for e in range(first, last):
        time, angle, speed = edges[e, TIME], edges[e, GLIDE_ANGLE], edges[e, SPEED]
        off[e] = np.inf
        if not 0.0 <= time <= latest:
            continue  # a damaged file may hold any value
        c = control_of(speed, angle, edges[e, HEADING])
        x, y, z = position[source[e]]
        path = trace(medium.flow, Place(x, y, z, departure), c, time, dt)
        _, x, y, height = path[path.shape[0] - 1]
        goal = position[target[e]]
        off[e, 0] = np.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2 + (height - goal[2]) ** 2)
        off[e, 1] = speed - glide_speed(medium.polar, 1 if angle > 0.0 else 0, abs(angle))


def verify(
    file: str | Path, problem_of: Callable[[KeptRoadmap], Problem], sample: int | None = None
) -> Verification:
    """Check that a roadmap file is whole, that its flow and glider are unchanged, and that its legs are right.

    `problem_of` makes the problem of a roadmap. All edges are flown again by the roadmap's integrator. A `sample`
    of them, SAMPLE if it is None, all if it is 0, is also flown by DOP853. If a sample of a large roadmap of one
    departure is asked for, only that is read.
    """
    require(sample is None or sample >= 0, f"`sample` must be at least 0, all; got {sample}")
    require(Path(file).is_file(), f"the roadmap {file} does not exist; build it first")
    try:
        road: KeptRoadmap = opened_roadmap(file)
        if isinstance(road, StoredRoadmap) and road.departures is not None:
            road = road.whole()
        problem = problem_of(road)
        check_unchanged(road, problem)
        if isinstance(road, SlicedRoadmap):
            return check_slices(str(file), road, problem, SAMPLE if sample is None else sample)
        every = not sample or not isinstance(road, StoredRoadmap)
        if every:
            road.rows(FASTEST).need(np.arange(len(road.position)))  # its targets must rise, too
        return check_edges(str(file), road, problem, SAMPLE if sample is None else sample, every)
    except InputError as error:
        return Verification(str(file), 0, 0, (str(error),), np.empty(0), (), 0)


def check_slices(name: str, road: SlicedRoadmap, problem: Problem, sample: int) -> Verification:
    """Return the verification of a roadmap of several departures; each slice gets a part of the sample."""
    slices = road.departures.size
    parts = []
    for number, departure in enumerate(road.departures):
        share = 0 if sample == 0 else max(1, (sample * (number + 1)) // slices - (sample * number) // slices)
        parts.append(check_edges(name, road.at(number), replace(problem, departure=float(departure)), share))
    faults = [
        f"at departure {departure:g} s: {fault}"
        for departure, part in zip(road.departures, parts, strict=True)
        for fault in part.faults
    ]
    worst = sorted((edge for part in parts for edge in part.worst), key=lambda edge: -edge[2])[:WORST]
    return Verification(
        name,
        sum(part.edges for part in parts),
        sum(part.sample for part in parts),
        tuple(faults),
        np.concatenate([part.differences for part in parts]),
        tuple(worst),
        sum(part.held for part in parts),
    )


def check_edges(name: str, road: BaseRoadmap, problem: Problem, sample: int, every: bool = True) -> Verification:
    """Return the verification of a roadmap that was read without error: `every` edge, or only the sample."""
    evaluator, position = problem.evaluator, np.require(road.position, np.float64, ["C", "W"])
    count = road.edge_count
    size = count if sample == 0 else min(sample, count)
    some = np.sort(np.random.default_rng(0).choice(count, size, replace=False))
    blocks = [some]
    if every:
        blocks = [np.arange(n, min(n + LOOKED_AT_ONCE, count)) for n in range(0, count, LOOKED_AT_ONCE)]
    in_water = evaluator.allowed(position, problem.departure)
    found: dict[str, list[tuple[int, int, int]]] = {}
    for edges in blocks:
        legs = _Legs.of(road, edges)
        for what, bad in _looks(problem, position, in_water, legs).items():
            if bad.any():
                first = int(legs.source[bad][0]), int(legs.target[bad][0])
                found.setdefault(what, []).append((int(bad.sum()), *first))
    faults = [
        f"{sum(bad for bad, _, _ in blocks):,} edges {what}, the first from node {blocks[0][1]} to {blocks[0][2]}"
        for what, blocks in found.items()
    ]
    legs = _Legs.of(road, some)
    ends = evaluator, problem.departure, position, legs.source, legs.target, legs.values
    differences = np.abs(replayed_misses(*ends) - legs.column("miss"))
    most = MOST_OFF * evaluator.integration.tolerance
    far = differences > most
    if far.any():
        faults.append(f"{int(far.sum()):,} edges of the sample end more than {most:g} m elsewhere by DOP853")
    order = np.argsort(-differences)[:WORST]
    worst = tuple((int(legs.source[n]), int(legs.target[n]), float(differences[n])) for n in order)
    flown = count if every else size
    return Verification(name, flown, size, tuple(faults), differences, worst, count)


@dataclass(frozen=True)
class _Legs:
    """Some edges of a roadmap: nodes `source` and `target` (n,), `values` (n, 6) in the order of EDGE_FIELDS."""

    source: Index
    target: Index
    values: Array

    @classmethod
    def of(cls, road: BaseRoadmap, edges: Index) -> "_Legs":
        """Read some edges (n,)."""
        source = np.searchsorted(road.indptr, edges, side="right") - 1
        return cls(source, road.targets(edges).astype(np.int64), road.legs(edges))

    def column(self, name: str) -> Array:
        """Return one of EDGE_FIELDS (n,)."""
        return np.asarray(self.values[:, EDGE_FIELDS.index(name)])


def _looks(problem: Problem, position: Array, in_water: Bools, legs: _Legs) -> dict[str, Bools]:
    """Return, by what it would mean, which of some edges (n,) are wrong."""
    evaluator, source, target = problem.evaluator, legs.source, legs.target
    edges = np.column_stack([np.full(target.size, float(CONNECTED)), legs.values])
    off = np.empty((target.size, 2))
    with threads(None):
        task = partial(_fly, evaluator.medium, position, problem.departure, source, target, edges, off)
        in_parallel(task, target.size, EDGES_AT_ONCE)
    horizon = evaluator.integration.dt * evaluator.integration.steps
    polar, price = evaluator.polar, evaluator.cost.kernel()
    time, miss, glide_angle = (legs.column(name) for name in ("time", "miss", "glide_angle"))
    angle = np.abs(glide_angle)
    direction = (glide_angle > 0).astype(np.intp)
    rise = position[target, 2] - position[source, 2]
    return {
        "lead to where they begin or to the same depth": (rise == 0) | (source == target),
        "climb where they should dive, or dive": np.sign(rise) != np.sign(glide_angle),
        "cost something else than the scenario says": legs.column("cost")
        != price.per_second * time + price.per_leg,
        "take no time or longer than the horizon": (time <= 0) | (time > horizon + evaluator.integration.dt),
        "have a glide angle outside the polar": (angle < polar.shallowest[direction] - 1e-9)
        | (angle > polar.steepest[direction] + 1e-9),
        "have a speed that is not the polar's": np.abs(off[:, 1]) > 1e-6,
        "miss by more than the tolerance": miss >= evaluator.integration.tolerance,
        "begin or end where no glider may be": ~(in_water[source] & in_water[target]),
        "do not end where they say": ~(np.abs(off[:, 0] - miss) <= SAME),
    }
