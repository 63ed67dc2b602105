"""Analytic flows of a scenario: checks their values and makes the flows that the kernels read."""

import itertools
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..base.checks import Range, check_range, require_positive
from ..base.settings import require
from ..kernels import flow as kernel

ALWAYS = (-math.inf, math.inf)
BEYOND = 50.0
"""A path may leave the domain's depths by this distance [m]; the bound of the speed holds there too."""


@dataclass(frozen=True, kw_only=True)
class AnalyticFlow(ABC):
    """Settings that every analytic flow has: where and when the flow is known, and `sampled`.

    `x`, `y` [m] are the box in which the flow is known. A flow that changes is known at `times` [s], from the
    first to the last; if they are left out, at all times. If `sampled` = [dx, dy, dz] [m] is given, the flow is
    evaluated once on a grid with at most these spacings and interpolated trilinearly.
    """

    x: Range | None = None
    y: Range | None = None
    times: Range | None = None
    sampled: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        for name, bounds in (("x", self.x), ("y", self.y), ("times", self.times)):
            if bounds is not None:
                check_range(bounds, f"flow.{name}")
        for spacing in self.sampled or ():
            require_positive(spacing, "flow.sampled")
        self.check()

    def check(self) -> None:  # noqa: B027  (many flows have nothing to check)
        """Raise InputError if a value of this flow is not usable."""

    @abstractmethod
    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields; `depth` [m, downward] is the range that the plan uses.

        The fields of `Extent` may be left out where the flow has no bounds of its own.
        """

    def kernel(self, z: Range) -> kernel.Flow:
        """Return the flow as the kernels read it; `z` [m, upward] is the range of heights that the plan uses."""
        kind, values = self.fields((-z[1], -z[0]))
        (x_lo, x_hi), (y_lo, y_hi) = self.x or ALWAYS, self.y or ALWAYS
        t_lo, t_hi = self.times or ALWAYS
        usual = {"x_lo": x_lo, "x_hi": x_hi, "y_lo": y_lo, "y_hi": y_hi, "t_lo": t_lo, "t_hi": t_hi}
        values = usual | values
        known = kernel.Extent(**{name: values.pop(name) for name in kernel.Extent._fields})
        result: kernel.Flow = kind(**values, extent=known)
        fits = self.times is None or kernel.cycle(result) > 0
        require(fits, "`flow.times` is for a flow that changes, and this one is steady; leave it out")
        return result


@dataclass(frozen=True)
class Uniform(AnalyticFlow):
    """The same current everywhere: u east, v north [m/s]."""

    u: float
    v: float

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields."""
        speed = math.hypot(self.u, self.v)
        return kernel.Uniform, {"u": self.u, "v": self.v, "max_speed": speed, "length_scale": math.inf}


@dataclass(frozen=True)
class Vortex:
    """psi = speed R sqrt(e) exp(-r^2 / 2R^2) exp(-((depth - depth_0) / H)^2); > 0 counter-clockwise.

    Its centre is at x, y [m] at t = 0 and moves by `drift` [m/s] along x and y.
    """

    x: float
    y: float
    radius: float
    speed: float
    depth: float = 0.0
    thickness: float | None = None
    drift: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        require_positive(self.radius, "flow.vortex.radius")
        if self.thickness is not None:
            require_positive(self.thickness, "flow.vortex.thickness")


@dataclass(frozen=True)
class Vortices(AnalyticFlow):
    """A sum of vortices; a vortex without `thickness` is the same at all depths."""

    vortex: tuple[Vortex, ...]

    def check(self) -> None:
        """Raise InputError if there is no vortex."""
        require(len(self.vortex) > 0, "`flow.vortex` must hold at least one vortex; got none")

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields."""
        columns = {
            name: np.array([getattr(vortex, name) for vortex in self.vortex])
            for name in ("x", "y", "radius", "speed", "depth")
        }
        columns["thickness"] = np.array([vortex.thickness or math.inf for vortex in self.vortex])
        drifts = np.array([vortex.drift for vortex in self.vortex])
        # vortices that move alike keep their distances
        together = bool((drifts == drifts[0]).all())
        bound = _speed_bound(columns, depth) if together else _speed_bound_anywhere(columns, depth)
        values = columns | {"max_speed": bound, "length_scale": float(columns["radius"].min())}
        if not drifts.any():
            return kernel.Vortices, values
        drift_x, drift_y = (np.ascontiguousarray(drifts[:, n]) for n in range(2))
        return kernel.MovingVortices, values | {"drift_x": drift_x, "drift_y": drift_y}


def _shares_by_depth(vortex: dict[str, Array], depth: Range, slices: int = 8) -> list[Array]:
    """Return for each slice of the depths an upper bound (n,) of each vortex's share of its peak speed."""
    # a path may end deeper or shallower than its nodes, by a tolerance and a step
    edges = np.linspace(depth[0] - BEYOND, depth[1] + BEYOND, slices + 1)
    shares = []
    for top, bottom in itertools.pairwise(edges):
        off = np.maximum(np.maximum(top - vortex["depth"], vortex["depth"] - bottom), 0) / vortex["thickness"]
        shares.append(np.exp(-off * off))
    return shares


def _speed_bound_anywhere(vortex: dict[str, Array], depth: Range) -> float:
    """Return an upper bound of the total speed [m/s] of vortices that may meet: the sum of their peaks."""
    return max(float(share @ np.abs(vortex["speed"])) for share in _shares_by_depth(vortex, depth)) * (1 + 1e-12)


def _speed_bound(vortex: dict[str, Array], depth: Range, cells: int = 96) -> float:
    """Return an upper bound of the total speed [m/s].

    The domain is divided into cells. The bound of a cell is the sum of the maxima of all vortices in it.
    """
    radius, speed = vortex["radius"], np.abs(vortex["speed"])

    def rim(r: Array) -> Array:
        return np.asarray(speed[:, None, None] * r * np.exp(0.5 - 0.5 * r * r))

    edges = [np.linspace((vortex[a] - 3 * radius).min(), (vortex[a] + 3 * radius).max(), cells + 1) for a in "xy"]
    # the nearest and the farthest point of each cell: their distances from each centre, in radii
    spans = []
    for axis, line in zip("xy", edges, strict=True):
        low = (line[:-1] - vortex[axis][:, None]) / radius[:, None]
        high = (line[1:] - vortex[axis][:, None]) / radius[:, None]
        far = np.maximum(np.abs(low), np.abs(high))
        near = np.where((low <= 0) & (high >= 0), 0.0, np.minimum(np.abs(low), np.abs(high)))
        spans.append((near, far))
    near = np.hypot(spans[0][0][:, :, None], spans[1][0][:, None, :])
    far = np.hypot(spans[0][1][:, :, None], spans[1][1][:, None, :])
    inside = np.where((near <= 1) & (far >= 1), speed[:, None, None], np.maximum(rim(near), rim(far)))
    # outside the box the distance to every centre is at least three radii
    outside = float(rim(np.full((radius.size, 1, 1), 3.0)).sum())
    shares = _shares_by_depth(vortex, depth)
    worst = max(float((share[:, None, None] * inside).sum(axis=0).max()) for share in shares)
    return max(worst, outside) * (1 + 1e-12)


@dataclass(frozen=True)
class DoubleGyre(AnalyticFlow):
    """Shadden's double gyre: psi = A sin(pi f) sin(pi y), f = a x^2 + (1 - 2a) x, a = epsilon sin(2 pi t/T).

    x and y in units of `length` [m] from `origin`, over [0, 2] x [0, 1]; `amplitude` A [m/s]: the greatest
    speed of the steady field is pi A. The published case is A = 0.1, epsilon = 0.25, T = 10, length = 1
    (Shadden, Lekien, Marsden 2005, Physica D 212); epsilon = 0 is steady. `period` T [s].
    """

    amplitude: float
    length: float
    epsilon: float
    period: float = field(
        metadata={"missing": "the period [s] with which the gyres swing; any value above 0 if epsilon is 0"}
    )
    origin: tuple[float, float] = (0.0, 0.0)
    cells = 2

    def check(self) -> None:
        """Raise InputError unless length, period and epsilon are usable.

        Length and period are positive; 0 <= epsilon < 1/2, so that f maps the box onto itself.
        """
        require_positive(self.length, "flow.length")
        require_positive(self.period, "flow.period")
        require(0 <= self.epsilon < 0.5, f"`flow.epsilon` must be in [0, 0.5); got {self.epsilon:g}")

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields; the flow ends at the gyres' walls, which are streamlines."""
        x, y = self.origin
        box_x, box_y = self.x or (x, x + self.cells * self.length), self.y or (y, y + self.length)
        stretch = 1 + 2 * self.epsilon * max(abs((b - x) / self.length - 1) for b in box_x)
        return kernel.Gyre, {
            "x_origin": x,
            "y_origin": y,
            "length": self.length,
            "amplitude": self.amplitude,
            "epsilon": self.epsilon,
            "period": self.period,
            "x_lo": box_x[0],
            "x_hi": box_x[1],
            "y_lo": box_y[0],
            "y_hi": box_y[1],
            "max_speed": math.pi * abs(self.amplitude) * stretch,
            "length_scale": self.length / 4,
        }


@dataclass(frozen=True)
class SingleGyre(DoubleGyre):
    """One steady gyre over [0, 1] x [0, 1]: psi = A sin(pi x) sin(pi y), lengths in units of `length`."""

    epsilon: float = field(default=0.0, init=False)
    period: float = field(default=1.0, init=False)
    cells = 1


@dataclass(frozen=True)
class Rankine(AnalyticFlow):
    """A Rankine vortex about (x_centre, y_centre): solid rotation within `radius` [m], `speed` at its rim."""

    x_centre: float
    y_centre: float
    radius: float
    speed: float

    def check(self) -> None:
        """Raise InputError unless the radius is positive."""
        require_positive(self.radius, "flow.radius")

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields."""
        return kernel.Rankine, {
            "x": self.x_centre,
            "y": self.y_centre,
            "radius": self.radius,
            "speed": self.speed,
            "max_speed": abs(self.speed),
            "length_scale": self.radius / 2,
        }


@dataclass(frozen=True)
class Jet(AnalyticFlow):
    """A uniform jet along x: `speed` [m/s] in a band of `width` [m] about `y_centre`.

    The water beside the band is still.
    """

    y_centre: float
    width: float
    speed: float

    def check(self) -> None:
        """Raise InputError unless the width is positive."""
        require_positive(self.width, "flow.width")

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields."""
        return kernel.Jet, {
            "y": self.y_centre,
            "width": self.width,
            "speed": self.speed,
            "max_speed": abs(self.speed),
            "length_scale": self.width / 8,
        }


@dataclass(frozen=True)
class TidalJet(AnalyticFlow):
    """A jet along x that turns with the tide: u = speed cos(2 pi (t - peak) / period) exp(-(2 dy / width)^2).

    dy [m] is the distance from `y_centre`. At time `peak` [s] the current is `speed` [m/s] in the middle; half a
    `period` [s] later it is as fast the other way. Give the box's `y` as the sides of a strait.
    """

    y_centre: float
    width: float
    speed: float
    period: float
    peak: float = 0.0

    def check(self) -> None:
        """Raise InputError unless width and period are positive."""
        require_positive(self.width, "flow.width")
        require_positive(self.period, "flow.period")

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields."""
        return kernel.TidalJet, {
            "y": self.y_centre,
            "width": self.width,
            "speed": self.speed,
            "period": self.period,
            "peak": self.peak,
            "max_speed": abs(self.speed),
            "length_scale": self.width / 4,
        }


@dataclass(frozen=True)
class Upwelling(AnalyticFlow):
    """A current with a vertical part: u, v and w [m/s, upward] at z = 0 and x = `x_centre`, the same everywhere.

    With `stretch` [1/s] the water is stretched along z and squeezed along x: u - stretch (x - x_centre) and
    w + stretch z, free of divergence; then the box's `x` must be given.
    """

    u: float
    v: float
    w: float
    stretch: float = 0.0
    x_centre: float = 0.0

    def check(self) -> None:
        """Raise InputError if the flow stretches and has no sides."""
        bounded = self.stretch == 0 or self.x is not None
        require(
            bounded, "`flow.x` must be given where `flow.stretch` is not 0: the speed grows with the distance"
        )

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields."""
        ends = (0.0, 0.0) if self.x is None else self.x
        fastest = max(abs(self.u - self.stretch * (end - self.x_centre)) for end in ends)
        heights = -(depth[1] + BEYOND), -(depth[0] - BEYOND)
        return kernel.Upwelling, {
            "u": self.u,
            "v": self.v,
            "w": self.w,
            "x": self.x_centre,
            "stretch": self.stretch,
            "max_rise": max(abs(self.w + self.stretch * z) for z in heights),
            "max_speed": math.hypot(fastest, self.v),
            "length_scale": math.inf if self.stretch == 0 else (ends[1] - ends[0]) / 8,
        }


@dataclass(frozen=True)
class Rolls(AnalyticFlow):
    """A row of convection cells: w = -w_max cos(pi (x - x_centre) / width) sin(pi z / depth), u by continuity.

    The water rises and sinks by turns every `width` [m]; `depth` [m] is that of the cells. `w` [m/s] is the
    greatest vertical speed, upward at `x_centre`. u is at most w width / depth, at the surface and at the bottom.
    """

    w: float
    width: float
    depth: float
    x_centre: float = 0.0

    def check(self) -> None:
        """Raise InputError unless width and depth are positive."""
        require_positive(self.width, "flow.width")
        require_positive(self.depth, "flow.depth")

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields."""
        return _rolls(self.w, self.width, self.depth, self.x_centre, 0.0)


@dataclass(frozen=True)
class InternalWave(AnalyticFlow):
    """An internal wave that travels along x: w = -w_max cos(2 pi (dx / length - t / period)) sin(m z).

    dx = x - x_centre; m = pi mode / depth: at the surface and at `depth` [m] there is no vertical current. u and
    w come from one stream function in the vertical plane, so the wave is free of divergence. `w` [m/s] is the
    greatest vertical speed; the wave moves towards +x by its `length` [m] in a `period` [s]. u is at most
    w mode length / (2 depth).
    """

    w: float
    length: float
    depth: float
    period: float
    mode: int = 1
    x_centre: float = 0.0

    def check(self) -> None:
        """Raise InputError unless length, depth, period and mode are positive."""
        for name in ("length", "depth", "period"):
            require_positive(getattr(self, name), f"flow.{name}")
        require(self.mode >= 1, f"`flow.mode` must be at least 1; got {self.mode}")

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields."""
        drift = self.length / self.period
        return _rolls(self.w, self.length / 2, self.depth / self.mode, self.x_centre, drift)


def _rolls(w: float, width: float, depth: float, x: float, drift: float) -> tuple[type, dict[str, Any]]:
    """Return cells of a width and a depth [m] that move along x at `drift` [m/s], as the kernels read them."""
    return kernel.Rolls, {
        "x": x,
        "w": w,
        "across": math.pi / width,
        "down": math.pi / depth,
        "drift": drift,
        "max_rise": abs(w),
        "max_speed": abs(w) * width / depth,
        "length_scale": min(width, depth) / 2,
    }


@dataclass(frozen=True)
class Abc(AnalyticFlow):
    """The flow of Arnold, Beltrami and Childress, whose paths are chaotic: a hard test.

    u = a sin(kz) + c cos(ky), v = b sin(kx) + a cos(kz), w = c sin(ky) + b cos(kx); k = 2 pi / length.

    `a`, `b`, `c` [m/s], `length` [m].
    """

    a: float
    b: float
    c: float
    length: float

    def check(self) -> None:
        """Raise InputError unless the length is positive."""
        require_positive(self.length, "flow.length")

    def fields(self, depth: Range) -> tuple[type, dict[str, Any]]:
        """Return the kernel's class and its fields."""
        a, b, c = abs(self.a), abs(self.b), abs(self.c)
        return kernel.Abc, {
            "a": self.a,
            "b": self.b,
            "c": self.c,
            "number": 2 * math.pi / self.length,
            "max_rise": b + c,
            "max_speed": math.hypot(a + c, b + a),
            "length_scale": self.length / 8,
        }


FLOWS: dict[str, type[AnalyticFlow]] = {
    "uniform": Uniform,
    "vortices": Vortices,
    "double-gyre": DoubleGyre,
    "single-gyre": SingleGyre,
    "rankine": Rankine,
    "jet": Jet,
    "tidal-jet": TidalJet,
    "upwelling": Upwelling,
    "convection-cells": Rolls,
    "internal-wave": InternalWave,
    "abc": Abc,
}
