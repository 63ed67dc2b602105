"""What all figures share: style, units, files.

Only matplotlib's object interface is used: there is no global state and no window. The layout is frozen and no
time of day enters a file, so the same input gives the same bytes.
"""

import contextlib
import importlib
import warnings
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..base.output import check_output, replacing
from ..base.settings import require

if TYPE_CHECKING:
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure

Side = tuple[float, float]

INK, GREY = "#1a1a1a", "#9a9a9a"
STYLE = {"font.size": 9, "axes.titlesize": 9.5, "axes.titlelocation": "left", "axes.linewidth": 0.7}
NO_CLOCK: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}


EARLIEST = " by the earliest way to each node"
"""Fronts with the clock running follow no later ways; a route may."""
PASSING, STILL = ", as the route passes nearest", "FROZEN: all legs in the current of the departure"
"""Texts of figures: PASSING gives the time of the currents if the clock runs, STILL says that it does not run."""


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Apply the style of all figures in the block, independent of matplotlibrc; InputError without the extra."""
    try:
        with warnings.catch_warnings():
            # matplotlib 3.11 warns about the way in which cmocean 4.0 builds its maps
            warnings.simplefilter("ignore")
            importlib.import_module("cmocean")
        style = importlib.import_module("matplotlib.style")
    except ImportError as missing:
        raise InputError(f"drawing needs {missing.name}: pip install glider-stream[plot]") from missing
    with style.context(["default", STYLE]):
        yield


def new_figure(width: float, height: float, title: str) -> "Figure":
    """Return an empty figure, `width` by `height` [inches], with a bold title on top."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    layout = ConstrainedLayoutEngine(h_pad=0.08, w_pad=0.08, hspace=0.03, wspace=0.02)
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    figure.suptitle(title, x=0.012, ha="left", fontsize=13, fontweight="bold")
    return figure


def frozen(figure: "Figure") -> "Figure":
    """Return the figure with a fixed layout; otherwise each saving would move the panels a little.

    The last digit of the solver's places depends on where its constraints lie in memory, so it is rounded away:
    the same input gives the same file.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for ax in figure.axes:
        x, y, wide, high = (round(float(part), 9) for part in ax.get_position(original=True).bounds)
        ax.set_position((x, y, wide, high), which="original")
        if ax.get_axes_locator() is None:  # colour bars follow their maps when they are drawn
            ax.apply_aspect()
    return figure


def colours(name: str, low: float = 0.0, high: float = 1.0, white: float = 0.0) -> "ListedColormap":
    """Return part of a colour map, mixed with a share of white so that lines on it can be seen."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    part = colormaps[name](np.linspace(low, high, 256))
    part[:, :3] += white * (1.0 - part[:, :3])
    return ListedColormap(part, name=name)


def length_unit(*sides: Side) -> tuple[float, str]:
    """Return the factor and name of metres, or of kilometres if a side is longer than 5 km."""
    return (1e3, "km") if max(high - low for low, high in sides) > 5e3 else (1.0, "m")


def time_unit(seconds: float) -> tuple[float, str]:
    """Return the factor and name of the unit for a span of time [s]."""
    for limit, unit, name in ((300.0, 1.0, "s"), (3.0 * 3600, 60.0, "min"), (96.0 * 3600, 3600.0, "h")):
        if seconds <= limit:
            return unit, name
    return 86400.0, "days"


def time_text(seconds: float) -> str:
    """Return a span of time [s] as text."""
    unit, name = time_unit(seconds)
    return f"{seconds / unit:.3g} {name}"


def departs_text(departs: datetime | None, seconds: float) -> str:
    """Return the dates of a departure and of the arrival so much later, as text; empty if unknown."""
    if departs is None:
        return ""
    arrives = departs + timedelta(seconds=seconds)
    return f", departs {departs:%Y-%m-%d %H:%M} UTC, arrives {arrives:%Y-%m-%d %H:%M} UTC"


HOURS = (1, 2, 3, 6, 12, 24, 48, 96, 168, 336)
"""The allowed distances of two dates on an axis [h]."""
MOST_DATES = 6


def draw_dates(ax: Any, departs: datetime | None, seconds: float, unit: float) -> None:
    """Draw round dates above a panel whose axis is the time since `departs`, in `unit` [s], to `seconds`."""
    if departs is None:
        return
    step = next((3600 * n for n in HOURS if seconds / (3600 * n) <= MOST_DATES), 3600 * HOURS[-1])
    begins = departs.replace(tzinfo=UTC).timestamp()
    at = np.arange(np.ceil(begins / step), np.floor((begins + seconds) / step) + 1) * step - begins
    above = ax.secondary_xaxis("top")
    form = "%d %b" if step >= 86_400 else "%d %b %H:%M"
    above.set_xticks(at / unit, [f"{departs + timedelta(seconds=float(after)):{form}}" for after in at])
    above.tick_params(labelsize=8, length=3)


def when_text(steady: bool, seconds: float, departs: datetime | None) -> str:
    """Return the time of a map as text: the departure's date if known, else its seconds; empty if steady."""
    if steady:
        return ""
    return f", t = {time_text(seconds)}" if departs is None else f", {departs:%Y-%m-%d %H:%M} UTC"


def thinned(count: int, most: int) -> NDArray[np.intp]:
    """Return at most `most` numbers below `count`, evenly spread: a drawing of all would be unreadable."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def check_figure(path: str | Path) -> str:
    """Return the ending of a figure's file; InputError unless it can be drawn and the file can be made."""
    suffix = Path(path).suffix.lower()
    known = ", ".join(NO_CLOCK)
    got = repr(suffix or "no ending")
    require(suffix in NO_CLOCK, f"the figure {path} must end in one of: {known}; got {got}")
    check_output(path)
    return suffix


def save_figure(figure: "Figure", path: str | Path, dpi: float = 150) -> None:
    """Write a figure in the form of its file's ending; an old file is replaced whole or not at all."""
    suffix = check_figure(path)
    require(1 <= dpi <= 2400, f"`dpi` must be from 1 to 2400; got {dpi:g}")
    from matplotlib import rc_context

    # without a fixed salt, an SVG's identifiers are random
    with replacing(Path(path)) as temporary, rc_context({"svg.hashsalt": "glider-stream"}):
        figure.savefig(temporary, format=suffix[1:], dpi=dpi, metadata=NO_CLOCK[suffix])
