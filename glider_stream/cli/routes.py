"""Commands that find a route, and the least time that one can take."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..base.terminal import say
from .answers import show
from .group import cli
from .options import ELSEWHERE, FILE, JSON, ROADMAP, SET, WAYPOINTS, WINDOW_HOURS, Percentage, place

if TYPE_CHECKING:
    from ..opened import OpenedScenario


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
    WINDOW_HOURS,
    WAYPOINTS,
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
    from ..opened import open

    _answer(lambda: open(roadmap, overrides), **options)


@cli.command()
@click.argument("scenario")
@route_options
@SET
def plan(scenario: str, overrides: tuple[str, ...], **options: Any) -> None:
    """Find a route of SCENARIO without a roadmap.

    SCENARIO is a TOML file or the name of a shipped scenario. Each leg leaves when the last one arrives.
    """
    from ..opened import open_scenario

    _answer(lambda: open_scenario(scenario, overrides), **options)


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
    most_yos: int | None,
    most_hours: float | None,
    as_card: bool,
    front: bool,
    depart_between: tuple[str, str] | None,
    every: float | None,
    arrive_by: str | None,
    figure: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Print the answer of a roadmap or a scenario; exit code 1 if no path exists."""
    from ..search.surfacing import Surfacing

    options["most_waypoints"] = options.pop("waypoints")
    free = most_yos is None and most_hours is None
    options["surfacing"] = None if free else Surfacing(most_yos, most_hours)
    ends = {name: options.pop(name) for name in ("start", "goal", "depart", "surfacing")}
    given = {name: value for name, value in options.items() if value is not None and value is not False}
    if not given["outputs"]:
        del given["outputs"]
    departures = depart_between is not None or arrive_by is not None
    spacing = every is not None or figure is not None
    _check_together(front, departures, alone=not (given or as_card), spacing=spacing)
    answer: Any
    if front:
        corners = opened().trade_off(**ends)
        found = corners.paths[0].found
        answer = corners if found else corners.paths[0]
    elif departures:
        if ends.pop("depart") is not None:
            raise click.UsageError("--depart cannot be used with --depart-between or --arrive-by; leave it out")
        answer = opened().when_to_leave(depart_between, every=every, arrive_by=arrive_by, figure=figure, **ends)
        found = answer.found
    else:
        answer, found = _route(opened, as_card, ends | given)
    show(answer, as_json, error=not found)
    if not found:
        sys.exit(1)


def _route(opened: "Callable[[], OpenedScenario]", as_card: bool, given: dict[str, Any]) -> tuple[Any, bool]:
    """Return one route, or its card, and whether it was found."""
    from ..opened import split_outputs

    refines = "within" in given or "seconds" in given
    split_outputs(given.get("outputs", ()), refines)  # before the file is read
    source = opened()
    path = source.query(**given, progress=lambda line: say(line, error=True))
    for note in path.notes:
        say(f"note: {note}", error=True)
    return source.card(path) if as_card and path.found else path, path.found


@cli.command()
@click.argument("scenario")
@SET
@click.option("--nodes", type=int, help="Nodes along the longest side of the finer grid; 101 in 2-D, 61 in 3-D.")
@click.option(
    "--dimensions", type=int, help="2: the mean current of a yo's depths; 3: all depths; 2 for long routes."
)
@click.option(
    "--any-depth", is_flag=True, help="In 2-D, the current of whichever depth is best: a bound, no estimate."
)
@JSON
def bound(
    scenario: str,
    overrides: tuple[str, ...],
    nodes: int | None,
    dimensions: int | None,
    any_depth: bool,
    as_json: bool,
) -> None:
    """Find the least time that a route of SCENARIO can take, by a level set, with its error."""
    from .. import planner
    from ..base.progress import reporter

    with reporter("bound") as progress:
        found = planner.bound(
            scenario,
            overrides=overrides,
            nodes=nodes,
            dimensions=dimensions,
            any_depth=any_depth,
            progress=progress,
        )
    show(found, as_json)
