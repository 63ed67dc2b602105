"""What an edge costs: travel time [s]."""

from .cache import kernel


@kernel
def edge_cost(duration):
    """Cost of a leg from its duration [s]; it never falls as the duration grows."""
    return duration
