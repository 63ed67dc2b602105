"""Kill builds and what follows them at random moments, begin them again, and see that they end in the same bytes.

    python benchmarks/kills.py --kills 300 --log kills.jsonl

Each round is made from its number alone: a job (a build by some method, on an older roadmap, or as shards; a
merge; a query that exports; a plot) runs as a process of its own and is stopped by SIGKILL, SIGTERM or SIGHUP,
again and again until it ends by itself. A third of the signals come after a random time, a third while results
are added to the journal, a third in the last moments, when files are moved. A build on an older roadmap is also
continued without it and on another one: that must be refused, and the journal stay as it was. The log has a line
for each round; the same command goes on where it stopped. Exit code 1 if an output ever differs from that of an
unbroken run, or if a file there is not whole.

Each process is a fork of this one, which has imported all modules and has run nothing: so signals come while
there is work, and not while modules are loaded.
"""

import argparse
import contextlib
import json
import math
import os
import random
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

import h5py
import matplotlib.pyplot  # noqa: F401  imported for the forks
import numpy as np
import xarray as xr

import glider_stream.plot.draw  # noqa: F401  imported for the forks
from glider_stream import __main__ as program
from glider_stream import cli, planner  # noqa: F401  imported for the forks
from glider_stream.jobs import build

FEWER = "sampling.shape=[9,9,4]"
METHODS = {
    "streamline": ["steering.candidates=54", "neighbours.k=60", FEWER],
    "refine": ["steering.refine=true", "neighbours.k=60", FEWER],
    "surface": ["steering.method=surface", "steering.candidates=54", "neighbours.k=60", FEWER],
    "flow-map": ["steering.method=flow-map", "neighbours.kind=all", FEWER],
    "reachable": ["steering.method=flow-map", "neighbours.kind=reachable", "neighbours.limit=64", FEWER],
}
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)
REFUSED = "keeps the progress of another build, whose base differ"
OCEAN = """\
[flow]
kind = "netcdf"
file = "now.nc"
[glider]
preset = "slocum"
[domain]
lon = [10.2, 10.6]
lat = [40.2, 40.5]
depth = [0.0, 900.0]
[sampling]
kind = "halton"
count = 400
seed = 1
[neighbours]
kind = "nearest"
k = 20
[steering]
method = "flow-map"
[integration]
dt = 60.0
steps = 120
tolerance = 150.0
[cost]
kind = "time"
"""
SMALL_BATCH = 700
"""Pairs in a batch of builds here, so that there is something to go on from."""
MOST_ATTEMPTS = 60


def currents(name, southwest, northeast):
    """A file of currents, two corners of which are weaker than in the others."""
    lon, lat = np.arange(10.0, 10.81, 0.01), np.arange(40.0, 40.71, 0.01)
    depth = np.array([0.0, 100.0, 300.0, 1000.0])
    z, y, x = np.meshgrid(depth, lat, lon, indexing="ij")
    u = 0.25 * np.sin(9 * x) * np.cos(7 * y) * np.exp(-z / 400)
    v = 0.2 * np.cos(8 * x + 5 * y) * np.exp(-z / 300)
    for corner, share in (((x < 10.29) & (y < 40.28), southwest), ((x > 10.5) & (y > 40.4), northeast)):
        u, v = (np.where(corner, share * part, part) for part in (u, v))
    axes = {
        "depth": ("depth", depth, {"units": "m", "positive": "down"}),
        "lat": ("lat", lat, {"units": "degrees_north"}),
        "lon": ("lon", lon, {"units": "degrees_east"}),
    }
    fields = {name: (tuple(axes), part, {"units": "m/s"}) for name, part in (("uo", u), ("vo", v))}
    xr.Dataset(fields, axes).to_netcdf(name, engine="h5netcdf")


def content(path):
    """What an output holds: the bytes of a roadmap's datasets, or those of any other file."""
    if path.suffix != ".h5":
        return path.read_bytes()
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, one: found.update({name: one[()].tobytes()} if hasattr(one, "dtype") else {})
        )
    return found


def options_of(name):
    """The options of a build by some method."""
    return [word for one in METHODS[name] for word in ("--set", one)]


def jobs():
    """By name: the arguments of a command, and the outputs that it writes."""
    found = {}
    small = ["seed-box", "--set", FEWER]
    for name in METHODS:
        found[name] = ["build", "seed-box", "-o", "out.h5", *options_of(name)], ["out.h5"]
    ocean = ["build", "ocean.toml"]
    found["from"] = [*ocean, "-o", "out.h5", "--from", "old.h5"], ["out.h5"]
    found["shard from"] = [*ocean, "-o", "out.h5", "--shard", "2/3", "--from", "old.h5"], ["out.h5"]
    found["shard"] = ["build", *small, "-o", "out.h5", "--shard", "1/2"], ["out.h5"]
    found["merge"] = ["merge", "part1.h5", "part2.h5", "-o", "out.h5"], ["out.h5"]
    files = ["out.json", "out.csv", "out.windows.csv"]  # of a box in metres; maps' files are moved alike
    found["query"] = ["query", "road.h5", *(word for file in files for word in ("-o", file))], files
    found["plot"] = ["plot", "road.h5", "path.json", "-o", "out.png"], ["out.png"]
    found["page"] = ["plot", "road.h5", "path.json", "-o", "out.html"], ["out.html"]
    return found


def prepared(folder):
    """Make what jobs need in a folder; what unbroken runs of them write, and the seconds that they take."""
    # a base is what an older roadmap has right: of `other.nc` less than of `before.nc`
    for name, *shares in (("before.nc", 1.0, 1.0), ("now.nc", 0.5, 1.0), ("other.nc", 0.2, 0.2)):
        currents(folder / name, *shares)
    (folder / "ocean.toml").write_text(OCEAN)
    made = [
        ["build", "ocean.toml", "-o", "old.h5", "--set", "flow.file=before.nc"],
        ["build", "ocean.toml", "-o", "older.h5", "--set", "flow.file=other.nc"],
        ["build", "seed-box", "--set", FEWER, "-o", "part1.h5", "--shard", "1/2"],
        ["build", "seed-box", "--set", FEWER, "-o", "part2.h5", "--shard", "2/2"],
        ["build", "seed-box", *options_of("reachable"), "-o", "road.h5"],
        ["query", "road.h5", "-o", "path.json"],
    ]
    for arguments in made:
        unbroken(folder, arguments)
    whole, seconds = {}, {}
    for name, (arguments, outputs) in jobs().items():
        seconds[name] = unbroken(folder, arguments)
        whole[name] = {output: content(folder / output) for output in outputs}
        for output in outputs:
            (folder / output).unlink()
    return whole, seconds


def unbroken(folder, arguments):
    """Run a command to its end; the seconds that it takes."""
    began = time.monotonic()
    code, said = ended(begun(folder, arguments), folder)
    assert code == 0, f"{arguments}: exit code {code}: {said}"
    return time.monotonic() - began


def begun(folder, arguments):
    """A command in a process of its own, its standard error in a file: the process's number."""
    process = os.fork()
    if process:
        return process
    code = 70
    try:
        os.chdir(folder)
        for number, name in ((1, os.devnull), (2, "said.txt")):
            os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        defaults = build.build_file.__defaults__
        build.build_file.__defaults__ = tuple(SMALL_BATCH if d == build.BATCH_PAIRS else d for d in defaults)
        sys.argv = ["glider-stream", *arguments, *(["--checkpoint", "0"] if arguments[0] == "build" else [])]
        program.main()
        code = 0
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else int(error.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def ended(process, folder):
    """Wait for a process: its exit code, and what it wrote on standard error."""
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    return code, (folder / "said.txt").read_text()


def others(name, arguments):
    """The same command as it began, without its older roadmap, and on another; by what they build on."""
    if "from" not in name:
        return {"": arguments}
    at = arguments.index("--from")
    without, another = ([*arguments[:at], *more, *arguments[at + 2 :]] for more in ([], ["--from", "older.h5"]))
    return {"old": arguments, "none": without, "other": another}


def stopped(dice, folder, arguments, seconds, patience):
    """Run a command and stop it at some moment: its exit code, what it said, and whether it was stopped."""
    moment = dice.choice(("any", "late", "midst" if arguments[0] == "build" else "late"))
    journal = folder / "out.h5.journal"
    before = journal.stat().st_size if journal.exists() else 0
    process = begun(folder, arguments)
    running = lambda: os.waitid(os.P_PID, process, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None  # noqa: E731
    if moment == "any":
        until = time.monotonic() + seconds * patience * (0.1 + dice.random())
        while running() and time.monotonic() < until:
            time.sleep(0.001)
    else:
        reached = {
            "late": lambda: any(folder.glob(".out.*")),
            "midst": lambda: journal.exists() and journal.stat().st_size > before + 2000,
        }[moment]
        while running() and not seen(reached):
            time.sleep(0.0005)
        until = time.monotonic() + 0.02 * patience * dice.random()
        while running() and time.monotonic() < until:
            time.sleep(0.0002)
    killed = running()
    if killed:
        os.kill(process, dice.choice(SIGNALS))
    code, said = ended(process, folder)
    # it may have ended by itself between the look and the signal
    return code, said, killed and code < 0


def seen(reached):
    """Whether something is there; a file may go between two looks."""
    try:
        return reached()
    except FileNotFoundError:
        return False


def tried(number, folder, whole, seconds):
    """A line of the log: round `number`."""
    dice = random.Random(number)
    name = list(jobs())[number % len(jobs())]
    arguments, outputs = jobs()[name]
    ways = others(name, arguments)
    counts, faults, owner = Counter(), [], ""
    for left in folder.glob("*out.*"):
        left.unlink()
    journal = folder / "out.h5.journal"
    for attempt in range(MOST_ATTEMPTS):
        before = journal.read_bytes() if journal.exists() else b""
        way = dice.choice(list(ways)) if before.count(b"\n") >= 2 else next(iter(ways))
        owner = owner if before.count(b"\n") >= 2 else way
        # on a busy machine the time of an unbroken run is never enough
        code, said, killed = stopped(dice, folder, ways[way], seconds[name], 1.0 + attempt / 4)
        counts["kills"] += killed
        counts["resumed"] += bool(before) and way == owner
        for output in outputs:
            if (folder / output).exists() and content(folder / output) != whole[name][output]:
                faults.append(f"{output} is not what an unbroken run writes")
        if way != owner:
            counts[f"{owner} then {way}: {'killed' if killed else 'refused' if code == 2 else code}"] += 1
            faults += alien_faults(code, said, killed, before, journal)
            continue
        if killed:
            continue
        if code != 0:
            faults.append(f"exit code {code}: {said[-300:]}")
        break
    else:
        faults.append("it never ended by itself")
    faults += [f"{output} is missing" for output in outputs if not (folder / output).exists()]
    left = sorted(path.name for path in folder.glob(".out.*"))
    if left and name not in ("query", "plot", "page"):  # a build cleans up after builds alone
        faults.append(f"left beside it: {left}")
    return {"number": number, "job": name, "counts": dict(counts), "faults": faults}


def alien_faults(code, said, killed, before, journal):
    """What is wrong where a build was continued on another base than it began with."""
    faults = []
    if not killed and not (code == 2 and REFUSED in said):
        faults.append(f"a build on another base was not refused: exit code {code}: {said[-300:]}")
    if not journal.exists() or journal.read_bytes() != before:
        faults.append("a build on another base changed the journal")
    return faults


def main():
    """Run it."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--kills", type=int, default=300)
    options.add_argument("--log", type=Path, default=Path("kills.jsonl"))
    options.add_argument("--seconds", type=float, default=math.inf, help="stop, to go on another time")
    asked = options.parse_args()
    lines = [json.loads(line) for line in asked.log.read_text().splitlines()] if asked.log.exists() else []
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder, asked.log.open("a") as log:
        whole, seconds = prepared(Path(folder))
        while total(lines)["kills"] < asked.kills and time.monotonic() - began < asked.seconds:
            line = tried(len(lines), Path(folder), whole, seconds)
            lines.append(line)
            log.write(json.dumps(line) + "\n")
            log.flush()
            print(line, flush=True)
    bad = [line["number"] for line in lines if line["faults"]]
    for what, count in sorted(total(lines).items()):
        print(f"{what}: {count}")
    print(f"{total(lines)['kills']} kills in {len(lines)} rounds; {len(bad)} rounds went wrong: {bad}")
    sys.exit(1 if bad else 0)


def total(lines):
    """What was counted in all rounds."""
    return sum((Counter(line["counts"]) for line in lines), Counter())


if __name__ == "__main__":
    main()
