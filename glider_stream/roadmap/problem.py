"""The problem: the objects that a scenario describes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.flow import contains
from ..water.domain import BoxDomain, GeographicDomain
from .evaluator import Evaluator
from .neighbours import NeighbourLaw, Reachable
from .nodes import Sampler
from .pairs import LegFinder, legs_of


@dataclass(frozen=True)
class Problem:
    """The objects that a scenario describes; `build` and `query` need them.

    `lo`, `hi` (3,) [m] are the box of nodes. `departure` [s] is the time at which a glider leaves a node.
    `to_lonlat` changes x, y [m] into degrees in a geographic scenario. `departs` is the date and time of the
    departure (UTC), if known. `frozen`: in queries every leg meets the current of the departure, though the flow
    changes. `bins` [s]: queries keep ways to one node that arrive in different bins of time. `flow_words` and
    `glider_words` describe flow and glider. `domain` is the scenario's domain. `slices` are the rising departures
    [s] of a roadmap of several departures.

    Examples:
        >>> problem = glider_stream.read_scenario("small.toml").problem()
        >>> problem.lo.tolist(), problem.departure
        ([-200.0, -200.0, -150.0], 0.0)
    """

    evaluator: Evaluator
    sampler: Sampler
    law: NeighbourLaw | Reachable
    lo: Array
    hi: Array
    departure: float
    start: Array | None
    goal: Array | None
    scenario: str
    flow_words: str
    glider_words: str
    to_lonlat: Callable[[Array], Array] | None = None
    departs: datetime | None = None
    frozen: bool = False
    bins: float | None = None
    domain: BoxDomain | GeographicDomain | None = None
    slices: tuple[float, ...] = ()

    @property
    def departures(self) -> tuple[float, ...]:
        """The departures [s] of all slices of the roadmap; only one if the scenario has no [departures]."""
        return self.slices or (self.departure,)

    def leaving(self, since: float) -> "Problem":
        """Return the same problem for gliders that leave `since` [s] later."""
        departs = None if self.departs is None else self.departs + timedelta(seconds=since)
        return replace(self, departure=self.departure + since, departs=departs)

    def check_point(self, point: Array, name: str) -> None:
        """Raise InputError unless a glider can be at `point` (3,) [m]."""
        shown, deepest = [*point], f"domain, which ends at z = {self.lo[2]:g} m"
        if self.to_lonlat is not None and np.isfinite(point).all():
            shown = [*self.to_lonlat(point[None])[0], 0.0 - point[2]]
            deepest = f"domain, which ends at a depth of {-self.lo[2]:g} m"
        text = "[" + ", ".join(f"{value:.7g}" for value in shown) + "]"
        require(bool(np.isfinite(point).all()), f"`{name}` must be three finite numbers; got {text}")
        require(point[2] <= 0, f"`{name}` = {text} lies above the surface; z is upward, a depth of 100 m is -100")
        require(bool(point[2] >= self.lo[2]), f"`{name}` = {text} lies below the {deepest}; move it up")
        if bool(self.evaluator.allowed(point[None], self.departure)[0]):
            return
        outside = "" if self.domain is None else self.domain.outside(shown[0], shown[1])
        require(not outside, f"`{name}` = {text} lies {outside}")
        inside = contains(self.evaluator.flow, float(point[0]), float(point[1]), self.departure)
        where = "on land, in a keep-out area or too near the seabed" if inside else "outside the flow"
        require(False, f"`{name}` = {text} lies {where}; move it into open water")

    def legs(self, position: Array) -> LegFinder:
        """Return the object that finds legs among nodes (n, 3) [m]."""
        volume = float(np.prod(self.hi - self.lo))
        return legs_of(self.law, self.evaluator, position, volume, self.departure)
