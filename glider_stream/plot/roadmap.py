"""A figure of a roadmap: its edges over the current, ways out of nodes, travel times, controls."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels.flow import Flow
from ..kernels.terrain import Terrain
from ..water.inspect import is_steady
from .canvas import INK, colours, frozen, new_figure, styled, thinned, time_text, time_unit, when_text
from .scene import MAX_NODES, draw_current, draw_space
from .water import Frame, checked_depths, frame_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..roadmap.problem import Problem
    from ..roadmap.roadmap import Roadmap

MAX_EDGES = 1000
DIVE, CLIMB = "#3b2a8c", "#f0a04b"


def plot_roadmap(
    flow: Flow,
    terrain: Terrain,
    problem: "Problem",
    roadmap: "Roadmap",
    depth: float | None = None,
    title: str = "",
) -> "Figure":
    """Draw a roadmap: its map at a `depth` [m] (None: the top), degrees of nodes, edge times, controls, counts.

    Of `problem` the box `lo`, `hi` [m], the `departure` [s], which is the time of the map, and `to_lonlat` are
    read.
    """
    with styled():
        frame = frame_of(problem, roadmap.position)
        depth = frame.top if depth is None else checked_depths([depth], frame)[0]
        figure = new_figure(14.0, 8.2, f"{title}: roadmap" if title else "Roadmap")
        halves: Any = figure.subfigures(1, 2, width_ratios=(1.0, 1.12), wspace=0.02)
        left, right = halves
        ax = left.add_subplot()
        image = draw_current(ax, flow, terrain, frame, depth, problem.departure, pale=0.5, arrows=24)
        left.colorbar(image, ax=ax, label="Current speed (m/s)", location="bottom", aspect=45, pad=0.01)
        when = when_text(is_steady(flow), problem.departure, problem.departs)
        _draw_edges(ax, frame, roadmap, f"over the current at {depth:.4g} m{when}")
        _draw_degree(right.add_subplot(2, 2, 1, projection="3d"), terrain, frame, roadmap)
        _draw_facts(right.add_subplot(2, 2, 2), roadmap)
        _draw_times(right.add_subplot(2, 2, 3), roadmap)
        _draw_steering(right.add_subplot(2, 2, 4), roadmap)
        return frozen(figure)


def _draw_edges(ax: Any, frame: Frame, roadmap: "Roadmap", over: str) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    edges = roadmap.target.size
    drawn = thinned(edges, MAX_EDGES)
    # quick edges are short: drawn last, they remain visible
    drawn = drawn[np.argsort(-roadmap.time[drawn], kind="stable")]
    source = np.repeat(np.arange(len(roadmap.position)), np.diff(roadmap.indptr))
    places = frame.scaled(roadmap.position)[:, :2]
    unit, name = time_unit(float(roadmap.time.max(initial=0.0)))
    times = roadmap.time / unit
    lines = LineCollection(
        list(np.stack([places[source[drawn]], places[roadmap.target[drawn]]], axis=1)),
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


def _draw_degree(ax: Any, terrain: Terrain, frame: Frame, roadmap: "Roadmap") -> None:
    degree = np.diff(roadmap.indptr)[thinned(len(roadmap.position), MAX_NODES)]
    look = {"c": degree, "cmap": colours("viridis_r"), "s": 9, "alpha": 0.9, "color": None}
    marks = draw_space(ax, terrain, frame, roadmap.position, ticks=3, **look)
    ax.set_title("(b) Ways out of each node", loc="left")
    where = {"location": "bottom", "aspect": 30, "pad": 0.06, "shrink": 0.9}
    ax.figure.colorbar(marks, ax=ax, label="Edges that leave the node (count)", **where)


def _draw_facts(ax: Any, roadmap: "Roadmap") -> None:
    nodes, edges, pairs = len(roadmap.position), roadmap.target.size, sum(roadmap.counts.values())
    out, into = np.diff(roadmap.indptr), np.bincount(roadmap.target, minlength=nodes)
    facts = [("Nodes", f"{nodes:,}"), ("Pairs evaluated", f"{pairs:,}"), ("Edges", f"{edges:,}")]
    facts += [("Edges per node", f"{edges / nodes:.1f}")]
    facts += [("Nodes without a way out", f"{(out == 0).sum():,}")]
    facts += [("Nodes without a way in", f"{(into == 0).sum():,}")]
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


def _draw_times(ax: Any, roadmap: "Roadmap") -> None:
    unit, name = time_unit(float(roadmap.time.max(initial=0.0)))
    dives = roadmap.glide_angle < 0
    halves = [roadmap.time[dives] / unit, roadmap.time[~dives] / unit]
    look = {"stacked": True, "color": [DIVE, CLIMB], "label": ["dives", "climbs"], "edgecolor": "white"}
    ax.hist(halves, bins=30, linewidth=0.4, **look)
    ax.spines[["top", "right"]].set_visible(False)
    ax.set(xlabel=f"Travel time of the edge ({name})", ylabel="Edges (count)")
    ax.set_title("(c) How long edges take")
    ax.legend(frameon=False)


def _draw_steering(ax: Any, roadmap: "Roadmap") -> None:
    bearing = np.degrees(0.5 * np.pi - roadmap.heading) % 360.0
    glide = np.degrees(roadmap.glide_angle)
    steepest = max(10.0, 5.0 * np.ceil(np.abs(glide).max(initial=0.0) / 5.0))
    bins = [np.linspace(0, 360, 37), np.linspace(-steepest, steepest, 33)]
    *_, image = ax.hist2d(bearing, glide, bins=bins, cmin=1, cmap=colours("cmo.dense", 0.05))
    ax.set_xticks([0, 90, 180, 270, 360], ["N\n0", "E\n90", "S\n180", "W\n270", "N\n360"])
    ax.axhline(0.0, color=INK, linewidth=0.7)
    ax.set(xlabel="Compass heading (°)", ylabel="Glide angle (°), climbs above 0")
    ax.set_title("(d) How one steers")
    if glide.size:
        ax.figure.colorbar(image, ax=ax, label="Edges (count)", aspect=25, pad=0.02)
