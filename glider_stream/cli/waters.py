"""Commands that show and map currents."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from .answers import show
from .group import cli
from .options import FILE, JSON, NAME, key_and_value, place_and_time, scale_and_value


@cli.command()
@click.argument("currents", nargs=-1, required=True, type=FILE)
@click.option(
    "--at",
    multiple=True,
    type=place_and_time,
    metavar="LON,LAT,DEPTH[,TIME]",
    help="Show the current at this place.",
)
@NAME
@JSON
def describe(
    currents: tuple[Path, ...], at: tuple[Any, ...], names: tuple[tuple[str, Any], ...], as_json: bool
) -> None:
    """Show what the current files CURRENTS hold.

    The output also shows how the planner reads them.
    """
    from .. import planner

    description = planner.describe(currents, [(*place, None)[:4] for place in at], dict(names))
    show(description, as_json)


MAP_OPTIONS = (
    click.option(
        "--dives", multiple=True, type=FILE, help="Currents averaged over dives: CSV, or a glider's NetCDF."
    ),
    click.option("--points", multiple=True, type=FILE, help="Currents at points: CSV with lon, lat, u, v."),
    click.option(
        "--drifters", multiple=True, type=FILE, help="Fixes of drifters: CSV with drifter, time, lon, lat."
    ),
    click.option(
        "--column", "columns", multiple=True, type=key_and_value, metavar="WHAT=COLUMN", help="A column's name."
    ),
    click.option(
        "--scale",
        "scales",
        multiple=True,
        type=scale_and_value,
        metavar="NAME=VALUE",
        help="A known scale: speed, noise, mean [m/s], length, depth [m], time [s]; the others are fitted.",
    ),
    click.option(
        "--kernel", default="matern", show_default=True, help="matern for rough currents, gaussian for smooth."
    ),
    click.option(
        "--inducing", type=int, metavar="N", help="With very many measurements: let N of them stand for all."
    ),
    click.option("--members", type=int, default=0, metavar="N", help="Write N currents that may be, beside."),
    click.option("--seed", type=int, default=0, show_default=True, help="For members and for starts of the fit."),
    click.option("-o", "--output", required=True, type=FILE, help="The NetCDF file to write."),
    JSON,
)


def map_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of commands that map currents."""
    for option in reversed(MAP_OPTIONS):
        command = option(command)
    return command


def _mapped(make: Callable[..., Any], *places: Any, output: Path, as_json: bool, **options: Any) -> None:
    """Make a map and print its figures."""
    for pairs in ("columns", "scales"):
        options[pairs] = dict(options[pairs])
    options["columns"] = {what: str(column) for what, column in options["columns"].items()}
    found = make(*places, output, **options)
    show(found, as_json)


@cli.command()
@click.argument("forecast", nargs=-1, required=True, type=FILE)
@NAME
@map_options
def assimilate(forecast: tuple[Path, ...], names: tuple[tuple[str, Any], ...], **options: Any) -> None:
    """Correct the currents of FORECAST by measurements.

    The output holds the corrected current and its standard deviation on the same grid, levels and times, and is a
    current file as any other.
    """
    from .. import planner

    _mapped(planner.assimilate, forecast, names=dict(names), **options)


@cli.command("map")
@click.option("--lon", nargs=2, type=float, required=True, metavar="WEST EAST", help="Degrees.")
@click.option("--lat", nargs=2, type=float, required=True, metavar="SOUTH NORTH", help="Degrees.")
@click.option("--spacing", type=float, required=True, metavar="METRES", help="The widest spacing of the grid.")
@click.option("--depth", multiple=True, type=float, metavar="METRES", help="A level; 0 if not given; repeatable.")
@click.option("--time", "times", multiple=True, metavar="T", help="A date (UTC) of the map; repeatable.")
@map_options
def map_command(
    lon: tuple[float, float], lat: tuple[float, float], spacing: float, depth: tuple[float, ...], **options: Any
) -> None:
    """Map currents from measurements alone.

    The output holds the current and its standard deviation, and is a current file as any other.
    """
    from .. import planner

    _mapped(planner.map_currents, lon, lat, spacing, depth=depth or (0.0,), **options)
