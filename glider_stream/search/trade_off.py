"""The trade of time against energy for one query: the paths that are best for some price of time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..base.clock import span
from ..base.settings import require
from .path import Path
from .query import Blend

SAME = 1e-9
"""Two paths whose times and energies differ by less, relatively, are the same point."""
MOST = 200


@dataclass(frozen=True)
class TradeOff:
    """`paths` by rising time and falling energy: the corners of the convex hull of all there are.

    Between two of them others may lie that no price of time makes the best.
    """

    paths: tuple[Path, ...]

    def within(self, energy: float) -> Path | None:
        """The fastest of them that uses at most so much energy [J]."""
        return next((path for path in self.paths if path.cost <= energy), None)

    def least_time(self, energy: float) -> float:
        """A bound [s] from below on the time of any path within an energy [J]: the hull's."""
        for fast, slow in zip(self.paths, self.paths[1:], strict=False):
            if slow.cost <= energy < fast.cost:
                share = (fast.cost - energy) / (fast.cost - slow.cost)
                return fast.travel_time + share * (slow.travel_time - fast.travel_time)
        return self.paths[0].travel_time

    def as_dict(self) -> dict[str, Any]:
        """For JSON: each path's time, energy and number of legs."""
        rows = [(path.travel_time, path.cost, len(path.legs)) for path in self.paths]
        return {"trade_off": [{"travel_time_s": t, "energy_j": e, "legs": n} for t, e, n in rows]}

    def __str__(self) -> str:
        lines = ["   time                energy   legs"]
        lines += [
            f"{span(path.travel_time):>20} {path.cost / 1000:9,.2f} kJ  {len(path.legs):4}" for path in self.paths
        ]
        return "\n".join(
            [*lines, "the corners of the hull: between two, others may lie that no price makes best"]
        )


def trade_off(best: Callable[[Blend], Path]) -> TradeOff:
    """All paths that are best for some price of a second, by a search for each corner of the hull.

    `best` finds the path of a blend. The price at which two neighbours are equal is asked for next, until
    it finds nothing between them (Aneja and Nair 1979, Bicriteria transportation problem).
    """
    ends = best(Blend(SAME, 1.0)), best(Blend(1.0, SAME))
    if not ends[0].found:
        return TradeOff(ends[:1])
    corners, waiting = [ends[0]], [ends]
    while waiting:
        fast, slow = waiting.pop()
        if slow.cost >= fast.cost * (1 - SAME) or slow.travel_time <= fast.travel_time * (1 + SAME):
            continue
        price = Blend(slow.travel_time - fast.travel_time, fast.cost - slow.cost)
        between = best(price)
        worth = price.of(between.cost, between.travel_time) < price.of(fast.cost, fast.travel_time) * (1 - SAME)
        require(len(corners) < MOST, f"the trade-off has more than {MOST} corners; ask for fewer nodes")
        if worth:
            waiting += [(between, slow), (fast, between)]
        else:
            corners.append(slow)
    corners.sort(key=lambda path: path.travel_time)
    return TradeOff(tuple(corners))
