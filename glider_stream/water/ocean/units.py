"""Units of current files."""

import re

METRES = {"": 1.0, "m": 1.0, "meter": 1.0, "metre": 1.0, "cm": 0.01, "centimeter": 0.01, "centimetre": 0.01}
METRES |= {"km": 1e3, "kilometer": 1e3, "kilometre": 1e3, "mm": 1e-3, "millimeter": 1e-3, "millimetre": 1e-3}
KNOTS = {"knot", "knots", "kt", "kts", "kn"}


def in_metres(units: str) -> float | None:
    """Return the metres in a unit; 1 for an empty unit, None if it is not a length."""
    text = units.strip().lower()
    return METRES.get(text if len(text) < 3 else text.removesuffix("s"))


HOURS = {
    "s": 1.0,
    "sec": 1.0,
    "second": 1.0,
    "min": 60.0,
    "minute": 60.0,
    "h": 3600.0,
    "hr": 3600.0,
    "hour": 3600.0,
}
HOURS |= {"d": 86400.0, "day": 86400.0}
"""Units of time in seconds."""
SIGNS = str.maketrans({"⁻": "-", "−": "-", "¹": "1", "·": " ", "⋅": " ", "×": " ", "{": "", "}": "", "$": ""})


def in_seconds(units: str) -> float | None:
    """Return the seconds in a unit; None if it is not a time."""
    text = units.strip().lower()
    return HOURS.get(text, HOURS.get(text.removesuffix("s")))


def in_metres_per_second(units: str) -> float | None:
    """Return the m/s in a unit; None if it is not a speed."""
    text = re.sub(r"\s+", " ", units.translate(SIGNS).strip().lower())
    if text in KNOTS:
        return 1852 / 3600
    text = text.replace(" ^", "^").replace("^-1", "-1").replace("**-1", "-1").replace(" / ", "/")
    match = re.fullmatch(r"([a-z]+?)s?\s*(?:/|per)\s*([a-z]+)\.?", text)
    match = match or re.fullmatch(r"([a-z]+?)s?[\s.*_]+([a-z]+?)\s*-1", text)
    match = match or re.fullmatch(r"(k?m|cm|mm)(s|h)-1", text)
    match = match or re.fullmatch(r"([a-z]+?)s?[\s.*_]*(s|sec|secs|second|seconds)\s*-1", text)
    if match is None or not match.group(1):
        return None
    length, time = METRES.get(match.group(1)), in_seconds(match.group(2))
    return None if length is None or time is None else length / time
