"""The command line. The body of each command is one library call; heavy modules are loaded only when needed."""

import json
import math
import os
import re
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .base.errors import InputError, InputWarning, Stopped
from .base.interrupt import STOPPED, stoppable
from .base.terminal import plain, say, silence

if TYPE_CHECKING:
    from .opened import OpenedScenario


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


def _write_json(value: Any) -> None:
    say(json.dumps(value, indent=1))


TRACE = "GLIDER_STREAM_TRACE"
"""With this environment variable set, an error of this program shows its trace."""
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


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False)
@click.version_option(package_name="glider-stream")
def cli() -> None:
    """Plan underwater glider routes in ocean currents."""


@cli.command()
@click.argument("scenario")
@click.option("-o", "--output", required=True, type=FILE, help="The roadmap file to write.")
@click.option("--threads", type=int, help="Threads to use; all cores if not given.")
@SET
@click.option("--shard", metavar="K/N", help="Build only part K of N, for `merge`.")
@click.option("--restart", is_flag=True, help="Discard what a stopped build has kept, and start again.")
@click.option(
    "--from",
    "base",
    type=FILE,
    metavar="OLD",
    help="Reuse the legs of an older roadmap that the new current cannot have changed.",
)
@click.option("--scheduler", metavar="ADDRESS", help="Evaluate on a Dask cluster; local:N for N processes here.")
@click.option(
    "--checkpoint", type=float, metavar="SECONDS", help="Seconds between writes to disk; 30 if not given."
)
def build(
    scenario: str,
    output: Path,
    threads: int | None,
    overrides: tuple[str, ...],
    shard: str | None,
    restart: bool,
    base: Path | None,
    scheduler: str | None,
    checkpoint: float | None,
) -> None:
    """Build the roadmap of SCENARIO.

    SCENARIO is a TOML file or the name of a shipped scenario, such as seed-box. Results are kept beside the
    output until it is complete: the same command continues a stopped build.
    """
    from . import planner
    from .base.progress import reporter

    run: dict[str, Any] = {
        "threads": threads,
        "overrides": overrides,
        "restart": restart,
        "checkpoint": checkpoint,
        "scheduler": scheduler,
        "base": base,
    }
    empty = ""
    with reporter("build") as progress:
        if shard is not None:
            planner.build_part(scenario, output, shard, progress=progress, **run)
            done = f"part {shard} of a roadmap"
        else:
            road = planner.build(scenario, output, progress=progress, **run)
            dense = planner.density(road)
            done, empty = f"{road}\n  dense:  {dense}", planner.why_no_edges(road) or dense.warning
    say(f"{done}\n  file:   {output}")
    if empty:
        say(f"note: {empty}", error=True)


@cli.command()
@click.argument("parts", nargs=-1, required=True, type=FILE)
@click.option("-o", "--output", required=True, type=FILE, help="The roadmap file to write.")
def merge(parts: tuple[Path, ...], output: Path) -> None:
    """Merge PARTS into one roadmap.

    PARTS are the files that `build --shard` wrote.
    """
    from . import planner

    road = planner.merge(parts, output)
    say(f"{road}\n  file:   {output}")
    if empty := planner.why_no_edges(road):
        say(f"note: {empty}", error=True)


ROUTE_OPTIONS = (
    click.option("--start", type=place, metavar="X,Y,Z", help="Metres, z upward; LON,LAT,DEPTH if geographic."),
    click.option("--goal", type=place, metavar="X,Y,Z", help="The goal, in the same form as --start."),
    click.option(
        "--depart",
        metavar="T",
        help="The departure, in place of query.departure: seconds of the flow, or a date (UTC).",
    ),
    click.option(
        "-o",
        "--output",
        "outputs",
        multiple=True,
        type=FILE,
        help="A route file to write: .json, .csv, .geojson, .kml, .gpx, goto_l10.ma, targets, ...; repeatable.",
    ),
    click.option(
        "--most-energy",
        type=float,
        metavar="J",
        help="The fastest path that uses no more; needs cost.kind = energy.",
    ),
    click.option(
        "--most-yos", type=int, help="The most yos (a dive and a climb) from one surfacing to the next."
    ),
    click.option("--most-hours", type=float, help="The most hours from one surfacing to the next."),
    click.option(
        "--polish",
        is_flag=True,
        help="Move the stops off the nodes, cut legs, count yos anew, as long as the cost falls.",
    ),
    click.option(
        "--within",
        type=Percentage(),
        metavar="PERCENT",
        help="Add nodes where they can help, in rounds, until a round gains less than this, such as 1%.",
    ),
    click.option(
        "--seconds", type=float, metavar="SECONDS", help="Add nodes, as long as another round fits this time."
    ),
    click.option(
        "--thin",
        type=float,
        metavar="METRES",
        help="Join legs this near to a straight line, if one glide can do it.",
    ),
    click.option(
        "--card", "as_card", is_flag=True, help="Print the pilot's card: speed over ground, currents, arrivals."
    ),
    click.option("--window-hours", type=float, metavar="H", help="Length of exported windows; 12 if not given."),
    click.option("--waypoints", type=int, metavar="N", help="The most waypoints in a goto list; 8 if not given."),
    click.option(
        "--arrival-radius",
        type=float,
        metavar="METRES",
        help="A waypoint is reached at this distance; 500 if not given, 200 for targets.",
    ),
    click.option(
        "--trade-off", "front", is_flag=True, help="Instead, list the paths that trade time against energy."
    ),
    click.option(
        "--depart-between",
        nargs=2,
        metavar="A B",
        help="Try departures between two times: seconds of the flow, or dates (UTC).",
    ),
    click.option(
        "--every",
        type=float,
        metavar="SECONDS",
        help="With --depart-between: the time from one departure to the next.",
    ),
    click.option("--arrive-by", metavar="T", help="Find the latest departure that arrives by this time."),
    click.option(
        "--figure", type=FILE, help="A figure of travel time and arrival against departure: PNG, SVG or PDF."
    ),
    JSON,
)


def route_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of commands that find a route."""
    for option in reversed(ROUTE_OPTIONS):
        command = option(command)
    return command


@cli.command()
@ROADMAP
@ELSEWHERE
@route_options
def query(roadmap: Path, overrides: tuple[str, ...], **options: Any) -> None:
    """Find the cheapest path in ROADMAP.

    It leads from --start to --goal; without these, between the scenario's own points.
    """
    from .opened import open

    _answer(lambda: open(roadmap, overrides), **options)


@cli.command()
@click.argument("scenario")
@route_options
@SET
def plan(scenario: str, overrides: tuple[str, ...], **options: Any) -> None:
    """Find a route of SCENARIO without a roadmap.

    SCENARIO is a TOML file or the name of a shipped scenario. Each leg leaves when the last one arrives.
    """
    from .opened import open_scenario

    _answer(lambda: open_scenario(scenario, overrides), **options)


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
@click.option("--window-hours", type=float, metavar="H", help="Length of exported windows; 12 if not given.")
@click.option("--waypoints", type=int, metavar="N", help="The most waypoints in a goto list; 8 if not given.")
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
    from . import planner
    from .search.surfacing import Surfacing

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
    if as_json:
        _write_json(answer.as_dict())
    else:
        say(answer, error=not answer.new.found)
    if not answer.new.found:
        sys.exit(1)


def _check_together(front: bool, departures: bool, alone: bool, spacing: bool) -> None:
    """Raise UsageError if options of a route cannot be used together.

    `front`: --trade-off; `departures`: --depart-between or --arrive-by; `alone`: no option that needs one route;
    `spacing`: --every or --figure.
    """
    if front and (departures or not alone):
        raise click.UsageError(
            "--trade-off cannot be used with --output, --most-energy, --polish, --within, --seconds, --thin, "
            "--card, --window-hours, --waypoints, --arrival-radius, --depart-between and --arrive-by; leave one "
            "of them out"
        )
    if departures and not alone:
        raise click.UsageError(
            "--depart-between and --arrive-by cannot be used with --output, --most-energy, --polish, --within, "
            "--seconds, --thin, --card, --window-hours, --waypoints and --arrival-radius; set query.departure to "
            "the departure that they find"
        )
    if spacing and not departures:
        raise click.UsageError("--every and --figure need --depart-between or --arrive-by; add one of them")


def _answer(
    opened: "Callable[[], OpenedScenario]",
    *,
    start: Any,
    goal: Any,
    depart: str | None,
    outputs: tuple[Path, ...],
    most_energy: float | None,
    most_yos: int | None,
    most_hours: float | None,
    polish: bool,
    within: float | None,
    seconds: float | None,
    thin: float | None,
    as_card: bool,
    window_hours: float | None,
    waypoints: int | None,
    arrival_radius: float | None,
    front: bool,
    depart_between: tuple[str, str] | None,
    every: float | None,
    arrive_by: str | None,
    figure: Path | None,
    as_json: bool,
) -> None:
    """Print the answer of a roadmap or a scenario; exit code 1 if no path exists."""
    from .opened import split_outputs
    from .search.surfacing import Surfacing

    free = most_yos is None and most_hours is None
    rule = None if free else Surfacing(most_yos, most_hours)
    departures = depart_between is not None or arrive_by is not None
    answer: Any
    given = {"window_hours": window_hours, "most_waypoints": waypoints, "arrival_radius": arrival_radius}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    refines = within is not None or seconds is not None
    alone = not (outputs or polish or refines or options or as_card) and most_energy is None and thin is None
    spacing = every is not None or figure is not None
    _check_together(front, departures, alone, spacing)
    if departures and depart is not None:
        raise click.UsageError("--depart cannot be used with --depart-between or --arrive-by; leave it out")
    if front:
        corners = opened().trade_off(start, goal, depart=depart, surfacing=rule)
        answer, found = (corners, True) if corners.paths[0].found else (corners.paths[0], False)
    elif departures:
        ends: dict[str, Any] = {"start": start, "goal": goal, "surfacing": rule}
        answer = opened().when_to_leave(depart_between, every=every, arrive_by=arrive_by, figure=figure, **ends)
        found = answer.found
    else:
        split_outputs(outputs, refines)
        source = opened()
        options |= {"most_energy": most_energy, "polish": polish, "thin": thin, "surfacing": rule}
        options |= {"within": within, "seconds": seconds, "progress": lambda line: say(line, error=True)}
        path = source.query(start, goal, depart=depart, outputs=outputs, **options)
        for note in path.notes:
            say(f"note: {note}", error=True)
        answer, found = source.card(path) if as_card and path.found else path, path.found
    if as_json:
        _write_json(answer.as_dict())
    else:
        say(answer, error=not found)
    if not found:
        sys.exit(1)


@cli.command()
@ROADMAP
@click.option(
    "--diff", "other", type=FILE, metavar="OTHER", help="Instead, show what differs from another roadmap."
)
@JSON
def info(roadmap: Path, other: Path | None, as_json: bool) -> None:
    """Show what ROADMAP holds."""
    from . import planner

    answer = planner.info(roadmap) if other is None else planner.differ(roadmap, other)
    if as_json:
        _write_json(answer.as_dict())
    else:
        say(answer)


@cli.command()
@ROADMAP
@ELSEWHERE
@click.option(
    "--sample",
    type=int,
    default=200,
    show_default=True,
    help="The number of edges to fly with the integrator DOP853; 0 for all.",
)
@JSON
def verify(roadmap: Path, overrides: tuple[str, ...], sample: int, as_json: bool) -> None:
    """Fly the legs of ROADMAP again.

    A sample of them is flown by another integrator. Exit code 1 if a leg differs.
    """
    from . import planner

    verification = planner.verify(roadmap, sample, overrides=overrides)
    if as_json:
        _write_json(verification.as_dict())
    else:
        say(verification)
    if not verification.holds:
        sys.exit(1)


@cli.command()
@ROADMAP
@ELSEWHERE
@click.argument("paths", nargs=-1, type=FILE)
@click.option(
    "-o", "--output", required=True, type=FILE, help="PNG, SVG or PDF; HTML for an interactive page of a route."
)
@click.option("--depth", "depths", multiple=True, type=float, help="Depth [m] of a map; up to 4 for one route.")
@click.option("--chart", is_flag=True, help="Draw the route by time on one map, with depth, heading and speeds.")
@click.option(
    "--fronts", type=float, metavar="HOURS", help="Draw a chart with lines of what can be reached every HOURS."
)
def plot(
    roadmap: Path,
    overrides: tuple[str, ...],
    paths: tuple[Path, ...],
    output: Path,
    depths: tuple[float, ...],
    chart: bool,
    fronts: float | None,
) -> None:
    """Draw the route in PATHS, or ROADMAP.

    PATHS are JSON files from `query`. One route is drawn over ROADMAP's current, two to four are drawn side by
    side; without PATHS, the roadmap is drawn.
    """
    from . import planner

    if len(paths) > 1:
        if chart or fronts is not None or len(depths) > 1:
            raise click.UsageError(
                "several routes need one --depth, and no --chart or --fronts; leave these out, or give one route"
            )
        planner.plot_routes(roadmap, paths, output, depths[0] if depths else None, overrides=overrides)
    else:
        path = paths[0] if paths else None
        planner.plot(roadmap, path, output, depths or None, chart=chart, fronts=fronts, overrides=overrides)
    say(output)


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
    from . import planner

    description = planner.describe(currents, [(*place, None)[:4] for place in at], dict(names))
    if as_json:
        _write_json(description.as_dict())
    else:
        say(description)


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
    from .opened import open_either

    found = open_either(roadmap, overrides).score(route, start, depart=depart)
    if as_json:
        _write_json(found.as_dict())
    else:
        say(found, error=not found.flyable)
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
    from . import planner

    looked = planner.lint(files, waypoints)
    if as_json:
        _write_json([result.as_dict() for result in looked])
    else:
        say("\n".join(map(str, looked)))
    if any(result.faults for result in looked):
        sys.exit(1)


@cli.command()
@click.argument("scenario")
@SET
@click.option("--nodes", type=int, help="Nodes along the longest side of the finer grid; 101 in 2-D, 61 in 3-D.")
@click.option(
    "--dimensions", type=int, help="2: the mean current of a yo's depths; 3: all depths; 2 for long routes."
)
@JSON
def bound(
    scenario: str, overrides: tuple[str, ...], nodes: int | None, dimensions: int | None, as_json: bool
) -> None:
    """Find the least time that a route of SCENARIO can take, by a level set, with its error."""
    from . import planner

    found = planner.bound(
        scenario,
        overrides=overrides,
        nodes=nodes,
        dimensions=dimensions,
        progress=lambda line: say(f"bound: {line}", error=True),
    )
    if as_json:
        _write_json(found.as_dict())
    else:
        say(found)


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
    from . import planner

    for pairs in ("columns", "scales"):
        options[pairs] = dict(options[pairs])
    options["columns"] = {what: str(column) for what, column in options["columns"].items()}
    found = make(*places, output, **options)
    if as_json:
        _write_json(found.as_dict())
        return
    files = [output, planner.members_file(output)] if options["members"] else [output]
    say("\n".join([str(found), *(f"  file: {file}" for file in files)]))


@cli.command()
@click.argument("forecast", nargs=-1, required=True, type=FILE)
@NAME
@map_options
def assimilate(forecast: tuple[Path, ...], names: tuple[tuple[str, Any], ...], **options: Any) -> None:
    """Correct the currents of FORECAST by measurements.

    The output holds the corrected current and its standard deviation on the same grid, levels and times, and is a
    current file as any other.
    """
    from . import planner

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
    from . import planner

    _mapped(planner.map_currents, lon, lat, spacing, depth=depth or (0.0,), **options)


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
    from . import planner

    found = planner.calibrate(
        dives, output, preset=preset, columns={name: str(column) for name, column in columns}
    )
    if as_json:
        _write_json(found.as_dict())
    else:
        say(found)


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
    from . import planner

    found = planner.currents(
        dives, output, columns={name: str(column) for name, column in columns}, declination=declination,
        attack=attack, fix_error=fix_error, speed_error=speed_error, heading_error=heading_error,
    )  # fmt: skip
    if as_json:
        _write_json(found.as_dict())
    else:
        say(found)


@cli.command()
@click.option("--runs", type=int, help="The number of measurements of each figure; 5 if not given.")
@click.option("--quick", is_flag=True, help="Small problems, to check that everything runs.")
@click.option("--only", multiple=True, metavar="PART", help="Only these parts, or problems of the suite.")
@click.option("--suite", is_flag=True, help="Solve the named problems instead, by every method and baseline.")
@click.option("--ompl", type=FILE, help="With --suite: a folder for logs that OMPL's tools read.")
@click.option("--ceiling", type=FILE, help="A program to compare the integrator with.")
@click.option("--against", type=FILE, help="An older record: show what has changed since.")
@click.option("--json", "output", type=FILE, help="The record to write.")
def bench(
    runs: int | None,
    quick: bool,
    only: tuple[str, ...],
    suite: bool,
    ompl: Path | None,
    ceiling: Path | None,
    against: Path | None,
    output: Path | None,
) -> None:
    """Measure this machine, or the quality of routes.

    Let nothing else run meanwhile.
    """
    from . import planner

    if suite:
        unusable = {"--runs": runs, "--ceiling": ceiling, "--against": against}
        for name, value in unusable.items():
            if value is not None:
                raise click.UsageError(f"{name} does not go with --suite; leave one of them out")
        report = planner.suite(
            output,
            ompl=ompl,
            quick=quick,
            only=only,
            progress=lambda message: say(f"suite: {message}", error=True),
        )
        say(report)
        return
    if ompl is not None:
        raise click.UsageError("--ompl needs --suite; add it, or leave --ompl out")
    record, moved = planner.bench(
        output, against=against, runs=5 if runs is None else runs, quick=quick, only=only, ceiling=ceiling,
        progress=lambda figure: say(f"bench: {figure}", error=True),
    )  # fmt: skip
    say(record)
    if against is not None:
        say("\n".join(["moved beyond both spreads:", *(f"  {line}" for line in moved or ["nothing"])]))


@cli.command()
@click.argument("mission")
@click.option("--runs", type=int, required=True, help="The number of runs of each policy.")
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    type=FILE,
    help="A file to write: .json (table), .h5 (tracks), .png, .svg, .pdf, .html (plays a run); repeatable.",
)
@click.option("--processes", type=int, help="Processes that share the runs; one for each core if not given.")
@click.option("--scheduler", metavar="ADDRESS", help="Fly on a Dask cluster; local:N for N processes here.")
@SET
@click.option("--restart", is_flag=True, help="Discard the runs that a stopped campaign has kept.")
@click.option("--run", "number", type=int, default=0, show_default=True, help="The run that a page plays.")
@click.option("--policy", default="replan", show_default=True, help="The policy that a page plays.")
@JSON
def simulate(
    mission: str,
    runs: int,
    outputs: tuple[Path, ...],
    processes: int | None,
    scheduler: str | None,
    overrides: tuple[str, ...],
    restart: bool,
    number: int,
    policy: str,
    as_json: bool,
) -> None:
    """Fly MISSION many times, and compare how pilots plan.

    MISSION is a TOML file or the name of a shipped mission, such as box: a vehicle with errors flies in a true
    current that differs from the forecast. Runs are kept beside the first output until all are done: the same
    command continues a stopped campaign. --set takes keys of the mission and of its scenario.
    """
    from . import planner
    from .base.cores import usable_cores
    from .base.progress import reporter

    with reporter("simulate") as progress:
        campaign = planner.simulate(
            mission,
            runs,
            outputs,
            overrides=overrides,
            processes=usable_cores() if processes is None else processes,
            scheduler=scheduler,
            restart=restart,
            show=(number, policy),
            progress=progress,
        )
    if as_json:
        _write_json(campaign.as_dict())
    else:
        say("\n".join([str(campaign), *(f"  file: {output}" for output in outputs)]))


def main() -> None:
    """Run the command line.

    Exit codes: 0 done; 1 no path or a failed check; 2 unusable input; 3 an error of this program.
    """
    if hasattr(sys.stdout, "reconfigure"):
        # a name that is not UTF-8, or a letter that an old terminal does not have, is written as \\udcff
        sys.stdout.reconfigure(errors="backslashreplace")
    os.environ["MPLBACKEND"] = "agg"  # a notebook's own backend does not draw into files
    with stoppable():
        _run()


def _run() -> None:
    try:
        _check_environment()
        _show_warnings()
        cli(prog_name="glider-stream", standalone_mode=False)
    except InputError as error:
        _refuse(str(error))
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        place = context.command_path if context else "glider-stream"
        _refuse(f"{error.format_message().rstrip('.')}; see `{place} --help`")
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        if error.filename is None:
            silence(sys.stdout)  # errors of files have a name: this one is of standard output
        _refuse(f"{error.filename or 'standard output'} cannot be used: {reason}; name another")
    except MemoryError as error:
        _refuse(f"there is not enough memory ({error}); make the problem smaller")
    except (click.Abort, KeyboardInterrupt) as error:
        # click turns a KeyboardInterrupt into an Abort
        stopped = error.__cause__ if isinstance(error.__cause__, Stopped) else "stopped"
        say(f"glider-stream: {plain(str(stopped))}", error=True)
        sys.exit(STOPPED)
    except Exception as error:
        if os.environ.get(TRACE):
            raise
        what = " ".join(f"{type(error).__name__}: {error}".split())
        say(
            f"glider-stream: this is an error of the program, not of your input: {what}; "
            f"please report it, with the output that {TRACE}=1 in the environment gives",
            error=True,
        )
        sys.exit(3)


def _show_warnings() -> None:
    """Show warnings about input on one line, without the place in this program."""
    usual = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *rest: Any, **named: Any) -> None:
        if issubclass(category, InputWarning):
            say(f"glider-stream: warning: {message}", error=True)
        else:
            usual(message, category, *rest, **named)

    warnings.showwarning = show


def _check_environment() -> None:
    """Raise InputError for a bad NUMBA_NUM_THREADS, for which Numba itself shows a traceback at import."""
    threads = os.environ.get("NUMBA_NUM_THREADS", "1")
    fits = threads.isdecimal() and int(threads) > 0
    if not fits:
        raise InputError(f"the environment's NUMBA_NUM_THREADS must be a whole number above 0; got {threads!r}")


def _refuse(sentence: str) -> None:
    say(f"glider-stream: {plain(' '.join(sentence.split()))}", error=True)
    sys.exit(2)
