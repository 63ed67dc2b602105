"""Scoring a drawn route: how long each leg takes, or the one that fails and why."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kernels.edges import Edge, Status
from .path import Path

Array = NDArray[np.float64]

REASONS = {
    Status.CURRENT_TOO_STRONG: "the current across it is stronger than the vehicle; go round, or with it",
    Status.TOO_FAR: "it is too far for one glide within the horizon; put a stop between",
    Status.NO_HIT: "no glide angle and heading lead there; move the stop with the current, or change its depth",
    Status.BLOCKED: "every glide there touches land, seabed or a keep-out area; move it into open water",
    Status.OUTSIDE_FLOW: "one of its ends lies outside the current's grid; stay within the domain",
    Status.SAME_DEPTH: "one glide changes depth, and its ends lie at the same",
}
"""Why a leg fails, and what to try."""


@dataclass(frozen=True)
class ScoredLeg:
    """From `start` to `end` (3,) [m]: its time [s], the glides that it takes, none where it fails, and why."""

    start: Array
    end: Array
    time: float | None
    glides: int
    why: str


@dataclass(frozen=True)
class Score:
    """The legs up to the first that fails."""

    legs: tuple[ScoredLeg, ...]
    asked: int

    @property
    def flyable(self) -> bool:
        """Whether all of the route can be flown."""
        return len(self.legs) == self.asked and all(leg.time is not None for leg in self.legs)

    @property
    def time(self) -> float:
        """Of the legs that can be flown [s]."""
        return sum(leg.time for leg in self.legs if leg.time is not None)

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        return {
            "flyable": self.flyable,
            "travel_time_s": self.time if self.flyable else None,
            "legs": [{"time_s": leg.time, "glides": leg.glides, "why": leg.why or None} for leg in self.legs],
        }

    def __str__(self) -> str:
        lines = []
        for n, leg in enumerate(self.legs, 1):
            said = (
                f"{leg.time:9,.0f} s, {leg.glides} glide{'' if leg.glides == 1 else 's'}"
                if leg.time is not None
                else "fails"
            )
            lines.append(f"  leg {n:3}  {said}")
        if self.flyable:
            return "\n".join([f"the route takes {self.time:,.0f} s", *lines])
        return "\n".join([f"leg {len(self.legs)} of {self.asked} fails: {self.legs[-1].why}", *lines])


def score(
    points: Sequence[Array], connect: Callable[[Array, Array], Edge], query: Callable[[Array, Array], Path]
) -> Score:
    """Fly a drawn route: one glide between points at other depths, the best way of the roadmap between others."""
    legs: list[ScoredLeg] = []
    for start, end in pairwise(points):
        if start[2] != end[2]:
            edge = connect(start, end)
            reached = edge.status == Status.CONNECTED
            why = "" if reached else REASONS[Status(int(edge.status))]
            legs.append(ScoredLeg(start, end, edge.time if reached else None, int(reached), why))
        else:
            way = query(start, end)
            why = "" if way.found else "the roadmap has no way between its ends; more nodes may find one"
            legs.append(ScoredLeg(start, end, way.travel_time if way.found else None, len(way.legs), why))
        if legs[-1].time is None:
            break
    return Score(tuple(legs), len(points) - 1)
