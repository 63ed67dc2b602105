"""A campaign: tracks over the current, who arrives when, a plan against what was flown, times over the best."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..base.arrays import Array
from ..roadmap.problem import Problem
from ..water.inspect import is_steady
from .canvas import GREY, INK, frozen, new_figure, styled, time_unit, when_text
from .scene import draw_current, draw_ends, legend_below, map_height
from .water import Frame, frame_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOOKS: dict[str, tuple[str, Any]] = {
    "replan": ("#d55e00", "-"),
    "assimilate": ("#e69f00", (0, (3, 1, 1, 1))),
    "omniscient": (INK, (0, (1, 1))),
    "open-loop": ("#0072b2", (0, (4, 1.2))),
    "depth-averaged": ("#009e73", (0, (6, 1, 1, 1))),
    "straight": ("#cc79a7", (0, (2, 1))),
}
"""Colour and line of each policy (Okabe, Ito 2008): they differ in print and for people who see few colours."""
FEW = 5
"""With fewer runs each is a mark, since shares and boxes of a few runs say nothing."""
MAP_WIDTH = 5.2
"""The width of a map [inches]."""
MOST_TRACKS = 60
"""So many tracks of each policy are drawn; more would hide the current."""


class Flown(Protocol):
    """A run of a policy: `track` rows [t, x, y, z], `time` [s], its first plan as a `line` (n, 2) [m]."""

    @property
    def arrived(self) -> bool:
        """Whether it arrived."""
        ...

    @property
    def time(self) -> float:
        """How long it took [s]."""
        ...

    @property
    def track(self) -> Array:
        """The rows [t, x, y, z]."""
        ...

    @property
    def line(self) -> Array:
        """The first plan (n, 2) [m]."""
        ...


Runs = Mapping[str, Sequence[Flown]]


def plot_campaign(problem: Problem, runs: Runs, radius: float, depth: float, title: str) -> "Figure":
    """Draw the runs of each policy, over the true current at a `depth` [m]; within `radius` [m] a run arrives.

    Of `problem` the true flow and terrain, the box, start and goal, the departure and `to_lonlat` are read.
    """
    assert problem.start is not None
    assert problem.goal is not None
    with styled():
        points = [run.track[:, 1:] for flown in runs.values() for run in flown[:MOST_TRACKS]]
        frame = frame_of(problem, np.vstack(points))
        count = max(len(flown) for flown in runs.values())
        high = map_height(frame, MAP_WIDTH)
        title = f"{title}: {count:,} run{'s' * (count != 1)} of each policy"
        figure = new_figure(13.0, high + 4.8, title)
        grid = figure.add_gridspec(2, 2, height_ratios=(high + 1.0, 3.4))
        flow, terrain = problem.evaluator.flow, problem.evaluator.terrain
        when = when_text(is_steady(flow), problem.departure, problem.departs)
        maps = [figure.add_subplot(grid[0, n]) for n in range(2)]
        for ax in maps:
            image = draw_current(ax, flow, terrain, frame, depth, problem.departure, pale=0.45)
            ax.set(xlabel=frame.labels[0], ylabel=frame.labels[1])
            _draw_goal(ax, frame, problem.goal, radius)
        look: dict[str, Any] = {"aspect": 30 * high / MAP_WIDTH, "pad": 0.02}
        figure.colorbar(image, ax=maps, label="True current (m/s)", **look)
        _draw_tracks(maps[0], frame, runs)
        maps[0].set_title(f"(a) Tracks over the true current at {depth:.4g} m{when}")
        _draw_plan(maps[1], frame, runs)
        for ax in maps:
            draw_ends(ax, frame.scaled(np.stack([problem.start, problem.goal]))[:, :2], 0.7)
        _draw_arrivals(figure.add_subplot(grid[1, 0]), runs)
        _draw_ratios(figure.add_subplot(grid[1, 1]), runs)
        return frozen(figure)


def _draw_goal(ax: Any, frame: Frame, goal: Array, radius: float) -> None:
    from matplotlib.patches import Circle

    middle = frame.scaled(goal)[:2]
    ax.add_patch(
        Circle((middle[0], middle[1]), radius / frame.unit, fill=False, edgecolor=INK, linewidth=0.9, zorder=8)
    )


def _draw_tracks(ax: Any, frame: Frame, runs: Runs) -> None:
    shown = max(len(flown) for flown in runs.values())
    alpha = float(np.clip(6.0 / shown, 0.12, 0.9))
    for policy, flown in runs.items():
        colour, style = LOOKS[policy]
        look: dict[str, Any] = {"color": colour, "linestyle": style}
        for run in flown[:MOST_TRACKS]:
            line = frame.scaled(run.track[:, 1:])
            ax.plot(*line[:, :2].T, linewidth=1.2, alpha=alpha, zorder=5, **look)
        ax.plot([], [], linewidth=2.0, label=policy, **look)
    legend_below(ax, 5)


def _draw_plan(ax: Any, frame: Frame, runs: Runs) -> None:
    """Draw the first plan of run 0, and what was flown, of replanning or else of the first policy."""
    policy = "replan" if "replan" in runs else next(iter(runs))
    run, (colour, style) = runs[policy][0], LOOKS[policy]
    flown = frame.scaled(run.track[:, 1:])
    plan = frame.scaled(np.column_stack([run.line, np.zeros(len(run.line))]))
    for line, look in (
        (flown, {"color": colour, "linestyle": style}),
        (plan, {"color": INK, "linestyle": (0, (4, 2))}),
    ):
        ax.plot(*line[:, :2].T, color="white", linewidth=3.6, zorder=5)
        ax.plot(*line[:, :2].T, linewidth=1.8, zorder=6, **look)
    ax.plot([], [], color=INK, linestyle=(0, (4, 2)), label="first plan")
    ax.plot([], [], color=colour, linestyle=style, label="flown")
    legend_below(ax, 2)
    ax.set_title(f"(b) Plan and flown: run 0, {policy}")


def _draw_arrivals(ax: Any, runs: Runs) -> None:
    """Draw the share of all runs that have arrived by each time."""
    latest = max((run.time for flown in runs.values() for run in flown if run.arrived), default=1.0)
    unit, name = time_unit(latest)
    if max(len(flown) for flown in runs.values()) < FEW:
        _draw_single(
            ax, {policy: [run.time / unit for run in flown if run.arrived] for policy, flown in runs.items()}
        )
        counts = [f"{sum(run.arrived for run in flown)} of {len(flown)}" for flown in runs.values()]
        ax.set_yticks(range(1, len(runs) + 1), [f"{name} ({n})" for name, n in zip(runs, counts, strict=True)])
        ax.set(xlabel=f"Time since departure ({name})", title="(c) Who has arrived, and when: a mark a run")
        return
    for policy, flown in runs.items():
        colour, line = LOOKS[policy]
        times = np.sort([run.time for run in flown if run.arrived]) / unit
        share = 100.0 * np.arange(times.size + 1) / len(flown)
        at = np.concatenate([[0.0], times, [1.05 * latest / unit]])
        ax.step(at, np.append(share, share[-1]), where="post", color=colour, linestyle=line, label=policy)
    ax.set(xlabel=f"Time since departure ({name})", ylabel="Arrived (% of runs)", ylim=(-2, 104))
    first = min((run.time for flown in runs.values() for run in flown if run.arrived), default=0.0)
    ax.set_xlim(max(0.0, first - 0.1 * (latest - first) - 0.02 * latest) / unit, 1.03 * latest / unit)
    ax.set_title("(c) Who has arrived")
    ax.grid(color="#e6e6e6", linewidth=0.6)
    ax.legend(frameon=False, fontsize=8, loc="best")


def _draw_ratios(ax: Any, runs: Runs) -> None:
    """Draw the times over those of the omniscient policy, run by run where both arrive."""
    names = [policy for policy in runs if policy != "omniscient"]
    if "omniscient" not in runs or not names:
        ax.set_axis_off()
        return
    best = runs["omniscient"]
    ratios = [
        [
            run.time / ideal.time
            for run, ideal in zip(runs[name], best, strict=True)
            if run.arrived and ideal.arrived
        ]
        for name in names
    ]
    if len(best) < FEW:
        _draw_single(ax, dict(zip(names, ratios, strict=True)))
    else:
        _draw_boxes(ax, names, ratios)
    ax.axvline(1.0, color=GREY, linewidth=0.8)
    ax.set_yticks(
        range(1, len(names) + 1), [f"{name} ({len(some)})" for name, some in zip(names, ratios, strict=True)]
    )
    ax.set(xlabel="Time over the omniscient's (runs in which both arrive)")
    what = "a mark a run" if len(best) < FEW else "half of the runs in a box"
    ax.set_title(f"(d) How much longer it takes; {what}")


def _draw_single(ax: Any, values: Mapping[str, Sequence[float]]) -> None:
    """Draw a mark for each value of each policy, a policy a row."""
    for row, (policy, some) in enumerate(values.items(), 1):
        look: dict[str, Any] = {"s": 60, "color": LOOKS[policy][0], "edgecolors": INK, "linewidths": 0.8}
        ax.scatter(some, np.full(len(some), row), zorder=4, **look)
    ax.set_ylim(0.4, len(values) + 0.6)
    ax.grid(color="#e6e6e6", linewidth=0.6)


def _draw_boxes(ax: Any, names: Sequence[str], ratios: Sequence[Sequence[float]]) -> None:
    look = {"color": INK, "linewidth": 1.2}
    boxes = ax.boxplot(ratios, orientation="horizontal", widths=0.6, medianprops=look, patch_artist=True)
    for box, name in zip(boxes["boxes"], names, strict=True):
        box.set(facecolor=LOOKS[name][0], alpha=0.55)
    for flier in boxes["fliers"]:
        flier.set(marker=".", markersize=3, markeredgecolor=GREY)
