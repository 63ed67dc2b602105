"""The planner: one call for each command."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from os.path import realpath
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from .base.arrays import Array
from .base.output import check_output, replacing
from .base.settings import require
from .jobs.build import Job, build_file, shard_of
from .jobs.build import merge as merge_parts
from .pilot.card import Card
from .pilot.card import card as card_of
from .pilot.export import check_export, export_path
from .pilot.route_files import read_drawn
from .pilot.score import Score
from .pilot.score import score as score_of
from .pilot.windows import HOURS
from .roadmap.builder import Progress, build_roadmap, node_positions
from .roadmap.compare import Difference, difference
from .roadmap.provenance import check_unchanged
from .roadmap.roadmap import Roadmap
from .roadmap.store import read_roadmap
from .scenario import Scenario, read_scenario, scenario_of
from .search.path import SURFACE, Path, load_path
from .search.query import Planner
from .search.surfacing import Surfacing, SurfacingPlanner
from .search.thin import thin as thinned
from .search.trade_off import TradeOff
from .search.trade_off import trade_off as find_trade_off
from .water.domain import GeographicDomain, Point

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .evaluation.bench import Record
    from .evaluation.suite import Report
    from .roadmap.verify import Verification
    from .vehicle.calibration.result import Calibration
    from .water.describe import Description, Place
    from .water.ocean import Names


def build(
    scenario: str | File | Scenario,
    output: str | File | None = None,
    *,
    threads: int | None = None,
    overrides: Sequence[str] = (),
    progress: Callable[[Progress], None] = lambda progress: None,
    **job: Any,
) -> Roadmap:
    """Build the roadmap of a scenario (a file, a shipped name or an object); write it where `output` says.

    A build into a file goes on where an earlier one of the same was stopped. `job` as `jobs.Job` has it:
    `restart`, to begin anew; `checkpoint` [s], how often the disk is asked to keep what was found; and
    `scheduler`, the address of a Dask scheduler, or "local:N", whose workers evaluate; `base`, an older
    roadmap of the same nodes in another current, of which what that cannot have touched is taken over.
    """
    resolved = _resolved(scenario, output, overrides)
    if output is None:
        require(not job, f"{', '.join(job)} need an output file; name one")
        return build_roadmap(resolved.problem(), threads, progress)
    _build(resolved, output, threads, progress, job)
    return read_roadmap(output)


def build_part(
    scenario: str | File | Scenario,
    output: str | File,
    shard: str,
    *,
    threads: int | None = None,
    overrides: Sequence[str] = (),
    progress: Callable[[Progress], None] = lambda progress: None,
    **job: Any,
) -> None:
    """Build the part `shard`, such as "3/16", of a scenario's roadmap, for `merge`; else as `build`."""
    _build(_resolved(scenario, output, overrides), output, threads, progress, job | {"shard": shard_of(shard)})


def _build(
    scenario: Scenario,
    output: str | File,
    threads: int | None,
    progress: Callable[[Progress], None],
    job: dict[str, Any],
) -> None:
    address, older = job.pop("scheduler", None), job.pop("base", None)
    problem = scenario.problem()
    if older is not None:
        from .jobs.reuse import untouched

        road = info(older)
        before = scenario_of(road).problem()
        check_unchanged(road, before)
        job["base"] = road, untouched(road, before, problem)
    if address is None:
        build_file(problem, output, threads, progress, job=Job(**job))
        return
    from .jobs.cluster import scheduler

    with scheduler(address) as cluster:
        job |= {"finder": cluster.find_edges, "warm": False}
        build_file(problem, output, threads, progress, job=Job(**job))


def _resolved(scenario: str | File | Scenario, output: str | File | None, overrides: Sequence[str]) -> Scenario:
    """The scenario to build, once it is known that its output can be written."""
    if output is not None:
        check_output(output)
    if isinstance(scenario, Scenario):
        require(not overrides, f"overrides are for a scenario that is read from a file; got {list(overrides)}")
        return scenario
    itself = output is not None and realpath(output) == realpath(scenario)
    require(not itself, f"the output {output} is the scenario itself; name another file")
    return read_scenario(scenario, overrides)


def merge(parts: Sequence[str | File], output: str | File) -> Roadmap:
    """One roadmap of the parts that builds with `shard` wrote."""
    merge_parts(parts, output)
    return read_roadmap(output)


def info(roadmap: str | File | Roadmap, overrides: Sequence[str] = ()) -> Roadmap:
    """A roadmap from its file; printed, it says what it is.

    `overrides`, such as "flow.file=currents.nc", say where a file is now that its scenario reads; one that lies
    beside the roadmap is found without. All functions that take a roadmap take what this returns.
    """
    road = roadmap if isinstance(roadmap, Roadmap) else read_roadmap(roadmap)
    return replace(road, elsewhere=(*road.elsewhere, *overrides)) if overrides else road


def differ(first: str | File | Roadmap, second: str | File | Roadmap) -> Difference:
    """What two roadmaps differ in; printed, it says so."""
    return difference(info(first), info(second))


def query(
    roadmap: str | File | Roadmap,
    start: Point | None = None,
    goal: Point | None = None,
    outputs: Sequence[str | File] = (),
    most_energy: float | None = None,
    thin: float | None = None,
    surfacing: Mapping[str, Any] | None = None,
    window_hours: float = HOURS,
) -> Path:
    """The cheapest path between two points, given in the coordinates of the scenario's domain.

    These are x, y, z [m], z upward, or lon, lat [degrees], depth [m] where the domain is geographic; the
    scenario's own start and goal where none are given. Written to each of `outputs`. `most_energy` [J] asks
    for the fastest of the paths of `trade_off` that uses no more. `thin` [m] joins legs whose stops lie so
    near the straight line, where one glide does, and none where that breaks another rule. `surfacing`
    is a rule for how often to come up, as `surfacing.Surfacing` has it; the scenario's own if None. Exported
    windows last `window_hours`.
    """
    for output in outputs:
        check_export(output)
    rule = None if surfacing is None else Surfacing(**surfacing)
    search, ends = _search(roadmap, start, goal, rule)
    if most_energy is None:
        path = search.query(*ends)
    else:
        require(most_energy >= 0, f"`most_energy` must be at least 0 J; got {most_energy:g}")
        front = _front(search, ends)
        last = front.paths[-1]
        why = (
            f"the least that one takes is {last.cost:,.0f} J, more than {most_energy:,.0f}" if last.found else ""
        )
        within = front.within(most_energy)
        least = front.least_time(most_energy)
        path = replace(within, least_time=least) if within else replace(last, cost=math.inf, legs=(), why=why)
    if thin is not None:
        path = _with_fewer_legs(path, thin, search, most_energy)
    for output in outputs:
        export_path(path, output, window_hours)
    return path


def _with_fewer_legs(path: Path, tolerance: float, search: Planner, most_energy: float | None) -> Path:
    """A path thinned, or as it is where fewer legs would break what else was asked for."""
    rule = search.rule if isinstance(search, SurfacingPlanner) else Surfacing()
    bound = rule != Surfacing()
    stays = (lambda stop: bool(stop[2] >= -SURFACE)) if bound else (lambda stop: False)
    fewer = thinned(path, tolerance, search.connect, search.fly, stays)
    keeps = rule.holds(fewer) and (most_energy is None or fewer.cost <= most_energy)
    return fewer if keeps else replace(path, unthinned=fewer.unthinned)


def trade_off(roadmap: str | File | Roadmap, start: Point | None = None, goal: Point | None = None) -> TradeOff:
    """The paths of one query that are best for some price of time against energy; points as in `query`."""
    return _front(*_search(roadmap, start, goal))


def _front(search: Planner, ends: tuple[Array | None, Array | None]) -> TradeOff:
    unit = search.problem.evaluator.cost.unit
    require(unit == "J", 'the roadmap\'s cost is time, without energy; build it with [cost] kind = "energy"')
    return find_trade_off(lambda blend: search.query(*ends, blend=blend))


def card(roadmap: str | File | Roadmap, path: Path) -> Card:
    """What a route of this roadmap makes over ground, leg by leg, and what the water does to it."""
    road = info(roadmap)
    return card_of(path, scenario_of(road).problem())


def score(roadmap: str | File | Roadmap, route: str | File) -> Score:
    """Fly a route that somebody drew (CSV, GeoJSON, KML, GPX, or a path file) in a roadmap's water."""
    drawn = read_drawn(route)
    # a rule of surfacing is the planner's, and what was drawn may begin or end anywhere
    search, _ = _search(roadmap, None, None, Surfacing())
    domain = scenario_of(search.roadmap).domain
    on_globe = isinstance(domain, GeographicDomain)
    cure = "and the roadmap is in metres; give x, y, z in a CSV file"
    require(on_globe or not drawn.geographic, f"the route {route} is in longitude and latitude, {cure}")
    points = [domain.point(place) if drawn.geographic else np.array(place) for place in drawn.places]
    for n, point in enumerate(points, 1):
        search.problem.check_point(point, f"point {n}")
    return score_of(points, search.connect, search.query, search.fly)


def _search(
    roadmap: str | File | Roadmap, start: Point | None, goal: Point | None, rule: Surfacing | None = None
) -> tuple[Planner, tuple[Array | None, Array | None]]:
    road = info(roadmap)
    scenario = scenario_of(road)
    ends = [None if end is None else scenario.domain.point(end) for end in (start, goal)]
    if rule is None and scenario.query is not None:
        rule = Surfacing(scenario.query.most_yos, scenario.query.most_hours)
    problem = scenario.problem()
    free = rule is None or rule == Surfacing()
    search = Planner(road, problem) if free or rule is None else SurfacingPlanner(road, problem, rule)
    return search, (ends[0], ends[1])


def verify(roadmap: str | File, sample: int = 200, *, overrides: Sequence[str] = ()) -> "Verification":
    """Fly a roadmap file's legs again, a `sample` of them, 0 for all, by another integrator too.

    `overrides` as `info` has them.
    """
    from .roadmap.verify import verify

    return verify(roadmap, lambda road: scenario_of(info(road, overrides)).problem(), sample)


def table(roadmap: str | File | Roadmap, starts: Sequence[Point], goals: Sequence[Point]) -> Array:
    """Costs [s] of the cheapest paths from n points to m others: (n, m), inf where there is none.

    Points are given in the coordinates of the scenario's domain; see `query`.
    """
    road = info(roadmap)
    scenario = scenario_of(road)
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
    )

    as_page = output is not None and File(output).suffix.lower() == PAGE
    if output is not None:
        check_output(output) if as_page else check_figure(output)
    needs = "a page" if as_page else "`fronts`" if fronts is not None else "a chart"
    chart = chart or as_page or fronts is not None
    require(path is not None or not chart, f"{needs} needs a path, got none; give the file that `query -o` wrote")
    road = info(roadmap)
    title = "" if road.file is None else road.file.stem
    route = path if path is None or isinstance(path, Path) else load_path(path)
    scenario = scenario_of(road)
    problem = scenario.problem()
    check_unchanged(road, problem)
    flow, terrain = problem.evaluator.flow, problem.evaluator.terrain
    if route is None:
        require(depths is None or len(depths) == 1, f"a roadmap is drawn at one depth; got {depths}")
        require(fronts is None and not as_page, "fronts, and pages, are of a route; give its path file")
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
    currents: str | File | Sequence[str | File],
    at: Sequence["Place"] = (),
    names: "Names | Mapping[str, Any] | None" = None,
) -> "Description":
    """What current files hold, and what the planner takes for what; the current at places `at`.

    A place is lon, lat [degrees], depth [m] and the time (ISO 8601, UTC), or None where there is but one.
    `names` says what the files do not. InputError where they cannot be used.
    """
    from .water.describe import describe

    return describe(currents, at, names)


def calibrate(
    dives: str | File,
    output: str | File | None = None,
    *,
    preset: str = "seaglider",
    columns: Mapping[str, str] | None = None,
) -> "Calibration":
    """Fit a preset to the dives of a CSV file; the scenario's [glider] section, written where `output` says."""
    from .vehicle.calibration.calibrate import calibrate
    from .vehicle.calibration.dives import read_dives

    if output is not None:
        check_output(output)
    found = calibrate(read_dives(dives, columns), preset)
    if output is not None:
        with replacing(File(output)) as temporary:
            temporary.write_text(found.table(), encoding="utf-8")
    return found


def bench(
    output: str | File | None = None, *, against: str | File | None = None, **options: Any
) -> tuple["Record", list[str]]:
    """Measure what this machine does: the record, and what has moved since the record `against`.

    `options` as `bench.bench` has them. Written as JSON where `output` says.
    """
    from .evaluation.bench import bench, read_record, write_record

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
    from .evaluation.bench import write_record
    from .evaluation.suite import ompl_log, run_suite

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
