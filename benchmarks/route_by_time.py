"""The paper's figure 5 (c): travel time of the route against the time to compute the roadmap, by method.

python benchmarks/route_by_time.py [--quick] [--record FILE] -o docs/figures/route_by_time.svg
"""

import numpy as np
from experiment import arguments, collect, series

from glider_stream.plot import plot_comparison, save_figure

if __name__ == "__main__":
    options = arguments(__doc__)
    rows = collect(options.record, options.quick)
    lines = series(rows, "route_s", lambda group: float(np.mean([row["wall_s"] for row in group])))
    title = "Travel time of the route (fields that have one)"
    labels = "time to build the roadmap [s]", "travel time [s]"
    save_figure(plot_comparison(lines, title, labels, ("log", "linear")), options.output)
