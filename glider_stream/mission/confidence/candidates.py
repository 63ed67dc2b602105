"""Candidates: routes, and ways to plan anew, that are flown in all members before one of them is chosen."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import Array, Bools
from ...roadmap.roadmap import Roadmap
from ...search.answer import planner_of
from ...search.path import Path
from ...water.inspect import is_steady
from ..orders import Trims, Waypoints
from ..pilot import DepthAveraged, Office, Plan, Policy, Replan, Straight, plan_of
from ..vehicle import Fix
from .ensemble import Ensemble
from .shared import SharedRoadmap, shared_roadmap

SHARES = (0.5, 0.7, 0.9, 1.0)
"""Routes over the legs that exist in such shares of the members, with the times that these shares keep."""
FORECAST = "fastest in the forecast"


class Sent(Policy):
    """A plan that is sent once."""

    replans = False

    def __init__(self, plan: Plan) -> None:
        """Keep the plan."""
        self.sent = plan

    def plan(self, office: Office, fix: Fix) -> Plan | None:
        """Return the plan."""
        return self.sent


@dataclass(frozen=True)
class Candidate:
    """A way to fly: a `policy` with its `office`. `path`: the route that is sent; None if the policy makes more.

    `member` is the place, among the members, of the one in whose current the route is the fastest; -1 for none.
    `planned` says in which current the times of the path hold.
    `stops` (n, 2) [m] are the ends of the legs that the vehicle is ordered to fly, if they are known.
    """

    name: str
    policy: Policy
    office: Office
    path: Path | None = None
    member: int = -1
    stops: Array | None = None
    planned: str = "the forecast"

    @property
    def orders(self) -> str | None:
        """A text that is the same for the same orders; None if they are made on the way."""
        if not isinstance(self.policy, Sent):
            return None
        orders = self.policy.sent.orders
        if isinstance(orders, Trims):
            return repr(orders.glides)
        return repr((orders.stops.tolist(), orders.depth.tolist()))


def sent_routes(
    name: str, path: Path, office: Office, member: int = -1, planned: str = "the forecast"
) -> list[Candidate]:
    """Return a route that is sent once: as the vehicle steers, and if that is by trims, as waypoints, too."""
    if office.mission.vehicle.steering == "trims":
        plans = {f"{name}, as {orders}": plan_of(path, office, orders) for orders in ("trims", "waypoints")}
    else:
        plans = {name: plan_of(path, office)}
    return [
        Candidate(title, Sent(plan), office, path, member, _stops_of(plan, path), planned)
        for title, plan in plans.items()
    ]


def _stops_of(plan: Plan, path: Path) -> Array | None:
    orders = plan.orders
    if isinstance(orders, Waypoints):
        return orders.stops
    assert isinstance(orders, Trims)
    return np.array([leg.end[:2] for leg in path.legs])


class Search:
    """What is searched in an ensemble, once: the shared roadmap, and the candidates."""

    def __init__(self, ensemble: Ensemble, legs: bool = True) -> None:
        """Find the legs in all members, where the currents are steady; none if `legs` is False."""
        self.ensemble = ensemble
        steady = is_steady(ensemble.forecast.evaluator.flow)
        self.shared: SharedRoadmap | None = shared_roadmap(ensemble) if steady and legs else None
        road = None if self.shared is None else self.shared.forecast
        self.office = Office(ensemble.forecast, ensemble.mission, road)

    def candidates(self, replanned: bool) -> list[Candidate]:
        """Return the candidates; `replanned`: ways to plan anew at each call, else routes that are sent once."""
        found = self._policies() if replanned else [*self._routes(), *self._of_members()]
        found += [
            Candidate("straight", Straight(), self.office),
            self._depth_averaged(replanned),
        ]
        return _distinct(found)

    def _policies(self) -> list[Candidate]:
        offices = {FORECAST: self.office}
        if self.shared is not None:
            problem, mission = self.office.problem, self.office.mission
            offices |= {_legs_of(share): Office(problem, mission, self.shared.over(share)) for share in SHARES}
        return [Candidate(name, Replan(), office) for name, office in offices.items()]

    def _routes(self) -> list[Candidate]:
        """Return the fastest route in the forecast, and those over legs that many members have."""
        routes = {FORECAST: self.office.planner.query()}
        if self.shared is not None:
            routes |= {_legs_of(share): self._over(share) for share in SHARES}
        return [
            each for name, path in routes.items() if path.legs for each in sent_routes(name, path, self.office)
        ]

    def _over(self, share: float, without: Bools | None = None) -> Path:
        assert self.shared is not None
        road: Roadmap = self.shared.over(share, without)
        path = planner_of(self.office.problem, road, self.office.mission.pilot.rule).query()
        return replace(path, cost=path.travel_time)

    def _of_members(self) -> list[Candidate]:
        """Return the fastest route in each member's current."""
        found, rule = [], self.office.mission.pilot.rule
        for n, problem in enumerate(self.ensemble.each("routes")):
            road = None if self.shared is None else self.shared.members[n]
            path = planner_of(problem, road, rule).query()
            if path.legs:
                name = f"member {self.ensemble.numbers[n]}"
                found += sent_routes(f"fastest in {name}", path, self.office, n, name)
        return found

    def _depth_averaged(self, replanned: bool) -> Candidate:
        policy = DepthAveraged()
        if replanned:
            return Candidate("depth-averaged", policy, self.office)
        start = self.office.problem.start
        assert start is not None
        fix = Fix(float(start[0]), float(start[1]), self.office.problem.departure, (0.0, 0.0))
        plan = policy.plan(self.office, fix)
        return Candidate("depth-averaged", policy if plan is None else Sent(plan), self.office)


def _legs_of(share: float) -> str:
    return f"fastest over legs of {share:.0%}"


def _distinct(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates without those whose orders another one before has, too."""
    found: list[Candidate] = []
    seen: set[str] = set()
    for candidate in candidates:
        orders = candidate.orders
        if orders is None or orders not in seen:
            found.append(candidate)
            seen.add(orders or "")
    return found
