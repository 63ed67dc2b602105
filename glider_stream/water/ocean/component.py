"""Reads one component of the current from one open file, step by step."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array, Bools, Index
from ...base.checks import Range
from ...base.errors import InputError
from ...base.settings import require
from ..frame import wrapped
from .axes import degrees, places, told
from .clock import Clock, clock_of
from .doubts import doubts_of, speed_doubts
from .file import Times
from .flow import HALO, READ_BEYOND, levels_for
from .grid import Grid, grid_of
from .ground import model_depth, places_of
from .horizontal import halves, horizontal_of, no_axis, signs_of
from .land import Evidence, clear_marks, mask_of
from .levels import NO_LEVELS, Levels, check_hold, faces_of, levels_of
from .names import ALONG_GRID, ALONG_WORDS, IN_METRES, TOWARD_EAST, Catalogue, standard_name, units_of
from .part import Field, Part
from .quality import Order, bad_by_flags, spread_over
from .sigma import fixed_depths, to_fixed
from .units import in_metres_per_second
from .valid import outside_range

Values = NDArray[np.float32]
Domain = tuple[Range, Range, Range]

CALM = 5.0
"""A file without a unit is taken as m/s if no value is above this."""
ANGLES = re.compile(r"^(angle|anglet|ang|alpha|angle_dx|angle_rho|grid_angle|rotang)$", re.IGNORECASE)
ENSEMBLE = re.compile(
    r"^(n?ens|ensemble(_member)?|ens_member|members?|number|realization|realisation)$", re.IGNORECASE
)
"""Names of the dimension along which the members of an ensemble lie."""
POLAR = 65.0
"""North of this latitude [degrees] the nominal axes of a global model do not give positions."""


class TooLargeError(InputError):
    """Currents would take more memory than they may."""


@dataclass(frozen=True)
class Points:
    """The points of a component: `dims` across and along the rows, and the file's `rows` and `columns` in use.

    `placeless` (ny, nx): points that have no position in the file.
    """

    dims: tuple[str, str]
    grid: Grid
    rows: Index
    columns: Index
    placeless: Bools | None
    took: dict[str, str]
    notes: tuple[str, ...]

    def cut(self, name: str, domain: Domain | None) -> "Points":
        """Return the points that a domain needs, with a margin."""
        if domain is None:
            return self
        middle = float(wrapped((domain[0][0] + (domain[0][1] - domain[0][0]) % 360 / 2), 0.0))
        cut = self.grid.cut(name, domain[0], domain[1], middle, READ_BEYOND + HALO + 1)
        placeless = None if self.placeless is None else self.placeless[cut.rows][:, cut.columns]
        return replace(
            self, grid=cut.grid, rows=self.rows[cut.rows], columns=self.columns[cut.columns], placeless=placeless
        )

    def of(self, field: Array) -> Array:
        """Return the values at these points of a field (..., ny, nx) that covers the whole file."""
        return field[..., self.rows, :][..., self.columns]


class Component:
    """One component of the current in one open file; `how` tells by which rule its variable was found."""

    def __init__(self, at: Catalogue, component: str, name: str, how: str) -> None:
        self.at, self.names, self.file = at, at.names, at.name
        self.component, self.name, self.how = component, name, how
        self.variable = at.data[name]

    def part(self, domain: Domain | None, room: float, whole_depth: bool) -> Part:
        """Return the component in a domain; InputError if it needs more memory than `room` [bytes]."""
        sense = self.at.check_sense(self.component, self.name)
        every = self._points()
        clock, axes, single, notes = self._axes(every.dims)
        levels = levels_of(self.at, self.variable, axes)
        self._check_used(
            {"lon": every.took["lon"], "lat": every.took["lat"], "depth": levels.name, "time": clock.description}
        )
        factor, units = self._factor()
        points = every.cut(self.file, domain)
        floor = None
        terrain_following = levels.sigma
        if terrain_following is not None:
            levels = self._fixed(levels)
            floor = points.of(self._over(terrain_following.depth, every))
        read = self._wanted_levels(levels, domain, whole_depth)
        count = 1 if clock.times is None else clock.times.size
        self._check_room((count, read.stop - read.start, points.rows.size, points.columns.size), room)

        picked = dict.fromkeys(single, 0) | notes.picked | clock.picked
        values, more = self._block(points, levels, clock, picked, read, floor)
        deeper = self._deeper(points, levels, clock, picked, read)
        masked = self._mask_dims(levels)
        values, marks = clear_marks(self.file, self.name, values, factor)
        if deeper is not None:
            deeper = clear_marks(self.file, self.name, deeper, factor)[0]
        times, values = _in_order(clock.times, values)
        notes_of_all = (
            *sense,
            *every.notes,
            *notes.description,
            *clock.notes,
            *more,
            *marks,
            *self._doubts(values, factor),
        )
        took = {self.component: f"{self.name} ({self.how}, {units})", **every.took}
        took |= {"depth": levels.description} if levels.description else {}
        took |= {"time": clock.description} if clock.description else {}
        took |= {"stamps": clock.stamps}
        return Part(
            self.component,
            self.name,
            points.grid,
            levels.cut(read),
            times,
            values,
            deeper,
            took,
            tuple(dict.fromkeys(notes_of_all)),
            self._way(),
            signs_of(self.at, self.variable),
            dict(self._fields(points, levels, floor)),
            self._zeros(every, levels, clock, picked, values, masked, domain is None),
        )

    def _points(self) -> Points:
        """Return the points of the component in the whole file."""
        dims, lon, lat = horizontal_of(self.at, self.variable, self.component)
        took = {kind: told(one, kind) for kind, one in (("lon", lon), ("lat", lat))}
        many = "of two points or more: a plan needs a grid, and a current at one position is not a grid"
        if lon.ndim == 1:
            (at_lon, columns), (at_lat, rows) = degrees(self.file, lon, "lon"), degrees(self.file, lat, "lat")
            require(
                min(at_lon.size, at_lat.size) > 1,
                f"`{self.name}` in {self.file} has no longitude and latitude axis {many}",
            )
            self._check_nominal(lon, lat, at_lat)
            return Points(dims, grid_of(at_lon, at_lat), rows, columns, None, took, ())
        own_lon, own_lat, placeless = places(self.file, lon, lat)
        require(min(own_lon.shape) > 1, f"`{self.name}` in {self.file} has no longitude and latitude {many}")
        ny, nx = own_lon.shape
        notes: tuple[str, ...] = ()
        if placeless.any():
            notes = (f"{int(placeless.sum())} points of `{lon.name}` have no position: taken as land",)
        return Points(dims, grid_of(own_lon, own_lat), np.arange(ny), np.arange(nx), placeless, took, notes)

    def _axes(
        self, horizontal: tuple[str, str]
    ) -> "tuple[Clock, dict[str, tuple[str, str]], list[str], _Choice]":
        """Return the axes of the variable: times; depth, faces or sigma; left-out dimensions; chosen indices.

        Depth, faces and sigma are given by dimension and coordinate. Dimensions of one element are left out.
        """
        clock = clock_of(self.at, self.variable, self._time_axis(horizontal))
        axes: dict[str, tuple[str, str]] = {}
        single: list[str] = []
        choice = _Choice({}, ())
        for dim in map(str, self.variable.dims):
            if dim in (*horizontal, *clock.dims, *clock.picked):
                continue
            hit = self.at.axis_of(self.variable, dim)
            if hit is None and re.match(r"s_(rho|w)$|sigma$|siglay$", dim):
                hit = ("sigma", dim)
            if hit is None and (faces := faces_of(self.at, self.variable, dim)) is not None:
                hit = ("faces", faces)
            if hit is not None and hit[0] not in axes and hit[0] in ("depth", "faces", "sigma"):
                axes[hit[0]] = (dim, hit[1])
            elif self.variable.sizes[dim] == 1:
                single.append(dim)
            elif self._is_ensemble(dim):
                choice = self._chosen_member(dim)
            else:
                raise no_axis(self.at, self.variable, dim)
        if self.names.member is not None and not choice.picked:
            choice = self._only_member(single)
        left_out = tuple(
            f"the dimension `{dim}` of one element is left out" for dim in single if dim not in choice.picked
        )
        return clock, axes, single, _Choice(choice.picked, (*left_out, *choice.description))

    def _time_axis(self, horizontal: tuple[str, str]) -> tuple[str, str] | None:
        for dim in map(str, self.variable.dims):
            if dim not in horizontal:
                hit = self.at.axis_of(self.variable, dim)
                if hit is not None and hit[0] == "time":
                    return dim, hit[1]
        return None

    def _is_ensemble(self, dim: str) -> bool:
        return self._is_realization(dim) or ENSEMBLE.match(dim) is not None or self.names.member is not None

    def _only_member(self, single: list[str]) -> "_Choice":
        """Return the only member of a file, if the user names it; InputError if he names another."""
        dim = next((dim for dim in single if ENSEMBLE.match(dim) or self._is_realization(dim)), None)
        if dim is not None:
            return self._chosen_member(dim)
        label = next((name for name in map(str, self.at.data.variables) if self._labels_one(name)), None)
        held = None if label is None else str(self.at.data[label].values.ravel()[0])
        has = "no members" if held is None else f"member {held} alone"
        require(
            held is not None and held == str(self.names.member),
            f"{self.file} holds {has}, but `member` = {self.names.member!r}: leave `member` out, or name a file "
            "of members",
        )
        return _Choice({}, (f"member {held}, the only one of the file",))

    def _labels_one(self, name: str) -> bool:
        """Return whether a variable is the label of the one member of a file."""
        return self.at.data[name].size == 1 and (ENSEMBLE.match(name) is not None or self._is_realization(name))

    def _is_realization(self, name: str) -> bool:
        return name in self.at.data.variables and standard_name(self.at.data[name]) == "realization"

    def member_labels(self) -> list[str]:
        """Return the labels of the file's members, or an empty list."""
        for dim in map(str, self.variable.dims):
            if ENSEMBLE.match(dim) or self._is_realization(dim):
                return self._labels_of(dim)
        return []

    def _labels_of(self, dim: str) -> list[str]:
        """Return the labels of members along a dimension: of its coordinate, else their numbers."""
        if dim in self.at.data.variables:
            return [str(label) for label in self.at.data[dim].values.ravel()]
        return [str(n) for n in range(self.variable.sizes[dim])]

    def _chosen_member(self, dim: str) -> "_Choice":
        """Return the index of the ensemble member that the user names: by its label, or from 0 without labels."""
        size, wanted = self.variable.sizes[dim], self.names.member
        known = self._labels_of(dim)
        listed = f", {known[0]} to {known[-1]}"
        require(
            wanted is not None,
            f"`{self.name}` in {self.file} holds {size} members along `{dim}`{listed}: "
            f"set `member` in `names`, or `flow.member`, such as {known[0]}",
        )
        require(
            str(wanted) in known,
            f"{self.file} holds no member {wanted!r} along `{dim}`{listed}; name another `member`",
        )
        return _Choice({dim: known.index(str(wanted))}, (f"member {wanted} of {size} along `{dim}`, as you say",))

    def _check_used(self, found: dict[str, str]) -> None:
        """Raise InputError if the user names a coordinate that the component does not have."""
        for key, description in found.items():
            named = getattr(self.names, key)
            used = named is None or named in re.findall(r"[\w.\-]+", description)
            require(
                used or named not in self.at.data.variables,
                f"`{key}` = {named!r} is not a coordinate of `{self.name}` in {self.file}"
                + (f", which has {description.split(',')[0]!r}" if description else "")
                + f" ({', '.join(map(str, self.variable.dims))}); name another, or leave it out",
            )

    def _factor(self) -> tuple[float | None, str]:
        """Return the factor to m/s (None if the file gives no unit) and the unit."""
        units = self.names.units or units_of(self.variable)
        if not units.strip():
            inside = re.search(r"[(\[]([^()\[\]]+)[)\]]\s*$", str(self.variable.attrs.get("long_name", "")))
            units = inside.group(1) if inside and in_metres_per_second(inside.group(1)) else ""
        if not units.strip():
            return None, "no unit"
        factor = in_metres_per_second(units)
        if factor is None:
            raise InputError(
                f"`{self.name}` in {self.file} is in {units!r}, which is not a known unit of speed; "
                'set `units` in `names`, such as "m/s" or "cm/s"'
            )
        return factor, units.strip()

    def _way(self) -> str:
        """Return the direction of a component: "east" (or north), "grid" (along the rows), or "unsure"."""
        if self.names.rotate is not None:
            return "east" if self.names.rotate == "none" else "grid"
        name = self.name.lower()
        standard, long_name = standard_name(self.variable), str(self.variable.attrs.get("long_name", "")).lower()
        if ALONG_GRID.search(standard) or ALONG_GRID.search(name):
            return "grid"
        if TOWARD_EAST.search(standard) or TOWARD_EAST.search(name):
            return "east"
        if ALONG_WORDS.search(long_name):
            return "grid"
        return "east" if TOWARD_EAST.search(long_name.replace("_", " ")) else "unsure"

    def _fixed(self, levels: Levels) -> Levels:
        """Return levels of fixed depth for terrain-following levels.

        They depend on the whole grid, so that u and v get the same.
        """
        assert levels.sigma is not None
        depth = fixed_depths(levels.sigma, np.asarray(levels.sigma.depth.values, np.float64))
        top = 0.0 if levels.sigma.high[0] == 0.0 else float(depth[0])
        description = levels.description
        if not levels.sigma.whole:
            description += f": data at {depth[0]:.4g} to {depth[-1]:.4g} m"
        order, extent = np.arange(depth.size), f"{top:.4g} to {depth[-1]:.6g} m"
        return replace(
            levels, depth=depth, lower=depth, top=top, order=order, description=description, extent=extent
        )

    def _wanted_levels(self, levels: Levels, domain: Domain | None, whole_depth: bool) -> slice:
        """Return the levels that a domain needs, beginning with the uppermost, which shows the land."""
        if (
            domain is None
            or whole_depth
            or levels.depth is None
            or check_hold(self.file, self.names.hold, levels)
        ):
            return slice(0, levels.count)
        return slice(0, min(levels_for(self.file, levels.depth, domain[2], levels.top).stop, levels.count))

    def _check_room(self, sizes: tuple[int, int, int, int], room: float) -> None:
        # the planner holds float64; the other component takes the same room
        need = 8.0 * math.prod(sizes)
        if (2 * need if self.component == "u" else need) > room:
            raise TooLargeError(
                f"the currents of {self.file} would take {2 * need / 1e9:.1f} GB "
                f"({' x '.join(map(str, sizes))} points), more than the rest of the limit, {room / 1e9:.1f} GB: "
                "cut the file or narrow the domain"
            )

    def _block(
        self,
        points: Points,
        levels: Levels,
        clock: Clock,
        picked: dict[str, int],
        which: slice,
        floor: Array | None,
    ) -> tuple[Values, tuple[str, ...]]:
        """Return values (nt, nz, ny, nx), NaN where the file declares no data, and notes."""
        place, order = self._selection(points, levels, clock, picked, which)
        raw = np.asarray(self.variable.isel(place).transpose(*filter(None, order)).values, dtype=np.float32)
        nt = raw.shape[0] if clock.dims else 1
        values = raw.reshape(nt, -1, points.rows.size, points.columns.size)
        if points.placeless is not None:
            values = np.where(points.placeless, np.float32(np.nan), values)
        values = self._masked(values, place, order)
        values, beyond = outside_range(self.variable, values, self._factor()[0] or 1.0)
        values, notes = bad_by_flags(self.at, self.variable, values, place, order)
        notes = (*beyond, *notes)
        if levels.sigma is None or floor is None:
            return values, notes
        assert levels.depth is not None
        sigma, fixed = levels.sigma, []
        zeta = None if sigma.surface is None else points.of(self._over(sigma.surface, points))
        for n, layer in enumerate(values):
            top: Array | float = 0.0
            if zeta is not None:
                top = np.nan_to_num(zeta[min(n, len(zeta) - 1)] if zeta.ndim == 3 else zeta)
                top = np.where(np.abs(top) < 100.0, top, 0.0)
            ends = sigma.ends(floor, top)
            fixed.append(to_fixed(layer, sigma.heights(floor, top), floor, levels.depth[which], ends))
        return np.stack(fixed), notes

    def _selection(
        self, points: Points, levels: Levels, clock: Clock, picked: dict[str, int], which: slice
    ) -> tuple[dict[str, Any], Order]:
        """Return the indices to read and the dimensions of time, depth (None without one), rows and columns."""
        place: dict[str, Any] = dict(picked)
        place[points.dims[1]], place[points.dims[0]] = _slice(points.columns), _slice(points.rows)
        order: Order = (clock.dims[0] if clock.dims else None, levels.dim, *points.dims)
        if levels.dim is not None and levels.sigma is None:
            place[levels.dim] = _slice(levels.order[which])
        return place, order

    def _deeper(
        self, points: Points, levels: Levels, clock: Clock, picked: dict[str, int], read: slice
    ) -> Values | None:
        """Return the values below the levels that were read; they show how deep a column is.

        One time is enough. But where a column ends in zeros, all times are read: zeros are seabed only if they
        are zero at all times.
        """
        if levels.sigma is not None or levels.depth is None or read.stop >= levels.count:
            return None
        first = dict.fromkeys(clock.dims, 0)
        below, moment = slice(read.stop, levels.count), replace(clock, dims=())
        found, _ = self._block(points, levels, moment, {**picked, **first}, below, None)
        later = range(1, self.variable.sizes[clock.dims[0]]) if clock.dims and (found[:, -1] == 0).any() else ()
        for n in later:
            layer, _ = self._block(points, levels, moment, {**picked, clock.dims[0]: n}, below, None)
            found = np.where(np.abs(layer) > np.abs(found), layer, found)
        return found

    def _zeros(
        self,
        every: Points,
        levels: Levels,
        clock: Clock,
        picked: dict[str, int],
        values: Values,
        masked: int,
        is_whole: bool,
    ) -> Evidence:
        """Return how the zeros on the file's uppermost level look at the first time.

        The level is read only if there are zeros.
        """
        suspect = ((values == 0) | np.isnan(values)).all(axis=(0, 1)) & (values == 0).any(axis=(0, 1))
        top = values[:1, :1]
        if suspect.any() and not is_whole:
            once = {**picked, **({clock.dims[0]: 0} if clock.dims else {})}
            if levels.sigma is not None and levels.dim is not None:
                upper = int(np.argmax(levels.sigma.at))
                once, levels = {**once, levels.dim: upper}, replace(NO_LEVELS)
            top, _ = self._block(every, levels, replace(clock, dims=()), once, slice(0, 1), None)
        still = top[0, 0] == 0 if suspect.any() else np.zeros((1, 1), dtype=bool)
        count = levels.sigma.at.size if levels.sigma is not None else levels.count
        return Evidence(still, bool(np.isnan(top).any()), masked, count)

    def _mask_dims(self, levels: Levels) -> int:
        found = mask_of(self.file, self.at.data, self.names, self.variable, self.component)
        return 0 if found is None else 3 if levels.dim in found[0].dims else 2

    def _doubts(self, values: Values, factor: float | None) -> tuple[str, ...]:
        notes = doubts_of(self.variable)
        fastest = float(np.nanmax(np.abs(values), initial=0.0, where=np.isfinite(values)))
        if factor is None:
            require(
                self.name.lower() in IN_METRES and fastest < CALM,
                f"`{self.name}` in {self.file} has no unit (its largest value is {fastest:.3g}): "
                'set `units` in `names`, such as "m/s" or "cm/s"',
            )
            notes += (
                f"`{self.name}` has no unit: taken as m/s, the unit that its makers use; at most {fastest:.2f}",
            )
        # a vertical current is slower than any sea's horizontal one
        return notes if self.component == "w" else notes + speed_doubts(self.variable, fastest)

    def _check_nominal(self, lon: Any, lat: Any, axis: Array) -> None:
        """Raise InputError if a tripolar model's axes are used beyond the latitude where its grid bends."""
        nominal = any(
            "nominal" in str(axis_variable.attrs.get("long_name", "")).lower() for axis_variable in (lon, lat)
        )
        require(
            not nominal or axis[-1] <= POLAR,
            f"the axes `{lon.name}` and `{lat.name}` of {self.file} are nominal and do not give positions beyond "
            f"{POLAR:g} "
            "degrees north: add the file of the model's grid with two-dimensional longitudes, or cut the file",
        )

    def _over(self, field: Any, points: Points) -> Array:
        """Return a field of the grid file at the points of the component, or its mean between two points."""
        extra = list(map(str, field.dims[:-2]))
        ny, nx = (self.variable.sizes[dim] for dim in points.dims)
        if set(points.dims) <= set(map(str, field.dims)):
            extra = [dim for dim in map(str, field.dims) if dim not in points.dims]
            values = np.asarray(field.transpose(*extra, *points.dims).values, np.float64)
        else:
            values = np.asarray(field.values, np.float64)
        require(
            len(extra) <= 1 and values.size < 5e7,
            f"`{field.name}` in {self.file} has dimensions {', '.join(map(str, field.dims))}, which is more than "
            "rows, columns and one other; give a `bottom` in `names` without them",
        )
        values = np.where(np.abs(values) < 2e4, values, np.nan)
        shape = values.shape[-2:]
        if shape == (ny, nx + 1):
            return halves(values, -1)
        if shape == (ny + 1, nx):
            return halves(values, -2)
        require(
            shape == (ny, nx),
            f"`{field.name}` in {self.file} has {shape[0]} x {shape[1]} points, `{self.name}` {ny} x {nx}: "
            "they do not fit; give the grid file of the same model",
        )
        return values

    def _masked(self, values: Values, place: dict[str, Any], order: Order) -> Values:
        """Return the values with NaN where a mask on the component's points marks land."""
        mask = mask_of(self.file, self.at.data, self.names, self.variable, self.component)
        if mask is None:
            return values
        variable, land = mask
        here = variable.isel({dim: at for dim, at in place.items() if dim in variable.dims})
        dims = [dim for dim in order if dim is not None and dim in here.dims]
        if land is None:
            raise InputError(
                f"the mask `{variable.name}` in {self.file} does not say whether land is 0 or 1: set `land` in "
                '`names`, or `mask` = "none" to leave it out'
            )
        numbers = np.asarray(here.transpose(*dims).values, np.float64)
        return np.where(spread_over(numbers, dims, order) == land, np.float32(np.nan), values)

    def _fields(self, points: Points, levels: Levels, floor: Array | None) -> Iterator[tuple[str, Field]]:
        """Yield the fields of the grid that have their own positions: the seabed and the angle of the rows."""
        if floor is not None and levels.sigma is not None:
            lon, lat = points.grid.mesh()
            yield "seabed", Field(str(levels.sigma.depth.name), lon.ravel(), lat.ravel(), floor.ravel())
        else:
            depth = model_depth(self.at, points.grid, points.dims)
            if depth is not None:
                yield "seabed", depth
        angle = self._angle()
        if angle is not None:
            yield "angle", angle

    def _angle(self) -> Field | None:
        """Return the angle from east to the rows, if the file holds it."""
        rotate = self.names.rotate
        if rotate in ("none", "grid"):
            return None
        require(
            rotate is None or rotate in self.at.data.variables,
            f"{self.file} holds no variable `{rotate}` to rotate by; set `rotate` to one of its variables, "
            '"grid" or "none"',
        )
        for name in map(str, self.at.data.variables) if rotate is None else [rotate]:
            variable = self.at.data[name].squeeze()
            known = ANGLES.match(name) or standard_name(variable) == "angle_of_rotation_from_east_to_x"
            if variable.ndim != 2 or not (name == rotate or known):
                continue
            where = places_of(self.at, variable)
            if where is None:
                continue
            angle = np.asarray(variable.values, np.float64).ravel()
            angle = np.where(np.isfinite(angle) & (np.abs(angle) < 1e4), angle, np.nan)
            units = str(variable.attrs.get("units", "")).lower()
            wide = not units and float(np.nanmax(np.abs(angle), initial=0)) > 2 * np.pi
            angle = np.radians(angle) if units.startswith("degree") or wide else angle
            return Field(name, *where, np.nan_to_num(angle))
        return None


@dataclass(frozen=True)
class _Choice:
    """Indices along dimensions without an axis, and notes about them."""

    picked: dict[str, int]
    description: tuple[str, ...]


def _slice(which: Index) -> Any:
    """Return indices along a file's axis as a slice if possible, since a slice reads faster."""
    if which.size > 1 and bool((np.diff(which) == 1).all()):
        return slice(int(which[0]), int(which[-1]) + 1)
    return which


def _in_order(times: Times | None, values: Values) -> tuple[Times | None, Values]:
    if times is None or times.size < 2:
        return times, values
    rank = np.argsort(times, kind="stable")
    return (times, values) if bool((np.diff(rank) == 1).all()) else (times[rank], values[rank])
