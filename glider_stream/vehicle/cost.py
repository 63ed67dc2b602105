"""The cost of legs: travel time or energy."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array
from ..base.settings import require
from ..kernels import cost

GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]."""


@dataclass(frozen=True)
class TravelTime:
    """A leg costs its travel time [s]; an inflection costs nothing."""

    unit: ClassVar[str] = "s"

    def kernel(self) -> cost.CostRates:
        """Return the cost of a second and of a leg, for the kernels; the fastest control is the cheapest."""
        return cost.CostRates(1.0, 0.0)

    def inflection(self, z: ArrayLike) -> Array | None:
        """Return the cost of a turn from dive to climb at heights z [m]; None if turns are free."""
        return None


@dataclass(frozen=True, kw_only=True)
class Energy:
    """A leg costs the energy that the vehicle uses [J]: E = P T + E_trim, and E_pump at an inflection.

    `hotel` P [W]. `trim` E_trim [J]: the change of trim at each leg. E_pump = rho g |z| dV / eta(z): `volume` dV
    [cc] is pumped against the pressure at the depth |z| where a dive turns into a climb; `efficiency` eta: pairs
    of depth [m] and share, linear between them and constant beyond; `density` rho [kg/m^3].
    """

    unit: ClassVar[str] = "J"
    hotel: float
    trim: float
    volume: float
    efficiency: tuple[tuple[float, float], ...]
    density: float
    note: str = ""

    def __post_init__(self) -> None:
        for name in ("hotel", "trim", "volume", "density"):
            value = getattr(self, name)
            require(value >= 0, f"`cost.{name}` must be at least 0; got {value:g}")
        free = f"`cost.hotel` must be above 0 W, so that time costs something; got {self.hotel:g}"
        require(self.hotel > 0, free)
        require(len(self.efficiency) > 0, "`cost.efficiency` must be pairs of depth and share; got none")
        depth, share = zip(*self.efficiency, strict=True)
        require(bool((np.diff(depth) > 0).all()), f"the depths of `cost.efficiency` must rise; got {list(depth)}")
        within = min(share) > 0 and max(share) <= 1
        require(within, f"the shares of `cost.efficiency` must be above 0, at most 1; got {list(share)}")

    def kernel(self) -> cost.CostRates:
        """Return the rate [W] and the fixed cost [J] of a leg, for the kernels; a cost rises with time."""
        return cost.CostRates(float(self.hotel), float(self.trim))

    def inflection(self, z: ArrayLike) -> Array | None:
        """Return the pump's energy [J] where a dive becomes a climb at heights z [m]: rho g |z| dV / eta(z)."""
        depth = np.abs(np.asarray(z, np.float64))
        known, shares = (np.array(column) for column in zip(*self.efficiency, strict=True))
        share = np.interp(depth, known, shares)
        return np.asarray(self.density * GRAVITY * depth * self.volume * 1e-6 / share)


Cost = TravelTime | Energy
PRESETS: dict[str, dict[str, Any]] = {
    "slocum": {
        "hotel": 0.5,
        "trim": 0.0,
        "volume": 500.0,
        "efficiency": [[100.0, 0.15], [1000.0, 0.45]],
        "density": 1025.0,
        "note": "hotel load of the vehicle alone, 0.5 W, without its sensors; 500 cc from full to empty; pump "
        "0.1-0.2 at 100 m and 0.4-0.5 at 1000 m from memory; no figure for a change of trim: set yours",
    },
}


def energy_from_table(table: dict[str, Any]) -> dict[str, Any]:
    """Return the keys of a [cost] table of kind "energy"; its `preset` gives the missing values."""
    given = dict(table)
    name = given.pop("preset", None)
    if name is None:
        return given
    known = isinstance(name, str) and name in PRESETS
    require(known, f"`cost.preset` = {name!r} is not known; choose from: {', '.join(PRESETS)}")
    return PRESETS[name] | given
