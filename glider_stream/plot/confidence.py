"""A route's confidence: its tracks in all members, who arrives by when, and what can be reached."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import Array, Bools
from ..roadmap.problem import Problem
from ..water.inspect import is_steady
from .canvas import GREY, INK, frozen, new_figure, styled, time_unit, when_text
from .scene import KEY_PAD, draw_current, draw_ends, legend_below, map_height
from .water import Frame, frame_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ARRIVES, LOST = "#0072b2", "#d55e00"
"""Colours that differ in print and for people who see few colours (Okabe, Ito 2008)."""
MOST_TRACKS = 100

Times = Sequence[tuple[str, Array]]
"""Names, and times of arrival (members,) [s], inf without arrival."""


def plot_confidence(
    problem: Problem,
    tracks: Sequence[Array],
    times: Times,
    others: Sequence[Array],
    radius: float,
    title: str,
    reach: tuple[Array, Array, float] | None = None,
) -> "Figure":
    """Draw the tracks, rows [t, x, y, z], of the first of `times`, and the arrivals of all; `others` are grey.

    Within `radius` [m] of the goal a vehicle arrives. `reach`: places (n, 3) [m], the share of the members in
    which each is reached, and by when [s].
    """
    assert problem.start is not None
    assert problem.goal is not None
    with styled():
        frame = frame_of(problem, np.vstack([track[:, 1:] for track in tracks]))
        panels = 2 if reach is None else 3
        figure = new_figure(6.6 * panels, max(map_height(frame, 5.6), 2.4) + 1.7, title)
        axes = figure.subplots(1, panels)
        _draw_tracks(axes[0], problem, frame, tracks, np.isfinite(times[0][1]), radius)
        _draw_arrivals(axes[1], times, others)
        if reach is not None:
            _draw_reach(figure, axes[2], frame, problem, reach)
        return frozen(figure)


def _draw_tracks(
    ax: Any, problem: Problem, frame: Frame, tracks: Sequence[Array], arrived: Bools, radius: float
) -> None:
    from matplotlib.patches import Circle

    flow, terrain = problem.evaluator.flow, problem.evaluator.terrain
    depth = float(-0.5 * (problem.lo[2] + problem.hi[2]))
    draw_current(ax, flow, terrain, frame, depth, problem.departure, pale=0.6, key=True)
    assert problem.goal is not None
    assert problem.start is not None
    for track, there in list(zip(tracks, arrived, strict=True))[:MOST_TRACKS]:
        line = frame.scaled(track[:, 1:])
        look = (
            {"color": ARRIVES, "zorder": 5} if there else {"color": LOST, "zorder": 6, "linestyle": (0, (4, 1))}
        )
        ax.plot(*line[:, :2].T, linewidth=0.9, alpha=0.6, **look)
    middle = frame.scaled(problem.goal)
    circle = Circle((middle[0], middle[1]), radius / frame.unit, fill=False, edgecolor=INK, zorder=8)
    ax.add_patch(circle)
    draw_ends(ax, frame.scaled(np.stack([problem.start, problem.goal]))[:, :2], 0.7)
    ax.plot([], [], color=ARRIVES, label=f"arrives ({int(arrived.sum())})")
    ax.plot([], [], color=LOST, linestyle=(0, (4, 1)), label=f"does not ({int((~arrived).sum())})")
    legend_below(ax, 4)
    when = when_text(is_steady(flow), problem.departure, problem.departs)
    ax.set(xlabel=frame.labels[0], ylabel=frame.labels[1])
    ax.set_title(f"(a) In all members; the forecast at {depth:.4g} m{when}", pad=KEY_PAD)


def _draw_arrivals(ax: Any, times: Times, others: Sequence[Array]) -> None:
    latest = max((float(t[np.isfinite(t)].max(initial=0.0)) for _, t in times), default=0.0) or 1.0
    unit, name = time_unit(latest)
    for time in others:
        ax.step(*_steps(time, latest, unit), where="post", color=GREY, linewidth=0.6, alpha=0.35)
    for (what, time), style in zip(times, ("-", (0, (4, 1.2)), (0, (1, 1))), strict=False):
        ax.step(*_steps(time, latest, unit), where="post", color=INK, linestyle=style, label=what)
    ax.set(xlabel=f"Time since departure ({name})", ylabel="Arrived (% of members)", ylim=(-2, 104))
    ax.grid(color="#e6e6e6", linewidth=0.6)
    ax.set_title("(b) Who has arrived; grey: the other candidates" if others else "(b) Who has arrived")
    ax.legend(frameon=False, fontsize=8, loc="best")


def _steps(time: Array, latest: float, unit: float) -> tuple[Array, Array]:
    known = np.sort(time[np.isfinite(time) & (time <= latest)])
    share = 100.0 * np.arange(known.size + 1) / max(time.size, 1)
    return np.concatenate([[0.0], known, [1.05 * latest]]) / unit, np.append(share, share[-1])


def _draw_reach(
    figure: "Figure", ax: Any, frame: Frame, problem: Problem, reach: tuple[Array, Array, float]
) -> None:
    place, share, by = reach
    at = frame.scaled(place)
    marks = ax.scatter(at[:, 0], at[:, 1], c=100.0 * share, cmap="viridis", vmin=0, vmax=100, s=26)
    unit, name = time_unit(by)
    assert problem.start is not None
    assert problem.goal is not None
    draw_ends(ax, frame.scaled(np.stack([problem.start, problem.goal]))[:, :2], 0.7)
    ax.set(xlabel=frame.labels[0], ylabel=frame.labels[1], aspect="equal")
    ax.set_title(f"(c) Can be reached by {by / unit:.3g} {name}, by who knows the current")
    figure.colorbar(marks, ax=ax, label="Share of the members (%)", shrink=0.8, pad=0.02)
