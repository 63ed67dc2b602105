"""Peers beside this project: each in its own environment, on the same problem, in the same run; one record.

    python benchmarks/peers/run.py --folder ../peers CURRENTS.nc -o benchmarks/records/peers.json

CURRENTS.nc is the Copernicus Marine file of `data/ionian.toml`. Environments, problems and answers are kept in
`--folder`, which must not be in this project. `--table docs/peers.md` writes the document's
tables. What is there already is not made again: `--again NAME` forgets a
peer's answer. A peer that cannot be installed or that fails becomes a row with its own message. Every script
beside this one has what a user of the peer writes; PEERS names them.
"""

import argparse
import json
import os
import subprocess
import sys
import time
import venv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parents[1]
sys.path.insert(0, str(HERE.parent))

import numpy as np
import problems
import table
from record import keep, machine

LONGEST = 900.0
"""A peer that has not answered after this time [s] has failed."""


@dataclass(frozen=True)
class Peer:
    """A row: its name, what pip installs, its script, its problem, what it is and what it can do."""

    name: str
    packages: tuple[str, ...]
    script: str
    problem: str
    what: str
    can: str


READS = ("h5netcdf", "h5py")
HALEM = ("halem==1.0.3", "numpy<2", "xarray", *READS)
OURS = ("--editable", f"{PROJECT}[ocean]")
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
            (
                "OMPL FMT", ("ompl==2.0.1", *OURS), "legs_ompl.py", "OMPL's, by its bindings, our legs",
                "many planners; costs that do not change with time",
            ),
        )
    ),
)  # fmt: skip


def environment(peer: Peer, folder: Path) -> Path:
    """The Python of the environment of a peer's packages, made if it is not there. RuntimeError if pip fails."""
    name = "+".join("project" if str(PROJECT) in one else one.strip("-") for one in peer.packages)
    place = folder / "environments" / name
    python, done = place / "bin" / "python", place / "installed"
    if not done.exists():
        venv.create(place, with_pip=True, clear=True)
        made = subprocess.run(
            [python, "-m", "pip", "install", "--quiet", *peer.packages], capture_output=True, text=True
        )
        if made.returncode:
            raise RuntimeError(last_line(made.stderr))
        done.touch()
    return python


def last_line(text: str) -> str:
    """The last line of a message that says something."""
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "no message")


def answer_of(peer: Peer, folder: Path) -> Path:
    """The file of a peer's answer to its problem."""
    return folder / "answers" / f"{peer.problem}-{peer.script.removesuffix('.py')}.answer"


def ask(peer: Peer, folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """A peer's answer to a job: run now on one thread, or what it answered before."""
    answer = answer_of(peer, folder)
    file = answer.with_suffix(".json")
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps(job))
    if answer.exists():
        return dict(json.loads(answer.read_text()))
    began = time.perf_counter()
    try:
        python = environment(peer, folder)
        alone = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB", "NUMEXPR")}
        done = subprocess.run(
            [python, HERE / peer.script, file.absolute()],
            capture_output=True, text=True, timeout=LONGEST, cwd=file.parent, env=os.environ | alone,
        )  # fmt: skip
        if done.returncode or not answer.exists():
            raise RuntimeError(last_line(done.stderr))
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        answer.write_text(json.dumps({"failed": str(error)[:300]}))
    found = json.loads(answer.read_text()) | {"whole_s": round(time.perf_counter() - began, 1)}
    answer.write_text(json.dumps(found))
    return dict(found)


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


def main() -> None:
    """Read the arguments, ask every peer, keep the record and the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("currents", type=Path, help="the file of `data/ionian.toml`")
    parser.add_argument("--folder", type=Path, required=True, help="environments, problems and answers")
    parser.add_argument("--only", action="append", help="a peer or a problem; again for more")
    parser.add_argument("--again", action="append", default=[], help="forget a peer's answers; again for more")
    parser.add_argument("--answered", action="store_true", help="only peers that have answered before")
    parser.add_argument("--beside", action="store_true", help="other work runs on the machine: say so")
    parser.add_argument("-o", "--output", type=Path, help="the record")
    parser.add_argument("--table", type=Path, help="a document: its tables are written anew")
    args = parser.parse_args()
    folder = args.folder.absolute()
    if folder.is_relative_to(PROJECT):
        parser.error(f"`--folder` must not be in the project; got {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    asked = [peer for peer in PEERS if not args.only or {peer.name, peer.problem} & set(args.only)]
    if args.answered:
        asked = [peer for peer in asked if answer_of(peer, folder).exists()]
    rows = []
    for problem in dict.fromkeys(peer.problem for peer in asked):
        job, judge = problems.make(problem, args.currents.absolute(), folder)
        answers: dict[str, dict[str, Any]] = {}
        for peer in (one for one in asked if one.problem == problem):
            if peer.name in args.again:
                answer_of(peer, folder).unlink(missing_ok=True)
            answers[peer.script] = ask(peer, folder, job)
            print(peer.problem, peer.name, answers[peer.script].get("failed", "answered"), flush=True)
        measure = judge(answers)
        rows += [row_of(peer, answers[peer.script], measure) for peer in asked if peer.problem == problem]
    beside = ", beside other work" if args.beside else ""
    record = {"machine": machine(1) + beside, "numpy": np.__version__, "rows": rows}
    keep(record, args.output)
    if args.table:
        table.rewrite(args.table, record)


if __name__ == "__main__":
    main()
