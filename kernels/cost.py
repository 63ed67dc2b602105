"""The cost of an edge: a rate for each second and an amount for each leg."""

from typing import NamedTuple

from .cache import kernel


class CostRates(NamedTuple):
    """`per_second` of a leg and `per_leg`, in the unit of the cost; travel time is 1 and 0."""

    per_second: float
    per_leg: float


@kernel
def edge_cost(cost, duration):
    """Return the cost of a leg from its duration [s]; a longer leg never costs less."""
    return cost.per_second * duration + cost.per_leg
