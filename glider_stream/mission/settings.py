"""Mission files: makes settings from MISSION.toml, and checks every key."""

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from ..base.checks import LONGEST, WIDEST
from ..base.settings import from_table, require
from ..base.toml import check_depth, to_toml
from ..scenario import (
    FILES,
    SECTIONS,
    Scenario,
    read_scenario,
    read_table,
    scenario_from_table,
    set_key,
    shipped_scenarios,
)
from ..search.surfacing import Surfacing
from ..vehicle.cost import Energy, energy_from_table

POLICIES = ("open-loop", "replan", "assimilate", "straight", "depth-averaged", "omniscient")
"""The names of the policies; `pilot` has a class for each."""
MOST_DEGREES = 180.0
MOST_SHARE = 10.0
"""A forecast whose error is larger than this many times the true current is surely a slip."""


@dataclass(frozen=True)
class ForecastError:
    """The error that is added to the true current to make the forecast: a random current without divergence.

    `rms_share`: its rms speed, as a share of the true current's. `length_m`, `depth_m`, `time_s`: the distances,
    depths and times over which it loses its memory (a Gaussian correlation exp(-d^2 / 2 L^2) of its stream
    function). `depth_m` may be "all" for an error that is the same at all depths, and `time_s` may be "steady".
    """

    rms_share: float
    length_m: float
    depth_m: float | Literal["all"]
    time_s: float | Literal["steady"]

    def __post_init__(self) -> None:
        share = self.rms_share
        fits = 0 <= share <= MOST_SHARE
        require(fits, f"`forecast_error.rms_share` must be from 0 to {MOST_SHARE:g}; got {share:g}")
        _check(self.length_m, "forecast_error.length_m", WIDEST, "m")
        if not isinstance(self.depth_m, str):
            _check(self.depth_m, "forecast_error.depth_m", WIDEST, "m")
        if not isinstance(self.time_s, str):
            _check(self.time_s, "forecast_error.time_s", LONGEST, "s")


@dataclass(frozen=True)
class VehicleSettings:
    """How the vehicle executes its orders; errors are standard deviations, drawn from normal distributions.

    `steering`: "trims" (the plan's headings and glide angles, leg by leg) or "waypoints" (it heads for the places
    where the plan surfaces). `heading_bias_deg` and `speed_bias` are drawn once a run, `heading_error_deg`,
    `speed_error` and `depth_error_m` for each leg; speeds are shares. `call_minutes`: the time at the surface of
    each call, during which it drifts. `fix_error_m`: of a position fix, in each direction. `call_failure`: the
    probability that a call brings no new orders. `waypoint_radius_m`: a waypoint counts as reached this near.
    """

    steering: Literal["trims", "waypoints"]
    heading_bias_deg: float
    heading_error_deg: float
    speed_bias: float
    speed_error: float
    depth_error_m: float
    call_minutes: float
    fix_error_m: float
    call_failure: float
    waypoint_radius_m: float

    def __post_init__(self) -> None:
        most = {
            "heading_bias_deg": (MOST_DEGREES, "degrees"),
            "heading_error_deg": (MOST_DEGREES, "degrees"),
            "speed_bias": (0.25, "of the speed"),
            "speed_error": (0.25, "of the speed"),
            "depth_error_m": (1e3, "m"),
            "call_minutes": (LONGEST / 60, "minutes"),
            "fix_error_m": (1e5, "m"),
            "call_failure": (1.0, "(a probability)"),
        }
        for name, (limit, unit) in most.items():
            value = getattr(self, name)
            require(0 <= value <= limit, f"`vehicle.{name}` must be from 0 to {limit:g} {unit}; got {value:g}")
        _check(self.waypoint_radius_m, "vehicle.waypoint_radius_m", WIDEST, "m")


@dataclass(frozen=True)
class PilotSettings:
    """The policies, and how often the vehicle comes up: at the latest after so many yos and so many hours."""

    policies: tuple[str, ...]
    most_yos: int | None = None
    most_hours: float | None = None

    def __post_init__(self) -> None:
        choices = ", ".join(POLICIES)
        for name in self.policies:
            require(
                name in POLICIES, f"`pilot.policies` names {name!r}, which is not known; choose from: {choices}"
            )
        several = len(self.policies) > 0 and len(set(self.policies)) == len(self.policies)
        require(several, f"`pilot.policies` must name each policy once; got {list(self.policies)}")
        cure = "give `pilot.most_yos`, `pilot.most_hours` or both"
        given = self.most_yos is not None or self.most_hours is not None
        require(given, f"the vehicle must come up to be given new orders; {cure}")
        Surfacing(self.most_yos, self.most_hours)  # checks the values

    @property
    def rule(self) -> Surfacing:
        """The rule of surfacing."""
        return Surfacing(self.most_yos, self.most_hours)


@dataclass(frozen=True)
class Arrival:
    """A run arrives if the vehicle is up within `radius_m` of the goal, at most `longest_hours` later."""

    radius_m: float
    longest_hours: float

    def __post_init__(self) -> None:
        _check(self.radius_m, "arrival.radius_m", WIDEST, "m")
        _check(self.longest_hours, "arrival.longest_hours", LONGEST / 3600, "hours")

    @property
    def longest(self) -> float:
        """The longest time of a run [s]."""
        return 3600.0 * self.longest_hours


@dataclass(frozen=True)
class Random:
    """The seed of all random numbers of a campaign."""

    seed: int

    def __post_init__(self) -> None:
        require(self.seed >= 0, f"`random.seed` must be at least 0; got {self.seed}")


@dataclass(frozen=True)
class ScenarioChoice:
    """The scenario: a file or a shipped `name`, and texts section.key=value that override its keys."""

    name: str
    set: tuple[str, ...] = ()


@dataclass(frozen=True)
class Mission:
    """A mission as its file describes it; `text` is the complete TOML, with the scenario's.

    The forecast is the true current with the error of `forecast_error`; or else the scenario's own current is the
    forecast, and `truth` has the same sections with the true current.
    """

    scenario: Scenario
    truth: Scenario | None
    forecast_error: ForecastError | None
    vehicle: VehicleSettings
    pilot: PilotSettings
    arrival: Arrival
    energy: Energy
    random: Random
    text: str
    title: str


SECTIONS_OF_MISSION = {
    "scenario": "the scenario: `name`, and `set` to override its keys",
    "truth": "the true current, in the form of a scenario's [flow]",
    "forecast_error": "the error of the forecast: rms_share, length_m, depth_m, time_s",
    "vehicle": "how the vehicle executes its orders",
    "pilot": "the policies, and how often the vehicle comes up",
    "arrival": "radius_m and longest_hours",
    "energy": 'what the vehicle uses, in the form of a scenario\'s [cost] of kind "energy"',
    "random": "the seed",
}


def shipped_missions() -> dict[str, Path]:
    """Return the missions that come with the package, by name."""
    folder = Path(str(files("glider_stream"))) / "data" / "missions"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def read_mission(name: str | Path, overrides: Sequence[str] = ()) -> Mission:
    """Return the mission in a TOML file, or a shipped one by its name.

    `overrides` are texts section.key=value, for sections of the mission or of its scenario. A scenario file is
    looked for beside the mission.
    """
    path = Path(name)
    if not path.is_file() and str(name) in shipped_missions():
        path = shipped_missions()[str(name)]
    known = ", ".join(shipped_missions())
    exists = path.is_file()
    require(
        exists, f"the mission {name} is neither a file nor a shipped mission; choose a file, or one of: {known}"
    )
    table = read_table(path, f"the mission {name}")
    mine = [text for text in overrides if _section(text) in SECTIONS_OF_MISSION]
    others = [text for text in overrides if text not in mine]
    unknown = [text for text in others if _section(text) not in SECTIONS]
    sections = ", ".join([*SECTIONS_OF_MISSION, *SECTIONS])
    require(
        not unknown, f"`--set {unknown[:1]}` names no section of a mission or a scenario; choose from: {sections}"
    )
    for text in mine:
        set_key(table, text)
    return mission_from_table(table, path, others)


def _section(override: str) -> str:
    return override.partition("=")[0].partition(".")[0].strip()


def mission_from_table(table: Mapping[str, Any], path: Path, overrides: Sequence[str] = ()) -> Mission:
    """Return the mission of a table, with every key checked; `overrides` are for keys of its scenario."""
    for name, block in table.items():
        choices = ", ".join(SECTIONS_OF_MISSION)
        require(
            name in SECTIONS_OF_MISSION, f"the section `{name}` of a mission is not known; choose from: {choices}"
        )
        require(isinstance(block, Mapping), f"`{name}` must be a section, [{name}]; got {block!r}")
    for name, what in SECTIONS_OF_MISSION.items():
        needed = name not in ("truth", "forecast_error")
        require(name in table or not needed, f"the section [{name}] of the mission is missing; add it: {what}")
    both = "truth" in table, "forecast_error" in table
    cure = "say what the forecast gets wrong by one of [truth] and [forecast_error]"
    require(sum(both) == 1, f"{cure}; got {'both' if all(both) else 'neither'}")
    check_depth(table, "the mission")
    scenario = _scenario(from_table(ScenarioChoice, table["scenario"], "scenario"), path.parent, overrides)
    truth = None
    if "truth" in table:
        truth = scenario_from_table({**tomllib.loads(scenario.text), "flow": table["truth"]}, path.parent)
    vehicle = from_table(VehicleSettings, table["vehicle"], "vehicle")
    arrival = from_table(Arrival, table["arrival"], "arrival")
    wide = vehicle.waypoint_radius_m <= arrival.radius_m
    cure = f"`arrival.radius_m`, {arrival.radius_m:g} m: who has reached the last waypoint would not have arrived"
    require(wide, f"`vehicle.waypoint_radius_m` = {vehicle.waypoint_radius_m:g} m must not be above {cure}")
    error = None
    if "forecast_error" in table:
        error = from_table(ForecastError, table["forecast_error"], "forecast_error")
    pilot = from_table(PilotSettings, table["pilot"], "pilot")
    told = error is not None or "assimilate" not in pilot.policies
    why = "the policy `assimilate` needs [forecast_error], which says how far errors reach; got [truth]"
    require(told, f"{why}; leave it out of `pilot.policies`")
    kept = {name: dict(table[name]) for name in SECTIONS_OF_MISSION if name in table and name != "scenario"}
    if truth is not None:
        kept["truth"] = tomllib.loads(truth.text)["flow"]
    return Mission(
        scenario=scenario,
        truth=truth,
        forecast_error=error,
        vehicle=vehicle,
        pilot=pilot,
        arrival=arrival,
        energy=from_table(Energy, energy_from_table(dict(table["energy"])), "energy"),
        random=from_table(Random, table["random"], "random"),
        text=to_toml({**kept, "scenario": tomllib.loads(scenario.text)}),
        title=path.stem,
    )


def _scenario(choice: ScenarioChoice, folder: Path, overrides: Sequence[str]) -> Scenario:
    """Return the scenario; its file, and files in `set`, are named relative to the mission's folder."""
    beside = folder / choice.name
    shipped = choice.name in shipped_scenarios() and not beside.is_file()
    name = choice.name if shipped else str(beside)
    return read_scenario(name, [*(_located(text, folder) for text in choice.set), *overrides])


def _located(override: str, folder: Path) -> str:
    """Return an override whose value, if it is the name of a file, is absolute."""
    place, _, value = override.partition("=")
    if place.rpartition(".")[2].strip() not in FILES or value.lstrip().startswith("["):
        return override
    return f"{place}={json.dumps(str((folder / value.strip().strip(chr(34))).absolute()))}"


def _check(value: float, where: str, most: float, unit: str) -> None:
    require(0 < value <= most, f"`{where}` must be above 0 and at most {most:g} {unit}; got {value:g}")
