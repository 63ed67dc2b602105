"""The outputs of a simulated campaign: results, tracks, a figure, a page that plays a run."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from .base.output import check_output, replacing
from .base.settings import require
from .mission.campaign import Campaign
from .mission.replay import path_of
from .mission.run import Runner
from .mission.settings import Mission
from .search.path import placed

CHANGED = (
    "the mission's files hold other currents or another terrain than when its runs were flown; put the old files "
    "back and give the same command again: the runs are kept, or fly anew with --restart"
)
Show = tuple[int, str]
"""The run and the policy that a page plays."""


def check_outputs(outputs: Sequence[str | Path], mission: Mission, runs: int, show: Show) -> None:
    """Raise InputError, before any run is flown, if an output cannot be written."""
    for output in outputs:
        path = Path(output)
        known = ", ".join(_WRITERS)
        ending = path.suffix.lower()
        require(
            ending in _WRITERS, f"the output {path} must end in one of: {known}; got {ending or 'no ending'!r}"
        )
        check_output(path)
    require(
        len({Path(output).resolve() for output in outputs}) == len(outputs),
        "an output is named twice; leave one out",
    )
    number, policy = show
    if any(Path(output).suffix.lower() == ".html" for output in outputs):
        require(0 <= number < runs, f"the page's run must be from 0 to {runs - 1}; got {number}")
        choices = ", ".join(mission.pilot.policies)
        require(policy in mission.pilot.policies, f"the page's policy must be one of {choices}; got {policy}")


def write_campaign(campaign: Campaign, outputs: Sequence[str | Path], show: Show) -> None:
    """Write a campaign to each output, in the form of its ending.

    InputError if the mission's files hold other currents or another terrain than when the runs were flown.
    """
    if not outputs:
        return
    runner = Runner(campaign.mission)
    require(not campaign.waters or runner.worlds.sha256 == campaign.waters, CHANGED)
    for output in outputs:
        _WRITERS[Path(output).suffix.lower()](campaign, runner, Path(output), show)


def _write_json(campaign: Campaign, runner: Runner, path: Path, show: Show) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(campaign.as_dict(), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _write_tracks(campaign: Campaign, runner: Runner, path: Path, show: Show) -> None:
    from .mission.tracks import write_tracks

    write_tracks(campaign, runner.worlds.true, path)


def _write_figure(campaign: Campaign, runner: Runner, path: Path, show: Show) -> None:
    from .plot import save_figure
    from .plot.campaign import plot_campaign

    mission, problem = campaign.mission, runner.worlds.true
    runs = {name: [run[n] for run in campaign.runs] for n, name in enumerate(mission.pilot.policies)}
    depth = float(-0.5 * (problem.lo[2] + problem.hi[2]))
    save_figure(plot_campaign(problem, runs, mission.arrival.radius_m, depth, mission.title), path)


def _write_page(campaign: Campaign, runner: Runner, path: Path, show: Show) -> None:
    from .plot.page import Replay, save_page
    from .roadmap.builder import node_positions

    number, policy = show
    problem = runner.worlds.true
    flight = runner.flight(policy, number, runner.office(number))
    outcome = flight.outcome
    require(len(flight.phases) > 0, f"run {number} of {policy} has not moved ({outcome.ended}); show another")
    told = (
        f"run {number}, {policy}: {outcome.ended} after {outcome.time / 60:,.0f} min, "
        f"surfacings {outcome.surfacings}, plans {outcome.plans}, failed calls {outcome.failed}"
    )
    plans = [(since, np.asarray(plan.line)) for since, plan in flight.plans]
    flow, terrain = problem.evaluator.flow, problem.evaluator.terrain
    path_flown = placed(path_of(flight, problem), problem)
    words = campaign.mission.title, Replay(told, plans)
    save_page(path, flow, terrain, problem, node_positions(problem), path_flown, title=words[0], replay=words[1])


_WRITERS: dict[str, Callable[[Campaign, Runner, Path, Show], None]] = {
    ".json": _write_json,
    ".h5": _write_tracks,
    ".png": _write_figure,
    ".svg": _write_figure,
    ".pdf": _write_figure,
    ".html": _write_page,
}
"""The writer of each ending of an output."""
