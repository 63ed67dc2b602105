"""The paper's figure 5 (c): travel time of the route against the time to compute the roadmap, by method.

Travel time over that of the flow map in the same field, as in route_by_controls.py.

python benchmarks/route_by_time.py [--quick] [--record FILE] -o docs/figures/route_by_time.svg
"""

import numpy as np
from experiment import arguments, collect, over_flow_map, series

from glider_stream.plot import plot_comparison, save_figure

if __name__ == "__main__":
    options = arguments(__doc__)
    rows = over_flow_map(collect(options.record, options.quick))
    lines = series(rows, "route", lambda group: float(np.mean([row["wall_s"] for row in group])))
    title = "Travel time of the route, where there is one"
    labels = "time to build the roadmap [s]", "travel time over the flow map's in the same field"
    save_figure(plot_comparison(lines, title, labels, ("log", "linear")), options.output)
