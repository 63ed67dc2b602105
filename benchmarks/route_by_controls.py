"""The paper's figure 5 (b): travel time of the route against the number of controls, by method.

Means are over the fields in which the method finds a route, and say in how many that is.

python benchmarks/route_by_controls.py [--quick] [--record FILE] -o docs/figures/route_by_controls.svg
"""

from experiment import arguments, collect, series

from glider_stream.plot import plot_comparison, save_figure

if __name__ == "__main__":
    options = arguments(__doc__)
    rows = collect(options.record, options.quick)
    lines = series(rows, "route_s", lambda group: group[0]["controls"])
    title = "Travel time of the route (fields that have one)"
    labels = "controls per pair", "travel time [s]"
    save_figure(plot_comparison(lines, title, labels, ("log", "linear")), options.output)
