"""Types of arrays, by what they hold."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Real numbers."""
Index = NDArray[np.int64]
"""Indices of nodes, edges or rows."""
Bools = NDArray[np.bool_]
"""Masks: which rows are chosen."""
