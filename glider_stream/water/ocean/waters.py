"""The block [flow] of a scenario for currents from files."""

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
    """The block [flow] of kind "netcdf": one `file` or several, and the `epoch` (ISO 8601, UTC) of t = 0.

    `names`: needed where the file's own names are not enough.
    """

    file: tuple[str, ...] = field(
        metadata={"missing": "the file of currents, or a list of them, such as --set flow.file=currents.nc"}
    )
    epoch: str | None = None
    names: Names | None = None

    def waters(self, frame: LocalFrame, lon: Range, lat: Range, depth: Range) -> tuple[OceanGrid, Bottom, str]:
        """Return the flow and the bottom of a domain, and a text on their source."""
        file = read_currents(self.file, self.names, lon=lon, lat=lat, depth=depth)
        flow, bottom = ocean_waters(file, frame, lon, lat, depth, self.epoch)
        source = [
            f"{file.took['u']}, {file.took['v']} of {file.name}",
            file.time_range,
            *file.assumptions,
            *file.notes,
        ]
        return flow, bottom, "; ".join(source)
