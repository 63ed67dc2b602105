"""Builds of one small problem by every method."""

from functools import cache
from pathlib import Path

import h5py

from glider_stream.roadmap import store
from glider_stream.roadmap.builder import build_roadmap
from glider_stream.scenario import read_scenario

METHODS = {
    "streamline": [],
    "refine": ["steering.refine=true"],
    "surface": ["steering.method=surface"],
    "flow-map": ["steering.method=flow-map"],
    "reachable": ["steering.method=flow-map", "neighbours.kind=reachable", "neighbours.limit=12"],
}

BATCH = 400


def problem(place, overrides=()):
    return read_scenario(place / "small.toml", overrides).problem()


def datasets(path):
    """The bytes of every dataset."""
    with h5py.File(path) as file:
        found = {}
        keep = lambda name, one: found.update({name: one[()].tobytes()}) if hasattr(one, "dtype") else None  # noqa: E731
        file.visititems(keep)
        counts = {name: int(n) for name, n in file["pairs"].attrs.items() if name not in ("wall_s", "threads")}
    return found, counts


@cache
def expected(method):
    road = build_roadmap(read_scenario(Path("small.toml"), METHODS[method]).problem())
    store.write_roadmap(road, f"expected-{method}.h5")
    return datasets(f"expected-{method}.h5")


def interrupt(progress):
    raise KeyboardInterrupt
