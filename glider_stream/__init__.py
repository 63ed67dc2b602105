"""Underwater glider planning in ocean currents: exact legs, roadmaps, routes.

from glider_stream import planner

roadmap = planner.build("seed-box", "seed-box.h5")
path = planner.query(roadmap)
planner.plot(roadmap, path, "route.png")
"""

import importlib
from typing import Any

_HOMES = {
    "errors": ("InputError",),
    "path": ("Path",),
    "query": ("Planner",),
    "roadmap": ("Roadmap", "build_roadmap"),
    "scenario": ("Scenario", "read_scenario", "shipped_scenarios"),
    "store": ("read_roadmap", "write_roadmap"),
}
_WHERE = {name: home for home, names in _HOMES.items() for name in names}
__all__ = sorted(_WHERE)


def __getattr__(name: str) -> Any:
    """Load what is asked for, when it is asked for: starting up costs only what is used."""
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_WHERE[name]}", __name__), name)
