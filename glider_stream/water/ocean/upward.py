"""Reads the vertical current of ocean files: one variable, at its own points and on its own levels."""

import re
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.checks import Range
from ...base.settings import require
from .component import Component
from .file import OceanFile
from .joining import stacked, stamped
from .names import Catalogue, Names, listing, standard_name, units_of
from .opening import opened
from .part import Part
from .reader import LIMIT, dated, with_fields_of

WAYS = {"upward": 1.0, "up": 1.0, "downward": -1.0, "down": -1.0}
"""What a vertical current counts, by words of its names and of its attribute `positive`."""
ACROSS_LEVELS = re.compile(r"\bs.coordinate vertical\b|\bomega\b|\bdiapycnal\b")
"""Words of a current through levels that are not level themselves: it is not the water's upward speed."""


@dataclass(frozen=True)
class Upward:
    """A file's vertical current: in place of both components of `file`; `way` is -1 where it counts downward."""

    file: OceanFile
    way: float
    told: str


def read_upward(
    files: Sequence[str | Path],
    names: Names,
    name: str,
    upward: bool | None,
    *,
    lon: Range,
    lat: Range,
    depth: Range,
    limit: float = LIMIT,
) -> Upward:
    """Return the vertical current `name` of a domain [degrees, m], at its own points.

    `upward`: whether it counts upward, where the file does not say so. InputError if no file holds it, if nobody
    says which way it counts, if it is a current through sloping levels, or if it has fewer than two levels.
    """
    paths = [Path(path) for path in files]
    held = {path: _variables(path, names) for path in paths}
    own = [path for path in paths if name in held[path]]
    every = [one for variables in held.values() for one in variables]
    require(
        bool(own),
        f"`flow.vertical` names a variable of the files, and none holds `{name}`; name another, or "
        f'"continuity"; they hold: {listing(dict.fromkeys(every))}',
    )
    parts: list[Part] = []
    with ExitStack() as stack:
        beside = [stack.enter_context(opened(path, names.group)) for path in paths if path not in own]
        for path in own:
            with opened(path, names.group) as data:
                whole = with_fields_of(data, beside)
                way, how = _way(path.name, whole[name], upward)
                at = Catalogue(path.name, whole, _own(names, whole, name))
                part = Component(at, "w", name, "as you say").part((lon, lat, depth), limit, True)
                parts.append(dated(part, parts, names))
    file = _one_file(own, stacked(own[0].name, parts), names)
    return Upward(file, way, "; ".join([f"`{name}` of {file.name} counts {how}", *file.notes]))


def _variables(path: Path, names: Names) -> list[str]:
    with opened(path, names.group) as data:
        return list(map(str, data.variables))


def _way(file: str, variable: Any, upward: bool | None) -> tuple[float, str]:
    """Return 1 if a vertical current counts upward, -1 if downward, and a text that says who says so."""
    text = f"{standard_name(variable)} {variable.attrs.get('long_name', '')}".lower().replace("_", " ")
    across = ACROSS_LEVELS.search(f"{text} {str(variable.name).lower()}")
    require(
        across is None,
        f"`{variable.name}` of {file} is a current through sloping levels, by its {across and across.group()!r}; "
        'name the upward current, or "continuity"',
    )
    if upward is not None:
        return (1.0, "upward, as you say") if upward else (-1.0, "downward, as you say")
    said = {word for word in ("upward", "downward") if re.search(rf"\b{word}\b", text)}
    said |= {str(variable.attrs.get("positive", "")).strip().lower()} & {"up", "down"}
    ways = {WAYS[word] for word in said}
    require(
        len(ways) < 2,
        f"`{variable.name}` of {file} contradicts itself: {' and '.join(sorted(said))}; set `flow.upward`",
    )
    require(bool(ways), f"`{variable.name}` of {file} does not say whether it counts upward; set `flow.upward`")
    way = ways.pop()
    return way, f"{'upward' if way > 0 else 'downward'} by its {' and '.join(sorted(said))}"


def _own(names: Names, data: Any, name: str) -> Names:
    """Return the settings that fit the vertical current too: those that name a coordinate of its dimensions."""
    dims = set(data[name].dims)

    def fits(key: str) -> bool:
        given = getattr(names, key)
        return given not in data.variables or set(data[given].dims) <= dims

    lost = {key: None for key in ("lon", "lat", "depth", "time", "mask", "quality") if not fits(key)}
    own_unit = units_of(data[name])
    return replace(
        names,
        **{"u": None, "v": None, "hold": None} | lost,
        units=None if own_unit else names.units,
        rotate="none",
        stagger="none",
        zeros="calm",
        bottom="none",
    )


def _one_file(paths: list[Path], part: Part, names: Names) -> OceanFile:
    """Return the vertical current in place of both components of a file."""
    name = paths[0].name if len(paths) == 1 else f"{paths[0].name} and {len(paths) - 1} more"
    levels = part.levels
    require(
        levels.depth is not None and levels.depth.size > 1,
        f"`flow.vertical` = {part.variable!r} needs two levels or more, and {name} has one; choose "
        '"continuity", or leave it out',
    )
    assert levels.depth is not None
    values = _to_the_seabed(part.values, levels.sigma is None)
    return OceanFile(
        name,
        part.grid,
        levels.depth,
        stamped(name, part.times, names),
        values,
        values,
        np.asarray(np.isfinite(values).all(axis=0)),
        False,
        part.took,
        part.notes,
        np.full(part.grid.shape, np.inf),
        levels.depth if levels.lower is None else levels.lower,
        levels.top,
    )


def _to_the_seabed(values: NDArray[np.float32], level: bool) -> NDArray[np.float32]:
    """Return w (nt, nz, ny, nx): NaN in columns that hold 0 alone, which are land, and 0 below the last value.

    Nothing crosses the seabed, and a model of level layers masks the face at the bottom of the last one.
    """
    still = (values == 0).all(axis=(0, 1))
    values = np.where(still & ~still.all(), np.float32(np.nan), values)
    if not level:
        return values
    known = np.isfinite(values)
    below = np.cumsum(known[:, ::-1], axis=1)[:, ::-1] == 0
    return np.where(below & known.any(axis=1, keepdims=True), np.float32(0.0), values)
