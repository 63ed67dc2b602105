"""Gliders by name, and the [glider] table of a scenario."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from ..base.errors import InputError
from ..base.settings import from_kinds, from_table, require
from .models import MODELS, Glider, Seaglider, SteadyGlide

SYMBOLS = {
    **{"K_D0": "drag_0", "K_D": "drag_alpha2", "K_L0": "lift_0", "K_L": "lift_alpha"},
    **{"off": "offset", "m_b_max": "ballast_max", "g": "gravity"},
    **{"a": "lift", "b": "drag", "c": "induced_drag", "s": "drag_exponent", "rho0": "density", "l": "length"},
}
"""The papers' symbols, which a scenario may use instead of the keys."""

PRESETS: dict[str, Glider] = {
    "paper": SteadyGlide(
        name="paper",
        note="a Slocum's coefficients by Graver (2005), with the net mass that gives the source paper's "
        "0.9 m/s horizontal; optimistic: the drag is 3.6 times below field-calibrated",
        angles=(10.0, 45.0),
        gravity=9.81,
        drag_0=2.15,
        drag_alpha2=25.0,
        lift_0=0.0,
        lift_alpha=132.5,
        offset=0.464051,
        ballast_max=0.928102,
    ),
    "slocum": SteadyGlide(
        name="slocum",
        note="a Slocum calibrated in the field (Merckelbach et al. 2019; gliderflight with C_D0 = 0.15, "
        "S = 0.1 m^2, rho = 1024 kg/m^3), 250 cc heavy or light",
        angles=(20.0, 45.0),
        gravity=9.81,
        drag_0=7.68,
        drag_alpha2=537.2229,
        lift_0=0.0,
        lift_alpha=385.7546,
        offset=0.256,
        ballast_max=0.512,
    ),
    "seaglider": Seaglider(
        name="seaglider",
        note="the default flight model of the University of Washington's basestation3, 150 cc heavy or light",
        angles=(15.0, 45.0),
        gravity=9.82,
        lift=0.003548134,
        drag=0.011220184,
        induced_drag=5.7e-6,
        drag_exponent=-0.25,
        length=1.8,
        density=1027.5,
        dive_volume=150.0,
        climb_volume=150.0,
    ),
}


def glider_from_table(table: Mapping[str, Any]) -> Glider:
    """Return the glider of a scenario's [glider] table: `preset` and changes, or `model` and all its keys."""
    named: dict[str, Any] = {}
    for key, value in table.items():
        name = SYMBOLS.get(key, key)
        require(
            name not in named, f"`glider.{name}` is given twice, by its name and by its symbol; leave one out"
        )
        named[name] = value
    if "preset" not in named:
        missing = f"`glider.preset` is missing: choose from: {', '.join(PRESETS)}; or give `glider.model`"
        require("model" in named, missing)
        return from_kinds(MODELS, named, "glider", selector="model")
    preset = named.pop("preset")
    if not isinstance(preset, str) or preset not in PRESETS:
        raise InputError(f"`glider.preset` = {preset!r} is not known; choose from: {', '.join(PRESETS)}")
    if not named:
        return PRESETS[preset]
    base = PRESETS[preset]
    says = {"name": f"{preset}, modified", "note": f"{base.note}; changed: {', '.join(named)}"}
    return from_table(type(base), asdict(base) | says | named, "glider")
