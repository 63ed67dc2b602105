"""The command line. The body of each command is one library call; heavy modules are loaded only when needed."""

from . import confidences, measures, pilots, roadmaps, routes, waters  # their commands join the group
from .group import cli
from .run import main

__all__ = ["cli", "confidences", "main", "measures", "pilots", "roadmaps", "routes", "waters"]
