"""The paper's figure 4: the route on its own problem with 16 and with 54 controls, among all pairs of nodes.

python benchmarks/two_cases.py [--quick] -o docs/figures

Draws seed-box-16.png and seed-box-54.png into the folder.
"""

import argparse
from pathlib import Path

from PIL import Image

from glider_stream import planner
from glider_stream.opened import OpenedRoadmap

CASES = (16, 54)

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer nodes, exact legs: to see that it runs")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the folder for the figures")
    options = parser.parse_args()
    for candidates in CASES:
        overrides = ["neighbours.kind=all", f"steering.candidates={candidates}"]
        if options.quick:
            overrides = ["sampling.shape=[5,5,3]", "neighbours.kind=all", "steering.method=flow-map"]
        roadmap = planner.build("seed-box", overrides=overrides)
        path = planner.query(roadmap)
        print(f"{candidates} controls: {roadmap}\n{path}")
        file = options.output / f"seed-box-{candidates}.png"
        OpenedRoadmap(roadmap, f"Seed box, {candidates} controls").plot(path, file)
        Image.open(file).convert("RGB").quantize(128).save(file, optimize=True)
