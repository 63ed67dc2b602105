"""Figures: a route in its current (like figure 4 of the paper), a roadmap, and steering."""

from ..search.path import placed
from .along import Along, along
from .canvas import check_figure, save_figure
from .chart import plot_chart
from .comparison import Mean, Series, plot_comparison
from .departures import plot_departures
from .fronts import Fronts, fronts_of
from .page import PAGE, save_page
from .roadmap import plot_roadmap
from .route import plot_route
from .routes import plot_routes
from .seabed import sample_bottom
from .steering import plot_steering
from .water import sample_field, sample_water

__all__ = [
    "PAGE",
    "Along",
    "Fronts",
    "Mean",
    "Series",
    "along",
    "check_figure",
    "fronts_of",
    "placed",
    "plot_chart",
    "plot_comparison",
    "plot_departures",
    "plot_roadmap",
    "plot_route",
    "plot_routes",
    "plot_steering",
    "sample_bottom",
    "sample_field",
    "sample_water",
    "save_figure",
    "save_page",
]
