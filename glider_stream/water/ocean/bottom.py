"""The bottom under the points of a grid, as a file gives it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .grid import Grid


@dataclass(frozen=True)
class Bottom:
    """`height` (ny, nx) [m, upward]: the water below it is closed. `grid` gives the positions.

    `ground` (ny, nx): height of the seabed, from which the clearance counts; 0 or more is land and -inf is
    unknown. None if `height` is the seabed itself; otherwise `height` is where the data end. `between`: if true,
    a place is as high as the highest of the points around it, else as high as the nearest point. `description`:
    what was assumed.
    """

    grid: Grid
    height: NDArray[np.float64]
    between: bool
    description: str
    ground: NDArray[np.float64] | None = None
