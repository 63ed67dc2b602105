"""Ocean current files: right values, or one sentence that says what is missing and how to say it."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array, Bools
from ...base.checks import Range
from ...base.errors import InputError
from ...base.settings import from_table, require
from ..frame import wrapped
from .axes import degrees, depths, places, times
from .file import OceanFile
from .flow import HALO, MARGIN, levels_for
from .grid import Grid, grid_of
from .horizontal import halves, horizontal_of, no_axis, signs_of
from .joining import joined
from .land import clear_marks, mask_of
from .names import (
    ALONG_GRID,
    ALONG_WORDS,
    IN_METRES,
    TOWARD_EAST,
    Catalogue,
    Names,
    standard_name,
)
from .opening import opened
from .part import Field, Part
from .sigma import fixed_depths, sigma_levels, to_fixed
from .units import in_metres_per_second

Values = NDArray[np.float32]
Domain = tuple[Range, Range, Range]

LIMIT = 2e9
"""The most that the currents of a domain may take in memory [bytes]: two float64 a point."""
CALM = 5.0
"""The most that a file without a unit may hold to pass for m/s."""
NO_GRIDS = {"trajectory", "timeseries", "profile", "trajectoryprofile", "timeseriesprofile", "point"}
ANGLES = re.compile(r"^(angle|anglet|ang|alpha|angle_dx|angle_rho|grid_angle|rotang)$", re.IGNORECASE)
POLAR = 65.0
"""A global model's nominal axes are no places beyond this latitude [degrees]."""


def read_currents(
    files: str | Path | Sequence[str | Path],
    names: Names | Mapping[str, Any] | None = None,
    *,
    lon: Range | None = None,
    lat: Range | None = None,
    depth: Range | None = None,
    limit: float = LIMIT,
) -> OceanFile:
    """The currents of one file, or of several: one per component or stretch of time, and those of the grid.

    `names` as `Names` says. `lon`, `lat` [degrees] and `depth` [m] read no more than a domain
    needs; more than `limit` [bytes] is refused.
    """
    paths = [Path(files)] if isinstance(files, (str, Path)) else [Path(path) for path in files]
    require(len(paths) > 0, "`flow.file` must name at least one current file; got none")
    said = names if isinstance(names, Names) else from_table(Names, names or {}, "names")
    domain = None if lon is None or lat is None else (lon, lat, depth or (0.0, 0.0))
    parts: list[Part] = []
    with ExitStack() as stack:
        beside: list[Any] = []
        if len(paths) > 1:
            held = {path: _holds_currents(path, said) for path in paths}
            beside = [stack.enter_context(opened(path)) for path in paths if not held[path]]
            paths = [path for path in paths if held[path]] or paths[:1]
        for path in paths:
            with opened(path) as data:
                room = limit - sum(8.0 * part.values.size for part in parts)
                whole = _with(data, beside)
                parts += _Reader(path.name, whole, said).parts(domain, room, whole_depth=depth is None)
    return joined(paths, parts, said)


def _holds_currents(path: Path, said: Names) -> bool:
    with opened(path) as data:
        return bool(Catalogue(path.name, data, said).components())


def _with(data: Any, beside: list[Any]) -> Any:
    """A dataset, and those variables of others that fit its dimensions: a model's grid in a file of its own."""
    for other in beside:
        fits = {
            name: variable
            for name, variable in other.variables.items()
            if name not in data.variables and all(data.sizes.get(d, n) == n for d, n in variable.sizes.items())
        }
        data = data.assign(fits)
    return data


class _Reader:
    """What one open file says, refused where it says too little."""

    def __init__(self, name: str, data: Any, said: Names) -> None:
        self.name, self.data, self.said = name, data, said
        self.catalogue = Catalogue(name, data, said)

    def parts(self, domain: Domain | None, room: float, whole_depth: bool) -> list[Part]:
        """Both components, or the one that this file holds."""
        sort = str(self.data.attrs.get("featureType", "")).lower()
        require(
            sort not in NO_GRIDS,
            f"{self.name} is a {sort}: what was measured along a track or at a mooring is no grid to plan on",
        )
        found = self.catalogue.components()
        if not found:
            raise self.catalogue.refuse()
        result = []
        for component, (variable, how) in found.items():
            result.append(self._part(component, variable, how, domain, room, whole_depth))
            room -= 8.0 * result[-1].values.size
        return result

    def _others(self, variable: Any, horizontal: tuple[str, str]) -> tuple[dict[str, tuple[str, str]], list[str]]:
        """Dimension and coordinate of depth, sigma and time; dimensions of one element that are no axis."""
        axes: dict[str, tuple[str, str]] = {}
        single: list[str] = []
        for dim in map(str, variable.dims):
            if dim in horizontal:
                continue
            hit = self.catalogue.axis_of(variable, dim)
            if hit is None and re.match(r"s_(rho|w)$|sigma$|siglay$", dim):
                hit = ("sigma", dim)
            if hit is not None and hit[0] not in axes and hit[0] not in ("lon", "lat"):
                axes[hit[0]] = (dim, hit[1])
            elif variable.sizes[dim] == 1:
                single.append(dim)
            else:
                raise no_axis(self.catalogue, variable, dim)
        return axes, single

    def _factor(self, variable: Any) -> tuple[float | None, str]:
        """Into m/s, and the unit; None where the file gives none."""
        attrs = variable.attrs
        units = self.said.units or next(
            (str(attrs[k]) for k in ("units", "unit", "Unit", "Units") if k in attrs), ""
        )
        if not units.strip():
            inside = re.search(r"[(\[]([^()\[\]]+)[)\]]\s*$", str(attrs.get("long_name", "")))
            units = inside.group(1) if inside and in_metres_per_second(inside.group(1)) else ""
        if not units.strip():
            return None, "no unit"
        factor = in_metres_per_second(units)
        if factor is None:
            raise InputError(
                f"`{variable.name}` in {self.name} is in {units!r}, which is no speed that is known; "
                'name `units` in `names`, such as "m/s" or "cm/s"'
            )
        return factor, units.strip()

    def _way(self, name: str, variable: Any) -> str:
        """Whether a component runs toward east or north, along the grid, or does not say."""
        if self.said.rotate is not None:
            return "east" if self.said.rotate == "none" else "grid"
        standard, words = standard_name(variable), str(variable.attrs.get("long_name", "")).lower()
        if ALONG_GRID.search(standard) or ALONG_GRID.search(name.lower()):
            return "grid"
        if TOWARD_EAST.search(standard) or TOWARD_EAST.search(name.lower()):
            return "east"
        if ALONG_WORDS.search(words):
            return "grid"
        return "east" if TOWARD_EAST.search(words.replace("_", " ")) else "unsure"

    def _part(
        self, component: str, name: str, how: str, domain: Domain | None, room: float, whole_depth: bool
    ) -> Part:
        variable = self.data[name]
        horizontal, lon, lat = horizontal_of(self.catalogue, variable, component)
        axes, single = self._others(variable, horizontal)
        factor, units = self._factor(variable)
        took = {component: f"{name} ({how}, {units})", "lon": str(lon.name), "lat": str(lat.name)}
        notes = tuple(f"the dimension `{dim}` of one element is left out" for dim in single)

        none: Bools | None = None
        lon_turned = lat_turned = False
        if lon.ndim == 1:
            at_lon, lon_turned = degrees(self.name, lon, "lon")
            at_lat, lat_turned = degrees(self.name, lat, "lat")
            require(
                min(at_lon.size, at_lat.size) > 1,
                f"`{name}` in {self.name} has no longitude and latitude axis of two points or more: "
                "a current at one position is no grid to plan on",
            )
            self._check_nominal(lon, lat, at_lat)
            grid: Grid = grid_of(at_lon, at_lat)
        else:
            own_lon, own_lat, none = places(self.name, lon, lat)
            require(
                min(own_lon.shape) > 1,
                f"`{name}` in {self.name} has no longitude and latitude of two points or more: "
                "a current at one position is no grid to plan on",
            )
            grid = grid_of(own_lon, own_lat)
            if none.any():
                notes += (f"{int(none.sum())} points of `{lon.name}` have no place of their own: taken as land",)
        depth, depth_turned, when, sigma = None, False, None, None
        if "sigma" in axes:
            sigma = sigma_levels(self.name, self.data, variable, axes["sigma"][0])
            took["depth"] = sigma.words
        vertical = axes["depth"][1] if "depth" in axes else None
        if vertical is None and sigma is None:
            vertical = self.catalogue.scalar(variable, "depth")
        if vertical is not None:
            depth, depth_turned, took["depth"] = depths(self.name, self.data[vertical], self.said)
        clock = axes["time"][1] if "time" in axes else self.catalogue.scalar(variable, "time")
        if clock is not None:
            took["time"] = clock
            when, more = times(self.name, self.data, clock)
            notes += more

        ny, nx = grid.shape
        rows, columns = slice(0, ny), np.arange(nx)
        if domain is not None:
            middle = float(wrapped((domain[0][0] + (domain[0][1] - domain[0][0]) % 360 / 2), 0.0))
            cut = grid.cut(self.name, domain[0], domain[1], middle, MARGIN + HALO + 1)
            rows, columns, grid = cut.rows, cut.columns, cut.grid
        own_depths = depth
        floor = None
        if sigma is not None:
            turns = np.s_[..., :: -1 if lat_turned else 1, :: -1 if lon_turned else 1]
            floor = self._over(sigma.depth, variable, horizontal)[turns][rows][:, columns]
            # of the whole grid, so that both components get the same
            own_depths = fixed_depths(sigma, np.asarray(sigma.depth.values, np.float64))
        levels = slice(0, 1 if own_depths is None else own_depths.size)
        if domain is not None and not whole_depth:
            cut_levels = levels_for(self.name, own_depths, domain[2])
            levels = slice(cut_levels.start, min(cut_levels.stop, levels.stop))
        sizes = (
            1 if when is None else when.size,
            levels.stop - levels.start,
            rows.stop - rows.start,
            columns.size,
        )
        # as the planner holds it, in float64; the other component takes as much again
        need = 8.0 * math.prod(sizes)
        require(
            need <= room if component == "v" else 2 * need <= room,
            f"the currents of {self.name} would take {2 * need / 1e9:.1f} GB "
            f"({' x '.join(map(str, sizes))} points), more than the rest of the limit, {room / 1e9:.1f} GB: "
            "cut the file or narrow the domain",
        )

        picked: dict[str, Any] = dict.fromkeys(single, 0)
        picked[horizontal[1]] = _along(columns, variable.sizes[horizontal[1]], lon_turned)
        picked[horizontal[0]] = _along(np.arange(ny)[rows], ny, lat_turned)
        order = list(horizontal)
        if sigma is not None:
            order.insert(0, axes["sigma"][0])
        elif "depth" in axes:
            assert depth is not None
            picked[axes["depth"][0]] = _along(np.arange(depth.size)[levels], depth.size, depth_turned)
            order.insert(0, axes["depth"][0])
        if "time" in axes:
            order.insert(0, axes["time"][0])
        raw = np.asarray(variable.isel(picked).transpose(*order).values, dtype=np.float32)
        values = raw.reshape(sizes[0], -1, *sizes[2:])
        if none is not None:
            values = np.where(none[rows][:, columns], np.float32(np.nan), values)
        values = self._masked(values, variable, component, picked, order)
        if sigma is not None:
            assert floor is not None
            assert own_depths is not None
            zeta = None if sigma.surface is None else self._over(sigma.surface, variable, horizontal)[turns]
            wanted, fixed = own_depths[levels], []
            for n, layer in enumerate(values):
                top: Array | float = 0.0
                if zeta is not None:
                    top = np.nan_to_num(
                        (zeta[min(n, len(zeta) - 1)] if zeta.ndim == 3 else zeta)[rows][:, columns]
                    )
                    top = np.where(np.abs(top) < 100.0, top, 0.0)
                fixed.append(to_fixed(layer, sigma.heights(floor, top), floor, wanted))
            values = np.stack(fixed)
        own_depths = None if own_depths is None else own_depths[levels]
        if when is not None and when.size > 1:
            rank = np.argsort(when, kind="stable")
            if (np.diff(rank) != 1).any():
                when, values = when[rank], values[rank]
        values, more = clear_marks(self.name, name, values, factor)
        notes += more
        if factor is None:
            fastest = float(np.nanmax(np.abs(values), initial=0.0, where=np.isfinite(values)))
            require(
                name.lower() in IN_METRES and fastest < CALM,
                f"`{name}` in {self.name} has no unit (its largest value is {fastest:.3g}): "
                'name `units` in `names`, such as "m/s" or "cm/s"',
            )
            notes += (f"`{name}` has no unit: taken as m/s, as its makers write it; at most {fastest:.2f}",)
        fields = dict(self._fields(variable, horizontal))
        if sigma is not None and floor is not None:
            lons, lats = grid.mesh()
            fields["seabed"] = Field(str(sigma.depth.name), lons.ravel(), lats.ravel(), floor.ravel())
        return Part(
            component,
            name,
            grid,
            own_depths,
            when,
            values,
            took,
            notes,
            self._way(name, variable),
            signs_of(self.catalogue, variable),
            "" if vertical is None else vertical,
            fields,
        )

    def _check_nominal(self, lon: Any, lat: Any, axis: Array) -> None:
        """A tripolar model's axes name places only up to where its grid bends."""
        nominal = any("nominal" in str(one.attrs.get("long_name", "")).lower() for one in (lon, lat))
        require(
            not nominal or axis[-1] <= POLAR,
            f"the axes `{lon.name}` and `{lat.name}` of {self.name} are nominal, and no places beyond {POLAR:g} "
            "degrees north: add the file of the model's grid with two-dimensional longitudes, or cut the file",
        )

    def _over(self, one: Any, variable: Any, horizontal: tuple[str, str]) -> Array:
        """A field of the grid file at the points of a component: its own, or midway between two."""
        extra = list(map(str, one.dims[:-2]))
        ny, nx = (variable.sizes[dim] for dim in horizontal)
        if set(horizontal) <= set(map(str, one.dims)):
            extra = [dim for dim in map(str, one.dims) if dim not in horizontal]
            values = np.asarray(one.transpose(*extra, *horizontal).values, np.float64)
        else:
            values = np.asarray(one.values, np.float64)
        require(
            len(extra) <= 1 and values.size < 5e7,
            f"`{one.name}` in {self.name} has dimensions {', '.join(map(str, one.dims))}, too many",
        )
        values = np.where(np.abs(values) < 2e4, values, np.nan)
        shape = values.shape[-2:]
        if shape == (ny, nx + 1):
            return halves(values, -1)
        if shape == (ny + 1, nx):
            return halves(values, -2)
        require(
            shape == (ny, nx),
            f"`{one.name}` in {self.name} has {shape[0]} x {shape[1]} points, `{variable.name}` {ny} x {nx}: "
            "they do not fit",
        )
        return values

    def _masked(
        self, values: Values, variable: Any, component: str, picked: dict[str, Any], order: list[str]
    ) -> Values:
        """NaN where a mask on the component's own points says land."""
        mask = mask_of(self.name, self.data, self.said, variable, component)
        if mask is None:
            return values
        one, land = mask
        own = [dim for dim in order if dim in one.dims]
        here = np.asarray(
            one.isel({dim: at for dim, at in picked.items() if dim in one.dims}).transpose(*own).values,
            np.float64,
        )
        shape = [1 if dim not in own else values.shape[n - len(order)] for n, dim in enumerate(order)]
        dry = (
            here.reshape(shape if len(shape) == 4 else [1] * (4 - len(shape)) + shape) == land
            if land is not None
            else None
        )
        if dry is None:
            raise self._unsure_mask(one)
        return np.where(dry, np.float32(np.nan), values)

    def _unsure_mask(self, one: Any) -> InputError:
        return InputError(
            f"the mask `{one.name}` in {self.name} does not say whether land is 0 or 1: name `land` in `names`, "
            'or `mask` = "none" to leave it out'
        )

    def _fields(self, variable: Any, horizontal: tuple[str, str]) -> Iterator[tuple[str, Field]]:
        """What the file says of the grid at places of its own."""
        said = self.said.rotate
        if said in ("none", "grid"):
            return
        require(
            said is None or said in self.data.variables,
            f'{self.name} holds no variable `{said}` to rotate by; name one of it, "grid" or "none"',
        )
        names = list(map(str, self.data.variables)) if said is None else [said]
        for name in names:
            one = self.data[name].squeeze()
            known = ANGLES.match(name) or standard_name(one) == "angle_of_rotation_from_east_to_x"
            if one.ndim != 2 or not (name == said or known):
                continue
            at = self._places_of(one)
            if at is None:
                continue
            angle = np.asarray(one.values, np.float64).ravel()
            angle = np.where(np.isfinite(angle) & (np.abs(angle) < 1e4), angle, np.nan)
            units = str(one.attrs.get("units", "")).lower()
            if units.startswith("degree") or (
                not units and float(np.nanmax(np.abs(angle), initial=0)) > 2 * np.pi
            ):
                angle = np.radians(angle)
            yield "angle", Field(name, *at, np.nan_to_num(angle))
            return

    def _places_of(self, one: Any) -> tuple[Array, Array] | None:
        """Longitude and latitude of each point of a field of two dimensions, as it lies in memory."""
        try:
            at = self.catalogue.places(one, "u")
        except InputError:
            return None
        if at is None:
            hits = [self.catalogue.axis_of(one, dim) for dim in map(str, one.dims)]
            kinds = [hit[0] if hit else None for hit in hits]
            if sorted(map(str, kinds)) != ["lat", "lon"]:
                return None
            axes = {hit[0]: np.asarray(self.data[hit[1]].values, np.float64) for hit in hits if hit}
            lat, lon = np.meshgrid(axes["lat"], axes["lon"], indexing="ij")
            if kinds[0] == "lon":
                lat, lon = lat.T, lon.T
            return lon.ravel(), lat.ravel()
        lon, lat = (self.data[name].squeeze().transpose(*one.dims) for name in at)
        return tuple(part.ravel() for part in places(self.name, lon, lat)[:2])  # type: ignore[return-value]


def _along(which: NDArray[np.intp], size: int, is_turned: bool) -> Any:
    """An index along a file's axis: a slice where it can be, which reads faster."""
    which = size - 1 - which if is_turned else which
    step = np.diff(which)
    if which.size > 1 and (step == 1).all():
        return slice(int(which[0]), int(which[-1]) + 1)
    return which
