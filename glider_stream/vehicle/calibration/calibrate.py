"""Calibration: the buoyancy, drag and lift of a vehicle, as far as dives that it flew determine them.

Where each dive tells two numbers, speed and glide angle, all forces may be multiplied by one number and nothing
recorded changes: of net mass and drag only the ratio shows, and of lift and induced drag only c / a^2. What does
not show is held at the preset's value, and said.
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
"""By model: the keys of parasite drag, induced drag and lift."""
INSTRUMENTS = ("vertical", "horizontal", "glide_angle", "pitch")
DETERMINED = 0.25
"""A coefficient whose relative standard error is larger is not determined, and keeps the preset's value."""
OUTLYING = 3.0
"""Scatters away from the fit that make a dive worth a look."""
FLAT = 0.1
"""The share of dives that may be too flat for a vehicle by the scatter of their angles."""
FEWEST = 3


def calibrate(dives: Dives, preset: str = "seaglider") -> Calibration:
    """Fit a preset to dives by least squares of their distance from what the vehicle's instruments would record.

    With the buoyancy of each dive the parasite drag is fitted; without, the buoyancy is, of each phase where
    phases are told. The lift needs a pitch beside the glide angle. It and the induced drag are held where the
    dives do not determine them. Standard errors come from the Jacobian and the scatter of the residuals.
    """
    require(preset in VEHICLES, f"`preset` = {preset!r} cannot be calibrated; choose from: {', '.join(VEHICLES)}")
    base, count = PRESETS[preset], dives.vertical.size
    require(count >= FEWEST, f"a calibration needs {FEWEST} dives or more; got {count}: add some")
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
        held[induced] = "a pitch alone does not tell it from the lift"
    if angled and dives.pitch is not None:
        loose.append(lift)
    else:
        held[lift] = f"without a pitch beside the glide angle only {induced} / {lift}^2 shows"
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
        require(not fit.bound[n], f"{wrong} {', '.join(dives.took.values())}; look at their units")
    return _calibration(problem, preset, fit, held)


def _vague(problem: FitProblem, fit: Fit, first: Fit) -> tuple[str, str] | None:
    """The coefficient that the dives determine worst, and why it does not do; `first`: the fit without any."""
    loose = [n for n in range(len(fit.names)) if fit.names[n] not in first.names]
    if not loose:
        return None
    worst = max(loose, key=lambda n: (bool(fit.bound[n]), float(fit.errors[n])))
    name, error = fit.names[worst], float(fit.errors[worst])
    flat = [np.mean(problem.flat(found)) for found in (fit, first)]
    if fit.bound[worst]:
        return name, "these dives fit best with one that no vehicle has, so they do not determine it"
    if flat[0] > flat[1] + FLAT:
        return name, "these dives fit best with one that could not have flown some of them"
    if not error <= DETERMINED:
        return name, f"these dives determine it to {min(error, 99.0):.0%} only"
    return None


def _held(drag: str, base: Glider) -> dict[str, str]:
    """What is held whatever the dives are, and why."""
    shape = "drag_exponent" if isinstance(base, Seaglider) else "lift_0"
    why = "the published model's shape" if isinstance(base, Seaglider) else "the vehicle is symmetrical"
    return {drag: "without a recorded buoyancy only its ratio to the buoyancy shows", shape: why}


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
    """The vehicle that a fit found, and how far the dives are from it at the angles that they were flown at."""
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
        # the horizontal speed that vertical speed and glide angle tell
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
    """The mean off neutral in a dive and in a climb [cc]; the other's where one of them is not flown."""
    phases = [volumes] * 2 if dives.down is None else [volumes[dives.down], volumes[~dives.down]]
    dive, climb = (float((phase if phase.size else volumes).mean()) for phase in phases)
    return dive, climb


def _ranged(glider: Glider, base: Glider, angle: Array) -> Glider:
    """The glider over the preset's range and the flown angles [degrees], as far as the kernels can take them."""
    limit = math.degrees(max(map(abs, glider.limits)))
    high = max(base.angles[1], math.ceil(float(angle.max())))
    low = max(min(base.angles[0], math.floor(float(angle.min()))), math.ceil(limit + 0.5))
    while True:
        ranged = replace(glider, angles=(float(low), float(min(high, 89.0))))
        try:
            polar(ranged)
            return ranged
        except InputError:
            # near its limit a vehicle may sink faster on a flatter path
            low += 1
