"""Scores a drawn route: how long each leg takes, or which leg fails and why."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from ..base.arrays import Array
from ..base.clock import moment, span
from ..kernels.edges import Edge, Status
from ..search.path import FROZEN, Hop, Path, hops_of

REASONS = {
    Status.CURRENT_TOO_STRONG: "the current across it is stronger than the vehicle; go round, or with it",
    Status.TOO_FAR: "it is too far for one glide within the horizon; put a stop between",
    Status.NO_HIT: "no glide angle and heading lead there; move the stop with the current, or change its depth",
    Status.BLOCKED: "every glide there touches land, seabed or a keep-out area; move it into open water",
    Status.OUTSIDE_FLOW: "one of its ends lies outside the current's grid; stay within the domain",
    Status.CARRIED_AWAY: "the water rises or sinks there faster than any glide against it; go where it is"
    " calmer, or leave at another time",
    Status.SAME_DEPTH: "one glide changes depth, its ends lie at the same, and the roadmap has no way between;"
    " put a stop at another depth between",
}
"""The reason why a leg fails, and the cure."""


@dataclass(frozen=True)
class ScoredLeg:
    """A leg from `start` to `end` (3,) [m]: its time [s] and number of glides (0 if it fails), and its status."""

    start: Array
    end: Array
    status: Status
    time: float | None
    glides: int

    @property
    def why(self) -> str:
        """The reason why it fails, and the cure; empty if it does not fail."""
        return "" if self.time is not None else REASONS[self.status]


@dataclass(frozen=True)
class Score:
    """The score: the legs up to the first that fails, of `asked` legs.

    `flown`: all their glides, if there are any. `notes`: what the route's file leaves open and what was not read.
    """

    legs: tuple[ScoredLeg, ...]
    asked: int
    flown: Path | None
    notes: tuple[str, ...] = ()

    @property
    def flyable(self) -> bool:
        """Whether the whole route can be flown."""
        return len(self.legs) == self.asked and all(leg.time is not None for leg in self.legs)

    @property
    def time(self) -> float:
        """Total time [s] of the legs that can be flown."""
        return sum(leg.time for leg in self.legs if leg.time is not None)

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        return {
            "flyable": self.flyable,
            "travel_time_s": self.time if self.flyable else None,
            "legs": [
                {
                    "from": leg.start.tolist(),
                    "to": leg.end.tolist(),
                    "status": leg.status.name.lower(),
                    "time_s": leg.time,
                    "glides": leg.glides,
                    "why": leg.why or None,
                }
                for leg in self.legs
            ],
            "notes": list(self.notes),
            **({} if self.flown is None or self.flown.departure is None else {"frozen": self.flown.frozen}),
        }

    def __str__(self) -> str:
        departs = None if self.flown is None else self.flown.departs
        if self.flyable:
            arrives = "" if departs is None else f", arrives {moment(departs, self.time)}"
            title = f"the route takes {span(self.time)}{arrives}"
        else:
            failed = self.legs[-1]
            name = failed.status.name.lower().replace("_", " ")
            title = f"leg {len(self.legs)} of {self.asked} fails: {failed.why} ({name})"
        glides = iter(() if self.flown is None else self.flown.legs)
        still = [FROZEN] if self.flown is not None and self.flown.frozen else []
        lines = [title, *(f"  note: {note}" for note in (*self.notes, *still))]
        for n, leg in enumerate(self.legs, 1):
            summary = "fails"
            if leg.time is not None:
                summary = f"{span(leg.time)}, {leg.glides} glide{'' if leg.glides == 1 else 's'}"
            if leg.status == Status.SAME_DEPTH and leg.glides:
                summary += " of the roadmap: one glide changes depth, and the leg's ends lie at the same depth"
            lines += [f"  leg {n}: {summary}", *(f"    {next(glides).told(departs)}" for _ in range(leg.glides))]
        return "\n".join(lines)


def score(
    points: Sequence[Array],
    connect: Callable[[Array, Array, float], Edge],
    query: Callable[[Array, Array, float], Path],
    fly: Callable[[list[Hop]], Path],
) -> Score:
    """Return the score of a drawn route.

    Between points at different depths there is one glide; between points at the same depth, the best way of the
    roadmap. `points` (n, 3) [m]. Every glide begins when the last one ends, as in a query: `connect` and `query`
    get the seconds since departure.
    """
    legs: list[ScoredLeg] = []
    hops: list[Hop] = []
    clock = 0.0
    for start, end in pairwise(points):
        if start[2] != end[2]:
            edge = connect(start, end, clock)
            status = Status(int(edge.status))
            new = [(start, end, edge)] if status == Status.CONNECTED else []
            found = bool(new)
        else:
            way, status = query(start, end, clock), Status.SAME_DEPTH
            new, found = hops_of(way), way.found
        legs.append(ScoredLeg(start, end, status, sum(hop[2].time for hop in new) if found else None, len(new)))
        if not found:
            break
        hops += new
        clock += sum(hop[2].time for hop in new)
    return Score(tuple(legs), len(points) - 1, fly(hops) if hops else None)
