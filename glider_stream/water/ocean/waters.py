"""The scenario's block for a flow out of current files."""

from dataclasses import dataclass, field

from ...base.checks import Range
from ...kernels.flow import OceanGrid
from ..frame import LocalFrame
from .bottom import Bottom
from .flow import ocean_waters
from .names import Names
from .reader import read_currents


@dataclass(frozen=True)
class OceanFlow:
    """The block [flow] of kind "netcdf": `file` or files, the `epoch` (ISO 8601, UTC) of t = 0.

    `names` where the file does not speak for itself.
    """

    file: tuple[str, ...] = field(
        metadata={"missing": "the file of currents, or a list of them, such as --set flow.file=currents.nc"}
    )
    epoch: str | None = None
    names: Names | None = None

    def waters(self, frame: LocalFrame, lon: Range, lat: Range, depth: Range) -> tuple[OceanGrid, Bottom, str]:
        """Flow and bottom of a domain, and a word on where they come from."""
        file = read_currents(self.file, self.names, lon=lon, lat=lat, depth=depth)
        flow, bottom = ocean_waters(file, frame, lon, lat, depth, self.epoch)
        words = [f"{file.took['u']}, {file.took['v']} of {file.name}", file.time_range, *file.words, *file.notes]
        return flow, bottom, "; ".join(words)
