"""One run: a vehicle, flown by a policy from the start until it arrives or cannot."""

import math
from dataclasses import dataclass, field

import numpy as np

from ..base.arrays import Array
from ..kernels.place import Place
from ..roadmap.problem import Problem
from .orders import Orders, Trims
from .pilot import POLICIES, Office, Plan, Policy
from .settings import Mission
from .vehicle import Phase, Vehicle
from .world import Worlds, seeds_of

ENDS = ("arrived", "out of time", "missed the goal", "aground", "left the domain", "no plan", "carried away")
"""How runs end. "missed the goal": the list was flown to its end elsewhere, and the policy makes no other."""


@dataclass(frozen=True)
class Outcome:
    """A run of a policy: how it `ended`, and what it took.

    `time` [s] since departure, `energy` [J]; `surfacings`; `failed`: calls that failed; `plans`: plans that were
    made; `without`: calls at which no plan was found, so that the vehicle went on with its list or headed for the
    goal. `off` [m]: the last distance from the goal. `planned` [s]: the time that the first plan should take; NaN
    if the policy does not say. `track`: rows [t, x, y, z]. `line` (n, 2) [m]: the first plan.
    """

    policy: str
    number: int
    ended: str
    time: float
    energy: float
    surfacings: int
    failed: int
    plans: int
    without: int
    off: float
    planned: float
    track: Array
    line: Array

    @property
    def arrived(self) -> bool:
        """Whether the run arrived."""
        return self.ended == "arrived"


@dataclass
class Flight:
    """A run in all its parts: its `outcome`, its `phases`, and its plans, each with its time [s].

    `touched`: dives that the seabed's clearance has cut short.
    """

    outcome: Outcome
    phases: list[Phase]
    plans: list[tuple[float, Plan]] = field(default_factory=list)
    touched: int = 0


class Runner:
    """Flies the runs of a mission; the true current and what is planned in it are made once."""

    def __init__(self, mission: Mission) -> None:
        """Read the water."""
        self.mission, self.worlds = mission, Worlds(mission)
        self._true = Office(self.worlds.true, mission)
        self._fixed: Office | None = None

    def run(self, number: int) -> list[Outcome]:
        """Return the outcomes of a run's policies, in the order of the mission."""
        return [flight.outcome for flight in self.flights(number)]

    def flights(self, number: int) -> list[Flight]:
        """Return a run of each policy, all in the same world and with the same seed of the vehicle's errors."""
        office = self.office(number)
        return [self.flight(name, number, office) for name in self.mission.pilot.policies]

    def office(self, number: int) -> Office:
        """Return the office with a run's forecast; a forecast that is the same in all runs has one office."""
        world = self.worlds.world(number)
        if world.forecast is self.worlds.true:
            return self._true
        if self.mission.truth is None:
            return Office(world.forecast, self.mission)
        if self._fixed is None:
            self._fixed = Office(world.forecast, self.mission)
        return self._fixed

    def flight(self, name: str, number: int, forecast: Office) -> Flight:
        """Return one run of a policy."""
        policy, true = POLICIES[name](), self.worlds.true
        return fly(true, policy, self._true if policy.knows else forecast, name, number)


def fly(true: Problem, policy: Policy, office: Office, name: str, number: int) -> Flight:
    """Return a flight in the `true` current, of a policy that plans in an office; `number` sets its errors."""
    mission = office.mission
    assert true.start is not None
    vehicle = Vehicle(
        true,
        mission.vehicle,
        mission.pilot.rule,
        mission.energy,
        np.random.default_rng(seeds_of(mission, number)[1]),
        Place(float(true.start[0]), float(true.start[1]), float(true.start[2]), true.departure),
    )
    return _Run(vehicle, policy, office, mission).fly(name, number)


class _Run:
    def __init__(self, vehicle: Vehicle, policy: Policy, office: Office, mission: Mission) -> None:
        self.vehicle, self.policy, self.office, self.mission = vehicle, policy, office, mission
        self.plans: list[tuple[float, Plan]] = []
        self.failed = self.without = 0

    def fly(self, name: str, number: int) -> Flight:
        vehicle = self.vehicle
        departure = vehicle.here.t
        ended = self._ended(departure)
        begin = self.office.problem.start
        assert begin is not None
        track = [np.array([[departure, *begin]]), *(phase.rows for phase in vehicle.phases)]
        outcome = Outcome(
            name,
            number,
            ended,
            vehicle.here.t - departure,
            vehicle.spent,
            vehicle.surfacings,
            self.failed,
            len(self.plans),
            self.without,
            self._off(),
            self.plans[0][1].takes if self.plans else math.nan,
            np.concatenate(track) - [departure, 0.0, 0.0, 0.0],
            self.plans[0][1].line if self.plans else np.empty((0, 2)),
        )
        plans = [(t - departure, plan) for t, plan in self.plans]
        return Flight(outcome, vehicle.phases, plans, vehicle.touched)

    def _off(self) -> float:
        return math.dist(self.vehicle.here[:2], self.office.goal[:2])

    def _ended(self, departure: float) -> str:
        """Fly until the run ends; return how."""
        vehicle = self.vehicle
        orders = self._plan()
        if orders is None and not self.policy.replans:
            return "no plan"
        if orders is None:
            self.without += 1
            orders = self._home()
        while True:
            orders = vehicle.dive(orders)
            if ended := self._now(departure):
                return ended
            called = vehicle.call()
            # the vehicle may drift to the goal, or ashore
            if ended := self._now(departure):
                return ended
            self.failed += not called
            new = self._plan() if called and self.policy.replans else None
            self.without += called and self.policy.replans and new is None
            orders = orders if new is None else new
            if _is_empty(orders):
                if not self.policy.replans:
                    return "missed the goal"
                orders = self._home()

    def _home(self) -> Orders:
        """Return the orders of a vehicle without a list: it heads for the goal until a call brings a plan."""
        return self.office.towards(self.office.goal[None, :2])

    def _now(self, departure: float) -> str:
        """Return how the run ends here and now; empty if it goes on."""
        arrival = self.mission.arrival
        if self.vehicle.lost:
            return self.vehicle.lost
        if self.vehicle.here.t - departure > arrival.longest:
            return "out of time"
        return "arrived" if self._off() <= arrival.radius_m else ""

    def _plan(self) -> Orders | None:
        plan = self.policy.plan(self.office, self.vehicle.fix)
        if plan is None:
            return None
        self.plans.append((self.vehicle.here.t, plan))
        return plan.orders


def _is_empty(orders: Orders) -> bool:
    return len(orders.glides) == 0 if isinstance(orders, Trims) else len(orders.stops) == 0
