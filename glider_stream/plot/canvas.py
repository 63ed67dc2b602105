"""What every figure shares: look, units, files.

Only matplotlib's object interface is used: no global state, no window. The layout is frozen and no clock enters a
file, so the same input gives the same bytes.
"""

import contextlib
import importlib
import warnings
from collections.abc import Iterator
from datetime import datetime
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


PASSING, STILL = ", as the route passes nearest", "FROZEN: all legs in the current of the departure"
"""Of which time the currents of a figure are where the clock runs; what a figure says where it does not."""


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """The look of every figure, whatever matplotlibrc says; InputError where the extra is missing."""
    try:
        with warnings.catch_warnings():
            # cmocean 4.0 builds its maps in a way that matplotlib 3.11 calls deprecated
            warnings.simplefilter("ignore")
            importlib.import_module("cmocean")
        style = importlib.import_module("matplotlib.style")
    except ImportError as missing:
        raise InputError(f"drawing needs {missing.name}: pip install glider-stream[plot]") from missing
    with style.context(["default", STYLE]):
        yield


def new_figure(width: float, height: float, title: str) -> "Figure":
    """An empty figure of some inches, its title in bold on top."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    layout = ConstrainedLayoutEngine(h_pad=0.08, w_pad=0.08, hspace=0.03, wspace=0.02)
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    figure.suptitle(title, x=0.012, ha="left", fontsize=13, fontweight="bold")
    return figure


def frozen(figure: "Figure") -> "Figure":
    """The figure with its layout done: another pass, at each saving, would move the panels a little."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure


def colours(name: str, low: float = 0.0, high: float = 1.0, white: float = 0.0) -> "ListedColormap":
    """Part of a colour map, paled by a share of white, so that what is drawn over it shows."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    part = colormaps[name](np.linspace(low, high, 256))
    part[:, :3] += white * (1.0 - part[:, :3])
    return ListedColormap(part, name=name)


def length_unit(*sides: Side) -> tuple[float, str]:
    """Metres, or kilometres where a side is longer than 5 km."""
    return (1e3, "km") if max(high - low for low, high in sides) > 5e3 else (1.0, "m")


def time_unit(seconds: float) -> tuple[float, str]:
    """The unit that a span of time is read in."""
    for limit, unit, name in ((300.0, 1.0, "s"), (3.0 * 3600, 60.0, "min"), (96.0 * 3600, 3600.0, "h")):
        if seconds <= limit:
            return unit, name
    return 86400.0, "days"


def said_time(seconds: float) -> str:
    """A span of time in words."""
    unit, name = time_unit(seconds)
    return f"{seconds / unit:.3g} {name}"


def said_when(steady: bool, seconds: float, departs: datetime | None) -> str:
    """The time of a map, of a flow that changes: the departure's date where it is known, else its seconds."""
    if steady:
        return ""
    return f", t = {said_time(seconds)}" if departs is None else f", {departs:%Y-%m-%d %H:%M} UTC"


def thinned(count: int, most: int) -> NDArray[np.intp]:
    """Numbers below `count`, evenly spread, not more than `most`: a drawing of all would hide itself."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def check_figure(path: str | Path) -> str:
    """The ending of a figure's file; InputError unless it is one that can be drawn, and the file can be made."""
    suffix = Path(path).suffix.lower()
    known = ", ".join(NO_CLOCK)
    got = repr(suffix or "no ending")
    require(suffix in NO_CLOCK, f"the figure {path} must end in one of: {known}; got {got}")
    check_output(path)
    return suffix


def save_figure(figure: "Figure", path: str | Path, dpi: float = 150) -> None:
    """Write a figure as its file's ending says; an old file is replaced by a whole one or not at all."""
    suffix = check_figure(path)
    require(1 <= dpi <= 2400, f"`dpi` must be from 1 to 2400; got {dpi:g}")
    from matplotlib import rc_context

    # without a salt of our own, an SVG's identifiers are random
    with replacing(Path(path)) as temporary, rc_context({"svg.hashsalt": "glider-stream"}):
        figure.savefig(temporary, format=suffix[1:], dpi=dpi, metadata=NO_CLOCK[suffix])
