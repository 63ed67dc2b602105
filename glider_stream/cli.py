"""The command line. Each command's body is one library call; nothing heavy is loaded before it is needed."""

import json
import os
import sys
from pathlib import Path
from typing import Any

import click

from .errors import InputError


def place(text: str, texts: int = 0) -> tuple[Any, ...]:
    """Three numbers with commas between, then up to `texts` texts."""
    parts = text.split(",")
    try:
        numbers = tuple(float(part) for part in parts[:3])
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or len(parts) > 3 + texts:
        raise click.BadParameter(f"{text!r} is not three numbers with commas between, such as 100,-50,-20")
    return (*numbers, *parts[3:])


def place_and_time(text: str) -> tuple[Any, ...]:
    """Three numbers, then a time if one is given."""
    return place(text, texts=1)


def _write_json(value: Any) -> None:
    click.echo(json.dumps(value, indent=1))


FILE = click.Path(path_type=Path)
JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON on standard output.")
ROADMAP = click.argument("roadmap", type=FILE)


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False)
@click.version_option(package_name="glider-stream")
def cli() -> None:
    """Plan underwater glider routes in ocean currents."""


@cli.command()
@click.argument("scenario")
@click.option("-o", "--output", required=True, type=FILE, help="The roadmap file to write.")
@click.option("--threads", type=int, help="Threads to use; all cores if not given.")
@click.option("--set", "overrides", multiple=True, metavar="SECTION.KEY=VALUE", help="Override a key.")
def build(scenario: str, output: Path, threads: int | None, overrides: tuple[str, ...]) -> None:
    """Build the roadmap of SCENARIO: a TOML file, or the name of a shipped one."""
    from . import planner
    from .progress import reporter

    with reporter("build") as progress:
        roadmap = planner.build(scenario, output, threads=threads, overrides=overrides, progress=progress)
    click.echo(f"{roadmap}\n  file:   {output}")


@cli.command()
@ROADMAP
@click.option("--start", type=place, metavar="X,Y,Z", help="Metres, z upward; LON,LAT,DEPTH if geographic.")
@click.option("--goal", type=place, metavar="X,Y,Z", help="As --start.")
@click.option("-o", "--output", "outputs", multiple=True, type=FILE, help="A route file to write.")
def query(roadmap: Path, start: Any, goal: Any, outputs: tuple[Path, ...]) -> None:
    """Find the cheapest path in ROADMAP; without --start and --goal, between the scenario's own."""
    from . import planner

    path = planner.query(roadmap, start, goal, outputs)
    click.echo(path, err=not path.found)
    if not path.found:
        sys.exit(1)


@cli.command()
@ROADMAP
@JSON
def info(roadmap: Path, as_json: bool) -> None:
    """Say what ROADMAP holds."""
    from . import planner

    road = planner.info(roadmap)
    if as_json:
        _write_json(road.as_dict())
    else:
        click.echo(road)


@cli.command()
@ROADMAP
@click.option("--sample", type=int, default=200, show_default=True, help="Edges for DOP853; 0 for all.")
@JSON
def verify(roadmap: Path, sample: int, as_json: bool) -> None:
    """Fly the legs of ROADMAP again, a sample by another integrator; exit code 1 if it is not what it says."""
    from . import planner

    verification = planner.verify(roadmap, sample)
    if as_json:
        _write_json(verification.as_dict())
    else:
        click.echo(verification)
    if not verification.holds:
        sys.exit(1)


@cli.command()
@ROADMAP
@click.argument("path", required=False, type=FILE)
@click.option("-o", "--output", required=True, type=FILE, help="PNG, SVG or PDF; HTML for a page of a route.")
@click.option("--depth", "depths", multiple=True, type=float, help="Depth [m] of a map; up to 4 for a route.")
@click.option("--chart", is_flag=True, help="The route by time on one map, its depth, heading and speeds.")
@click.option("--fronts", type=float, metavar="HOURS", help="As --chart, with what is reached every HOURS.")
def plot(
    roadmap: Path, path: Path | None, output: Path, depths: tuple[float, ...], chart: bool, fronts: float | None
) -> None:
    """Draw the route in PATH (JSON, from query) over ROADMAP's current; without PATH, the roadmap."""
    from . import planner

    planner.plot(roadmap, path, output, depths or None, chart=chart, fronts=fronts)
    click.echo(output)


@cli.command()
@click.argument("currents", nargs=-1, required=True, type=FILE)
@click.option(
    "--at",
    multiple=True,
    type=place_and_time,
    metavar="LON,LAT,DEPTH[,TIME]",
    help="Sample the current here.",
)
@JSON
def describe(currents: tuple[Path, ...], at: tuple[Any, ...], as_json: bool) -> None:
    """Say what the current files CURRENTS hold, and what the planner takes for what."""
    from . import planner

    description = planner.describe(currents, [(*place, None)[:4] for place in at])
    if as_json:
        _write_json(description.as_dict())
    else:
        click.echo(description)


@cli.command()
@click.option("--runs", type=int, help="How often each figure is measured; 5 if not given.")
@click.option("--quick", is_flag=True, help="Small problems: to see that all of it runs.")
@click.option("--only", multiple=True, metavar="PART", help="Parts, or problems of the suite; see README.")
@click.option("--suite", is_flag=True, help="Solve the named problems instead, by every method and baseline.")
@click.option("--ompl", type=FILE, help="With --suite: a folder for logs that OMPL's tools read.")
@click.option("--ceiling", type=FILE, help="A program to compare the integrator with.")
@click.option("--against", type=FILE, help="A record: say what has moved since.")
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
    """Measure what this machine does, or how good routes are; the full run must be alone on it."""
    from . import planner

    if suite:
        alien = {"--runs": runs, "--ceiling": ceiling, "--against": against}
        for name, value in alien.items():
            if value is not None:
                raise click.UsageError(f"{name} does not go with --suite; leave one of them out")
        report = planner.suite(
            output,
            ompl=ompl,
            quick=quick,
            only=only,
            progress=lambda said: click.echo(f"suite: {said}", err=True),
        )
        click.echo(report)
        return
    if ompl is not None:
        raise click.UsageError("--ompl goes with --suite alone; add that or leave it out")
    record, moved = planner.bench(
        output, against=against, runs=5 if runs is None else runs, quick=quick, only=only, ceiling=ceiling,
        progress=lambda figure: click.echo(f"bench: {figure}", err=True),
    )  # fmt: skip
    click.echo(record)
    if against is not None:
        click.echo("\n".join(["moved beyond both spreads:", *(f"  {line}" for line in moved or ["nothing"])]))


def main() -> None:
    """Run the command line: exit code 0 done, 1 the honest no, 2 unusable input."""
    try:
        _check_environment()
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
            # what is written to files names them: this is standard output, and what waits there goes nowhere
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _refuse(f"{error.filename or 'standard output'} cannot be used: {reason}; name another")
    except MemoryError as error:
        _refuse(f"there is not enough memory ({error}); make the problem smaller")
    except (click.Abort, KeyboardInterrupt):
        click.echo("glider-stream: stopped", err=True)
        sys.exit(130)


def _check_environment() -> None:
    """Numba answers a bad number of threads with a traceback, as soon as it is imported."""
    threads = os.environ.get("NUMBA_NUM_THREADS", "1")
    fits = threads.isdecimal() and int(threads) > 0
    if not fits:
        raise InputError(f"the environment's NUMBA_NUM_THREADS must be a whole number above 0; got {threads!r}")


def _refuse(sentence: str) -> None:
    click.echo(f"glider-stream: {' '.join(sentence.split())}", err=True)
    sys.exit(2)
