"""Reads ocean current files. It returns right values, or one sentence with what is missing and the cure."""

import re
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.checks import Range
from ...base.settings import from_table, require
from .component import Component, Domain
from .file import OceanFile, parse_time
from .ground import model_depth
from .joining import joined
from .names import Catalogue, Names, listing, standard_name
from .opening import opened
from .part import Part

LIMIT = 2e9
"""The currents of a domain may take at most this much memory [bytes]; a point takes two float64."""
NO_GRIDS = {"trajectory", "timeseries", "profile", "trajectoryprofile", "timeseriesprofile", "point"}


def read_currents(
    files: str | Path | Sequence[str | Path],
    names: Names | Mapping[str, Any] | None = None,
    *,
    lon: Range | None = None,
    lat: Range | None = None,
    depth: Range | None = None,
    limit: float = LIMIT,
) -> OceanFile:
    """Return the currents of one file or several: components, stretches of time, or the model's grid.

    `names`: see `Names`. `lon`, `lat` [degrees] and `depth` [m]: only what a domain needs is read. InputError if
    the currents take more memory than `limit` [bytes].
    """
    paths = [Path(files)] if isinstance(files, (str, Path)) else [Path(path) for path in files]
    require(len(paths) > 0, "`flow.file` must name at least one current file; got none")
    given = names if isinstance(names, Names) else from_table(Names, names or {}, "names")
    domain = None if lon is None or lat is None else (lon, lat, depth or (0.0, 0.0))
    with_currents = _with_currents(paths, given)
    parts: list[Part] = []
    with ExitStack() as stack:
        beside: list[Any] = []
        if len(paths) > 1:
            grids = [path for path in paths if path not in with_currents]
            beside = [stack.enter_context(opened(path, given.group)) for path in grids]
            paths = with_currents or paths[:1]
        for path in paths:
            with opened(path, given.group) as data:
                room = limit - sum(8.0 * part.values.size for part in parts)
                whole = with_fields_of(data, beside)
                found = _parts(Catalogue(path.name, whole, given), domain, room, depth is None)
                parts += [dated(_grounded(part, beside, given), parts, given) for part in found]
    return joined(paths, parts, given)


VERTICAL_WORDS = re.compile(r"\b(upward|vertical).*(velocity|current|speed)|\bw.?(velocity|component)\b")
NO_WATER = re.compile(r"\bair\b|wind|\bice\b")
VERTICAL_NAMES = {"w", "wo", "vovecrtz", "wvel"}
"""How a vertical current is told: by its long name, unless it is of air or ice, or by its name."""


def _vertical_note(at: Catalogue) -> tuple[str, ...]:
    """Return a note on a vertical current that a file holds."""
    for name, variable in at.data.data_vars.items():
        standard, long = standard_name(variable), str(variable.attrs.get("long_name", "")).lower()
        named = str(name).lower() in VERTICAL_NAMES or standard == "upward_sea_water_velocity"
        if (
            variable.ndim >= 3
            and (named or VERTICAL_WORDS.search(long))
            and not NO_WATER.search(f"{standard} {long}")
        ):
            return (f"`{name}` may be a vertical current: it is read if `flow.vertical` names it",)
    return ()


def _with_currents(paths: list[Path], names: Names) -> list[Path]:
    """Return the files that hold currents, if there are several; InputError if no file holds a named variable."""
    held: dict[str, Sequence[str]] = {}
    found = []
    for path in paths if len(paths) > 1 or names.variables() else []:
        with opened(path, names.group) as data:
            held[path.name] = list(map(str, data.variables))
            if Catalogue(path.name, data, names).components():
                found.append(path)
    if held:
        _check_names(held, names)
    return found


def _check_names(held: dict[str, Sequence[str]], names: Names) -> None:
    """Raise InputError if the user names a variable that no file holds."""
    every = [name for variables in held.values() for name in variables]
    for key, name in names.variables().items():
        require(
            name in every,
            f"{' and '.join(list(held)[:3])} {'holds' if len(held) == 1 else 'hold'} no variable `{name}`, which "
            f"`{key}` names; it holds: {listing(every)}",
        )


def _parts(at: Catalogue, domain: Domain | None, room: float, whole_depth: bool) -> list[Part]:
    """Return both components, or the one that this file holds."""
    sort = str(at.data.attrs.get("featureType", "")).lower()
    require(
        sort not in NO_GRIDS,
        f"{at.name} is a {sort}: a plan needs a grid, and measurements along a track or at a mooring are not a "
        "grid",
    )
    found = at.components()
    if not found:
        raise at.refuse()
    result: list[Part] = []
    for component, (variable, how) in found.items():
        part = Component(at, component, variable, how).part(domain, room, whole_depth)
        result.append(replace(part, notes=(*part.notes, *_vertical_note(at))))
        room -= 8.0 * result[-1].values.size
    return result


def _grounded(part: Part, beside: list[Any], names: Names) -> Part:
    """Return the part; the model's depth is taken from a file beside it if its own file has none."""
    if "seabed" in part.fields:
        return part
    for other in beside:
        found = model_depth(Catalogue("the file beside it", other, names), part.grid, None)
        if found is not None and found.lon.size:
            return replace(part, fields={**part.fields, "seabed": found})
    return part


def dated(part: Part, before: list[Part], names: Names) -> Part:
    """Return the part with the time that the user gives: `origin`, plus `step` for each earlier file."""
    if names.step is None:
        return part
    number = sum(earlier.component == part.component for earlier in before)
    require(
        part.times is None and len(part.values) == 1,
        "`step` is for files of one step each that hold no time; at least one of these holds its time: leave "
        "it out",
    )
    first = parse_time(str(names.origin), "`origin`")
    after = np.timedelta64(round(number * names.step * 3_600_000), "ms")
    took = {**part.took, "time": f"{names.origin} and {names.step:g} h from file to file, as you say"}
    return replace(part, times=np.array([first + after]), took=took)


def with_fields_of(data: Any, beside: list[Any]) -> Any:
    """Return a dataset with the variables of other files that fit its dimensions, such as a model's grid."""
    for other in beside:
        fits = {
            name: variable
            for name, variable in other.variables.items()
            if name not in data.variables and all(_fits(data, other, d, n) for d, n in variable.sizes.items())
        }
        data = data.assign(fits)
    return data


def _fits(data: Any, other: Any, dim: str, size: int) -> bool:
    """Return whether a dimension of another dataset is the same: equally long, with the same coordinates."""
    if data.sizes.get(dim, size) != size:
        return False
    if dim not in data.variables or dim not in other.variables:
        return True
    values, others = data[dim].values, other[dim].values
    if values.dtype.kind not in "fiu" or others.dtype.kind not in "fiu":
        return True
    return bool(
        np.allclose(
            values, others, rtol=0, atol=1e-3 * max(float(np.abs(np.diff(values)).min(initial=1.0)), 1e-9)
        )
    )
