"""Underwater glider planning in ocean currents: exact legs, roadmaps, routes.

import glider_stream
from glider_stream import planner

planner.build("seed-box", "seed-box.h5")
road = glider_stream.open("seed-box.h5")
path = road.query()
road.plot(path, "route.png")
"""

import importlib
from importlib.metadata import version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .base.errors import InputError
    from .kernels.edges import Status
    from .opened import OpenedRoadmap, open
    from .roadmap.builder import build_roadmap
    from .roadmap.problem import Problem
    from .roadmap.roadmap import Roadmap
    from .roadmap.slices import SlicedRoadmap
    from .roadmap.store import read_roadmap, write_roadmap
    from .scenario import Scenario, read_scenario, shipped_scenarios
    from .search.path import Leg, Path
    from .search.query import Planner
    from .search.surfacing import Surfacing

    __version__: str

__all__ = [
    "InputError",
    "Leg",
    "OpenedRoadmap",
    "Path",
    "Planner",
    "Problem",
    "Roadmap",
    "Scenario",
    "SlicedRoadmap",
    "Status",
    "Surfacing",
    "__version__",
    "build_roadmap",
    "open",
    "read_roadmap",
    "read_scenario",
    "shipped_scenarios",
    "write_roadmap",
]

_HOMES = {
    "base.errors": ("InputError",),
    "kernels.edges": ("Status",),
    "opened": ("OpenedRoadmap", "open"),
    "roadmap.builder": ("build_roadmap",),
    "roadmap.problem": ("Problem",),
    "roadmap.roadmap": ("Roadmap",),
    "roadmap.slices": ("SlicedRoadmap",),
    "roadmap.store": ("read_roadmap", "write_roadmap"),
    "scenario": ("Scenario", "read_scenario", "shipped_scenarios"),
    "search.path": ("Leg", "Path"),
    "search.query": ("Planner",),
    "search.surfacing": ("Surfacing",),
}
"""The module of each name. A name is loaded when it is first used, so that the start costs little."""
_WHERE = {name: home for home, names in _HOMES.items() for name in names}

if (
    not TYPE_CHECKING
):  # a type checker reads the imports above; this function would tell it "any name, of any type"

    def __getattr__(name):
        if name == "__version__":
            return version("glider-stream")
        if name not in _WHERE:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(importlib.import_module(f".{_WHERE[name]}", __name__), name)
