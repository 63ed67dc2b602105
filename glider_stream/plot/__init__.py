"""Figures: a route in its current, as the paper's figure 4 shows one; a roadmap, and steering, at a glance."""

from .canvas import check_figure, save_figure
from .chart import plot_chart
from .comparison import Mean, Series, plot_comparison
from .page import check_page, page_depths, route_page, save_page
from .roadmap import plot_roadmap
from .route import plot_route
from .steering import plot_steering
from .water import sample_field, sample_water

__all__ = [
    "Mean",
    "Series",
    "check_figure",
    "check_page",
    "page_depths",
    "plot_chart",
    "plot_comparison",
    "plot_roadmap",
    "plot_route",
    "plot_steering",
    "route_page",
    "sample_field",
    "sample_water",
    "save_figure",
    "save_page",
]
