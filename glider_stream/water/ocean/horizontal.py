"""The points of a component: its dimensions along and across the rows, and their positions."""

import re
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.errors import InputError
from ...base.settings import require
from .names import WORDS, Catalogue, standard_name, units_of
from .units import in_metres


def horizontal_of(at: Catalogue, variable: Any, component: str) -> tuple[tuple[str, str], Any, Any]:
    """Return the dimensions across and along the rows, and longitude and latitude with one or two dimensions."""
    two = at.places(variable, component)
    if two is not None:
        lon, lat = (at.data[name].squeeze() for name in two)
        require(
            lon.dims == lat.dims or set(lon.dims) == set(lat.dims),
            f"`{two[0]}` and `{two[1]}` in {at.name} have other dimensions; set `lon` and `lat` in `names`",
        )
        rows = _rows_first(tuple(map(str, lon.dims)))
        return rows, lon.transpose(*rows), lat.transpose(*rows)
    hits = {dim: at.axis_of(variable, dim) for dim in map(str, variable.dims)}
    axes = {hit[0]: (dim, hit[1]) for dim, hit in hits.items() if hit is not None and hit[0] in ("lon", "lat")}
    if len(axes) == 2:
        return (axes["lat"][0], axes["lon"][0]), at.data[axes["lon"][1]], at.data[axes["lat"][1]]
    derived = _halfway(at, variable) or _projected(at, variable)
    if derived is not None:
        return derived
    _refuse_geometry(at, variable)
    for dim in map(str, variable.dims):
        if hits[dim] is None and variable.sizes[dim] > 1 and dim not in at.data.variables:
            raise no_axis(at, variable, dim)
    lacks = next(kind for kind in ("lon", "lat") if kind not in axes)
    raise InputError(
        f"`{variable.name}` in {at.name} has no {WORDS[lacks]} axis of two points or more: "
        "a plan needs a grid, and a current at one position is not a grid; if it has such an axis, set "
        f"`{lacks}` in `names`"
    )


def _rows_first(dims: tuple[str, ...]) -> tuple[str, str]:
    """Return the dimension across the rows, then the one along them; their names decide the order."""
    first, second = dims
    along = re.compile(r"^(x|i|ni|nx|nlon|lon|xi_\w+|x[a-z]?_?\w*|i_\w+)$", re.IGNORECASE)
    swapped = along.match(first) is not None and along.match(second) is None
    return (second, first) if swapped else (first, second)


def _halfway(at: Catalogue, variable: Any) -> tuple[tuple[str, str], Any, Any] | None:
    """Return points midway between the file's positions: ROMS' u and v without lon_u and lat_v."""
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
    """Return the positions of a plane with x, y and a `grid_mapping`, computed by pyproj."""
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
        flat = [axis.values.astype(np.float64) * _plane_unit(at, axis) for axis in (x, y)]
        east, north = np.meshgrid(*flat)
        lon, lat = across.transform(east, north, errcheck=True)
    except (ProjError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the grid mapping `{mapping}` in {at.name} is not understood: {error}; add a file with "
            "two-dimensional longitudes"
        ) from None
    rows = (str(y.dims[0]), str(x.dims[0]))
    made = [xarray.DataArray(part, dims=rows, name=name) for name, part in ((axes[0], lon), (axes[1], lat))]
    return rows, made[0], made[1]


def _plane_unit(at: Catalogue, axis: Any) -> float:
    """Return the metres in the unit of a plane's x or y, such as "km"; 1 for degrees of a rotated pole."""
    units = units_of(axis)
    if units.lower().startswith(("degree", "rad")):
        return 1.0
    match = re.fullmatch(r"([\d.]*)\s*([a-zA-Z]*)", units)
    factor = None if match is None else in_metres(match.group(2))
    if match is None or factor is None:
        raise InputError(
            f"`{axis.name}` in {at.name} is in {units!r}, which is not a known unit of length: add a file of "
            "two-dimensional longitudes, or convert it to metres"
        )
    return factor * float(match.group(1) or 1.0)


def _plane_axis(at: Catalogue, variable: Any, which: str) -> str | None:
    """Return the coordinate x or y of a plane along one of a variable's dimensions."""
    known = {f"projection_{which}_coordinate", {"x": "grid_longitude", "y": "grid_latitude"}[which]}
    for name in map(str, at.data.variables):
        variable_here = at.data[name]
        if len(variable_here.dims) != 1 or variable_here.dims[0] not in variable.dims or variable_here.size < 2:
            continue
        plain = name.lower() == which and str(variable_here.attrs.get("units", "")) in (
            "m",
            "km",
            "meter",
            "meters",
        )
        if (
            standard_name(variable_here) in known
            or plain
            or str(variable_here.attrs.get("axis", "")).lower() == which
        ):
            return name
    return None


def signs_of(at: Catalogue, variable: Any) -> tuple[int, int]:
    """Return the signs of x and y of a plane: -1 where the file counts downward, else 1."""
    found = []
    for which in "xy":
        axis = _plane_axis(at, variable, which)
        values = np.zeros(2) if axis is None else np.asarray(at.data[axis].values, np.float64)
        found.append(-1 if values[-1] < values[0] else 1)
    return found[0], found[1]


def _refuse_geometry(at: Catalogue, variable: Any) -> None:
    """Raise InputError if the positions do not form a grid."""
    held = {k: n for n in map(str, at.data.variables) if (k := at.kind(n)) in ("lon", "lat")}
    dims = [at.data[name].dims for name in held.values()]
    if len(dims) == 2 and dims[0] == dims[1] and len(dims[0]) == 1 and set(dims[0]) <= set(variable.dims):
        raise InputError(
            f"{at.name} has longitude and latitude along one dimension, `{dims[0][0]}`: a track or an "
            "unstructured mesh, not a grid with rows and columns"
        )


def no_axis(at: Catalogue, variable: Any, dim: str) -> InputError:
    """Return the error for a dimension that cannot be read."""
    return InputError(
        f"the dimension `{dim}` ({variable.sizes[dim]}) of `{variable.name}` in {at.name} has "
        "no coordinate that is known as longitude, latitude, depth or time; name it in `names`"
    )


def halves(values: Array, axis: int) -> Array:
    """Return the means of neighbours along an axis."""
    size = values.shape[axis]
    return np.asarray((np.take(values, range(size - 1), axis) + np.take(values, range(1, size), axis)) / 2)
