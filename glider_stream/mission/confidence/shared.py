"""A roadmap over all members: nodes and pairs are the forecast's, and each leg is found in each member.

What the members share: nodes, glide table, terrain and neighbours, and the pairs of nodes that a leg connects in
the forecast. What they cannot share is the fan of controls, which the current bends: each member flies its own.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.arrays import Array, Bools
from ...kernels.edges import STATUS, TIME, Status
from ...roadmap.builder import build_roadmap
from ...roadmap.problem import Problem
from ...roadmap.provenance import provenance_of
from ...roadmap.roadmap import EDGE_FIELDS, Roadmap
from .ensemble import Ensemble


@dataclass(frozen=True)
class SharedRoadmap:
    """The legs of the forecast's roadmap in every member.

    `time` (members, edges) [s]: inf where a leg does not exist in a member.
    """

    forecast: Roadmap
    members: tuple[Roadmap, ...]
    time: Array

    def over(self, share: float, without: Bools | None = None) -> Roadmap:
        """Return the legs that exist in a share of the members; their cost is the time that this share keeps.

        `without` (members,) marks members that are left out. Legs are those of the forecast, with its controls.
        """
        times = self.time if without is None else self.time[~without]
        rank = max(0, int(np.ceil(share * len(times))) - 1)
        kept = np.sort(times, axis=0)[rank]
        return _with(self.forecast, {"cost": kept}, np.isfinite(kept))


def shared_roadmap(ensemble: Ensemble) -> SharedRoadmap:
    """Return the roadmap over the members of a steady ensemble."""
    road = build_roadmap(ensemble.forecast)
    members, times = [], []
    for problem in ensemble.each("legs"):
        found = _legs_in(road, problem)
        members.append(found)
        times.append(_spread(road, found))
    return SharedRoadmap(road, tuple(members), np.array(times))


def _legs_in(road: Roadmap, problem: Problem) -> Roadmap:
    """Return the legs of a roadmap's pairs in the current of a member."""
    nodes = np.arange(len(road.position))
    found = problem.evaluator.connect(road.position, problem.departure, nodes, road.indptr, road.target)
    made = replace(provenance_of(problem, road.position), steps=road.provenance.steps)
    values = {name: found[:, TIME + n] for n, name in enumerate(EDGE_FIELDS)}
    return replace(_with(road, values, found[:, STATUS] == Status.CONNECTED), provenance=made)


def _with(road: Roadmap, values: dict[str, Array], kept: Bools) -> Roadmap:
    """Return a roadmap with other values of its edges, of which only some are kept."""
    columns = {name: getattr(road, name) for name in EDGE_FIELDS} | values
    before = np.concatenate([[0], np.cumsum(kept)])
    edges: dict[str, Any] = {name: np.ascontiguousarray(column[kept]) for name, column in columns.items()}
    return replace(road, indptr=before[road.indptr], target=road.target[kept], node_counts=None, **edges)


def _spread(road: Roadmap, member: Roadmap) -> Array:
    """Return a member's times for all edges of the roadmap whose pairs it has; inf where it has no leg."""

    def keys(some: Roadmap) -> Array:
        source = np.repeat(np.arange(len(some.position)), np.diff(some.indptr))
        return np.asarray(source * len(some.position) + some.target)

    times = np.full(road.target.size, np.inf)
    times[np.searchsorted(keys(road), keys(member))] = member.time
    return times
