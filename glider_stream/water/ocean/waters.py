"""The block [flow] of a scenario for currents from files."""

from dataclasses import dataclass, field, replace

from ...base.checks import Range
from ...base.settings import require
from ...kernels.flow import OceanGrid, RisingOceanGrid
from ..frame import LocalFrame
from .bottom import Bottom
from .flow import ocean_grounds
from .names import Names
from .reader import read_currents
from .upward import read_upward
from .vertical import CONTINUITY, by_continuity, by_variable


@dataclass(frozen=True)
class OceanFlow:
    """The block [flow] of kind "netcdf": one `file` or several, and the `epoch` (ISO 8601, UTC) of t = 0.

    `names`: needed where the file's own names are not enough. `member`: which member of an ensemble, by its
    label, or by its number from 0 without labels; the same as `names.member`.
    `vertical`: the name of the variable with the vertical current, on its own levels, or "continuity": from u
    and v. Without it there is none, though the files may hold one. `upward` says whether that variable counts
    upward, where it does not say so itself.
    """

    file: tuple[str, ...] = field(
        metadata={"missing": "the file of currents, or a list of them, such as --set flow.file=currents.nc"}
    )
    epoch: str | None = None
    names: Names | None = None
    member: int | str | None = None
    vertical: str | None = None
    upward: bool | None = None

    def __post_init__(self) -> None:
        named = None if self.names is None else self.names.member
        require(
            self.member is None or named is None or str(named) == str(self.member),
            f"`flow.member` = {self.member!r} and `flow.names.member` = {named!r} differ; leave one of them out",
        )
        why = "`flow.upward` is for a `flow.vertical` that is a variable's name; leave it out"
        require(self.upward is None or self.vertical not in (None, CONTINUITY), why)

    def waters(
        self, frame: LocalFrame, lon: Range, lat: Range, depth: Range
    ) -> tuple[OceanGrid | RisingOceanGrid, Bottom, str]:
        """Return the flow and the bottom of a domain, and a text on their source."""
        names = self.names or Names()
        if self.member is not None:
            names = replace(names, member=self.member)
        file = read_currents(self.file, names, lon=lon, lat=lat, depth=depth)
        box = frame, lon, lat, depth, self.epoch
        flow, seabed, grid = ocean_grounds(file, *box)
        result: OceanGrid | RisingOceanGrid = flow
        rising = []
        if self.vertical == CONTINUITY:
            result, told = by_continuity(flow, seabed, frame, grid, file.name)
            rising = [told]
        elif self.vertical is not None:
            lifted = read_upward(self.file, names, self.vertical, self.upward, lon=lon, lat=lat, depth=depth)
            own = ocean_grounds(lifted.file, *box)
            result, told = by_variable(flow, own, lifted.way, frame, grid, self.vertical)
            rising = [told, lifted.told]
        source = [
            f"{file.took['u']}, {file.took['v']} of {file.name}",
            file.time_range,
            *file.assumptions,
            *(note for note in file.notes if not rising or "flow.vertical" not in note),
            *rising,
        ]
        # the file's assumptions name what was taken for the bottom
        where = Bottom(grid, seabed.bottom.T, False, "bottom by the currents' own file", seabed.ground.T)
        return result, where, "; ".join(source)
