"""Notes on currents that can be read but may be wrong: parts of the current, or speeds that no sea has."""

import re
from typing import Any

from .names import standard_name

PARTS = {
    "tides alone, or without them": re.compile(r"\btid(e|es|al)\b|\b[uv]_?tide\b|\bassuming no tide\b"),
    "an anomaly": re.compile(r"\banomal(y|ies)\b|\bperturbation|\bdeviation from"),
    "the geostrophic part": re.compile(r"\bgeostrophic\b|\b[uv]gos\w*"),
    "a mean over the depth": re.compile(
        r"\bbarotropic\b|\bdepth.?(averaged?|mean|integrated)\b|\bvertical(ly)?.(mean|averaged|integrated)"
    ),
    "the baroclinic part": re.compile(r"\bbaroclinic\b"),
    "an average over many years": re.compile(r"\bclimatolog"),
}
"""Parts of the current, and the words in a variable's names that tell them."""
WHOLE = re.compile(r"\btotal\b|\bsum\b|\+|\bincluding\b|\bwith tides?\b")
"""Long names with these words are of the total current."""
SLOW, FAST = 0.002, 5.0
"""A sea with all speeds below SLOW, or any above FAST [m/s], is unusual."""


def doubts_of(variable: Any) -> tuple[str, ...]:
    """Return a note if the names of a variable say that it is only a part of the current."""
    long = str(variable.attrs.get("long_name", "")).lower()
    text = " ".join([str(variable.name).lower(), standard_name(variable), long]).replace("_", " ")
    if WHOLE.search(long):
        return ()
    parts = [what for what, known in PARTS.items() if known.search(text)]
    if not parts:
        return ()
    return (
        f"`{variable.name}` ({long or standard_name(variable) or 'by its name'}) is {' and '.join(parts)}, "
        "not the whole current",
    )


def speed_doubts(variable: Any, fastest: float) -> tuple[str, ...]:
    """Return a note if the greatest speed [m/s] of a component is unusual for a sea."""
    if SLOW <= fastest <= FAST or fastest == 0.0:
        return ()
    kind = str(variable.encoding.get("dtype", variable.dtype))
    factor = variable.encoding.get("scale_factor", 1.0)
    cause = "is its unit right?"
    if "float" in kind and factor != 1.0:
        cause = (
            f"its `scale_factor` {float(factor):g} was applied to data that are not integers: is it left over?"
        )
    rank = "nowhere above" if fastest < SLOW else "as fast as"
    return (f"`{variable.name}` is {rank} {fastest:.2g} m/s: {cause} Name `units` in `names` to correct it",)
