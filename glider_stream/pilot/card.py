"""The pilot's card: speed over ground, currents and times of arrival for each leg of a route."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.clock import moment
from ..kernels.flow import velocities
from ..roadmap.problem import Problem
from ..search.confidence_lines import told
from ..search.path import FROZEN, SURFACE, Leg, Path

DAY = 86_400.0


@dataclass(frozen=True)
class Row:
    """A leg, or the whole route.

    `duration` [s]; `over_ground` [m/s]; the current `along` the way and `across` it, positive to the left [m/s];
    `toward_goal` [km/day]; `fastest`: the fastest current on the way [m/s]; `outrun`: whether that current is
    faster than the vehicle, which then cannot hold station; `arrives` [s since departure].
    """

    duration: float
    over_ground: float
    along: float
    across: float
    toward_goal: float
    fastest: float
    outrun: bool
    arrives: float

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a dictionary for JSON."""
        return {
            "duration_s": self.duration,
            "arrives_s": self.arrives,
            "over_ground_mps": self.over_ground,
            "over_ground_km_per_day": daily(self.over_ground),
            "toward_goal_km_per_day": self.toward_goal,
            "current_along_mps": self.along,
            "current_across_mps": self.across,
            "fastest_current_mps": self.fastest,
            "outrun": self.outrun,
        }


@dataclass(frozen=True)
class Card:
    """The legs of a route and the whole route.

    `under`: times under water from one surfacing to the next [s]; `best`: the vehicle's greatest horizontal speed
    [m/s].
    """

    path: Path
    legs: tuple[Row, ...]
    whole: Row
    under: tuple[float, ...]
    best: float

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a dictionary for JSON."""
        return {
            "departs": None if self.path.departs is None else self.path.departs.isoformat(),
            "legs": [row.as_dict() for row in self.legs],
            "whole": self.whole.as_dict(),
            "surface_to_surface_s": list(self.under),
            "best_horizontal_mps": self.best,
            **({} if self.path.departure is None else {"frozen": self.path.frozen}),
            **({} if self.path.confidence is None else {"confidence": dict(self.path.confidence)}),
        }

    def __str__(self) -> str:
        above = "                                     current, m/s                    greatest"
        head = "leg   hours  over ground             along   across     to goal    current   arrives"
        lines = [above, head, *(self._line(f"{n:3}", row) for n, row in enumerate(self.legs, 1))]
        lines.append(self._line("all", self.whole))
        if self.under:
            times = "" if len(self.under) == 1 else f" {len(self.under)} times, {min(self.under) / 3600:.2f} to"
            lines.append(f"surface to surface:{times} {max(self.under) / 3600:.2f} h")
        else:
            lines.append("surface to surface: the route does not surface twice")
        outrun = [str(n) for n, row in enumerate(self.legs, 1) if row.outrun]
        if outrun:
            lines.append(
                f"* the water is faster than the vehicle's {self.best:.2f} m/s: "
                f"it cannot hold station on legs {', '.join(outrun)}"
            )
        sure = self.path.confidence
        if sure is not None:
            lines.append(
                f"arrivals above: as planned, in {sure['planned_in']}; below: in the members, with errors"
            )
            lines += [f"{sure['ensemble']}, {sure['flown']}:", *told(sure)]
        return "\n".join([*lines, *([FROZEN] if self.path.frozen else [])])

    def _line(self, name: str, row: Row) -> str:
        return (
            f"{name}  {row.duration / 3600:6.2f}  {row.over_ground:6.2f} m/s {daily(row.over_ground):6.1f} km/d  "
            f"{row.along:+7.2f}  {row.across:+7.2f}  {row.toward_goal:6.1f} km/d  "
            f"{row.fastest:5.2f}{'*' if row.outrun else ' '} m/s  {moment(self.path.departs, row.arrives)}"
        )


def daily(speed: float) -> float:
    """Return a speed [m/s] in km/day."""
    return speed * DAY / 1000


def card(path: Path, problem: Problem) -> Card:
    """Return the card of a route that was planned in the water of this problem."""
    best = float(problem.evaluator.polar.best_horizontal.max())
    legs = tuple(_row(leg, path, problem, best) for leg in path.legs)
    if not legs:
        return Card(path, (), Row(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False, 0.0), (), best)
    time = np.array([row.duration for row in legs])
    total = max(float(time.sum()), 1e-9)
    over_ground, along, across = (
        float(np.dot(time / total, [getattr(row, name) for row in legs]))
        for name in ("over_ground", "along", "across")
    )
    gained = _distance(path.start, path.goal) - _distance(path.legs[-1].trajectory[-1, 1:4], path.goal)
    fastest = max(row.fastest for row in legs)
    outrun = any(row.outrun for row in legs)
    whole = Row(total, over_ground, along, across, daily(gained / total), fastest, outrun, total)
    return Card(path, legs, whole, _under(path), best)


def _under(path: Path) -> tuple[float, ...]:
    """Return the times [s] from one surfacing to the next."""
    ends = [(0.0, path.start[2]), *((leg.depart + leg.duration, leg.end[2]) for leg in path.legs)]
    return tuple(float(time) for time in np.diff([when for when, z in ends if z >= -SURFACE]))


def _distance(a: Any, b: Any) -> float:
    return math.dist(a[:2], b[:2])


def _row(leg: Leg, path: Path, problem: Problem, best: float) -> Row:
    rows = leg.trajectory
    times = path.water_times(leg, problem.departure)
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
        toward_goal=daily(gained / time),
        fastest=fastest,
        outrun=fastest > best,
        arrives=leg.depart + leg.duration,
    )
