"""Commands that make, check and draw roadmaps."""

import sys
from pathlib import Path
from typing import Any

import click

from ..base.terminal import say
from .answers import show
from .group import cli
from .options import ELSEWHERE, FILE, JSON, ROADMAP, SET


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
    from .. import planner
    from ..base.progress import reporter

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
            road = planner.build_opened(scenario, output, progress=progress, **run)
            dense = road.density()
            done, empty = f"{road}\n  dense:  {dense}", road.why_no_edges() or dense.warning
    say(done)
    if empty:
        say(f"note: {empty}", error=True)


@cli.command()
@click.argument("parts", nargs=-1, required=True, type=FILE)
@click.option("-o", "--output", required=True, type=FILE, help="The roadmap file to write.")
def merge(parts: tuple[Path, ...], output: Path) -> None:
    """Merge PARTS into one roadmap.

    PARTS are the files that `build --shard` wrote.
    """
    from .. import planner

    road = planner.merge(parts, output)
    say(road)
    if empty := planner.why_no_edges(road):
        say(f"note: {empty}", error=True)


@cli.command()
@ROADMAP
@click.option(
    "--diff", "other", type=FILE, metavar="OTHER", help="Instead, show what differs from another roadmap."
)
@JSON
def info(roadmap: Path, other: Path | None, as_json: bool) -> None:
    """Show what ROADMAP holds."""
    from .. import planner
    from ..opened import open

    answer = open(roadmap) if other is None else planner.differ(roadmap, other)
    show(answer, as_json)


@cli.command()
@ROADMAP
@ELSEWHERE
@click.option(
    "--sample",
    type=int,
    help="The number of edges to fly with the integrator DOP853, 200 if not given; 0 for all. In a roadmap of "
    "more than two million edges, only these are looked at.",
)
@JSON
def verify(roadmap: Path, overrides: tuple[str, ...], sample: int | None, as_json: bool) -> None:
    """Fly the legs of ROADMAP again.

    A sample of them is flown by another integrator. Exit code 1 if a leg differs.
    """
    from .. import planner

    verification = planner.verify(roadmap, sample, overrides=overrides)
    show(verification, as_json)
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
    """Draw the routes in PATHS, or ROADMAP.

    PATHS are JSON files from `query` or `plan`. One route is drawn over ROADMAP's current, two to four are drawn
    side by side; without PATHS, the roadmap is drawn. ROADMAP may also be a scenario, or it is left out: then the
    first of PATHS says what it was planned with.
    """
    from .. import planner
    from ..opened import is_plan

    if is_plan(roadmap):
        paths = (roadmap, *paths)
    if len(paths) > 1:
        if chart or fronts is not None or len(depths) > 1:
            raise click.UsageError(
                "several routes need one --depth, and no --chart or --fronts; leave these out, or give one route"
            )
        planner.plot_routes(roadmap, paths, output, depths[0] if depths else None, overrides=overrides)
    else:
        path = paths[0] if paths else None
        planner.plot(roadmap, path, output, depths or None, chart=chart, fronts=fronts, overrides=overrides)
