"""Finds the scales of a map from its measurements, by their marginal likelihood."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.errors import InputError
from ...base.settings import require
from .covariance import LEAST_NOISE, SCALES, covariance_and_slopes
from .observations import Observations, spread, thinned
from .scales import KERNELS, Scales

MOST_FITTED = 500, 3000
"""Scales are fitted to at most so many measurements with so many nodes, spread evenly; a map uses them all."""
FIRST_LOOK = 150, 600
"""The fit from each start uses so many measurements and nodes; only the best is continued with MOST_FITTED."""
STARTS = 4
"""The number of starts, of which the first is the expected scales."""
LOOSE = 1.5
"""Before the data, the logarithm of a scale is normal about what is expected, with this standard deviation.

It settles what data cannot: a scale may well be 4 times smaller or larger, and hardly 100 times.
"""
SETTLED = 0.5
"""A scale whose logarithm has a larger standard deviation after the fit, relative to LOOSE, is undetermined."""
FURTHEST = 7.0
"""No scale is fitted beyond a factor of exp(FURTHEST) from what is expected."""
MESOSCALE = {"depth": 60.0, "time": 5 * 86_400.0}
"""The expected scales of depth (at the surface) [m] and time [s] of mesoscale currents."""
FITTED = ("speed", "length", "depth", "time", "noise")
HOPELESS = 1e30
"""The loss of scales for which the covariance cannot be factored."""
STEP = 1e-3
"""The step in a logarithm over which the gradient's differences give the second derivatives."""


@dataclass(frozen=True)
class Fit:
    """Fitted scales. `errors`: the standard deviation of the logarithm of each fitted scale.

    `undetermined`: scales that the measurements hardly tell, whose values are what is usual. `held`: scales that
    were given or cannot be fitted, and why. `used` of `count` measurements were fitted; `log_likelihood`: theirs.
    """

    scales: Scales
    errors: dict[str, float]
    undetermined: tuple[str, ...]
    held: dict[str, str]
    used: int
    count: int
    log_likelihood: float

    def __str__(self) -> str:
        units = {"length": (1000, "km"), "depth": (1, "m"), "time": (3600, "h")}
        lines = [f"scales fitted to {self.used:,} of {self.count:,} measurements, {self.scales.kernel} kernel"]
        for name, error in self.errors.items():
            per, unit = units.get(name, (1, "m/s"))
            value, factor = getattr(self.scales, name) / per, math.exp(error)
            note = "; the measurements hardly tell it: this is what is usual" if name in self.undetermined else ""
            lines.append(f"  {name:<8}{value:.3g} {unit}, within a factor of {factor:.2f} (one sd){note}")
        return "\n".join([*lines, *(f"  {name:<8}held: {why}" for name, why in self.held.items())])

    def as_dict(self) -> dict[str, Any]:
        """Return the fit as a dictionary for JSON; an infinite scale is null."""
        values = {field.name: getattr(self.scales, field.name) for field in fields(self.scales)}
        finite = {n: None if isinstance(v, float) and math.isinf(v) else v for n, v in values.items()}
        rest = {"undetermined": list(self.undetermined), "held": self.held}
        return {
            "scales": finite,
            "log_errors": self.errors,
            **rest,
            "used": self.used,
            "measurements": self.count,
            "log_likelihood": self.log_likelihood,
        }


def fit_scales(
    at: Observations, known: Mapping[str, float] | None = None, *, kernel: str = "matern", seed: int = 0
) -> Fit:
    """Return the scales with which the measurements are most likely; those in `known` are held.

    Fitted are speed, length and noise; depth and time where the measurements differ in these. The current is the
    same at all depths, or at all times, where they do not. `mean` is held at the measurements' rms speed.
    """
    from scipy.linalg import cho_solve
    from scipy.optimize import minimize

    known = dict(known or {})
    for name in known:
        allowed = (*FITTED, "mean")
        require(name in allowed, f"the scale `{name}` is not known; choose from: {', '.join(allowed)}")
    require(kernel in KERNELS, f"`kernel` must be one of {', '.join(KERNELS)}; got {kernel!r}")
    expected, free, held = _expected(at, known, kernel)
    if not free:
        return Fit(expected, {}, (), held, at.count, at.count, -_loss(at, expected, (), expected)[0])
    few, many = _some(at, *FIRST_LOOK), _some(at, *MOST_FITTED)
    generator = np.random.default_rng(seed)
    starts = [np.zeros(len(free)), *generator.normal(0, LOOSE / 2, (STARTS - 1, len(free)))]
    bounds = [(-FURTHEST, FURTHEST)] * len(free)

    def search(some: Observations, start: Array) -> Any:
        def loss(logs: Array) -> tuple[float, Array]:
            return _loss(some, _moved(expected, free, logs), free, expected, logs)

        return minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60})

    found = min((search(few, start) for start in starts), key=lambda result: float(result.fun))
    if many.count > few.count:
        found = search(many, found.x)
    logs = np.asarray(found.x)
    second = np.empty((len(free), len(free)))
    for n in range(len(free)):
        step = STEP * np.eye(len(free))[n]
        ends = [_loss(many, _moved(expected, free, logs + d), free, expected, logs + d)[1] for d in (step, -step)]
        second[n] = (ends[0] - ends[1]) / (2 * STEP)
    second = (second + second.T) / 2
    try:
        factor = np.linalg.cholesky(second)
        errors = np.sqrt(np.diag(cho_solve((factor, True), np.eye(len(free)))))
    except np.linalg.LinAlgError:
        # at a bound the second derivatives may be negative: then nothing is known beyond the expectation
        errors = np.full(len(free), LOOSE)
    scales = _moved(expected, free, logs)
    undetermined = tuple(name for name, e in zip(free, errors, strict=True) if e > SETTLED * LOOSE)
    by_name = {name: float(error) for name, error in zip(free, errors, strict=True)}
    prior = float((logs**2).sum()) / (2 * LOOSE**2)
    return Fit(scales, by_name, undetermined, held, many.count, at.count, prior - float(found.fun))


def _some(at: Observations, most: int, nodes: int) -> Observations:
    """Return at most so many measurements with so many nodes, spread evenly."""
    share = min(1.0, nodes / at.x.size)
    return at.take(np.array(thinned(at, min(most, max(2, int(at.count * share))))))


def _expected(
    at: Observations, known: Mapping[str, float], kernel: str
) -> tuple[Scales, tuple[str, ...], dict[str, str]]:
    """Return the scales before the data are compared, which of them are fitted, and why others are held."""
    wide, deep, long = spread(at)
    rms = float(np.sqrt(np.mean(at.values**2)))
    if "speed" not in known and rms == 0:
        raise InputError(
            "every measurement is exactly 0 m/s, so their scales are unknown; give `speed` and `length`"
        )
    needs = [name for name, reach in (("length", wide),) if reach == 0 and name not in known]
    require(
        not needs,
        "all measurements are at one place, so how far currents are alike is unknown; give `length`",
    )
    held = dict.fromkeys(known, "as you say")
    values: dict[str, float] = {
        "speed": rms,
        "length": wide / 4,
        "depth": MESOSCALE["depth"] if deep > 0 else math.inf,
        "time": MESOSCALE["time"] if long > 0 else math.inf,
        "noise": 0.1 * rms,
        "mean": rms,
        **known,
    }
    if deep == 0 and "depth" not in known:
        held["depth"] = "all measurements are at one depth: the current is taken as the same at all depths"
    if long == 0 and "time" not in known:
        held["time"] = "all measurements are at one time: the current is taken as steady"
    if "mean" not in known:
        held["mean"] = "the rms of the measurements"
    free = tuple(name for name in FITTED if name not in held)
    return Scales(**values, kernel=kernel), free, held


def _moved(expected: Scales, free: Sequence[str], logs: Array) -> Scales:
    return replace(
        expected,
        **{name: getattr(expected, name) * math.exp(log) for name, log in zip(free, logs, strict=True)},
    )


def _loss(
    at: Observations,
    scales: Scales,
    free: Sequence[str],
    expected: Scales,
    logs: Array | None = None,
) -> tuple[float, Array]:
    """Return minus the logarithm of the likelihood, with that of the expectation of scales, and its gradient."""
    from scipy.linalg import cho_solve
    from scipy.linalg.lapack import dpotrf, dpotri

    inner = [name for name in free if name in SCALES]
    smooth, *slopes = covariance_and_slopes(scales, at, inner)
    whole = smooth.copy()
    floor = (LEAST_NOISE * expected.speed) ** 2
    whole[np.diag_indices_from(whole)] += np.tile(at.error**2 + scales.noise**2, 2) + floor
    root, failed = dpotrf(whole, lower=1, overwrite_a=1)
    if failed:
        return HOPELESS, np.zeros(len(free))
    weights = cho_solve((root, True), at.values, check_finite=False)
    size = at.values.size
    loss = 0.5 * float(at.values @ weights) + float(np.log(np.diag(root)).sum())
    loss += 0.5 * size * math.log(2 * math.pi)
    if not free:
        return loss, np.zeros(0)
    assert logs is not None
    # d loss / d log(scale) = trace((K^-1 - w w^T) dK) / 2; LAPACK gives the lower triangle of K^-1
    below = dpotri(root, lower=1)[0]
    precision = np.tril(below) + np.tril(below, -1).T
    gradient = np.empty(len(free))
    for n, name in enumerate(free):
        if name == "noise":
            gradient[n] = scales.noise**2 * float(np.trace(precision) - weights @ weights)
            continue
        slope = 2 * smooth if name == "speed" else slopes[inner.index(name)]
        gradient[n] = 0.5 * float(np.vdot(precision, slope) - weights @ (slope @ weights))
        if name == "speed" and scales.mean > 0:
            half = size // 2
            for part in (slice(0, half), slice(half, size)):
                constant = float(precision[part, part].sum()) - float(weights[part].sum()) ** 2
                gradient[n] -= scales.mean**2 * constant
    return loss + float((logs**2).sum()) / (2 * LOOSE**2), gradient + logs / LOOSE**2
