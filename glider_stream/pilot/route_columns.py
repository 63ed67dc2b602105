"""Columns and properties of route files: the meaning of their names and units.

A number that is ignored may be the depth at which a vehicle should fly. So every name is either known to give a
position, or known not to give one, or refused.
"""

import csv
import io
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from ..base.errors import InputError


class NotARoute(InputError):
    """The reason why a file is not a route, and the cure; the reader adds the file's name in front."""


NAMES = {
    "lon": ("lon", "long", "lng", "longitude"),
    "lat": ("lat", "latitude"),
    "x": ("x",),
    "y": ("y",),
    "depth": ("depth",),
    "altitude": ("altitude", "alt", "elevation", "ele"),
    "z": ("z",),
}
"""The names of coordinates in files; a depth counts downward, an altitude upward."""
HEIGHTS = ("depth", "altitude", "z")
METRES = {
    **dict.fromkeys(("", "m", "metre", "metres", "meter", "meters"), 1.0),
    "cm": 0.01,
    "km": 1000.0,
    **dict.fromkeys(("ft", "foot", "feet"), 0.3048),
    **dict.fromkeys(("fathom", "fathoms"), 1.8288),
}
DEGREES = dict.fromkeys(
    (
        *("", "°", "deg", "degree", "degrees", "decimal degrees", "dd", "degrees e", "degrees n", "°e", "°n"),
        *("degree_east", "degrees_east", "degree_north", "degrees_north", "degrees east", "degrees north"),
    ),
    1.0,
)
"""Units as headers write them, in metres or degrees."""
UNITS = {"lon": DEGREES, "lat": DEGREES}
_IGNORED = (
    "id fid gid ogc_fid objectid index idx no nr num number n count seq sequence order ord rank row leg "
    "legs stop point waypoint wp wpt name label title code vehicle glider sym symbol type kind visible "
    "visibility folder eta etd time timestamp date datetime day hour hours minute second seconds year "
    "month arrives departs duration duration_s travel_time travel_time_s speed speed_over_ground sog stw "
    "velocity course cog heading bearing track azimuth direction distance dist length shape_length "
    "shape_leng shape__length radius range progress pitch roll yaw glide_angle current_u current_v u v "
    "temp atemp temperature wtemp hr cad power battery fix sat satellites hdop vdop pdop magvar "
    "geoidheight ageofdgpsdata dgpsid stroke_width stroke_opacity fill_opacity marker_size tessellate "
    "extrude draworder icon begin end scale opacity width color colour arrival_radius desc description "
    "cmt comment comments note notes src source text url href link styleurl stroke fill snippet address "
    "phonenumber lookat "
)
IGNORED = frozenset(_IGNORED.split())
"""Names of columns with numbers that do not give a position; they are ignored."""
MEASURE = re.compile(r"^\s*[-+]?\d+(\.\d*)?\s*(m|km|cm|ft|feet|fathoms?|metres?|meters?|dbar)\s*$", re.IGNORECASE)
"""A number followed by a unit of length."""
BRACKETS = re.compile(r"^(.*?)\s*[(\[{]\s*([^)\]}]*?)\s*[)\]}]$")


class Column(NamedTuple):
    """The meaning of a column: one of NAMES, and the factor from its numbers to metres or degrees."""

    role: str
    scale: float


def bare_name(header: str) -> tuple[str, str]:
    """Return a header's name and unit in lower case: `Depth (m)`, `depth [m]` and `depth_m` are the same."""
    text = " ".join(header.strip().lower().split())
    fits = BRACKETS.match(text)
    if fits:
        return fits[1].replace(" ", "_").replace("-", "_"), fits[2]
    name = text.replace(" ", "_").replace("-", "_")
    front, underscore, unit = name.rpartition("_")
    known = any(front in names for names in NAMES.values()) and unit in {**METRES, **DEGREES}
    return (front, unit) if underscore and known else (name, "")


def column_of(header: str) -> Column | None:
    """Return the meaning of a header; None if its name is unknown, NotARoute if its unit is unknown."""
    name, unit = bare_name(header)
    role = next((role for role, names in NAMES.items() if name in names), None)
    if role is None:
        return None
    units = UNITS.get(role, METRES)
    if unit not in units:
        wanted = "degrees" if units is DEGREES else "m, km, cm, ft or fathoms"
        raise NotARoute(f"the unit of its column {header.strip()!r} is not known; give it in {wanted}")
    return Column(role, units[unit])


def number(value: Any) -> float | None:
    """Return a finite number, or None; texts of numbers count as numbers, truth values do not."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        found = float(value)
    except (ValueError, OverflowError):
        return None
    return found if math.isfinite(found) else None


def refuse_unknown(header: str, values: Iterable[Any], what: str) -> None:
    """Raise NotARoute if a column with an unknown name holds numbers."""
    name, _ = bare_name(header)
    if name in IGNORED or not any(number(value) is not None or MEASURE.match(str(value)) for value in values):
        return
    raise NotARoute(
        f"its {what} {header.strip()!r} holds numbers of unknown meaning; if they give the vehicle's position "
        "call it depth (metres, downward) or altitude (metres, upward), else remove it"
    )


def stated_height(values: Mapping[str, Any], what: str) -> float | None:
    """Return the height [m, upward] in the properties of a point, or None if they hold none."""
    found: dict[str, float] = {}
    for name, value in values.items():
        if value is None or value == "":
            continue
        column = column_of(name)
        if column is None:
            refuse_unknown(name, [value], what)
        elif column.role in HEIGHTS and number(value) is None:
            raise NotARoute(
                f"its {what} {name!r} is {str(value)[:40]!r}, which is not a number; write the unit in its name"
            )
        elif column.role == "z":
            raise NotARoute(f"its {what} {name!r} may count up or down; call it depth or altitude")
        elif column.role in HEIGHTS:
            amount = (number(value) or 0.0) * column.scale
            found[name] = amount if column.role == "altitude" else 0.0 - amount
    if len(set(found.values())) > 1:
        raise NotARoute(f"its {what}s {', '.join(found)} give different depths for one point; keep one of them")
    return next(iter(found.values()), None)


def depth_of(third: float | None, property_height: float | None) -> float:
    """Return a point's depth [m] from its third coordinate and its properties' height [m, upward]; else 0."""
    if third and property_height is not None and third != property_height:
        raise NotARoute(
            f"a point has an altitude of {third:g} m and properties that say {property_height:g} m; "
            "keep one of them"
        )
    return 0.0 - (third or property_height or 0.0)


def csv_points(text: str) -> tuple[list[Any], bool]:
    """Return the points of a table with a header, and whether they are lon, lat, depth (else x, y, z)."""
    text = text.lstrip()
    first = text.partition("\n")[0]
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=max(",;\t", key=first.count)) if row]
    headers = [name.strip() for name in rows[0]] if rows else []
    columns = {name: column_of(name) for name in headers}
    where: dict[str, int] = {}
    for n, name in enumerate(headers):
        column = columns[name]
        if column is None:
            continue
        role = "height" if column.role in HEIGHTS else column.role
        if role in where:
            raise NotARoute(
                f"its columns {headers[where[role]]!r} and {name!r} mean the same; remove one of them"
            )
        where[role] = n
    for across, along in (("lon", "lat"), ("x", "y")):
        if across in where and along in where:
            geographic = across == "lon"
            break
    else:
        known = ", ".join(name.lower() for name in headers if name and name.isprintable()) or "none"
        raise NotARoute(f"its columns are {known}; name them lon, lat, depth or x, y, z")
    if len({"lon", "lat", "x", "y"} & set(where)) > 2:
        raise NotARoute("it has columns for lon, lat and for x, y; remove two of them")
    if "height" not in where and "depth_min" in headers:  # the depths in our own table are ranges over whole legs
        raise NotARoute(
            "it holds neither the start of the first leg nor the depths where legs end; give the .json file "
            "instead"
        )
    for n, name in enumerate(headers):
        if columns[name] is None:
            refuse_unknown(name, (row[n] for row in rows[1:] if n < len(row)), "column")
    return [_point(row, headers, columns, where, geographic) for row in rows[1:]], geographic


def _point(
    row: list[str], headers: list[str], columns: dict[str, Column | None], where: dict[str, int], geographic: bool
) -> tuple[Any, Any, Any]:
    """Return three values of a row: metres and degrees if they are numbers, else unchanged."""
    values: list[Any] = []
    for role in ("lon", "lat", "height") if geographic else ("x", "y", "height"):
        if role not in where:
            values.append(0.0)
            continue
        column = columns[headers[where[role]]]
        assert column is not None
        if geographic and column.role == "z":
            name = headers[where[role]]
            raise NotARoute(
                f"its column {name!r} may count up or down beside lon, lat; call it depth or altitude"
            )
        text = row[where[role]] if where[role] < len(row) else None
        amount = number(text)
        if amount is None:
            values.append(text)
            continue
        turned = role == "height" and (column.role == "depth") != geographic
        values.append((-amount if turned else amount) * column.scale + 0.0)
    return values[0], values[1], values[2]
