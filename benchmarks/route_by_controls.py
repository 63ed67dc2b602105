"""The paper's figure 5 (b): travel time of the route against the number of controls, by method.

Travel time over that of the flow map in the same field, so that fields do not blur what methods do. Means are
over the fields in which the method finds a route, and say in how many that is.

python benchmarks/route_by_controls.py [--quick] [--record FILE] -o docs/figures/route_by_controls.svg
"""

from experiment import arguments, collect, over_flow_map, series

from glider_stream.plot import plot_comparison, save_figure

if __name__ == "__main__":
    options = arguments(__doc__)
    rows = over_flow_map(collect(options.record, options.quick))
    lines = series(rows, "route", lambda group: group[0]["controls"])
    title = "Travel time of the route, where there is one"
    labels = "controls per pair", "travel time over the flow map's in the same field"
    save_figure(plot_comparison(lines, title, labels, ("log", "linear")), options.output)
