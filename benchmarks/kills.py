"""Kill builds and what follows them at random moments, begin them again, and see that they end in the same bytes.

    python benchmarks/kills.py --kills 300 --log kills.jsonl

Each round is made from its number alone: a job (a build by some method, on an older roadmap, or as shards; a
merge; a query that exports; a plot) runs as a process of its own and is stopped by SIGKILL, SIGTERM or SIGHUP
after a random time, again and again until it ends by itself; a third of the signals wait for the last moments,
when files are moved. A build on an older roadmap is now and then continued without it, or on another: that must
be refused, or end in the same bytes. The log has a line for each round; the same command goes on where it
stopped. Exit code 1 if an output ever differs from that of an unbroken run, or if a file there is not whole.
"""

import argparse
import json
import math
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

from glider_stream import planner

METHODS = {
    "streamline": ["steering.candidates=54", "neighbours.k=60"],
    "refine": ["steering.refine=true", "neighbours.k=60"],
    "surface": ["steering.method=surface", "steering.candidates=54", "neighbours.k=60"],
    "flow-map": ["steering.method=flow-map", "neighbours.kind=all"],
    "reachable": ["steering.method=flow-map", "neighbours.kind=reachable", "neighbours.limit=64"],
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
count = 900
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
PROGRAM = (
    "import glider_stream.jobs.build as j; "
    "j.build_file.__defaults__ = tuple(1000 if d == 100_000 else d for d in j.build_file.__defaults__); "
    "from glider_stream.__main__ import main; main()"
)
"""The program with small batches, so that there is something to go on from."""


def currents(name, weaker):
    """A file of currents, a corner of which is `weaker` than in the others."""
    import xarray as xr

    lon, lat = np.arange(10.0, 10.81, 0.01), np.arange(40.0, 40.71, 0.01)
    depth = np.array([0.0, 100.0, 300.0, 1000.0])
    z, y, x = np.meshgrid(depth, lat, lon, indexing="ij")
    u = 0.25 * np.sin(9 * x) * np.cos(7 * y) * np.exp(-z / 400)
    v = 0.2 * np.cos(8 * x + 5 * y) * np.exp(-z / 300)
    corner = (x < 10.29) & (y < 40.28)
    u, v = (np.where(corner, weaker * part, part) for part in (u, v))
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


def jobs():
    """By name: the arguments of a command, and the outputs that it writes."""
    found = {}
    for name, sets in METHODS.items():
        options = [word for one in sets for word in ("--set", one)]
        found[name] = ["build", "seed-box", "-o", "out.h5", *options], ["out.h5"]
    ocean = ["build", "ocean.toml"]
    found["from"] = [*ocean, "-o", "out.h5", "--from", "old.h5"], ["out.h5"]
    found["shard from"] = [*ocean, "-o", "out.h5", "--shard", "2/3", "--from", "old.h5"], ["out.h5"]
    found["shard"] = ["build", "seed-box", "-o", "out.h5", "--shard", "1/2"], ["out.h5"]
    found["merge"] = ["merge", "part1.h5", "part2.h5", "-o", "out.h5"], ["out.h5"]
    files = ["out.json", "out.csv", "out.windows.csv"]  # of a box in metres; maps' files are moved alike
    found["query"] = ["query", "road.h5", *(word for file in files for word in ("-o", file))], files
    found["plot"] = ["plot", "road.h5", "path.json", "-o", "out.png"], ["out.png"]
    found["page"] = ["plot", "road.h5", "path.json", "-o", "out.html"], ["out.html"]
    return found


def prepared(folder):
    """Make what jobs need in a folder; what unbroken runs of them write, and the seconds that they take."""
    for name, weaker in (("before.nc", 1.0), ("now.nc", 0.5), ("other.nc", 0.2)):
        currents(folder / name, weaker)
    (folder / "ocean.toml").write_text(OCEAN)
    for name, file in (("old.h5", "before.nc"), ("older.h5", "other.nc")):
        planner.build(folder / "ocean.toml", folder / name, overrides=[f"flow.file={folder / file}"])
    for number in (1, 2):
        planner.build_part("seed-box", folder / f"part{number}.h5", f"{number}/2")
    planner.query(planner.build("seed-box", folder / "road.h5"), outputs=[folder / "path.json"])
    whole, seconds = {}, {}
    for name, (arguments, outputs) in jobs().items():
        began = time.monotonic()
        subprocess.run(program(arguments), cwd=folder, check=True, capture_output=True)
        seconds[name] = time.monotonic() - began
        whole[name] = {output: content(folder / output) for output in outputs}
        for output in outputs:
            (folder / output).unlink()
    return whole, seconds


def program(arguments):
    """A command in a process of its own."""
    more = ["--checkpoint", "0"] if arguments[0] == "build" else []
    return [sys.executable, "-c", PROGRAM, *arguments, *more]


def varied(dice, name, arguments, begun):
    """Of a build that has begun, now and then the same without its older roadmap, or on another."""
    if "from" not in name or not begun or dice.random() < 0.6:
        return arguments, False
    at = arguments.index("--from")
    other = ["--from", "older.h5"] if dice.random() < 0.5 else []
    return [*arguments[:at], *other, *arguments[at + 2 :]], True


def stopped(dice, folder, arguments, seconds, patience):
    """Run a command and stop it at a random moment: its exit code, what it said, and whether it was stopped."""
    late = dice.random() < 1 / 3
    with subprocess.Popen(
        program(arguments), cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as running:
        if late:
            while running.poll() is None and not list(folder.glob(".out.*")):
                time.sleep(0.0005)
            time.sleep(0.02 * patience * dice.random())
        else:
            time.sleep(seconds * patience * (0.1 + dice.random()))
        killed = running.poll() is None
        if killed:
            running.send_signal(dice.choice(SIGNALS))
        said = running.communicate()[1]
    return running.returncode, said, killed


def tried(number, folder, whole, seconds):
    """A line of the log: round `number`."""
    dice = random.Random(number)
    name = list(jobs())[number % len(jobs())]
    arguments, outputs = jobs()[name]
    kills = resumed = refused = 0
    faults = []
    for left in folder.glob("*out.*"):
        left.unlink()
    journal = folder / "out.h5.journal"
    for attempt in range(60):
        before = journal.read_bytes() if journal.exists() else b""
        command, alien = varied(dice, name, arguments, bool(before))
        # on a busy machine the time of an unbroken run is never enough
        code, said, killed = stopped(dice, folder, command, seconds[name], 1.0 + attempt / 4)
        kills += killed
        resumed += bool(before)
        for output in outputs:
            if (folder / output).exists() and content(folder / output) != whole[name][output]:
                faults.append(f"{output} is not what an unbroken run writes")
        if killed:
            continue
        if alien and code == 2 and REFUSED in said:
            refused += 1
            if journal.read_bytes() != before:
                faults.append("a build that was refused changed the journal")
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
    return {
        "number": number, "job": name, "kills": kills, "resumed": resumed, "refused": refused, "faults": faults
    }  # fmt: skip


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
        while sum(line["kills"] for line in lines) < asked.kills and time.monotonic() - began < asked.seconds:
            line = tried(len(lines), Path(folder), whole, seconds)
            lines.append(line)
            log.write(json.dumps(line) + "\n")
            log.flush()
            print(line, flush=True)
    kills, resumed, refused = (sum(line[key] for line in lines) for key in ("kills", "resumed", "refused"))
    bad = [line["number"] for line in lines if line["faults"]]
    print(
        f"{kills} kills in {len(lines)} rounds; {resumed} commands found a journal, {refused} were refused for "
        f"another base; {len(bad)} rounds went wrong: {bad}"
    )
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
