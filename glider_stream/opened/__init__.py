"""Opened scenarios and roadmaps: water, problem and searches are each made once, when they are first needed."""

from .opening import is_plan, open, open_either, open_plan, open_scenario
from .questions import OpenedRoadmap, OpenedScenario
from .routes import split_outputs

__all__ = [
    "OpenedRoadmap",
    "OpenedScenario",
    "is_plan",
    "open",
    "open_either",
    "open_plan",
    "open_scenario",
    "split_outputs",
]
