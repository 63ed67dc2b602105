"""When to leave: arrival and travel time of several departures, and the latest departure that arrives in time."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from ..base.settings import require
from ..roadmap.problem import Problem
from .path import Path

Moment = float | str
"""A time: seconds of the flow, or ISO 8601 (UTC) where the flow has a calendar."""
COUNT = 24
"""If no step is given, the time between the first and the last departure is cut into this many steps."""
MOST = 2000
"""No more departures than this are tried in one call."""
CLOSE = 30.0
"""The latest departure that arrives in time is found with this accuracy [s]."""


@dataclass(frozen=True)
class Departures:
    """The paths of some departures, in order of departure; `best` is the path with the least cost.

    `by` is the time [s of the flow] before which a path must arrive; `latest` is the last path that does.
    """

    paths: tuple[Path, ...]
    best: Path
    by: float | None = None
    latest: Path | None = None

    @property
    def found(self) -> bool:
        """Whether any departure has a path; if `by` is set, whether any path arrives in time."""
        return self.best.found if self.by is None else self.latest is not None

    def as_dict(self) -> dict[str, Any]:
        """Return a table for JSON: a row for each departure, the best path and the latest path."""
        rows = {"departures": [_row(path) for path in self.paths], "best": _row(self.best)}
        if self.by is None:
            return rows
        return {**rows, "arrive_by_s": self.by, "latest": None if self.latest is None else _row(self.latest)}

    def __str__(self) -> str:
        lines = ["departure             arrival               travel"]
        marked = [self.best, *([] if self.latest is None else [self.latest])]
        lines += [_line(path) + ("  best" if path is self.best else "") for path in self.paths]
        lines += [_line(path) + "  the latest that arrives in time" for path in marked[1:]]
        if self.by is not None and self.latest is None:
            lines.append("none of these arrives in time; leave earlier")
        return "\n".join(lines)


def _row(path: Path) -> dict[str, Any]:
    leaves, found = leaving(path), path.found
    row: dict[str, Any] = {
        "departure_s": leaves,
        "arrival_s": leaves + path.travel_time if found else None,
        "travel_time_s": path.travel_time if found else None,
        "cost": path.cost if found else None,
    }
    if path.departs is not None:
        row["departs"] = path.departs.isoformat()
    return row


def _line(path: Path) -> str:
    leaves = leaving(path)
    if not path.found:
        return f"{_moment_text(path, leaves)}no path: {path.why or 'none was found'}"
    arrives = leaves + path.travel_time
    return f"{_moment_text(path, leaves)}{_moment_text(path, arrives)}{path.travel_time / 3600:9.2f} h"


def _moment_text(path: Path, when: float) -> str:
    if path.departs is None:
        return f"{when:,.0f} s".ljust(22)
    stamp = path.departs.timestamp() + when - leaving(path)
    return f"{datetime.fromtimestamp(stamp, UTC):%Y-%m-%d %H:%M} UTC".ljust(22)


def leaving(path: Path) -> float:
    """Return the time [s of the flow] at which a path leaves; 0 in a steady flow."""
    return 0.0 if path.departure is None else path.departure


def seconds(moment: Moment, problem: Problem, name: str) -> float:
    """Return a time in seconds of the flow.

    InputError if `moment` is not a time, or if it is a date and the flow has no calendar.
    """
    try:
        value = float(moment)
    except ValueError:
        try:
            date = datetime.fromisoformat(str(moment).strip())
        except ValueError:
            date = None
        require(date is not None, f"`{name}` must be seconds or a time such as 2024-10-29T06:00; got {moment!r}")
        departs = problem.departs
        known = departs is not None
        require(known, f"`{name}` = {moment} is a date, and the flow has no calendar; give seconds")
        assert date is not None
        assert departs is not None
        utc = date.replace(tzinfo=UTC) if date.tzinfo is None else date.astimezone(UTC)
        value = problem.departure + (utc - departs).total_seconds()
    require(math.isfinite(value), f"`{name}` must be a finite time; got {moment!r}")
    return value


def when_to_leave(
    at: Callable[[float], Path], first: float, last: float, every: float | None, by: float | None = None
) -> Departures:
    """Return the paths of departures from `first` to `last` [s] with steps of `every` [s].

    `at` finds the path of one departure. If a path must arrive `by` a time, the latest departure is found by
    halving: between the last departure of these that arrives in time and the next one. If a glider that leaves
    later can arrive earlier, a still later departure may exist.
    """
    require(first <= last, f"the first departure must not lie after the last; got {first:g} and {last:g} s")
    step = (last - first) / COUNT if every is None else every
    require(step > 0 or first == last, f"`every` must be above 0 s; got {step:g}")
    count = 1 if first == last else math.floor((last - first) / step + 1e-9) + 1
    require(count <= MOST, f"departures every {step:g} s are {count:,}, more than {MOST:,}; take longer steps")
    times = first + step * np.arange(count)
    paths = [at(float(time)) for time in times]
    best = min(paths, key=lambda path: path.cost)
    if by is None:
        return Departures(tuple(paths), best)
    met = [n for n, path in enumerate(paths) if _arrival(path) <= by]
    if not met:
        return Departures(tuple(paths), best, by)
    latest, late = paths[met[-1]], float(times[met[-1]]) + step
    early, late = float(times[met[-1]]), min(late, last)
    while late - early > CLOSE:
        middle = 0.5 * (early + late)
        path = at(middle)
        if _arrival(path) <= by:
            latest, early = path, middle
        else:
            late = middle
    return Departures(tuple(paths), best, by, latest)


def _arrival(path: Path) -> float:
    return leaving(path) + path.travel_time
