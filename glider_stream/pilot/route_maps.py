"""Reads routes in KML and GPX, as map programs and plotters write them."""

import re
from typing import Any, NamedTuple
from xml.etree import ElementTree as Xml

from .route_columns import NotARoute, depth_of, stated_height

Place = tuple[Any, Any, Any]
CONTAINERS = ("kml", "Document", "Folder")
LINES = ("LineString", "Track")
OUR_NAME = "glider-stream route"
FIRST, STOP = "START", "WP{:03}"
"""The names in our files of the route's start and of the ends of its legs, counted from 1."""
OURS = re.compile(r"START|WP\d+")


class Mark(NamedTuple):
    """A point of a map: its name, and lon, lat [degrees], depth [m]."""

    name: str
    place: Place


def our_stops(marks: list[Mark]) -> list[Mark]:
    """Return the marks that have our names of a route's stops, in their order; no mark if one is missing."""
    by_name = {mark.name: mark for mark in marks}
    first = [by_name[FIRST]] if FIRST in by_name else []
    stops: list[Mark] = []
    while STOP.format(len(stops) + 1) in by_name:
        stops.append(by_name[STOP.format(len(stops) + 1)])
    named = sum(1 for name in by_name if name != FIRST and OURS.fullmatch(name))
    return first + stops if stops and len(stops) == named else []


def route_of(lines: list[list[Place]], marks: list[Mark], ours: bool) -> list[Place]:
    """Return the route among lines and points: a line if there is just one; points beside it are marks on a map.

    In our own files the line is the curved track, and the route is its start and the ends of its legs. This also
    holds if another program saved the file and kept only the names and positions of our marks.
    """
    if len(lines) > 1:
        raise NotARoute(f"it holds {len(lines)} lines, but a route is one line; keep one of them")
    stops = our_stops(marks)
    if not lines:
        if stops and stops[0].name != FIRST and len(stops) == len(marks):
            raise NotARoute(
                "it holds the ends of our legs but not the start of the route; export the route again"
            )
        return [mark.place for mark in marks]
    if stops and (ours or _along(lines[0], stops)):
        begins = [] if stops[0].name == FIRST else [lines[0][0]]
        return [*begins, *(stop.place for stop in stops)]
    return lines[0]


def _along(line: list[Place], stops: list[Mark]) -> bool:
    """Return whether all stops are points of the line, in its order, and the last stop is its end."""
    at = 0
    for stop in stops:
        while at < len(line) and not _same(line[at], stop.place):
            at += 1
        if at == len(line):
            return False
    return _same(line[-1], stops[-1].place)


def _same(a: Place, b: Place) -> bool:
    """Return whether two places are equal, except for rounding and for a full circle at the date line."""
    across = (float(a[0]) - float(b[0]) + 180.0) % 360.0 - 180.0
    return abs(across) < 2e-6 and abs(float(a[1]) - float(b[1])) < 2e-6 and abs(float(a[2]) - float(b[2])) < 0.5


def _tree(text: str) -> Xml.Element:
    # entities can be declared only in a document type
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise NotARoute("it declares a document type, which is not read; export it again without one")
    return Xml.fromstring(text)


def _kind(element: Xml.Element) -> str:
    """Return an element's name without its namespace."""
    return element.tag.rsplit("}", 1)[-1]


def _named(tree: Xml.Element, name: str) -> list[Xml.Element]:
    return [element for element in tree.iter() if _kind(element) == name]


def _text(tree: Xml.Element, name: str) -> str:
    """Return the text of the first child with that name, or an empty text."""
    return next(((element.text or "").strip() for element in tree if _kind(element) == name), "")


# KML


class _Shape(NamedTuple):
    """A line or a point of a KML file, with its placemark and folder, if it has them."""

    element: Xml.Element
    placemark: Xml.Element | None
    folder: Xml.Element | None


def _shapes(tree: Xml.Element) -> list[_Shape]:
    """Return all lines and points in the order of the file; without recursion, since a file may be deep."""
    found, waiting = [], [_Shape(tree, None, tree)]
    while waiting:
        element, placemark, folder = waiting.pop()
        kind = _kind(element)
        if kind in (*LINES, "Point"):
            found.append(_Shape(element, placemark, folder))
            continue
        inner = element if kind in CONTAINERS else folder
        mark = element if kind == "Placemark" else placemark
        waiting += [_Shape(child, mark, inner) for child in reversed(element)]
    return found


def kml_points(text: str) -> tuple[list[Place], list[str]]:
    """Return the route of a KML file as lon, lat [degrees], depth [m], and notes on what was left out."""
    tree, notes = _tree(text), list[str]()
    shapes = _shapes(tree)
    lines = [shape for shape in shapes if _kind(shape.element) in LINES]
    points = [shape for shape in shapes if _kind(shape.element) == "Point"]
    if lines:
        # points in other folders were not drawn together with the line
        points = [shape for shape in points if shape.folder is lines[0].folder]
    folders = list({id(shape.folder): shape.folder for shape in points}.values())
    if len(folders) > 1:
        names = ", ".join(
            repr(_text(folder, "name") or "without a name") for folder in folders if folder is not None
        )
        raise NotARoute(
            f"its points lie in {len(folders)} folders ({names}), but a route is in one folder; keep one of them"
        )
    ours = any(element.text == OUR_NAME for element in _named(tree, "name"))
    if lines:
        # any other point is a mark on the map, and its height does not matter
        points = [shape for shape in points if OURS.fullmatch(_name(shape))]
    marks = [mark for shape in points for mark in _marked(shape, notes)]
    found = route_of([_coordinates(shape, notes) for shape in lines], marks, ours)
    if not found:
        raise NotARoute("it holds no line and no points; draw a path, and export that")
    return found, list(dict.fromkeys(notes))


def _name(shape: _Shape) -> str:
    return "" if shape.placemark is None else _text(shape.placemark, "name")


def _marked(shape: _Shape, notes: list[str]) -> list[Mark]:
    """Return the points of an element."""
    height = None if shape.placemark is None else stated_height(_data(shape.placemark), "data")
    places = _coordinates(shape, notes)
    return [Mark(_name(shape), (a, b, depth_of(0.0 - depth, height))) for a, b, depth in places]


def _data(placemark: Xml.Element) -> dict[str, str]:
    """Return the values in a placemark's ExtendedData, by name."""
    data = {element.get("name", ""): _text(element, "value") for element in _named(placemark, "Data")}
    return data | {
        element.get("name", ""): (element.text or "").strip() for element in _named(placemark, "SimpleData")
    }


def _coordinates(shape: _Shape, notes: list[str]) -> list[Place]:
    """Return the places of a line or point: lon, lat, and the depth by the altitude mode."""
    element = shape.element
    if _kind(element) == "Track":
        values = [[float(value) for value in (child.text or "").split()] for child in _named(element, "coord")]
    else:
        texts = " ".join(child.text or "" for child in _named(element, "coordinates"))
        values = [[float(value) for value in place.split(",")] for place in texts.split()]
    if _kind(element) in LINES and shape.placemark is not None:
        height = stated_height(_data(shape.placemark), "data")
        if height is not None:
            raise NotARoute("its line has data with one depth; write the depth as the altitude of each point")
    heights = [value[2] if len(value) > 2 else 0.0 for value in values]
    counted = _heights(_text(element, "altitudeMode") or "clampToGround", heights, notes)
    return [(value[0], value[1], 0.0 - height) for value, height in zip(values, counted, strict=True)]


def _heights(mode: str, heights: list[float], notes: list[str]) -> list[float]:
    """Return heights above the sea [m] for altitudes in an altitude mode (KML 2.2 or Google's of the seabed)."""
    if mode == "absolute":
        return heights
    raised = any(height != 0.0 for height in heights)
    if mode == "clampToGround":
        if raised:
            notes.append(
                "altitudes are ignored where the altitude mode is clampToGround, the default: these points lie "
                "at the surface; write <altitudeMode>absolute</altitudeMode> if they count"
            )
        return [0.0] * len(heights)
    if mode == "relativeToGround" and not raised:
        return heights  # on the sea, a map's ground is its surface
    raise NotARoute(
        f"its altitudes count from the ground or the seabed (altitude mode {mode}); "
        "save them as absolute, negative below the surface"
    )


# GPX


def gpx_points(text: str) -> list[Place]:
    """Return the route of a GPX file, lon, lat [degrees], depth [m]: its route, else track, else way points."""
    tree = _tree(text)
    routes, tracks = ([_gpx_marks(line, f"{kind}pt") for line in _named(tree, kind)] for kind in ("rte", "trk"))
    routes, tracks = ([marks for marks in some if marks] for some in (routes, tracks))
    for some, what in ((routes, "routes"), (tracks, "tracks")):
        if len(some) > 1 and (some is routes or not routes):
            raise NotARoute(f"it holds {len(some)} {what}, but only one can be read; keep one of them")
    marks = (routes or tracks or [_gpx_marks(tree, "wpt")])[0]
    stops = our_stops(marks)
    if stops and stops[0].name == FIRST:
        return [stop.place for stop in stops]
    if stops and len(stops) == len(marks):
        # a route of an earlier version: only its track holds the start
        if not tracks:
            raise NotARoute(
                "it holds the ends of our legs but not the start of the route; export the route again"
            )
        return [tracks[0][0].place, *(stop.place for stop in stops)]
    if not marks:
        raise NotARoute("it holds no route point, way point or track point; draw a route, and export that")
    return [mark.place for mark in marks]


def _gpx_marks(tree: Xml.Element, kind: str) -> list[Mark]:
    """Return the points of GPX with their names."""
    marks = []
    for point in _named(tree, kind):
        leaves = [inner for inner in point.iter() if len(inner) == 0 and inner is not point]
        values = {_kind(inner): (inner.text or "").strip() for inner in leaves}
        height = values.pop("ele", "")
        name = values.pop("name", "")
        stated = stated_height(values, "point's element")
        depth = depth_of(float(height) if height else None, stated)
        marks.append(Mark(name, (float(point.attrib["lon"]), float(point.attrib["lat"]), depth)))
    return marks
