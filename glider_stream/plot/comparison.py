"""Comparisons: a quantity of each method, with confidence intervals, against controls or time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from .canvas import GREY, INK, frozen, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOOKS = (("#0072b2", "o", "-"), ("#d55e00", "s", "--"), ("#009e73", "^", "-."), (INK, "D", ":"))
"""Colour, marker and line of each series: also for grey prints and colour-blind readers (Okabe and Ito 2008)."""


class Mean(NamedTuple):
    """A mean at `x` (None if it holds for every x), the ends of its interval, and a note."""

    x: float | None
    mean: float
    low: float
    high: float
    note: str = ""


@dataclass(frozen=True)
class Series:
    """The means of one method."""

    name: str
    points: Sequence[Mean]


def plot_comparison(
    series: Sequence[Series], title: str, labels: tuple[str, str], scales: tuple[str, str] = ("linear", "linear")
) -> "Figure":
    """Draw means and intervals of up to four series over a common axis; `labels` include units."""
    with styled():
        from matplotlib.ticker import LogLocator, NullFormatter

        figure = new_figure(6.2, 4.2, title)
        axes = figure.add_subplot()
        axes.set(xlabel=labels[0], ylabel=labels[1], xscale=scales[0], yscale=scales[1])
        for method, (colour, marker, line) in zip(series, LOOKS, strict=False):
            points = [point for point in method.points if point.x is not None]
            for level in (point for point in method.points if point.x is None):
                name = f"{method.name} ({level.note})" if level.note else method.name
                axes.axhline(level.mean, color=colour, linestyle=line, label=name)
                axes.axhspan(level.low, level.high, color=colour, alpha=0.15, linewidth=0)
            if not points:
                continue
            below, above = [p.mean - p.low for p in points], [p.high - p.mean for p in points]
            axes.errorbar(
                [p.x or 0.0 for p in points], [p.mean for p in points], yerr=[below, above], label=method.name,
                color=colour, marker=marker, linestyle=line, markersize=4.5, capsize=2.5, linewidth=1.2,
            )  # fmt: skip
            # notes of the first series are above, of others below, so that they rarely overlap
            up = 1 if method is series[0] else -1
            for p in points:
                axes.annotate(
                    p.note, (p.x or 0.0, p.high if up > 0 else p.low), xytext=(0, 4 * up), color=colour,
                    textcoords="offset points", ha="center", va="bottom" if up > 0 else "top", fontsize=6.5,
                )  # fmt: skip
        for axis, scale in ((axes.xaxis, scales[0]), (axes.yaxis, scales[1])):
            if scale == "log":
                axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                axis.set_major_formatter(lambda value, place: f"{value:,.10g}")
                axis.set_minor_formatter(NullFormatter())
        axes.grid(color=GREY, alpha=0.3, linewidth=0.5)
        axes.legend(frameon=False)
        return frozen(figure)
