"""Opening roadmaps, scenarios and plans."""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as File

from ..base.errors import InputWarning
from ..base.settings import require
from ..roadmap.inputs import settings_sha256
from ..roadmap.roadmap import Roadmap
from ..roadmap.slices import SlicedRoadmap
from ..roadmap.store import KeptRoadmap, opened_roadmap
from ..scenario import Scenario, read_scenario, scenario_from_text, shipped_scenarios
from ..search.path import Path, load_path
from .questions import OpenedRoadmap, OpenedScenario
from .searches import Nodes, Searches


def open(roadmap: str | File | KeptRoadmap | OpenedRoadmap, overrides: Sequence[str] = ()) -> OpenedRoadmap:
    """Open a roadmap (a file or an object) for any number of queries.

    `overrides`, such as "flow.file=currents.nc", give the new place of a file that the scenario reads; a file
    beside the roadmap is found without.

    InputError if the file is not a roadmap, or is newer, incomplete or damaged.

    Examples:
        >>> road = glider_stream.open("small.h5")
        >>> print(road)  # doctest: +ELLIPSIS
        Roadmap: 77 nodes, 929 edges
        ...
    """
    if overrides:
        before = open(roadmap)
        assert before.searches.source is not None
        return OpenedRoadmap(replace(before.searches.source, elsewhere=tuple(overrides)), before.title)
    if isinstance(roadmap, OpenedRoadmap):
        return roadmap
    if isinstance(roadmap, KeptRoadmap):
        return OpenedRoadmap(roadmap)
    return OpenedRoadmap(opened_roadmap(roadmap), File(roadmap).stem)


def open_plan(path: Path, overrides: Sequence[str] = ()) -> OpenedScenario:
    """Open what a plan was made with: its roadmap if that is still there, else its scenario.

    `overrides` give the new place of files, such as "flow.file=currents.nc". InputError if the plan does not say
    what it was made with.
    """
    origin = path.origin
    cure = "name its roadmap with --roadmap, or its scenario with --scenario"
    require(
        origin is not None, f"the plan does not say what it was made with: an earlier version wrote it; {cure}"
    )
    assert origin is not None
    road = None
    if origin.roadmap and File(origin.roadmap).is_file():
        road = open(origin.roadmap)
        if not origin.nodes_only:
            assert road.searches.source is not None
            built = settings_sha256(road.searches.source.provenance.scenario)
            same = built == settings_sha256(origin.scenario)
            require(same, f"the roadmap {origin.roadmap} has been built anew with other settings; {cure}")
            return open(origin.roadmap, overrides) if overrides else road
    elif origin.roadmap:
        gone = f"the plan's roadmap {origin.roadmap} is not there: the scenario's nodes are taken instead"
        warnings.warn(f"{gone}; to use the roadmap, name it with --roadmap", InputWarning, stacklevel=2)
    scenario = scenario_from_text(origin.scenario, overrides, "the plan's scenario")
    nodes = None if road is None else Nodes(road.position, road.searches.file, road.searches)
    return OpenedScenario(Searches(scenario, nodes=nodes))


def open_scenario(scenario: str | File | Scenario, overrides: Sequence[str] = ()) -> OpenedScenario:
    """Open a scenario (a file, a shipped name or an object), whose legs are found when they are needed."""
    if isinstance(scenario, Scenario):
        require(not overrides, f"overrides are for a scenario that is read from a file; got {list(overrides)}")
        return OpenedScenario(Searches(scenario))
    return OpenedScenario(Searches(read_scenario(scenario, overrides)), File(scenario).stem)


def is_plan(source: object) -> bool:
    """Return whether a source is the name of a path file (.json)."""
    return isinstance(source, str | File) and File(source).suffix.lower() == ".json"


def open_either(
    source: "str | File | Roadmap | SlicedRoadmap | Scenario | OpenedScenario", overrides: Sequence[str] = ()
) -> OpenedScenario:
    """Open a roadmap, a scenario or what a plan was made with: an object, a file, or a shipped name.

    A scenario's file ends in .toml, a plan's in .json. `overrides`: see `open`, `open_scenario`, `open_plan`.
    """
    if isinstance(source, OpenedRoadmap):
        return open(source, overrides)
    if isinstance(source, OpenedScenario):
        require(not overrides, f"overrides are for a scenario that is read from a file; got {list(overrides)}")
        return source
    if isinstance(source, Scenario):
        return open_scenario(source, overrides)
    if isinstance(source, Roadmap | SlicedRoadmap):
        return open(source, overrides)
    if is_plan(source):
        return open_plan(load_path(source), overrides)
    if File(source).suffix == ".toml" or str(source) in shipped_scenarios():
        return open_scenario(source, overrides)
    return open(source, overrides)
