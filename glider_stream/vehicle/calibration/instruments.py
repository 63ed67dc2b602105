"""The records that a vehicle's instruments would make; dives are compared with them."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.arrays import Array
from ..models import Glider, Seaglider, SteadyGlide
from .dives import Dives

DENSITY = 1024.0
"""The density of sea water [kg/m^3] that turns a volume into a mass if the model does not give one."""
STEEP = (89.0, 89.9)
"""A range of glide angles [degrees] that can be flown with any coefficients that a fit may try."""
MASS_NODES = 3
"""If each dive has its own volume, a glider is evaluated only at this many volumes.

A polynomial in ln(volume) gives the values between them.
"""
NEAREST_STEPS = 3
"""This many steps find the point of the vehicle's curve that is nearest to a dive."""


def per_volume(base: Glider) -> float:
    """Return the net mass for each cc off neutral [kg]."""
    return 1e-6 * (base.density if isinstance(base, Seaglider) else DENSITY)


def vehicle(base: Glider, values: dict[str, float], dive: float, climb: float, **more: Any) -> Glider:
    """Return the base glider with other coefficients and these volumes [cc] off neutral in dive and climb."""
    angles: dict[str, Any] = {"angles": STEEP, **values, **more}
    if isinstance(base, Seaglider):
        return replace(base, dive_volume=dive, climb_volume=climb, **angles)
    assert isinstance(base, SteadyGlide)
    unit = per_volume(base)
    return replace(base, offset=climb * unit, ballast_max=(dive + climb) * unit, **angles)


class Flown:
    """The records of dives (n,) at glide angles; each dive has its own volume [cc] or that of its phase."""

    def __init__(self, base: Glider, values: dict[str, float], volumes: Array) -> None:
        self.volumes = volumes
        nodes = np.unique(volumes)
        if nodes.size > MASS_NODES:
            # Chebyshev's nodes are enough: the speed is nearly a power of the volume
            low, high = np.log(nodes[[0, -1]])
            place = np.cos(np.pi * (np.arange(MASS_NODES) + 0.5) / MASS_NODES)
            nodes = np.exp(0.5 * (low + high) + 0.5 * (high - low) * place)
        logs, at = np.log(nodes), np.log(volumes)
        self.weight = np.ones((nodes.size, volumes.size))
        for n, m in np.ndindex(nodes.size, nodes.size):
            if n != m:
                self.weight[n] *= (at - logs[m]) / (logs[n] - logs[m])
        self.gliders = [vehicle(base, values, volume, volume) for volume in nodes]
        # a little inside the limits, so that rounding leaves a glide
        self.flattest = max(abs(glider.limits[0]) for glider in self.gliders) + 1e-9

    def within(self, angle: Array) -> Array:
        """Return the nearest angles that can be flown."""
        return np.clip(angle, self.flattest, math.radians(STEEP[1]))

    def speed(self, angle: Array) -> Array:
        """V [m/s]."""
        speeds = [glider.speed(-angle) for glider in self.gliders]
        return np.asarray(np.exp((self.weight * np.log(speeds)).sum(axis=0)))

    def attack(self, angle: Array) -> Array:
        """Return the angle of attack [rad]."""
        attacks = [glider.angle_of_attack(-angle) for glider in self.gliders]
        return np.asarray((self.weight * attacks).sum(axis=0))

    def recorded(self, kinds: Sequence[str], angle: Array) -> Array:
        """Return what the instruments would record, (n, kinds)."""
        speed = self.speed(angle)
        records = {"vertical": speed * np.sin(angle), "horizontal": speed * np.cos(angle), "glide_angle": angle}
        if "pitch" in kinds:
            records["pitch"] = angle - self.attack(angle)
        return np.stack([records[kind] for kind in kinds], axis=1)

    def angle(self, dives: Dives) -> Array:
        """Return the recorded glide angles [rad], or those of the recorded pitch; they stay within `within`."""
        if dives.horizontal is not None:
            return self.within(np.arctan2(dives.vertical, dives.horizontal))
        if dives.glide_angle is not None:
            return self.within(dives.glide_angle)
        assert dives.pitch is not None
        # near the limit of a steady glide alpha grows and the pitch too: of two angles the steeper is flown
        middle = self.gliders[len(self.gliders) // 2]
        table = np.linspace(self.flattest, math.radians(STEEP[1]), 500)
        nose = table - np.abs(middle.angle_of_attack(-table))
        first = int(nose.argmin())
        angle = self.within(np.interp(dives.pitch, nose[first:], table[first:]))
        for _ in range(4):
            angle = self.within(dives.pitch + self.attack(angle))
        return angle


def distances(model: Flown, kinds: Sequence[str], dives: Dives, scale: Array) -> tuple[Array, Array]:
    """Return the distance of each dive from the vehicle's curve, (n, kinds), in `scale`, and the tangents there.

    The true glide angle of a dive is as unknown as its speed. So the nearest point of the curve is taken: errors
    of every instrument count, and none biases the fit.
    """
    recorded = np.stack([getattr(dives, kind) for kind in kinds], axis=1)
    angle, step = model.angle(dives), 1e-5
    for _ in range(NEAREST_STEPS):
        here = model.recorded(kinds, angle)
        tangent = (model.recorded(kinds, angle + step) - here) / step / scale
        off = (recorded - here) / scale
        length = np.maximum((tangent**2).sum(axis=1), 1e-12)
        angle = model.within(angle + np.clip((tangent * off).sum(axis=1) / length, -0.1, 0.1))
    return (recorded - model.recorded(kinds, angle)) / scale, tangent
