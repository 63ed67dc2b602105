"""Ensembles: the problems of currents that may be, which differ in nothing but the current."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...base.arrays import Array
from ...base.errors import InputError
from ...base.settings import require
from ...kernels.flow import Flow, OceanGrid, RisingOceanGrid, max_rise
from ...roadmap.problem import Problem
from ...scenario import Scenario
from ...vehicle.cost import TravelTime
from ...water.domain import GeographicDomain
from ...water.inspect import flow_sha256, is_steady
from ...water.ocean import OceanFlow, read_members
from ...water.ocean.ensemble import member_labels
from ..orders import is_up
from ..settings import Mission
from ..world import Worlds, check_ends, check_known

MOST_MEMBERS = 10_000
KEPT = 64
"""So many drawn members are kept in memory; with more, each is drawn again when it is needed."""


@dataclass(frozen=True)
class Progress:
    """How many members of all are done with some work, `what` in words."""

    done: int
    total: int
    what: str

    def __str__(self) -> str:
        return f"{self.what}: {self.done} of {self.total} members"


def _silent(progress: Progress) -> None:
    """Tell nobody."""


@dataclass(frozen=True)
class Ensemble:
    """The members of an ensemble, and the `forecast` that a pilot plans with.

    `numbers`: those of the members, by which currents and the vehicle's errors are drawn. `words` describe them.
    `names`: those of members that were read from files. `progress` is told of each member that is done.
    """

    mission: Mission
    forecast: Problem
    numbers: tuple[int, ...]
    words: str
    worlds: Worlds | None = None
    members: dict[int, Problem] = field(default_factory=dict)
    names: tuple[str, ...] = ()
    progress: Callable[[Progress], None] = _silent

    @property
    def count(self) -> int:
        """The number of members."""
        return len(self.numbers)

    def each(self, what: str = "members") -> Iterator[Problem]:
        """Yield the members' problems, in the order of `numbers`; `what` says for which work."""
        for done, number in enumerate(self.numbers, 1):
            yield self._member(number)
            self.progress(Progress(done, self.count, what))

    def _member(self, number: int) -> Problem:
        made = self.members.get(number)
        if made is None:
            assert self.worlds is not None
            made = self.worlds.world(number).forecast
        if self.count <= KEPT:
            self.members[number] = made
        return self._like_the_forecast(made)

    def between(self, start: Array, goal: Array) -> "Ensemble":
        """Return the same ensemble for routes from a start to a goal (3,) [m], both at the surface."""
        for point, name in ((start, "start"), (goal, "goal")):
            self.forecast.check_point(point, name)
            up = f"a route with confidence begins and ends at the surface; got a {name} at {-point[2]:g} m"
            require(is_up(float(point[2])), up)
        return replace(self, forecast=replace(self.forecast, start=start, goal=goal)).checked()

    def checked(self) -> "Ensemble":
        """Return the ensemble; InputError if a member that was read from a file has no water at an end."""
        for number, name in zip(self.numbers, self.names, strict=bool(self.names)):
            problem = self._member(number)
            try:
                for end in ("start", "goal"):
                    problem.check_point(getattr(problem, end), end)
            except InputError as error:
                cure = "or leave this member out (a place without data counts as land)"
                raise InputError(f"in member {name}, {error}, {cure}") from None
        return self

    def _like_the_forecast(self, member: Problem) -> Problem:
        """Return the forecast's problem with a member's current and terrain."""
        evaluator = member.evaluator
        waters = replace(self.forecast.evaluator, flow=evaluator.flow, terrain=evaluator.terrain)
        return replace(self.forecast, evaluator=waters)


def drawn(mission: Mission, count: int, first: int = 0) -> Ensemble:
    """Return `count` members, from number `first` on: the scenario's current with the mission's random errors."""
    require(1 <= count <= MOST_MEMBERS, f"`draws` must be from 1 to {MOST_MEMBERS:,}; got {count:,}")
    require(first >= 0, f"the number of the first draw must be at least 0; got {first}")
    cure = "name the members' files, or describe the forecast's error in [forecast_error]"
    require(mission.forecast_error is not None, f"members are drawn from a mission's [forecast_error]; {cure}")
    worlds = Worlds(mission)
    numbers = tuple(range(first, first + count))
    words = f"{count} draws of the forecast's error, {first} to {first + count - 1}"
    return Ensemble(mission, _timed(worlds.true), numbers, words, worlds)


def from_files(mission: Mission, files: Sequence[str | Path]) -> Ensemble:
    """Return the members of a file, or one of each of several files; the forecast is their mean.

    InputError unless the members have the same points and times, and no two the same currents.
    """
    scenarios = _scenarios(mission.scenario, files)
    problems = [_timed(scenario.problem()) for scenario in scenarios]
    if len(files) == len(problems) and is_steady(problems[0].evaluator.flow):
        _check_alike(mission.scenario, files)
    labelled = [_name_of(scenario) for scenario in scenarios]
    _check_each_once(labelled, [flow_sha256(problem.evaluator.flow) for problem in problems])
    for problem in problems:
        check_known(problem, mission, "members' current")
    check_ends(problems[0])
    mean = _mean([problem.evaluator.flow for problem in problems])
    forecast = replace(problems[0], evaluator=replace(problems[0].evaluator, flow=mean))
    names = ", ".join(Path(file).name for file in files[:3]) + (", ..." if len(files) > 3 else "")
    numbers = tuple(range(len(problems)))
    return Ensemble(
        mission,
        forecast,
        numbers,
        f"{len(problems)} members of {names}; the forecast is their mean",
        members=dict(zip(numbers, problems, strict=True)),
        names=tuple(labelled),
    ).checked()


def _name_of(member: Scenario) -> str:
    """Return the name of a member for people: its file, or its label there."""
    flow = member.flow
    assert isinstance(flow, OceanFlow)
    file = Path(flow.file[0]).name
    return file if flow.member is None else f"{flow.member} of {file}"


def _check_each_once(names: Sequence[str], digests: Sequence[str]) -> None:
    """Raise InputError if two members hold the same currents: they would count twice."""
    seen: dict[str, str] = {}
    for name, digest in zip(names, digests, strict=True):
        cure = "leave one of them out"
        require(digest not in seen, f"members {seen.get(digest)} and {name} hold the same currents; {cure}")
        seen[digest] = name


def _mean(flows: Sequence[Flow]) -> OceanGrid | RisingOceanGrid:
    """Return the mean of currents on one grid; InputError if their points or times differ."""
    grids = [flow for flow in flows if isinstance(flow, OceanGrid | RisingOceanGrid)]
    first, total = grids[0], np.zeros_like(grids[0].values)
    for n, grid in enumerate(grids):
        alike = grid.values.shape == first.values.shape and np.array_equal(grid.times, first.times)
        alike = alike and np.array_equal(grid.levels, first.levels) and grid.extent[:4] == first.extent[:4]
        alike = alike and np.array_equal(grid.index_map, first.index_map)
        require(alike, f"members 0 and {n} have different points or times, so they have no mean; cut them alike")
        total += grid.values
    fastest = max(grid.extent.max_speed for grid in grids)
    values, extent = total / len(grids), first.extent._replace(max_speed=fastest)
    if isinstance(first, RisingOceanGrid):
        # a bound as that of the speed: the mean may rise faster than the first member
        return first._replace(values=values, extent=extent, max_rise=max(max_rise(grid) for grid in grids))
    return first._replace(values=values, extent=extent)


def first_member(files: Sequence[str | Path]) -> list[str]:
    """Return the overrides with which a scenario reads the first of the members in some files."""
    labels = member_labels(files)
    quoted = ", ".join(f'"{Path(file).absolute()}"' for file in (files if labels else files[:1]))
    return [f"flow.file=[{quoted}]", *([f'flow.member="{labels[0]}"'] if labels else [])]


def _scenarios(scenario: Scenario, files: Sequence[str | Path]) -> list[Scenario]:
    flow = scenario.flow
    if not isinstance(flow, OceanFlow):
        raise InputError('members from files are for a scenario whose [flow] has kind = "netcdf"; draw them')
    names = tuple(str(Path(file).absolute()) for file in files)
    labels = member_labels(files)
    one = "holds no members: name a file that does, or one file for each member"
    require(len(labels) > 0 or len(files) > 1, f"{Path(files[0]).name} {one}")
    if labels:
        flows = [replace(flow, file=names, member=label) for label in labels]
    else:
        flows = [replace(flow, file=(name,), member=None) for name in names]
    return [replace(scenario, flow=flow) for flow in flows]


def _check_alike(scenario: Scenario, files: Sequence[str | Path]) -> None:
    """Raise InputError unless files with one time each have the same: a flow of one time does not keep it."""
    domain, flow = scenario.domain, scenario.flow
    assert isinstance(domain, GeographicDomain)
    assert isinstance(flow, OceanFlow)
    read_members(files, flow.names, lon=domain.lon, lat=domain.lat, depth=domain.depth)


def _timed(problem: Problem) -> Problem:
    """Return the problem with time as its cost: confidence is about arrivals."""
    return replace(problem, evaluator=replace(problem.evaluator, cost=TravelTime()))
