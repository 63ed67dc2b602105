"""Stop and kill the parts of a Dask cluster while it builds, and see that the roadmap has the same bytes.

    python benchmarks/cluster_trouble.py

A scheduler and two workers run as processes of their own. Four builds of one problem: a worker is stopped
(SIGSTOP) and wakes again; a worker is stopped for ever, and the scheduler gives it up; a worker is killed, and
another joins; the scheduler is killed, the build is continued on another scheduler, which is killed too, and is
ended without any. Exit code 1 if a roadmap differs, or a command neither goes on nor says how to.
"""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py

BATCH = 4000
"""Pairs in a chunk: some two hundred chunks."""
PROGRAM = (
    "from glider_stream.jobs.build import build_file as f; "
    f"f.__defaults__ = tuple({BATCH} if d == 100_000 else d for d in f.__defaults__); "
    "from glider_stream.__main__ import main; main()"
)
BUILD = ["build", "seed-box", "--set", "steering.method=flow-map", "--set", "neighbours.kind=all", "-o", "out.h5"]
GIVEN_UP = 8
"""Seconds without a sign of life after which the scheduler gives a worker up; by default minutes."""
ASLEEP = 5.0
"""Seconds for which a worker is stopped that wakes again."""
PATIENCE = 300.0


class Trouble:
    """A folder, and the processes that work in it."""

    def __init__(self, folder):
        """Make nothing yet."""
        self.folder = folder
        self.processes = []
        self.journal = folder / "out.h5.journal"

    def dask(self, *arguments):
        """A scheduler or worker as a process."""
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments], cwd=self.folder, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": f"{GIVEN_UP}s"},
        )  # fmt: skip
        self.processes.append(process)
        return process

    def cluster(self, workers=2):
        """A scheduler's process and address, and its workers' processes."""
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        address = f"tcp://127.0.0.1:{port}"
        scheduler = self.dask("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
        return scheduler, address, [self.worker(address) for _ in range(workers)]

    def worker(self, address):
        """A worker of a scheduler."""
        return self.dask("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard")

    def build(self, *more):
        """A build that has begun."""
        process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *BUILD, "--checkpoint", "0", *more], cwd=self.folder,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.processes.append(process)
        return process

    def kept(self):
        """Bytes in the journal."""
        return self.journal.stat().st_size if self.journal.exists() else 0

    def grown(self, process, bytes_more=200_000):
        """Wait until the journal has grown."""
        before = self.kept()
        until = time.monotonic() + PATIENCE
        while self.kept() < before + bytes_more:
            if process.poll() is not None or time.monotonic() > until:
                raise SystemExit(f"the build ended before its time: {process.stderr.read()}")
            time.sleep(0.01)

    def end(self):
        """End what still runs."""
        for process in self.processes:
            if process.poll() is None:
                with contextlib.suppress(ProcessLookupError):
                    process.send_signal(signal.SIGCONT)
                    process.kill()
            process.wait()
        self.processes.clear()


def content(path):
    """The bytes of every dataset."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, one: found.update({name: one[()].tobytes()} if hasattr(one, "dtype") else {})
        )
    return found


def ended(process, code, words=""):
    """See that a command ends as it should; the seconds that it takes."""
    began = time.monotonic()
    said = process.communicate(timeout=PATIENCE)[1]
    if process.returncode != code or words not in said:
        raise SystemExit(f"exit code {process.returncode}, not {code}: {said[-600:]}")
    return time.monotonic() - began


def a_worker_that_wakes(trouble):
    """It is stopped, and wakes before it is given up."""
    _, address, workers = trouble.cluster()
    build = trouble.build("--scheduler", address)
    trouble.grown(build)
    workers[0].send_signal(signal.SIGSTOP)
    time.sleep(ASLEEP)
    workers[0].send_signal(signal.SIGCONT)
    return f"ended {ended(build, 0):.0f} s after it woke"


def a_worker_that_wakes_late(trouble):
    """It is stopped, given up by the scheduler, and wakes when others have done its chunks."""
    _, address, workers = trouble.cluster()
    build = trouble.build("--scheduler", address)
    trouble.grown(build)
    workers[0].send_signal(signal.SIGSTOP)
    seconds = ended(build, 0)
    workers[0].send_signal(signal.SIGCONT)
    return f"ended {seconds:.0f} s after the stop, without it"


def a_worker_that_dies(trouble):
    """Another joins."""
    _, address, workers = trouble.cluster()
    build = trouble.build("--scheduler", address)
    trouble.grown(build)
    workers[0].kill()
    trouble.worker(address)
    return f"ended {ended(build, 0):.0f} s after"


def a_scheduler_that_dies(trouble):
    """The build says how to go on, and goes on, on another scheduler and then on none."""
    took = []
    for _ in range(2):
        scheduler, address, workers = trouble.cluster()
        build = trouble.build("--scheduler", address)
        trouble.grown(build)
        scheduler.kill()
        took.append(ended(build, 2, "the cluster failed: "))
        for worker in workers:
            worker.kill()
    kept = trouble.kept()
    build = trouble.build()
    ended(build, 0)
    return f"told {took[0]:.0f} and {took[1]:.0f} s after; {kept:,} bytes of progress were used"


def main():
    """Run it."""
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        trouble = Trouble(Path(name))
        output = trouble.folder / "out.h5"
        ended(trouble.build(), 0)
        whole = content(output)
        for case in (a_worker_that_wakes, a_worker_that_wakes_late, a_worker_that_dies, a_scheduler_that_dies):
            output.unlink()
            try:
                said = case(trouble)
                same = content(output) == whole
                said += "; the same bytes" if same else "; OTHER BYTES"
                wrong += not same
            except (SystemExit, subprocess.TimeoutExpired) as error:
                said, wrong = f"WRONG: {error}", wrong + 1
            finally:
                trouble.end()
            trouble.journal.unlink(missing_ok=True)
            output.touch()
            print(f"{case.__name__.replace('_', ' ')}: {said}", flush=True)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
