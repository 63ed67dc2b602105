"""Kill builds at random moments, begin them again, and see that they end in the same bytes.

    python benchmarks/kills.py --kills 100

Builds of every method run as processes of their own and are killed (SIGKILL) after a random time, again and again
until one ends by itself; a third of the kills wait for the last moments, when the roadmap is written and moved.
Exit code 1 if a dataset ever differs, or if a file at the output does not open and verify.
"""

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py

from glider_stream import planner

METHODS = {
    "streamline": ["steering.candidates=54", "neighbours.k=60"],
    "refine": ["steering.refine=true", "neighbours.k=60"],
    "surface": ["steering.method=surface", "steering.candidates=54", "neighbours.k=60"],
    "flow-map": ["steering.method=flow-map", "neighbours.kind=all"],
    "reachable": ["steering.method=flow-map", "neighbours.kind=reachable", "neighbours.limit=64"],
}
SMALL = "import glider_stream.roadmap.builder as r, glider_stream.jobs.build as j; r.BATCH_PAIRS = 1000; "
PROGRAM = SMALL + (
    "j.build_file.__defaults__ = tuple(1000 if d == 100_000 else d for d in j.build_file.__defaults__); "
    "from glider_stream.cli import main; main()"
)


def datasets(path):
    """The bytes of every dataset."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, one: found.update({name: one[()].tobytes()} if hasattr(one, "dtype") else {})
        )
    return found


def main():
    """Run it."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--kills", type=int, default=100)
    options.add_argument("--seed", type=int, default=1)
    asked = options.parse_args()
    dice, kills, resumed, bad = random.Random(asked.seed), 0, 0, 0
    with tempfile.TemporaryDirectory() as folder:
        whole, seconds = {}, {}
        for name, sets in METHODS.items():
            began = time.monotonic()
            planner.build("seed-box", Path(folder) / f"{name}.h5", overrides=sets)
            whole[name], seconds[name] = datasets(Path(folder) / f"{name}.h5"), time.monotonic() - began
        rounds = 0
        while kills < asked.kills:
            name = list(METHODS)[rounds % len(METHODS)]
            rounds += 1
            output = Path(folder) / "out.h5"
            command = [sys.executable, "-c", PROGRAM, "build", "seed-box", "-o", str(output), "--checkpoint", "0"]
            for one in METHODS[name]:
                command += ["--set", one]
            while True:
                late = dice.random() < 1 / 3
                with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as build:
                    if late:
                        while build.poll() is None and not list(Path(folder).glob(".out.h5.*")):
                            time.sleep(0.0005)
                        time.sleep(0.02 * dice.random())
                    else:
                        time.sleep(0.9 + (seconds[name] + 0.3) * dice.random())
                    ended = build.poll() is not None
                    if not ended:
                        build.send_signal(signal.SIGKILL)
                        kills += 1
                if output.exists():
                    if datasets(output) != whole[name] or not planner.verify(output, sample=2).holds:
                        bad += 1
                        print(f"{name}: a file at the output that is not whole", flush=True)
                    if not ended:
                        continue
                if ended:
                    break
                resumed += (Path(folder) / "out.h5.journal").exists()
            same = datasets(output) == whole[name]
            bad += not same
            left = sorted(path.name for path in Path(folder).glob("*out.h5*") if path.name != "out.h5")
            print(f"{name}: {kills} kills so far, the same bytes: {same}, left beside: {left}", flush=True)
            output.unlink()
    print(f"{kills} kills over {rounds} builds; {resumed} left a journal to go on from; {bad} went wrong")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
