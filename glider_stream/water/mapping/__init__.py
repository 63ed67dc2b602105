"""Maps of currents from sparse measurements: a Gaussian process on the stream function.

u = d psi/dy and v = -d psi/dx at every depth and time, so the mean and all samples are free of divergence.
"""

from .conditioned import CurrentMap, Sample, condition
from .fitting import Fit, fit_scales
from .observations import Observations, at_points, dive_averages, drifts
from .scales import Scales

__all__ = [
    "CurrentMap",
    "Fit",
    "Observations",
    "Sample",
    "Scales",
    "at_points",
    "condition",
    "dive_averages",
    "drifts",
    "fit_scales",
]
