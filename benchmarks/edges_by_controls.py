"""The paper's figure 5 (a): edges in the roadmap against the number of controls, by method.

python benchmarks/edges_by_controls.py [--quick] [--record FILE] -o docs/figures/edges_by_controls.svg
"""

from experiment import arguments, collect, series

from glider_stream.plot import plot_comparison, save_figure

if __name__ == "__main__":
    options = arguments(__doc__)
    rows = collect(options.record, options.quick)
    lines = series(rows, "edges", lambda group: group[0]["controls"])
    title = "Edges found among 27 nearest neighbours"
    labels = "controls per pair", "edges in the roadmap"
    save_figure(plot_comparison(lines, title, labels, ("log", "log")), options.output)
