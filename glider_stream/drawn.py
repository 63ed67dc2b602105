"""Routes that somebody drew, out of the files that maps write."""

import csv
import io
import json
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

from .errors import InputError
from .settings import require

Place = tuple[float, float, float]
MOST_TEXT, MOST_POINTS = 20_000_000, 10_000
COLUMNS = (
    (("lon", "longitude"), ("lat", "latitude"), ("depth", "depth_m", "depth_max")),
    (("x", "x_m"), ("y", "y_m"), ("z", "z_m")),
)


def read_drawn(file: str | Path) -> list[Place]:
    """The points of a drawn route: lon, lat [degrees], depth [m], or x, y, z [m], as the file has them.

    CSV with a header, GeoJSON, KML or GPX; a point without depth lies at the surface. InputError where there
    are fewer than two, or where the file is none of these.
    """
    path = Path(file)
    require(path.is_file(), f"the route {path} does not exist")
    size = path.stat().st_size
    require(
        size <= MOST_TEXT,
        f"{path.name} holds {size:,} bytes, more than a route needs ({MOST_TEXT:,}); simplify it",
    )
    forms = {".csv": _csv, ".geojson": _geojson, ".json": _geojson, ".kml": _kml, ".gpx": _gpx}
    form = path.suffix.lower()
    require(
        form in forms, f"the route {path} must end in one of: {', '.join(forms)}; got {form or 'no ending'!r}"
    )
    try:
        points = [tuple(map(float, point)) for point in forms[form](path.read_text(encoding="utf-8-sig"))]
    except InputError:
        raise
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError, Xml.ParseError) as error:
        said = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path.name} cannot be read as a route: {said}; export it again") from None
    require(
        2 <= len(points) <= MOST_POINTS,
        f"{path.name} must hold from 2 to {MOST_POINTS:,} points; got {len(points)}",
    )
    for n, point in enumerate(points, 1):
        require(all(map(math.isfinite, point)), f"point {n} of {path.name} is not three numbers")
    return [(a, b, c) for a, b, c in points]


def _csv(text: str) -> list[Any]:
    rows = list(csv.DictReader(io.StringIO(text)))
    header = {name.strip().lower(): name for name in (rows[0] if rows else {}) if name}
    for kinds in COLUMNS:
        found = [next((header[name] for name in names if name in header), None) for names in kinds]
        if found[0] is not None and found[1] is not None:
            return [[row[found[0]], row[found[1]], row[found[2]] if found[2] else 0.0] for row in rows]
    raise ValueError(f"its columns are {', '.join(header) or 'none'}, and not lon, lat, depth or x, y, z")


def _geojson(text: str) -> list[Any]:
    table = json.loads(text)
    if isinstance(table.get("legs"), list):  # a path file of our own, in metres
        return [table["legs"][0]["from"], *(leg["to"] for leg in table["legs"])]
    shapes: list[Any] = []

    def walk(one: Any) -> None:
        kind = one["type"]
        if kind == "FeatureCollection":
            for feature in one["features"]:
                walk(feature)
        elif kind == "Feature":
            walk(one["geometry"])
        elif kind in ("LineString", "Point"):
            shapes.append(one)
        else:
            raise ValueError(f"it holds a {kind}, and not a line or points")

    walk(table)
    points = [one["coordinates"] for one in shapes if one["type"] == "Point"]
    lines = [one["coordinates"] for one in shapes if one["type"] == "LineString"]
    # our own exports hold the curved track and the places where legs end: these are the route
    return [_below(place) for place in (points if len(points) > 1 or not lines else lines[0])]


def _below(place: Any) -> list[float]:
    """lon, lat and an altitude as lon, lat, depth."""
    return [place[0], place[1], 0.0 - place[2] if len(place) > 2 else 0.0]


def _tree(text: str) -> Xml.Element:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("it declares a document type, which is not read")
    return Xml.fromstring(text)


def _named(tree: Xml.Element, name: str) -> list[Xml.Element]:
    return [one for one in tree.iter() if one.tag.rsplit("}", 1)[-1] == name]


def _kml(text: str) -> list[Any]:
    tree = _tree(text)
    lines = {
        name: [c for one in _named(tree, name) for c in _named(one, "coordinates")]
        for name in ("LineString", "Point")
    }
    kind = "Point" if len(lines["Point"]) > 1 or not lines["LineString"] else "LineString"
    texts = lines[kind] if kind == "Point" else lines[kind][:1]
    return [_below([float(v) for v in place.split(",")]) for one in texts for place in (one.text or "").split()]


def _gpx(text: str) -> list[Any]:
    tree = _tree(text)
    for name in ("rtept", "wpt", "trkpt"):
        points = _named(tree, name)
        if points:
            return [_below([float(one.attrib["lon"]), float(one.attrib["lat"]), *_height(one)]) for one in points]
    raise ValueError("it holds no route point, way point or track point")


def _height(point: Xml.Element) -> list[float]:
    return [float(one.text or 0.0) for one in _named(point, "ele")[:1]]
