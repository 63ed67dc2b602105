"""The planner over a roadmap of several departures: fastest routes by its slices, all else as without."""

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
    """Answers queries with the clock running over slices, which a fastest route between two points is found by.

    What slices cannot answer (a rule of surfacing, energy, bins of time, many goals, legs that leave before the
    first or after the last of them, no way that they know) is searched for by legs found when they are needed, as
    by `ClockPlanner`.
    """

    def __init__(
        self,
        problem: Problem,
        slices: SliceSearch,
        rule: Surfacing = Surfacing(),  # noqa: B008  (frozen)
    ) -> None:
        """Over the nodes of a roadmap of slices, whose search is made already."""
        super().__init__(problem, slices.roadmap.position, rule)
        self.slices = slices

    def leaving(self, since: float) -> "SlicePlanner":
        """The same planner for routes that leave `since` [s] later."""
        later = SlicePlanner(self.problem.leaving(since), self.slices, self.rule)
        later._speeds = self._speeds
        return later

    def _query(self, start: ArrayLike | None, goal: ArrayLike | None, aim: Aim) -> Path:
        first, last = self.slices.roadmap.departures[[0, -1]]
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
        """The path by legs that are found when they are needed, with a note of why slices cannot answer."""
        first, last = self.slices.roadmap.departures[[0, -1]]
        slices = f"the roadmap's slices are from {first:g} s to {last:g} s"
        note = f"{slices}, and {why}: its legs were found without them"
        path = super()._query(start, goal, aim)
        return replace(path, notes=(note, *path.notes))
