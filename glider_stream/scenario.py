"""Scenarios: makes objects from TOML, checks every key, and builds the problem."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import UTC, date, datetime, timedelta
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

import numpy as np

from .base.arrays import Array
from .base.checks import FASTEST, LONGEST
from .base.errors import InputError
from .base.settings import from_kinds, from_table, require
from .base.toml import check_depth, to_toml
from .kernels.flow import Flow, max_rise, rises
from .kernels.terrain import OpenWater, Seabed, Terrain
from .roadmap.evaluator import Evaluator
from .roadmap.inputs import KEYS, located, names_of, renamed
from .roadmap.neighbours import NEIGHBOURS, NeighbourLaw, Reachable
from .roadmap.nodes import SAMPLERS, Sampler, YoSampler
from .roadmap.problem import Problem
from .roadmap.roadmap import Roadmap
from .roadmap.slices import SlicedRoadmap
from .roadmap.steering import METHODS, FlowMapMethod, IntegrationSettings, Method
from .vehicle.cost import Cost, Energy, TravelTime, energy_from_table
from .vehicle.models import Glider
from .vehicle.polar import polar
from .vehicle.presets import glider_from_table
from .water.analytic import FLOWS, AnalyticFlow
from .water.domain import BoxDomain, GeographicDomain, Point, domain_from_table
from .water.inspect import divergence_ratio, is_steady
from .water.ocean import OceanFlow, parse_time
from .water.ocean.bottom import Bottom
from .water.sampled import sample_flow, sampling_error
from .water.terrain import TerrainSettings, raster_terrain

SECTIONS = (
    "flow",
    "terrain",
    "glider",
    "domain",
    "sampling",
    "neighbours",
    "steering",
    "integration",
    "cost",
    "query",
    "departures",
)
OPTIONAL = ("terrain", "query", "departures")


COSTS: dict[str, type[Cost]] = {"time": TravelTime, "energy": Energy}
MOST_SLICES = 10_000
FILES = {key for keys in KEYS.values() for key in keys}
"""The keys whose values are names of files."""
KINDS: dict[str, tuple[str, Mapping[str, type[Any]]]] = {
    "flow": ("kind", {**FLOWS, "netcdf": OceanFlow}),
    "sampling": ("kind", SAMPLERS),
    "neighbours": ("kind", NEIGHBOURS),
    "steering": ("method", METHODS),
    "cost": ("kind", COSTS),
}
"""The sections with several kinds: the key that selects the kind, and its choices."""


@dataclass(frozen=True)
class QueryPoints:
    """The query: `start` and `goal` in the domain's coordinates; a route leaves at `departure` [s].

    `most_yos` and `most_hours`: the most yos and hours from one surfacing to the next, or None. In a flow that
    changes, each leg leaves when the last one arrives. With `frozen` all legs meet the current of the departure.
    `bins` [s]: paths to a node that arrive in different bins of time are kept side by side, since a later
    departure may arrive earlier.
    """

    start: Point
    goal: Point
    departure: float = 0.0
    most_yos: int | None = None
    most_hours: float | None = None
    frozen: bool = False
    bins: float | None = None

    def __post_init__(self) -> None:
        fits = self.bins is None or 0 < self.bins <= LONGEST
        require(fits, f"`query.bins` must be above 0 s and at most {LONGEST:g} s; got {self.bins}")
        fits = abs(self.departure) <= LONGEST
        require(fits, f"`query.departure` must be within {LONGEST:g} s of 0; got {self.departure:g}")


@dataclass(frozen=True)
class Departures:
    """The departures of a roadmap's slices [s]: from `first` to `last`, one `every` so many seconds."""

    first: float
    last: float
    every: float

    def __post_init__(self) -> None:
        for name in ("first", "last"):
            value = getattr(self, name)
            fits = abs(value) <= LONGEST
            require(fits, f"`departures.{name}` must be within {LONGEST:g} s of 0; got {value:g}")
        rises = self.first <= self.last
        require(rises, f"`departures.last` must not be before `first`, {self.first:g} s; got {self.last:g}")
        require(self.every > 0, f"`departures.every` must be above 0 s; got {self.every:g}")
        count = (self.last - self.first) / self.every + 1
        least = (self.last - self.first) / (MOST_SLICES - 1)
        require(
            count <= MOST_SLICES,
            f"`departures.every` = {self.every:g} s makes {count:,.0f} departures, more than {MOST_SLICES:,}; "
            f"make it at least {least:.6g}",
        )

    def times(self) -> tuple[float, ...]:
        """Return all departures, rising."""
        steps = math.floor((self.last - self.first) / self.every * (1 + 1e-12))
        times = [min(self.first + n * self.every, self.last) for n in range(steps + 1)]
        return tuple(times) if times[-1] == self.last else (*times, self.last)


@dataclass(frozen=True)
class Scenario:
    """A problem as the TOML file describes it: one object for each section; `text` is the complete TOML.

    Examples:
        >>> scenario = glider_stream.read_scenario("seed-box")
        >>> scenario.query.start, scenario.sampler
        ((-450.0, 450.0, 0.0), GridSampler(shape=(16, 16, 4)))
    """

    domain: BoxDomain | GeographicDomain
    flow: AnalyticFlow | OceanFlow
    terrain: TerrainSettings
    glider: Glider
    sampler: Sampler
    law: NeighbourLaw | Reachable
    method: Method
    integration: IntegrationSettings
    cost: Cost
    query: QueryPoints | None
    text: str
    departures: Departures | None = None

    def problem(self) -> Problem:
        """Return the problem: flow, terrain, glide polar, and all else that a search needs."""
        lo, hi = self.domain.box()
        table, frame = polar(self.glider), self.domain.frame()
        horizon = self.integration.dt * self.integration.steps
        flow, terrain, text = self._waters(float(table.best_horizontal.max()) * horizon, horizon)
        known = flow.extent
        times = f"the times of the flow, {known.t_lo:g} to {known.t_hi:g} s"
        within = known.t_lo <= self.departure <= known.t_hi
        require(within, f"`query.departure` = {self.departure:g} s lies outside {times}; choose one of them")
        fast = f"the current of the flow must be at most {FASTEST:g} m/s; got {known.max_speed:g}: mend [flow]"
        require(known.max_speed <= FASTEST, fast)
        ratio = divergence_ratio(flow, (lo[0], hi[0]), (lo[1], hi[1]), (lo[2], hi[2]), self.departure)
        text += f", at most {known.max_speed:.2f} m/s, divergence {ratio:.2g} of vorticity"
        if not is_steady(flow):
            text += f"; it changes with time, and legs hold for {self._when()}"
        sampler = self.sampler
        if isinstance(sampler, YoSampler):
            sampler = sampler.for_glide(float(table.best_angle.max()))
        if frame is not None and isinstance(self.domain, GeographicDomain):
            error = frame.scale_error(self.domain.lon, self.domain.lat)
            text += f"; metres about {frame.lon:.4g}, {frame.lat:.4g}, wrong by up to {100 * error:.2g} %"
        return Problem(
            evaluator=Evaluator(flow, terrain, table, self.method, self.integration, self.cost),
            sampler=sampler,
            law=self.law,
            lo=lo,
            hi=hi,
            departure=self.departure,
            start=None if self.query is None else self.domain.point(self.query.start),
            goal=None if self.query is None else self.domain.point(self.query.goal),
            scenario=self.text,
            flow_words=text,
            glider_words=str(self.glider),
            to_lonlat=None if frame is None else lambda at: np.stack(frame.to_lonlat(*at[:, :2].T), axis=-1),
            departs=self._departs(),
            frozen=self.query is not None and self.query.frozen,
            bins=None if self.query is None else self.query.bins,
            domain=self.domain,
            slices=self._slices(flow),
        )

    def _told_rise(self, flow: Flow) -> str:
        """Return a text on the vertical part of a flow; empty if it has none."""
        if not rises(flow):
            return ""
        line = (
            "" if isinstance(self.method, FlowMapMethod) else ", which the controls of this method do not foresee"
        )
        return f", with a vertical current of up to {max_rise(flow):.3g} m/s{line}"

    @property
    def departure(self) -> float:
        """The time when gliders leave their nodes [s]."""
        return 0.0 if self.query is None else self.query.departure

    def _when(self) -> str:
        several = self.departures is not None and self.departures.first < self.departures.last
        return "the departures of their slices" if several else f"departure at {self.departure:g} s"

    def _slices(self, flow: Flow) -> tuple[float, ...]:
        """The departures of the roadmap's slices [s]; empty without a section [departures]."""
        if self.departures is None:
            return ()
        first, last, known = self.departures.first, self.departures.last, flow.extent
        why = "[departures] makes slices of a flow that changes, and this one does not; remove that section"
        require(not is_steady(flow), why)
        span = f"the times of the flow, {known.t_lo:g} to {known.t_hi:g} s"
        for name, value in (("first", first), ("last", last)):
            within = known.t_lo <= value <= known.t_hi
            require(within, f"`departures.{name}` = {value:g} s lies outside {span}; choose one of them")
        require(
            first <= self.departure <= last,
            f"`query.departure` = {self.departure:g} s lies outside [departures], {first:g} to {last:g} s; "
            "choose a time between",
        )
        return self.departures.times()

    def _departs(self) -> datetime | None:
        """The date when gliders leave (UTC), or None if the flow has no date."""
        if not isinstance(self.flow, OceanFlow) or self.flow.epoch is None:
            return None
        epoch = parse_time(self.flow.epoch, "`flow.epoch`").item()
        return cast(datetime, epoch).replace(tzinfo=UTC) + timedelta(seconds=self.departure)

    def _waters(self, glide: float, horizon: float) -> tuple[Flow, Terrain, str]:
        """Return flow, terrain and a text on them; `glide` [m] is the way in still water within `horizon` [s]."""
        if isinstance(self.flow, OceanFlow):
            require(
                isinstance(self.domain, GeographicDomain),
                "a flow from a current file needs a domain in `lon`, `lat` and `depth`; got x, y, z",
            )
            assert isinstance(self.domain, GeographicDomain)
            domain, frame = self.domain, self.domain.frame()
            ocean, bottom, description = self.flow.waters(frame, domain.lon, domain.lat, domain.depth)
            known = ocean.extent
            rim = np.array([known.x_lo, known.y_lo]), np.array([known.x_hi, known.y_hi])
            seabed, also = self._grounds(rim, [bottom])
            return ocean, seabed, f"{description}; {also}"
        lo, hi = self.domain.box()
        flow = self.flow.kernel((lo[2], hi[2]))
        if self.flow.sampled is not None:
            # no path between two nodes leaves the box by more than half the length of the longest leg
            stray = (glide + flow.extent.max_speed * horizon) / 2
            x, y = ((lo[n] - stray, hi[n] + stray) for n in range(2))
            exact, flow = flow, sample_flow(flow, self.flow.sampled, x, y, (lo[2], hi[2]))
        text = next(name for name, kind in FLOWS.items() if kind is type(self.flow))
        if self.flow.sampled is not None:
            known = flow.extent
            box = (
                (max(lo[0], known.x_lo), min(hi[0], known.x_hi)),
                (max(lo[1], known.y_lo), min(hi[1], known.y_hi)),
            )
            off = sampling_error(exact, flow, *box, (lo[2], hi[2]))
            spacing = ", ".join(f"{step:g}" for step in self.flow.sampled)
            text += f", sampled every {spacing} m, off by at most {off:.2g} m/s"
        text += self._told_rise(flow)
        if self.terrain == TerrainSettings():
            return flow, OpenWater(-np.inf), text
        if self.terrain == TerrainSettings(max_depth=self.terrain.max_depth):
            return flow, OpenWater(-float(self.terrain.max_depth or np.inf)), text
        wide = (glide + flow.extent.max_speed * horizon) / 2
        seabed, also = self._grounds((lo[:2] - wide, hi[:2] + wide), [])
        return flow, seabed, f"{text}; {also}"

    def _grounds(self, box: tuple[Array, Array], bottoms: list[Bottom]) -> tuple[Seabed, str]:
        """Return the terrain over a box [m] and a text on it: the known bottoms and the [terrain] section."""
        require(
            isinstance(self.domain, GeographicDomain),
            "[terrain] needs a domain in `lon`, `lat` and `depth`, except for `max_depth`; got x, y, z",
        )
        assert isinstance(self.domain, GeographicDomain)
        domain, frame, settings = self.domain, self.domain.frame(), self.terrain
        if settings.bathymetry is not None:
            from .water.ocean.bathymetry import read_bathymetry

            lo, hi = domain.box()
            stray = float(max((lo[:2] - box[0]).max(), (box[1] - hi[:2]).max()))
            text = settings.variable, settings.positive, settings.names
            bottoms = [
                *bottoms,
                read_bathymetry(settings.bathymetry, frame, domain.lon, domain.lat, stray, *text),
            ]
        return raster_terrain(settings, frame, *box, bottoms, domain.box())


def shipped_scenarios() -> dict[str, Path]:
    """Return the scenarios that come with the package, by name.

    Examples:
        >>> "seed-box" in glider_stream.shipped_scenarios()
        True
    """
    folder = Path(str(files("glider_stream"))) / "data"
    return {path.stem: path for path in sorted(folder.glob("*.toml"), key=lambda path: path.stem)}


def read_scenario(name: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Return the scenario in a TOML file, or a shipped one by its name.

    `overrides` are texts section.key=value. If they choose another kind of a section, the keys of the old kind
    that the new kind does not have are dropped, unless they are also overridden. File names in the scenario are
    relative to its folder, those in overrides to the working folder.

    Examples:
        >>> scenario = glider_stream.read_scenario("seed-box", ["steering.method=flow-map"])
        >>> scenario.domain.z
        (-300.0, 0.0)
    """
    path = Path(name)
    if not path.is_file() and str(name) in shipped_scenarios():
        path = shipped_scenarios()[str(name)]
    shipped = ", ".join(shipped_scenarios())
    require(
        path.is_file(),
        f"the scenario {name} is neither a file nor a shipped scenario; choose a file, or one of: {shipped}",
    )
    table = read_table(path, f"the scenario {name}")
    _override(table, overrides)
    check_depth(table, "`--set`")
    return scenario_from_table(table, path.parent)


def read_table(path: Path, what: str) -> dict[str, Any]:
    """Return the table of a TOML file; `what` names the file in the sentence of an InputError."""
    try:
        # some editors write a byte order mark at the start
        table = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{what} cannot be read: {error.strerror}; name another") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{what} is not UTF-8 text ({error}); save it as UTF-8") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{what} is not valid TOML: {error}; mend this place") from None
    check_depth(table, what)
    return table


def scenario_from_text(
    text: str, overrides: Sequence[str] = (), whose: str = "the roadmap's scenario"
) -> Scenario:
    """Return the scenario from the text that a roadmap or a plan holds; `overrides` as in `read_scenario`."""
    try:
        table = tomllib.loads(text)
        check_depth(table, whose)
        _override(table, overrides)
        return scenario_from_table(table, Path())
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{whose} is not valid TOML: {error}") from None


def with_currents(scenario: Scenario, currents: Sequence[str | Path], query: Mapping[str, Any]) -> Scenario:
    """Return a scenario that reads other current files; `query` replaces keys of its [query].

    If `query` names an `epoch` (ISO 8601), that is the flow's time 0 now. Slices of several departures are
    dropped, because their times are those of the old files.
    """
    table = tomllib.loads(scenario.text)
    kind = table["flow"].get("kind")
    require(kind == "netcdf", f'newer currents are for a flow from a file, kind = "netcdf"; this one is {kind!r}')
    table["flow"]["file"] = [str(Path(file).absolute()) for file in currents]
    asked = dict(query)
    if "epoch" in asked:
        table["flow"]["epoch"] = asked.pop("epoch")
    table["query"] = {**table.get("query", {}), **asked}
    table.pop("departures", None)
    return scenario_from_table(table, Path())


def scenario_of(road: Roadmap | SlicedRoadmap) -> Scenario:
    """Return the scenario that a roadmap holds; its files are found again if they or the roadmap have moved."""
    text = road.provenance.scenario
    try:
        table: dict[str, Any] = tomllib.loads(text)
    except (ValueError, RecursionError):
        return scenario_from_text(text)
    check_depth(table, "the roadmap's scenario")
    names, beside = names_of(table), Path() if road.file is None else road.file.absolute().parent
    given: dict[str, tuple[str, ...]] = {}
    for override in road.elsewhere:
        place = override.partition("=")[0].strip()
        choices = " or ".join(names) or "which has none"
        require(place in names, f"`--set` names a file of the roadmap's scenario, {choices}; got {override!r}")
        set_key(table, override)
        section, key = place.split(".")
        table[section] |= _located({key: table[section][key]}, Path())
        given[place] = names_of(table)[place]
    asked = {place: some for place, some in names.items() if place not in given}
    return scenario_from_table(renamed(table, located(asked, road.provenance.inputs, beside)), Path())


def scenario_from_table(table: Mapping[str, Any], folder: Path) -> Scenario:
    """Return the scenario of a table, with every key checked; file names are relative to `folder`."""
    for name, block in table.items():
        require(name in SECTIONS, f"the section `{name}` is not known; choose from: {', '.join(SECTIONS)}")
        require(isinstance(block, Mapping), f"`{name}` must be a section, [{name}]; got {block!r}")
    for name in SECTIONS:
        require(name in table or name in OPTIONAL, f"the section [{name}] is missing; add it")
    table = {**table, "flow": _located(_dated(table["flow"]), folder)}
    if table["cost"].get("kind") == "energy":
        table["cost"] = energy_from_table(table["cost"])
    if "terrain" in table:
        table["terrain"] = _located(table["terrain"], folder)
    blocks: dict[str, Any] = {
        name: from_kinds(kinds, table[name], name, selector) for name, (selector, kinds) in KINDS.items()
    }
    return Scenario(
        domain=domain_from_table(table["domain"]),
        flow=blocks["flow"],
        terrain=from_table(TerrainSettings, table.get("terrain", {}), "terrain"),
        glider=glider_from_table(table["glider"]),
        sampler=blocks["sampling"],
        law=blocks["neighbours"],
        method=blocks["steering"],
        integration=from_table(IntegrationSettings, table["integration"], "integration"),
        cost=blocks["cost"],
        query=from_table(QueryPoints, table["query"], "query") if "query" in table else None,
        text=to_toml(table),
        departures=from_table(Departures, table["departures"], "departures") if "departures" in table else None,
    )


def _dated(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section with TOML's dates as texts, so that `epoch = 2024-11-20T12:00:00` needs no quotes."""
    return {key: value.isoformat() if isinstance(value, date) else value for key, value in table.items()}


def _located(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return a table with absolute file names."""
    result = dict(table)
    for key in FILES & set(table):
        several = not isinstance(table[key], str)
        names = table[key] if several else [table[key]]
        if isinstance(names, list) and all(isinstance(name, str) for name in names):
            found = [str((folder / name).absolute()) for name in names]
            for name in found:
                # a roadmap holds it as text
                utf_8 = not any("\ud800" <= letter <= "\udfff" for letter in name)
                require(utf_8, f"`{key}` = {name!r} is not a name in UTF-8; rename the file or its folder")
            result[key] = found if several or key != "bathymetry" else found[0]
    return result


def _override(table: dict[str, Any], overrides: Sequence[str]) -> None:
    """Set each section.key=value, and drop the keys of kinds that are no longer chosen."""
    before = {section: _kind_keys(table, section) for section in KINDS}
    given = [set_key(table, override) for override in overrides]
    for section, key in (place for place in given if len(place) == 2 and place[1] in FILES):
        table[section] |= _located({key: table[section][key]}, Path())
    for section, keys in before.items():
        for key in keys - _kind_keys(table, section):
            if key in table[section] and not any(place[:2] == [section, key] for place in given):
                del table[section][key]


def _kind_keys(table: Mapping[str, Any], section: str) -> set[str]:
    """Return the keys of a section's chosen kind; empty if the choice is unknown."""
    selector, kinds = KINDS[section]
    block = table.get(section)
    name = block.get(selector) if isinstance(block, dict) else None
    kind = kinds.get(name) if isinstance(name, str) else None
    return {field.name for field in fields(kind) if field.init} if kind else set()


def set_key(table: dict[str, Any], override: str) -> list[str]:
    """Set a value, which is TOML or else a plain text, and return its place."""
    place, equals, text = override.partition("=")
    keys = [key.strip() for key in place.split(".")]
    well = bool(equals) and len(keys) >= 2 and all(keys) and "\n" not in override
    require(well, f"`--set` takes section.key=value; got {override!r}")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        value = text.strip()
    for key in keys[:-1]:
        table = table.setdefault(key, {})
        section = isinstance(table, dict)
        require(section, f"`--set` takes section.key=value, and `{key}` is not a section; got {override!r}")
    table[keys[-1]] = value
    return keys
