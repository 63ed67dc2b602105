"""Reads drawn routes from the files that map programs write."""

import csv
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as Xml

from ..base.errors import InputError
from ..base.settings import require
from ..base.untrusted import check_file
from ..search.path import NO_ORIGIN
from .route_columns import HEIGHTS, NotARoute, column_of, csv_points, depth_of, refuse_unknown, stated_height
from .route_maps import OURS, Mark, gpx_points, kml_points, route_of
from .seaglider import target_points
from .slocum_files import goto_points

Place = tuple[float, float, float]
MOST_TEXT, MOST_POINTS = 20_000_000, 10_000
BROKEN = ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError
"""Errors that are raised if a text does not have the form of its ending."""


class Found(NamedTuple):
    """The contents of a file: points, whether they are lon, lat, depth, notes for the reader, its scenario."""

    points: list[Any]
    geographic: bool
    notes: list[str]
    scenario: str = ""


@dataclass(frozen=True)
class Drawn:
    """The points of a drawn route, in order.

    If `geographic`, they are lon, lat [degrees], depth [m, downward]; else x, y, z [m] in the local frame.
    `notes`: what the file leaves open and what was not read.
    """

    places: tuple[Place, ...]
    geographic: bool
    notes: tuple[str, ...] = ()
    of_vehicle: bool = False
    """Whether it is a vehicle's file; the vehicle starts anywhere, so the way to the first point is unknown."""
    scenario: str = ""
    """The scenario of a path file of our own, as TOML, from whose centre its metres count; empty if unknown."""


def read_drawn(file: str | Path) -> Drawn:
    """Return the route in a CSV file with a header, GeoJSON, KML, GPX, path file, goto list or `targets`.

    A point without a depth lies at the surface. From our own exports the route's start and the ends of its legs
    are read. InputError if there is no point, if there are several lines, if a number has an unknown meaning, or
    if the file has another form.
    """
    path = Path(file)
    check_file(path, "the route")
    require(path.is_file(), f"the route {path} does not exist; name a file")
    form = "targets" if path.name.lower() == "targets" else path.suffix.lower()
    known, got = ", ".join(FORMS), repr(form or "no ending")
    require(form in FORMS, f"the route {path} must end in one of: {known}; got {got}")
    try:
        with path.open("rb") as stream:
            content = stream.read(MOST_TEXT + 1)
        most = f"more than the {MOST_TEXT:,} bytes that a route needs"
        require(len(content) <= MOST_TEXT, f"the route {path} holds {most}; simplify it")
        points, geographic, notes, scenario = FORMS[form](content.decode("utf-8-sig"))
    except NotARoute as error:
        raise InputError(f"{path.name} cannot be read as a route: {error}") from None
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"the route {path} cannot be read: {error.strerror}; name another") from None
    except (*BROKEN, csv.Error, Xml.ParseError) as error:
        message = " ".join(str(error).split())[:200] if isinstance(error, ValueError | csv.Error) else ""
        message = message or (
            "its XML is broken" if isinstance(error, Xml.ParseError) else "it is not built like a route file"
        )
        raise InputError(f"{path.name} cannot be read as a route: {message}; export it again") from None
    # a vehicle flies to the first point of its list, so one point is enough
    least = 1 if form in VEHICLES else 2
    count = f"from {least} to {MOST_POINTS:,} points; got {len(points)}"
    require(least <= len(points) <= MOST_POINTS, f"{path.name} must hold {count}")
    places = tuple(_place(point, n, path.name) for n, point in enumerate(points, 1))
    return Drawn(places, geographic, tuple(notes), form in VEHICLES, scenario)


def _place(point: Any, number: int, name: str) -> Place:
    try:
        a, b, c = (float(value) for value in point)
    except (TypeError, ValueError, OverflowError):
        a = b = c = math.nan
    finite = math.isfinite(a) and math.isfinite(b) and math.isfinite(c)
    require(finite, f"point {number} of {name} must be three finite numbers; got {repr(point)[:80]}")
    return a, b, c


def _csv(text: str) -> Found:
    return Found(*csv_points(text), [])


def _json(text: str) -> Found:
    table = json.loads(text)
    if isinstance(table.get("legs"), list):  # a path file of our own, in metres
        if not table["legs"]:
            raise NotARoute("it holds no leg; give a file in which a path was found")
        scenario = str(table.get("origin", {}).get("scenario", ""))
        notes = [] if scenario else [f"the route {NO_ORIGIN}"]
        return Found([table["legs"][0]["from"], *(leg["to"] for leg in table["legs"])], False, notes, scenario)
    features = table["features"] if table["type"] == "FeatureCollection" else [table]
    lines: list[tuple[list[Any], dict[str, Any]]] = []
    points: list[tuple[list[Any], dict[str, Any]]] = []
    ours = False
    for feature in features:
        whole = feature["type"] == "Feature"
        geometry, properties = feature["geometry"] if whole else feature, (feature.get("properties") or {})
        ours = ours or "travel_time_s" in properties
        if geometry is None:
            continue
        if geometry["type"] not in ("LineString", "Point"):
            raise NotARoute(f"it holds a {geometry['type']}, which is not a line or points; draw a line")
        (lines if geometry["type"] == "LineString" else points).append((geometry["coordinates"], properties))
    for _, properties in lines:
        _check_line(properties)
    # points beside a line are marks on the map; they give no positions unless they are ours
    marks = [
        _mark(place, {"name": properties.get("name", "")} if lines else properties)
        for place, properties in points
    ]
    return Found(route_of([[_below(place, {}) for place in line] for line, _ in lines], marks, ours), True, [])


def _mark(place: Any, properties: dict[str, Any]) -> Mark:
    name = str(properties.get("name", ""))
    return Mark(name, _below(place, {} if OURS.fullmatch(name) else properties))


def _check_line(properties: dict[str, Any]) -> None:
    """Raise NotARoute if a line's properties give a depth, which would hold for all of its points."""
    for name, value in properties.items():
        column = None if value is None else column_of(name)
        if column is not None and column.role in HEIGHTS:
            refuse = "write depths as the third coordinate of each point, negative below the surface"
            raise NotARoute(f"its line has a property {name!r}, one for all of its points; {refuse}")
        if column is None:
            refuse_unknown(name, value if isinstance(value, list) else [value], "property")


def _below(place: Any, properties: dict[str, Any]) -> tuple[Any, Any, float]:
    """Return lon, lat, depth of a point with an altitude; its properties may also give the depth."""
    height = stated_height(properties, "property")
    return place[0], place[1], depth_of(place[2] if len(place) > 2 else None, height)


def _kml(text: str) -> Found:
    points, notes = kml_points(text)
    return Found(points, True, notes)


def _gpx(text: str) -> Found:
    return Found(gpx_points(text), True, [])


def _goto(text: str) -> Found:
    points, notes = goto_points(text)
    return Found(points, True, notes)


def _targets(text: str) -> Found:
    points, notes = target_points(text)
    return Found(points, True, notes)


FORMS: dict[str, Callable[[str], Found]] = {
    ".csv": _csv,
    ".geojson": _json,
    ".json": _json,
    ".kml": _kml,
    ".gpx": _gpx,
    ".ma": _goto,
    "targets": _targets,
}
"""The function that reads the points of each form, by the file's ending or name."""
VEHICLES = (".ma", "targets")
"""The forms that vehicles fly; they start wherever they are."""
