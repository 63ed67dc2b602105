"""Gliders: drag models for the scenario's [glider] table.

Signs: the glide angle gamma < 0 dives, > 0 climbs; the net mass is > 0 if heavy, < 0 if light; the angle of
attack is > 0 in a dive and < 0 in a climb, so that pitch = gamma + alpha is shallower than the path. A new model
is one dataclass and one row of MODELS.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.control import CLIMB, DIVE
from .polar import polar

SOLVE_TOLERANCE = 1e-13  # relative, of q
SOLVE_STEPS = 100  # 4 to 7 steps are enough in a usable range, 20 within 1e-12 rad of the limit


@dataclass(frozen=True, kw_only=True)
class Glider(ABC):
    """The base of all models: `angles` [degrees], the range of |gamma|, and `gravity` [m/s^2]."""

    angles: tuple[float, float]
    gravity: float
    name: str = "glider"
    note: str = ""

    def __post_init__(self) -> None:
        low, high = self.angles
        for phase, limit in zip(("dive", "climb"), np.degrees(np.abs(self.limits)), strict=True):
            require(
                limit < low < high < 90.0,
                f"`glider.angles` must rise from above {limit:.4f} degrees, the limit of a steady {phase}, "
                f"to below 90; got {[low, high]}",
            )

    def __str__(self) -> str:
        table = polar(self)
        phases = []
        for row in (DIVE, CLIMB):
            slow, fast = table.speed[row, [0, -1]] * np.sin([table.shallowest[row], table.steepest[row]])
            angle = math.degrees(table.best_angle[row])
            best = f"{table.best_horizontal[row]:.3f} m/s horizontal at {angle:.1f} degrees"
            phases.append(f"{best}, {slow:.3f} to {fast:.3f} m/s vertical")
        same = phases[DIVE] == phases[CLIMB]
        return f"{self.name}: " + (phases[DIVE] if same else f"dive {phases[DIVE]}; climb {phases[CLIMB]}")

    def _positive(self, *names: str) -> None:
        for name in names:
            value = getattr(self, name)
            require(value > 0.0, f"`glider.{name}` must be greater than 0; got {value}")

    def speed(self, gamma: Array | float) -> Array:
        """Return the speed through water V [m/s] at the signed glide angle [rad]; NaN without a steady glide."""
        return self._glide(self._feasible(gamma))[0]

    def angle_of_attack(self, gamma: Array | float) -> Array:
        """Return the angle of attack alpha [rad] at the signed glide angle [rad]; NaN without a steady glide."""
        return self._glide(self._feasible(gamma))[1]

    def net_mass(self, gamma: Array | float) -> Array:
        """Return the net mass m0 [kg] of the phase: > 0 in a dive, < 0 in a climb."""
        return np.where(np.asarray(gamma) < 0.0, *self._net_masses())

    @cached_property
    def limits(self) -> tuple[float, float]:
        """The `feasible_limits`, computed once, since a fit needs them some thousand times."""
        return self.feasible_limits()

    @abstractmethod
    def feasible_limits(self) -> tuple[float, float]:
        """Return two limits [rad] of gamma: dives lie below the first and climbs above the second.

        No steady glide exists between them.
        """

    @abstractmethod
    def _net_masses(self) -> tuple[float, float]:
        """Return the net mass [kg] in a dive and in a climb."""

    @abstractmethod
    def _glide(self, gamma: Array) -> tuple[Array, Array]:
        """Return V [m/s] and alpha [rad] at feasible angles."""

    def _feasible(self, gamma: Array | float) -> Array:
        """Return the angles [rad], with NaN where no steady glide exists."""
        gamma = np.asarray(gamma, dtype=np.float64)
        dive, climb = self.limits
        glides = ((gamma < dive) | (gamma > climb)) & (np.abs(gamma) <= 0.5 * math.pi)
        return np.where(glides, gamma, np.nan)


@dataclass(frozen=True, kw_only=True)
class SteadyGlide(Glider):
    """Leonard and Graver's steady glide (2001), the model of the source paper (arXiv 2005.03834).

    The forces are D V^2 and L V^2 with D = K_D0 + K_D alpha^2, L = K_L0 + K_L alpha, alpha in radians: `drag_0`
    K_D0, `lift_0` K_L0 [kg/m]; `drag_alpha2` K_D [kg/(m rad^2)]; `lift_alpha` K_L [kg/(m rad)].

    The ballast is full in a dive and empty in a climb: m0 = `ballast_max` - `offset` and m0 = -`offset` [kg].
    `offset` = m - m_h - m_bar is the displaced mass less all mass that is not ballast.
    """

    drag_0: float
    drag_alpha2: float
    lift_0: float
    lift_alpha: float
    offset: float
    ballast_max: float

    def __post_init__(self) -> None:
        self._positive("gravity", "drag_0", "drag_alpha2", "lift_alpha")
        masses = f"`glider.offset` = {self.offset} kg, `glider.ballast_max` = {self.ballast_max} kg"
        require(
            self.offset > 0.0,
            f"the climb has no speed: with empty ballast the glider is not light ({masses}); give a larger "
            "offset",
        )
        require(
            self.offset < self.ballast_max,
            f"the dive has no speed: with full ballast the glider is not heavy ({masses}); give more ballast",
        )
        super().__post_init__()

    def feasible_limits(self) -> tuple[float, float]:
        """Return lim± = atan(2 (K_D/K_L) (K_L0/K_L ± sqrt((K_L0/K_L)^2 + K_D0/K_D))) [rad]."""
        lift = self.lift_0 / self.lift_alpha
        root = math.sqrt(lift**2 + self.drag_0 / self.drag_alpha2)
        scale = 2.0 * self.drag_alpha2 / self.lift_alpha
        return math.atan(scale * (lift - root)), math.atan(scale * (lift + root))

    def _net_masses(self) -> tuple[float, float]:
        return self.ballast_max - self.offset, -self.offset

    def _glide(self, gamma: Array) -> tuple[Array, Array]:
        """Return V = sqrt(-m0 g sin(gamma) / D) and alpha, the smaller root of tan(gamma) = -D/L.

        The paper's forms lose digits by cancellation. Here V = sqrt(m0 g / (L cos - D sin)) and alpha = (1/2)
        (K_L/K_D) tan(gamma) (-1 + sqrt(1 - x)) with x = 4 (K_D/K_L^2) cot(gamma) F, F = K_D0 cot(gamma) + K_L0.
        """
        cot = np.cos(gamma) / np.sin(gamma)
        force = self.drag_0 * cot + self.lift_0
        x = 4.0 * self.drag_alpha2 / self.lift_alpha**2 * cot * force
        alpha = -2.0 * force / (self.lift_alpha * (1.0 + np.sqrt(np.maximum(1.0 - x, 0.0))))
        drag = self.drag_0 + self.drag_alpha2 * alpha**2
        return np.sqrt(-self.net_mass(gamma) * self.gravity * np.sin(gamma) / drag), alpha


@dataclass(frozen=True, kw_only=True)
class Seaglider(Glider):
    """The University of Washington's Seaglider (Eriksen et al. 2001; basestation3).

    Lift = l^2 q a alpha, drag = l^2 q (b q^s + c alpha^2) [N], q = rho0 V^2 / 2 [Pa], alpha in **degrees**:
    `lift` a [1/degree], `drag` b [Pa^-s], `drag_exponent` s, `induced_drag` c [1/degree^2], `length` l [m],
    `density` rho0 [kg/m^3]. `dive_volume` and `climb_volume` [cc] are the volumes below and above neutral
    buoyancy.
    """

    lift: float
    drag: float
    induced_drag: float
    drag_exponent: float
    length: float
    density: float
    dive_volume: float
    climb_volume: float

    def __post_init__(self) -> None:
        self._positive("gravity", "lift", "drag", "induced_drag", "length", "density")
        exponent = self.drag_exponent
        require(exponent > -1.0, f"`glider.drag_exponent` must be greater than -1; got {exponent}")
        for phase, volume in (("dive", self.dive_volume), ("climb", self.climb_volume)):
            require(
                volume > 0.0,
                f"the {phase} has no speed: `glider.{phase}_volume` must be greater than 0 cc; got {volume}",
            )
        super().__post_init__()

    def _net_masses(self) -> tuple[float, float]:
        return 1e-6 * self.density * self.dive_volume, -1e-6 * self.density * self.climb_volume

    def _forces(self, gamma: Array) -> tuple[Array, Array]:
        """Return drag and lift [N] that balance the weight W: -W sin(gamma) and W cos(gamma)."""
        weight = self.net_mass(gamma) * self.gravity
        return -weight * np.sin(gamma), weight * np.cos(gamma)

    def _terms(self, lift: Array) -> tuple[float, Array]:
        """Return B and C of drag = B q^(1+s) + C / q, with alpha = lift / (l^2 a q) inserted."""
        area = self.length**2
        return area * self.drag, self.induced_drag * (lift / self.lift) ** 2 / area

    def feasible_limits(self) -> tuple[float, float]:
        """Return the limits [rad]: angles where the drag is (2 + s) B q^(1+s) at q^(2+s) = C / (B (1 + s)).

        There the drag equals its minimum.
        """
        power = 1.0 + self.drag_exponent
        angles = np.array([[0.0, 0.0], [0.5 * math.pi, 0.5 * math.pi]])
        for _ in range(60):
            middle = np.array([-0.5, 0.5]) * angles.sum(axis=0)
            drag, lift = self._forces(middle)
            base, induced = self._terms(lift)
            least = (1.0 + power) * base * (induced / (base * power)) ** (power / (1.0 + power))
            angles[np.where(drag < least, 0, 1), [DIVE, CLIMB]] = np.abs(middle)
        return -float(angles[1, DIVE]), float(angles[1, CLIMB])

    def _glide(self, gamma: Array) -> tuple[Array, Array]:
        """Return V = sqrt(2 q / rho0) and alpha = lift / (l^2 a q).

        q is the larger root of B q^(1+s) + C / q = drag.
        """
        drag, lift = self._forces(gamma)
        base, induced = self._terms(lift)
        power = 1.0 + self.drag_exponent
        # the function is convex in x = ln q; Newton's steps from beyond the larger root cannot pass it
        x = np.log(drag / base) / power
        for _ in range(SOLVE_STEPS):
            parasite, vortex = base * np.exp(power * x), induced * np.exp(-x)
            step = (parasite + vortex - drag) / (power * parasite - vortex)
            x = x - step
            if not np.any(np.abs(step) > SOLVE_TOLERANCE):
                break
        pressure = np.exp(x)
        alpha = np.radians(lift / (self.length**2 * self.lift * pressure))
        return np.sqrt(2.0 * pressure / self.density), alpha


MODELS: dict[str, type[Glider]] = {"steady-glide": SteadyGlide, "seaglider": Seaglider}
