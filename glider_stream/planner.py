"""The planner: one call for each command."""

from collections.abc import Callable, Sequence
from os.path import realpath
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from .domain import Array, Point
from .export import check_export, export_path
from .path import Path, load_path
from .query import Planner, check_unchanged
from .roadmap import Progress, Roadmap, build_roadmap, node_positions
from .scenario import Scenario, read_scenario, scenario_from_text
from .settings import require
from .store import build_file, check_output, read_roadmap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .bench import Record
    from .describe import Description, Place
    from .ocean import Names
    from .suite import Report
    from .verify import Verification


def build(
    scenario: str | File | Scenario,
    output: str | File | None = None,
    *,
    threads: int | None = None,
    overrides: Sequence[str] = (),
    progress: Callable[[Progress], None] = lambda progress: None,
) -> Roadmap:
    """Build the roadmap of a scenario (a file, a shipped name or an object); write it where `output` says."""
    if output is not None:
        check_output(output)
    if isinstance(scenario, Scenario):
        require(not overrides, f"overrides are for a scenario that is read from a file; got {list(overrides)}")
        resolved = scenario
    else:
        itself = output is not None and realpath(output) == realpath(scenario)
        require(not itself, f"the output {output} is the scenario itself; name another file")
        resolved = read_scenario(scenario, overrides)
    if output is None:
        return build_roadmap(resolved.problem(), threads, progress)
    build_file(resolved.problem(), output, threads, progress)
    return read_roadmap(output)


def info(roadmap: str | File | Roadmap) -> Roadmap:
    """A roadmap from its file; printed, it says what it is."""
    return roadmap if isinstance(roadmap, Roadmap) else read_roadmap(roadmap)


def query(
    roadmap: str | File | Roadmap,
    start: Point | None = None,
    goal: Point | None = None,
    outputs: Sequence[str | File] = (),
) -> Path:
    """The cheapest path between two points, given in the coordinates of the scenario's domain.

    These are x, y, z [m], z upward, or lon, lat [degrees], depth [m] where the domain is geographic; the
    scenario's own start and goal where none are given. Written to each of `outputs`.
    """
    for output in outputs:
        check_export(output)
    road = info(roadmap)
    scenario = scenario_from_text(road.provenance.scenario)
    ends = [None if end is None else scenario.domain.point(end) for end in (start, goal)]
    path = Planner(road, scenario.problem()).query(*ends)
    for output in outputs:
        export_path(path, output)
    return path


def verify(roadmap: str | File, sample: int = 200) -> "Verification":
    """Fly a roadmap file's legs again, a `sample` of them, 0 for all, by another integrator too."""
    from .verify import verify

    return verify(roadmap, lambda text: scenario_from_text(text).problem(), sample)


def table(roadmap: str | File | Roadmap, starts: Sequence[Point], goals: Sequence[Point]) -> Array:
    """Costs [s] of the cheapest paths from n points to m others: (n, m), inf where there is none.

    Points are given in the coordinates of the scenario's domain; see `query`.
    """
    road = info(roadmap)
    scenario = scenario_from_text(road.provenance.scenario)
    ends = ([scenario.domain.point(end) for end in some] for some in (starts, goals))
    return Planner(road, scenario.problem()).table(*ends)


def plot(
    roadmap: str | File | Roadmap,
    path: str | File | Path | None = None,
    output: str | File | None = None,
    depths: Sequence[float] | None = None,
    *,
    chart: bool = False,
    fronts: float | None = None,
) -> "Figure | None":
    """Draw a path over its roadmap and the current at some `depths` [m], or the roadmap where there is none.

    A path file or object; up to four depths for a path, one for a roadmap or a `chart`, which shows a path by
    time, with heading and speeds; `fronts` draws there what is reached every so many hours. Written where
    `output` says; one that ends in .html is a page to look around in, and no figure is returned.
    """
    from .plot import (
        PAGE,
        check_figure,
        fronts_of,
        placed,
        plot_chart,
        plot_roadmap,
        plot_route,
        save_figure,
        save_page,
    )  # fmt: skip

    as_page = output is not None and File(output).suffix.lower() == PAGE
    if output is not None:
        check_output(output) if as_page else check_figure(output)
    needs = "a page" if as_page else "`fronts`" if fronts is not None else "a chart"
    chart = chart or as_page or fronts is not None
    require(path is not None or not chart, f"{needs} needs a path, got none; give the file that `query -o` wrote")
    road = info(roadmap)
    title = "" if isinstance(roadmap, Roadmap) else File(roadmap).stem
    route = path if path is None or isinstance(path, Path) else load_path(path)
    scenario = scenario_from_text(road.provenance.scenario)
    problem = scenario.problem()
    check_unchanged(road, problem)
    flow, terrain = problem.evaluator.flow, problem.evaluator.terrain
    if route is None:
        require(depths is None or len(depths) == 1, f"a roadmap is drawn at one depth; got {depths}")
        figure = plot_roadmap(flow, terrain, problem, road, None if depths is None else depths[0], title)
    else:
        stops = np.array([point for leg in route.legs for point in (leg.start, leg.end)]).reshape(-1, 3)
        here = bool(problem.evaluator.allowed(stops, problem.departure).all())
        require(here, "the path leaves the roadmap's water; draw it over the roadmap that it was found in")
        if chart:
            route, every = placed(route, problem), None
            if fronts is not None:
                arrival = Planner(road, problem).arrivals(route.start)
                every = (fronts_of(road.position, arrival, terrain), fronts)
            if as_page:
                assert output is not None
                save_page(output, flow, terrain, problem, road.position, route, depths, every, title)
                return None
            figure = plot_chart(flow, terrain, problem, route, depths, every, title)
        else:
            figure = plot_route(flow, terrain, problem, road.position, route, depths, title)
    if output is not None:
        save_figure(figure, output)
    return figure


def plot_steering(
    scenario: str | File | Scenario,
    start: Point,
    goal: Point,
    output: str | File | None = None,
    *,
    overrides: Sequence[str] = (),
) -> "Figure":
    """Draw how legs are found from one point: its flow map at the goal's depth, and what each method finds.

    Points are in the coordinates of the scenario's domain; any method may be chosen there.
    """
    from .plot import check_figure, plot_steering, save_figure

    if output is not None:
        check_figure(output)
    resolved = scenario if isinstance(scenario, Scenario) else read_scenario(scenario, overrides)
    problem = resolved.problem()
    ends = [resolved.domain.point(end) for end in (start, goal)]
    for end, name in zip(ends, ("start", "goal"), strict=True):
        problem.check_point(end, name)
    require(ends[0][2] != ends[1][2], "start and goal lie at the same depth; a leg changes it")
    figure = plot_steering(problem, node_positions(problem), ends[0], ends[1])
    if output is not None:
        save_figure(figure, output)
    return figure


def describe(
    currents: str | File | Sequence[str | File], at: Sequence["Place"] = (), names: "Names | None" = None
) -> "Description":
    """What current files hold, and what the planner takes for what; the current at places `at`.

    A place is lon, lat [degrees], depth [m] and the time (ISO 8601, UTC), or None where there is but one.
    `names` says what the files do not. InputError where they cannot be used.
    """
    from .describe import describe

    return describe(currents, at, names)


def bench(
    output: str | File | None = None, *, against: str | File | None = None, **options: Any
) -> tuple["Record", list[str]]:
    """Measure what this machine does: the record, and what has moved since the record `against`.

    `options` as `bench.bench` has them. Written as JSON where `output` says.
    """
    from .bench import bench, read_record, write_record

    if output is not None:
        check_output(output)
    before = None if against is None else read_record(against)
    record = bench(**options)
    if output is not None:
        write_record(record.as_dict(), output)
    return record, [] if before is None else record.moved(before)


def suite(output: str | File | None = None, *, ompl: str | File | None = None, **options: Any) -> "Report":
    """Solve the suite's named problems by every method and baseline; `options` as `suite.run_suite` has them.

    Written as JSON where `output` says; a log per problem, as OMPL's tools read them, into the folder `ompl`.
    """
    from .bench import write_record
    from .suite import ompl_log, run_suite

    if output is not None:
        check_output(output)
    if ompl is not None:
        require(File(ompl).is_dir(), f"the folder {ompl} for logs is none; make it first")
    report = run_suite(**options)
    if output is not None:
        write_record(report.as_dict(), output)
    if ompl is not None:
        for name in report.references:
            (File(ompl) / f"{name}.log").write_text(ompl_log(report, name))
    return report
