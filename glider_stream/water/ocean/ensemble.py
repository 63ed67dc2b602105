"""Reads all members of an ensemble: those of a file, or one from each of several files."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.checks import Range
from ...base.settings import from_table, require
from .component import Component
from .file import OceanFile
from .names import Catalogue, Names
from .opening import opened
from .reader import LIMIT, read_currents
from .stagger import same_points


def read_members(
    files: str | Path | Sequence[str | Path],
    names: Names | Mapping[str, Any] | None = None,
    *,
    lon: Range | None = None,
    lat: Range | None = None,
    depth: Range | None = None,
    limit: float = LIMIT,
) -> list[OceanFile]:
    """Return every member of an ensemble, each as `read_currents` gives it; together at most `limit` [bytes].

    If the files hold members along a dimension, these; several files are then joined in time. If they do not,
    each file is a member; all must have the same points and times.
    """
    paths = [Path(files)] if isinstance(files, (str, Path)) else [Path(path) for path in files]
    require(len(paths) > 0, "an ensemble needs at least one file; got none")
    given = names if isinstance(names, Names) else from_table(Names, names or {}, "names")
    require(given.member is None, f"all members are read: leave out `member` = {given.member!r}")
    labels = member_labels(paths, given)
    require(
        len(labels) > 0 or len(paths) > 1,
        f"{paths[0].name} holds no members: name a file that does, or one file for each member",
    )
    count = len(labels) or len(paths)
    area: dict[str, Any] = {"lon": lon, "lat": lat, "depth": depth, "limit": limit / count}
    if labels:
        return [read_currents(paths, replace(given, member=label), **area) for label in labels]
    members = [read_currents(path, given, **area) for path in paths]
    for path, member in zip(paths[1:], members[1:], strict=True):
        _check_alike(paths[0].name, members[0], path.name, member)
    return members


def member_labels(files: Sequence[str | Path], names: Names | None = None) -> list[str]:
    """Return the labels of the members along a dimension of some files; an empty list if they hold none."""
    return list(dict.fromkeys(label for file in files for label in _labels(Path(file), names or Names())))


def _labels(path: Path, names: Names) -> list[str]:
    with opened(path, names.group) as data:
        at = Catalogue(path.name, data, names)
        for component, (variable, how) in at.components().items():
            return Component(at, component, variable, how).member_labels()
    return []


def _check_alike(first: str, a: OceanFile, second: str, b: OceanFile) -> None:
    """Raise InputError unless two members have the same points and times."""
    times = a.times is b.times is None
    if a.times is not None and b.times is not None:
        times = np.array_equal(a.times, b.times)
    grid = a.u.shape == b.u.shape and same_points(a.grid.mesh(), b.grid.mesh()) and np.allclose(a.depth, b.depth)
    for what, same in (("times", times), ("points", grid)):
        require(
            bool(same), f"{first} and {second} have different {what}: members must have the same; cut them alike"
        )
