"""Where the points of a component lie: its dimensions along and across the rows, and their places."""

import re
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.errors import InputError
from ...base.settings import require
from .names import WORDS, Catalogue, standard_name, units_of
from .units import in_metres


def horizontal_of(at: Catalogue, variable: Any, component: str) -> tuple[tuple[str, str], Any, Any]:
    """The dimensions across and along the rows, and longitude and latitude, of one dimension or two."""
    two = at.places(variable, component)
    if two is not None:
        lon, lat = (at.data[name].squeeze() for name in two)
        require(
            lon.dims == lat.dims or set(lon.dims) == set(lat.dims),
            f"`{two[0]}` and `{two[1]}` in {at.name} have other dimensions; name `lon` and `lat` in `names`",
        )
        rows = _rows_first(tuple(map(str, lon.dims)))
        return rows, lon.transpose(*rows), lat.transpose(*rows)
    hits = {dim: at.axis_of(variable, dim) for dim in map(str, variable.dims)}
    own = {hit[0]: (dim, hit[1]) for dim, hit in hits.items() if hit is not None and hit[0] in ("lon", "lat")}
    if len(own) == 2:
        return (own["lat"][0], own["lon"][0]), at.data[own["lon"][1]], at.data[own["lat"][1]]
    derived = _halfway(at, variable) or _projected(at, variable)
    if derived is not None:
        return derived
    _refuse_geometry(at, variable)
    for dim in map(str, variable.dims):
        if hits[dim] is None and variable.sizes[dim] > 1 and dim not in at.data.variables:
            raise no_axis(at, variable, dim)
    lacks = next(kind for kind in ("lon", "lat") if kind not in own)
    raise InputError(
        f"`{variable.name}` in {at.name} has no {WORDS[lacks]} axis of two points or more: "
        f"a current at one position is no grid to plan on; if it has one, name `{lacks}` in `names`"
    )


def _rows_first(dims: tuple[str, ...]) -> tuple[str, str]:
    """The dimension across the rows, then the one along them, by name where the file turns them round."""
    first, second = dims
    along = re.compile(r"^(x|i|ni|nx|nlon|lon|xi_\w+|x[a-z]?_?\w*|i_\w+)$", re.IGNORECASE)
    swapped = along.match(first) is not None and along.match(second) is None
    return (second, first) if swapped else (first, second)


def _halfway(at: Catalogue, variable: Any) -> tuple[tuple[str, str], Any, Any] | None:
    """Points between those whose places the file holds: ROMS' u and v without lon_u and lat_v."""
    if "lon_rho" not in at.data.variables or "lat_rho" not in at.data.variables:
        return None
    lon, lat = at.data["lon_rho"], at.data["lat_rho"]
    if lon.ndim != 2 or lat.shape != lon.shape or len(variable.dims) < 2:
        return None
    rows, cols = map(str, variable.dims[-2:])
    ny, nx = variable.sizes[rows], variable.sizes[cols]
    if (ny, nx) not in ((lon.shape[0], lon.shape[1] - 1), (lon.shape[0] - 1, lon.shape[1])):
        return None
    axis = 1 if nx < lon.shape[1] else 0
    x, y = (halves(np.asarray(part.values, np.float64), axis) for part in (lon, lat))
    import xarray

    made = [
        xarray.DataArray(part, dims=(rows, cols), name=name) for name, part in (("lon_rho", x), ("lat_rho", y))
    ]
    return (rows, cols), made[0], made[1]


def _projected(at: Catalogue, variable: Any) -> tuple[tuple[str, str], Any, Any] | None:
    """The places of a plane with x, y and a `grid_mapping`, by pyproj."""
    import xarray
    from pyproj import CRS, Transformer
    from pyproj.exceptions import ProjError

    mapping = str(variable.attrs.get("grid_mapping", variable.encoding.get("grid_mapping", "")))
    axes = [_plane_axis(at, variable, which) for which in "xy"]
    if mapping not in at.data.variables or None in axes:
        return None
    x, y = (at.data[axis] for axis in axes)
    try:
        crs = CRS.from_cf(dict(at.data[mapping].attrs))
        across = Transformer.from_crs(crs, CRS.from_epsg(4326), always_xy=True)
        flat = [one.values.astype(np.float64) * _plane_unit(at, one) for one in (x, y)]
        east, north = np.meshgrid(*flat)
        lon, lat = across.transform(east, north, errcheck=True)
    except (ProjError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"the grid mapping `{mapping}` in {at.name} is not understood: {error}") from None
    rows = (str(y.dims[0]), str(x.dims[0]))
    made = [xarray.DataArray(part, dims=rows, name=name) for name, part in ((axes[0], lon), (axes[1], lat))]
    return rows, made[0], made[1]


def _plane_unit(at: Catalogue, axis: Any) -> float:
    """Metres of the unit of a plane's x or y, such as "km" or "100 km"; 1 for degrees of a turned pole."""
    units = units_of(axis)
    if units.lower().startswith(("degree", "rad")):
        return 1.0
    match = re.fullmatch(r"([\d.]*)\s*([a-zA-Z]*)", units)
    factor = None if match is None else in_metres(match.group(2))
    if match is None or factor is None:
        raise InputError(
            f"`{axis.name}` in {at.name} is in {units!r}, which is no length that is known: add the file of "
            "two-dimensional longitudes, or convert it to metres"
        )
    return factor * float(match.group(1) or 1.0)


def _plane_axis(at: Catalogue, variable: Any, which: str) -> str | None:
    """The coordinate x or y of a plane along one of a variable's dimensions."""
    known = {f"projection_{which}_coordinate", {"x": "grid_longitude", "y": "grid_latitude"}[which]}
    for name in map(str, at.data.variables):
        one = at.data[name]
        if len(one.dims) != 1 or one.dims[0] not in variable.dims or one.size < 2:
            continue
        plain = name.lower() == which and str(one.attrs.get("units", "")) in ("m", "km", "meter", "meters")
        if standard_name(one) in known or plain or str(one.attrs.get("axis", "")).lower() == which:
            return name
    return None


def signs_of(at: Catalogue, variable: Any) -> tuple[int, int]:
    """-1 where the file counts a plane's x or y downward."""
    found = []
    for which in "xy":
        axis = _plane_axis(at, variable, which)
        values = np.zeros(2) if axis is None else np.asarray(at.data[axis].values, np.float64)
        found.append(-1 if values[-1] < values[0] else 1)
    return found[0], found[1]


def _refuse_geometry(at: Catalogue, variable: Any) -> None:
    """What is no grid at all."""
    held = {k: n for n in map(str, at.data.variables) if (k := at.kind(n)) in ("lon", "lat")}
    dims = [at.data[name].dims for name in held.values()]
    if len(dims) == 2 and dims[0] == dims[1] and len(dims[0]) == 1 and set(dims[0]) <= set(variable.dims):
        raise InputError(
            f"{at.name} has longitude and latitude along one dimension, `{dims[0][0]}`: a track or an "
            "unstructured mesh, and not a regular grid"
        )


def no_axis(at: Catalogue, variable: Any, dim: str) -> InputError:
    """Why a dimension cannot be read."""
    return InputError(
        f"the dimension `{dim}` ({variable.sizes[dim]}) of `{variable.name}` in {at.name} has "
        "no longitude, latitude, depth or time that can be told; name it in `names`"
    )


def halves(values: Array, axis: int) -> Array:
    """Midway between neighbours along an axis."""
    size = values.shape[axis]
    return np.asarray((np.take(values, range(size - 1), axis) + np.take(values, range(1, size), axis)) / 2)
