"""The suite: problems with references, and the results of methods and baselines on them and on random queries."""

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..base.threads import threads
from ..kernels.edges import STATUS, Status
from ..roadmap.builder import build_roadmap
from ..roadmap.neighbours import Reachable
from ..roadmap.nodes import SobolSampler
from ..roadmap.problem import Problem
from ..roadmap.roadmap import Roadmap
from ..roadmap.steering import FlowMapMethod, Method, StreamlineMethod, SurfaceMethod
from ..scenario import read_scenario
from ..search.answer import planner_of
from ..search.assembly import RoutePlanner
from ..search.surfacing import Surfacing
from .baselines import BASELINES
from .brute_force import fastest_legs
from .record import made_by

COMPARED: dict[str, Method] = {
    "flow-map": FlowMapMethod(),
    "streamline": StreamlineMethod(16),
    "surface": SurfaceMethod(16),
}
LAW = "neighbours.kind=reachable"
"""Every method gets the same pairs: those that the flow map can fly."""
BEST = "best known"
DENSE, DENSE_LIMIT = 4096, 128
"""Nodes and limit of the roadmap whose routes are the best known of random queries."""
SCAN = (48, 96)
"""Brute force begins with this scan of controls."""
QUARTILES = (25, 50, 75, 95)
ROW = "{:<17}{:<16}{:>10}{:>13}{:>9}{:>10}{:>11}"


@dataclass(frozen=True)
class Reference:
    """A problem's least travel time [s] (None if no path exists), its kind, and how it is known.

    In closed form `bound` is the same. By level set, `seconds` is the fastest known path, whose controls change
    at every instant (in an unsteady flow the finest grid's arrival), and no path is faster than `bound`.
    """

    seconds: float | None
    bound: float | None
    kind: str
    how: str


@dataclass(frozen=True)
class Attempt:
    """One method's route between one pair of points: its travel time [s], inf if no route exists."""

    problem: str
    method: str
    pair: int
    travel_time: float
    wall_s: float
    legs: int


@dataclass(frozen=True)
class Outcome:
    """The result of a method on a problem: route [s], build [s], edges, pairs; None where there is no value."""

    problem: str
    method: str
    travel_time: float
    build_s: float | None = None
    edges: int | None = None
    pairs: int | None = None

    @property
    def solved(self) -> bool:
        """Whether a route exists."""
        return math.isfinite(self.travel_time)


@dataclass(frozen=True)
class Report:
    """The results of the suite: outcomes, attempts at random queries, completeness (share, number of legs)."""

    references: dict[str, Reference]
    outcomes: tuple[Outcome, ...]
    attempts: tuple[Attempt, ...]
    completeness: dict[str, tuple[float, int]]
    made: dict[str, Any]

    def over_reference(self, outcome: Outcome) -> float | None:
        """Return travel time over the problem's reference, if both are known."""
        seconds = self.references[outcome.problem].seconds
        return outcome.travel_time / seconds if seconds and outcome.solved else None

    def quality(self) -> list[dict[str, Any]]:
        """Return rows for each problem and method on random queries: success, and time over the best known.

        Success is the share of the queries that any method solves. The time is given by quartiles and 95 %.
        """
        best = {(a.problem, a.pair): a.travel_time for a in self.attempts if a.method == BEST}
        for attempt in self.attempts:
            best[attempt.problem, attempt.pair] = min(best[attempt.problem, attempt.pair], attempt.travel_time)
        rows = []
        for problem, method in dict.fromkeys((a.problem, a.method) for a in self.attempts if a.method != BEST):
            attempts = [a for a in self.attempts if (a.problem, a.method) == (problem, method)]
            able = [a for a in attempts if math.isfinite(best[a.problem, a.pair])]
            ratios = [a.travel_time / best[a.problem, a.pair] for a in able if math.isfinite(a.travel_time)]
            spread = np.percentile(ratios, QUARTILES).round(4).tolist() if ratios else [None] * len(QUARTILES)
            names = [f"p{n}" for n in QUARTILES]
            success = len(ratios) / len(able) if able else None
            row = {"problem": problem, "method": method, "able": len(able), "success": success}
            rows.append(row | dict(zip(names, spread, strict=True)))
        return rows

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON; infinite times are null."""
        outcomes = []
        for outcome in self.outcomes:
            row = {**asdict(outcome), "solved": outcome.solved, "over_reference": self.over_reference(outcome)}
            outcomes.append(row | {"travel_time": outcome.travel_time if outcome.solved else None})
        shares = {name: {"share": share, "legs": legs} for name, (share, legs) in self.completeness.items()}
        references = {name: asdict(reference) for name, reference in self.references.items()}
        known = {"references": references, "outcomes": outcomes, "completeness": shares}
        return self.made | known | {"quality": self.quality()}

    def __str__(self) -> str:
        head = ("problem", "method", "route", "/ reference", "build", "edges", "pairs/s")
        lines = [ROW.format(*head)]
        for outcome in self.outcomes:
            ratio = self.over_reference(outcome)
            route = f"{outcome.travel_time:,.0f} s" if outcome.solved else "none"
            built = ("", "", "")
            if outcome.build_s is not None and outcome.pairs is not None:
                built = (
                    f"{outcome.build_s:.2f} s",
                    f"{outcome.edges:,}",
                    f"{outcome.pairs / max(outcome.build_s, 1e-9):,.0f}",
                )
            lines.append(
                ROW.format(
                    outcome.problem, outcome.method, route, "" if ratio is None else f"{ratio:.3f}", *built
                )
            )
        lines.append("\nof the legs that brute force finds, the flow map has")
        for name, (share, legs) in self.completeness.items():
            lines.append(f"  {name:<17}{share:8.2%} of {legs:,}")
        lines.append("\nrandom queries: success, and travel time over the best known, quartiles and 95 %")
        for row in self.quality():
            spread = "".join("       -" if row[f"p{n}"] is None else f"{row[f'p{n}']:8.3f}" for n in QUARTILES)
            success = "-" if row["success"] is None else f"{row['success']:.0%}"
            lines.append(f"  {row['problem']:<17}{row['method']:<16}{success:>5} of {row['able']:<4}{spread}")
        return "\n".join(lines)


def references() -> dict[str, Reference]:
    """Return the references of the suite's problems (shipped scenarios) by name."""
    text = (files("glider_stream") / "data" / "references.json").read_text(encoding="utf-8")
    return {name: Reference(**fields) for name, fields in json.loads(text).items()}


def run_suite(
    only: Sequence[str] = (),
    *,
    quick: bool = False,
    pairs: int = 20,
    progress: Callable[[str], None] = lambda message: None,
) -> Report:
    """Return the report on the problems in `only` (empty: all), with `pairs` random queries each.

    `quick`: a small run.
    """
    known = references()
    for name in only:
        require(name in known, f"the problem {name!r} is not known; choose from: {', '.join(known)}")
    require(pairs >= 1, f"`pairs` must be at least 1; got {pairs}")
    chosen = {name: reference for name, reference in known.items() if name in only or not only}
    outcomes: list[Outcome] = []
    attempts: list[Attempt] = []
    completeness: dict[str, tuple[float, int]] = {}
    with threads(None) as count:
        for name in chosen:
            problem = read_scenario(name, [LAW]).problem()
            roads = {method: _with(problem, steering) for method, steering in COMPARED.items()}
            built = {method: build_roadmap(case) for method, case in roads.items()}
            planners = {method: planner_of(roads[method], road, Surfacing()) for method, road in built.items()}
            outcomes += [_outcome(name, method, built[method], planner) for method, planner in planners.items()]
            outcomes += _baselines(name, problem)
            position = built["flow-map"].position
            completeness[name] = _completeness(roads["flow-map"], position, 2 if quick else 16)
            attempts += _attempts(name, problem, planners, 2 if quick else pairs, 256 if quick else DENSE)
            progress(f"{name}: {outcomes[-len(COMPARED) - len(BASELINES)].travel_time:,.0f} s")
    return Report(chosen, tuple(outcomes), tuple(attempts), completeness, made_by(count, quick))


def _with(problem: Problem, steering: Method) -> Problem:
    return replace(problem, evaluator=replace(problem.evaluator, steering=steering))


def _outcome(name: str, method: str, road: Roadmap, planner: RoutePlanner) -> Outcome:
    path = planner.query()
    return Outcome(name, method, path.travel_time, road.wall_s, road.target.size, road.evaluated)


def _baselines(name: str, problem: Problem) -> list[Outcome]:
    assert problem.start is not None
    assert problem.goal is not None
    return [
        Outcome(name, method, baseline(problem, problem.start, problem.goal))
        for method, baseline in BASELINES.items()
    ]


def _completeness(problem: Problem, position: Array, count: int) -> tuple[float, int]:
    """Return the found share of the legs that brute force finds from some nodes to others, and their number."""
    rng, evaluator = np.random.default_rng(0), problem.evaluator
    source = rng.choice(len(position), min(count, len(position)), replace=False)
    target = np.sort(rng.choice(len(position), min(100, len(position)), replace=False))
    dt, horizon = evaluator.integration.dt, evaluator.integration.dt * evaluator.integration.steps
    ends = position, source, target, problem.departure
    best = fastest_legs(evaluator.flow, evaluator.polar, *ends, *SCAN, dt, horizon).ravel()
    indptr = np.arange(source.size + 1) * target.size
    rows = evaluator.connect(position, problem.departure, source, indptr, np.tile(target, source.size))
    found = rows[np.isfinite(best), STATUS] == Status.CONNECTED
    return (float(found.mean()) if found.size else 1.0), found.size


def _attempts(
    name: str, problem: Problem, planners: dict[str, RoutePlanner], count: int, dense: int
) -> list[Attempt]:
    """Return the attempts of every planner and baseline, and of a denser roadmap, at random queries."""
    rng = np.random.default_rng(1)
    points = rng.uniform(problem.lo, problem.hi, (8 * count, 3))
    points = points[problem.evaluator.allowed(points, problem.departure)][: 2 * count]
    ends = points.reshape(-1, 2, 3)
    best = replace(
        _with(problem, FlowMapMethod()),
        sampler=SobolSampler(count=dense, seed=1),
        law=Reachable(DENSE_LIMIT),
    )
    planners = planners | {BEST: planner_of(best, build_roadmap(best), Surfacing())}
    made = []
    for pair, (start, goal) in enumerate(ends):
        for method, planner in planners.items():
            began = time.perf_counter()
            path = planner.query(start, goal)
            wall = time.perf_counter() - began
            made.append(Attempt(name, method, pair, path.travel_time, wall, len(path.legs)))
        for method, baseline in BASELINES.items():
            began = time.perf_counter()
            seconds = baseline(problem, start, goal)
            made.append(Attempt(name, method, pair, seconds, time.perf_counter() - began, 0))
    return made


def ompl_log(report: Report, problem: str) -> str:
    """Return one problem's random queries as an OMPL benchmark log (ompl.kavrakilab.org/benchmark.html)."""
    chosen = [attempt for attempt in report.attempts if attempt.problem == problem]
    methods = list(dict.fromkeys(attempt.method for attempt in chosen))
    runs = len({attempt.pair for attempt in chosen})
    reference = report.references[problem]
    lines = [
        f"glider-stream version {report.made['software_version']}",
        f"Experiment {problem}",
        "1 experiment properties",
        f"reference_s REAL = {math.nan if reference.seconds is None else reference.seconds}",
        f"Running on {report.made['processor']}",
        f"Starting at {report.made['date']}",
        "<<<|",
        f"{problem}: {reference.kind}, {reference.how}",
        "|>>>",
        "<<<|",
        f"{report.made['processor']}, {report.made['threads']} threads",
        "|>>>",
        "1 is the random seed",
        "0 seconds per run",
        "0 MB per run",
        f"{runs} runs per planner",
        f"{sum(attempt.wall_s for attempt in chosen)} seconds spent to collect the data",
        "0 enum types",
        f"{len(methods)} planners",
    ]
    for method in methods:
        rows = [attempt for attempt in chosen if attempt.method == method]
        lines += [
            method.replace(" ", "_"),
            "0 common properties",
            "4 properties for each run",
            "time REAL",
            "solved BOOLEAN",
            "travel_time REAL",
            "legs INTEGER",
            f"{len(rows)} runs",
        ]
        for attempt in rows:
            solved = math.isfinite(attempt.travel_time)
            values = (attempt.wall_s, int(solved), attempt.travel_time if solved else math.nan, attempt.legs)
            lines.append("".join(f"{value}; " for value in values))
        lines.append(".")
    return "\n".join(lines) + "\n"
