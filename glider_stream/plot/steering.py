"""A figure of steering: a node's flow map, its folds, the solutions of a target; what each method finds."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter
from scipy.optimize import root

from ..base.arrays import Array
from ..kernels.control import CLIMB, DIVE
from ..kernels.edges import STATUS, Status
from ..roadmap.evaluator import Evaluator
from ..roadmap.neighbours import AllNodes, as_csr
from ..roadmap.steering import FlowMapMethod, Method, StreamlineMethod
from .canvas import GREY, INK, colours, frozen, new_figure, styled, thinned, time_unit
from .scene import draw_current
from .water import Frame, frame_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..roadmap.problem import Problem

MESH = (97, 193)
"""Controls of a figure's fan: glide angles by headings."""
LINES = (9, 33)
"""The number of them that are drawn as lines."""
CANDIDATES = 16
SOURCES = 40
"""The methods are compared on the pairs of this many nodes."""
LANDED = 0.01
"""A solution lands this close to its target [m]."""


class Fan(NamedTuple):
    """A mesh of controls and where they land at one height: angle (n,), heading (m,) [rad], x, y (n, m) [m]."""

    start: Array
    height: float
    angle: Array
    heading: Array
    x: Array
    y: Array


def fan_of(evaluator: Evaluator, start: Array, height: float, departure: float) -> Fan:
    """Return the fan of a point (3,) [m] at a height [m]: all headings, and glide angles that arrive in time."""
    polar = evaluator.polar
    direction = CLIMB if height > start[2] else DIVE
    angle = np.linspace(polar.shallowest[direction], polar.steepest[direction], 20 * MESH[0])
    sink = np.interp(angle, np.linspace(angle[0], angle[-1], polar.speed.shape[1]), polar.speed[direction])
    horizon = evaluator.integration.dt * evaluator.integration.steps
    in_time = angle[sink * np.sin(angle) * horizon >= abs(height - start[2])]
    angle = np.linspace(in_time[0], in_time[-1], MESH[0])
    heading = np.linspace(0.0, 2.0 * math.pi, MESH[1])
    mesh = np.meshgrid(angle, heading, indexing="ij")
    at = evaluator.landings(start, height, mesh[0].ravel(), mesh[1].ravel(), departure).reshape(*MESH, 2)
    return Fan(start, height, angle, heading, at[..., 0], at[..., 1])


def solutions(evaluator: Evaluator, fan: Fan, goal: Array, departure: float) -> Array:
    """Return all controls of a fan's mesh that lead to a goal (3,) [m]: angle, heading (n, 2) [rad]."""
    miss = np.hypot(fan.x - goal[0], fan.y - goal[1])
    lowest = miss == minimum_filter(miss, size=3, mode=("nearest", "wrap"))

    def off(control: Array) -> Array:
        angle = np.clip(control[:1], fan.angle[0], fan.angle[-1])
        return np.asarray(evaluator.landings(fan.start, fan.height, angle, control[1:], departure)[0] - goal[:2])

    found: list[Array] = []
    for i, j in zip(*np.nonzero(lowest), strict=True):
        solved = root(off, [fan.angle[i], fan.heading[j]], options={"xtol": 1e-10})
        control = np.array([solved.x[0], solved.x[1] % (2.0 * math.pi)])
        inside = fan.angle[0] <= control[0] <= fan.angle[-1] and np.hypot(*solved.fun) < LANDED
        if inside and all(np.abs(control - other).max() > 1e-4 for other in found):
            found.append(control)
    return np.array(found).reshape(-1, 2)


def folded(fan: Fan) -> NDArray[np.bool_]:
    """Return where the fan's map is folded over: where its Jacobian has the rarer sign, (n, m)."""
    x_a, x_h = np.gradient(fan.x, fan.angle, fan.heading)
    y_a, y_h = np.gradient(fan.y, fan.angle, fan.heading)
    sign = x_a * y_h - x_h * y_a > 0.0
    return np.asarray(sign != (sign.mean() > 0.5))


def plot_steering(problem: "Problem", position: Array, start: Array, goal: Array, title: str = "") -> "Figure":
    """Draw how legs are found: a fan from `start`, its mesh at the depth of `goal` (3,) [m], results of methods.

    `position` (n, 3) [m] are the roadmap's nodes.
    """
    evaluator = problem.evaluator
    with styled():
        frame = frame_of(problem, np.vstack([start, goal]))
        fan = fan_of(evaluator, start, float(goal[2]), problem.departure)
        solved = solutions(evaluator, fan, goal, problem.departure)
        figure = new_figure(14.0, 11.4, title or "Steering by the flow map")
        axes: Any = figure.subplots(2, 2)
        _draw_paths(axes[0, 0], evaluator, problem, frame, fan, goal, solved)
        _draw_mesh(axes[0, 1], evaluator, problem, frame, fan, goal, position)
        _draw_controls(axes[1, 0], evaluator, problem, fan, goal, solved)
        _draw_found(axes[1, 1], evaluator, problem, position)
        return frozen(figure)


def _draw_water(ax: Any, evaluator: Evaluator, problem: "Problem", frame: Frame, height: float) -> Any:
    look: dict[str, Any] = {"pale": 0.65, "arrows": 20}
    image = draw_current(ax, evaluator.flow, evaluator.terrain, frame, -height, problem.departure, **look)
    ax.set(xlabel=frame.labels[0], ylabel=frame.labels[1])
    return image


def _draw_paths(
    ax: Any, evaluator: Evaluator, problem: "Problem", frame: Frame, fan: Fan, goal: Array, solved: Array
) -> None:
    from matplotlib.collections import LineCollection

    _draw_water(ax, evaluator, problem, frame, fan.height)
    chosen = np.meshgrid(thinned(MESH[0], 4), thinned(MESH[1], 25)[:-1], indexing="ij")
    share = np.linspace(0.0, 1.0, 25)[1:]
    angle, heading = fan.angle[chosen[0].ravel()], fan.heading[chosen[1].ravel()]

    def flown(angles: Array, headings: Array) -> Array:
        heights = fan.start[2] + share * (fan.height - fan.start[2])
        steps = [evaluator.landings(fan.start, at, angles, headings, problem.departure) for at in heights]
        begin = np.broadcast_to(fan.start[:2], (1, angles.size, 2))
        return np.asarray(np.concatenate([begin, steps]).swapaxes(0, 1) / frame.unit)

    lines = LineCollection(
        list(flown(angle, heading)), cmap=colours("viridis", 0.0, 0.85), linewidths=0.9, zorder=4
    )
    lines.set_array(np.degrees(angle))
    ax.add_collection(lines)
    if len(solved):
        for path in flown(solved[:, 0], solved[:, 1]):
            ax.plot(*path.T, color=INK, linewidth=2.2, zorder=6)
    _draw_point(ax, fan.start / frame.unit, "o")
    _draw_point(ax, goal / frame.unit, "*")
    legs = f"{len(solved)} leg{'' if len(solved) == 1 else 's'}"
    ax.set_title(f"(a) A fan, over the current at {-fan.height:.4g} m;\nblack: {legs} to the star")
    ax.figure.colorbar(lines, ax=ax, label="Glide angle (degrees)", location="bottom", aspect=45, pad=0.01)


def _draw_mesh(
    ax: Any, evaluator: Evaluator, problem: "Problem", frame: Frame, fan: Fan, goal: Array, position: Array
) -> None:
    image = _draw_water(ax, evaluator, problem, frame, fan.height)
    for i in thinned(MESH[0], LINES[0]):
        ax.plot(fan.x[i] / frame.unit, fan.y[i] / frame.unit, color="#30307a", linewidth=0.9, zorder=4)
    for j in thinned(MESH[1], LINES[1]):
        ax.plot(fan.x[:, j] / frame.unit, fan.y[:, j] / frame.unit, color="#b3541e", linewidth=0.7, zorder=4)
    at_depth = np.flatnonzero(position[:, 2] == fan.height)
    nodes, rows = replace(evaluator, steering=FlowMapMethod()).reach_point(
        position, fan.start, problem.departure, False
    )
    reached = np.isin(at_depth, nodes[rows[:, STATUS] == Status.CONNECTED])
    for which, face in ((reached, INK), (~reached, "white")):
        marks = position[at_depth[which], :2] / frame.unit
        ax.scatter(*marks.T, s=14, facecolors=face, edgecolors=INK, linewidths=0.6, zorder=5)
    _draw_point(ax, fan.start / frame.unit, "o")
    _draw_point(ax, goal / frame.unit, "*")
    ax.set_title(
        f"(b) Its mesh at {-fan.height:.4g} m, blue: one glide angle, brown: one heading;\n"
        "nodes at that depth, filled where they are reached"
    )
    where = f"Current speed at {-fan.height:.4g} m (m/s)"
    ax.figure.colorbar(image, ax=ax, label=where, location="bottom", aspect=45, pad=0.01)


def _compass(heading: Array) -> Array:
    """Return headings from 0 to 2 pi [rad] as degrees clockwise from north, from 90 down to -270."""
    return np.asarray(90.0 - np.degrees(heading))


def _draw_controls(
    ax: Any, evaluator: Evaluator, problem: "Problem", fan: Fan, goal: Array, solved: Array
) -> None:
    from matplotlib.colors import LogNorm

    miss = np.hypot(fan.x - goal[0], fan.y - goal[1])
    compass, angle = _compass(fan.heading), np.degrees(fan.angle)
    shade = colours("cividis", 0.15, 1.0)
    image = ax.pcolormesh(compass, angle, np.maximum(miss, 1.0), cmap=shade, norm=LogNorm(), shading="gouraud")
    over = folded(fan)
    if over.any():
        ax.contourf(compass, angle, over, levels=[0.5, 1.5], colors="none", hatches=["////"])
        ax.contour(compass, angle, over, levels=[0.5], colors=INK, linewidths=0.8)
    line = evaluator.control_line(fan.start, goal, CANDIDATES, problem.departure)
    nearest = 0.0
    if len(line):
        ends = evaluator.landings(fan.start, fan.height, line[:, 0], line[:, 1], problem.departure)
        nearest = float(np.hypot(*(ends - goal[:2]).T).min())
        at = _compass(line[:, 1] % (2.0 * math.pi)), np.degrees(line[:, 0])
        ax.scatter(*at, s=26, c="white", edgecolors=INK, zorder=5)
    legs = _compass(solved[:, 1]), np.degrees(solved[:, 0])
    ax.scatter(*legs, marker="*", s=230, c="#e0261c", ec="white", zorder=6)
    ax.set(xlabel="Heading, clockwise from north (degrees)", ylabel="Glide angle (degrees)")
    ax.set(xlim=(-270, 90), ylim=(angle[0], angle[-1]))
    ax.set_xticks(range(-270, 91, 45), [f"{tick % 360}" for tick in range(-270, 91, 45)])
    ax.set_title(
        f"(c) Every control's miss of the star; red: the legs, white: the control line\n"
        f"(nearest {nearest:.3g} m off), hatched: the map is folded over"
    )
    ax.figure.colorbar(image, ax=ax, label="Distance from the target (m)", location="bottom", aspect=45, pad=0.01)


def _draw_found(ax: Any, evaluator: Evaluator, problem: "Problem", position: Array) -> None:
    source = thinned(len(position), SOURCES)
    law = AllNodes().among(position, 1.0)
    indptr, target = as_csr([law.of(position[n]) for n in source])
    methods: dict[str, Method] = {
        "flow map": FlowMapMethod(),
        f"control line, {CANDIDATES} candidates, refined": StreamlineMethod(CANDIDATES, refine=True),
        f"control line, {CANDIDATES} candidates": StreamlineMethod(CANDIDATES),
    }
    rows = {
        name: replace(evaluator, steering=method).connect(position, problem.departure, source, indptr, target)
        for name, method in methods.items()
    }
    exact = rows["flow map"]
    connected = exact[:, STATUS] == Status.CONNECTED
    unit, name_of_unit = time_unit(float(exact[connected, 1].max(initial=0.0)))
    edges = np.linspace(0.0, float(exact[connected, 1].max(initial=1.0)) / unit, 26)
    for (name, found), (face, hatch) in zip(
        rows.items(), (("#d9d9d9", ""), ("#7fa6c9", "///"), ("#1f4e79", "")), strict=True
    ):
        both = connected & (found[:, STATUS] == Status.CONNECTED)
        share = both.sum() / max(connected.sum(), 1)
        label = f"{name}: {both.sum():,} ({share:.0%})"
        ax.hist(
            exact[both, 1] / unit, edges, label=label, facecolor=face, hatch=hatch, edgecolor=GREY, linewidth=0.5
        )
    ax.set(
        xlabel=f"Time of the fastest leg ({name_of_unit})", ylabel=f"Connections of {len(source)} nodes (count)"
    )
    ax.set_title("(d) What each method finds of what the flow map finds")
    ax.margins(y=0.3)
    ax.legend(loc="upper left", frameon=False)


def _draw_point(ax: Any, place: Array, marker: str) -> None:
    size = 200 if marker == "*" else 70
    ax.scatter(*place[:2], marker=marker, s=size, facecolors="white", edgecolors=INK, linewidths=1.4, zorder=9)
