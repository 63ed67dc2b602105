"""Units of current files."""

import re

METRES = {"": 1.0, "m": 1.0, "meter": 1.0, "metre": 1.0, "cm": 0.01, "centimeter": 0.01, "centimetre": 0.01}
METRES |= {"km": 1e3, "kilometer": 1e3, "kilometre": 1e3, "mm": 1e-3, "millimeter": 1e-3, "millimetre": 1e-3}
KNOTS = {"knot", "knots", "kt", "kts", "kn"}


def in_metres(units: str) -> float | None:
    """Metres of one such unit; 1 where there is none, None where it is no length."""
    text = units.strip().lower()
    return METRES.get(text if len(text) < 3 else text.removesuffix("s"))


def in_metres_per_second(units: str) -> float | None:
    """m/s of one such unit; None where it is no speed."""
    text = re.sub(r"\s+", " ", units.strip().lower())
    if text in KNOTS:
        return 1852 / 3600
    text = text.replace(" ^", "^").replace("^-1", "-1").replace("**-1", "-1").replace(" / ", "/")
    match = re.fullmatch(r"([a-z]+?)s?\s*(/|per)\s*(s|sec|secs|second|seconds)\.?", text)
    match = match or re.fullmatch(r"([a-z]+?)s?[\s.*_]*(s|sec|secs|second|seconds)\s*-1", text)
    return METRES.get(match.group(1)) if match and match.group(1) else None
