"""What many runs say: shares, medians and ratios, each with its 95 % interval."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import Array
from .run import ENDS, Outcome

NORMAL_95 = 1.959964
"""A normal value lies within so many standard deviations with a probability of 95 %."""
RESAMPLES = 2000
"""The bootstrap draws so many samples."""
REFERENCE, OURS = "omniscient", "replan"


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval; NaN if no run tells."""

    value: float
    low: float
    high: float

    def as_list(self) -> list[float | None]:
        """Return value, low and high for JSON."""
        return [x if math.isfinite(x) else None for x in (self.value, self.low, self.high)]

    def told(self, form: str, scale: float = 1.0) -> str:
        """Return the estimate as text."""
        if math.isnan(self.value):
            return "-"
        value, low, high = (format(x * scale, form) for x in (self.value, self.low, self.high))
        return f"{value} ({low}-{high})"


NOTHING = Estimate(math.nan, math.nan, math.nan)


def share(count: int, total: int) -> Estimate:
    """Return a share with its Wilson interval (Wilson 1927), which holds for few runs and near 0 and 1, too."""
    if total == 0:
        return NOTHING
    z2 = NORMAL_95**2
    p, most = count / total, 1.0 + z2 / total
    middle = (p + z2 / (2 * total)) / most
    half = NORMAL_95 / most * math.sqrt(p * (1 - p) / total + z2 / (4 * total**2))
    return Estimate(p, max(0.0, middle - half), min(1.0, middle + half))


def median(values: Sequence[float] | Array) -> Estimate:
    """Return the median with its bootstrap interval (percentiles of the medians of resampled runs)."""
    known = np.asarray(values, np.float64)
    if known.size == 0:
        return NOTHING
    drawn = np.random.default_rng(0).integers(0, known.size, (RESAMPLES, known.size))
    low, high = np.percentile(np.median(known[drawn], axis=1), [2.5, 97.5])
    return Estimate(float(np.median(known)), float(low), float(high))


@dataclass(frozen=True)
class Row:
    """What the runs of a policy say.

    `arrived`: the share of all runs; `with_reference`: of the runs in which the omniscient policy arrives. `time`
    [s], `energy` [J] and `surfacings` are medians of the runs that arrive. `over_reference` and `over_replan`:
    the median of this policy's time over the omniscient's and over replanning's, run by run where both arrive.
    `ends`: how many runs ended in each way.
    """

    policy: str
    runs: int
    arrived: Estimate
    with_reference: Estimate
    time: Estimate
    energy: Estimate
    surfacings: Estimate
    over_reference: Estimate
    over_replan: Estimate
    ends: dict[str, int]

    def as_dict(self) -> dict[str, Any]:
        """Return the row for JSON; an estimate is a list of value, low and high."""
        return {
            "policy": self.policy,
            "runs": self.runs,
            "arrived_share": self.arrived.as_list(),
            "arrived_where_omniscient_does": self.with_reference.as_list(),
            "time_s": self.time.as_list(),
            "energy_j": self.energy.as_list(),
            "surfacings": self.surfacings.as_list(),
            "time_over_omniscient": self.over_reference.as_list(),
            "time_over_replan": self.over_replan.as_list(),
            "ends": self.ends,
        }


def row_of(policy: str, runs: Sequence[dict[str, Outcome]]) -> Row:
    """Return the row of a policy; `runs` are the outcomes of each run by policy."""
    mine = [run[policy] for run in runs]
    there = [outcome for outcome in mine if outcome.arrived]
    known = [run for run in runs if REFERENCE in run and run[REFERENCE].arrived]
    ends = Counter(outcome.ended for outcome in mine)
    return Row(
        policy,
        len(mine),
        share(len(there), len(mine)),
        share(sum(run[policy].arrived for run in known), len(known)),
        median([outcome.time for outcome in there]),
        median([outcome.energy for outcome in there]),
        median([outcome.surfacings for outcome in there]),
        median(_ratios(policy, REFERENCE, runs)),
        median(_ratios(policy, OURS, runs)),
        {end: ends[end] for end in ENDS if ends[end]},
    )


def _ratios(policy: str, other: str, runs: Sequence[dict[str, Outcome]]) -> list[float]:
    return [
        run[policy].time / run[other].time
        for run in runs
        if other in run and run[policy].arrived and run[other].arrived and run[other].time > 0.0
    ]
