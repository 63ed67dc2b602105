"""Finds land in current files: masks, fill values that are not declared, and zeros."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Bools
from ...base.errors import InputError
from ...base.settings import require
from .names import Names, standard_name

Values = NDArray[np.float32]

NO_DATA = 1e3
"""In cm/s or larger units, numbers above this are fill values that the file does not declare."""
FASTEST = 9.0
"""No ocean current is as fast as this [m/s]: a faster value is a fill value or has another unit."""
ALONE = 2
"""Up to this many neighbouring points of exactly 0 m/s are calm water, as a radar measures it.

Larger patches of zeros are land.
"""
SEA_IS_ONE = re.compile(
    r"^([tuv]mask(util)?|(wetdry_)?mask_(rho|u|v|t)|wet(_[cuvt])?|sea_binary_mask|sea_mask)$", re.IGNORECASE
)
LAND_IS_ONE = re.compile(r"^(land_binary_mask|land_mask|landmask)$", re.IGNORECASE)
EITHER = re.compile(r"^(mask|lsm|land_sea_mask|landsea|binary_mask)$", re.IGNORECASE)


def mask_of(name: str, data: Any, names: Names, variable: Any, component: str) -> tuple[Any, float | None] | None:
    """Return a mask on the points of a variable and its value on land, or None if there is no mask.

    The value is None if it is unknown. The order of trust: the user's setting, the mask's own attributes, the
    points where the current is not zero.
    """
    if names.mask == "none":
        return None
    if names.mask is not None:
        exists = names.mask in data.variables
        require(
            exists,
            f'{name} holds no mask `{names.mask}`; set `mask` in `names` to one of its variables, or to "none"',
        )
    candidates = (
        [names.mask] if names.mask else [str(n) for n in data.variables if _is_mask(str(n), data[n], component)]
    )
    # what falls dry with the tide is land then; there the model leaves the last current that it had
    candidates.sort(key=lambda candidate: not candidate.lower().startswith("wetdry_"))
    for mask in (data[n] for n in candidates):
        extra = [dim for dim in mask.dims if dim not in variable.dims]
        fits = len(mask.dims) - len(extra) >= 2 and all(mask.sizes[dim] == 1 for dim in extra)
        if fits:
            mask = mask.isel(dict.fromkeys(extra, 0))
            return mask, float(names.land) if names.land is not None else _on_land(mask, variable)
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
    meanings = str(mask.attrs.get("flag_meanings", "")).lower().split()
    flags = np.ravel(mask.attrs.get("flag_values", []))
    if len(meanings) == len(flags) == 2 and sum("land" in word for word in meanings) == 1:
        return float(flags[next(n for n, word in enumerate(meanings) if "land" in word)])
    first = {dim: 0 for dim in variable.dims if dim not in mask.dims}
    speed = np.abs(np.nan_to_num(np.asarray(variable.isel(first).transpose(*mask.dims).values, np.float64)))
    here = np.asarray(mask.values, np.float64)
    moves = [(speed[here == value] > 0).any() for value in (0.0, 1.0)]
    if moves[0] == moves[1]:
        return None
    return 0.0 if moves[1] else 1.0


def clear_marks(file: str, name: str, values: Values, factor: float | None) -> tuple[Values, tuple[str, ...]]:
    """Return values in m/s, NaN where there is no data, and a note on fill values that were found."""
    # in mm/s or m/day a current may well have thousands
    values = np.where(np.abs(values) > max(NO_DATA, FASTEST / (factor or 1.0)), np.float32(np.nan), values)
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


@dataclass(frozen=True)
class Evidence:
    """How a file uses zeros; this does not depend on the domain.

    `still` (ny, nx): where the current of the whole uppermost level is exactly 0 at the first time. `fills`:
    whether a point of that level has no value. `masked`: the number of dimensions of the mask that was used, 0
    without a mask. `levels`: the number of levels in the file.
    """

    still: Bools
    fills: bool
    masked: int
    levels: int

    def patch(self) -> int:
        """Return the number of points in the largest patch of zeros; calm water is scattered, land is wide."""
        from scipy.ndimage import label

        patches, count = label(self.still, structure=np.ones((3, 3)))
        return int(np.bincount(patches.ravel())[1:].max()) if count else 0

    def wide(self) -> bool:
        """Return whether a patch of zeros holds three by three points."""
        from scipy.ndimage import binary_erosion

        return bool(binary_erosion(self.still, structure=np.ones((3, 3), dtype=bool)).any())


def both_still(first: Evidence, second: Evidence) -> Evidence:
    """Return the evidence where both components are 0; on a staggered grid, on their common rows and columns."""
    ny, nx = (min(a, b) for a, b in zip(first.still.shape, second.still.shape, strict=True))
    still = first.still[:ny, :nx] & second.still[:ny, :nx]
    fewest = min(first.masked, second.masked)
    return Evidence(still, first.fills or second.fills, fewest, max(first.levels, second.levels))


def _columns_of_land(name: str, still: Bools, evidence: Evidence, zeros: str | None) -> tuple[Bools, list[str]]:
    """Return which of the columns (ny, nx) that never move are land, and notes on what was assumed."""
    nowhere = np.zeros_like(still)
    count = int(still.sum())
    if count == 0 or zeros == "calm":
        return nowhere, [f"{count} columns without any current are calm water, as you say"] if count else []
    if zeros == "land":
        return still, [f"{count} columns without any current are land, as you say"]
    if evidence.masked:
        return nowhere, [f"{count} columns without any current are water by the mask: taken as calm water"]
    if evidence.levels < 2 and evidence.fills and evidence.wide():
        raise InputError(
            f"{name} holds both missing values and wide patches of exactly 0 m/s ({evidence.patch()} points "
            'together), which may be land or calm water: set `zeros` in `names`, "land" or "calm"'
        )
    few = 'calm water: they lie apart from each other; set `zeros` = "land" in `names` if they are land'
    if evidence.patch() <= ALONE or (evidence.levels < 2 and evidence.fills):
        return nowhere, [f"{count} columns of exactly 0 m/s are taken as {few}"]
    return still, [
        f"{count} columns with no current at any time or depth are taken as land; "
        'set `zeros` = "calm" in `names` if they are water'
    ]


def mark_land(
    name: str,
    u: Values,
    v: Values,
    deeper: tuple[Values, Values] | None,
    evidence: Evidence,
    known: Bools | None,
    zeros_are: str | None,
) -> list[str]:
    """Set u and v to NaN, in place, where land and seabed are written as zeros; return notes.

    u, v (nt, nz, ny, nx) are the levels that were read, `deeper` (1, n, ny, nx) the levels below them. `evidence`
    decides whether a column without any current is land. Zeros from some level down to the last level of the file
    are seabed, column by column. This does not hold where a fill value lies below the zeros or where the model's
    depth is `known` (ny, nx): there the seabed is marked in another way.
    """
    blocks = [(u, v)] if deeper is None else [(u, v), deeper]
    parts = []
    for east, north in blocks:
        still, held = np.ones(east.shape[1:], dtype=bool), np.zeros(east.shape[1:], dtype=bool)
        for a, b in zip(east, north, strict=True):
            missing = np.isnan(a)
            still &= ((a == 0) & (b == 0)) | missing
            held |= ~missing
        parts.append((still, held))
    still, held = (np.concatenate([part[n] for part in parts]) for n in range(2))
    whole = np.asarray(still.all(axis=0) & held.any(axis=0))
    land, notes = _columns_of_land(name, whole, evidence, zeros_are)
    under = np.cumprod((still & held)[::-1], axis=0)[::-1].astype(bool) & ~whole
    if known is not None:
        under &= ~known
    if evidence.masked > 2 or evidence.levels < 2 or zeros_are == "calm":
        under[:] = False
    dry = under | land
    levels = u.shape[1]
    for (east, north), part in zip(blocks, (dry[:levels], dry[levels:]), strict=False):
        east[:, part] = north[:, part] = np.nan
    if under.any():
        notes.append(
            f"{int(under.sum())} points with no current at any time, down to the last level, are taken as "
            'seabed; set `zeros` = "calm" in `names` if they are water'
        )
    return notes
