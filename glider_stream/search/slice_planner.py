"""The planner for a roadmap of several departures: slices give the fastest routes, `ClockPlanner` all others."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..roadmap.problem import Problem
from .labels import Aim
from .path import Path
from .sliced import SliceSearch
from .surfacing import Surfacing
from .time_dependent import ClockPlanner


class SlicePlanner(ClockPlanner):
    """Answers queries with the clock running; the slices give the fastest route between two points.

    Slices cannot answer a query with a rule of surfacing, with energy, with bins of time or with many goals. They
    also cannot answer it if a leg leaves before the first slice or after the last one, or if they know no way.
    Then `ClockPlanner` answers it, with legs that are found when they are needed.
    """

    def __init__(
        self,
        problem: Problem,
        slices: SliceSearch,
        rule: Surfacing = Surfacing(),  # noqa: B008  (frozen)
    ) -> None:
        """Use the nodes of a roadmap of slices; `slices` searches it."""
        super().__init__(problem, slices.position, rule)
        self.slices = slices

    def leaving(self, since: float) -> "SlicePlanner":
        """Return the same planner for routes that leave `since` [s] later."""
        later = SlicePlanner(self.problem.leaving(since), self.slices, self.rule)
        later._speeds = self._speeds
        return later

    def _query(self, start: ArrayLike | None, goal: ArrayLike | None, aim: Aim) -> Path:
        first, last = self.slices.departures[[0, -1]]
        problem = self.problem
        by_slices = (
            self.rule == Surfacing()
            and problem.bins is None
            and problem.evaluator.cost.unit == "s"
            and aim == Aim(by_cost=True)
        )
        if not by_slices:
            return super()._query(start, goal, aim)
        if not first <= problem.departure <= last:
            return self._without(start, goal, aim, f"this route leaves at {problem.departure:g} s")
        ends = self._ends(start, [goal])
        if np.array_equal(ends.start, ends.goals[0]):
            return self.assembly.path(ends.start, ends.goals[0], [])
        hops, agreement = self.slices.fastest(ends.start, ends.goals[0], problem.departure)
        if hops is None:
            return super()._query(start, goal, aim)
        if problem.departure + sum(edge.time for _, _, edge in hops[:-1]) > last:
            return self._without(start, goal, aim, "some legs of this route leave later")
        self._check_steps(hops)
        return replace(self.assembly.path(ends.start, ends.goals[0], hops), notes=(str(agreement),))

    def _without(self, start: ArrayLike | None, goal: ArrayLike | None, aim: Aim, why: str) -> Path:
        """Return the path of `ClockPlanner`, with a note that says why the slices cannot answer."""
        first, last = self.slices.departures[[0, -1]]
        slices = f"the roadmap's slices are from {first:g} s to {last:g} s"
        note = f"{slices}, and {why}: its legs were found without them"
        path = super()._query(start, goal, aim)
        return replace(path, notes=(note, *path.notes))
