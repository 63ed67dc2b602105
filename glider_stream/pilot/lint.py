"""The linter: finds faults in the files that vehicles fly, ours or a pilot's."""

import re
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

from ..base.errors import InputError
from ..base.settings import require
from ..base.untrusted import check_file
from .seaglider import target_faults
from .slocum_files import MOST_WAYPOINTS, goto_faults, read_mission_file, yo_faults

MOST_TEXT = 1_000_000
"""The largest file [bytes] that is read; a vehicle's file has some kilobytes."""


@dataclass(frozen=True)
class Linted:
    """The result for a vehicle's file: its kind and its faults, one sentence each."""

    file: str
    kind: str
    faults: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        return {"file": self.file, "kind": self.kind, "faults": list(self.faults)}

    def __str__(self) -> str:
        if not self.faults:
            return f"{self.file}: {self.kind}, no faults"
        return "\n".join(f"{self.file}: {fault}" for fault in self.faults)


def lint(file: str | File, most_waypoints: int = MOST_WAYPOINTS) -> Linted:
    """Check a goto list (of at most `most_waypoints`), a yo file or `targets`; InputError for other files."""
    require(most_waypoints >= 1, f"a goto list must hold 1 waypoint or more; got {most_waypoints}")
    path = File(file)
    check_file(path, "the file")
    try:
        with path.open("rb") as stream:
            content = stream.read(MOST_TEXT + 1)
    except OSError as error:
        raise InputError(f"the file {path} cannot be read: {(error.strerror or 'error').lower()}") from None
    require(
        len(content) <= MOST_TEXT, f"the file {path} holds more than {MOST_TEXT:,} bytes; name a vehicle's file"
    )
    require(b"\0" not in content, f"the file {path} is not a text file; name a goto list, a yo file or targets")
    text = content.decode("utf-8", errors="replace")
    behavior = read_mission_file(text).behavior
    if behavior == "goto_list":
        return Linted(str(path), "goto list", tuple(goto_faults(text, most_waypoints)))
    if behavior == "yo":
        return Linted(str(path), "yo", tuple(yo_faults(text)))
    listed = path.name.lower().startswith("targets") or re.search(r"(?m)^\w+\s.*\blat=.*\blon=", text) is not None
    got = f"the behavior {behavior!r}" if behavior else "neither a behavior_name nor targets"
    known = "give a goto list, a yo file or targets"
    require(listed and not behavior, f"the file {path} holds {got}; {known}")
    return Linted(str(path), "targets", tuple(target_faults(text)))
