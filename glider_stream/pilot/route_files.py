"""Routes that somebody drew, out of the files that maps write."""

import csv
import io
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

from ..base.errors import InputError
from ..base.settings import require

Place = tuple[float, float, float]
MOST_TEXT, MOST_POINTS = 20_000_000, 10_000
BROKEN = ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError
"""What reading a text raises that is not what its ending says."""
DEGREES = ("lon", "longitude"), ("lat", "latitude"), ("depth", "depth_m")
METRES = ("x", "x_m"), ("y", "y_m"), ("z", "z_m")


@dataclass(frozen=True)
class Drawn:
    """The points of a drawn route, in order.

    Where it is `geographic`: lon, lat [degrees], depth [m], downward; else x, y, z [m] of the local frame.
    """

    places: tuple[Place, ...]
    geographic: bool


def read_drawn(file: str | Path) -> Drawn:
    """A drawn route: CSV with a header, GeoJSON, KML, GPX or a path file of our own.

    A point without depth lies at the surface. Of our own exports: where the route begins, and where legs end.
    InputError where there are fewer than two points, more than one line, or where the file is none of these.
    """
    path = Path(file)
    require(path.is_file(), f"the route {path} does not exist; name a file")
    form = path.suffix.lower()
    known, got = ", ".join(FORMS), repr(form or "no ending")
    require(form in FORMS, f"the route {path} must end in one of: {known}; got {got}")
    try:
        with path.open("rb") as stream:
            content = stream.read(MOST_TEXT + 1)
        most = f"more than the {MOST_TEXT:,} bytes that a route needs"
        require(len(content) <= MOST_TEXT, f"the route {path} holds {most}; simplify it")
        points, geographic = FORMS[form](content.decode("utf-8-sig"))
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"the route {path} cannot be read: {error.strerror}; name another") from None
    except (*BROKEN, csv.Error, Xml.ParseError) as error:
        said = " ".join(str(error).split())[:200] if isinstance(error, ValueError | csv.Error) else ""
        said = said or ("its XML is broken" if isinstance(error, Xml.ParseError) else "it is not built as one is")
        raise InputError(f"{path.name} cannot be read as a route: {said}; export it again") from None
    count = f"from 2 to {MOST_POINTS:,} points; got {len(points)}"
    require(2 <= len(points) <= MOST_POINTS, f"{path.name} must hold {count}")
    return Drawn(tuple(_place(point, n, path.name) for n, point in enumerate(points, 1)), geographic)


def _place(point: Any, number: int, name: str) -> Place:
    try:
        a, b, c = (float(value) for value in point)
    except (TypeError, ValueError, OverflowError):
        a = b = c = math.nan
    finite = math.isfinite(a) and math.isfinite(b) and math.isfinite(c)
    require(finite, f"point {number} of {name} must be three finite numbers; got {repr(point)[:80]}")
    return a, b, c


def _csv(text: str) -> tuple[list[Any], bool]:
    first = text.lstrip().partition("\n")[0]
    rows = list(csv.DictReader(io.StringIO(text.lstrip()), delimiter=max(",;\t", key=first.count)))
    header = {name.strip().lower(): name for name in (rows[0] if rows else {}) if name}
    for kind in (DEGREES, METRES):
        across, along, height = (next((header[name] for name in names if name in header), None) for names in kind)
        if across is not None and along is not None:
            # the depths of our own table are those of whole legs
            if height is None and "depth_min" in header:
                raise ValueError(
                    "it says neither where the first leg begins nor how deep legs end, as a .json does"
                )
            return [(row[across], row[along], row[height] if height else 0.0) for row in rows], kind is DEGREES
    raise ValueError(f"its columns are {', '.join(header) or 'none'}, and not lon, lat, depth or x, y, z")


def _json(text: str) -> tuple[list[Any], bool]:
    table = json.loads(text)
    if isinstance(table.get("legs"), list):  # a path file of our own, in metres
        if not table["legs"]:
            raise ValueError("it holds no leg")
        return [table["legs"][0]["from"], *(leg["to"] for leg in table["legs"])], False
    lines: list[list[Any]] = []
    points: list[Any] = []
    features = table["features"] if table["type"] == "FeatureCollection" else [table]
    ours = False
    for feature in features:
        one = feature["geometry"] if feature["type"] == "Feature" else feature
        ours = ours or "travel_time_s" in (feature.get("properties") or {})
        if one is None:
            continue
        if one["type"] == "LineString":
            lines.append([_below(place) for place in one["coordinates"]])
        elif one["type"] == "Point":
            points.append(_below(one["coordinates"]))
        else:
            raise ValueError(f"it holds a {one['type']}, and not a line or points")
    return _one(lines, points, ours), True


def _one(lines: list[list[Any]], points: list[Any], ours: bool) -> list[Any]:
    """The route among lines and points: a line that is alone; points beside it are marks on a map."""
    if len(lines) > 1:
        raise ValueError(f"it holds {len(lines)} lines, and a route is one")
    if ours and lines:
        # our line is the curved track: the route is where it begins and where its legs end
        return [lines[0][0], *points]
    return lines[0] if lines else points


def _below(place: Any) -> tuple[Any, Any, float]:
    """lon, lat and an altitude as lon, lat, depth."""
    return place[0], place[1], 0.0 - place[2] if len(place) > 2 else 0.0


def _tree(text: str) -> Xml.Element:
    # entities are declared in a document type, and only there
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("it declares a document type, which is not read")
    return Xml.fromstring(text)


def _named(tree: Xml.Element, name: str) -> list[Xml.Element]:
    return [one for one in tree.iter() if one.tag.rsplit("}", 1)[-1] == name]


def _kml(text: str) -> tuple[list[Any], bool]:
    tree = _tree(text)
    lines, points = ([_coordinates(one) for one in _named(tree, kind)] for kind in ("LineString", "Point"))
    ours = any(one.text == "glider-stream route" for one in _named(tree, "name"))
    found = _one(lines, [place for point in points for place in point], ours)
    if not found:
        raise ValueError("it holds no line and no points")
    return found, True


def _coordinates(shape: Xml.Element) -> list[Any]:
    texts = " ".join(one.text or "" for one in _named(shape, "coordinates"))
    return [_below([float(value) for value in place.split(",")]) for place in texts.split()]


def _gpx(text: str) -> tuple[list[Any], bool]:
    tree = _tree(text)
    routes, tracks = ([_marks(one, f"{kind}pt") for one in _named(tree, kind)] for kind in ("rte", "trk"))
    if tree.get("creator") == "glider-stream":
        return _one(tracks, routes[0], True), True
    found = _one(routes or tracks, _marks(tree, "wpt"), False)
    if not found:
        raise ValueError("it holds no route point, way point or track point")
    return found, True


def _marks(tree: Xml.Element, name: str) -> list[Any]:
    """Points of GPX."""
    places = []
    for one in _named(tree, name):
        heights = [float(height.text or 0.0) for height in _named(one, "ele")[:1]]
        places.append(_below([float(one.attrib["lon"]), float(one.attrib["lat"]), *heights]))
    return places


FORMS: dict[str, Callable[[str], tuple[list[Any], bool]]] = {
    ".csv": _csv,
    ".geojson": _json,
    ".json": _json,
    ".kml": _kml,
    ".gpx": _gpx,
}
"""By a file's ending: what reads its points, and whether they are in degrees."""
