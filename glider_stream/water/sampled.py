"""Analytic flows sampled once on a grid, and the error of the grid."""

import math
from functools import partial

import numpy as np

from ..base.arrays import Array
from ..base.checks import Range
from ..base.settings import require
from ..base.threads import in_parallel
from ..kernels import flow as kernel
from .inspect import is_steady

LINES_AT_ONCE = 8
"""A thread evaluates this many lines of the grid at a time."""

MAX_SAMPLES = 100_000_000
"""The largest grid [points] that `sampled` may make; it takes 1.6 GB."""


def sample_flow(
    flow: kernel.Flow, spacing: tuple[float, float, float], x: Range, y: Range, z: Range
) -> kernel.Grid | kernel.RisingGrid:
    """Return the flow on an even grid over a box [m], interpolated trilinearly.

    `spacing` [m] is the largest spacing along x, y and z.
    """
    require(is_steady(flow), "`flow.sampled` needs a steady flow; this one changes with time")
    known = flow.extent
    box = [(max(x[0], known.x_lo), min(x[1], known.x_hi)), (max(y[0], known.y_lo), min(y[1], known.y_hi)), z]
    points = [(float(hi) - float(lo)) / step + 1 for (lo, hi), step in zip(box, spacing, strict=True)]
    require(
        math.prod(points) <= MAX_SAMPLES,
        f"`flow.sampled` = {list(spacing)} makes {math.prod(points):.3g} points, "
        f"more than {MAX_SAMPLES:,}; widen it",
    )
    counts = [max(2, math.ceil(n - 1e-9)) for n in points]
    lines = [np.linspace(lo, hi, n) for (lo, hi), n in zip(box, counts, strict=True)]
    rises = kernel.rises(flow)
    values = np.empty((counts[2], counts[0], counts[1], 4 if rises else 2))
    sample = kernel.sample_rising_lines if rises else kernel.sample_lines
    in_parallel(partial(sample, flow, *lines, 0.0, values), counts[2] * counts[0], LINES_AT_ONCE)
    steps = [(hi - lo) / (n - 1) for (lo, hi), n in zip(box, counts, strict=True)]
    scale = known.length_scale
    level_speed = np.array([np.hypot(level[..., 0], level[..., 1]).max() for level in values])
    extent = kernel.Extent(
        *box[0],
        *box[1],
        known.t_lo,
        known.t_hi,
        max_speed=float(level_speed.max()),
        length_scale=max(scale / 2, steps[0], steps[1]) if math.isfinite(scale) else steps[0],
    )
    spaced = {"per_x": 1 / steps[0], "per_y": 1 / steps[1], "z_first": z[0], "per_z": 1 / steps[2]}
    if rises:
        return kernel.RisingGrid(values, **spaced, max_rise=float(np.abs(values[..., 2]).max()), extent=extent)
    return kernel.Grid(values, level_speed, level_carry=_carry(level_speed, steps[2]), **spaced, extent=extent)


def _carry(level_speed: Array, step: float) -> Array:
    return np.concatenate([[0.0], np.cumsum((level_speed[1:] + level_speed[:-1]) / 2 * step)])


def level_part(flow: kernel.Flow) -> kernel.Flow | None:
    """Return the flow without its vertical part; None for a formula that has one."""
    if not kernel.rises(flow):
        return flow
    if not isinstance(flow, kernel.RisingGrid | kernel.RisingOceanGrid):
        return None
    kept = flow._asdict() | {"values": np.ascontiguousarray(flow.values[..., :2])}
    del kept["max_rise"]
    if isinstance(flow, kernel.RisingOceanGrid):
        return kernel.OceanGrid(**kept, ladder=kernel.NO_LADDER)
    speed = np.hypot(flow.values[..., 0], flow.values[..., 1]).max(axis=(1, 2))
    return kernel.Grid(**kept, level_speed=speed, level_carry=_carry(speed, 1 / flow.per_z))


def sampling_error(flow: kernel.Flow, sampled: kernel.Flow, x: Range, y: Range, z: Range) -> float:
    """Return the largest error [m/s] of a sampled flow at 4096 points of a box [m]."""
    lo, hi = np.array([x, y, z]).T
    px, py, pz = (lo + np.random.default_rng(0).random((4096, 3)) * (hi - lo)).T.copy()
    now = np.zeros(px.size)
    read = kernel.currents if kernel.rises(flow) else kernel.velocities
    off = read(flow, px, py, pz, now) - read(sampled, px, py, pz, now)
    return float(np.hypot.reduce(off, axis=1).max())
