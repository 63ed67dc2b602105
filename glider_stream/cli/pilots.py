"""Commands for pilots: plans made anew, routes and files checked, vehicles and currents from dives."""

import sys
from pathlib import Path
from typing import Any

import click

from ..base.terminal import say
from .answers import show, show_json
from .group import cli
from .options import (
    ELSEWHERE,
    FILE,
    JSON,
    ROADMAP,
    SET,
    WAYPOINTS,
    WINDOW_HOURS,
    Percentage,
    fix_place,
    key_and_value,
    place,
    two_numbers,
)


@cli.command()
@click.argument("plan", type=FILE)
@click.option(
    "--fix",
    required=True,
    type=fix_place,
    metavar="LON,LAT,TIME",
    help="Where and when the vehicle surfaced: degrees, or X,Y in metres; a date (UTC), or seconds of the flow.",
)
@click.option(
    "--dac",
    type=two_numbers,
    metavar="EAST,NORTH",
    help="The depth-averaged current of the last dive [m/s], to compare with the forecast.",
)
@click.option("--currents", multiple=True, type=FILE, help="A newer current file; repeatable.")
@click.option("--roadmap", type=FILE, help="The roadmap to search, if not the one that PLAN names.")
@click.option("--scenario", help="The scenario, if PLAN does not name one.")
@SET
@click.option(
    "--tolerance",
    type=Percentage(),
    default="5%",
    show_default=True,
    help="The old list is good while flying it on costs at most this much more in all.",
)
@click.option("--all-nodes", is_flag=True, help="Search all nodes, not only those near the roadmap's best ways.")
@click.option("--polish", is_flag=True, help="Polish the new plan, as in `query`.")
@click.option("--thin", type=float, metavar="METRES", help="Join legs of the new plan, as in `query`.")
@click.option("--most-yos", type=int, help="The rule of surfacing, if not the old plan's.")
@click.option("--most-hours", type=float, help="The rule of surfacing, if not the old plan's.")
@click.option("-o", "--output", "outputs", multiple=True, type=FILE, help="A route file to write, as in `query`.")
@WINDOW_HOURS
@WAYPOINTS
@click.option(
    "--arrival-radius",
    type=float,
    metavar="METRES",
    help="A waypoint, and the goal, is reached at this distance.",
)
@JSON
def replan(
    plan: Path,
    fix: tuple[float, float, str],
    dac: tuple[float, float] | None,
    currents: tuple[Path, ...],
    roadmap: Path | None,
    scenario: str | None,
    overrides: tuple[str, ...],
    tolerance: float,
    most_yos: int | None,
    most_hours: float | None,
    window_hours: float | None,
    waypoints: int | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Plan anew from a position fix to the goal of PLAN.

    PLAN is a JSON file from `query`, `plan` or `replan`. The answer says what changes, what the old list would
    do, and until when it is good if the next call fails. Exit code 1 if no path exists.
    """
    from .. import planner
    from ..search.surfacing import Surfacing

    if roadmap is not None and scenario is not None:
        raise click.UsageError("--roadmap and --scenario do not go together; leave one of them out")
    given = {"window_hours": window_hours, "most_waypoints": waypoints}
    options |= {name: value for name, value in given.items() if value is not None}
    rule = None if most_yos is None and most_hours is None else Surfacing(most_yos, most_hours)
    answer = planner.replan(
        plan, fix[:2], fix[2], source=roadmap or scenario, overrides=overrides, dac=dac,
        currents=currents or None, tolerance=tolerance, surfacing=rule, **options,
    )  # fmt: skip
    for note in answer.notes:
        say(f"note: {note}", error=True)
    show(answer, as_json, error=not answer.new.found)
    if not answer.new.found:
        sys.exit(1)


@cli.command()
@ROADMAP
@ELSEWHERE
@click.argument("route", nargs=-1, required=True, type=FILE)
@click.option(
    "--start",
    type=place,
    metavar="X,Y,Z",
    help="The vehicle's position before ROUTE, in the same form as for `query`.",
)
@click.option("--depart", metavar="T", help="The departure, in the same form as for `query`.")
@JSON
def score(
    roadmap: Path,
    overrides: tuple[str, ...],
    route: tuple[Path, ...],
    start: Any,
    depart: str | None,
    as_json: bool,
) -> None:
    """Fly the drawn ROUTE in the water of ROADMAP.

    ROUTE is a CSV, GeoJSON, KML or GPX file, a path file, goto lists or targets; several files are one route.
    Exit code 1 if a leg fails.
    """
    from ..opened import open_either

    found = open_either(roadmap, overrides).score(route, start, depart=depart)
    show(found, as_json, error=not found.flyable)
    if not found.flyable:
        sys.exit(1)


@cli.command()
@click.argument("files", nargs=-1, required=True, type=FILE)
@click.option("--waypoints", type=int, default=8, show_default=True, help="The most waypoints in a goto list.")
@JSON
def lint(files: tuple[Path, ...], waypoints: int, as_json: bool) -> None:
    """Find faults in FILES that vehicles fly.

    FILES are goto lists, yo files or targets. Exit code 1 if there are faults.
    """
    from .. import planner

    looked = planner.lint(files, waypoints)
    if as_json:
        show_json([result.as_dict() for result in looked])
    else:
        say("\n".join(map(str, looked)))
    if any(result.faults for result in looked):
        sys.exit(1)


@cli.command()
@click.argument("dives", type=FILE)
@click.option(
    "--preset", default="seaglider", show_default=True, help="The vehicle to start from: seaglider or slocum."
)
@click.option(
    "--column",
    "columns",
    multiple=True,
    type=key_and_value,
    metavar="WHAT=COLUMN",
    help="The column of vertical, horizontal, pitch, glide_angle, buoyancy [cc], net_mass [kg] or phase.",
)
@click.option("-o", "--output", type=FILE, help="The TOML file to write, with the [glider] section.")
@JSON
def calibrate(
    dives: Path, preset: str, columns: tuple[tuple[str, Any], ...], output: Path | None, as_json: bool
) -> None:
    """Fit a vehicle to DIVES, a CSV file of its dives.

    The fit finds the vehicle's buoyancy or drag, and its lift.
    """
    from .. import planner

    found = planner.calibrate(
        dives, output, preset=preset, columns={name: str(column) for name, column in columns}
    )
    show(found, as_json)


@cli.command()
@click.argument("dives", type=FILE)
@click.option(
    "--column",
    "columns",
    multiple=True,
    type=key_and_value,
    metavar="WHAT=COLUMN",
    help="A column or variable with another name: t_start, lon_start, ..., heading, horizontal, east, north, ...",
)
@click.option(
    "--declination", type=float, default=0.0, show_default=True, help="Degrees to add to magnetic headings."
)
@click.option("--attack", type=float, default=3.0, show_default=True, help="A track's angle of attack [degrees].")
@click.option("--fix-error", type=float, default=10.0, show_default=True, help="Standard error of a fix [m].")
@click.option(
    "--speed-error",
    type=Percentage(),
    default="5%",
    show_default=True,
    help="Standard error of the speed through water; at least 10% where a track's depth and pitch give it.",
)
@click.option(
    "--heading-error", type=float, default=3.0, show_default=True, help="Standard error of headings [degrees]."
)
@click.option("-o", "--output", type=FILE, help="A CSV or JSON file to write.")
@JSON
def currents(
    dives: Path,
    columns: tuple[tuple[str, Any], ...],
    declination: float,
    attack: float,
    fix_error: float,
    speed_error: float,
    heading_error: float,
    output: Path | None,
    as_json: bool,
) -> None:
    """Find the depth-averaged current of each of DIVES, with its error.

    DIVES is a CSV file with a line for each dive, or a NetCDF file of a track with depth, heading and pitch.
    """
    from .. import planner

    found = planner.currents(
        dives, output, columns={name: str(column) for name, column in columns}, declination=declination,
        attack=attack, fix_error=fix_error, speed_error=speed_error, heading_error=heading_error,
    )  # fmt: skip
    show(found, as_json)
