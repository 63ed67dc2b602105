"""Parts of a roadmap, for batch queues."""

from dataclasses import dataclass

from ..base.arrays import Array
from .roadmap import Edges, Provenance


@dataclass(frozen=True)
class Shard:
    """Part `number`, from 1, of `count` parts of a roadmap."""

    number: int
    count: int

    @property
    def whole(self) -> bool:
        """Whether this part is the whole roadmap."""
        return self.count == 1

    def nodes(self, count: int) -> tuple[int, int]:
        """Return the first source node of this part, and the node after its last one, of `count` nodes."""
        return (self.number - 1) * count // self.count, self.number * count // self.count

    def rows(self, count: int, slices: int) -> tuple[int, int]:
        """Return the first row of edges, and the row after the last; each node has one row for each departure."""
        first, last = self.nodes(count)
        return first * slices, last * slices

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"


@dataclass(frozen=True)
class Part:
    """A shard that was read from its file.

    `edges` is None if only the head was read. `departures` (slices,) [s] is None for a roadmap of one departure.
    """

    shard: Shard
    provenance: Provenance
    position: Array
    lonlat: Array | None
    edges: Edges | None
    wall_s: float
    threads: int
    departures: Array | None = None
