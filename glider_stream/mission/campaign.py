"""Campaigns: many runs of a mission, in parallel, that survive a kill; the table of its policies."""

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from importlib.metadata import version
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from ..base.cores import usable_cores
from ..base.errors import InputError, Stopped
from ..base.lock import locked
from ..base.output import check_output
from ..base.settings import require
from ..base.threads import threads
from ..jobs.cluster import check_software, scheduler, software
from ..kernels.cache import KERNEL_DIGEST
from ..roadmap.problem import Problem
from .journal import Run, RunJournal
from .run import Outcome, Runner
from .settings import Mission
from .statistics import REFERENCE, Row, row_of
from .world import waters_sha256

FORMAT = "glider-stream/campaign"
CHECKPOINT = 30.0
"""After this many seconds the disk is asked again to keep the runs that are done."""
MOST_RUNS = 1_000_000
CHANGED = (
    "a worker reads other currents or another terrain from the mission's files than the campaign began with; "
    "give all machines the same files, leave them as they are, and start again with --restart"
)


@dataclass(frozen=True)
class Progress:
    """The progress of a campaign: runs that are done, all runs, seconds since the begin, runs done before."""

    done: int
    total: int
    seconds: float
    before: int

    def __str__(self) -> str:
        rate = (self.done - self.before) / max(self.seconds, 1e-9)
        left = (self.total - self.done) / rate if rate else 0.0
        return f"{self.done:,} of {self.total:,} runs, {rate:.2g} runs/s, {left:,.0f} s left"


@dataclass(frozen=True)
class Campaign:
    """The runs of a mission, sorted by number, each with one outcome for each policy.

    `forecast` describes how the first run's forecast differs from the true current. `waters` is the digest of
    what was read from files.
    """

    mission: Mission
    runs: tuple[tuple[Outcome, ...], ...]
    forecast: str
    waters: str = ""

    @property
    def rows(self) -> list[Row]:
        """The table of the policies."""
        by_policy = [{outcome.policy: outcome for outcome in run} for run in self.runs]
        return [row_of(policy, by_policy) for policy in self.mission.pilot.policies]

    def as_dict(self) -> dict[str, Any]:
        """Return the results for JSON: the mission, the table, and each run without its track."""
        return {
            "format": FORMAT,
            "format_version": 1,
            "software_version": version("glider-stream"),
            "title": self.mission.title,
            "mission": self.mission.text,
            "forecast": self.forecast,
            "intervals": "95 %: Wilson for shares; bootstrap percentiles for medians",
            "policies": [row.as_dict() for row in self.rows],
            "runs": [[_scalars(outcome) for outcome in run] for run in self.runs],
        }

    def __str__(self) -> str:
        count = len(self.runs)
        title = f"{self.mission.title}: {count:,} run{'s' * (count != 1)}; run 0: {self.forecast}"
        return "\n".join([title, *_lines(self.rows), *_ends(self.rows)])


def _scalars(outcome: Outcome) -> dict[str, Any]:
    planned = outcome.planned if outcome.planned == outcome.planned else None
    return {
        "policy": outcome.policy,
        "number": outcome.number,
        "ended": outcome.ended,
        "time_s": outcome.time,
        "energy_j": outcome.energy,
        "surfacings": outcome.surfacings,
        "failed_calls": outcome.failed,
        "plans": outcome.plans,
        "calls_without_plan": outcome.without,
        "off_m": outcome.off,
        "planned_s": planned,
    }


def _lines(rows: list[Row]) -> list[str]:
    """Return the table for people; medians are of the runs that arrive, intervals hold with 95 %."""
    known = [row.time.value for row in rows if row.time.value == row.time.value]
    unit, name = (3600.0, "h") if max(known, default=0.0) > 3 * 3600 else (60.0, "min")
    titles = ["policy", "arrived (%)", f"time ({name})", "energy (kJ)", "surfacings", f"time / {REFERENCE}"]
    table = [titles]
    for row in rows:
        table.append(
            [
                row.policy,
                row.arrived.told(".0f", 100.0),
                row.time.told(".1f", 1.0 / unit),
                row.energy.told(".1f", 1e-3),
                row.surfacings.told(".0f"),
                row.over_reference.told(".3f"),
            ]
        )
    widths = [max(len(line[n]) for line in table) for n in range(len(titles))]
    return [
        "  " + "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip()
        for line in table
    ]


def _ends(rows: list[Row]) -> list[str]:
    """Return how the runs of each policy ended that did not arrive."""
    found = []
    for row in rows:
        others = [f"{count} {end}" for end, count in row.ends.items() if end != "arrived"]
        if others:
            found.append(f"  {row.policy}: {', '.join(others)}")
    return found


def simulate(
    mission: Mission,
    runs: int,
    *,
    processes: int = 1,
    address: str | None = None,
    keep: Path | None = None,
    restart: bool = False,
    progress: Callable[[Progress], None] = lambda progress: None,
) -> Campaign:
    """Fly `runs` runs of a mission and return them; neither processes nor a kill change a bit of them.

    `processes` of this machine share the runs, or the workers of a Dask scheduler at an `address`. `keep`: the
    results' file, beside which runs are kept until all are done; a later call with the same mission continues
    from there, unless it must `restart`.
    """
    require(1 <= runs <= MOST_RUNS, f"`runs` must be from 1 to {MOST_RUNS:,}; got {runs:,}")
    most = 4 * usable_cores()
    fits = 1 <= processes <= most
    require(fits, f"`processes` must be from 1 to {most} on this machine, four for each core; got {processes}")
    runner = Runner(mission)
    first = runner.worlds.world(0)
    forecast = str(first)
    if keep is None:
        found = list(_found(runner, list(range(runs)), processes, address, progress, runs))
        return _campaign(runner, found, forecast)
    check_output(keep)
    target = keep.resolve()
    identity = identity_of(mission, (first.true, first.forecast))
    kept, path = "", target.with_name(f"{target.name}.journal")
    with locked(target):
        try:
            with RunJournal(path, identity, mission.pilot.policies, restart, CHECKPOINT) as journal:
                try:
                    waiting = [number for number in range(runs) if number not in journal.done]
                    for run in _found(runner, waiting, processes, address, progress, runs):
                        journal.append(run)
                finally:
                    kept = f"{len(journal.done):,} of {runs:,} runs are kept in {path.name}"
                found = [run for run in journal.records() if run[0].number < runs]
        except KeyboardInterrupt:
            raise Stopped(f"stopped; {kept}: give the same command again to continue") from None
        except OSError as error:
            reason = (error.strerror or "it cannot be written").lower()
            cure = f"make room on its disk; {kept}: give the same command again to continue"
            raise InputError(f"the journal {path} cannot be written: {reason}; {cure}") from None
    return _campaign(runner, found, forecast)


def identity_of(mission: Mission, waters: Sequence[Problem]) -> dict[str, str]:
    """Return what tells a campaign from any other; `waters` are its problems: what is true, and run 0's forecast.

    The mission's text names the files of currents and of closed areas, but not what they hold.
    """
    return {
        "mission": mission.text,
        "waters": waters_sha256(waters),
        "software": version("glider-stream"),
        "kernels": KERNEL_DIGEST,
    }


def forget(keep: Path) -> None:
    """Remove the journal of a campaign whose results are written."""
    target = keep.resolve()
    target.with_name(f"{target.name}.journal").unlink(missing_ok=True)


def _campaign(runner: Runner, runs: list[Run], forecast: str) -> Campaign:
    ordered = sorted(runs, key=lambda run: run[0].number)
    return Campaign(runner.mission, tuple(tuple(run) for run in ordered), forecast, runner.worlds.sha256)


def _found(
    runner: Runner,
    waiting: list[int],
    processes: int,
    address: str | None,
    progress: Callable[[Progress], None],
    total: int,
) -> Iterator[Run]:
    """Yield runs in the order in which they are done."""
    began, before = time.monotonic(), total - len(waiting)
    if address is not None:
        runs = _on_cluster(_work_of(runner), waiting, address)
    elif processes == 1 or len(waiting) < 2:
        runs = map(runner.run, waiting)
    else:
        runs = _in_processes(_work_of(runner), waiting, processes)
    for done, run in enumerate(runs, before + 1):
        yield run
        progress(Progress(done, total, time.monotonic() - began, before))


@dataclass(frozen=True)
class Work:
    """What a worker needs to fly runs: the mission, the digest of the waters that it must read, the sender."""

    mission: Mission
    waters: str
    software: dict[str, str]


def _work_of(runner: Runner) -> Work:
    return Work(runner.mission, runner.worlds.sha256, software())


_RUNNERS: dict[tuple[str, str], Runner] = {}
"""The runner of this process, by its mission's text and its waters: a worker reads the water once."""
_ONE_AT_A_TIME = Lock()
"""Kernels use all threads of a worker's process, so several Dask threads of a worker take turns."""


def run_here(work: Work, number: int) -> Run:
    """Return a run of a mission; this is called in a worker.

    InputError if its files hold other currents or other terrain here than where the campaign began.
    """
    with _ONE_AT_A_TIME, threads(1):
        key = work.mission.text, work.waters
        if key not in _RUNNERS:
            runner = Runner(work.mission)
            require(runner.worlds.sha256 == work.waters, CHANGED)
            _RUNNERS.clear()
            _RUNNERS[key] = runner
        return _RUNNERS[key].run(number)


def run_there(work: Work, number: int) -> Run:
    """Return a run of a mission, in a worker of a cluster whose software must be the sender's."""
    check_software(work.software)
    return run_here(work, number)


def _begin_worker() -> None:
    """Let only the first process answer Ctrl-C, which lets this one finish its run; end when it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when its parent has ended; a pool's processes would wait for work for ever."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _in_processes(work: Work, waiting: list[int], processes: int) -> Iterator[Run]:
    # a forked process would inherit the locks of threads that it does not have
    pool = ProcessPoolExecutor(min(processes, len(waiting)), get_context("spawn"), _begin_worker)
    try:
        for future in as_completed([pool.submit(run_here, work, number) for number in waiting]):
            yield future.result()
    except BrokenProcessPool:
        cure = "give the same command again to continue, with fewer processes if memory was short"
        raise InputError(f"a process of the campaign was killed; {cure}") from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _on_cluster(work: Work, waiting: list[int], address: str) -> Iterator[Run]:
    with scheduler(address) as cluster:
        yield from cluster.each(run_there, work, waiting)
