"""Records of benchmarks: the machine in words, and JSON texts in files."""

import json
import os
import platform
from pathlib import Path
from typing import Any


def machine(threads: int | None = None) -> str:
    """Return what machine this is, and on how many threads it works if that is told."""
    on = "" if threads is None else f"{threads} thread{'s' * (threads != 1)}, "
    return f"{platform.machine()}, {os.cpu_count()} cores, {on}Python {platform.python_version()}"


def earlier(output: Path | None) -> dict[str, Any]:
    """Return what a record holds already; nothing if there is none."""
    known: dict[str, Any] = {}
    if output is not None and output.exists():
        known = json.loads(output.read_text())
    return known


def keep(found: Any, output: Path | None) -> str:
    """Write a record, if a file is named, and return its text."""
    text = json.dumps(found, indent=1)
    if output is not None:
        output.write_text(text + "\n")
    return text
