"""The command for answers with confidence: routes in an ensemble of currents."""

import sys
from pathlib import Path
from typing import Any

import click

from ..base.terminal import say
from .answers import show, show_json
from .group import cli
from .options import FILE, JSON, SET, Percentage


def _best(text: str) -> float | str:
    """Return a share from a percentage, or the text."""
    return Percentage().convert(text, None, None) if text.strip().endswith("%") else text.strip()


@cli.command()
@click.argument("mission")
@click.argument("routes", nargs=-1, type=FILE)
@click.option(
    "--members", multiple=True, type=FILE, help="A file of members, or one of several files; repeatable."
)
@click.option("--draws", type=int, metavar="N", help="Instead, N draws of the mission's forecast error.")
@click.option("--first", type=int, default=0, show_default=True, help="The number of the first draw.")
@click.option(
    "--best",
    default="90%",
    show_default=True,
    metavar="WHAT",
    help="90%: the earliest time by which so many arrive; mean: the least mean time; by: most arrivals --by.",
)
@click.option("--by", type=float, metavar="HOURS", help="With --best by: the time to arrive by.")
@click.option("--replanned", is_flag=True, help="Compare ways to plan anew at each call.")
@click.option(
    "--reach", is_flag=True, help="Also find the share of the members in which each place can be reached."
)
@click.option(
    "-o", "--output", "outputs", multiple=True, type=FILE, help="A file for the chosen route, as in `query`."
)
@click.option("--figure", type=FILE, help="A figure of tracks and arrivals: PNG, SVG or PDF.")
@click.option("--card", "as_card", is_flag=True, help="Print the card of the chosen route, with its confidence.")
@SET
@JSON
def confidence(
    mission: str,
    routes: tuple[Path, ...],
    best: str,
    by: float | None,
    as_card: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Say how often, and by when, ROUTES arrive.

    They are flown in all members of an ensemble of currents, as the vehicle of MISSION flies. Without ROUTES,
    candidates are searched; the best of them is chosen. Exit code 1 if none arrives as asked.
    """
    from .. import planner
    from ..base.progress import reporter

    asked = _best(best)
    seconds = None if by is None else 3600.0 * by
    with reporter("confidence") as progress:
        answer, notes = planner.confidence(mission, routes, best=asked, by=seconds, progress=progress, **options)
    for note in notes:
        say(f"note: {note}", error=True)
    path = answer.path if as_card else None
    if as_json and path is None:
        show_json(answer.as_dict())
    elif not as_json:
        say(answer, error=not answer.found)
    if path is not None:
        from ..pilot.card import card

        show(card(path, answer.ensemble.forecast), as_json)
    if not answer.found:
        sys.exit(1)
