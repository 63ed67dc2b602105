"""Judges candidates: how often, and by when, each arrives in the members, and which of them is best."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arrays import Array, Bools, Index
from ...base.settings import require
from ..run import ENDS
from ..run import fly as fly_run
from ..statistics import Estimate, share
from .candidates import Candidate
from .ensemble import Ensemble

QUANTILES = (0.1, 0.5, 0.9)
FOLDS = 5
"""A choice is checked by so many parts of the members: it is made without a part, and looked at in that part."""


@dataclass(frozen=True)
class Flights:
    """A candidate flown in all members: the `time` (members,) [s] at which it arrives, inf if it does not.

    `ended`: how each flight ended. `touched` (members,): whether the seabed or its clearance ended a flight or a
    dive. `lost` (members,): the leg, from 0, at whose end the vehicle was not near its stop; -1 if it arrives, or
    if the candidate has no list of stops. `tracks`: rows [t, x, y, z] of each, if they are kept.
    """

    candidate: Candidate
    time: Array
    ended: tuple[str, ...]
    touched: Bools
    lost: Index
    tracks: tuple[Array, ...] = ()

    def as_dict(self, by: float | None) -> dict[str, Any]:
        """Return the figures for JSON; `by` [s]: also the share that arrives by this time."""
        count, stops = len(self.time), self.candidate.stops
        legs = 0 if stops is None else len(stops)
        lost = np.bincount(self.lost[self.lost >= 0], minlength=legs)
        quantiles = {f"{q:.0%}": quantile(self.time, q) for q in QUANTILES}
        ends = Counter(self.ended)
        return {
            "name": self.candidate.name,
            "members": count,
            "arrived_share": self.arrived().as_list(),
            **({} if by is None else {"arrived_by_share": self.arrived(by).as_list()}),
            "arrival_quantiles_s": {name: _finite(time) for name, time in quantiles.items()},
            "touched_terrain_share": self.terrain.as_list(),
            "lost_by_leg": lost.tolist() if legs else None,
            "ends": {end: ends[end] for end in ENDS if ends[end]},
        }

    def arrived(self, by: float = math.inf) -> Estimate:
        """Return the share of the members in which the candidate arrives, at the latest `by` a time [s]."""
        return share(int((np.isfinite(self.time) & (self.time <= by)).sum()), len(self.time))

    @property
    def terrain(self) -> Estimate:
        """The share of the members in which terrain is touched."""
        return share(int(self.touched.sum()), len(self.time))


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def fly(ensemble: Ensemble, candidates: Sequence[Candidate], tracks: bool = False) -> list[Flights]:
    """Fly each candidate in each member, with the vehicle's errors of the member's number."""
    count, radius = ensemble.count, ensemble.mission.arrival.radius_m
    time = np.full((len(candidates), count), math.inf)
    touched, lost = np.zeros(time.shape, bool), np.full(time.shape, -1)
    ended = [[""] * count for _ in candidates]
    kept: list[list[Array]] = [[] for _ in candidates]
    for n, (number, problem) in enumerate(
        zip(ensemble.numbers, ensemble.each("tracks" if tracks else "flights"), strict=True)
    ):
        for k, candidate in enumerate(candidates):
            flight = fly_run(problem, candidate.policy, candidate.office, candidate.name, number)
            outcome = flight.outcome
            ended[k][n] = outcome.ended
            touched[k, n] = flight.touched > 0 or outcome.ended == "aground"
            if outcome.arrived:
                time[k, n] = outcome.time
            elif candidate.stops is not None:
                lost[k, n] = lost_leg(outcome.track, candidate.stops, radius)
            if tracks:
                kept[k].append(outcome.track)
    return [
        Flights(candidate, time[k], tuple(ended[k]), touched[k], lost[k], tuple(kept[k]))
        for k, candidate in enumerate(candidates)
    ]


def lost_leg(track: Array, stops: Array, radius: float) -> int:
    """Return the first leg at whose end a track (n, 4) never comes within a `radius` [m] of the stop (m, 2).

    Stops are passed in their order. If the track passes all of them, it is the last leg.
    """
    row = 0
    for number, stop in enumerate(stops):
        near = np.flatnonzero(np.hypot(*(track[row:, 1:3] - stop).T) <= radius)
        if not near.size:
            return number
        row += int(near[0])
    return len(stops) - 1


def quantile(time: Array, q: float) -> float:
    """Return the time by which a new member arrives with a probability of at least `q`; inf if n is too small.

    It is number q (n + 1), rounded up, of the n sorted times: the new member's time is as likely to lie in each
    of the n + 1 gaps.
    """
    rank = math.ceil(q * (len(time) + 1) - 1e-9)
    return float(np.sort(time)[rank - 1]) if rank <= len(time) else math.inf


@dataclass(frozen=True)
class Criterion:
    """What is best: the mean time, the time at a `quantile`, or the greatest share that arrives `by` a time [s].

    Both None stand for the mean, in which a member without arrival counts as the `limit` [s], the longest time of
    a run.
    """

    limit: float
    quantile: float | None = None
    by: float | None = None

    def __post_init__(self) -> None:
        share, by = self.quantile, self.by
        require(share is None or 0 < share < 1, f"a quantile must be between 0 % and 100 %; got {share or 0:.0%}")
        fits = by is None or 0 < by <= self.limit
        require(fits, f"the time to arrive by must be above 0 h and at most {self.limit / 3600:g} h, the longest "
                f"time of a run; got {(by or 0) / 3600:g} h")  # fmt: skip

    def check(self, count: int) -> None:
        """Raise InputError unless so many members can tell the quantile."""
        if self.quantile is None:
            return
        least = math.ceil(self.quantile / (1 - self.quantile) - 1e-9)
        cure = f"give at least {least}, or ask for a smaller share"
        require(count >= least, f"{count} members cannot tell by when {self.quantile:.0%} arrive; {cure}")

    def rank(self, time: Array) -> tuple[float, float, float]:
        """Return what is compared, the smallest first, for the times (members,) of a candidate."""
        mean = float(np.minimum(time, self.limit).mean())
        arrived = float(np.isfinite(time).mean())
        if self.quantile is not None:
            return quantile(time, self.quantile), -arrived, mean
        if self.by is not None:
            return -float((time <= self.by).mean()), mean, 0.0
        return mean, -arrived, 0.0

    def promised(self, time: Array) -> float:
        """Return the time [s] by which the chosen candidate is said to arrive."""
        if self.quantile is not None:
            return quantile(time, self.quantile)
        return self.limit if self.by is None else self.by

    def __str__(self) -> str:
        if self.quantile is not None:
            return f"the earliest time by which {self.quantile:.0%} arrive"
        return "the least mean time" if self.by is None else f"most arrivals by {self.by / 3600:.2f} h"


def best_of(time: Array, criterion: Criterion) -> int:
    """Return the best row of the times (candidates, members) [s]; the first of equals."""
    return min(range(len(time)), key=lambda k: (*criterion.rank(time[k]), k))


def checked(flights: Sequence[Flights], criterion: Criterion) -> Estimate | None:
    """Return how often the promise of a choice holds in members that had no part in it; None for few members.

    For each of FOLDS parts of the members: the candidates are those that were not planned in the part, and the
    choice and its promise are made without it.
    """
    time = np.array([each.time for each in flights])
    planned = np.array([each.candidate.member for each in flights])
    count = time.shape[1]
    part = np.arange(count) % FOLDS
    share_asked = criterion.quantile or 0.5
    if count - math.ceil(count / FOLDS) < math.ceil(share_asked / (1 - share_asked) - 1e-9) or count < 2 * FOLDS:
        return None
    held = 0
    for fold in range(FOLDS):
        inside = part == fold
        free = np.flatnonzero((planned < 0) | (part[planned] != fold))
        chosen = free[best_of(time[free][:, ~inside], criterion)]
        promised = criterion.promised(time[chosen, ~inside])
        times = time[chosen, inside]
        held += int((np.isfinite(times) & (times <= promised)).sum())
    return share(held, count)
