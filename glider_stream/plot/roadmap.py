"""A figure of a roadmap: its edges over the current, ways out of nodes, travel times, controls."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Index
from ..kernels.flow import Flow
from ..kernels.terrain import Terrain
from ..roadmap.store import StoredRoadmap
from ..water.inspect import is_steady
from .canvas import INK, colours, frozen, new_figure, styled, thinned, time_text, time_unit, when_text
from .scene import MAX_NODES, draw_current, draw_space
from .water import Frame, checked_depths, frame_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..roadmap.problem import Problem
    from ..roadmap.roadmap import Roadmap

MAX_EDGES = 1000
PLACES, SUCCESSIVE = 64, 512
"""The sample: so many edges, one after another, at so many places."""
DIVE, CLIMB = "#3b2a8c", "#f0a04b"


@dataclass(frozen=True)
class _Drawn:
    """The edges that are drawn of a roadmap of nodes `position` (n, 3) [m]: all, or a sample of `all_edges`.

    `source`, `target` (edges,), `time` [s], `glide_angle` and `heading` [rad]; all edges give `degree` (n,).
    """

    position: Array
    degree: Index
    pairs: int
    all_edges: int
    source: Index
    target: NDArray[np.int32]
    time: Array
    glide_angle: Array
    heading: Array

    @classmethod
    def of(cls, road: "Roadmap | StoredRoadmap") -> "_Drawn":
        """Choose the edges, and read those of a roadmap that stays in its file, at a few places of it."""
        degree, count = np.diff(road.indptr), int(road.indptr[-1])
        sizes = road.position, degree, sum(road.counts.values()), count
        if not isinstance(road, StoredRoadmap):
            source = np.repeat(np.arange(degree.size), degree)
            return cls(*sizes, source, road.target, road.time, road.glide_angle, road.heading)
        first = np.linspace(0, max(count - SUCCESSIVE, 0), PLACES).astype(np.int64)
        edges = np.unique(first[:, None] + np.arange(min(SUCCESSIVE, count)))
        source, target = np.searchsorted(road.indptr, edges, side="right") - 1, road.targets(edges)
        time, _, glide_angle, heading, _, _ = road.legs(edges).T
        return cls(*sizes, source, target, time, glide_angle, heading)

    @property
    def whole(self) -> bool:
        """Whether these are all edges."""
        return self.time.size == self.all_edges

    @property
    def name(self) -> str:
        """A name for these edges in titles: empty if they are all."""
        return "" if self.whole else f", of {self.time.size:,} sampled edges"


def plot_roadmap(
    flow: Flow,
    terrain: Terrain,
    problem: "Problem",
    roadmap: "Roadmap | StoredRoadmap",
    depth: float | None = None,
    title: str = "",
) -> "Figure":
    """Draw a roadmap: its map at a `depth` [m] (None: the top), degrees of nodes, edge times, controls, counts.

    Of a roadmap that stays in its file a sample is drawn, and titles say so.

    Of `problem` the box `lo`, `hi` [m], the `departure` [s], which is the time of the map, and `to_lonlat` are
    read.
    """
    with styled():
        drawn, frame = _Drawn.of(roadmap), frame_of(problem, roadmap.position)
        depth = frame.top if depth is None else checked_depths([depth], frame)[0]
        figure = new_figure(14.0, 8.2, f"{title}: roadmap" if title else "Roadmap")
        halves: Any = figure.subfigures(1, 2, width_ratios=(1.0, 1.12), wspace=0.02)
        left, right = halves
        ax = left.add_subplot()
        image = draw_current(ax, flow, terrain, frame, depth, problem.departure, pale=0.5, arrows=24)
        left.colorbar(image, ax=ax, label="Current speed (m/s)", location="bottom", aspect=45, pad=0.01)
        when = when_text(is_steady(flow), problem.departure, problem.departs)
        _draw_edges(ax, frame, drawn, f"over the current at {depth:.4g} m{when}")
        _draw_degree(right.add_subplot(2, 2, 1, projection="3d"), terrain, frame, drawn)
        _draw_facts(right.add_subplot(2, 2, 2), drawn)
        _draw_times(right.add_subplot(2, 2, 3), drawn)
        _draw_steering(right.add_subplot(2, 2, 4), drawn)
        return frozen(figure)


def _draw_edges(ax: Any, frame: Frame, roadmap: _Drawn, over: str) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    edges = roadmap.all_edges
    drawn = thinned(roadmap.time.size, MAX_EDGES)
    # quick edges are short: drawn last, they remain visible
    drawn = drawn[np.argsort(-roadmap.time[drawn], kind="stable")]
    places = frame.scaled(roadmap.position)[:, :2]
    unit, name = time_unit(float(roadmap.time.max(initial=0.0)))
    times = roadmap.time / unit
    lines = LineCollection(
        list(np.stack([places[roadmap.source[drawn]], places[roadmap.target[drawn]]], axis=1)),
        cmap=colours("plasma", 0.0, 0.85),
        linewidths=0.7,
        alpha=0.75,
        zorder=4,
        # a few slow edges would give all others the same colour
        norm=Normalize(0.0, max(float(np.quantile(times, 0.95)), 1e-9) if edges else 1.0),
    )
    lines.set_array(times[drawn])
    ax.add_collection(lines)
    nodes = places[thinned(len(places), MAX_NODES)]
    # many nodes would hide the edges between them
    ax.scatter(*nodes.T, s=min(5.0, 2500.0 / len(nodes)), color=INK, linewidths=0, zorder=5)
    ax.set(xlabel=frame.labels[0], ylabel=frame.labels[1])
    which = "All" if drawn.size == edges else f"{drawn.size:,} of {edges:,}"
    ax.set_title(f"(a) {which} edges {over}")
    if edges:
        look = {"location": "bottom", "aspect": 45, "pad": 0.01, "extend": "max"}
        ax.figure.colorbar(lines, ax=ax, label=f"Travel time of the edge ({name})", **look)


def _draw_degree(ax: Any, terrain: Terrain, frame: Frame, roadmap: _Drawn) -> None:
    degree = roadmap.degree[thinned(len(roadmap.position), MAX_NODES)]
    look = {"c": degree, "cmap": colours("viridis_r"), "s": 9, "alpha": 0.9, "color": None}
    marks = draw_space(ax, terrain, frame, roadmap.position, ticks=3, **look)
    ax.set_title("(b) Ways out of each node", loc="left")
    where = {"location": "bottom", "aspect": 30, "pad": 0.06, "shrink": 0.9}
    ax.figure.colorbar(marks, ax=ax, label="Edges that leave the node (count)", **where)


def _draw_facts(ax: Any, roadmap: _Drawn) -> None:
    nodes, edges = len(roadmap.position), roadmap.all_edges
    facts = [("Nodes", f"{nodes:,}"), ("Pairs evaluated", f"{roadmap.pairs:,}"), ("Edges", f"{edges:,}")]
    facts += [("Edges per node", f"{edges / nodes:.1f}")]
    facts += [("Nodes without a way out", f"{(roadmap.degree == 0).sum():,}")]
    if roadmap.whole:
        into = np.bincount(roadmap.target, minlength=nodes)
        facts += [("Nodes without a way in", f"{(into == 0).sum():,}")]
    else:
        facts += [("Edges sampled, for all below", f"{roadmap.time.size:,}")]
    if edges:
        facts += [("Dives", f"{np.mean(roadmap.glide_angle < 0):.0%}")]
        facts += [("Median edge time", time_text(float(np.median(roadmap.time))))]
        facts += [("Longest edge time", time_text(float(roadmap.time.max())))]
    ax.set(xlim=(0, 1), ylim=(len(facts) + 0.2, -0.4))
    ax.axis("off")
    ax.set_title("Counts")
    for n, (name, value) in enumerate(facts):
        ax.text(0.02, n + 0.5, name, va="center", color="#444444")
        ax.text(0.98, n + 0.5, value, va="center", ha="right", fontweight="bold")
        ax.axhline(n + 1, color="#e0e0e0", linewidth=0.7)


def _draw_times(ax: Any, roadmap: _Drawn) -> None:
    unit, name = time_unit(float(roadmap.time.max(initial=0.0)))
    dives = roadmap.glide_angle < 0
    halves = [roadmap.time[dives] / unit, roadmap.time[~dives] / unit]
    look = {"stacked": True, "color": [DIVE, CLIMB], "label": ["dives", "climbs"], "edgecolor": "white"}
    ax.hist(halves, bins=30, linewidth=0.4, **look)
    ax.spines[["top", "right"]].set_visible(False)
    ax.set(xlabel=f"Travel time of the edge ({name})", ylabel="Edges (count)")
    ax.set_title(f"(c) How long edges take{roadmap.name}")
    ax.legend(frameon=False)


def _draw_steering(ax: Any, roadmap: _Drawn) -> None:
    bearing = np.degrees(0.5 * np.pi - roadmap.heading) % 360.0
    glide = np.degrees(roadmap.glide_angle)
    steepest = max(10.0, 5.0 * np.ceil(np.abs(glide).max(initial=0.0) / 5.0))
    bins = [np.linspace(0, 360, 37), np.linspace(-steepest, steepest, 33)]
    *_, image = ax.hist2d(bearing, glide, bins=bins, cmin=1, cmap=colours("cmo.dense", 0.05))
    ax.set_xticks([0, 90, 180, 270, 360], ["N\n0", "E\n90", "S\n180", "W\n270", "N\n360"])
    ax.axhline(0.0, color=INK, linewidth=0.7)
    ax.set(xlabel="Compass heading (°)", ylabel="Glide angle (°), climbs above 0")
    ax.set_title(f"(d) How one steers{roadmap.name}")
    if glide.size:
        ax.figure.colorbar(image, ax=ax, label="Edges (count)", aspect=25, pad=0.02)
