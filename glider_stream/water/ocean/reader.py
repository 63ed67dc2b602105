"""Ocean current files: right values, or one sentence that says what is missing and how to say it."""

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
from .names import Catalogue, Names, listing
from .opening import opened
from .part import Part

LIMIT = 2e9
"""The most that the currents of a domain may take in memory [bytes]: two float64 a point."""
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
        held: dict[str, Sequence[str]] = {}
        with_currents = []
        for path in paths if len(paths) > 1 or said.variables() else []:
            with opened(path, said.group) as data:
                held[path.name] = list(map(str, data.variables))
                if Catalogue(path.name, data, said).components():
                    with_currents.append(path)
        if held:
            _check_names(held, said)
        if len(paths) > 1:
            grids = [path for path in paths if path not in with_currents]
            beside = [stack.enter_context(opened(path, said.group)) for path in grids]
            paths = with_currents or paths[:1]
        for path in paths:
            with opened(path, said.group) as data:
                room = limit - sum(8.0 * part.values.size for part in parts)
                whole = _with(data, beside)
                found = _parts(Catalogue(path.name, whole, said), domain, room, depth is None)
                parts += [_dated(_grounded(part, beside, said), parts, said) for part in found]
    return joined(paths, parts, said)


def _check_names(held: dict[str, Sequence[str]], said: Names) -> None:
    """InputError where the user names a variable that none of the files holds."""
    every = [name for names in held.values() for name in names]
    for key, name in said.variables().items():
        require(
            name in every,
            f"{' and '.join(list(held)[:3])} {'holds' if len(held) == 1 else 'hold'} no variable `{name}`, which "
            f"`{key}` names; it holds: {listing(every)}",
        )


def _parts(at: Catalogue, domain: Domain | None, room: float, whole_depth: bool) -> list[Part]:
    """Both components, or the one that this file holds."""
    sort = str(at.data.attrs.get("featureType", "")).lower()
    require(
        sort not in NO_GRIDS,
        f"{at.name} is a {sort}: what was measured along a track or at a mooring is no grid to plan on",
    )
    found = at.components()
    if not found:
        raise at.refuse()
    result: list[Part] = []
    for component, (variable, how) in found.items():
        result.append(Component(at, component, variable, how).part(domain, room, whole_depth))
        room -= 8.0 * result[-1].values.size
    return result


def _grounded(part: Part, beside: list[Any], said: Names) -> Part:
    """A part, with the model's depth out of a file beside it where its own file has none."""
    if "seabed" in part.fields:
        return part
    for other in beside:
        found = model_depth(Catalogue("the file beside it", other, said), part.grid, None)
        if found is not None and found.lon.size:
            return replace(part, fields={**part.fields, "seabed": found})
    return part


def _dated(part: Part, before: list[Part], said: Names) -> Part:
    """A part of one step without time, at the time that the user gives the files in their order."""
    if said.step is None:
        return part
    number = sum(one.component == part.component for one in before)
    require(
        part.times is None and len(part.values) == 1,
        "`step` is for files of one step each that do not say their time; at least one of these says it: leave "
        "it out",
    )
    first = parse_time(str(said.origin), "`origin`")
    after = np.timedelta64(round(number * said.step * 3_600_000), "ms")
    took = {**part.took, "time": f"{said.origin} and {said.step:g} h from file to file, as you say"}
    return replace(part, times=np.array([first + after]), took=took)


def _with(data: Any, beside: list[Any]) -> Any:
    """A dataset, and those variables of others that fit its dimensions: a model's grid in a file of its own."""
    for other in beside:
        fits = {
            name: variable
            for name, variable in other.variables.items()
            if name not in data.variables and all(_fits(data, other, d, n) for d, n in variable.sizes.items())
        }
        data = data.assign(fits)
    return data


def _fits(data: Any, other: Any, dim: str, size: int) -> bool:
    """Whether a dimension of another dataset is that of this one: as long, with the same coordinates."""
    if data.sizes.get(dim, size) != size:
        return False
    if dim not in data.variables or dim not in other.variables:
        return True
    one, two = data[dim].values, other[dim].values
    if one.dtype.kind not in "fiu" or two.dtype.kind not in "fiu":
        return True
    return bool(
        np.allclose(one, two, rtol=0, atol=1e-3 * max(float(np.abs(np.diff(one)).min(initial=1.0)), 1e-9))
    )
