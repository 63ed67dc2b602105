"""The vertical axis of a component: levels of fixed depth, layers between faces, terrain-following levels."""

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.arrays import Array, Index
from ...base.errors import InputError
from ...base.settings import require
from .axes import depths
from .names import Catalogue
from .sigma import SigmaLevels, sigma_levels
from .units import in_metres

FACES = re.compile(
    r"^(w_dep|dep_w|z_w|z_w_bot|zw|depth_?w|depth_(edges|faces|bnds|interface)|st_edges_ocean|zi)$", re.I
)
"""Names of the depths between which the levels of a model lie."""
HELD_ABOVE = 20.0
"""A top level this near the surface [m] stands for the water above it, too; or half a level's spacing."""


@dataclass(frozen=True)
class Levels:
    """Depths [m, downward] of a component's levels, rising; None where the file names none.

    `lower` (nz): how deep the value of each holds, the level itself where values are points, the lower face
    where they are of layers. `top`: how shallow the first holds. `order`: the file's levels in this order.
    `every`: `lower` of all the file's levels; `extent`: from where to where they hold. `words` say what was
    taken for what, `bottom` what the deepest level with data says of the seabed.
    """

    depth: Array | None
    lower: Array | None
    top: float
    order: Index
    dim: str | None
    name: str
    sigma: SigmaLevels | None
    words: str
    bottom: str
    every: Array | None = None
    extent: str = ""

    @property
    def count(self) -> int:
        """Levels of the file."""
        return 1 if self.depth is None else self.depth.size

    def cut(self, which: slice) -> "Levels":
        """Some of the levels."""
        if self.depth is None or self.lower is None:
            return self
        return replace(self, depth=self.depth[which], lower=self.lower[which], every=self.lower)


NO_LEVELS = Levels(None, None, 0.0, np.zeros(1, np.int64), None, "", None, "", "")


def held_above(axis: Array) -> float:
    """The shallowest depth [m] for which the first of some levels holds."""
    spacing = float(axis[1] - axis[0]) if axis.size > 1 else 0.0
    reach = max(HELD_ABOVE, spacing / 2)
    return 0.0 if axis[0] <= reach else float(axis[0]) - spacing / 2


def levels_of(at: Catalogue, variable: Any, axes: dict[str, tuple[str, str]]) -> Levels:
    """The levels of a variable whose axes of "depth", "faces" or "sigma" are known by dimension and name."""
    if "sigma" in axes:
        sigma = sigma_levels(at.name, at.data, variable, axes["sigma"][0])
        dim = axes["sigma"][0]
        return replace(NO_LEVELS, dim=dim, name=dim, sigma=sigma, words=sigma.words)
    if "faces" in axes:
        return _between_faces(at, *axes["faces"])
    scalar = at.scalar(variable, "depth")
    if "depth" not in axes and scalar is None:
        return NO_LEVELS
    name = axes["depth"][1] if "depth" in axes else str(scalar)
    depth, order, factor, words = depths(at.name, at.data[name], at.said)
    lower, bottom = depth, f"the deepest level with data of each column (`{name}`, whose values are points)"
    bounds = _bounds(at, name, depth, factor, order)
    if bounds is not None:
        lower, bottom = bounds[0], f"the lower face of the deepest layer with data (`{bounds[1]}`)"
    along, top = axes["depth"][0] if "depth" in axes else None, held_above(depth)
    extent = f"{top:.4g} to {depth[-1]:.6g} m"
    return Levels(depth, lower, top, order, along, name, None, words, bottom, extent=extent)


def _between_faces(at: Catalogue, dim: str, name: str) -> Levels:
    faces, order, _, words = depths(at.name, at.data[name], at.said)
    middle = (faces[1:] + faces[:-1]) / 2
    turned = order[0] > order[-1]
    every = np.arange(middle.size)[:: -1 if turned else 1]
    bottom = f"the lower face of the deepest layer with data (`{name}`)"
    told, extent = f"midway between {words}", f"{faces[0]:.4g} to {faces[-1]:.6g} m"
    return Levels(middle, faces[1:], float(faces[0]), every, dim, name, None, told, bottom, extent=extent)


def faces_of(at: Catalogue, variable: Any, dim: str) -> str | None:
    """The variable of the faces between the levels along a dimension, where their depths are not given."""
    for name in map(str, at.data.variables):
        one = at.data[name]
        known = FACES.match(name) or at.kind(name) == "depth"
        if one.ndim == 1 and one.size == variable.sizes[dim] + 1 and known and name not in variable.dims:
            return name
    return None


def _bounds(at: Catalogue, name: str, depth: Array, factor: float, order: Index) -> tuple[Array, str] | None:
    """How deep each layer reaches, by the bounds or edges that a coordinate names."""
    for key in ("bounds", "edges"):
        of = str(at.data[name].attrs.get(key, ""))
        if of not in at.data.variables:
            continue
        limits = np.abs(np.asarray(at.data[of].values, np.float64)) * (
            in_metres(str(at.data[of].attrs.get("units", ""))) or 1.0
        )
        if not at.data[of].attrs.get("units"):
            limits = limits * factor
        if limits.shape == (depth.size, 2):
            lower = limits.max(axis=1)[order]
        elif limits.shape == (depth.size + 1,):
            lower = np.sort(limits)[1:]
        else:
            continue
        if bool(np.isfinite(lower).all() and (lower >= depth - 1e-6).all() and (np.diff(lower) > 0).all()):
            return lower, of
    return None


def check_hold(name: str, said: str | None, levels: Levels) -> bool:
    """Whether the one level of a file is to be held at all depths, by the user's word."""
    if said is None:
        return False
    require(
        levels.count == 1 and levels.sigma is None,
        f"`hold` = {said!r} is for files of one level; {name} has {levels.count}: leave it out",
    )
    return True


def no_such_levels(name: str, axis: Array, depth: tuple[float, float], top: float) -> InputError | None:
    """Why levels do not hold the depths of a domain [m], if they do not."""
    if depth[1] > axis[-1] + 0.01:
        cure = '; name `hold` = "all" in `names` to hold its one level at all depths' if axis.size == 1 else ""
        return InputError(
            f"the domain reaches {depth[1]:g} m deep, but the deepest level of {name} is at {axis[-1]:g} m{cure}"
        )
    if depth[0] < top - 0.01:
        return InputError(
            f"the domain begins at {depth[0]:g} m, but the data of {name} begin at {top:g} m: begin it there"
        )
    return None
