"""Ocean current files: right values, or one sentence that says what is missing and how to say it."""

import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .frame import LocalFrame, Range, wrapped
from .kernels.flow import OceanGrid
from .kernels.terrain import Seabed
from .ocean_flow import EARTH, OceanFile, crop, grid_flow, ocean_flow, sample
from .settings import from_table, require

__all__ = [
    "Names",
    "OceanFile",
    "OceanFlow",
    "divergence_ratio",
    "grid_flow",
    "ocean_flow",
    "read_currents",
    "sample",
]

LIMIT = 2e9
"""The most that the currents of a domain may take in memory [bytes]: two float64 a point."""
NO_DATA = 1e3
"""No unit of a current makes such a number: a fill that the file does not declare."""
FASTEST = 9.0
"""No ocean current is as fast [m/s]: a fill, or another unit."""
CALM = 5.0
"""The most that a file without a unit may hold to pass for m/s."""

STANDARD_NAMES = [
    ("eastward_sea_water_velocity", "northward_sea_water_velocity"),
    ("surface_eastward_sea_water_velocity", "surface_northward_sea_water_velocity"),
    ("eastward_sea_water_velocity_assuming_no_tide", "northward_sea_water_velocity_assuming_no_tide"),
    ("surface_geostrophic_eastward_sea_water_velocity", "surface_geostrophic_northward_sea_water_velocity"),
    ("surface_eastward_geostrophic_sea_water_velocity", "surface_northward_geostrophic_sea_water_velocity"),
    ("geostrophic_eastward_sea_water_velocity", "geostrophic_northward_sea_water_velocity"),
]
SHORT_NAMES = [
    ("uo", "vo"),
    ("utotal", "vtotal"),
    ("water_u", "water_v"),
    ("u_eastward", "v_northward"),
    ("u", "v"),
    ("ugos", "vgos"),
    ("uvel", "vvel"),
    ("ucur", "vcur"),
    ("eastward_eulerian_current_velocity", "northward_eulerian_current_velocity"),
]
IN_METRES = {"uo", "vo", "utotal", "vtotal", "water_u", "water_v", "ugos", "vgos"}
"""Names whose makers write m/s, with or without saying so."""
LONG_NAMES = [
    (
        r"(?=.*\b(eastward|zonal)\b)(?=.*\b(current|velocity)\b)",
        r"(?=.*\b(northward|meridional)\b)(?=.*\b(current|velocity)\b)",
    )
]
NO_CURRENT = re.compile(r"\bwind|stress|stokes|flag|\berror|quality|uncertain|\bice\b|\bair\b|\bstd|variance")
A_PART = re.compile(r"\btid(e|al)|geostrophic|anomal|barotropic|baroclinic|depth.?averag")
"""A long name that says so is not the whole current."""
GRID_AXES = re.compile(r"(^|_)[xy]_(sea_water_)?velocity|^(vozocrtx|vomecrty)$")

AXIS_NAMES = {
    "lon": {"lon", "longitude", "lons", "long", "nav_lon"},
    "lat": {"lat", "latitude", "lats", "nav_lat"},
    "depth": {"depth", "depths", "deptht", "depthu", "depthv", "z", "st_ocean", "z_t"},
    "time": {"time", "times", "mt", "ocean_time", "time_counter", "date_time"},
}
NO_GRIDS = {"trajectory", "timeseries", "profile", "trajectoryprofile", "timeseriesprofile", "point"}
CF_AXES = {"longitude": "lon", "latitude": "lat", "vertical": "depth", "time": "time"}
WORDS = {"lon": "longitude", "lat": "latitude", "depth": "depth", "time": "time"}
METRES = {"": 1.0, "m": 1.0, "meter": 1.0, "metre": 1.0, "cm": 0.01, "centimeter": 0.01, "centimetre": 0.01}
METRES |= {"km": 1e3, "kilometer": 1e3, "kilometre": 1e3, "mm": 1e-3, "millimeter": 1e-3, "millimetre": 1e-3}
KNOTS = {"knot", "knots", "kt", "kts", "kn"}


@dataclass(frozen=True)
class Names:
    """What a user says about a file; None is for the file to say.

    `u`, `v`: the currents toward east and north. `lon`, `lat`, `depth`, `time`: their axes. `units`: of the
    currents. `positive`: "down" or "up", the sense of the depths.
    """

    u: str | None = None
    v: str | None = None
    lon: str | None = None
    lat: str | None = None
    depth: str | None = None
    time: str | None = None
    units: str | None = None
    positive: str | None = None

    def __post_init__(self) -> None:
        require(
            self.positive in (None, "up", "down"), f'`positive` must be "up" or "down"; got {self.positive!r}'
        )


@dataclass(frozen=True)
class OceanFlow:
    """The block [flow] of kind "netcdf": `file` or files, the `epoch` (ISO 8601, UTC) of t = 0.

    `clearance` [m] is kept above the seabed; `names` where the file does not speak for itself.
    """

    file: tuple[str, ...] = field(
        metadata={"missing": "the file of currents, or a list of them, such as --set flow.file=currents.nc"}
    )
    clearance: float = 0.0
    epoch: str | None = None
    names: Names | None = None

    def waters(self, frame: LocalFrame, lon: Range, lat: Range, depth: Range) -> tuple[OceanGrid, Seabed, str]:
        """Flow and seabed of a domain, and a word on where they come from."""
        file = read_currents(self.file, self.names, lon=lon, lat=lat, depth=depth)
        flow, seabed = ocean_flow(file, frame, lon, lat, depth, self.epoch, self.clearance)
        words = [f"{file.took['u']}, {file.took['v']} of {file.name}", file.time_range, *file.notes]
        return flow, seabed, "; ".join(words)


@dataclass(frozen=True)
class _Axes:
    """The axes of one variable, rising."""

    lon: NDArray[np.float64]
    lat: NDArray[np.float64]
    depth: NDArray[np.float64] | None
    times: NDArray[np.datetime64] | None


@dataclass(frozen=True)
class _Part:
    """One component out of one file."""

    component: str
    axes: _Axes
    values: NDArray[np.float32]
    took: dict[str, str]
    notes: tuple[str, ...]


def read_currents(
    files: str | Path | Sequence[str | Path],
    names: Names | Mapping[str, str] | None = None,
    *,
    lon: Range | None = None,
    lat: Range | None = None,
    depth: Range | None = None,
    limit: float = LIMIT,
) -> OceanFile:
    """The currents of one file, or of several: one per component, or one per stretch of time.

    `names` as `Names` says. `lon`, `lat` [degrees] and `depth` [m] read no more than a domain
    needs; more than `limit` [bytes] is refused.
    """
    paths = [Path(files)] if isinstance(files, (str, Path)) else [Path(path) for path in files]
    require(len(paths) > 0, "`flow.file` must name at least one current file; got none")
    said = names if isinstance(names, Names) else from_table(Names, names or {}, "names")
    domain = None if lon is None or lat is None else (lon, lat, depth or (0.0, 0.0))
    parts: list[_Part] = []
    for path in paths:
        with _opened(path) as data:
            room = limit - sum(8.0 * part.values.size for part in parts)
            parts += _Reader(path.name, data, said).parts(domain, room, whole_depth=depth is None)
    return _joined(paths, parts)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        import cf_xarray  # noqa: F401  (registers the accessor)
        import xarray

        if find_spec("h5netcdf") is None:
            raise ImportError(name="h5netcdf")
    except ImportError as error:
        raise InputError(
            f"reading {path.name} needs {error.name}, which is missing: pip install glider-stream[ocean]"
        ) from None
    require(path.exists(), f"the current file {path} does not exist")
    require(path.is_file(), f"the current file {path} is a folder; name the NetCDF file in it")
    try:
        with path.open("rb") as stream:
            head = stream.read(2056)
    except OSError as error:
        raise InputError(f"the current file {path} cannot be read: {error.strerror}") from None
    hdf5 = any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (0, 512, 1024, 2048))
    require(head[:4] != b"CDF\x05", f"{path.name} is a NetCDF-5 file: rewrite it with `nccopy -k nc4`")
    require(hdf5 or head[:4] in (b"CDF\x01", b"CDF\x02"), f"{path.name} is not a NetCDF file, whatever its name")
    with warnings.catch_warnings():
        # stale attributes of good data: several fill values, odd calendars
        warnings.simplefilter("ignore", xarray.SerializationWarning)
        warnings.filterwarnings("ignore", category=RuntimeWarning, module=r"xarray|scipy")
        try:
            with xarray.open_dataset(
                path, engine="h5netcdf" if hdf5 else "scipy", decode_times=False, cache=False
            ) as data:
                yield data
        except InputError:
            raise
        except Exception as error:
            # what a damaged file makes the libraries raise is not written down anywhere
            what = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise InputError(f"{path.name} cannot be read; it may be truncated or damaged: {what}") from None


class _Reader:
    """What one open file says, refused where it says too little."""

    def __init__(self, name: str, data: Any, said: Names) -> None:
        self.name, self.data, self.said = name, data, said

    def parts(self, domain: tuple[Range, Range, Range] | None, room: float, whole_depth: bool) -> list[_Part]:
        """Both components, or the one that this file holds."""
        sort = str(self.data.attrs.get("featureType", "")).lower()
        require(
            sort not in NO_GRIDS,
            f"{self.name} is a {sort}: what was measured along a track or at a mooring is no grid to plan on",
        )
        found = self._find()
        dims = {component: set(self.data[variable].dims) for component, (variable, _) in found.items()}
        if len(dims) == 2 and dims["u"] != dims["v"]:
            u, v = (f"`{variable}` ({', '.join(self.data[variable].dims)})" for variable, _ in found.values())
            raise InputError(
                f"{self.name} holds a staggered grid, {u} and {v}: interpolate both to one regular "
                "longitude-latitude grid first"
            )
        result = []
        for component, (variable, how) in found.items():
            result.append(self._part(component, variable, how, domain, room, whole_depth))
            room -= 8.0 * result[-1].values.size
        return result

    def _find(self) -> dict[str, tuple[str, str]]:
        """Variable and reason by component; u and v by the same rule wherever both are here."""
        told = {c: str(getattr(self.said, c)) for c in "uv" if getattr(self.said, c) is not None}
        here = {c: (name, "as you say") for c, name in told.items() if name in self.data.variables}
        if told:
            if not here:
                raise InputError(
                    f"{self.name} holds no variable {' or '.join(f'`{n}`' for n in told.values())}; "
                    f"it holds: {self._listing()}"
                )
            if len(told) == 2:
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
        along = [
            n for n, v in self.data.data_vars.items() if GRID_AXES.search(self._standard(v) or str(n).lower())
        ]
        if along and not partial:
            raise InputError(
                f"`{along[0]}` in {self.name} runs along the grid's axes, not toward east or north: "
                "rotate it first, or name `u` and `v` in `names` if these are east and north"
            )
        require(
            bool(partial),
            f"{self.name} holds no current toward east and north that can be told by its name; "
            f"name `u` and `v` in `names`, out of: {self._listing()}",
        )
        return partial

    def _listing(self) -> str:
        every = [str(name) for name in self.data.data_vars]
        return (", ".join(every[:12]) + (", ..." if len(every) > 12 else "")) or "no variables"

    def _standard(self, variable: Any) -> str:
        return str(variable.attrs.get("standard_name", "")).strip().lower()

    def _label(self, how: str, name: str) -> str:
        return name if how == "name" else str(self.data[name].attrs[how]).strip()

    def _pick(self, how: str, key: str) -> str | None:
        hits = []
        for name, variable in self.data.data_vars.items():
            standard = self._standard(variable)
            words = f"{name} {variable.attrs.get('long_name', '')}".lower()
            packed = "scale_factor" in variable.encoding
            speed = _per_second(str(variable.attrs.get("units", ""))) is not None
            number = variable.dtype.kind == "f" or packed or (speed and variable.dtype.kind in "iu")
            if (
                not number
                or variable.ndim < 2
                or {"flag_values", "flag_masks", "flag_meanings"} & set(variable.attrs)
            ):
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

    def _kind(self, name: str) -> str | None:
        """Which axis a coordinate is: lon, lat, depth, time, or a word for what cannot be read."""
        variable = self.data[name]
        for kind in WORDS:
            if getattr(self.said, kind) == name:
                return kind
        standard, units = self._standard(variable), str(variable.attrs.get("units", "")).strip()
        if re.match(r"ocean_(s|sigma|double_sigma)", standard) or re.match(r"s_(rho|w)$", name):
            return "sigma"
        if standard.startswith(("grid_l", "projection_", "forecast_")):
            return None
        for cf, kind in CF_AXES.items():
            if name in self.data[[name]].set_coords(name).cf.coordinates.get(cf, []):
                return kind
        if " since " in units:
            return "time"
        if str(variable.attrs.get("axis", "")).upper() == "Z":
            return "depth"
        if standard:
            return None
        return next((kind for kind, known in AXIS_NAMES.items() if name.lower() in known), None)

    def _axis_of(self, variable: Any, dim: str) -> tuple[str, str] | None:
        """Kind and name of the coordinate along a dimension, the dimension's own first."""
        own = [dim] if dim in self.data.variables else []
        others = [str(name) for name in (*variable.coords, *self.data.variables) if str(name) not in own]
        hits = [
            (kind, name)
            for name in dict.fromkeys(own + others)
            if self.data[name].dims == (dim,) and (kind := self._kind(name)) is not None
        ]
        asked = [hit for hit in hits if getattr(self.said, hit[0], None) == hit[1]]
        return next(iter(asked or hits), None)

    def _dims(self, variable: Any) -> tuple[dict[str, tuple[str, str]], list[str]]:
        """Dimension and coordinate by kind; dimensions of one element that are no axis."""
        axes: dict[str, tuple[str, str]] = {}
        single: list[str] = []
        self._refuse_geometry(variable)
        for dim in map(str, variable.dims):
            hit = self._axis_of(variable, dim)
            if hit is not None and hit[0] == "sigma":
                raise InputError(
                    f"`{variable.name}` in {self.name} is on terrain-following levels `{dim}`: "
                    "interpolate it to levels of fixed depth first"
                )
            if hit is not None and hit[0] not in axes:
                axes[hit[0]] = (dim, hit[1])
            elif variable.sizes[dim] == 1:
                single.append(dim)
            else:
                raise InputError(
                    f"the dimension `{dim}` ({variable.sizes[dim]}) of `{variable.name}` in {self.name} has "
                    "no longitude, latitude, depth or time that can be told; name it in `names`"
                )
        for kind in ("lon", "lat"):
            require(
                kind in axes and variable.sizes[axes[kind][0]] > 1,
                f"`{variable.name}` in {self.name} has no {WORDS[kind]} axis of two points or more: "
                "a current at one position is no grid to plan on",
            )
        return axes, single

    def _refuse_geometry(self, variable: Any) -> None:
        """Grids of other shapes, and what is no grid at all."""
        places = {
            kind: name for name in map(str, self.data.variables) if (kind := self._kind(name)) in ("lon", "lat")
        }
        of_two = [n for n in map(str, self.data.variables) if self.data[n].ndim == 2 and self._kind(n) == "lon"]
        curved = [name for name in of_two if set(self.data[name].dims) <= set(variable.dims)]
        if curved and not any(self.data[n].dims == (d,) for n in places.values() for d in variable.dims):
            raise InputError(
                f"{self.name} is on a curvilinear grid, longitude `{curved[0]}` is two-dimensional: "
                "interpolate to a regular longitude-latitude grid first, with currents toward east and north"
            )
        dims = [self.data[name].dims for name in places.values()]
        if len(dims) == 2 and dims[0] == dims[1] and len(dims[0]) == 1 and set(dims[0]) <= set(variable.dims):
            raise InputError(
                f"{self.name} has longitude and latitude along one dimension, `{dims[0][0]}`: a track or an "
                "unstructured mesh, and not a regular grid"
            )

    def _degrees(self, name: str, kind: str) -> tuple[NDArray[np.float64], bool]:
        """The axis rising, without a last point that repeats the first, and whether it was turned."""
        axis = np.asarray(self.data[name].values, dtype=np.float64)
        broken = f"the {WORDS[kind]} `{name}` in {self.name}"
        require(bool(np.isfinite(axis).all()), f"{broken} has missing values")
        turned = bool(np.median(np.diff(axis)) < 0)
        axis = axis[::-1] if turned else axis
        if kind == "lon":
            axis = axis[0] + (axis - axis[0]) % 360
            # a cyclic point rounds to either side of the full circle
            cyclic = axis.size > 2 and bool(axis[-1] < axis[1] - 1e-3 * abs(axis[1] - axis[0]))
            axis = axis[:-1] if cyclic else axis
        else:
            require(bool((np.abs(axis) <= 90.001).all()), f"{broken} reaches beyond 90 degrees")
        require(bool((np.diff(axis) > 0).all()), f"{broken} does not rise or fall steadily")
        return axis, turned

    def _depths(self, name: str) -> tuple[NDArray[np.float64], bool, str]:
        """Depths downward, rising; whether turned; what was taken for what."""
        variable = self.data[name]
        axis = np.atleast_1d(np.asarray(variable.values, dtype=np.float64))
        broken = f"the depth `{name}` in {self.name}"
        require(bool(np.isfinite(axis).all()), f"{broken} has missing values")
        units = str(variable.attrs.get("units", "")).strip().lower()
        factor = METRES.get(units if len(units) < 3 else units.removesuffix("s"))
        if factor is None:
            raise InputError(f"{broken} is in {units!r}, not in metres: convert it first")
        below, above = bool((axis <= 0).all()), bool((axis >= 0).all())
        require(
            below or above,
            f"{broken} runs from {axis.min():g} to {axis.max():g}, on both sides of the surface",
        )
        claim = self.said.positive or str(variable.attrs.get("positive", "")).strip().lower()
        if claim not in ("up", "down"):
            claim = "up" if self._standard(variable).startswith(("height", "altitude")) else ""
        sense = "up" if not above else "down" if not below else claim or "down"
        # heights above the seabed look so, too: the sign alone must not decide
        require(
            claim in ("", sense),
            f"{broken} is said to be positive {claim}, but runs from {axis[0]:g} to {axis[-1]:g}: "
            f'if these are depths under the surface, name `positive` = "{sense}" in `names`',
        )
        axis = np.abs(axis) * factor
        turned = axis.size > 1 and bool(axis[0] > axis[-1])
        axis = axis[::-1] if turned else axis
        require(bool((np.diff(axis) > 0).all()), f"{broken} does not rise or fall steadily")
        return axis, turned, f"{name}, positive {sense}"

    def _times(self, name: str) -> tuple[NDArray[np.datetime64] | None, tuple[str, ...]]:
        """UTC, or None for a single time that does not say when; notes."""
        import xarray

        variable = self.data[name]
        broken = f"the time `{name}` in {self.name}"
        count = variable.size
        if " since " not in str(variable.attrs.get("units", "")):
            require(
                count == 1,
                f'{broken} has no unit such as "hours since 1950-01-01", so {count} times are unknown',
            )
            return None, (f"`{name}` does not say when it is",)
        require(bool(np.isfinite(variable.values).all()), f"{broken} has missing values")
        try:
            values = np.atleast_1d(xarray.decode_cf(self.data[[name]].drop_encoding())[name].values)
        except Exception as error:
            # what an impossible unit makes the libraries raise is not written down anywhere
            raise InputError(
                f"{broken} cannot be read: units {variable.attrs.get('units')!r}, calendar "
                f"{variable.attrs.get('calendar', 'standard')!r} ({str(error).splitlines()[0]})"
            ) from None
        notes: tuple[str, ...] = ()
        if values.dtype.kind == "O":
            calendar = str(variable.attrs.get("calendar", "standard"))
            try:
                # by its label: 1 March stays 1 March, whatever February was
                values = np.array([np.datetime64(one.isoformat(), "us") for one in values])
            except ValueError:
                raise InputError(f"{broken} has dates of the calendar {calendar!r} that do not exist") from None
            notes = (f"times of the calendar {calendar!r} keep their dates",)
        times = (values.astype("datetime64[us]") + np.timedelta64(500, "us")).astype("datetime64[ms]")
        return times, notes

    def _factor(self, variable: Any) -> tuple[float | None, str]:
        """Into m/s, and the unit; None where the file gives none."""
        attrs = variable.attrs
        units = self.said.units or next(
            (str(attrs[k]) for k in ("units", "unit", "Unit", "Units") if k in attrs), ""
        )
        if not units.strip():
            inside = re.search(r"[(\[]([^()\[\]]+)[)\]]\s*$", str(attrs.get("long_name", "")))
            units = inside.group(1) if inside and _per_second(inside.group(1)) else ""
        if not units.strip():
            return None, "no unit"
        factor = _per_second(units)
        if factor is None:
            raise InputError(
                f"`{variable.name}` in {self.name} is in {units!r}, which is no speed that is known; "
                'name `units` in `names`, such as "m/s" or "cm/s"'
            )
        return factor, units.strip()

    def _part(
        self,
        component: str,
        name: str,
        how: str,
        domain: tuple[Range, Range, Range] | None,
        room: float,
        whole_depth: bool,
    ) -> _Part:
        variable = self.data[name]
        standard = self._standard(variable)
        dims, single = self._dims(variable)
        factor, units = self._factor(variable)
        took = {component: f"{name} ({how}, {units})"}
        took |= {kind: coordinate for kind, (_, coordinate) in dims.items()}
        notes: tuple[str, ...] = ()
        if GRID_AXES.search(standard):
            notes += (f"`{name}` is {standard}: taken as {'east' if component == 'u' else 'north'}, as you say",)
        notes += tuple(f"the dimension `{dim}` of one element is left out" for dim in single)

        lon, lon_turned = self._degrees(dims["lon"][1], "lon")
        lat, lat_turned = self._degrees(dims["lat"][1], "lat")
        depth, depth_turned, times = None, False, None
        vertical = dims["depth"][1] if "depth" in dims else self._scalar(variable, "depth")
        if vertical is not None:
            depth, depth_turned, took["depth"] = self._depths(vertical)
        when = dims["time"][1] if "time" in dims else self._scalar(variable, "time")
        if when is not None:
            took["time"] = when
            times, more = self._times(when)
            notes += more

        which, rows = np.arange(lon.size), slice(0, lat.size)
        levels = slice(0, 1 if depth is None else depth.size)
        if domain is not None:
            middle = float(wrapped((domain[0][0] + (domain[0][1] - domain[0][0]) % 360 / 2), 0.0))
            which, lon, rows, cut = crop(self.name, (lon, lat, depth), *domain, centre=middle)
            levels = levels if whole_depth else slice(cut.start, min(cut.stop, levels.stop))
        sizes = (
            1 if times is None else times.size,
            levels.stop - levels.start,
            rows.stop - rows.start,
            which.size,
        )
        # as the planner holds it, in float64; the other component takes as much again
        need = 8.0 * math.prod(sizes)
        require(
            need <= room if component == "v" else 2 * need <= room,
            f"the currents of {self.name} would take {2 * need / 1e9:.1f} GB "
            f"({' x '.join(map(str, sizes))} points), more than the rest of the limit, {room / 1e9:.1f} GB: "
            "cut the file or narrow the domain",
        )

        count = variable.sizes[dims["lon"][0]]
        picked = {dims["lon"][0]: _along(which, count, lon_turned)}
        picked[dims["lat"][0]] = _along(np.arange(lat.size)[rows], lat.size, lat_turned)
        order = [dims["lat"][0], dims["lon"][0]]
        if "depth" in dims:
            picked[dims["depth"][0]] = _along(np.arange(depth.size)[levels], depth.size, depth_turned)  # type: ignore[union-attr]
            order.insert(0, dims["depth"][0])
        if "time" in dims:
            order.insert(0, dims["time"][0])
        plane = variable.isel({**picked, **dict.fromkeys(single, 0)}).transpose(*order)
        values = np.asarray(plane.values, dtype=np.float32).reshape(sizes)
        lat = lat[rows]
        depth = None if depth is None else depth[levels]
        if times is not None and times.size > 1:
            rank = np.argsort(times, kind="stable")
            if (np.diff(rank) != 1).any():
                times, values = times[rank], values[rank]
        values, more = self._checked(name, values, factor)
        return _Part(component, _Axes(lon, lat, depth, times), values, took, notes + more)

    def _scalar(self, variable: Any, kind: str) -> str | None:
        """A coordinate of one value; the height of a wind in the same file is none of the current's."""
        own = str(variable.encoding.get("coordinates", variable.attrs.get("coordinates", ""))).split()
        hits = []
        for name in map(str, self.data.variables):
            one = self.data[name]
            if one.size != 1 or set(one.dims) - set(variable.dims) or self._kind(name) != kind:
                continue
            wind = self._standard(one).startswith(("height", "altitude"))
            if (
                (name in own and not wind)
                or self._standard(one) in AXIS_NAMES[kind]
                or name.lower() in AXIS_NAMES[kind]
            ):
                hits.append(name)
        return hits[0] if hits else None

    def _checked(
        self, name: str, values: NDArray[np.float32], factor: float | None
    ) -> tuple[NDArray[np.float32], tuple[str, ...]]:
        """In m/s, NaN where there is no data."""
        notes: list[str] = []
        values = np.where(np.abs(values) > NO_DATA, np.float32(np.nan), values)
        values *= np.float32(factor or 1.0)
        beyond = np.abs(values) > FASTEST
        if beyond.any():
            marks = np.unique(values[beyond])
            require(
                marks.size == 1,
                f"`{name}` in {self.name} {'has no unit and ' if factor is None else ''}reaches "
                f"{float(np.abs(marks).max()):.4g} m/s, which no ocean current does: "
                'name its unit in `names`, such as `units` = "cm/s"',
            )
            values[beyond] = np.nan
            notes.append(f"`{name}` = {marks[0] / (factor or 1.0):g} is taken as no data")
        if factor is None:
            fastest = float(np.nanmax(np.abs(values), initial=0.0, where=np.isfinite(values)))
            require(
                name.lower() in IN_METRES and fastest < CALM,
                f"`{name}` in {self.name} has no unit (its largest value is {fastest:.3g}): "
                'name `units` in `names`, such as "m/s" or "cm/s"',
            )
            notes.append(f"`{name}` has no unit: taken as m/s, as its makers write it; at most {fastest:.2f}")
        return values, tuple(notes)


def _per_second(units: str) -> float | None:
    """m/s of one such unit."""
    text = re.sub(r"\s+", " ", units.strip().lower())
    if text in KNOTS:
        return 1852 / 3600
    text = text.replace(" ^", "^").replace("^-1", "-1").replace("**-1", "-1").replace(" / ", "/")
    match = re.fullmatch(r"([a-z]+?)s?\s*(/|per)\s*(s|sec|secs|second|seconds)\.?", text)
    match = match or re.fullmatch(r"([a-z]+?)s?[\s.*_]*(s|sec|secs|second|seconds)\s*-1", text)
    return METRES.get(match.group(1)) if match and match.group(1) else None


def _along(which: NDArray[np.intp], size: int, turned: bool) -> Any:
    """An index along a file's axis: a slice where it can be, which reads faster."""
    which = size - 1 - which if turned else which
    step = np.diff(which)
    if which.size > 1 and (step == 1).all():
        return slice(int(which[0]), int(which[-1]) + 1)
    return which


def _same(a: NDArray[Any] | None, b: NDArray[Any] | None) -> bool:
    if a is None or b is None:
        return a is b
    if a.shape != b.shape:
        return False
    if a.dtype.kind == "M":
        return bool((a == b).all())
    return bool(np.allclose(a, b, rtol=0, atol=1e-3 * float(np.diff(a).min(initial=1.0))))


def _joined(paths: list[Path], parts: list[_Part]) -> OceanFile:
    """One set of currents out of the parts: in the order of time, u and v on one grid."""
    name = paths[0].name if len(paths) == 1 else f"{paths[0].name} and {len(paths) - 1} more"
    first = parts[0].axes
    stacks: dict[str, tuple[NDArray[np.datetime64] | None, NDArray[np.float32]]] = {}
    for component, toward in (("u", "east"), ("v", "north")):
        own = [part for part in parts if part.component == component]
        require(len(own) > 0, f"{name} holds no current toward {toward}; name the file that does, too")
        for part in own:
            require(
                _same(part.axes.lon, first.lon)
                and _same(part.axes.lat, first.lat)
                and _same(part.axes.depth, first.depth),
                f"{name}: the currents are on different points ({_extent(first)}, and {_extent(part.axes)}), "
                "a staggered grid or unlike files; bring them onto one grid first",
            )
        if len(own) == 1:
            stacks[component] = own[0].axes.times, own[0].values
            continue
        known = [part.axes.times for part in own if part.axes.times is not None]
        require(
            len(known) == len(own), f"{name}: of several files, each must say its time; at least one does not"
        )
        joined, values = np.concatenate(known), np.concatenate([part.values for part in own])
        rank = np.argsort(joined, kind="stable")
        stacks[component] = joined[rank], values[rank]
    times = stacks["u"][0]
    require(_same(times, stacks["v"][0]), f"{name}: east and north currents are given at different times")
    if times is not None and times.size > 1:
        again = times[1:][np.diff(times) <= np.timedelta64(0, "ms")]
        require(again.size == 0, f"{name}: the time {again[:1]} is given more than once; leave out the overlap")
    u, v = stacks["u"][1], stacks["v"][1]
    none = np.isnan(u) | np.isnan(v)
    fills = bool(none.any())
    u[none] = v[none] = np.nan
    notes = list(dict.fromkeys(note for part in parts for note in part.notes))
    notes += _mark_land(u, v, fills)
    data = np.isfinite(u)
    wet, ever = np.asarray(data.all(axis=0)), np.asarray(data.any(axis=0))
    require(bool(ever.any()), f"{name} holds no current at all: every value is missing or zero")
    if (gaps := int((ever & ~wet).sum())) > 0:
        notes.append(
            f"{100 * gaps / ever.sum():.1f} % of the wet points have gaps in time; plans keep out of these"
        )
    if first.depth is None:
        notes.append("the file names no depth: its current is taken as the surface's and held at all depths")
    if times is None or times.size == 1:
        notes.append("a single time: the current is taken as steady")
    merged = {key: what for part in reversed(parts) for key, what in part.took.items()}
    took = {key: merged[key] for key in ("u", "v", *WORDS) if key in merged}
    depth = np.zeros(1) if first.depth is None else first.depth
    return OceanFile(name, first.lon, first.lat, depth, times, u, v, wet, first.depth is None, took, tuple(notes))


def _extent(axes: _Axes) -> str:
    return f"lon {axes.lon[0]:.6g} to {axes.lon[-1]:.6g}, lat {axes.lat[0]:.6g} to {axes.lat[-1]:.6g}"


def _mark_land(u: NDArray[np.float32], v: NDArray[np.float32], fills: bool) -> list[str]:
    """NaN where land is written as zeros: still water at all times, in the whole column.

    A file without any fill writes its seabed so as well: then also still water down to the last level.
    """
    still, known = np.ones(u.shape[1:], dtype=bool), np.zeros(u.shape[1:], dtype=bool)
    for east, north in zip(u, v, strict=True):
        missing = np.isnan(east)
        still &= ((east == 0) & (north == 0)) | missing
        known |= ~missing
    land = still.all(axis=0) & known.any(axis=0)
    dry = np.broadcast_to(land, still.shape).copy()
    if not fills:
        dry |= np.cumprod(still[::-1], axis=0)[::-1].astype(bool)
    u[:, dry] = v[:, dry] = np.nan
    notes = []
    if land.any():
        notes.append(f"{int(land.sum())} columns with no current at any time or depth are taken as land")
    if (under := int((dry & ~land).sum())) > 0:
        notes.append(f"{under} points with no current at any time, down to the last level, are taken as seabed")
    return notes


def divergence_ratio(file: OceanFile, level: int | None = None) -> float:
    """Rms horizontal divergence over rms vorticity, in the wet interior cells of one level or of all.

    0.05 to 0.3 in mesoscale fields, 0.45 to 0.8 in coastal and radar ones; NaN where no cell has neighbours.
    """
    phi = np.radians(file.lat)[:, None]
    step_x = EARTH * np.cos(phi) * np.radians(file.lon[2:] - file.lon[:-2])
    step_y = EARTH * np.radians(file.lat[2:] - file.lat[:-2])[:, None]
    cos, inner = np.cos(phi), np.s_[..., 1:-1, 1:-1]
    at = slice(None) if level is None else slice(level, level + 1)
    divergence = vorticity = 0.0
    for east, north in zip(file.u[:, at], file.v[:, at], strict=True):
        u, v = east.astype(np.float64), north.astype(np.float64)

        def along(f: NDArray[np.float64]) -> NDArray[np.float64]:
            return (f[..., 1:-1, 2:] - f[..., 1:-1, :-2]) / step_x[1:-1]

        def across(f: NDArray[np.float64]) -> NDArray[np.float64]:
            return (f[..., 2:, 1:-1] - f[..., :-2, 1:-1]) / step_y

        spread = along(u) + across(v * cos) / cos[1:-1]
        spin = along(v) - across(u * cos) / cos[1:-1]
        wet = np.isfinite(spread) & np.isfinite(spin) & np.isfinite(u[inner])
        divergence += float((spread[wet] ** 2).sum())
        vorticity += float((spin[wet] ** 2).sum())
    if vorticity == 0:
        return float("nan") if divergence == 0 else float("inf")
    return float(np.sqrt(divergence / vorticity))
