"""What an edge costs: travel time [s]."""

from numba import njit


@njit
def edge_cost(duration):
    """Cost of a leg from its duration [s]; it never falls as the duration grows."""
    return duration
