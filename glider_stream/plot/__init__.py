"""Figures: a route in its current, as the paper's figure 4 shows one; a roadmap, and steering, at a glance."""

from .canvas import check_figure, save_figure
from .comparison import Mean, Series, plot_comparison
from .roadmap import plot_roadmap
from .route import plot_route
from .steering import plot_steering
from .water import sample_field, sample_water

__all__ = [
    "Mean",
    "Series",
    "check_figure",
    "plot_comparison",
    "plot_roadmap",
    "plot_route",
    "plot_steering",
    "sample_field",
    "sample_water",
    "save_figure",
]
