"""Peers beside this project: each in its own environment, on the same problem, in the same run; one record.

    python benchmarks/peers/run.py --folder ../peers CURRENTS.nc -o benchmarks/records/peers.json

CURRENTS.nc is the Copernicus Marine file of `data/ionian.toml`. Environments, problems and answers are kept in
`--folder`, which must not be in this project; what is there already is not made again, so a run that was ended
goes on where it was. `--again NAME` forgets a peer's answers, or a problem's; `--again all` all of them; the
environments stay. A peer that cannot be installed or that fails becomes a row with its own message, and is asked
again by the next run. `--table docs/peers.md` writes the document's tables; `--against OLD.json` says which
ratios moved.
Every script beside this one has what a user of the peer writes; PEERS names them.
"""

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import time
import venv
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parents[1]
sys.path.insert(0, str(HERE.parent))

import compare
import numpy as np
import problems
import table
from record import keep, machine

LONGEST = 1800.0
"""A peer that has not answered after this time [s] has failed."""
ALL = "all"


@dataclass(frozen=True)
class Peer:
    """A row: its name, what pip installs, its script and its settings, its problem, what it is and can do."""

    name: str
    packages: tuple[str, ...]
    script: str
    problem: str
    what: str
    can: str
    settings: dict[str, Any] = field(default_factory=dict)


READS = ("h5netcdf", "h5py")
HALEM = ("halem==1.0.3", "numpy<2", "xarray", *READS)
OURS = ("--editable", f"{PROJECT}[ocean]")
OMPL = ("ompl==1.7.0", *OURS)
SECONDS = 5.0
"""The processor time [s] that OMPL's planners have."""
PEERS = (
    Peer(
        "glider-stream", OURS, "drift_glider_stream.py", "drift", "this project",
        "legs of gliders in a local frame; drift is a leg without a glide",
    ),
    Peer(
        "Parcels 4", ("parcels==4.0.2", "h5netcdf"), "drift_parcels4.py", "drift",
        "Lagrangian tracking, NumPy over all particles", "kernels written in Python, many grids; no planning",
    ),
    Peer(
        "Parcels 3", ("parcels==3.1.4", *READS), "drift_parcels3.py", "drift",
        "Lagrangian tracking, kernels compiled as C", "kernels in a part of Python, many grids; no planning",
    ),
    Peer(
        "OpenDrift", ("opendrift==1.14.12",), "drift_opendrift.py", "drift",
        "trajectories of oil, plankton, ships, people", "many models and readers, stranding, waves; no planning",
    ),
    Peer(
        "OceanTracker", ("oceantracker==0.5.3.9", "exceptiongroup", *READS), "drift_oceantracker.py", "drift",
        "Lagrangian tracking, compiled by Numba", "unstructured grids, statistics on the fly; no planning",
    ),
    *(
        peer
        for problem in problems.SURFACE
        for peer in (
            Peer(
                "glider-stream", OURS, "route_glider_stream.py", problem, "this project",
                "routes of gliders in three dimensions, the clock running, exact legs, polished",
            ),
            Peer(
                "HALEM", HALEM, "route_halem.py", problem, "routes of ships in tidal currents",
                "currents that change, water depths, several speeds, cost and emissions; the surface alone",
            ),
            Peer(
                "PolarRoute", ("polar-route==1.1.11", *READS), "route_polarroute.py", problem,
                "routes of ships in polar seas",
                "sea ice, currents that stay, smoothed routes; the surface alone",
            ),
            Peer(
                "hj_reachability", ("hj-reachability==0.7.0", "scipy"), "route_level_set.py", problem,
                "level sets on JAX", "the least time of any route; no route",
            ),
        )
    ),
    *(
        Peer(name, packages, script, problem, what, can)
        for problem in problems.LEGS
        for name, packages, script, what, can in (
            (
                "glider-stream", OURS, "legs_glider_stream.py", "this project", "roadmaps, polished routes",
            ),
            (
                "FMT*", OURS, "legs_fmt_star.py", "its paper, in `evaluation/fmt_star.py`",
                "one query; steers each pair once at most",
            ),
            (
                "FMT*, the paper's steering", OURS, "legs_fmt_star_line.py", "the same, 16 controls on the line",
                "legs that end up to 5 m short",
            ),
            (
                "VF-RRT", OURS, "legs_vf_rrt.py", "its paper, in `evaluation/vector_field_rrt.py`",
                "a first route; does not better it",
            ),
            (
                "VF-RRT, the paper's steering", OURS, "legs_vf_rrt_line.py", "the same, 16 controls on the line",
                "legs that end up to 5 m short",
            ),
        )
    ),
    *(
        Peer(name, OMPL, script, problem, "OMPL's, by its bindings", can, settings | {"seconds": SECONDS})
        for problem in problems.LEGS
        for name, script, can, settings in (
            (
                "OMPL FMT", "legs_ompl.py", "the shortest way of our legs; their times are told after",
                {"planner": "FMT", "settings": {"setNumSamples": 300}},
            ),
            (
                "OMPL RRT*", "legs_ompl.py", "our legs, costs that do not change with time",
                {"planner": "RRTstar", "settings": {}},
            ),
            (
                "OMPL RRT#", "legs_ompl.py", "our legs, costs that do not change with time",
                {"planner": "RRTsharp", "settings": {}},
            ),
            (
                "OMPL BIT*", "legs_ompl.py", "our legs, costs that do not change with time",
                {"planner": "BITstar", "settings": {}},
            ),
            (
                "OMPL SST", "legs_ompl_sst.py", "controls held for a time; no steering is needed",
                {"settings": {"setSelectionRadius": 60.0, "setPruningRadius": 25.0}},
            ),
        )
    ),
)  # fmt: skip


def environment(peer: Peer, folder: Path) -> Path:
    """The Python of the environment of a peer's packages, made if it is not there. RuntimeError if pip fails."""
    name = "+".join("project" if str(PROJECT) in one else one.strip("-") for one in peer.packages)
    place = folder / "environments" / name
    python, done, wanted = place / "bin" / "python", place / "installed", "\n".join(peer.packages)
    if not done.exists() or done.read_text() != wanted:  # another checkout of this project is another package
        venv.create(place, with_pip=True, clear=True)
        made = subprocess.run(
            [python, "-m", "pip", "install", "--quiet", *peer.packages], capture_output=True, text=True
        )
        if made.returncode:
            raise RuntimeError(f"pip: {last_line(made.stderr)}")
        done.write_text(wanted)
    return python


def last_line(text: str) -> str:
    """The last line of a message that says something."""
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "no message")


def ended(returncode: int, stderr: str) -> str:
    """How a script ended that did not answer: its last word, and the signal or the exit code."""
    by = f"exit code {returncode}" if returncode >= 0 else f"signal {signal.Signals(-returncode).name}"
    return f"{last_line(stderr)} ({by})"


def answer_of(peer: Peer, folder: Path) -> Path:
    """The file of a peer's answer to its problem."""
    name = re.sub(
        "[^a-z0-9]+", "-", f"{peer.problem} {peer.name.replace('*', ' star')}".lower().replace("#", " sharp")
    )
    return folder / "answers" / f"{name.strip('-')}.answer"


def known_answer(peer: Peer, folder: Path) -> dict[str, Any] | None:
    """What a peer answered before, None if nothing or if it failed."""
    file = answer_of(peer, folder)
    found = dict(json.loads(file.read_text())) if file.exists() else {"failed": "not asked"}
    return None if "failed" in found else found


def ask(peer: Peer, folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """A peer's answer to a job: run now on one thread, or what it answered before."""
    found = known_answer(peer, folder)
    if found is not None:
        return found
    answer, file = answer_of(peer, folder), answer_of(peer, folder).with_suffix(".json")
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps(job | peer.settings))
    answer.unlink(missing_ok=True)
    began = time.perf_counter()
    try:
        run_script(environment(peer, folder), peer.script, file)
        found = json.loads(answer.read_text())
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        found = {"failed": str(error)[:300]}
    found |= {"whole_s": round(time.perf_counter() - began, 1)}
    with problems.whole(answer) as part:
        part.write_text(json.dumps(found))
    return dict(found)


def run_script(python: Path, script: str, job: Path) -> None:
    """Run a peer's script on one thread. RuntimeError with its last word if it fails or does not answer."""
    alone = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB", "NUMEXPR")}
    done = subprocess.run(
        [python, HERE / script, job.absolute()],
        capture_output=True, text=True, timeout=LONGEST, cwd=job.parent, env=os.environ | alone,
    )  # fmt: skip
    if done.returncode or not job.with_suffix(".answer").exists():
        raise RuntimeError(ended(done.returncode, done.stderr))


def lines_written(script: str) -> int:
    """The lines of code of a peer's script, without its docstring, comments and empty lines."""
    text = (HERE / script).read_text().split('"""', 2)[2]
    return sum(1 for line in text.splitlines() if line.strip() and not line.strip().startswith("#"))


def spread(values: list[float]) -> dict[str, float]:
    """Median and range."""
    return {"median": median(values), "low": min(values), "high": max(values), "runs": len(values)}


def row_of(peer: Peer, found: dict[str, Any], measure: Callable[..., dict[str, Any]]) -> dict[str, Any]:
    """A peer's row of the record."""
    told = {"peer": peer.name, "problem": peer.problem, "what": peer.what, "can": peer.can}
    told |= {"script": peer.script, "lines": lines_written(peer.script)}
    if "failed" in found:
        return told | {"failed": found["failed"]}
    seconds = {key: spread(found[key]) for key in ("processor_s", "wall_s")}
    return told | {"version": found["version"], **seconds, **measure(found)}


def arguments() -> argparse.Namespace:
    """The arguments. The program ends with a message if the folder is in the project."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("currents", type=Path, help="the file of `data/ionian.toml`")
    parser.add_argument("--folder", type=Path, required=True, help="environments, problems and answers")
    parser.add_argument("--only", action="append", help="a peer or a problem; again for more")
    parser.add_argument(
        "--again",
        action="append",
        default=[],
        help="forget answers: a peer's, a problem's, or `all`; again for more",
    )
    parser.add_argument("--answered", action="store_true", help="only peers that have answered before")
    parser.add_argument("--beside", action="store_true", help="other work runs on the machine: say so")
    parser.add_argument("--against", type=Path, help="an older record: say which ratios moved")
    parser.add_argument("-o", "--output", type=Path, help="the record")
    parser.add_argument("--table", type=Path, help="a document: its tables are written anew")
    args = parser.parse_args()
    named = {ALL} | {name for peer in PEERS for name in (peer.name, peer.problem)}
    for name in {*(args.only or []), *args.again} - named:
        parser.error(f"no peer and no problem is called `{name}`; known are {', '.join(sorted(named))}")
    if args.folder.absolute().is_relative_to(PROJECT):
        parser.error(f"`--folder` must not be in the project; got {args.folder}")
    return args


def main() -> None:
    """Read the arguments, ask every peer, keep the record and the table."""
    args = arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended by SIGTERM"))  # so that the peer's process ends too
    folder = args.folder.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    asked = [peer for peer in PEERS if not args.only or {ALL, peer.name, peer.problem} & set(args.only)]
    if args.answered:
        asked = [peer for peer in asked if answer_of(peer, folder).exists()]
    for peer in asked:
        if {ALL, peer.name, peer.problem} & set(args.again):
            answer_of(peer, folder).unlink(missing_ok=True)
    rows = []
    for problem in dict.fromkeys(peer.problem for peer in asked):
        job, judge = problems.make(problem, args.currents.absolute(), folder)
        answers: dict[str, dict[str, Any]] = {}
        for peer in (one for one in asked if one.problem == problem):
            answers[peer.name] = ask(peer, folder, job)
            print(peer.problem, peer.name, answers[peer.name].get("failed", "answered"), flush=True)
        measure = judge(answers)
        rows += [row_of(peer, answers[peer.name], measure) for peer in asked if peer.problem == problem]
    beside = ", beside other work" if args.beside else ""
    record = {"machine": machine(1) + beside, "numpy": np.__version__, "rows": rows}
    keep(record, args.output)
    print(compare.answer(rows))
    if args.against:
        print(compare.moved(json.loads(args.against.read_text())["rows"], rows))
    if args.table:
        table.rewrite(args.table, record)


if __name__ == "__main__":
    main()
