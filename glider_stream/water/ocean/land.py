"""Land in current files: masks, fills that are not declared, and zeros."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.settings import require
from .names import Names, standard_name

Values = NDArray[np.float32]

NO_DATA = 1e3
"""No unit of a current makes such a number: a fill that the file does not declare."""
FASTEST = 9.0
"""No ocean current is as fast [m/s]: a fill, or another unit."""
SEA_IS_ONE = re.compile(
    r"^([tuv]mask(util)?|mask_(rho|u|v|t)|wet(_[cuvt])?|sea_binary_mask|sea_mask)$", re.IGNORECASE
)
LAND_IS_ONE = re.compile(r"^(land_binary_mask|land_mask|landmask)$", re.IGNORECASE)
EITHER = re.compile(r"^(mask|lsm|land_sea_mask|landsea|binary_mask)$", re.IGNORECASE)


def mask_of(name: str, data: Any, said: Names, variable: Any, component: str) -> tuple[Any, float | None] | None:
    """A mask on the points of a variable, and its value on land, None where nobody says; or no mask.

    A user's word first, then what the mask itself says, then where the current is not zero.
    """
    if said.mask == "none":
        return None
    if said.mask is not None:
        there = said.mask in data.variables
        require(there, f'{name} holds no mask `{said.mask}`; name one of it, or "none", in `names`')
    names = [said.mask] if said.mask else [str(n) for n in data.variables if _is_mask(str(n), data[n], component)]
    for one in (data[n] for n in names):
        extra = [dim for dim in one.dims if dim not in variable.dims]
        fits = len(one.dims) - len(extra) >= 2 and all(one.sizes[dim] == 1 for dim in extra)
        if fits:
            one = one.isel(dict.fromkeys(extra, 0))
            return one, float(said.land) if said.land is not None else _on_land(one, variable)
    return None


def _is_mask(name: str, variable: Any, component: str) -> bool:
    standard = standard_name(variable)
    if name.lower().endswith(("_u", "umask", "umaskutil")) and component != "u":
        return False
    if name.lower().endswith(("_v", "vmask", "vmaskutil")) and component != "v":
        return False
    known = any(kind.match(name) for kind in (SEA_IS_ONE, LAND_IS_ONE, EITHER))
    return variable.ndim >= 2 and (known or standard in ("sea_binary_mask", "land_binary_mask"))


def _on_land(mask: Any, variable: Any) -> float | None:
    standard, name = standard_name(mask), str(mask.name)
    if standard == "sea_binary_mask" or SEA_IS_ONE.match(name):
        return 0.0
    if standard == "land_binary_mask" or LAND_IS_ONE.match(name):
        return 1.0
    words = str(mask.attrs.get("flag_meanings", "")).lower().split()
    flags = np.ravel(mask.attrs.get("flag_values", []))
    if len(words) == len(flags) == 2 and sum("land" in word for word in words) == 1:
        return float(flags[next(n for n, word in enumerate(words) if "land" in word)])
    first = {dim: 0 for dim in variable.dims if dim not in mask.dims}
    speed = np.abs(np.nan_to_num(np.asarray(variable.isel(first).transpose(*mask.dims).values, np.float64)))
    here = np.asarray(mask.values, np.float64)
    moves = [(speed[here == value] > 0).any() for value in (0.0, 1.0)]
    if moves[0] == moves[1]:
        return None
    return 0.0 if moves[1] else 1.0


def clear_marks(file: str, name: str, values: Values, factor: float | None) -> tuple[Values, tuple[str, ...]]:
    """In m/s, NaN where there is no data; what was found."""
    values = np.where(np.abs(values) > NO_DATA, np.float32(np.nan), values)
    values *= np.float32(factor or 1.0)
    beyond = np.abs(values) > FASTEST
    if not beyond.any():
        return values, ()
    marks = np.unique(values[beyond])
    require(
        marks.size == 1,
        f"`{name}` in {file} {'has no unit and ' if factor is None else ''}reaches "
        f"{float(np.abs(marks).max()):.4g} m/s, which no ocean current does: "
        'name its unit in `names`, such as `units` = "cm/s"',
    )
    values[beyond] = np.nan
    return values, (f"`{name}` = {marks[0] / (factor or 1.0):g} is taken as no data",)


def mark_land(u: Values, v: Values, fills: bool) -> list[str]:
    """NaN where land is written as zeros: still water at all times, in the whole column.

    A file without any fill writes its seabed so as well: then also still water down to the last level.
    """
    still, known = np.ones(u.shape[1:], dtype=bool), np.zeros(u.shape[1:], dtype=bool)
    for east, north in zip(u, v, strict=True):
        missing = np.isnan(east)
        still &= ((east == 0) & (north == 0)) | missing
        known |= ~missing
    land = still.all(axis=0) & known.any(axis=0)
    dry = np.broadcast_to(land, still.shape).copy()
    if not fills:
        dry |= np.cumprod(still[::-1], axis=0)[::-1].astype(bool)
    u[:, dry] = v[:, dry] = np.nan
    notes = []
    if land.any():
        notes.append(f"{int(land.sum())} columns with no current at any time or depth are taken as land")
    if (under := int((dry & ~land).sum())) > 0:
        notes.append(f"{under} points with no current at any time, down to the last level, are taken as seabed")
    return notes
