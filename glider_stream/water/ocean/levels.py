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
"""A top level this near to the surface [m] also stands for the water above it; so does one within half a spacing.
"""


@dataclass(frozen=True)
class Levels:
    """Depths [m, downward] of a component's levels, rising; None if the file gives no depths.

    `lower` (nz): the depth down to which each value holds; the level itself if values are points, the lower face
    if they are layers. `top`: the depth where the first level begins to hold. `order`: indices of the levels in
    the file. `every`: `lower` of all levels of the file. `extent`: a text on the depths for which they hold.
    `description`: how the levels were read. `bottom`: what the deepest level with data tells of the seabed.
    """

    depth: Array | None
    lower: Array | None
    top: float
    order: Index
    dim: str | None
    name: str
    sigma: SigmaLevels | None
    description: str
    bottom: str
    every: Array | None = None
    extent: str = ""

    @property
    def count(self) -> int:
        """The number of levels in the file."""
        return 1 if self.depth is None else self.depth.size

    def cut(self, which: slice) -> "Levels":
        """Return a part of the levels."""
        if self.depth is None or self.lower is None:
            return self
        return replace(self, depth=self.depth[which], lower=self.lower[which], every=self.lower)


NO_LEVELS = Levels(None, None, 0.0, np.zeros(1, np.int64), None, "", None, "", "")


def held_above(axis: Array) -> float:
    """Return the shallowest depth [m] for which the first level holds."""
    spacing = float(axis[1] - axis[0]) if axis.size > 1 else 0.0
    reach = max(HELD_ABOVE, spacing / 2)
    return 0.0 if axis[0] <= reach else float(axis[0]) - spacing / 2


def levels_of(at: Catalogue, variable: Any, axes: dict[str, tuple[str, str]]) -> Levels:
    """Return the levels of a variable; `axes` gives dimension and coordinate of "depth", "faces" or "sigma"."""
    if "sigma" in axes:
        sigma = sigma_levels(at.name, at.data, variable, axes["sigma"][0])
        dim = axes["sigma"][0]
        return replace(NO_LEVELS, dim=dim, name=dim, sigma=sigma, description=sigma.description)
    if "faces" in axes:
        return _between_faces(at, *axes["faces"])
    scalar = at.scalar(variable, "depth")
    if "depth" not in axes and scalar is None:
        return NO_LEVELS
    name = axes["depth"][1] if "depth" in axes else str(scalar)
    depth, order, factor, description = depths(at.name, at.data[name], at.names)
    lower, bottom = depth, f"the deepest level with data of each column (`{name}`, whose values are points)"
    bounds = _bounds(at, name, depth, factor, order)
    if bounds is not None:
        lower, bottom = bounds[0], f"the lower face of the deepest layer with data (`{bounds[1]}`)"
    along, top = axes["depth"][0] if "depth" in axes else None, held_above(depth)
    extent = f"{top:.4g} to {depth[-1]:.6g} m"
    return Levels(depth, lower, top, order, along, name, None, description, bottom, extent=extent)


def _between_faces(at: Catalogue, dim: str, name: str) -> Levels:
    faces, order, _, description = depths(at.name, at.data[name], at.names)
    middle = (faces[1:] + faces[:-1]) / 2
    turned = order[0] > order[-1]
    every = np.arange(middle.size)[:: -1 if turned else 1]
    bottom = f"the lower face of the deepest layer with data (`{name}`)"
    between, extent = f"midway between {description}", f"{faces[0]:.4g} to {faces[-1]:.6g} m"
    return Levels(middle, faces[1:], float(faces[0]), every, dim, name, None, between, bottom, extent=extent)


def faces_of(at: Catalogue, variable: Any, dim: str) -> str | None:
    """Return the name of the variable with the faces between the levels, or None."""
    for name in map(str, at.data.variables):
        candidate = at.data[name]
        known = FACES.match(name) or at.kind(name) == "depth"
        if (
            candidate.ndim == 1
            and candidate.size == variable.sizes[dim] + 1
            and known
            and name not in variable.dims
        ):
            return name
    return None


def _bounds(at: Catalogue, name: str, depth: Array, factor: float, order: Index) -> tuple[Array, str] | None:
    """Return the lower depth of each layer and the name of the bounds or edges it is from, or None."""
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


def check_hold(name: str, hold: str | None, levels: Levels) -> bool:
    """Return whether the user holds the file's level at all depths; InputError if it has several levels."""
    if hold is None:
        return False
    require(
        levels.count == 1 and levels.sigma is None,
        f"`hold` = {hold!r} is for files of one level; {name} has {levels.count}: leave it out",
    )
    return True


def no_such_levels(name: str, axis: Array, depth: tuple[float, float], top: float) -> InputError | None:
    """Return an error if the levels do not cover the depths of a domain [m], else None."""
    if depth[1] > axis[-1] + 0.01:
        cure = '; set `hold` = "all" in `names` to hold its one level at all depths' if axis.size == 1 else ""
        return InputError(
            f"the domain reaches {depth[1]:g} m deep, but the deepest level of {name} is at {axis[-1]:g} m{cure}"
        )
    if depth[0] < top - 0.01:
        return InputError(
            f"the domain begins at {depth[0]:g} m, but the data of {name} begin at {top:g} m: let the domain "
            "begin there"
        )
    return None
