"""One page of HTML with the route on a map and a profile: it needs no network, and no program but a browser."""

import json
import math
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels.flow import Flow
from ..kernels.terrain import Terrain
from ..settings import require
from ..store import check_output, replacing
from .canvas import Array, said_time, time_unit
from .route import map_depths
from .water import frame_of, sample_bottom, sample_field, sample_water

if TYPE_CHECKING:
    from ..path import Path
    from ..roadmap import Problem

CELLS, ARROWS, MOST_POINTS = 160, 26, 4000
"""Cells of land and arrows along the longer side; points of the route."""


def check_page(path: str | File) -> None:
    """InputError unless the page can be written."""
    check_output(path)


def save_page(text: str, path: str | File) -> None:
    """Write a page, whole or not at all."""
    with replacing(File(path)) as temporary:
        temporary.write_text(text, encoding="utf-8")


def route_page(
    flow: Flow, terrain: Terrain, problem: "Problem", path: "Path", depths: Array, title: str = ""
) -> str:
    """The page of a path over the current at some `depths` [m], at the departure."""
    require(len(path.legs) > 0, "a route to draw must have a leg; got a path without any")
    rows = path.trajectory[:: max(1, len(path.trajectory) // MOST_POINTS)]
    rows = rows if np.array_equal(rows[-1], path.trajectory[-1]) else np.vstack([rows, path.trajectory[-1]])
    frame = frame_of(problem, rows[:, 1:])
    unit, name = time_unit(float(rows[-1, 0]))
    lonlat = np.zeros((len(rows), 2)) if problem.to_lonlat is None else problem.to_lonlat(rows[:, 1:])
    x, y = frame.mesh(CELLS)
    kinds = (~sample_water(terrain, x, y, -frame.bottom)).astype(int) + ~sample_water(terrain, x, y, -frame.top)
    seabed = -sample_bottom(terrain, rows[:, 1], rows[:, 2])
    data: dict[str, Any] = {
        "title": title or "Route",
        "summary": _summary(path),
        "box": _short([*frame.x, *frame.y], 1),
        "geographic": problem.to_lonlat is not None,
        "geo": _linear(problem),
        "unit": unit,
        "unit_name": name,
        "arrows": ARROWS,
        "depths": [float(f"{depth:.4g}") for depth in depths],
        "currents": [_current(flow, terrain, problem, frame, float(depth)) for depth in depths],
        "land": {"rows": kinds.shape[0], "columns": kinds.shape[1], "cells": "".join(map(str, kinds.ravel()))},
        "route": {
            "t": _short(rows[:, 0], 1),
            "x": _short(rows[:, 1], 1),
            "y": _short(rows[:, 2], 1),
            "depth": _short(-rows[:, 3], 1),
            "lon": _short(lonlat[:, 0], 6),
            "lat": _short(lonlat[:, 1], 6),
            "seabed": _short(np.clip(np.nan_to_num(seabed, posinf=1e5), -1e5, 1e5), 1),
        },
        "legs": [_leg(n, leg) for n, leg in enumerate(path.legs, 1)],
    }
    # a text in a script ends at its closing tag, wherever that stands
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    template = (files("glider_stream.plot") / "page.html").read_text(encoding="utf-8")
    return template.replace("@@DATA@@", text)


def page_depths(problem: "Problem", position: Array, depths: Sequence[float] | None) -> Array:
    """The depths [m] of the maps: those asked for, else the nodes' own if few, else evenly spread ones."""
    return map_depths(position, frame_of(problem, position), depths)


def _short(values: Any, digits: int) -> list[float]:
    return [round(float(value), digits) + 0.0 for value in values]


def _summary(path: "Path") -> str:
    said = f"{len(path.legs)} leg{'s' * (len(path.legs) > 1)}, {said_time(path.travel_time)}"
    return said if path.departs is None else f"{said}, from {path.departs:%Y-%m-%d %H:%M} UTC"


def _leg(number: int, leg: Any) -> dict[str, Any]:
    way = "climb" if leg.glide_angle > 0 else "dive"
    return {
        "number": number,
        "arrives": round(leg.depart + leg.duration, 1),
        "said": f"{way} at {abs(math.degrees(leg.glide_angle)):.1f}°, compass {leg.compass:.0f}°, "
        f"to {0.0 - leg.end[2]:.0f} m in {said_time(leg.duration)}",
    }


def _current(flow: Flow, terrain: Terrain, problem: "Problem", frame: Any, depth: float) -> dict[str, Any]:
    x, y = frame.mesh(ARROWS)
    u, v = sample_field(flow, x, y, -depth, problem.departure)
    wet = sample_water(terrain, x, y, -depth) & np.isfinite(u) & np.isfinite(v)
    fastest = float(np.hypot(u, v)[wet].max(initial=0.0))
    digits = {"x": (x, 0), "y": (y, 0), "u": (u, 4), "v": (v, 4)}
    return {"fastest": round(fastest, 4)} | {name: _short(one[wet], n) for name, (one, n) in digits.items()}


def _linear(problem: "Problem") -> dict[str, float] | None:
    """Longitude and latitude, nearly, as a straight function of x and y: for reading off the map."""
    if problem.to_lonlat is None:
        return None
    step = 1000.0
    origin, east, north = problem.to_lonlat(np.array([[0.0, 0.0, 0.0], [step, 0.0, 0.0], [0.0, step, 0.0]]))
    (a, c), (b, d) = (east - origin) / step, (north - origin) / step
    lon, lat = map(float, origin)
    return {"lon": lon, "lat": lat, "a": float(a), "b": float(b), "c": float(c), "d": float(d)}
