"""Calibration: finds a vehicle's buoyancy, drag and lift as far as its dives determine them.

If a dive gives only speed and glide angle, all forces may be multiplied by one number and no record changes. Then
only the ratio of net mass to drag is known, and of lift and induced drag only c / a^2. Values that are not
determined keep the preset's value, and the result lists them.
"""

import math
from dataclasses import replace

import numpy as np

from ...base.arrays import Array
from ...base.errors import InputError
from ...base.settings import require
from ..models import Glider, Seaglider, SteadyGlide
from ..polar import polar
from ..presets import PRESETS
from .dives import Dives
from .instruments import per_volume, vehicle
from .least_squares import FURTHEST_MAIN, Fit, FitProblem
from .result import CONFIDENCE, Calibration, Parameter, scatter

VEHICLES = ("seaglider", "slocum")
KEYS: dict[type[Glider], tuple[str, str, str]] = {
    Seaglider: ("drag", "induced_drag", "lift"),
    SteadyGlide: ("drag_0", "drag_alpha2", "lift_alpha"),
}
"""The keys of parasite drag, induced drag and lift of each model."""
INSTRUMENTS = ("vertical", "horizontal", "glide_angle", "pitch")
DETERMINED = 0.25
"""A coefficient with a larger relative standard error is not determined and keeps the preset's value."""
OUTLYING = 3.0
"""A dive this many scatters away from the fit is listed as outlying."""
FLAT = 0.1
"""This share of the dives may be too flat for the vehicle, because their angles scatter."""
FEWEST = 3


def calibrate(dives: Dives, preset: str = "seaglider") -> Calibration:
    """Fit a preset to dives by least squares of the distances to the values that the vehicle would record.

    If each dive has a buoyancy, the parasite drag is fitted; otherwise the buoyancy is fitted, for each phase if
    the phases are known. The lift needs a pitch in addition to the glide angle. Lift and induced drag keep the
    preset's values if the dives do not determine them. Standard errors come from the Jacobian and the scatter of
    the residuals.
    """
    require(preset in VEHICLES, f"`preset` = {preset!r} cannot be calibrated; choose from: {', '.join(VEHICLES)}")
    base, count = PRESETS[preset], dives.vertical.size
    require(count >= FEWEST, f"a calibration needs at least {FEWEST} dives; got {count}: add some")
    drag, induced, lift = KEYS[type(base)]
    problem = _problem(dives, base)
    main = tuple(problem.groups) or (drag,)
    angled = dives.horizontal is not None or dives.glide_angle is not None
    held, loose = _held(drag, base), []
    if problem.recorded is not None:
        held.pop(drag)
    if angled:
        loose.append(induced)
    else:
        held[induced] = "a pitch alone does not separate it from the lift"
    if angled and dives.pitch is not None:
        loose.append(lift)
    else:
        held[lift] = f"without a pitch in addition to the glide angle only {induced} / {lift}^2 is determined"
    first = problem.fit(main, {})
    start = dict(zip(main, first.logs, strict=True))
    while True:
        room = count * (len(problem.kinds) - 1) - 1
        if len(main) + len(loose) > room:
            held[loose.pop()] = "there are too few dives"
            continue
        fit = problem.fit((*main, *loose), start) if loose else first
        vague = _vague(problem, fit, first)
        if vague is None:
            break
        loose.remove(vague[0])
        held[vague[0]] = vague[1]
    for n, name in enumerate(main):
        wrong = f"no {name} within a factor of {math.exp(FURTHEST_MAIN):.0f} of the preset's fits"
        require(not fit.bound[n], f"{wrong} {', '.join(dives.took.values())}; check their units")
    return _calibration(problem, preset, fit, held)


def _vague(problem: FitProblem, fit: Fit, first: Fit) -> tuple[str, str] | None:
    """Return the coefficient that is determined worst, and the reason to hold it; None if all are good enough.

    `first`: the fit without any of these coefficients.
    """
    loose = [n for n in range(len(fit.names)) if fit.names[n] not in first.names]
    if not loose:
        return None
    worst = max(loose, key=lambda n: (bool(fit.bound[n]), float(fit.errors[n])))
    name, error = fit.names[worst], float(fit.errors[worst])
    flat = [np.mean(problem.flat(found)) for found in (fit, first)]
    if fit.bound[worst]:
        return name, "these dives fit best with a value that no vehicle has, so they do not determine it"
    if flat[0] > flat[1] + FLAT:
        return name, "these dives fit best with a value with which some of them cannot be flown"
    if not error <= DETERMINED:
        return name, f"these dives determine it only to {min(error, 99.0):.0%}"
    return None


def _held(drag: str, base: Glider) -> dict[str, str]:
    """Return the values that are held for any dives, and why."""
    shape = "drag_exponent" if isinstance(base, Seaglider) else "lift_0"
    why = "the published model's shape" if isinstance(base, Seaglider) else "the vehicle is symmetrical"
    return {drag: "without a recorded buoyancy only its ratio to the buoyancy is determined", shape: why}


def _problem(dives: Dives, base: Glider) -> FitProblem:
    unit = per_volume(base)
    volume = base.dive_volume if isinstance(base, Seaglider) else float(base.net_mass(-1.0)) / unit
    kinds = tuple(kind for kind in INSTRUMENTS if getattr(dives, kind) is not None)
    if dives.buoyancy is not None:
        return FitProblem(dives, base, volume, kinds, {}, dives.buoyancy / (unit if dives.unit == "kg" else 1.0))
    groups = {"buoyancy": np.full(dives.vertical.size, True)}
    if dives.down is not None and min(dives.down.sum(), (~dives.down).sum()) > 1:
        groups = {"dive_buoyancy": dives.down, "climb_buoyancy": ~dives.down}
    return FitProblem(dives, base, volume, kinds, groups, None)


def _calibration(problem: FitProblem, preset: str, fit: Fit, held: dict[str, str]) -> Calibration:
    """Return the fitted vehicle and its errors at the angles of the dives."""
    from scipy.special import stdtrit

    dives, base, count, fitted = problem.dives, problem.base, problem.dives.vertical.size, len(fit.names)
    ratio = dict(zip(fit.names, np.exp(fit.logs), strict=True))
    parameters = {}
    for name, error in zip(fit.names, fit.errors, strict=True):
        before = problem.volume if name in problem.groups else float(getattr(base, name))
        value = before * float(ratio[name])
        parameters[name] = Parameter(value, value * float(error), before, "cc" if name in problem.groups else "")
    flown = problem.flown(fit.names, fit.logs)
    angle = flown.angle(dives)
    vertical = flown.speed(angle) * np.sin(angle) - dives.vertical
    horizontal = None
    if dives.horizontal is not None:
        horizontal = flown.speed(angle) * np.cos(angle) - dives.horizontal
    elif dives.glide_angle is not None:
        # the horizontal speed from vertical speed and glide angle
        horizontal = vertical / np.tan(angle)
    wide = float(stdtrit(max(count - fitted, 1), 0.5 + CONFIDENCE / 2)) * math.sqrt(1 + fitted / count)
    off = np.abs(vertical if horizontal is None else np.hypot(vertical, horizontal))
    outlying = dives.line[off > OUTLYING * scatter(off, fitted)]
    values = [f"{name} {p.value:.5g} +- {p.error:.2g} {p.unit}".rstrip() for name, p in parameters.items()]
    note = f"fitted to {count} dives: {', '.join(values)}; held: {', '.join(held)}"
    volumes = _volumes(dives, flown.volumes)
    glider = vehicle(base, problem.values(ratio), *volumes, name=f"{preset}, calibrated", note=note)
    return Calibration(
        glider=_ranged(glider, base, np.degrees(angle)),
        parameters=parameters,
        held=held,
        dives=dives,
        vertical_off=vertical,
        horizontal_off=horizontal,
        flat=tuple(int(n) for n in dives.line[problem.flat(fit)]),
        vertical_within=wide * scatter(vertical, fitted),
        horizontal_within=None if horizontal is None else wide * scatter(horizontal, fitted),
        outlying=tuple(int(n) for n in outlying),
    )


def _volumes(dives: Dives, volumes: Array) -> tuple[float, float]:
    """Return the mean volume [cc] off neutral in dives and in climbs; a phase without dives gets the other's."""
    phases = [volumes] * 2 if dives.down is None else [volumes[dives.down], volumes[~dives.down]]
    dive, climb = (float((phase if phase.size else volumes).mean()) for phase in phases)
    return dive, climb


def _ranged(glider: Glider, base: Glider, angle: Array) -> Glider:
    """Return the glider for the preset's range and the flown angles [degrees], as far as the kernels allow."""
    limit = math.degrees(max(map(abs, glider.limits)))
    high = max(base.angles[1], math.ceil(float(angle.max())))
    low = max(min(base.angles[0], math.floor(float(angle.min()))), math.ceil(limit + 0.5))
    while True:
        ranged = replace(glider, angles=(float(low), float(min(high, 89.0))))
        try:
            polar(ranged)
            return ranged
        except InputError:
            # near the limit a vehicle may sink faster on a flatter path
            low += 1
