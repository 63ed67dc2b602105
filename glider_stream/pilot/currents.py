"""Depth-averaged currents of a vehicle's dives, with their errors: as a table for people, as JSON and as CSV."""

import csv
import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..base.output import check_output, replacing
from ..base.settings import require
from ..vehicle.averaged_current import AveragedCurrent, SensorErrors, averaged_current
from .dive_files import DiveRecord, read_dive_records

MODELLED = 0.1
"""The standard error of a speed through water that depth and pitch give, as a share: mostly of the angle of
attack."""
ENDINGS = (".csv", ".json")


@dataclass(frozen=True)
class DiveCurrent:
    """A dive and its depth-averaged current, east and north."""

    dive: DiveRecord
    averaged: AveragedCurrent

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a dictionary for JSON; `time`, `lon` and `lat` are the middle of the dive."""
        dive, (east, north), (error_east, error_north) = self.dive, self.averaged.current, self.averaged.error
        turn = (dive.end[0] - dive.start[0] + 180) % 360 - 180
        recorded = {}
        if dive.recorded is not None:
            off = float(np.abs(self.averaged.current - dive.recorded).max())
            recorded = {
                "recorded_east_mps": float(dive.recorded[0]),
                "recorded_north_mps": float(dive.recorded[1]),
            }
            recorded |= {"off_the_recorded_mps": off}
        return {
            "dive": dive.name,
            "time": _iso((dive.began + dive.ended) / 2),
            "lon": (dive.start[0] + turn / 2 + 180) % 360 - 180,
            "lat": (dive.start[1] + dive.end[1]) / 2,
            "hours": (dive.ended - dive.began) / 3600,
            **({} if dive.max_depth is None else {"max_depth_m": dive.max_depth}),
            "east_mps": float(east),
            "north_mps": float(north),
            "error_east_mps": float(error_east),
            "error_north_mps": float(error_north),
            **recorded,
        }


@dataclass(frozen=True)
class DiveCurrents:
    """The depth-averaged currents of some dives, and the `errors` from which their errors are computed."""

    dives: tuple[DiveCurrent, ...]
    errors: SensorErrors

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a dictionary for JSON."""
        assumed = {"fix_m": self.errors.fix, "speed_share": self.errors.speed}
        assumed |= {"heading_deg": math.degrees(self.errors.heading), "drift_mps": self.errors.drift}
        return {"assumed_errors": assumed, "dives": [dive.as_dict() for dive in self.dives]}

    def write(self, file: str | Path) -> None:
        """Write a CSV or a JSON file."""
        rows = [dive.as_dict() for dive in self.dives]
        text = json.dumps(self.as_dict(), indent=1) + "\n"
        if Path(file).suffix.lower() == ".csv":
            table = io.StringIO(newline="")
            names = list(dict.fromkeys(name for row in rows for name in row))
            writer = csv.DictWriter(table, names, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
            text = table.getvalue()
        with replacing(Path(file)) as temporary:
            temporary.write_text(text, encoding="utf-8")

    def __str__(self) -> str:
        errors = self.errors
        lines = ["dive        middle              hours   east             north            speed  from recorded"]
        for dive in self.dives:
            row = dive.as_dict()
            off = f"{row['off_the_recorded_mps']:.3f}" if "off_the_recorded_mps" in row else ""
            speed = math.hypot(row["east_mps"], row["north_mps"])
            lines.append(
                f"{row['dive'][:10]:10}  {row['time'][:16]}Z  {row['hours']:6.2f}   "
                f"{row['east_mps']:+.3f} +- {row['error_east_mps']:.3f}  "
                f"{row['north_mps']:+.3f} +- {row['error_north_mps']:.3f}  {speed:.3f}  {off}".rstrip()
            )
        known = f"{errors.speed:.0%} of the speed"
        if any(dive.dive.modelled for dive in self.dives):
            known = f"{max(errors.speed, MODELLED):.0%} of the speed, which depth and pitch give"
        lines.append(
            f"m/s; +- is one standard error, from {errors.fix:g} m of a fix, {known}, "
            f"{math.degrees(errors.heading):g} degrees of the heading, {errors.drift:g} m/s at the surface"
        )
        return "\n".join(lines)


def _iso(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def check_currents_output(file: str | Path) -> None:
    """Raise InputError unless currents can be written to a file of that name."""
    ending = Path(file).suffix.lower()
    known = ", ".join(ENDINGS)
    require(ending in ENDINGS, f"the output {file} must end in one of: {known}; got {ending or 'no ending'!r}")
    check_output(file)


def dive_currents(
    file: str | Path,
    columns: Mapping[str, str] | None = None,
    *,
    declination: float = 0.0,
    attack: float = 3.0,
    errors: SensorErrors = SensorErrors(),  # noqa: B008  (frozen)
) -> DiveCurrents:
    """Return the depth-averaged currents of the dives in a file; see `dive_files.read_dive_records`."""
    records = read_dive_records(file, columns, declination=declination, attack=attack)
    return DiveCurrents(tuple(DiveCurrent(record, _averaged(record, errors)) for record in records), errors)


def _averaged(dive: DiveRecord, errors: SensorErrors) -> AveragedCurrent:
    if dive.modelled:
        errors = replace(errors, speed=max(errors.speed, MODELLED))
    below = dive.ended - dive.began - dive.surface
    require(below > 0, f"dive {dive.name} is all its time at the surface, {dive.surface:g} s; mend `surface`")
    return averaged_current(
        dive.over_ground, dive.through_water, below, surface=dive.surface, drift=dive.drift, errors=errors
    )
