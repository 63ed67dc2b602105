"""How far off the integration's step puts legs: a sample of them, flown again in finer steps."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..base.arrays import Array, Index
from ..base.settings import require
from ..kernels.edges import CONNECTED, Edge
from .problem import Problem
from .roadmap import EDGE_FIELDS, Edges, Provenance, Roadmap, in_order

SAMPLED_NODES, SAMPLED_LEGS = 16, 512
"""The legs that are flown again: some of each of a few nodes, evenly chosen by their numbers."""
MOST_SAMPLED_NODES = 128
"""Where few legs leave those nodes, up to so many are asked for theirs; more would cost each part much."""
FINER = 0.381966
"""The finer step, in steps: near a half, but no simple fraction. A flow that repeats itself every step, or every
half one, would look the same in half steps."""


UNTRIED = "not tried: no leg leaves any of the nodes that were asked"
"""Words in a roadmap whose build had no leg to fly again."""


@dataclass(frozen=True)
class StepError:
    """Of `legs` legs, flown in steps of `dt` [s], the worst ends `off` [m] from where it does in finer steps."""

    off: float
    legs: int
    dt: float
    tolerance: float

    def check(self) -> None:
        """InputError where it exceeds the tolerance."""
        worst = f"of {self.legs} legs, the worst ends {self.off:.3g} m off"
        cure = "make `integration.dt` smaller, and `integration.steps` larger by as much"
        require(
            self.off <= self.tolerance,
            f"`integration.dt` = {self.dt:g} s is too coarse for this flow: {worst}, more than the tolerance of "
            f"{self.tolerance:g} m; {cure}",
        )

    def __str__(self) -> str:
        if self.legs == 0:
            return f"of {self.dt:g} s, {UNTRIED}"
        legs = "1 leg" if self.legs == 1 else f"{self.legs} legs"
        return f"of {self.dt:g} s, off by {self.off:.2g} m at most of {legs} that were flown again in finer steps"


def sampled_nodes(count: int, few: int = SAMPLED_NODES) -> Index:
    """The nodes of so many whose legs are flown again: the same for all parts, and every run, of a build."""
    return np.unique(np.linspace(0, count - 1, few).astype(np.int64))


def wider_samples(count: int) -> Iterator[Index]:
    """Of so many nodes a few, then twice as many, until all or the most are sampled."""
    few = SAMPLED_NODES
    while few < min(count, MOST_SAMPLED_NODES):
        yield sampled_nodes(count, few)
        few *= 2
    yield sampled_nodes(count, min(count, MOST_SAMPLED_NODES))


def step_error(problem: Problem, start: Array, values: Array) -> StepError:
    """How far off some of the legs from `start` (n, 3) [m] end; their `values` (n, 6) as EDGE_FIELDS says."""
    evaluator = problem.evaluator
    integration = evaluator.integration
    finer = replace(evaluator, integration=replace(integration, dt=FINER * integration.dt))
    some = np.unique(np.linspace(0, len(values) - 1, min(SAMPLED_LEGS, len(values))).astype(np.int64))
    off = 0.0
    for n in some:
        leg = Edge(CONNECTED, *(float(value) for value in values[n]))
        ends = [one.trace(start[n], leg, problem.departure)[-1, 1:] for one in (evaluator, finer)]
        off = max(off, float(np.linalg.norm(ends[0] - ends[1])))
    return StepError(off, len(some), integration.dt, integration.tolerance)


class StepSample:
    """The legs of a few nodes of a build: those that are known already, the others found."""

    def __init__(self, count: int) -> None:
        """Of a build of so many nodes."""
        self.samples = list(wider_samples(count))
        self.known = in_order([])

    def take(self, edges: Edges) -> None:
        """Keep what an earlier run, or an older roadmap, of one departure, knows of nodes that may be sampled."""
        wanted = np.unique(np.concatenate(self.samples))
        self.known = in_order([self.known, edges.of(np.isin(edges.source, wanted))])

    def checked(
        self,
        made: Provenance,
        problem: Problem,
        position: Array,
        find: Callable[[Problem, Index], Iterable[Edges]],
    ) -> Provenance:
        """What makes a roadmap, with words on its steps; InputError where they are too coarse.

        `find` evaluates some of the nodes `position` (n, 3) [m] at the departure of a problem. Of many departures
        the first, the last and the one in the middle are looked at, anew each time.
        """
        times = problem.departures
        errors = []
        for when in sorted({times[0], times[len(times) // 2], times[-1]}):
            one = replace(problem, departure=when, slices=())
            edges = self._legs(partial(find, one))
            errors.append(step_error(one, position[np.repeat(edges.source, edges.degree)], edges.values))
        worst = max(errors, key=lambda error: error.off)
        worst = replace(worst, legs=sum(error.legs for error in errors))
        worst.check()
        return replace(made, steps=str(worst))

    def _legs(self, find: Callable[[Index], Iterable[Edges]]) -> Edges:
        """The legs of the first sample that has enough of them, or of the widest."""
        known = self.known
        for nodes in self.samples:
            missing = np.setdiff1d(nodes, known.source)
            if missing.size:
                known = in_order([known, *find(missing)])
            edges = known.of(np.isin(known.source, nodes))
            if edges.target.size >= SAMPLED_LEGS:
                break
        return edges


def check_steps(roadmap: Roadmap, problem: Problem) -> None:
    """InputError where the steps of a roadmap are too coarse for its flow; if its build did not look already."""
    if roadmap.provenance.steps and UNTRIED not in roadmap.provenance.steps:
        return
    degree = np.diff(roadmap.indptr)
    start = np.repeat(roadmap.position, degree, axis=0)
    step_error(problem, start, np.column_stack([getattr(roadmap, name) for name in EDGE_FIELDS])).check()
