"""The answer: how often and by when routes arrive in an ensemble, and which of them is best."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.clock import hours
from ...search.confidence_lines import told
from ...search.path import Origin, Path, placed
from ..statistics import Estimate
from .candidates import Candidate, Search, sent_routes
from .ensemble import Ensemble
from .judged import QUANTILES, Criterion, Flights, best_of, checked, fly, quantile
from .reach import Reach, reach_of

FORMAT = "glider-stream/confidence"
SHOWN = 8
"""So many of the best candidates are shown to people; JSON has all."""
CHOICE = "a choice among candidates, each flown in every member: no optimum"


@dataclass(frozen=True)
class Confidence:
    """Candidates flown in the members of an ensemble, and the `chosen` one by a criterion.

    `check`: how often the promise of the choice holds in members that had no part in it; None for few members.
    `tracks` are those of the chosen one, in each member.
    """

    ensemble: Ensemble
    criterion: Criterion
    flights: tuple[Flights, ...]
    chosen: int
    replanned: bool
    check: Estimate | None = None
    reach: Reach | None = None
    tracks: tuple[Array, ...] = ()

    @property
    def best(self) -> Flights:
        """The flights of the chosen candidate."""
        return self.flights[self.chosen]

    @property
    def found(self) -> bool:
        """Whether the chosen candidate arrives as the criterion asks; by a time or in the mean: at all."""
        time = self.best.time
        return bool(np.isfinite(self.criterion.promised(time)) and (time <= self.criterion.promised(time)).any())

    @property
    def path(self) -> Path | None:
        """The chosen route, with its confidence; None if the chosen candidate makes more than one route."""
        path = self.best.candidate.path
        if path is None:
            return None
        problem, rule = self.ensemble.forecast, self.ensemble.mission.pilot.rule
        what: dict[str, Any] = {"departure": problem.departure, "most_yos": rule.most_yos}
        origin = path.origin or Origin(problem.scenario, most_hours=rule.most_hours, **what)
        return replace(path, confidence=self._of(self.best), origin=origin)

    def _of(self, flights: Flights) -> dict[str, Any]:
        by = self.criterion.by
        return {
            **flights.as_dict(by),
            **({} if by is None else {"by_s": by}),
            "within_m": self.ensemble.mission.arrival.radius_m,
            "planned_in": flights.candidate.planned,
            "ensemble": self.ensemble.words,
            "flown": "planned anew at each call" if self.replanned else "sent once",
        }

    def as_dict(self) -> dict[str, Any]:
        """Return the answer for JSON."""
        promised = self.criterion.promised(self.best.time)
        return {
            "format": FORMAT,
            "format_version": 1,
            "software_version": version("glider-stream"),
            "mission": self.ensemble.mission.text,
            "criterion": str(self.criterion),
            "intervals": "95 %, Wilson",
            "found": self.found,
            "chosen": self._of(self.best),
            "promised_by_s": promised if np.isfinite(promised) else None,
            "promise_holds_in_others": None if self.check is None else self.check.as_list(),
            "candidates": [flights.as_dict(self.criterion.by) for flights in self.flights],
            **({} if self.reach is None else {"reach": self.reach.as_dict()}),
        }

    def __str__(self) -> str:
        mission, best = self.ensemble.mission, self.best
        flown = "planned anew at each call" if self.replanned else "sent once"
        lines = [
            f"{mission.title}: {self.ensemble.words}; orders are {flown}; the vehicle errs as the mission says"
        ]
        if len(self.flights) > 1:
            lines.append(f"best of {len(self.flights)} by {self.criterion}: {best.candidate.name}; {CHOICE}")
        lines += [f"  {line}" for line in told(self._of(best))]
        if not self.found:
            lines.append(f"  none keeps the criterion, {self.criterion}: this one arrives most often")
        if self.check is not None:
            share = self.check.told(".0f", 100.0)
            lines.append(f"  members that had no part in the choice: its promise holds in {share} % of them")
        if self.reach is not None:
            lines.append(f"  {self.reach}")
        return "\n".join([*lines, *self._table()])

    def _table(self) -> list[str]:
        if len(self.flights) == 1:
            return []
        order = sorted(range(len(self.flights)), key=lambda k: (*self.criterion.rank(self.flights[k].time), k))
        names = [f"{q:.0%} by (h)" for q in QUANTILES]
        wide = 2 + max(len(self.flights[k].candidate.name) for k in order[:SHOWN])
        head = f"  {'candidate':<{wide}}{'arrived (%)':<18}" + "".join(f"{name:<14}" for name in names)
        lines = [head.rstrip()]
        for k in order[:SHOWN]:
            each = self.flights[k]
            times = [quantile(each.time, q) for q in QUANTILES]
            shown = "".join(f"{hours(t) if np.isfinite(t) else '-':<14}" for t in times)
            lines.append(
                f"  {each.candidate.name:<{wide}}{each.arrived().told('.0f', 100.0):<18}{shown}".rstrip()
            )
        left = len(self.flights) - SHOWN
        return lines if left <= 0 else [*lines, f"  and {left} others, in --json"]


def confidence_of(
    ensemble: Ensemble,
    criterion: Criterion,
    routes: Sequence[tuple[str, Path]] = (),
    *,
    replanned: bool = False,
    reach: bool = False,
) -> Confidence:
    """Return how often and by when routes arrive; without `routes`, those of candidates that are searched.

    `replanned`: instead, candidates are ways to plan anew at each call between the same ends. `reach`: also the
    map for the time that the criterion names, or that the chosen candidate promises.
    """
    criterion.check(ensemble.count)
    sent = [] if replanned else routes
    search = Search(ensemble, legs=reach or not sent)
    candidates: list[Candidate] = []
    for name, path in sent:
        candidates += sent_routes(name, placed(path, ensemble.forecast), search.office, planned="its plan")
    candidates = candidates or search.candidates(replanned)
    flights = fly(ensemble, candidates)
    chosen = best_of(np.array([each.time for each in flights]), criterion)
    tracks = fly(ensemble, [candidates[chosen]], tracks=True)[0].tracks
    check = checked(flights, criterion) if len(flights) > 1 else None
    area = None
    if reach:
        promised = criterion.promised(flights[chosen].time)
        area = reach_of(search, promised if np.isfinite(promised) else criterion.limit)
    return Confidence(ensemble, criterion, tuple(flights), chosen, replanned, check, area, tracks)
