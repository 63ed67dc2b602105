"""Names: which variable of a file is what. The user's word first, then CF, then name, then long name."""

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
IN_METRES |= {"vozocrtx", "vomecrty", "u_eastward", "v_northward"}
"""Names whose makers write m/s, with or without saying so."""
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
"""Long names that say which component a variable is."""
NO_CURRENT = re.compile(r"\bwind|stress|stokes|flag|\berror|quality|uncertain|\bice\b|\bair\b|\bstd|variance")
A_PART = re.compile(r"\btid(e|al)|geostrophic|anomal|barotropic|baroclinic|depth.?averag")
"""A long name that says so is not the whole current."""
ALONG_GRID = re.compile(r"(^|_)[xy]_(sea_water_)?velocity|^vozocrtx$|^vomecrty$")
"""Standard names, and names, of components along the rows and columns of a grid."""
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
"""Coordinates of points where u and v are, where a file holds those of others, too."""
ELSEWHERE = re.compile(r"(lam[ft]|phi[ft]|_psi|_t|_rho|^tl(on|at|ong))$", re.IGNORECASE)
"""Coordinates of the points of tracers and of corners."""
OTHERS = re.compile(r"^(tl(on|at|ong)|glam[ft]|gphi[ft]|geo(lon|lat)_t|(lon|lat)_psi)$", re.IGNORECASE)
"""Coordinates at which no current is given, unless its own `coordinates` say so."""
UNFIT_FOR_DEGREES = ("m", "km", "meters", "metres", "meter", "metre", "1")
"""Units of a plane's own axes, which are no degrees."""
SINCE = re.compile(r"\bsince\s+[-+]?\d", re.IGNORECASE)
"""Part of a unit of time that says when the count begins."""
CF_AXES = {"longitude": "lon", "latitude": "lat", "vertical": "depth", "time": "time"}
WORDS = {"lon": "longitude", "lat": "latitude", "depth": "depth", "time": "time"}
SIGMA = re.compile(r"ocean_(s|sigma|double_sigma)")


@dataclass(frozen=True)
class Names:
    """What a user says about a file; None is for the file to say.

    `u`, `v`: the currents' variables; `lon`, `lat`, `depth`, `time`: their coordinates; `mask`: that of land;
    `bottom`: the model's depth; `quality`: the flag of quality. Of these three, "none" leaves it out.
    `units`: of the currents. `positive`: "down" or "up", the sense of the depths. `rotate`: "none" where u, v
    are toward east and north, "grid" where along the grid's rows and columns, or the variable of the angle
    from east to the rows. `stagger`: "none" where both lie at the coordinates given, "nemo" where u lies half
    a cell along the rows from there and v half a cell across them. `land`: the mask's value there, 0 or 1.
    `zeros`: what currents of exactly 0 are, "land" (or seabed) or "calm" water. `hold`: "all" holds the one
    level of a file at all depths. `stamps`: where in the interval of a mean its time stands, "start",
    "middle" or "end". `origin`: the date from which times count; with `step` [hours], the date of the first
    of several files that do not say their time. `member` and `run`: which of an ensemble, and of several
    forecasts, by its number or its date. `group`: of a NetCDF-4 file.
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
            said = " or ".join(f'"{choice}"' for choice in choices)
            require(value is None or value in choices, f"`{name}` must be {said}; got {value!r}")
        require(self.land in (None, 0, 1), f"`land` must be 0 or 1; got {self.land!r}")
        require(self.step is None or self.step > 0, f"`step` must be above 0 hours; got {self.step}")
        require(
            self.step is None or self.origin is not None,
            "`step` needs the date of the first file; name `origin`, too, such as 2024-11-20T00:00",
        )

    def variables(self) -> dict[str, str]:
        """Keys and values of those that name a variable of the file."""
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
"""What some of the names may be."""


def standard_name(variable: Any) -> str:
    """The CF standard name in lower case, or nothing; CROCO's, without the points that it adds."""
    return re.sub(r"_at_[a-z]+_locations?$", "", str(variable.attrs.get("standard_name", "")).strip().lower())


def units_of(variable: Any) -> str:
    """The unit that a variable gives, under any spelling of the attribute, or nothing."""
    attrs = variable.attrs
    return next((str(attrs[key]).strip() for key in ("units", "unit", "Unit", "Units") if key in attrs), "")


def listing(names: Iterable[Any]) -> str:
    """Some names, for people."""
    every = [str(name) for name in names]
    return (", ".join(every[:12]) + (", ..." if len(every) > 12 else "")) or "no variables"


class Catalogue:
    """What the variables of one open file (an xarray.Dataset) are."""

    def __init__(self, name: str, data: Any, said: Names) -> None:
        self.name, self.data, self.said = name, data, said

    def components(self) -> dict[str, tuple[str, str]]:
        """Variable and reason of u, v, or of the one that is here; none if there is neither."""
        told = {c: str(getattr(self.said, c)) for c in "uv" if getattr(self.said, c) is not None}
        here = {c: (name, "as you say") for c, name in told.items() if name in self.data.variables}
        if len(told) == 2 or (told and not here):
            return here
        partial: dict[str, tuple[str, str]] = {}
        for how, pairs in (
            ("standard_name", STANDARD_NAMES),
            ("name", SHORT_NAMES),
            ("long_name", LONG_NAMES),
        ):
            for pair in pairs:
                found = dict(here)
                for component, key in zip("uv", pair, strict=True):
                    if component not in found and (hit := self._pick(how, key)) is not None:
                        found[component] = (hit, f"{how} {self._label(how, hit)}")
                if len(found) == 2:
                    return found
                partial = partial or found
        return partial

    def check_sense(self, component: str, name: str) -> tuple[str, ...]:
        """InputError where a variable's standard name and its name speak of different components.

        A note where only its long name speaks of the other: such texts are often copied from the neighbour.
        """
        if getattr(self.said, component) == name:
            return ()
        variable = self.data[name]
        words = {"standard name": standard_name(variable), "name": name.lower()}
        senses = {
            what: "uv"[pair.index(word)]
            for what, word in words.items()
            for pair in (STANDARD_NAMES if what == "standard name" else SHORT_NAMES)
            if word in pair
        }
        way = {"u": "toward east or along x", "v": "toward north or along y"}
        told = ", ".join(f"its {what} {words[what]!r} is {way[sense]}" for what, sense in senses.items())
        require(
            len(set(senses.values())) < 2,
            f"`{name}` in {self.name} contradicts itself: {told}; name `u` and `v` in `names` if you know "
            "which is which",
        )
        long = str(variable.attrs.get("long_name", "")).lower().replace("_", " ")
        others = [sense for sense, known in (("u", SENSE_OF_U), ("v", SENSE_OF_V)) if known.search(long)]
        if len(others) != 1 or others[0] == component:
            return ()
        believed = f"its {next(iter(senses), 'name')} is believed"
        return (f"the long name of `{name}`, {long!r}, speaks of the other component: {believed}",)

    def refuse(self) -> InputError:
        """Why a file without currents is none."""
        told = [f"`{n}`" for c in "uv" if (n := getattr(self.said, c)) is not None]
        held = listing(self.data.data_vars)
        if told:
            return InputError(f"{self.name} holds no variable {' or '.join(told)}; it holds: {held}")
        return InputError(
            f"{self.name} holds no current toward east and north that can be told by its name; "
            f"name `u` and `v` in `names`, out of: {held}"
        )

    def _label(self, how: str, name: str) -> str:
        return name if how == "name" else str(self.data[name].attrs[how]).strip()

    def _pick(self, how: str, key: str) -> str | None:
        hits = []
        for name, variable in self.data.data_vars.items():
            standard = standard_name(variable)
            words = f"{name} {variable.attrs.get('long_name', '')}".lower()
            packed = "scale_factor" in variable.encoding
            speed = in_metres_per_second(units_of(variable)) is not None
            number = variable.dtype.kind == "f" or packed or (speed and variable.dtype.kind in "iu")
            flag = {"flag_values", "flag_masks", "flag_meanings"} & set(variable.attrs)
            if not number or variable.ndim < 2 or flag:
                continue
            if how == "standard_name":
                matches = standard == key
            else:
                matches = not standard and not NO_CURRENT.search(words)
                if how == "name":
                    matches = matches and str(name).lower() == key
                else:
                    plain = words.replace("_", " ")
                    matches = matches and not A_PART.search(plain) and re.search(key, plain) is not None
            if matches:
                hits.append(str(name))
        known = [hit for hit in hits if any(hit.lower() in pair for pair in SHORT_NAMES)]
        hits = known if len(hits) > 1 and len(known) == 1 else hits
        require(
            len(hits) < 2,
            f"{self.name} holds {len(hits)} variables that could be the current, {', '.join(hits)}: "
            "name `u` and `v` in `names`",
        )
        return hits[0] if hits else None

    def kind(self, name: str) -> str | None:
        """Which axis a coordinate is: lon, lat, depth, time, or a word for terrain-following levels."""
        variable = self.data[name]
        for kind in WORDS:
            if getattr(self.said, kind) == name:
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
        # a plane's own metres are no degrees
        return None if hit in ("lon", "lat") and units.lower() in UNFIT_FOR_DEGREES else hit

    def _plain_degrees(self, name: str, units: str) -> str | None:
        """x and y that are degrees: by their long name, or in a grid that GMT made."""
        variable = self.data[name]
        if variable.ndim != 1 or name.lower() not in ("x", "y"):
            return None
        kind = {"x": "lon", "y": "lat"}[name.lower()]
        long = str(variable.attrs.get("long_name", "")).lower()
        told = WORDS[kind] in long and units.lower() in ("", "degrees", "degree", "deg")
        made = not units and {"node_offset", "GMT_version"} & set(self.data.attrs)
        return kind if told or made else None

    def axis_of(self, variable: Any, dim: str) -> tuple[str, str] | None:
        """Kind and name of the coordinate along a dimension, the dimension's own first."""
        own = [dim] if dim in self.data.variables else []
        others = [str(name) for name in (*variable.coords, *self.data.variables) if str(name) not in own]
        hits = [
            (kind, name)
            for name in dict.fromkeys(own + others)
            if self.data[name].dims == (dim,) and (kind := self.kind(name)) is not None
        ]
        asked = [hit for hit in hits if getattr(self.said, hit[0], None) == hit[1]]
        return next(iter(asked or hits), None)

    def scalar(self, variable: Any, kind: str) -> str | None:
        """A coordinate of one value; the height of a wind in the same file is none of the current's."""
        own = self.coordinates(variable)
        hits = []
        for name in map(str, self.data.variables):
            one = self.data[name]
            if one.size != 1 or set(one.dims) - set(variable.dims) or self.kind(name) != kind:
                continue
            wind = standard_name(one).startswith(("height", "altitude"))
            known = standard_name(one) in AXIS_NAMES[kind] or name.lower() in AXIS_NAMES[kind]
            if (name in own and not wind) or known:
                hits.append(name)
        return hits[0] if hits else None

    def coordinates(self, variable: Any) -> list[str]:
        """The coordinates that a variable names itself."""
        return str(variable.encoding.get("coordinates", variable.attrs.get("coordinates", ""))).split()

    def places(self, variable: Any, component: str) -> tuple[str, str] | None:
        """The two-dimensional longitude and latitude of a variable's points, if there are such."""
        dims = set(map(str, variable.dims))
        found = {}
        for kind in ("lon", "lat"):
            said = getattr(self.said, kind)
            every = [
                name
                for name in map(str, self.data.variables)
                if self.data[name].squeeze().ndim == 2
                and set(map(str, self.data[name].squeeze().dims)) <= dims
                and self.kind(name) == kind
            ]
            if said is not None and said in every:
                every = [said]
            every = [name for name in every if not ELSEWHERE.search(name)] or every
            own = [name for name in every if name in self.coordinates(variable)]
            here = [name for name in every if (AT_U if component == "u" else AT_V).search(name)]
            hits = own if len(own) == 1 else here if len(here) == 1 else every
            elsewhere = [name for name in hits if said != name and name not in own and OTHERS.match(name)]
            require(
                not elsewhere,
                f"`{variable.name}` in {self.name} does not lie at `{', '.join(elsewhere)}`, places of cells' "
                "centres or corners: add the file that holds its own, or name `lon` and `lat` in `names`",
            )
            require(
                len(hits) < 2,
                f"`{variable.name}` in {self.name} may lie at any of {', '.join(hits)}: "
                "name `lon` and `lat` in `names`",
            )
            if hits:
                found[kind] = hits[0]
        return (found["lon"], found["lat"]) if len(found) == 2 else None
