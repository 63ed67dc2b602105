"""Finds which variable of a file is what: by the user's names, then CF, then the name, then the long name."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ...base.errors import InputError
from ...base.settings import require
from .units import in_metres_per_second

STANDARD_NAMES = [
    ("eastward_sea_water_velocity", "northward_sea_water_velocity"),
    ("surface_eastward_sea_water_velocity", "surface_northward_sea_water_velocity"),
    ("eastward_sea_water_velocity_assuming_no_tide", "northward_sea_water_velocity_assuming_no_tide"),
    ("surface_geostrophic_eastward_sea_water_velocity", "surface_geostrophic_northward_sea_water_velocity"),
    ("surface_eastward_geostrophic_sea_water_velocity", "surface_northward_geostrophic_sea_water_velocity"),
    ("geostrophic_eastward_sea_water_velocity", "geostrophic_northward_sea_water_velocity"),
    ("sea_water_x_velocity", "sea_water_y_velocity"),
    ("x_sea_water_velocity", "y_sea_water_velocity"),
    ("surface_sea_water_x_velocity", "surface_sea_water_y_velocity"),
]
SHORT_NAMES = [
    ("uo", "vo"),
    ("utotal", "vtotal"),
    ("water_u", "water_v"),
    ("u_eastward", "v_northward"),
    ("u_east", "v_north"),
    ("vozocrtx", "vomecrty"),
    ("u", "v"),
    ("uos", "vos"),
    ("ugos", "vgos"),
    ("uvel", "vvel"),
    ("ucur", "vcur"),
    ("ssu", "ssv"),
    ("uu", "vv"),
    ("ewct", "nsct"),
    ("eastward_eulerian_current_velocity", "northward_eulerian_current_velocity"),
]
IN_METRES = {"uo", "vo", "uos", "vos", "utotal", "vtotal", "water_u", "water_v", "ugos", "vgos"}
IN_METRES |= {"vozocrtx", "vomecrty", "u_eastward", "v_northward", "wo", "vovecrtz"}
"""Variables with these names are in m/s even if the file gives no unit."""
LONG_NAMES = [
    (
        r"(?=.*\b(eastward|zonal)\b)(?=.*\b(current|velocity)\b)",
        r"(?=.*\b(northward|meridional)\b)(?=.*\b(current|velocity)\b)",
    )
]
SENSE_OF_U = re.compile(r"\b(eastward|zonal|west.east|x.(velocity|component|direction)|u.(velocity|component))\b")
SENSE_OF_V = re.compile(
    r"\b(northward|meridional|south.north|y.(velocity|component|direction)|v.(velocity|component))\b"
)
"""Long names with these words tell which component a variable is."""
NO_CURRENT = re.compile(r"\bwind|stress|stokes|flag|\berror|quality|uncertain|\bice\b|\bair\b|\bstd|variance")
A_PART = re.compile(r"\btid(e|al)|geostrophic|anomal|barotropic|baroclinic|depth.?averag")
"""A variable whose long name has one of these words is only a part of the current."""
ALONG_GRID = re.compile(r"(^|_)[xy]_(sea_water_)?velocity|^vozocrtx$|^vomecrty$")
"""Standard names and names of components along the rows and columns of a grid."""
ALONG_WORDS = re.compile(r"\b(grid.?[xyij]|[ij].?axis|[xy].?(direction|axis|component)|[uv].?momentum|xi|eta)\b")
TOWARD_EAST = re.compile(
    r"(^|_)(eastward|northward)|\b(eastward|northward|zonal|meridional)\b|^[uv]_(east|north)"
)

AXIS_NAMES = {
    "lon": {"lon", "longitude", "lons", "long", "nav_lon", "lon_rho", "lon_u", "lon_v", "lon_psi", "xlong"},
    "lat": {"lat", "latitude", "lats", "nav_lat", "lat_rho", "lat_u", "lat_v", "lat_psi", "xlat"},
    "depth": {"depth", "depths", "deptht", "depthu", "depthv", "z", "st_ocean", "z_t", "lev", "level_depth"},
    "time": {"time", "times", "mt", "ocean_time", "time_counter", "date_time", "valid_time"},
}
AXIS_NAMES["depth"] |= {"depthw"}
AXIS_NAMES["lon"] |= {"glamt", "glamu", "glamv", "glamf", "geolon", "geolon_c", "geolon_t", "geolon_u"}
AXIS_NAMES["lon"] |= {
    "geolon_v",
    "ulon",
    "tlon",
    "ulong",
    "tlong",
    "xc",
    "xg",
    "xu_ocean",
    "xt_ocean",
    "xh",
    "xq",
}
AXIS_NAMES["lat"] |= {"gphit", "gphiu", "gphiv", "gphif", "geolat", "geolat_c", "geolat_t", "geolat_u"}
AXIS_NAMES["lat"] |= {"geolat_v", "ulat", "tlat", "yc", "yg", "yu_ocean", "yt_ocean", "yh", "yq"}
AT_U = re.compile(r"(_u|lamu|phiu|^ul(on|at|ong))$|^ul(on|at|ong)$|^xu_|^yu_|_c$|_q$", re.IGNORECASE)
AT_V = re.compile(r"(_v|lamv|phiv)$|^ul(on|at|ong)$|^xu_|^yu_|_c$|_q$", re.IGNORECASE)
AT_W = re.compile(r"(_w|_t|_rho|lamt|phit)$|^tl(on|at|ong)$|^xt_|^yt_|_h$", re.IGNORECASE)
"""Coordinates of the points of u, of v and of w, in files that also hold other points."""
ELSEWHERE = re.compile(r"(lam[ft]|phi[ft]|_psi|_t|_rho|^tl(on|at|ong))$", re.IGNORECASE)
"""Coordinates of the points of tracers and of the cells' corners."""
NOT_AT_W = re.compile(r"(lam[fuv]|phi[fuv]|_psi|_[uvcq])$|^ul(on|at|ong)$|^xu_|^yu_", re.IGNORECASE)
"""Coordinates of points between which w lies."""
OF = {"u": (AT_U, ELSEWHERE), "v": (AT_V, ELSEWHERE), "w": (AT_W, NOT_AT_W)}
"""Coordinates that fit a component, and coordinates that do not."""
OTHERS = re.compile(r"^(tl(on|at|ong)|glam[ft]|gphi[ft]|geo(lon|lat)_t|(lon|lat)_psi)$", re.IGNORECASE)
"""Coordinates without currents, unless the variable's `coordinates` attribute names them."""
UNFIT_FOR_DEGREES = ("m", "km", "meters", "metres", "meter", "metre", "1")
"""Units of the axes of a plane, which are not degrees."""
SINCE = re.compile(r"\bsince\s+[-+]?\d", re.IGNORECASE)
"""The part of a unit of time that gives its origin."""
CF_AXES = {"longitude": "lon", "latitude": "lat", "vertical": "depth", "time": "time"}
WORDS = {"lon": "longitude", "lat": "latitude", "depth": "depth", "time": "time"}
SIGMA = re.compile(r"ocean_(s|sigma|double_sigma)")


@dataclass(frozen=True)
class Names:
    """The user's settings for a file; None leaves a setting to the file.

    `u`, `v`: the variables of the currents. `lon`, `lat`, `depth`, `time`: their coordinates. `mask`: the land
    mask; `bottom`: the model's depth; `quality`: the quality flag ("none" leaves one of these three out).
    `units`: of the currents. `positive`: "down" or "up", the direction of the depths. `rotate`: "none" if u, v
    are toward east and north, "grid" if they are along the grid's rows and columns, or the variable with the
    angle from east to the rows. `stagger`: "none" if u and v lie at the given coordinates, "nemo" if u lies half
    a cell further along the rows and v half a cell further across them. `land`: the mask's value on land, 0 or 1.
    `zeros`: currents of exactly 0 are "land" (or seabed) or "calm" water. `hold`: "all" holds the one level of a
    file at all depths. `stamps`: where in its interval the time of a mean stands, "start", "middle" or "end".
    `origin`: the date from which times count, or with `step` [hours] the date of the first of several files that
    hold no time. `member` and `run`: which member of an ensemble and which of several forecasts, by number or
    date. `group`: of a NetCDF-4 file.
    """

    u: str | None = None
    v: str | None = None
    lon: str | None = None
    lat: str | None = None
    depth: str | None = None
    time: str | None = None
    units: str | None = None
    positive: str | None = None
    rotate: str | None = None
    stagger: str | None = None
    mask: str | None = None
    land: int | None = None
    bottom: str | None = None
    quality: str | None = None
    zeros: str | None = None
    hold: str | None = None
    stamps: str | None = None
    origin: str | None = None
    step: float | None = None
    member: int | str | None = None
    run: int | str | None = None
    group: str | None = None

    def __post_init__(self) -> None:
        for name, choices in CHOICES.items():
            value = getattr(self, name)
            allowed = " or ".join(f'"{choice}"' for choice in choices)
            require(value is None or value in choices, f"`{name}` must be {allowed}; got {value!r}")
        require(self.land in (None, 0, 1), f"`land` must be 0 or 1; got {self.land!r}")
        require(self.step is None or self.step > 0, f"`step` must be above 0 hours; got {self.step}")
        require(
            self.step is None or self.origin is not None,
            "`step` needs the date of the first file; also set `origin`, such as 2024-11-20T00:00",
        )

    def variables(self) -> dict[str, str]:
        """Return the settings that name a variable of the file, as keys and names."""
        keys = ("u", "v", "lon", "lat", "depth", "time", "mask", "bottom", "quality")
        given = {key: getattr(self, key) for key in keys}
        if self.rotate not in (None, "none", "grid"):
            given["rotate"] = self.rotate
        leaves_out = {"mask", "bottom", "quality"}
        return {
            key: name
            for key, name in given.items()
            if name is not None and not (name == "none" and key in leaves_out)
        }


CHOICES = {
    "positive": ("up", "down"),
    "stagger": ("none", "nemo"),
    "zeros": ("land", "calm"),
    "hold": ("all",),
    "stamps": ("start", "middle", "end"),
}
"""The allowed values of some settings."""


def standard_name(variable: Any) -> str:
    """Return the CF standard name in lower case, or an empty text; CROCO's additions about points are removed."""
    return re.sub(r"_at_[a-z]+_locations?$", "", str(variable.attrs.get("standard_name", "")).strip().lower())


def units_of(variable: Any) -> str:
    """Return the unit of a variable, under any spelling of the attribute, or an empty text."""
    attrs = variable.attrs
    return next((str(attrs[key]).strip() for key in ("units", "unit", "Unit", "Units") if key in attrs), "")


def listing(names: Iterable[Any]) -> str:
    """Return a text of at most twelve names."""
    every = [str(name) for name in names]
    return (", ".join(every[:12]) + (", ..." if len(every) > 12 else "")) or "no variables"


class Catalogue:
    """The variables of one open file (an xarray.Dataset) and what they are."""

    def __init__(self, name: str, data: Any, names: Names) -> None:
        self.name, self.data, self.names = name, data, names

    def components(self) -> dict[str, tuple[str, str]]:
        """Return variable and reason for u and v, or for the one that the file holds, or an empty dictionary."""
        named = {c: str(getattr(self.names, c)) for c in "uv" if getattr(self.names, c) is not None}
        found_by_user = {c: (name, "as you say") for c, name in named.items() if name in self.data.variables}
        if len(named) == 2 or (named and not found_by_user):
            return found_by_user
        partial: dict[str, tuple[str, str]] = {}
        for how, pairs in (
            ("standard_name", STANDARD_NAMES),
            ("name", SHORT_NAMES),
            ("long_name", LONG_NAMES),
        ):
            for pair in pairs:
                found = dict(found_by_user)
                for component, key in zip("uv", pair, strict=True):
                    if component not in found and (hit := self._pick(how, key)) is not None:
                        found[component] = (hit, f"{how} {self._label(how, hit)}")
                if len(found) == 2:
                    return found
                partial = partial or found
        return partial

    def check_sense(self, component: str, name: str) -> tuple[str, ...]:
        """Raise InputError if a variable's standard name and its name are of different components.

        Return a note if only its long name is of the other component: such texts are often copied by mistake.
        """
        if component == "w" or getattr(self.names, component) == name:
            return ()
        variable = self.data[name]
        texts = {"standard name": standard_name(variable), "name": name.lower()}
        senses = {
            what: "uv"[pair.index(text)]
            for what, text in texts.items()
            for pair in (STANDARD_NAMES if what == "standard name" else SHORT_NAMES)
            if text in pair
        }
        way = {"u": "toward east or along x", "v": "toward north or along y"}
        contradiction = ", ".join(f"its {what} {texts[what]!r} is {way[sense]}" for what, sense in senses.items())
        require(
            len(set(senses.values())) < 2,
            f"`{name}` in {self.name} contradicts itself: {contradiction}; set `u` and `v` in `names` if you "
            "know "
            "which is which",
        )
        long = str(variable.attrs.get("long_name", "")).lower().replace("_", " ")
        others = [sense for sense, known in (("u", SENSE_OF_U), ("v", SENSE_OF_V)) if known.search(long)]
        if len(others) != 1 or others[0] == component:
            return ()
        believed = f"its {next(iter(senses), 'name')} is believed"
        return (f"the long name of `{name}`, {long!r}, is of the other component: {believed}",)

    def refuse(self) -> InputError:
        """Return the error for a file without currents."""
        named = [f"`{n}`" for c in "uv" if (n := getattr(self.names, c)) is not None]
        held = listing(self.data.data_vars)
        if named:
            return InputError(f"{self.name} holds no variable {' or '.join(named)}; it holds: {held}")
        return InputError(
            f"{self.name} holds no current toward east and north with a known name; "
            f"set `u` and `v` in `names` to two of: {held}"
        )

    def _label(self, how: str, name: str) -> str:
        return name if how == "name" else str(self.data[name].attrs[how]).strip()

    def _pick(self, how: str, key: str) -> str | None:
        hits = []
        for name, variable in self.data.data_vars.items():
            standard = standard_name(variable)
            text = f"{name} {variable.attrs.get('long_name', '')}".lower()
            packed = "scale_factor" in variable.encoding
            speed = in_metres_per_second(units_of(variable)) is not None
            number = variable.dtype.kind == "f" or packed or (speed and variable.dtype.kind in "iu")
            flag = {"flag_values", "flag_masks", "flag_meanings"} & set(variable.attrs)
            if not number or variable.ndim < 2 or flag:
                continue
            if how == "standard_name":
                matches = standard == key
            else:
                matches = not standard and not NO_CURRENT.search(text)
                if how == "name":
                    matches = matches and str(name).lower() == key
                else:
                    plain = text.replace("_", " ")
                    matches = matches and not A_PART.search(plain) and re.search(key, plain) is not None
            if matches:
                hits.append(str(name))
        known = [hit for hit in hits if any(hit.lower() in pair for pair in SHORT_NAMES)]
        hits = known if len(hits) > 1 and len(known) == 1 else hits
        require(
            len(hits) < 2,
            f"{self.name} holds {len(hits)} variables that could be the current, {', '.join(hits)}: "
            "set `u` and `v` in `names`",
        )
        return hits[0] if hits else None

    def kind(self, name: str) -> str | None:
        """Return a coordinate's axis: "lon", "lat", "depth", "time", "sigma" (terrain-following), or None."""
        variable = self.data[name]
        for kind in WORDS:
            if getattr(self.names, kind) == name:
                return kind
        standard, units = standard_name(variable), units_of(variable)
        if SIGMA.match(standard) or re.match(r"s_(rho|w)$", name):
            return "sigma"
        if standard.startswith(("grid_l", "projection_", "forecast_")):
            return None
        for cf, kind in CF_AXES.items():
            if name in self.data[[name]].set_coords(name).cf.coordinates.get(cf, []):
                return kind
        if SINCE.search(units):
            return "time"
        if str(variable.attrs.get("axis", "")).upper() == "Z":
            return "depth"
        if standard:
            return None
        hit = next((kind for kind, known in AXIS_NAMES.items() if name.lower() in known), None)
        hit = self._plain_degrees(name, units) if hit is None else hit
        # the metres of a plane are not degrees
        return None if hit in ("lon", "lat") and units.lower() in UNFIT_FOR_DEGREES else hit

    def _plain_degrees(self, name: str, units: str) -> str | None:
        """Return the axis if x or y are degrees: by the long name, or because GMT made the grid."""
        variable = self.data[name]
        if variable.ndim != 1 or name.lower() not in ("x", "y"):
            return None
        kind = {"x": "lon", "y": "lat"}[name.lower()]
        long = str(variable.attrs.get("long_name", "")).lower()
        described = WORDS[kind] in long and units.lower() in ("", "degrees", "degree", "deg")
        made = not units and {"node_offset", "GMT_version"} & set(self.data.attrs)
        return kind if described or made else None

    def axis_of(self, variable: Any, dim: str) -> tuple[str, str] | None:
        """Return kind and name of the coordinate along a dimension; one with the dimension's name comes first."""
        same_name = [dim] if dim in self.data.variables else []
        others = [str(name) for name in (*variable.coords, *self.data.variables) if str(name) not in same_name]
        hits = [
            (kind, name)
            for name in dict.fromkeys(same_name + others)
            if self.data[name].dims == (dim,) and (kind := self.kind(name)) is not None
        ]
        chosen = [hit for hit in hits if getattr(self.names, hit[0], None) == hit[1]]
        return next(iter(chosen or hits), None)

    def scalar(self, variable: Any, kind: str) -> str | None:
        """Return the name of a coordinate of one value, or None; the height of a wind does not count."""
        listed = self.coordinates(variable)
        hits = []
        for name in map(str, self.data.variables):
            candidate = self.data[name]
            if candidate.size != 1 or set(candidate.dims) - set(variable.dims) or self.kind(name) != kind:
                continue
            wind = standard_name(candidate).startswith(("height", "altitude"))
            known = standard_name(candidate) in AXIS_NAMES[kind] or name.lower() in AXIS_NAMES[kind]
            if (name in listed and not wind) or known:
                hits.append(name)
        return hits[0] if hits else None

    def coordinates(self, variable: Any) -> list[str]:
        """Return the coordinates that a variable's attribute names."""
        return str(variable.encoding.get("coordinates", variable.attrs.get("coordinates", ""))).split()

    def places(self, variable: Any, component: str) -> tuple[str, str] | None:
        """Return the names of the two-dimensional longitude and latitude of a variable's points, or None."""
        dims = set(map(str, variable.dims))
        found = {}
        here_of, elsewhere_of = OF[component]
        for kind in ("lon", "lat"):
            wanted = getattr(self.names, kind)
            every = [
                name
                for name in map(str, self.data.variables)
                if self.data[name].squeeze().ndim == 2
                and set(map(str, self.data[name].squeeze().dims)) <= dims
                and self.kind(name) == kind
            ]
            if wanted is not None and wanted in every:
                every = [wanted]
            every = [name for name in every if not elsewhere_of.search(name)] or every
            listed = [name for name in every if name in self.coordinates(variable)]
            matching = [name for name in every if here_of.search(name)]
            hits = listed if len(listed) == 1 else matching if len(matching) == 1 else every
            wrong = elsewhere_of if component == "w" else OTHERS
            elsewhere = [name for name in hits if wanted != name and name not in listed and wrong.search(name)]
            require(
                not elsewhere,
                f"`{variable.name}` in {self.name} does not lie at `{', '.join(elsewhere)}`, which are other "
                "points of the cells: add the file with the positions of its points, or set `lon` and `lat` in "
                "`names`",
            )
            require(
                len(hits) < 2,
                f"`{variable.name}` in {self.name} may lie at any of {', '.join(hits)}: "
                "set `lon` and `lat` in `names`",
            )
            if hits:
                found[kind] = hits[0]
        return (found["lon"], found["lat"]) if len(found) == 2 else None
