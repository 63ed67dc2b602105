"""Records of a machine's speed: figures with their spread, what has moved between two, their files."""

import json
import platform
import statistics
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..base.errors import InputError
from ..base.output import replacing
from ..base.settings import require
from ..base.untrusted import check_file
from ..kernels.cache import KERNEL_DIGEST


@dataclass(frozen=True)
class Figure:
    """One measured quantity with all its values; `more` tells whether more of it is better."""

    name: str
    unit: str
    values: tuple[float, ...]
    more: bool = True

    @property
    def median(self) -> float:
        """The median of the values."""
        return statistics.median(self.values)

    def as_dict(self) -> dict[str, Any]:
        """Return the figure as it stands in a record."""
        spread = {"median": self.median, "low": min(self.values), "high": max(self.values)}
        return (
            {"name": self.name, "unit": self.unit, "more_is_better": self.more}
            | spread
            | {"runs": len(self.values)}
        )

    def __str__(self) -> str:
        spread = (
            f"{_number_text(min(self.values))} to {_number_text(max(self.values))}"
            if len(self.values) > 1
            else "one run"
        )
        return f"{self.name:<44}{_number_text(self.median):>12} {self.unit:<16}({spread})"


@dataclass(frozen=True)
class Record:
    """The figures of a run, with the date and the machine."""

    figures: tuple[Figure, ...]
    made: dict[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """Return the record for JSON; the raw integrator's rate also has a key of its own."""
        raw = {figure.name: figure.median for figure in self.figures if figure.name == "evaluations_per_s"}
        return self.made | raw | {"figures": [figure.as_dict() for figure in self.figures]}

    def __str__(self) -> str:
        made = self.made
        head = f"{made['date']}, {made['processor']}, {made['threads']} threads, Python {made['python']}"
        return "\n".join([head, *(f"  {figure}" for figure in self.figures)])

    def moved(self, before: dict[str, Any]) -> list[str]:
        """Return texts on figures outside the spread of an earlier record: the ratio, and which is better."""
        then = {figure["name"]: figure for figure in before["figures"]}
        moved = []
        for now in self.figures:
            old = then.get(now.name)
            if old is None or (min(now.values) <= old["high"] and max(now.values) >= old["low"]):
                continue
            better = "better" if (now.median > old["median"]) == now.more else "worse"
            ratio = now.median / old["median"]
            moved.append(f"{now.name}: {ratio:.2f} times {_number_text(old['median'])} {now.unit}, {better}")
        return moved


def made_by(thread_count: int, quick: bool) -> dict[str, Any]:
    """Return the date and the machine of a record."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": platform.processor() or platform.machine(),
        "threads": thread_count,
        "python": platform.python_version(),
        "numba": version("numba"),
        "software_version": version("glider-stream"),
        "kernel_digest": KERNEL_DIGEST,
        "quick": quick,
    }


def _number_text(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def read_record(file: str | Path) -> dict[str, Any]:
    """Return a record that `bench --json` wrote; InputError if it is not one."""
    try:
        check_file(file, "the record")
        record = json.loads(Path(file).read_text(encoding="utf-8"))
        for figure in record["figures"]:
            sound = isinstance(figure["name"], str) and figure["low"] <= figure["median"] <= figure["high"]
            require(sound and figure["median"] != 0, "its figures are not usable")
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        text = (error.strerror or "it is not a file").lower() if isinstance(error, OSError) else str(error)
        raise InputError(f"the record {file} cannot be read: {text}; write it with `bench --json`") from None
    return dict(record)


def write_record(record: dict[str, Any], file: str | Path) -> None:
    """Write a record to a file as JSON."""
    with replacing(Path(file)) as temporary:
        temporary.write_text(json.dumps(record, indent=1) + "\n")
