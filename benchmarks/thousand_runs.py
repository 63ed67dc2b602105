"""A thousand runs of the box: their time, a kill in the middle, the same bits on one process and on several.

`python benchmarks/thousand_runs.py -o benchmarks/records/thousand_runs.json`
"""

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from glider_stream.base.cores import usable_cores
from glider_stream.mission.journal import MARK

COMMAND = [sys.executable, "-m", "glider_stream", "simulate", "box"]
COMPARED = 50
"""So many runs are flown again on one process."""


def flown(folder: Path, name: str, runs: int, processes: int, kill_at: int | None = None) -> float:
    """Fly runs into a file and return the seconds; kill the program when about `kill_at` runs are kept."""
    began = time.perf_counter()
    output = folder / name
    arguments = ["--runs", str(runs), "--processes", str(processes), "-o", str(output)]
    with subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.DEVNULL, start_new_session=True) as program:
        while kill_at is not None and program.poll() is None:
            time.sleep(0.5)
            if _kept(output) >= kill_at:
                # only the first process: its workers end when they find it gone
                program.send_signal(signal.SIGKILL)
                kill_at = None
    return time.perf_counter() - began


def _kept(output: Path) -> int:
    """Return about how many runs a journal holds."""
    journal = output.with_name(f"{output.name}.journal")
    return journal.read_bytes().count(MARK) if journal.exists() else 0


def main() -> None:
    """Fly, kill, continue, compare; print the findings and write the record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("-o", "--output", type=Path)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder, cores = Path(made), usable_cores()
        before = flown(folder, "runs.json", asked.runs, cores, kill_at=asked.runs // 3)
        kept = _kept(folder / "runs.json")
        after = flown(folder, "runs.json", asked.runs, cores)
        some = min(COMPARED, asked.runs)
        alone = flown(folder, "alone.json", some, 1)
        whole, again = (json.loads((folder / name).read_text()) for name in ("runs.json", "alone.json"))
        found = {
            "runs": len(whole["runs"]),
            "processes": cores,
            "seconds": round(before + after, 1),
            "killed_after_s": round(before, 1),
            "kept_at_the_kill": kept,
            "same_on_one_process": whole["runs"][:some] == again["runs"],
            "compared": some,
            "seconds_of_those": round(alone, 1),
            "policies": whole["policies"],
        }
    print(json.dumps(found, indent=1))
    if asked.output is not None:
        asked.output.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
