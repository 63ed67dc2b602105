"""The bottom under places of a grid, as a file has it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .grid import Grid


@dataclass(frozen=True)
class Bottom:
    """`height` (ny, nx) of the bottom [m, upward, land is 0 or more] on a `grid`; `words` on what was taken.

    `between`: a place may be as high as the highest of the points around it; else as the nearest one.
    """

    grid: Grid
    height: NDArray[np.float64]
    between: bool
    words: str
