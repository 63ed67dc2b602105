"""The block [flow] of a scenario for currents from files."""

from dataclasses import dataclass, field, replace

from ...base.checks import Range
from ...base.settings import require
from ...kernels.flow import OceanGrid
from ..frame import LocalFrame
from .bottom import Bottom
from .flow import ocean_waters
from .names import Names
from .reader import read_currents


@dataclass(frozen=True)
class OceanFlow:
    """The block [flow] of kind "netcdf": one `file` or several, and the `epoch` (ISO 8601, UTC) of t = 0.

    `names`: needed where the file's own names are not enough. `member`: which member of an ensemble, by its
    label, or by its number from 0 without labels; the same as `names.member`.
    """

    file: tuple[str, ...] = field(
        metadata={"missing": "the file of currents, or a list of them, such as --set flow.file=currents.nc"}
    )
    epoch: str | None = None
    names: Names | None = None
    member: int | str | None = None

    def __post_init__(self) -> None:
        named = None if self.names is None else self.names.member
        require(
            self.member is None or named is None or str(named) == str(self.member),
            f"`flow.member` = {self.member!r} and `flow.names.member` = {named!r} differ; leave one of them out",
        )

    def waters(self, frame: LocalFrame, lon: Range, lat: Range, depth: Range) -> tuple[OceanGrid, Bottom, str]:
        """Return the flow and the bottom of a domain, and a text on their source."""
        names = self.names or Names()
        if self.member is not None:
            names = replace(names, member=self.member)
        file = read_currents(self.file, names, lon=lon, lat=lat, depth=depth)
        flow, bottom = ocean_waters(file, frame, lon, lat, depth, self.epoch)
        source = [
            f"{file.took['u']}, {file.took['v']} of {file.name}",
            file.time_range,
            *file.assumptions,
            *file.notes,
        ]
        return flow, bottom, "; ".join(source)
