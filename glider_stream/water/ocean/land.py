"""Land in current files: masks, fills that are not declared, and zeros."""

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
"""No current of a few m/s makes such a number, in cm/s or larger units: a fill that the file does not declare."""
FASTEST = 9.0
"""No ocean current is as fast [m/s]: a fill, or another unit."""
ALONE = 2
"""So many neighbouring points of exactly 0 m/s are calm, as a radar measures it; more are written so."""
SEA_IS_ONE = re.compile(
    r"^([tuv]mask(util)?|(wetdry_)?mask_(rho|u|v|t)|wet(_[cuvt])?|sea_binary_mask|sea_mask)$", re.IGNORECASE
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
    # what falls dry with the tide is land then; there the model leaves the last current that it had
    names.sort(key=lambda one: not one.lower().startswith("wetdry_"))
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
    # of mm/s or m/day a current may well have thousands
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
    """What a file says of its zeros, wherever a domain is cut: `still` (ny, nx) is its whole uppermost level.

    `still`: where the current is exactly 0 at the first time; `fills`: whether a point of it has no value;
    `masked`: dimensions of the mask that was used, 0 if none; `levels`: how many the file has.
    """

    still: Bools
    fills: bool
    masked: int
    levels: int

    def patch(self) -> int:
        """Points of the largest patch of zeros: calm is measured here and there, land is wide."""
        from scipy.ndimage import label

        patches, count = label(self.still, structure=np.ones((3, 3)))
        return int(np.bincount(patches.ravel())[1:].max()) if count else 0

    def wide(self) -> bool:
        """Whether a patch of zeros holds three by three points."""
        from scipy.ndimage import binary_erosion

        return bool(binary_erosion(self.still, structure=np.ones((3, 3), dtype=bool)).any())


def both_still(one: Evidence, other: Evidence) -> Evidence:
    """Where both components are 0; of a staggered grid the rows and columns that both have."""
    ny, nx = (min(a, b) for a, b in zip(one.still.shape, other.still.shape, strict=True))
    still = one.still[:ny, :nx] & other.still[:ny, :nx]
    fewest = min(one.masked, other.masked)
    return Evidence(still, one.fills or other.fills, fewest, max(one.levels, other.levels))


def _columns_of_land(name: str, still: Bools, evidence: Evidence, said: str | None) -> tuple[Bools, list[str]]:
    """Which columns (ny, nx), still at all times and depths, are land; what was assumed."""
    none = np.zeros_like(still)
    count = int(still.sum())
    if count == 0 or said == "calm":
        return none, [f"{count} columns without any current are calm water, as you say"] if count else []
    if said == "land":
        return still, [f"{count} columns without any current are land, as you say"]
    if evidence.masked:
        return none, [f"{count} columns without any current are open by the mask: taken as calm water"]
    if evidence.levels < 2 and evidence.fills and evidence.wide():
        raise InputError(
            f"{name} holds both missing values and wide patches of exactly 0 m/s ({evidence.patch()} points "
            'together), which may be land or calm water: name `zeros` in `names`, "land" or "calm"'
        )
    few = 'calm water: they lie apart from each other; name `zeros` = "land" in `names` if they are land'
    if evidence.patch() <= ALONE or (evidence.levels < 2 and evidence.fills):
        return none, [f"{count} columns of exactly 0 m/s are taken as {few}"]
    return still, [
        f"{count} columns with no current at any time or depth are taken as land; "
        'name `zeros` = "calm" in `names` if they are water'
    ]


def mark_land(
    name: str,
    u: Values,
    v: Values,
    deeper: tuple[Values, Values] | None,
    evidence: Evidence,
    known: Bools | None,
    said: str | None,
) -> list[str]:
    """NaN, in place, where land and seabed are written as zeros; notes on what was assumed.

    u, v (nt, nz, ny, nx) and the levels below them, `deeper` (1, n, ny, nx) each. A column without any current
    is land by what the file's zeros look like (`evidence`). Zeros from some level down to the last one of the
    file are seabed, column by column: what a fill says elsewhere says nothing here. Not where a fill lies
    beneath them, nor where the model's depth is `known` (ny, nx): there the seabed has another mark.
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
    land, notes = _columns_of_land(name, whole, evidence, said)
    under = np.cumprod((still & held)[::-1], axis=0)[::-1].astype(bool) & ~whole
    if known is not None:
        under &= ~known
    if evidence.masked > 2 or evidence.levels < 2 or said == "calm":
        under[:] = False
    dry = under | land
    levels = u.shape[1]
    for (east, north), part in zip(blocks, (dry[:levels], dry[levels:]), strict=False):
        east[:, part] = north[:, part] = np.nan
    if under.any():
        notes.append(
            f"{int(under.sum())} points with no current at any time, down to the last level, are taken as "
            'seabed; name `zeros` = "calm" in `names` if they are water'
        )
    return notes
