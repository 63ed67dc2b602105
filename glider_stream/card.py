"""The pilot's card: what a route makes over ground, what the water does to it, when it arrives where."""

import math
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import numpy as np

from .kernels.flow import velocities
from .path import Leg, Path
from .roadmap import Problem

DAY = 86_400.0


@dataclass(frozen=True)
class Row:
    """A leg, or all: duration [s], `over_ground` [m/s], the current `along` its way and `across`, to the left.

    `toward_goal` [km/day]; `fastest` current that it meets [m/s], and whether that outruns the vehicle: there
    it cannot hold station. `arrives` [s since departure].
    """

    duration: float
    over_ground: float
    along: float
    across: float
    toward_goal: float
    fastest: float
    outrun: bool
    arrives: float


@dataclass(frozen=True)
class Card:
    """The route's legs, and the whole."""

    path: Path
    legs: tuple[Row, ...]
    whole: Row

    def _when(self, seconds: float) -> str:
        if self.path.departs is None:
            return f"{seconds:,.0f} s"
        return (self.path.departs + timedelta(seconds=seconds)).strftime("%Y-%m-%d %H:%MZ")

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        return {"legs": [vars(row) for row in self.legs], "whole": vars(self.whole)}

    def __str__(self) -> str:
        head = "leg   hours  over ground   along   across   to goal    fastest   arrives"
        lines = [head, *(self._line(f"{n:3}", row) for n, row in enumerate(self.legs, 1))]
        lines.append(self._line("all", self.whole))
        outrun = [str(n) for n, row in enumerate(self.legs, 1) if row.outrun]
        if outrun:
            lines.append(
                f"* the water is faster than the vehicle: no holding station on legs {', '.join(outrun)}"
            )
        return "\n".join(lines)

    def _line(self, name: str, row: Row) -> str:
        return (
            f"{name}  {row.duration / 3600:6.1f}  {row.over_ground:6.2f} m/s  {row.along:+7.2f}  "
            f"{row.across:+7.2f}  {row.toward_goal:5.1f} km/d  "
            f"{row.fastest:5.2f}{'*' if row.outrun else ' '} m/s  {self._when(row.arrives)}"
        )


def card(path: Path, problem: Problem) -> Card:
    """The card of a route that was planned in this problem's water."""
    best = float(problem.evaluator.polar.best_horizontal.max())
    legs = tuple(_row(leg, path, problem, best) for leg in path.legs)
    if not legs:
        return Card(path, (), Row(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False, 0.0))
    time = np.array([row.duration for row in legs])
    share = time / max(float(time.sum()), 1e-9)
    over_ground, along, across = (
        float(np.dot(share, [getattr(row, name) for row in legs])) for name in ("over_ground", "along", "across")
    )
    gained = _distance(path.start, path.goal) - _distance(path.legs[-1].trajectory[-1, 1:4], path.goal)
    total = float(time.sum())
    fastest = max(row.fastest for row in legs)
    outrun = any(row.outrun for row in legs)
    return Card(
        path, legs, Row(total, over_ground, along, across, gained / total * DAY / 1000, fastest, outrun, total)
    )


def _distance(a: Any, b: Any) -> float:
    return math.dist(a[:2], b[:2])


def _row(leg: Leg, path: Path, problem: Problem, best: float) -> Row:
    rows = leg.trajectory
    times = problem.departure + rows[:, 0] - rows[0, 0]
    current = velocities(problem.evaluator.flow, *(np.ascontiguousarray(rows[:, n]) for n in (1, 2, 3)), times)
    way = rows[-1, 1:3] - rows[0, 1:3]
    far = float(np.hypot(*way))
    ahead = way / far if far > 0 else np.array([1.0, 0.0])
    mean = (
        current.mean(axis=0) if len(rows) < 2 else np.trapezoid(current, times, axis=0) / (times[-1] - times[0])
    )
    fastest = float(np.hypot(*current.T).max())
    gained = _distance(rows[0, 1:3], path.goal) - _distance(rows[-1, 1:3], path.goal)
    time = max(leg.duration, 1e-9)
    return Row(
        duration=leg.duration,
        over_ground=far / time,
        along=float(mean @ ahead),
        across=float(mean @ [-ahead[1], ahead[0]]),
        toward_goal=gained / time * DAY / 1000,
        fastest=fastest,
        outrun=fastest > best,
        arrives=leg.depart + leg.duration,
    )
