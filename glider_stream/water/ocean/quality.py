"""Quality flags of currents: a value that a flag calls bad becomes no data."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .names import Catalogue, standard_name

Values = NDArray[np.float32]
Order = tuple[str | None, str | None, str, str]
"""The dimensions of time and level (None where a variable has none), of rows and of columns."""
FLAGS = re.compile(
    r"^(q_?c_?flags?|quality_?(flags?|control)|flags?|qc|.*_(qc|quality_flag|qartod))$", re.IGNORECASE
)
BAD = re.compile(r"bad|fail|suspect|questionable|missing|invalid|reject|error|erroneous|unusable|\bland\b")
NOT_BAD = re.compile(r"not_bad|no_error|error_?free")


def spread_over(numbers: Any, dims: list[str], order: Order) -> Any:
    """Return numbers along some dimensions of `order` in a shape that fits values (nt, nz, ny, nx)."""
    sizes = dict(zip(dims, numbers.shape, strict=True))
    return numbers.reshape([1 if dim is None else sizes.get(dim, 1) for dim in order])


def _flags_of(at: Catalogue, variable: Any) -> list[str]:
    """Return the flags of a current: those that its attributes name, else those with a fitting name."""
    wanted = at.names.quality
    if wanted is not None:
        return [wanted] if wanted in at.data.variables else []
    listed = str(variable.attrs.get("ancillary_variables", "")).split()
    pattern = re.compile(rf"^{re.escape(str(variable.name))}_?(qc|q_?c_?flag|quality_?flag|flag)$", re.IGNORECASE)
    found = []
    for name in map(str, at.data.variables):
        candidate = at.data[name]
        flag = "flag" in standard_name(candidate) or FLAGS.match(name) or "flag_meanings" in candidate.attrs
        other = re.match(r"^(.*)_(qc|quality_flag|qartod)$", name, re.IGNORECASE)
        elsewhere = other is not None and other.group(1) in at.data.variables and not pattern.match(name)
        named = name in listed or pattern.match(name) or (FLAGS.match(name) and not elsewhere)
        fits = (
            candidate.ndim >= 2
            and set(candidate.squeeze().dims) <= set(variable.dims)
            and candidate.dtype.kind in "iuf"
        )
        if flag and named and fits:
            found.append(name)
    return found


def _bad(flag: Any, values: Any) -> tuple[Any, str] | None:
    """Return where a flag calls values bad and its words for that; None if its attributes do not say."""
    meanings = str(flag.attrs.get("flag_meanings", "")).lower().replace(",", " ").split()
    bad = [bool(BAD.search(meaning)) and not NOT_BAD.search(meaning) for meaning in meanings]
    marks = [np.ravel(flag.attrs.get(key, [])) for key in ("flag_values", "flag_masks")]
    if isinstance(flag.attrs.get("flag_values"), str):
        marks[0] = np.array(re.findall(r"-?\d+", flag.attrs["flag_values"]), dtype=np.int64)
    if not meanings or not any(mark.size == len(meanings) for mark in marks):
        return None
    bad_meanings = ", ".join(meaning for meaning, is_bad in zip(meanings, bad, strict=True) if is_bad)
    if marks[0].size == len(meanings):
        return np.isin(
            values, [float(n) for n, is_bad in zip(marks[0], bad, strict=True) if is_bad]
        ), bad_meanings
    known = np.nan_to_num(values).astype(np.int64)
    hit = np.zeros(known.shape, dtype=bool)
    for mask, is_bad in zip(marks[1], bad, strict=True):
        hit |= is_bad & ((known & int(mask)) != 0)
    return hit, bad_meanings


def bad_by_flags(
    at: Catalogue, variable: Any, values: Values, place: dict[str, Any], order: Order
) -> tuple[Values, tuple[str, ...]]:
    """Return values (nt, nz, ny, nx) with NaN where a quality flag calls them bad, and notes."""
    if at.names.quality == "none":
        return values, ()
    notes: list[str] = []
    for name in _flags_of(at, variable):
        flag = at.data[name]
        extra = {dim: 0 for dim in map(str, flag.dims) if dim not in variable.dims}
        here = flag.isel(extra).isel({dim: which for dim, which in place.items() if dim in flag.dims})
        dims = [dim for dim in order if dim is not None and dim in here.dims]
        found = _bad(flag, np.asarray(here.transpose(*dims).values, np.float64))
        if found is None:
            notes.append(
                f"`{name}` beside the currents does not say what its numbers mean (flag_values, flag_meanings): "
                "not used"
            )
            continue
        hit = spread_over(found[0], dims, order) & np.isfinite(values)
        notes.append(
            f"{100 * hit.mean():.2g} % of `{variable.name}` are taken as no data by `{name}` "
            f"({found[1] or 'nothing bad'})"
        )
        values = np.where(hit, np.float32(np.nan), values)
    return values, tuple(notes)
