"""The vehicle: it executes orders between two surfacings, drifts during a call, and takes position fixes."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array
from ..kernels.control import CLIMB, DIVE, Polar
from ..kernels.place import Place
from ..kernels.terrain import OpenWater, Seabed, Terrain, allowed
from ..roadmap.problem import Problem
from ..search.surfacing import Surfacing
from ..vehicle.cost import Energy
from .glide import Aim, Belief, End, Glided, Motion, glided
from .orders import Orders, Trim, Trims, Waypoints, is_up
from .settings import VehicleSettings

NOWHERE = np.empty((0, 2))
LOST = {int(End.OUTSIDE): "left the domain", int(End.CARRIED): "carried away"}
"""How a vehicle is lost whose glide ends so, anywhere."""
SHALLOWEST = 10.0
"""A vehicle begins no yo that has room or time for less depth than this [m]."""


@dataclass(frozen=True)
class Phase:
    """A part of a run, a dive, a climb or a drift: rows [t, x, y, z], and the mean glide that it was in truth.

    `glide_angle` (signed) and `heading` [rad], `speed` through water [m/s]; all 0 in a drift. Where the water
    rises, its rise counts as the vehicle's.
    """

    rows: Array
    glide_angle: float
    heading: float
    speed: float


class Dive(NamedTuple):
    """What the vehicle has measured between two surfacings.

    `start`, `end`: fixes x, y [m]; `begins`, `ends` [s]; `depth`: the deepest place [m, downward]; `yos`; the
    mean `current` [m/s]; `through`: its mean horizontal speed through water by dead reckoning [m/s].
    """

    start: tuple[float, float]
    end: tuple[float, float]
    begins: float
    ends: float
    depth: float
    yos: int
    current: tuple[float, float]
    through: float


@dataclass(frozen=True)
class Fix:
    """What the vehicle knows after a surfacing: its place x, y [m] with the fix's error, and the time t [s].

    `current` (2,) [m/s] is the mean current of its last dive: the fix less the dead-reckoned way, over the time.
    `dives` are all its dives so far.
    """

    x: float
    y: float
    t: float
    current: tuple[float, float]
    dives: tuple[Dive, ...] = ()


@dataclass
class Vehicle:
    """A vehicle in the true current; all its errors come from `random`."""

    problem: Problem
    settings: VehicleSettings
    rule: Surfacing
    energy: Energy
    random: np.random.Generator
    here: Place
    phases: list[Phase] = field(default_factory=list)
    spent: float = 0.0
    surfacings: int = 0
    lost: str = ""
    """How the run has ended if the vehicle is lost: "aground", or one of LOST."""
    touched: int = 0
    """Dives that the seabed's clearance has cut short."""
    dives: tuple[Dive, ...] = ()

    def __post_init__(self) -> None:
        settings = self.settings
        self._turn = math.radians(settings.heading_bias_deg) * self.random.standard_normal()
        self._faster = 1.0 + settings.speed_bias * self.random.standard_normal()
        self._current = 0.0, 0.0
        self._ground = _without_clearance(self.problem.evaluator.terrain)
        self._fix = self._take_fix()
        self._believed = self._fix
        self._own = 0.0, 0.0
        self._dived_at, self._first_phase = self.here.t, 0

    # between two surfacings

    def dive(self, orders: Orders) -> Orders:
        """Execute orders until the vehicle comes up or is lost; return those that are left."""
        self._believed, self._own, self._dived_at = self._fix, (0.0, 0.0), self.here.t
        self._first_phase = len(self.phases)
        left = self._fly_trims(orders) if isinstance(orders, Trims) else self._fly_yos(orders)
        if not self.lost:
            self._surface()
        return left

    def _fly_trims(self, orders: Trims) -> Trims:
        glides = orders.glides
        for n, trim in enumerate(glides):
            up = is_up(trim.z)
            if not self._glide(trim, Aim(trim.heading, NOWHERE, 0, 0.0, False)) or up:
                return Trims(glides[n + 1 :])
        return Trims(())

    def _fly_yos(self, orders: Waypoints) -> Waypoints:
        """Fly yos towards waypoints, until the rule of surfacing or the end of the list brings the vehicle up."""
        stop, yos, reached = 0, 0, False
        last = len(orders.stops) - 1
        # who is at the last waypoint already has missed the goal, and must move to get there
        there = last == 0 and self._is_near(orders.stops[0])
        while not reached and not self.lost:
            angle, depth = float(orders.angle[stop]), float(orders.depth[stop])
            depth = min(depth, self._depth_in_time(angle))
            if (yos and depth < SHALLOWEST) or yos >= (self.rule.most_yos or math.inf):
                break
            for way in (DIVE, CLIMB):
                aim = Aim(0.0, orders.stops, stop, self.settings.waypoint_radius_m, way == DIVE and not there)
                flown = self._glide(self._trim(way, angle, -max(depth, SHALLOWEST) if way == DIVE else 0.0), aim)
                if flown is None:
                    break
                stop, reached = flown.stop, reached or flown.ended == End.REACHED
            yos += 1
        # the last waypoint stays in the list: who has not come up near it heads for it again
        return Waypoints(orders.stops[stop:], orders.depth[stop:], orders.angle[stop:])

    def _is_near(self, stop: Array) -> bool:
        return math.dist(self._believed, stop) <= self.settings.waypoint_radius_m

    def _depth_in_time(self, angle: float) -> float:
        """Return the depth [m] of the deepest yo that ends before the vehicle must be up; inf without a limit."""
        if self.rule.most_hours is None:
            return math.inf
        left = 3600.0 * self.rule.most_hours - (self.here.t - self._dived_at)
        pace = sum(1.0 / abs(_sink(self.problem.evaluator.polar, way, angle)) for way in (DIVE, CLIMB))
        return left / pace

    def _trim(self, way: int, angle: float, z: float) -> Trim:
        speed = _speed(self.problem.evaluator.polar, way, angle)
        return Trim(angle if way == CLIMB else -angle, 0.0, speed, z)

    def _glide(self, trim: Trim, aim: Aim) -> Glided | None:
        """Fly one glide, with the errors of this leg; return None if the vehicle is lost."""
        settings, evaluator = self.settings, self.problem.evaluator
        turn = self._turn + math.radians(settings.heading_error_deg) * self.random.standard_normal()
        speed = trim.speed * self._faster * (1.0 + settings.speed_error * self.random.standard_normal())
        off = settings.depth_error_m * self.random.standard_normal()
        z = 0.0 if is_up(trim.z) else min(trim.z + off, 0.0)
        climbs = trim.glide_angle > 0
        if (z - self.here.z) * trim.glide_angle <= 0.0:  # the last turn's error has brought it there already
            return Glided(np.empty((0, 4)), int(End.DEPTH), *self._believed, 0.0, 0.0, aim.first, 0.0, 0.0)
        along = math.cos(trim.glide_angle)
        flown = glided(
            evaluator.flow,
            self._ground if climbs else evaluator.terrain,
            self.here,
            z,
            0.0,
            Motion(speed * along, speed * math.sin(trim.glide_angle), turn),
            Belief(*self._believed, trim.speed * along, *self._current),
            aim,
            evaluator.integration.dt,
        )
        self._own = self._own[0] + flown.own_x, self._own[1] + flown.own_y
        self._believed = flown.x, flown.y
        return self._flown(flown, climbs)

    def _flown(self, flown: Glided, climbs: bool) -> Glided | None:
        """Note a glide, what it cost and whether it ended the run."""
        rows = flown.rows
        self.here = _place(rows[-1])
        if len(rows) > 1:
            self.phases.append(_phase(flown))
            self.spent += self.energy.hotel * float(rows[-1, 0] - rows[0, 0]) + self.energy.trim
            pump = self.energy.inflection(rows[0, 3])
            self.spent += float(pump) if climbs and pump is not None else 0.0
        if flown.ended in LOST:
            self.lost = LOST[flown.ended]
        elif flown.ended == End.BLOCKED and (climbs or len(rows) == 1 or self._on_ground()):
            # a dive that meets the seabed's clearance turns, as with an altimeter; nothing else can
            self.lost = "aground"
        self.touched += flown.ended == End.BLOCKED
        return None if self.lost else flown

    def _on_ground(self) -> bool:
        return not allowed(self._ground, self.here.x, self.here.y, self.here.z)

    def _surface(self) -> None:
        """Come up the rest of the way, after a dive that the seabed has cut short, and take a fix."""
        if not is_up(self.here.z):
            polar = self.problem.evaluator.polar
            angle = float(polar.best_angle[CLIMB])
            heading = self.phases[-1].heading if self.phases else 0.0
            if self._glide(self._trim(CLIMB, angle, 0.0), Aim(heading, NOWHERE, 0, 0.0, False)) is None:
                return
        self.surfacings += 1
        time = self.here.t - self._dived_at
        self._fix, before = self._take_fix(), self._fix
        if time > 0.0:
            way = self._fix[0] - before[0] - self._own[0], self._fix[1] - before[1] - self._own[1]
            self._current = float(way[0] / time), float(way[1] / time)
            self._note_dive(before, time)

    def _note_dive(self, start: tuple[float, float], time: float) -> None:
        """Keep what the dive from a fix, which took a `time` [s], has measured."""
        phases = self.phases[self._first_phase :]
        deepest = max((-float(phase.rows[:, 3].min()) for phase in phases), default=0.0)
        if deepest < SHALLOWEST:
            return
        yos = sum(phase.glide_angle < 0.0 for phase in phases)
        when, through = (self._dived_at, self.here.t), math.hypot(*self._own) / time
        dive = Dive(start, self._fix, *when, deepest, max(yos, 1), self._current, through)
        self.dives = (*self.dives, dive)

    # at the surface

    def call(self) -> bool:
        """Drift during a call, and take a fix at its end; return whether the call brings new orders."""
        seconds = 60.0 * self.settings.call_minutes
        if seconds > 0.0:
            evaluator = self.problem.evaluator
            still = Motion(0.0, 0.0, 0.0), Belief(0.0, 0.0, 0.0, 0.0, 0.0), Aim(0.0, NOWHERE, 0, 0.0, False)
            step = evaluator.integration.dt
            drifted = glided(evaluator.flow, self._ground, self.here, 0.0, seconds, *still, step)
            rows = drifted.rows
            self.here = _place(rows[-1])
            self.spent += self.energy.hotel * float(rows[-1, 0] - rows[0, 0])
            if len(rows) > 1:
                self.phases.append(Phase(rows, 0.0, 0.0, 0.0))
            ends = {int(End.OUTSIDE): "left the domain", int(End.BLOCKED): "aground"}
            self.lost = ends.get(drifted.ended, "")
            if self.lost:
                return False
        self._fix = self._take_fix()
        return bool(self.random.random() >= self.settings.call_failure)

    @property
    def fix(self) -> Fix:
        """The last fix, and the current of the last dive."""
        return Fix(*self._fix, self.here.t, self._current, self.dives)

    def _take_fix(self) -> tuple[float, float]:
        off = self.settings.fix_error_m * self.random.standard_normal(2)
        return self.here.x + float(off[0]), self.here.y + float(off[1])


def _place(row: Array) -> Place:
    t, x, y, z = (float(value) for value in row)
    return Place(x, y, z, t)


def _phase(flown: Glided) -> Phase:
    rows = flown.rows
    across, rise = math.hypot(flown.true_x, flown.true_y), float(rows[-1, 3] - rows[0, 3])
    speed = math.hypot(across, rise) / float(rows[-1, 0] - rows[0, 0])
    return Phase(rows, math.atan2(rise, across), math.atan2(flown.true_y, flown.true_x), speed)


def _speed(polar: Polar, way: int, angle: float) -> float:
    """Return the speed [m/s] of a glide angle's magnitude [rad]; the table is linear between its angles."""
    angles = np.linspace(polar.shallowest[way], polar.steepest[way], polar.speed.shape[1])
    return float(np.interp(angle, angles, polar.speed[way]))


def _sink(polar: Polar, way: int, angle: float) -> float:
    return _speed(polar, way, angle) * math.sin(angle)


def _without_clearance(terrain: Terrain) -> Terrain:
    """Return the ground itself: a vehicle above it floats, even where it is too shallow for a dive."""
    if isinstance(terrain, Seabed):
        return terrain._replace(clearance=0.0)
    return OpenWater(-math.inf)
