"""The number of cores that this process may use; taskset, containers and clusters may limit it."""

import math
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

GROUPS = Path("/sys/fs/cgroup")
"""The folder in which Linux shows the limits of groups of processes."""


def usable_cores() -> int:
    """Return NUMBA_NUM_THREADS if the user has set it, else what affinity and the group's limit allow."""
    asked = os.environ.get("NUMBA_NUM_THREADS", "")
    if asked.isdecimal() and int(asked) > 0:
        return int(asked)
    # `os.process_cpu_count` of Python 3.13 also heeds PYTHON_CPU_COUNT
    count = getattr(os, "process_cpu_count", os.cpu_count)() or 1
    if hasattr(os, "sched_getaffinity"):
        count = min(count, len(os.sched_getaffinity(0)))
    return max(1, math.ceil(min(count, _share())))


@cache
def _share() -> float:
    """Return the number of cores that the group of this process may use; inf without a limit."""
    try:
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        return math.inf
    return min(_shares(lines, GROUPS), default=math.inf)


def _shares(lines: list[str], groups: Path) -> Iterator[float]:
    """Yield the limits of a group and of all groups above it.

    `lines` of /proc/self/cgroup: number:controllers:path.
    """
    for line in lines:
        _, controllers, path = [*line.split(":", 2), "", ""][:3]
        if controllers == "":
            top, quota, period = groups, "cpu.max", ""
        elif "cpu" in controllers.split(","):
            top, quota, period = groups / "cpu", "cpu.cfs_quota_us", "cpu.cfs_period_us"
        else:
            continue
        here = top / path.strip("/")
        # within a container the path may be the host's, and only the top of it exists
        for folder in {top, here, *(parent for parent in here.parents if top in parent.parents)}:
            try:
                numbers = (folder / quota).read_text().split()
                numbers += (folder / period).read_text().split() if period else []
                limit, each = float(numbers[0]), float(numbers[1])
            except (OSError, ValueError, IndexError):
                continue  # no file, or "max"
            if limit > 0 and each > 0:
                yield limit / each
