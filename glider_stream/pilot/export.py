"""Route files: writes a path in the forms that other programs read.

Coordinates are longitude, latitude and altitude (a depth is negative). Bearings are clockwise from true north.
"""

import csv
import io
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path as File
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np

from ..base.output import check_output, replacing
from ..base.settings import require
from ..search.path import FROZEN, Leg, Path
from ..water.frame import wrapped
from . import seaglider, slocum
from .route_maps import FIRST, OUR_NAME, STOP
from .slocum import list_number, mission_files
from .slocum_files import MOST_WAYPOINTS
from .waypoints import skipped
from .windows import HOURS, Window, windows

Texts = dict[str, str]


@dataclass(frozen=True)
class Options:
    """Options of an export.

    `hours`: the length of a window [h]. `most_waypoints`: the waypoints that a goto list may hold.
    `arrival_radius`: the distance [m] at which a waypoint counts as reached; if None, each vehicle has its own.
    """

    window_hours: float = HOURS
    most_waypoints: int = MOST_WAYPOINTS
    arrival_radius: float | None = None


def _json(path: Path, name: str, options: Options) -> Texts:
    return {name: json.dumps(path.as_dict(), indent=1) + "\n"}


def _place(lonlat: Any, z: float) -> list[float]:
    lon, lat = lonlat
    return [round(float(wrapped(lon, 0.0)), 7), round(float(lat), 7), round(float(z), 2) + 0.0]


def _track(path: Path) -> list[list[float]]:
    """Return the positions of the route along the curves of all legs."""
    places = [_place(path.lonlat[0], path.start[2])] if path.lonlat is not None else []
    for leg in path.legs:
        assert leg.track is not None
        assert leg.lonlat is not None
        places += [
            _place(lonlat, row[3]) for lonlat, row in zip(leg.track[1:-1], leg.trajectory[1:-1], strict=True)
        ]
        # a leg may miss its end by the tolerance, and the next leg begins at that end
        places.append(_place(leg.lonlat[1], leg.end[2]))
    return places


def _when(path: Path, seconds: float) -> str | None:
    """Return the time in UTC (ISO 8601), or None if the plan has no date."""
    if path.departs is None:
        return None
    return (path.departs + timedelta(seconds=seconds)).strftime("%Y-%m-%dT%H:%M:%SZ")


def _clock(path: Path, seconds: float) -> str:
    """Return the time in UTC if the plan has a date, else the hours since departure."""
    return _when(path, seconds) or f"{seconds / 3600:.3f} h"


def _rows(path: Path) -> Iterator[dict[str, Any]]:
    """Yield a row for each leg: where and when it ends, how it is flown, the current on its way."""
    for n, leg in enumerate(path.legs, 1):
        u, v = _mean_current(leg)
        depths = -leg.trajectory[:, 3]
        over_ground = math.hypot(*(leg.trajectory[-1, 1:3] - leg.trajectory[0, 1:3])) / max(leg.duration, 1e-9)
        if leg.lonlat is None:
            place = {"x": round(float(leg.end[0]), 2), "y": round(float(leg.end[1]), 2)}
        else:
            lon, lat, _ = _place(leg.lonlat[1], 0.0)
            place = {"lat": lat, "lon": lon}
        arrives = leg.depart + leg.duration
        yield {
            "name": STOP.format(n),
            **place,
            "eta": _clock(path, arrives),
            "depth_min": round(float(depths.min()), 2) + 0.0,
            "depth_max": round(float(depths.max()), 2),
            "heading": round(leg.compass, 2),
            "glide_angle": round(math.degrees(leg.glide_angle), 2),
            "speed_over_ground": round(over_ground, 4),
            "current_u": round(u, 4),
            "current_v": round(v, 4),
        }


def _mean_current(leg: Leg) -> tuple[float, float]:
    """Return the mean current of a leg, east and north [m/s]: its motion less its own speed."""
    along = leg.speed * math.cos(leg.glide_angle)
    x, y = (leg.trajectory[-1, 1:3] - leg.trajectory[0, 1:3]) / max(leg.duration, 1e-9)
    u, v = x - along * math.cos(leg.heading), y - along * math.sin(leg.heading)
    c, s = math.cos(leg.north), math.sin(leg.north)
    return float(u * c + v * s), float(v * c - u * s)


def _csv(path: Path, name: str, options: Options) -> Texts:
    return _table(list(_rows(path)), name)


def _table(rows: list[dict[str, Any]], name: str) -> Texts:
    text = io.StringIO(newline="")
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return {name: text.getvalue()}


def _geojson(path: Path, name: str, options: Options) -> Texts:
    line = {"type": "LineString", "coordinates": _track(path)}
    features = [{"type": "Feature", "geometry": line, "properties": {"travel_time_s": path.travel_time}}]
    for row, place in list(_stops(path))[1:]:
        point = {"type": "Point", "coordinates": place}
        features.append({"type": "Feature", "geometry": point, "properties": row})
    return {name: json.dumps({"type": "FeatureCollection", "features": features}, indent=1) + "\n"}


def _stops(path: Path) -> Iterator[tuple[dict[str, Any], list[float]]]:
    """Yield the position where the route begins and the end of each leg, each with its row."""
    assert path.lonlat is not None
    yield {"name": FIRST, "eta": _clock(path, 0.0)}, _place(path.lonlat[0], path.start[2])
    for row, leg in zip(_rows(path), path.legs, strict=True):
        assert leg.lonlat is not None
        yield row, _place(leg.lonlat[1], leg.end[2])


def _child(parent: Xml.Element, tag: str, text: str | None = None, **attributes: str) -> Xml.Element:
    child = Xml.SubElement(parent, tag, attributes)
    child.text = text
    return child


def _xml(root: Xml.Element, name: str) -> Texts:
    Xml.indent(root)
    return {name: '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"}


def _kml(path: Path, name: str, options: Options) -> Texts:
    root = Xml.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    document = _child(root, "Document")
    _child(document, "name", OUR_NAME)
    route = _child(document, "Placemark")
    _child(route, "name", "route")
    line = _child(route, "LineString")
    _child(line, "altitudeMode", "absolute")
    _child(line, "coordinates", " ".join(",".join(map(str, place)) for place in _track(path)))
    for row, place in list(_stops(path))[1:]:
        mark = _child(document, "Placemark")
        _child(mark, "name", row["name"])
        description = (
            f"heading {row['heading']} degrees, glide angle {row['glide_angle']} degrees, eta {row['eta']}"
        )
        _child(mark, "description", description)
        if path.departs is not None:
            _child(_child(mark, "TimeStamp"), "when", row["eta"])
        point = _child(mark, "Point")
        _child(point, "altitudeMode", "absolute")
        _child(point, "coordinates", ",".join(map(str, place)))
    return _xml(root, name)


def _gpx(path: Path, name: str, options: Options) -> Texts:
    root = Xml.Element("gpx", version="1.1", creator="glider-stream", xmlns="http://www.topografix.com/GPX/1/1")
    route = _child(root, "rte")
    stops = list(_stops(path))
    for row, (lon, lat, z) in stops:
        point = _child(route, "rtept", lat=str(lat), lon=str(lon))
        _child(point, "ele", str(z))
        if path.departs is not None:
            _child(point, "time", row["eta"])
        _child(point, "name", row["name"])
    segment = _child(_child(root, "trk"), "trkseg")
    # points of the curve that are stops keep their names, so that the track alone still shows the route
    ends = np.cumsum([0, *(len(leg.trajectory) - 1 for leg in path.legs)]).tolist()
    names = {end: row["name"] for end, (row, _) in zip(ends, stops, strict=True)}
    for n, (lon, lat, z) in enumerate(_track(path)):
        point = _child(segment, "trkpt", lat=str(lat), lon=str(lon))
        _child(point, "ele", str(z))
        if n in names:
            _child(point, "name", names[n])
    return _xml(root, name)


def _window_properties(path: Path, window: Window) -> dict[str, Any]:
    """Return the times and depths of a window as properties."""
    return {
        "from": _clock(path, window.start),
        "to": _clock(path, window.end),
        "depth_min": round(window.shallowest, 2),
        "depth_max": round(window.deepest, 2),
    }


def _windows_geojson(path: Path, name: str, options: Options) -> Texts:
    """Return a polygon for each window; it is cut in two at the date line (RFC 7946, section 3.1.9)."""
    features = []
    for window in windows(path, options.window_hours):
        rings = [[[[w, s], [e, s], [e, n], [w, n], [w, s]]] for w, s, e, n in window.outline()]
        shape: dict[str, Any] = {"type": "Polygon", "coordinates": rings[0]}
        if len(rings) > 1:
            shape = {"type": "MultiPolygon", "coordinates": rings}
        features.append({"type": "Feature", "geometry": shape, "properties": _window_properties(path, window)})
    return {name: json.dumps({"type": "FeatureCollection", "features": features}, indent=1) + "\n"}


def _windows_csv(path: Path, name: str, options: Options) -> Texts:
    """Return a row for each window; west is greater than east if the window crosses the date line."""
    sides = ("x_min", "y_min", "x_max", "y_max") if path.lonlat is None else ("west", "south", "east", "north")
    rows = []
    for window in windows(path, options.window_hours):
        boxes = window.outline()
        box = [round(bound, 6) for bound in (*boxes[0][:2], *boxes[-1][2:])]
        rows.append({**dict(zip(sides, box, strict=True)), **_window_properties(path, window)})
    return _table(rows, name)


RADII = {".ma": slocum.RADIUS, "targets": seaglider.RADIUS}
"""The usual arrival radius [m] of each vehicle, by the form of its files."""


def _radius(form: str, options: Options) -> float:
    return RADII[form] if options.arrival_radius is None else options.arrival_radius


def _goto_lists(path: Path, name: str, options: Options) -> Texts:
    return mission_files(path, name, options.most_waypoints, _radius(".ma", options))


def _targets(path: Path, name: str, options: Options) -> Texts:
    return seaglider.targets(path, name, _radius("targets", options))


EXPORTS: dict[str, Callable[[Path, str, Options], Texts]] = {
    ".json": _json,
    ".geojson": _geojson,
    ".kml": _kml,
    ".gpx": _gpx,
    ".csv": _csv,
    ".ma": _goto_lists,
    "targets": _targets,
    ".windows.geojson": _windows_geojson,
    ".windows.csv": _windows_csv,
}
"""The function that writes each form, by the file's ending or name; a form may need several files."""
ANYWHERE = (".json", ".csv", ".windows.csv")
"""The forms that do not need longitude and latitude."""


def _saying_frozen(form: str, text: str) -> str:
    """Return the text of a file with a note that the path's currents are frozen, where its readers see it."""
    if form.endswith(".json"):
        return text  # its `frozen` says so
    if form.endswith(".geojson"):
        return json.dumps({"note": FROZEN} | json.loads(text), indent=1) + "\n"
    if form.endswith(".csv"):
        first, *rows = text.splitlines()
        return "\n".join([f"{first},note", *(f'{row},"{FROZEN}"' for row in rows)]) + "\n"
    if form == ".kml":
        name = "<name>glider-stream route</name>"
        return text.replace(name, f"{name}\n    <description>{FROZEN}</description>", 1)
    if form == ".gpx":
        return text.replace("<rte>", f"<metadata><desc>{FROZEN}</desc></metadata>\n  <rte>", 1)
    return f"{'#' if form == '.ma' else '/'} {FROZEN}\n{text}"


def _form(file: str | File) -> str:
    place = File(file)
    double = "".join(place.suffixes[-2:]).lower()
    return next((form for form in (place.name, double) if form in EXPORTS), place.suffix.lower())


def check_export(file: str | File) -> None:
    """Raise InputError unless the file's ending is a known form and the file can be made."""
    form, known = _form(file), ", ".join(EXPORTS)
    got = repr(form or "no ending")
    require(form in EXPORTS, f"the route file {file} must end in one of: {known}; got {got}")
    if form == ".ma":
        list_number(File(file).name)
    check_output(file)


def check_places(files: Sequence[str | File], geographic: bool) -> None:
    """Raise InputError if one of the files needs longitude and latitude, and the scenario has none."""
    for file in files:
        fits = geographic or _form(file) in ANYWHERE
        require(fits, f"the route file {file} needs longitude and latitude; plan in a geographic scenario")


def check_legs(path: Path, files: Sequence[str | File]) -> None:
    """Raise InputError if the path has no leg and one of the files must hold legs."""
    for file in files:
        empty = f"the route has no leg, because its start is its goal; there is nothing to write into {file}"
        written = bool(path.legs) or not path.found or _form(file) == ".json"
        require(written, f"{empty}; give another goal")


def export_path(
    path: Path, file: str | File, say: Callable[[str], None] = lambda note: None, **options: Any
) -> list[File]:
    """Write a path in the form that the file's ending names; return the files that were written.

    If no path was found, only a JSON file is written; `say` gets a message for every other file, and for every
    old file that was removed. `options`: see `Options`. InputError if the path has no leg to write.
    """
    check_export(file)
    form, place, chosen = _form(file), File(file), Options(**options)
    check_places([file], path.lonlat is not None)
    if not path.found and form != ".json":
        older = "; the file of that name is of an earlier query" if place.exists() else ""
        say(f"{file} is not written, because no path was found{older}")
        return []
    check_legs(path, [file])
    texts = EXPORTS[form](path, place.name, chosen)
    if path.frozen:
        texts = {name: _saying_frozen(form, text) for name, text in texts.items()}
    for name in texts:
        check_output(place.with_name(name))
    for name, text in texts.items():
        with replacing(place.with_name(name)) as temporary:
            temporary.write_text(text, encoding="utf-8")
    notes = skipped(path, _radius(form, chosen)) if form in RADII else []
    if form == ".ma":
        notes += slocum.altitude_notes(path, place.name)
        notes += slocum.turn_notes(path, place.name)
        notes += slocum.clear_leftovers(place.parent, place.name, list(texts))
    for note in notes:
        say(note)
    return [place.with_name(name) for name in texts]
