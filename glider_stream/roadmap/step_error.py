"""The error of the integration's step: a sample of legs is flown again in finer steps."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..base.arrays import Array, Index
from ..base.settings import require
from ..kernels.edges import CONNECTED, Edge
from ..kernels.flow import OceanGrid, ladder_in
from ..kernels.motion import most_step
from ..water.ocean.ladder import kink_shift
from .problem import Problem
from .roadmap import BaseRoadmap, Edges, Provenance, in_order

SAMPLED_NODES, SAMPLED_LEGS = 16, 512
"""At most this many nodes, evenly chosen by their numbers, and at most this many of their legs are flown
again."""
MOST_SAMPLED_NODES = 128
"""If few legs leave those nodes, the legs of up to this many nodes are found; more would take each part too
long."""
FINER = 0.381966
"""The finer step as a share of the step: near a half, but not a simple fraction. A flow that repeats itself in
every step, or in every half step, would give the same result in half steps."""


UNTRIED = "not tried: no leg leaves any of the nodes that were asked"
"""This text stands in a roadmap whose build had no leg to fly again."""


@dataclass(frozen=True)
class StepError:
    """The greatest distance `off` [m] between the ends of `legs` legs in steps of `dt` [s] and in finer steps.

    On a ladder a step lasts `longest` [s] at most. Bends of currents between levels move no end by more than
    `bound` [m], a side of a cell by no more than `kink` [m].
    """

    off: float
    legs: int
    dt: float
    tolerance: float
    longest: float = 0.0
    bound: float = 0.0
    kink: float = 0.0

    def check(self) -> None:
        """Raise InputError if the error exceeds the tolerance."""
        worst = f"of {self.legs} legs, the worst ends {self.off:.3g} m off"
        cure = "make `integration.dt` smaller, and `integration.steps` larger by as much"
        require(
            self.off <= self.tolerance,
            f"`integration.dt` = {self.dt:g} s is too coarse for this flow: {worst}, more than the tolerance of "
            f"{self.tolerance:g} m; {cure}",
        )

    def __str__(self) -> str:
        steps = f"of {self.dt:g} s"
        if self.longest:
            steps = f"of {self.longest:.3g} s at most, which end at levels of the file"
        if self.legs == 0:
            return f"{steps}, {UNTRIED}"
        legs = "1 leg" if self.legs == 1 else f"{self.legs} legs"
        told = f"{steps}, off by {self.off:.2g} m at most of {legs} that were flown again in finer steps"
        if not self.longest:
            return told
        passed = f"each side of a cell or time of the file that a leg passes {self.kink:.2g} m"
        return f"{told}; the file's bends from level to level allow {self.bound:.2g} m, and {passed}"


def sampled_nodes(count: int, few: int = SAMPLED_NODES) -> Index:
    """Return the nodes, of `count`, whose legs are flown again; they are the same for all parts of a build."""
    return np.unique(np.linspace(0, count - 1, few).astype(np.int64))


def wider_samples(count: int) -> Iterator[Index]:
    """Yield samples of `count` nodes: a few, then twice as many, until all or the greatest number is sampled."""
    few = SAMPLED_NODES
    while few < min(count, MOST_SAMPLED_NODES):
        yield sampled_nodes(count, few)
        few *= 2
    yield sampled_nodes(count, min(count, MOST_SAMPLED_NODES))


def sampled_legs(count: int) -> Index:
    """Return the legs, of `count`, that are flown again."""
    return np.unique(np.linspace(0, count - 1, min(SAMPLED_LEGS, count)).astype(np.int64))


def step_error(problem: Problem, start: Array, values: Array) -> StepError:
    """Return the step error of some legs from `start` (n, 3) [m]; `values` (n, 6) in the order of EDGE_FIELDS."""
    evaluator = problem.evaluator
    integration = evaluator.integration
    finer = replace(evaluator, integration=replace(integration, dt=FINER * integration.dt)).on_even_steps()
    some = sampled_legs(len(values))
    off, slowest = 0.0, np.inf
    for n in some:
        leg = Edge(CONNECTED, *(float(value) for value in values[n]))
        slowest = min(slowest, abs(leg.speed * np.sin(leg.glide_angle)))
        ends = [each.trace(start[n], leg, problem.departure)[-1, 1:] for each in (evaluator, finer)]
        off = max(off, float(np.linalg.norm(ends[0] - ends[1])))
    error = StepError(off, len(some), integration.dt, integration.tolerance)
    ladder = ladder_in(evaluator.flow)
    if not (ladder.longest and isinstance(evaluator.flow, OceanGrid)):
        return error
    longest = most_step(evaluator.flow, integration.dt)
    kink = kink_shift(evaluator.flow, longest)
    return replace(error, longest=longest, bound=ladder.shift / slowest, kink=kink)


class StepSample:
    """The legs of a few nodes of a build; legs that are known already are not found again."""

    def __init__(self, count: int) -> None:
        """Choose the sampled nodes of a build of `count` nodes."""
        self.samples = list(wider_samples(count))
        self.known = in_order([])

    def take(self, edges: Edges) -> None:
        """Keep the edges of sampled nodes from an earlier run, or from an older roadmap, of one departure."""
        wanted = np.unique(np.concatenate(self.samples))
        self.known = in_order([self.known, edges.of(np.isin(edges.source, wanted))])

    def checked(
        self,
        made: Provenance,
        problem: Problem,
        position: Array,
        find: Callable[[Problem, Index], Iterable[Edges]],
    ) -> Provenance:
        """Return the provenance with a text on its steps; InputError if the steps are too coarse.

        `find` evaluates some of the nodes `position` (n, 3) [m] at the departure of a problem. Of many departures
        the first, the last and the middle one are checked, each with new legs.
        """
        times = problem.departures
        errors = []
        for when in sorted({times[0], times[len(times) // 2], times[-1]}):
            at_departure = replace(problem, departure=when, slices=())
            edges = self._legs(partial(find, at_departure))
            errors.append(step_error(at_departure, position[np.repeat(edges.source, edges.degree)], edges.values))
        worst = max(errors, key=lambda error: error.off)
        worst = replace(worst, legs=sum(error.legs for error in errors))
        worst.check()
        return replace(made, steps=str(worst))

    def _legs(self, find: Callable[[Index], Iterable[Edges]]) -> Edges:
        """Return the legs of the first sample that has enough legs, or of the largest sample."""
        known = self.known
        for nodes in self.samples:
            missing = np.setdiff1d(nodes, known.source)
            if missing.size:
                known = in_order([known, *find(missing)])
            edges = known.of(np.isin(known.source, nodes))
            if edges.target.size >= SAMPLED_LEGS:
                break
        return edges


def check_steps(roadmap: BaseRoadmap, problem: Problem) -> None:
    """Raise InputError if the steps of a roadmap are too coarse, unless its build has checked them."""
    if roadmap.provenance.steps and UNTRIED not in roadmap.provenance.steps:
        return
    some = sampled_legs(roadmap.edge_count)
    source = np.searchsorted(roadmap.indptr, some, side="right") - 1
    step_error(problem, roadmap.position[source], roadmap.legs(some)).check()
