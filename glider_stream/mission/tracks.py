"""The file of a campaign's tracks: HDF5, all runs of all policies."""

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ..base.output import replacing
from ..roadmap.problem import Problem
from .campaign import Campaign
from .run import ENDS, Outcome

FORMAT, FORMAT_VERSION = "glider-stream/tracks", 1
COLUMNS: dict[str, tuple[str, str]] = {
    "number": ("1", "number of the run"),
    "time": ("s", "time since departure at the end"),
    "energy": ("J", "energy used"),
    "surfacings": ("1", "surfacings"),
    "failed": ("1", "calls that failed"),
    "plans": ("1", "plans that were made"),
    "without": ("1", "calls at which no plan was found"),
    "off": ("m", "distance from the goal at the end"),
    "planned": ("s", "time that the first plan should take"),
}


def write_tracks(campaign: Campaign, problem: Problem, path: Path) -> None:
    """Write the tracks and outcomes of a campaign; an old file is replaced whole or not at all.

    `outcomes/` has a value for each run of each policy, `tracks/` the rows of all: those of outcome n are
    indptr[n] to indptr[n + 1]. The same campaign makes the same bytes.
    """
    import h5py

    outcomes = [outcome for run in campaign.runs for outcome in run]
    policies = list(campaign.mission.pilot.policies)
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = FORMAT, FORMAT_VERSION
        file.attrs["software_version"] = version("glider-stream")
        file.attrs["title"], file.attrs["mission"] = campaign.mission.title, campaign.mission.text
        file.attrs["policies"], file.attrs["ends"] = policies, list(ENDS)
        for name, (unit, what) in COLUMNS.items():
            values = np.array([getattr(outcome, name) for outcome in outcomes])
            _write(file, f"outcomes/{name}", values, unit, what)
        index = np.array([policies.index(outcome.policy) for outcome in outcomes])
        _write(file, "outcomes/policy", index, "1", "number of the policy among `policies`")
        index = np.array([ENDS.index(outcome.ended) for outcome in outcomes])
        _write(file, "outcomes/ended", index, "1", "number of the end among `ends`")
        _write_rows(file, problem, outcomes)


def _write_rows(file: Any, problem: Problem, outcomes: list[Outcome]) -> None:
    rows = np.concatenate([outcome.track for outcome in outcomes])
    first = np.concatenate([[0], np.cumsum([len(outcome.track) for outcome in outcomes])])
    _write(file, "tracks/indptr", first, "1", "first row of each outcome")
    names = ("time", "s", "time since departure"), ("x", "m", "east"), ("y", "m", "north"), ("z", "m", "upward")
    for (name, unit, what), column in zip(names, rows.T, strict=True):
        _write(file, f"tracks/{name}", np.ascontiguousarray(column), unit, what)
    if problem.to_lonlat is not None:
        lonlat = problem.to_lonlat(rows[:, 1:])
        _write(file, "tracks/lonlat", lonlat, "degrees", "longitude and latitude")


def _write(file: Any, name: str, values: Any, unit: str, what: str) -> None:
    dataset = file.create_dataset(
        name, data=values, chunks=True, compression="gzip", shuffle=True, fletcher32=True
    )
    dataset.attrs["units"], dataset.attrs["long_name"] = unit, what
