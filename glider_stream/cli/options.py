"""What options and arguments read, and those that several commands share."""

import math
import re
from pathlib import Path
from typing import Any

import click


def place(text: str, texts: int = 0) -> tuple[Any, ...]:
    """Return three numbers with commas between them, then up to `texts` texts."""
    parts = text.split(",")
    try:
        numbers = tuple(float(part) for part in parts[:3])
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or len(parts) > 3 + texts:
        raise click.BadParameter(f"{text!r} is not three numbers with commas between, such as 100,-50,-20")
    return (*numbers, *parts[3:])


def place_and_time(text: str) -> tuple[Any, ...]:
    """Return three numbers and, if given, a time."""
    return place(text, texts=1)


def key_and_value(text: str) -> tuple[str, Any]:
    """Return a key and its value: a number or a text."""
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not key or not value:
        raise click.BadParameter(f"{text!r} is not KEY=VALUE, such as units=cm/s")
    if value.isdecimal():
        return key, int(value)
    return key, float(value) if re.fullmatch(r"\d+\.\d+", value) else value


def scale_and_value(text: str) -> tuple[str, float]:
    """Return the name of a scale and its value."""
    name, _, value = (part.strip() for part in text.partition("="))
    try:
        return name, float(value)
    except ValueError:
        raise click.BadParameter(f"{text!r} is not NAME=NUMBER, such as length=20000") from None


def fix_place(text: str) -> tuple[float, float, str]:
    """Return two numbers and a time with commas between them."""
    parts = text.split(",")
    try:
        x, y = (float(part) for part in parts[:2])
    except ValueError:
        parts = []
    if len(parts) != 3 or not parts[2].strip():
        form = "a fix, LON,LAT,TIME, such as 18.4,38.0,2024-11-20T18:00"
        raise click.BadParameter(f"{text!r} is not {form}")
    return x, y, parts[2].strip()


def two_numbers(text: str) -> tuple[float, float]:
    """Return two finite numbers with a comma between them."""
    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError:
        first = second = math.nan
    if not (math.isfinite(first) and math.isfinite(second)):
        raise click.BadParameter(f"{text!r} is not two numbers with a comma between, such as 0.12,-0.05")
    return first, second


class Percentage(click.ParamType[float]):
    """A percentage such as 1%, as a share."""

    name = "percentage"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The share."""
        number = str(value).strip().removesuffix("%")
        try:
            if number != str(value).strip():
                return float(number) / 100
        except ValueError:
            pass
        self.fail(f"{value!r} is not a percentage, such as 1%", param, ctx)


FILE = click.Path(path_type=Path)


JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON on standard output.")


ROADMAP = click.argument("roadmap", type=FILE)


SET = click.option("--set", "overrides", multiple=True, metavar="SECTION.KEY=VALUE", help="Override a key.")


ELSEWHERE = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="SECTION.KEY=FILE",
    help="The new place of a file of ROADMAP's scenario, such as flow.file=currents.nc.",
)


NAME = click.option(
    "--name",
    "names",
    multiple=True,
    type=key_and_value,
    metavar="KEY=VALUE",
    help="A setting for what the files do not hold, as in [flow.names]: u, v, lon, lat, depth, time, units, ...",
)
WINDOW_HOURS = click.option(
    "--window-hours", type=float, metavar="H", help="Length of exported windows; 12 if not given."
)
WAYPOINTS = click.option(
    "--waypoints", type=int, metavar="N", help="The most waypoints in a goto list; 8 if not given."
)
