"""Flags of quality beside the currents: what they call bad is no data."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .names import Catalogue, standard_name

Values = NDArray[np.float32]
Order = tuple[str | None, str | None, str, str]
"""Dimensions of time and level, None where a variable has no such, of rows and of columns."""
FLAGS = re.compile(
    r"^(q_?c_?flags?|quality_?(flags?|control)|flags?|qc|.*_(qc|quality_flag|qartod))$", re.IGNORECASE
)
BAD = re.compile(r"bad|fail|suspect|questionable|missing|invalid|reject|error|erroneous|unusable|\bland\b")
NOT_BAD = re.compile(r"not_bad|no_error|error_?free")


def spread_over(numbers: Any, dims: list[str], order: Order) -> Any:
    """Numbers along some dimensions of `order`, shaped so that they meet values (nt, nz, ny, nx)."""
    sizes = dict(zip(dims, numbers.shape, strict=True))
    return numbers.reshape([1 if dim is None else sizes.get(dim, 1) for dim in order])


def _flags_of(at: Catalogue, variable: Any) -> list[str]:
    """The flags of a current: those that it names itself, else those whose name says so."""
    said = at.said.quality
    if said is not None:
        return [said] if said in at.data.variables else []
    told = str(variable.attrs.get("ancillary_variables", "")).split()
    own = re.compile(rf"^{re.escape(str(variable.name))}_?(qc|q_?c_?flag|quality_?flag|flag)$", re.IGNORECASE)
    found = []
    for name in map(str, at.data.variables):
        one = at.data[name]
        flag = "flag" in standard_name(one) or FLAGS.match(name) or "flag_meanings" in one.attrs
        other = re.match(r"^(.*)_(qc|quality_flag|qartod)$", name, re.IGNORECASE)
        elsewhere = other is not None and other.group(1) in at.data.variables and not own.match(name)
        named = name in told or own.match(name) or (FLAGS.match(name) and not elsewhere)
        fits = one.ndim >= 2 and set(one.squeeze().dims) <= set(variable.dims) and one.dtype.kind in "iuf"
        if flag and named and fits:
            found.append(name)
    return found


def _bad(one: Any, values: Any) -> tuple[Any, str] | None:
    """Where a flag says bad, and what it calls so; None where its attributes do not say."""
    words = str(one.attrs.get("flag_meanings", "")).lower().replace(",", " ").split()
    bad = [bool(BAD.search(word)) and not NOT_BAD.search(word) for word in words]
    marks = [np.ravel(one.attrs.get(key, [])) for key in ("flag_values", "flag_masks")]
    if isinstance(one.attrs.get("flag_values"), str):
        marks[0] = np.array(re.findall(r"-?\d+", one.attrs["flag_values"]), dtype=np.int64)
    if not words or not any(mark.size == len(words) for mark in marks):
        return None
    told = ", ".join(word for word, is_bad in zip(words, bad, strict=True) if is_bad)
    if marks[0].size == len(words):
        return np.isin(values, [float(n) for n, is_bad in zip(marks[0], bad, strict=True) if is_bad]), told
    known = np.nan_to_num(values).astype(np.int64)
    hit = np.zeros(known.shape, dtype=bool)
    for mask, is_bad in zip(marks[1], bad, strict=True):
        hit |= is_bad & ((known & int(mask)) != 0)
    return hit, told


def bad_by_flags(
    at: Catalogue, variable: Any, values: Values, place: dict[str, Any], order: Order
) -> tuple[Values, tuple[str, ...]]:
    """Values (nt, nz, ny, nx) with NaN where a flag of quality calls them bad; notes on the flags."""
    if at.said.quality == "none":
        return values, ()
    notes: list[str] = []
    for name in _flags_of(at, variable):
        one = at.data[name]
        extra = {dim: 0 for dim in map(str, one.dims) if dim not in variable.dims}
        here = one.isel(extra).isel({dim: which for dim, which in place.items() if dim in one.dims})
        dims = [dim for dim in order if dim is not None and dim in here.dims]
        found = _bad(one, np.asarray(here.transpose(*dims).values, np.float64))
        if found is None:
            notes.append(
                f"`{name}` beside the currents does not say what its numbers mean (flag_values, flag_meanings): "
                "not used"
            )
            continue
        hit = spread_over(found[0], dims, order) & np.isfinite(values)
        notes.append(
            f"{100 * hit.mean():.2g} % of `{variable.name}` are no data by `{name}` ({found[1] or 'nothing bad'})"
        )
        values = np.where(hit, np.float32(np.nan), values)
    return values, tuple(notes)
