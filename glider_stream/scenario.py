"""Scenarios: TOML into objects, every key checked; the problem that they make."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from .domain import BoxDomain, GeographicDomain, Point, domain_from_table
from .edges import METHODS, Evaluator, IntegrationSettings, StreamlineMethod
from .errors import InputError
from .flow import FLOWS, AnalyticFlow, divergence_ratio, is_steady, sample_flow
from .glider import Glider, glider_from_table, polar
from .kernels.flow import Flow
from .kernels.terrain import OpenWater, Terrain
from .neighbours import NEIGHBOURS, NeighbourLaw
from .ocean import OceanFlow
from .roadmap import Problem
from .sampling import SAMPLERS, Sampler
from .settings import from_kinds, from_table, require

SECTIONS = ("flow", "glider", "domain", "sampling", "neighbours", "steering", "integration", "cost", "query")


@dataclass(frozen=True)
class TravelTime:
    """An edge costs the time that it takes [s]."""


COSTS: dict[str, type[TravelTime]] = {"time": TravelTime}


@dataclass(frozen=True)
class QueryPoints:
    """`start` and `goal` in the domain's coordinates; gliders leave every node at `departure` [s]."""

    start: Point
    goal: Point
    departure: float = 0.0


@dataclass(frozen=True)
class Scenario:
    """One block each; `text` is the resolved TOML."""

    domain: BoxDomain | GeographicDomain
    flow: AnalyticFlow | OceanFlow
    glider: Glider
    sampler: Sampler
    law: NeighbourLaw
    method: StreamlineMethod
    integration: IntegrationSettings
    cost: TravelTime
    query: QueryPoints | None
    text: str

    def problem(self) -> Problem:
        """Build flow, terrain and glide polar, and put everything together."""
        lo, hi = self.domain.box()
        table, frame = polar(self.glider), self.domain.frame()
        horizon = self.integration.dt * self.integration.steps
        flow, terrain, words = self._waters(float(table.best_horizontal.max()) * horizon, horizon)
        require(
            flow.t_lo <= self.departure <= flow.t_hi,
            f"`query.departure` = {self.departure:g} s lies outside the times of the flow, {flow.t_lo:g} to {flow.t_hi:g} s",
        )
        ratio = divergence_ratio(flow, (lo[0], hi[0]), (lo[1], hi[1]), (lo[2], hi[2]), self.departure)
        words += f", at most {flow.max_speed:.2f} m/s, divergence {ratio:.2g} of vorticity"
        if not is_steady(flow):
            words += f"; it changes with time, and legs hold for departure at {self.departure:g} s"
        return Problem(
            evaluator=Evaluator(flow, terrain, table, self.method, self.integration),
            sampler=self.sampler,
            law=self.law,
            lo=lo,
            hi=hi,
            departure=self.departure,
            start=None if self.query is None else self.domain.point(self.query.start),
            goal=None if self.query is None else self.domain.point(self.query.goal),
            scenario=self.text,
            flow_words=words,
            glider_words=str(self.glider),
            to_lonlat=None if frame is None else lambda xyz: np.stack(frame.to_lonlat(xyz[:, 0], xyz[:, 1]), axis=-1),
        )

    @property
    def departure(self) -> float:
        """When gliders leave their nodes [s]."""
        return 0.0 if self.query is None else self.query.departure

    def _waters(self, glide: float, horizon: float) -> tuple[Flow, Terrain, str]:
        """Flow and terrain; `glide` [m] is how far a glider gets in still water within the horizon [s]."""
        if isinstance(self.flow, OceanFlow):
            require(
                isinstance(self.domain, GeographicDomain),
                "a flow from a current file needs a domain in `lon`, `lat` and `depth`; got x, y, z",
            )
            assert isinstance(self.domain, GeographicDomain)
            return self.flow.waters(self.domain.frame(), self.domain.lon, self.domain.lat, self.domain.depth)
        lo, hi = self.domain.box()
        flow = self.flow.kernel((lo[2], hi[2]))
        if self.flow.sampled is not None:
            # no path between two nodes strays further from the box than half of what a leg can cover
            stray = (glide + flow.max_speed * horizon) / 2
            x, y, z = ((lo[n] - stray, hi[n] + stray) for n in range(3))
            flow = sample_flow(flow, self.flow.sampled, x, y, (lo[2], hi[2]))
        kind = next(name for name, one in FLOWS.items() if one is type(self.flow))
        words = kind if self.flow.sampled is None else f"{kind}, sampled every {list(self.flow.sampled)} m"
        return flow, OpenWater(-np.inf), words


def shipped_scenarios() -> dict[str, Path]:
    """The scenarios that come with the package, by name."""
    folder = Path(str(files("glider_stream"))) / "data"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def read_scenario(name: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """A scenario from a TOML file, or a shipped one by its name; `overrides`: section.key=value."""
    path = Path(name)
    if not path.exists() and str(name) in shipped_scenarios():
        path = shipped_scenarios()[str(name)]
    shipped = ", ".join(shipped_scenarios())
    require(path.is_file(), f"the scenario {name} is no file, and none of those shipped: {shipped}")
    try:
        text = path.read_text(encoding="utf-8")
        table = tomllib.loads(text)
    except OSError as error:
        raise InputError(f"the scenario {name} cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"the scenario {name} is not valid TOML: {error}") from None
    for override in overrides:
        _set(table, override)
    return scenario_from_table(table, path.parent)


def scenario_from_text(text: str) -> Scenario:
    """The scenario that a roadmap carries."""
    try:
        return scenario_from_table(tomllib.loads(text), Path())
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"the roadmap's scenario is not valid TOML: {error}") from None


def scenario_from_table(table: Mapping[str, Any], folder: Path) -> Scenario:
    """Check every block; relative file names are relative to `folder`."""
    for name, block in table.items():
        require(name in SECTIONS, f"the section `{name}` is not known; choose from: {', '.join(SECTIONS)}")
        require(isinstance(block, Mapping), f"`{name}` must be a section, [{name}]; got {block!r}")
    for name in SECTIONS:
        require(name in table or name == "query", f"the section [{name}] is missing; add it")
    flow = dict(table["flow"])
    if flow.get("kind") == "netcdf" and isinstance(flow.get("file"), (str, list)):
        names = [flow["file"]] if isinstance(flow["file"], str) else flow["file"]
        flow["file"] = [str((folder / str(name)).absolute()) for name in names]
    flow_kinds: dict[str, type[AnalyticFlow | OceanFlow]] = {**FLOWS, "netcdf": OceanFlow}
    return Scenario(
        domain=domain_from_table(table["domain"]),
        flow=from_kinds(flow_kinds, flow, "flow"),
        glider=glider_from_table(table["glider"]),
        sampler=from_kinds(SAMPLERS, table["sampling"], "sampling"),
        law=from_kinds(NEIGHBOURS, table["neighbours"], "neighbours"),
        method=from_kinds(METHODS, table["steering"], "steering", selector="method"),
        integration=from_table(IntegrationSettings, table["integration"], "integration"),
        cost=from_kinds(COSTS, table["cost"], "cost"),
        query=from_table(QueryPoints, table["query"], "query") if "query" in table else None,
        text=to_toml({**table, "flow": flow}),
    )


def _set(table: dict[str, Any], override: str) -> None:
    place, equals, text = override.partition("=")
    keys = place.strip().split(".")
    require(bool(equals) and len(keys) >= 2 and all(keys), f"`--set` takes section.key=value; got {override!r}")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    for key in keys[:-1]:
        table = table.setdefault(key, {})
        require(isinstance(table, dict), f"`--set {override}`: `{key}` is no section")
    table[keys[-1]] = value


def to_toml(table: Mapping[str, Any], prefix: str = "") -> str:
    """A nested table as TOML text: values first, then sub-tables, then lists of tables."""
    lines, below = [], []
    for key, value in table.items():
        if isinstance(value, Mapping):
            below.append(f"[{prefix}{key}]\n{to_toml(value, f'{prefix}{key}.')}")
        elif isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
            below.extend(f"[[{prefix}{key}]]\n{to_toml(one, f'{prefix}{key}.')}" for one in value)
        else:
            lines.append(f"{key} = {_toml_value(value)}\n")
    return "".join(lines) + "".join(below)


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, list):
        return "[" + ", ".join(_toml_value(one) for one in value) + "]"
    escaped = str(value).replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
