"""Reads ocean files of any convention and makes the currents that the kernels read."""

from .divergence import divergence_ratio
from .ensemble import read_members
from .file import OceanFile, parse_time
from .flow import grid_flow, ocean_flow, sample
from .grid import CurvedGrid, LonLatGrid, index_map
from .names import Names
from .reader import read_currents
from .waters import OceanFlow

__all__ = [
    "CurvedGrid",
    "LonLatGrid",
    "Names",
    "OceanFile",
    "OceanFlow",
    "divergence_ratio",
    "grid_flow",
    "index_map",
    "ocean_flow",
    "parse_time",
    "read_currents",
    "read_members",
    "sample",
]
