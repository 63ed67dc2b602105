"""The bottom under places of a grid, as a file has it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .grid import Grid


@dataclass(frozen=True)
class Bottom:
    """`height` (ny, nx) [m, upward] below which nothing is open on a `grid`; `words` on what was taken.

    `ground` (ny, nx): height of the seabed, which clearance counts from: 0 or more is land, -inf is not known;
    None where `height` is the seabed. Elsewhere `height` is where the data end. `between`: a place may be as
    high as the highest of the points around it; else as the nearest one.
    """

    grid: Grid
    height: NDArray[np.float64]
    between: bool
    words: str
    ground: NDArray[np.float64] | None = None
