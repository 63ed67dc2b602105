"""A page: an interactive view of a route in one HTML file, which loads nothing from a network.

The files beside this one make it: `page.html` is its body, `page.css` its style; of its script, `page-data.js`
reads, `page-map.js` and `page-profile.js` draw, and `page.js` moves. All data stand in the page as one JSON text.
The policy in `page.html` forbids the browser to load anything else.
"""

import html
import json
import math
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path as File
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.arrays import Array
from ..base.output import replacing
from ..base.settings import require
from ..kernels.flow import Flow, OceanGrid, cycle
from ..kernels.terrain import Terrain
from ..water.inspect import is_steady
from .along import along
from .canvas import STILL, length_unit, thinned, time_text, time_unit, when_text
from .fronts import HOUR, Fronts, front_times
from .route import map_depths
from .seabed import sample_bottom
from .water import Frame, frame_of, sample_field

if TYPE_CHECKING:
    from ..roadmap.problem import Problem
    from ..search.path import Path

PAGE = ".html"
SCRIPT = ("page-data.js", "page-map.js", "page-profile.js", "page.js")
CURRENT_CELLS, SEABED_CELLS, LONLAT_POINTS = 56, 160, 33
"""Numbers of points along the longer side of the map; the page interpolates linearly between them."""
MOST_MOMENTS, MOMENTS_A_CYCLE = 33, 16
"""Numbers of times at which the page holds a current that changes: at most, and for each cycle of the flow."""
AT_SLIDER = ", at the time of the slider"
MOST_ROWS = 20_000
"""The most rows of a trajectory; a longer one is thinned, and its ends are kept."""
FEWEST = 4  # rows of a leg
MOST_OF_PLAN = 400
"""The most points of a plan's line."""


class Replay(NamedTuple):
    """What a page shows of a flown run besides its path: a sentence, and the plans.

    `plans`: the time [s since departure] at which each plan was made, and its line (n, 2) [m].
    """

    told: str
    plans: Sequence[tuple[float, Array]]


def save_page(
    file: str | File,
    flow: Flow,
    terrain: Terrain,
    problem: "Problem",
    position: Array,
    path: "Path",
    depths: Sequence[float] | None = None,
    fronts: tuple[Fronts, float] | None = None,
    title: str = "",
    replay: Replay | None = None,
) -> None:
    """Write the page of a path that is `placed`; an old file is replaced whole or not at all.

    The current is shown at up to four `depths` [m], which `plot_route` chooses from the nodes `position` (n, 3)
    [m]; `fronts`: the fronts and the hours between them; `replay`: what else belongs to a flown run. Of `problem`
    the box `lo`, `hi` [m], the `departure` [s] and `to_lonlat` are read.
    """
    require(len(path.legs) > 0, "a route to draw must have a leg; got a path without any")
    rows = np.asarray(path.trajectory, np.float64)
    frame = frame_of(problem, np.vstack([rows[:, 1:], path.legs[0].start, path.legs[-1].end]))
    levels = map_depths(position, frame, depths)
    held = {
        **_words(flow, problem, path, title, fronts is not None and fronts[0].frozen),
        "box": [*frame.x, *frame.y],
        "unit": dict(zip(("size", "name"), length_unit(frame.x, frame.y), strict=True)),
        "lonlat": _lonlat(frame),
        "current": _current(
            flow,
            frame,
            levels,
            problem.departure if path.departure is None else path.departure,
            _moments(flow, path),
        ),
        "seabed": _seabed(terrain, frame),
        "legs": _legs(terrain, path),
        "fronts": None if fronts is None else _fronts(*fronts),
        "plans": [] if replay is None else [_plan(since, line) for since, line in replay.plans],
    }
    if replay is not None:
        held["said"] = replay.told
    text = page_text(held, held["title"])
    with replacing(File(file)) as temporary:
        temporary.write_text(text, encoding="utf-8")


def page_text(held: dict[str, Any], title: str) -> str:
    """Return the text of the page that shows the data `held`."""

    def part(name: str) -> str:
        return files(__package__ or "").joinpath(name).read_text("utf-8")

    # no text may end the script or the head of the document in which it stands
    data = json.dumps(held, separators=(",", ":"), allow_nan=False)
    for mark in "<>&":
        data = data.replace(mark, f"\\u{ord(mark):04x}")
    script = "".join(map(part, SCRIPT))
    pieces, rest = [], part("page.html")
    for name, fill in (("title", html.escape(title)), ("css", part("page.css")), ("data", data), ("js", script)):
        # texts that are filled in are not searched again
        piece, rest = rest.split(f"{{{{{name}}}}}")
        pieces += [piece, fill]
    return "".join([*pieces, rest])


def _words(flow: Flow, problem: "Problem", path: "Path", title: str, frozen: bool) -> dict[str, Any]:
    unit, name = time_unit(path.travel_time)
    when = AT_SLIDER if path.clock_runs else when_text(is_steady(flow), problem.departure, problem.departs)
    legs = f"{len(path.legs)} leg{'s' * (len(path.legs) > 1)}"
    return {
        "title": title or "Route",
        "said": f"{legs}, {time_text(path.travel_time)}" + (f"; {STILL}" if path.frozen or frozen else ""),
        "when": when,
        "time": {"size": unit, "name": name, "total": path.travel_time},
        "departs": None if path.departs is None else path.departs.timestamp() * 1e3,
    }


def _numbers(values: Array, digits: int) -> list[Any]:
    """Return rounded numbers for JSON, with None for those that are not finite."""
    rounded = np.round(values, digits) + 0.0
    if digits <= 0:
        return [int(value) if math.isfinite(value) else None for value in rounded.ravel().tolist()]
    return [value if math.isfinite(value) else None for value in rounded.ravel().tolist()]


def _lonlat(frame: Frame) -> dict[str, Any] | None:
    if frame.to_lonlat is None:
        return None
    x, y = np.meshgrid(np.linspace(*frame.x, LONLAT_POINTS), np.linspace(*frame.y, LONLAT_POINTS))
    lon, lat = frame.to_lonlat(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])).T
    return {"points": LONLAT_POINTS, "lon": _numbers(lon, 6), "lat": _numbers(lat, 6)}


def _moments(flow: Flow, path: "Path") -> Array:
    """Return the times (n,) [s since departure] at which the page holds the current, linear between them."""
    if not path.clock_runs:
        return np.zeros(1)
    total = path.travel_time
    if isinstance(flow, OceanGrid):
        assert path.departure is not None
        known = flow.times - path.departure
        moments = np.concatenate([[0.0], known[(known > 0) & (known < total)], [total]])
        return moments[thinned(moments.size, MOST_MOMENTS)]
    some = MOMENTS_A_CYCLE * total / cycle(flow)
    count = MOST_MOMENTS if some == 0 else min(MOST_MOMENTS, 2 + math.ceil(some))
    return np.linspace(0.0, total, count)


def _current(flow: Flow, frame: Frame, depths: Array, begins: float, moments: Array) -> dict[str, Any]:
    """Return the current [mm/s] at cell centres for each time and depth, row by row from the south.

    The times are `moments` [s] after the route `begins` [s].
    """
    x, y = frame.mesh(CURRENT_CELLS)
    fields = [[sample_field(flow, x, y, -depth, begins + since) for depth in depths] for since in moments]
    fastest = max(float(np.nanmax(np.hypot(u, v), initial=0.0)) for layers in fields for u, v in layers)
    return {
        "times": _numbers(moments, 1),
        "cells": [x.shape[1], x.shape[0]],
        "depths": _numbers(depths, 1),
        "fastest": fastest,
        "u": [[_numbers(1e3 * u, 0) for u, _ in layers] for layers in fields],
        "v": [[_numbers(1e3 * v, 0) for _, v in layers] for layers in fields],
    }


def _seabed(terrain: Terrain, frame: Frame) -> dict[str, Any] | None:
    """Return the depth of the seabed [m] at cell centres: 0 on land, None where unknown."""
    x, y = frame.mesh(SEABED_CELLS)
    depth = -sample_bottom(terrain, x, y)
    if not np.isfinite(depth).any():
        return None
    return {"cells": [x.shape[1], x.shape[0]], "depth": _numbers(depth, 0)}


def _legs(terrain: Terrain, path: "Path") -> list[dict[str, Any]]:
    most = max(FEWEST, MOST_ROWS // len(path.legs))
    kept = [leg.trajectory[thinned(len(leg.trajectory), most)] for leg in path.legs]
    rows = np.concatenate(kept)
    seabed = -sample_bottom(terrain, rows[:, 1], rows[:, 2])
    last = np.cumsum([len(some) for some in kept])
    means = _means(path)
    legs = []
    for n, leg in enumerate(path.legs):
        rows = kept[n]
        over, u, v = means[n]
        legs.append(
            {
                "t": _numbers(rows[:, 0], 1),
                "x": _numbers(rows[:, 1], 1),
                "y": _numbers(rows[:, 2], 1),
                "depth": _numbers(-rows[:, 3], 1),
                "seabed": _numbers(seabed[last[n] - len(rows) : last[n]], 0),
                "depart": round(leg.depart, 1),
                "duration": round(leg.duration, 1),
                "glide": round(math.degrees(leg.glide_angle), 2),
                "heading": round(leg.compass, 2),
                "speed": round(leg.speed, 4),
                "miss": _numbers(np.array([leg.miss]), 3)[0],
                "ground": _numbers(np.array([over]), 3)[0],
                "current": _numbers(np.array([u, v]), 4),
            }
        )
    return legs


def _means(path: "Path") -> Array:
    """Return mean speed over ground and current u, v [m/s] of each leg, (legs, 3); NaN without steps."""
    steps, count = along(path), len(path.legs)
    sums = [np.bincount(steps.leg, weights=some, minlength=count) for some in (steps.speed, steps.u, steps.v)]
    with np.errstate(invalid="ignore"):
        return np.asarray((np.array(sums) / np.bincount(steps.leg, minlength=count)).T)


def _plan(since: float, line: Array) -> dict[str, Any]:
    kept = line[thinned(len(line), MOST_OF_PLAN)]
    return {"t": round(since, 1), "x": _numbers(kept[:, 0], 1), "y": _numbers(kept[:, 1], 1)}


def _fronts(fronts: Fronts, hours: float) -> dict[str, Any]:
    front_times(fronts, hours)  # raises InputError if it cannot be drawn
    return {
        "hours": hours,
        "ways": fronts.ways,
        "last": float(fronts.time.max(initial=0.0)) / HOUR,
        "x": _numbers(fronts.x, 0),
        "y": _numbers(fronts.y, 0),
        "time": _numbers(fronts.time, 0),
        "triangles": fronts.triangles.ravel().tolist(),
    }
