"""Commands that measure: this machine, the quality of routes, and missions simulated."""

from pathlib import Path

import click

from ..base.terminal import say
from .answers import show_json
from .group import cli
from .options import FILE, JSON, SET


@cli.command()
@click.option("--runs", type=int, help="The number of measurements of each figure; 5 if not given.")
@click.option("--quick", is_flag=True, help="Small problems, to check that everything runs.")
@click.option("--only", multiple=True, metavar="PART", help="Only these parts, or problems of the suite.")
@click.option("--suite", is_flag=True, help="Solve the named problems instead, by every method and baseline.")
@click.option("--ompl", type=FILE, help="With --suite: a folder for logs that OMPL's tools read.")
@click.option("--ceiling", type=FILE, help="A program to compare the integrator with.")
@click.option("--currents", type=FILE, help="A file of currents for `ionian`: measure its legs too.")
@click.option("--against", type=FILE, help="An older record: show what has changed since.")
@click.option("--json", "output", type=FILE, help="The record to write.")
def bench(
    runs: int | None,
    quick: bool,
    only: tuple[str, ...],
    suite: bool,
    ompl: Path | None,
    ceiling: Path | None,
    currents: Path | None,
    against: Path | None,
    output: Path | None,
) -> None:
    """Measure this machine, or the quality of routes.

    Let nothing else run meanwhile.
    """
    from .. import planner

    if suite:
        unusable = {"--runs": runs, "--ceiling": ceiling, "--currents": currents, "--against": against}
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
        currents=currents, progress=lambda figure: say(f"bench: {figure}", error=True),
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
    from .. import planner
    from ..base.cores import usable_cores
    from ..base.progress import reporter

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
        show_json(campaign.as_dict())
    else:
        say(campaign)
