"""Figures: a route in its current, as the paper's figure 4 shows one; a roadmap, and steering, at a glance."""

from .canvas import check_figure, save_figure
from .roadmap import plot_roadmap
from .route import plot_route
from .steering import plot_steering
from .water import sample_field, sample_water

__all__ = [
    "check_figure",
    "plot_roadmap",
    "plot_route",
    "plot_steering",
    "sample_field",
    "sample_water",
    "save_figure",
]
