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
        """Whether it is all there is."""
        return self.count == 1

    def nodes(self, count: int) -> tuple[int, int]:
        """The first source node, and that after the last, of `count` nodes."""
        return (self.number - 1) * count // self.count, self.number * count // self.count

    def rows(self, count: int, slices: int) -> tuple[int, int]:
        """As `nodes`, of the rows of edges that `count` nodes have: one for each departure."""
        first, last = self.nodes(count)
        return first * slices, last * slices

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"


@dataclass(frozen=True)
class Part:
    """A shard out of its file; `edges` are None where only the head was read; `departures` of a sliced one."""

    shard: Shard
    provenance: Provenance
    position: Array
    lonlat: Array | None
    edges: Edges | None
    wall_s: float
    threads: int
    departures: Array | None = None
