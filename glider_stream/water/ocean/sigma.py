"""Terrain-following levels: the depth of each level, and values on levels of fixed depth."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Array
from ...base.errors import InputError
from ...base.settings import require
from .names import SIGMA, listing, standard_name

Values = NDArray[np.float32]
FINER = 2
"""There are this many levels of fixed depth for each terrain-following one, so that interpolation does not blur.
"""
SAME = 1e-6
STRETCHES = ("Cs_r", "Cs_rho"), ("Cs_w",)
"""Names of the stretching at the levels of u and v, and at the faces between them, where w lies."""
THIN = 0.1
"""A single level this near to the surface or the seabed, as a share of the depth, is the outermost layer."""


@dataclass(frozen=True)
class SigmaLevels:
    """Heights z(s) [m, upward] of levels over a seabed at depth h under a surface at zeta.

    The three forms of CF Appendix D; `stretch` is C and `at` is s, (levels,). ocean_s_coordinate_g1: S = hc s +
    (h - hc) C, z = S + zeta (1 + S / h). ocean_s_coordinate_g2: S = (hc s + h C) / (hc + h), z = zeta + (zeta +
    h) S. ocean_sigma_coordinate: z = zeta + s (zeta + h). `low`, `high`: s and C where the layers in the file
    begin and end; they are -1 and 0 for a whole column.
    """

    form: str
    dim: str
    at: Array
    stretch: Array
    critical: float
    depth: Any
    surface: Any | None
    description: str
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def whole(self) -> bool:
        """Whether the levels cover the whole column."""
        return self.low[0] == -1.0 and self.high[0] == 0.0

    def heights(self, h: Array, zeta: Array | float) -> Array:
        """Return the heights (levels, ny, nx) [m] of all levels over points of depth `h` (ny, nx)."""
        return self._heights(self.at, self.stretch, h, zeta)

    def ends(self, h: Array, zeta: Array | float) -> Array:
        """Return the heights (2, ny, nx) [m] between which there are data.

        They are half a layer beyond the outermost levels.
        """
        s, c = (np.array([low, high]) for low, high in zip(self.low, self.high, strict=True))
        found = self._heights(s, c, h, zeta)
        if self.low[0] == -1.0:
            found[0] = -np.inf
        if self.high[0] == 0.0:
            # at low water, too, the first level is at the surface
            found[1] = np.inf
        return found

    def _heights(self, at: Array, stretch: Array, h: Array, zeta: Array | float) -> Array:
        s, c = at[:, None, None], stretch[:, None, None]
        if self.form == "sigma":
            return np.asarray(zeta + s * (zeta + h))
        if self.form == "g1":
            S = self.critical * s + (h - self.critical) * c
            return np.asarray(S + zeta * (1 + S / h))
        S = (self.critical * s + h * c) / (self.critical + h)
        return np.asarray(zeta + (zeta + h) * S)


def _coordinate(data: Any, dim: str, variable: Any) -> Any | None:
    """Return s along the levels: by standard name, under the dimension's name, or in CROCO's form."""
    for name in map(str, data.variables):
        if data[name].dims == (dim,) and SIGMA.match(standard_name(data[name])):
            return data[name]
    return data[dim] if dim in data.variables else _among_attributes(data, dim, variable, "sc_r", "sc_w")


def sigma_levels(name: str, data: Any, variable: Any, dim: str) -> SigmaLevels:
    """Return the terrain-following levels of a variable; InputError names what is missing."""
    coordinate = _coordinate(data, dim, variable)
    subject = f"`{variable.name}` in {name} is on terrain-following levels `{dim}`"
    if coordinate is None:
        raise InputError(f"{subject}, which have no values in this file; add the file that holds them")
    terms = dict(re.findall(r"(\w+)\s*:\s*(\S+)", str(coordinate.attrs.get("formula_terms", ""))))

    def term(key: str, *usual: str) -> Any | None:
        names = [terms[key]] if key in terms else []
        return next((data[n] for n in (*names, *usual) if n in data.variables), None)

    def number(key: str, *usual: str) -> float | None:
        variable_found = term(key, *usual)
        if variable_found is not None and variable_found.size == 1:
            return float(variable_found.values.ravel()[0])
        attribute = next((data.attrs[n] for n in usual if n in data.attrs), None)
        if isinstance(attribute, str):
            # CROCO writes a word
            return {"NEW": 2.0, "OLD": 1.0}.get(attribute.strip().upper())
        return None if attribute is None else float(np.ravel(attribute)[0])

    standard = standard_name(coordinate)
    h, zeta = term("depth", "h", "bathy", "depth"), term("eta", "zeta", "ssh", "zos")
    if h is None or h.ndim < 2:
        raise InputError(f"{subject}, but the file holds no depth of the seabed `h`; add the grid file that does")
    s = np.asarray(coordinate.values, np.float64)
    require(
        bool(((s >= -1 - SAME) & (s <= SAME)).all()),
        f"{subject}, whose values are not all from -1 to 0; mend the file",
    )
    description = f"{dim}: terrain-following levels over `{h.name}`"
    description += " under a level surface" if zeta is None else f" under `{zeta.name}`"
    if standard == "ocean_sigma_coordinate":
        low, high = _ends(name, variable, s, s)
        return SigmaLevels("sigma", dim, s, s, 0.0, h, zeta, _with_range(description, low, high), low, high)
    form = _form(subject, standard, number("", "Vtransform", "vtransform", "VertCoordType"))
    stretch, critical = term("C", *STRETCHES[dim == "s_w"]), number("depth_c", "hc", "Tcline")
    stretch = _among_attributes(data, dim, variable, "Cs_r", "Cs_w") if stretch is None else stretch
    lacks = [what for what, term_found in (("Cs_r", stretch), ("hc", critical)) if term_found is None]
    require(not lacks, f"{subject}, but the file holds no {listing(lacks)}; add the grid file that does")
    assert stretch is not None
    assert critical is not None
    c = np.asarray(stretch.values, np.float64)
    require(
        c.shape == s.shape,
        f"{subject}, but `{stretch.name}` has {c.size} values for {s.size} levels; mend the file",
    )
    low, high = _ends(name, variable, s, c)
    return SigmaLevels(form, dim, s, c, critical, h, zeta, _with_range(description, low, high), low, high)


def _form(subject: str, standard: str, transform: float | None) -> str:
    """Return "g1" or "g2", the form of s-levels, by their standard name or by the file's `Vtransform`."""
    if standard not in ("ocean_s_coordinate_g1", "ocean_s_coordinate_g2"):
        if standard and standard != "ocean_s_coordinate":
            raise InputError(
                f"{subject} of the form {standard!r}, which is not known: interpolate them to fixed depths first"
            )
        if transform not in (1.0, 2.0):
            raise InputError(
                f"{subject}, but the file has no `Vtransform` of 1 or 2; add the grid file that does"
            )
        standard = f"ocean_s_coordinate_g{int(transform)}"
    require(
        transform in (None, float(standard[-1])),
        f"{subject} of the form {standard!r}, but the file says `Vtransform` = {transform}: mend one of them",
    )
    return standard[-2:]


def _with_range(description: str, low: tuple[float, float], high: tuple[float, float]) -> str:
    kept = "" if (low[0], high[0]) == (-1.0, 0.0) else f", those from s = {low[0]:.3g} to {high[0]:.3g} only"
    return description + kept


def _among_attributes(data: Any, dim: str, variable: Any, *names: str) -> Any | None:
    """Return values along the levels that CROCO writes as an attribute of the file, or None."""
    import xarray

    for name in names:
        values = np.ravel(data.attrs.get(name, []))
        if values.size == variable.sizes[dim] and values.dtype.kind in "fi":
            return xarray.DataArray(values.astype(np.float64), dims=(dim,), name=name)
    return None


def _ends(name: str, variable: Any, s: Array, c: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return s and C where the outermost layers end.

    They end half a layer beyond their levels; a whole column ends at -1 and 0.
    """
    order = np.argsort(s)
    at, stretch = s[order], c[order]
    if at.size == 1:
        # its thickness is unknown unless it is the uppermost or the lowest layer of many
        half = min(-at[0], 1 + at[0])
        require(
            half <= THIN,
            f"`{variable.name}` in {name} has one terrain-following level, at s = {at[0]:.3g}, far from surface "
            "and seabed: "
            "the depths for which it holds are unknown; give a file with more levels",
        )
        return (
            ((-1.0, -1.0), (2 * half - 1, 2 * half - 1))
            if at[0] < -0.5
            else ((-2 * half, 2 * stretch[0]), (0.0, 0.0))
        )
    low = at[0] - (at[1] - at[0]) / 2, stretch[0] - (stretch[1] - stretch[0]) / 2
    high = at[-1] + (at[-1] - at[-2]) / 2, stretch[-1] + (stretch[-1] - stretch[-2]) / 2
    near = 0.25 * (at[1] - at[0]), 0.25 * (at[-1] - at[-2])
    return ((-1.0, -1.0) if low[0] <= -1 + near[0] else low, (0.0, 0.0) if high[0] >= -near[1] else high)


def fixed_depths(levels: SigmaLevels, h: Array) -> Array:
    """Return rising depths [m, downward] for the levels: theirs over the deepest points, made finer."""
    known = np.isfinite(h) & (h > 0)
    require(
        bool(known.any()),
        f"the depth of the seabed `{levels.depth.name}` is nowhere above 0; name another `bottom` in `names`",
    )
    parts = []
    for deep in np.unique(np.quantile(h[known], [0.02, 0.5, 1.0])):
        column = np.full((1, 1), deep)
        last, first = np.clip(-levels.ends(column, 0.0).ravel(), 0.0, deep)
        levels_here = np.clip(np.sort(-levels.heights(column, 0.0).ravel()), first, last)
        edges = np.concatenate([[first], levels_here, [last]])
        parts.append(np.interp(np.linspace(0, 1, FINER * edges.size), np.linspace(0, 1, edges.size), edges))
    every = np.unique(np.concatenate(parts))
    # levels closer than a hundredth of their depth, or 10 cm, are the same level
    kept = [every[0]]
    for depth in every[1:]:
        if depth - kept[-1] >= max(0.1, 0.01 * depth):
            kept.append(depth)
    kept[-1] = every[-1] if every[-1] > kept[-1] - 0.1 and len(kept) > 1 else kept[-1]
    return np.array(kept)


def to_fixed(values: Values, heights: Array, h: Array, depths: Array, ends: Array) -> Values:
    """Return values (nz, ny, nx) on fixed `depths` (nz) [m] from values (levels, ny, nx) at `heights` [m].

    They are linear between levels. Above the highest and below the lowest level they are held as far as `ends`
    (2, ny, nx) [m]. They are NaN beyond that and below the seabed at `h`.
    """
    order = (
        slice(None) if heights.shape[0] < 2 or np.nanmean(np.diff(heights, axis=0)) > 0 else slice(None, None, -1)
    )
    at, known = heights[order], values[order]
    count = at.shape[0]
    result = np.empty((depths.size, *h.shape), np.float32)
    for k, depth in enumerate(depths):
        z = -depth
        below = np.clip((at <= z).sum(axis=0) - 1, 0, max(count - 2, 0))[None]
        above = np.minimum(below + 1, count - 1)
        lower, upper = (np.take_along_axis(at, n, axis=0)[0] for n in (below, above))
        low, high = (np.take_along_axis(known, n, axis=0)[0] for n in (below, above))
        gap = upper - lower
        weight = np.clip((z - lower) / np.where(gap > 0, gap, 1.0), 0.0, 1.0)
        held = (depth <= h + SAME) & (z >= ends[0] - SAME) & (z <= ends[1] + SAME)
        result[k] = np.where(held, low * (1 - weight) + high * weight, np.nan)
    return result
