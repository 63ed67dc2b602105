"""The planner: one call for each command."""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from os.path import realpath
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

from .base.arrays import Array
from .base.checks import Range
from .base.errors import InputWarning
from .base.output import check_apart, check_output, replacing
from .base.settings import require
from .jobs.build import Job, build_file, shard_of
from .jobs.build import merge as merge_parts
from .opened import OpenedRoadmap, is_plan, open_either, open_plan, open_scenario, split_outputs
from .opened import open as open_roadmap
from .pilot.card import Card
from .pilot.lint import Linted
from .pilot.lint import lint as lint_file
from .pilot.replan import Replan
from .pilot.score import Score
from .pilot.slocum_files import MOST_WAYPOINTS
from .pilot.windows import HOURS
from .roadmap.builder import Progress, build_roadmap, build_slices, node_positions
from .roadmap.compare import Difference, difference
from .roadmap.density import Density
from .roadmap.provenance import check_unchanged
from .roadmap.roadmap import Roadmap
from .roadmap.slices import SlicedRoadmap
from .roadmap.store import read_any_roadmap
from .scenario import Scenario, read_scenario
from .search.departures import Moment
from .search.path import Path, load_plan
from .search.surfacing import Surfacing
from .search.trade_off import TradeOff
from .water.domain import Point

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .evaluation import level_set
    from .evaluation import record as benchmarks
    from .evaluation.level_set import Bound
    from .evaluation.suite import Report
    from .mission.campaign import Campaign
    from .mission.confidence.answer import Confidence
    from .mission.settings import Mission
    from .pilot.currents import DiveCurrents
    from .roadmap.verify import Verification
    from .vehicle.calibration.result import Calibration
    from .water.describe import Description, Place
    from .water.mapping.assimilate import Corrected
    from .water.mapping.measured import Measurements
    from .water.ocean import Names

AnyRoadmap = str | File | Roadmap | SlicedRoadmap | OpenedRoadmap
"""A roadmap: the name of its file, an object, or an opened one, which keeps what queries need."""
MAP_ENDS = (".nc", ".nc4")
"""The endings of maps of currents that are written: they are NetCDF."""


def build(
    scenario: str | File | Scenario,
    output: str | File | None = None,
    *,
    threads: int | None = None,
    overrides: Sequence[str] = (),
    restart: bool = False,
    checkpoint: float | None = None,
    scheduler: str | None = None,
    base: str | File | Roadmap | SlicedRoadmap | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
) -> Roadmap | SlicedRoadmap:
    """Build the roadmap of a scenario (a file, a shipped name or an object), and write it to `output`.

    A build into a file continues an earlier one that was stopped; `restart` begins again. Every `checkpoint` [s]
    (None: 30) the disk is asked to keep what was found. `scheduler`: the address of a Dask scheduler, or
    "local:N", whose workers evaluate the nodes. `base`: an older roadmap of the same nodes in another current;
    edges that the change cannot affect are taken from it.

    Examples:
        >>> road = planner.build("small.toml", "built.h5", overrides=["neighbours.k=10"])
        >>> road.position.shape, road.target.size > 300
        ((77, 3), True)
    """
    resolved = _resolved(scenario, output, overrides)
    if output is None:
        file = {"restart": restart, "checkpoint": checkpoint, "scheduler": scheduler, "base": base}
        given = [name for name, value in file.items() if value not in (None, False)]
        require(not given, f"{', '.join(given)} need an output file; name one")
        problem = resolved.problem()
        make = build_roadmap if len(problem.departures) == 1 else build_slices
        return make(problem, threads, progress)
    _build(resolved, output, threads, progress, None, restart, checkpoint, scheduler, base)
    return read_any_roadmap(output)


def build_opened(
    scenario: str | File | Scenario,
    output: str | File,
    *,
    threads: int | None = None,
    overrides: Sequence[str] = (),
    restart: bool = False,
    checkpoint: float | None = None,
    scheduler: str | None = None,
    base: str | File | Roadmap | SlicedRoadmap | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
) -> OpenedRoadmap:
    """Build a roadmap into a file, as `build` does, and open it: the edges of a large roadmap stay in the file.

    Examples:
        >>> planner.build_opened("small.toml", "built.h5", restart=True).query().found
        True
    """
    resolved = _resolved(scenario, output, overrides)
    _build(resolved, output, threads, progress, None, restart, checkpoint, scheduler, base)
    return open_roadmap(output)


def build_part(
    scenario: str | File | Scenario,
    output: str | File,
    shard: str,
    *,
    threads: int | None = None,
    overrides: Sequence[str] = (),
    restart: bool = False,
    checkpoint: float | None = None,
    scheduler: str | None = None,
    base: str | File | Roadmap | SlicedRoadmap | None = None,
    progress: Callable[[Progress], None] = lambda progress: None,
) -> None:
    """Build the part `shard`, such as "3/16", of a scenario's roadmap, for `merge`; see `build` for the rest.

    Examples:
        >>> for shard in ("1/2", "2/2"):
        ...     planner.build_part("small.toml", f"part{shard[0]}.h5", shard)
        >>> planner.merge(["part1.h5", "part2.h5"], "whole.h5").target.size
        929
    """
    resolved = _resolved(scenario, output, overrides)
    _build(resolved, output, threads, progress, shard, restart, checkpoint, scheduler, base)


def _build(
    scenario: Scenario,
    output: str | File,
    threads: int | None,
    progress: Callable[[Progress], None],
    shard: str | None,
    restart: bool,
    checkpoint: float | None,
    address: str | None,
    older: str | File | Roadmap | SlicedRoadmap | None,
) -> None:
    job: dict[str, Any] = {"restart": restart, "shard": None if shard is None else shard_of(shard)}
    if checkpoint is not None:
        job["checkpoint"] = checkpoint
    problem = scenario.problem()
    if older is not None:
        from .jobs.reuse import untouched

        road = info(older)
        before = open_roadmap(older).problem
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
    """Return the scenario to build, after a check that its output can be written."""
    if output is not None:
        check_output(output)
    if isinstance(scenario, Scenario):
        require(not overrides, f"overrides are for a scenario that is read from a file; got {list(overrides)}")
        return scenario
    itself = output is not None and realpath(output) == realpath(scenario)
    require(not itself, f"the output {output} is the scenario itself; name another file")
    return read_scenario(scenario, overrides)


def merge(parts: Sequence[str | File], output: str | File) -> Roadmap | SlicedRoadmap:
    """Merge the parts that `build_part` wrote into one roadmap.

    Examples:
        >>> for shard in ("1/2", "2/2"):
        ...     planner.build_part("small.toml", f"part{shard[0]}.h5", shard, restart=True)
        >>> whole = planner.merge(["part1.h5", "part2.h5"], "merged.h5")
        >>> planner.differ(whole, "small.h5").same_edges
        True
    """
    merge_parts(parts, output)
    return read_any_roadmap(output)


def info(roadmap: AnyRoadmap) -> Roadmap | SlicedRoadmap:
    """Return a roadmap from its file; `print` shows it.

    Examples:
        >>> print(planner.info("small.h5"))  # doctest: +ELLIPSIS
        Roadmap: 77 nodes, 929 edges
        ...
    """
    return open_roadmap(roadmap).roadmap


def differ(first: AnyRoadmap, second: AnyRoadmap) -> Difference:
    """Return the differences between two roadmaps; `print` shows them.

    Examples:
        >>> fewer = planner.build("small.toml", overrides=["neighbours.k=10"])
        >>> planner.differ("small.h5", fewer).same_edges
        False
    """
    return difference(info(first), info(second))


def query(
    roadmap: AnyRoadmap,
    start: Point | None = None,
    goal: Point | None = None,
    outputs: Sequence[str | File] = (),
    most_energy: float | None = None,
    thin: float | None = None,
    surfacing: Surfacing | None = None,
    window_hours: float = HOURS,
    most_waypoints: int = MOST_WAYPOINTS,
    arrival_radius: float | None = None,
    polish: bool = False,
    within: float | None = None,
    seconds: float | None = None,
    depart: Moment | None = None,
) -> Path:
    """Return the cheapest path between two points; see `OpenedRoadmap.query`.

    For several queries open the roadmap once: `glider_stream.open`.

    Examples:
        >>> path = planner.query("small.h5", goal=(100, -100, -75), outputs=["path.json", "path.csv"])
        >>> len(path.legs), round(path.travel_time)
        (3, 430)
    """
    split_outputs(outputs, within is not None or seconds is not None)  # before the roadmap is read
    return open_roadmap(roadmap).query(
        start,
        goal,
        depart=depart,
        outputs=outputs,
        most_energy=most_energy,
        polish=polish,
        within=within,
        seconds=seconds,
        thin=thin,
        surfacing=surfacing,
        window_hours=window_hours,
        most_waypoints=most_waypoints,
        arrival_radius=arrival_radius,
    )


def plan(
    scenario: str | File | Scenario,
    start: Point | None = None,
    goal: Point | None = None,
    outputs: Sequence[str | File] = (),
    most_energy: float | None = None,
    thin: float | None = None,
    surfacing: Surfacing | None = None,
    window_hours: float = HOURS,
    *,
    overrides: Sequence[str] = (),
    polish: bool = False,
    within: float | None = None,
    seconds: float | None = None,
    depart: Moment | None = None,
) -> Path:
    """Return the cheapest path of a scenario, without a roadmap; see `OpenedRoadmap.query`.

    Examples:
        >>> path = planner.plan("small.toml", (-190, 190, 0), (100, -100, -75))
        >>> path.found
        True
    """
    split_outputs(outputs, within is not None or seconds is not None)
    return open_scenario(scenario, overrides).query(
        start,
        goal,
        depart=depart,
        outputs=outputs,
        most_energy=most_energy,
        polish=polish,
        within=within,
        seconds=seconds,
        thin=thin,
        surfacing=surfacing,
        window_hours=window_hours,
    )


def replan(
    path: str | File | Path,
    fix: tuple[float, float],
    time: Moment,
    *,
    source: str | File | Scenario | AnyRoadmap | None = None,
    overrides: Sequence[str] = (),
    **options: Any,
) -> Replan:
    """Return a new plan from a position fix to the goal of an old plan; see `OpenedRoadmap.replan`.

    `source`: the roadmap or scenario to search; None stands for what the plan says that it was made with.
    `overrides` of the scenario, or of a roadmap's files. `options`: see `OpenedRoadmap.replan`.

    Examples:
        >>> path = planner.query("small.h5", outputs=["plan.json"])
        >>> answer = planner.replan("plan.json", (-60.0, 60.0), 200.0)
        >>> answer.new.found, answer.good.whole
        (True, False)
    """
    refines = options.get("within") is not None or options.get("seconds") is not None
    split_outputs(options.get("outputs", ()), refines)  # before the roadmap is read
    old = path if isinstance(path, Path) else load_plan(path)
    opened = open_plan(old, overrides) if source is None else open_either(source, overrides)
    return opened.replan(old, fix, time, **options)


def currents(
    dives: str | File,
    output: str | File | None = None,
    *,
    columns: Mapping[str, str] | None = None,
    declination: float = 0.0,
    attack: float = 3.0,
    fix_error: float = 10.0,
    speed_error: float = 0.05,
    heading_error: float = 3.0,
) -> "DiveCurrents":
    """Return the depth-averaged current of each dive in a CSV file, or in a NetCDF file of a track, with its
    error.

    The current is the way between two fixes less the way through water, over the time. `columns` gives other
    names of columns. `declination` [degrees] is added to headings; `attack` [degrees] is the angle of attack of a
    track. Standard errors: `fix_error` [m], `speed_error` as a share, `heading_error` [degrees]. The result is
    written to `output`, .csv or .json.

        Examples:
        >>> dives = "t_start,lon_start,lat_start,t_end,lon_end,lat_end,east,north"
        >>> dive = "2024-11-20T12:00,18.30,38.10,2024-11-20T15:00,18.35,38.08,3300,-2100"
        >>> _ = pathlib.Path("fixes.csv").write_text(dives + chr(10) + dive + chr(10))
        >>> (dive,) = planner.currents("fixes.csv").dives
        >>> dive.averaged.current.round(3)
        array([ 0.101, -0.011])

    """
    from .pilot.currents import check_currents_output, dive_currents
    from .vehicle.averaged_current import SensorErrors

    if output is not None:
        check_currents_output(output)
        check_apart(output, [dives])
    errors = SensorErrors(fix=fix_error, speed=speed_error, heading=math.radians(heading_error))
    found = dive_currents(dives, columns, declination=declination, attack=attack, errors=errors)
    if output is not None:
        found.write(output)
    return found


def trade_off(
    roadmap: AnyRoadmap,
    start: Point | None = None,
    goal: Point | None = None,
    surfacing: Surfacing | None = None,
) -> TradeOff:
    """Return all paths of one query that no other path beats in both time and energy; see `query`.

    Examples:
        >>> road = planner.build("small.toml", overrides=["cost.kind=energy", "cost.preset=slocum"])
        >>> [len(path.legs) for path in planner.trade_off(road).paths]
        [4]
    """
    return open_roadmap(roadmap).trade_off(start, goal, surfacing=surfacing)


def card(roadmap: AnyRoadmap, path: Path) -> Card:
    """Return the card of a route of this roadmap: speed over ground and currents, leg by leg.

    Examples:
        >>> path = planner.query("small.h5")
        >>> len(planner.card("small.h5", path).legs)
        4
    """
    return open_roadmap(roadmap).card(path)


def score(
    roadmap: AnyRoadmap | Scenario, route: str | File | Sequence[str | File], start: Point | None = None
) -> Score:
    r"""Return the score of a drawn route (one file or several) in a roadmap's water; see `OpenedRoadmap.score`.

    Examples:
        >>> _ = pathlib.Path("drawn.csv").write_text("x,y,z\n-190,190,0\n-100,100,-75\n0,0,-150\n")
        >>> score = planner.score("small.h5", "drawn.csv")
        >>> score.flyable, len(score.legs)
        (True, 2)

    """
    return open_either(roadmap).score(route, start)


def lint(files: Sequence[str | File], most_waypoints: int = MOST_WAYPOINTS) -> list[Linted]:
    r"""Return the faults of vehicles' files: goto lists (of at most `most_waypoints`), yo files and targets.

    Examples:
        >>> _ = pathlib.Path("goto_l10.ma").write_text("behavior_name=goto_list\n")
        >>> (linted,) = planner.lint(["goto_l10.ma"])
        >>> len(linted.faults) > 0
        True
    """
    return [lint_file(file, most_waypoints) for file in files]


def why_no_edges(roadmap: AnyRoadmap) -> str:
    """Return the reason, in one sentence, if a roadmap has no edge; empty if it has edges.

    Examples:
        >>> planner.why_no_edges("small.h5")
        ''
    """
    return open_roadmap(roadmap).why_no_edges()


def density(roadmap: AnyRoadmap) -> Density:
    """Return how far a roadmap's nodes lie apart in legs, and in how many directions legs leave them.

    Examples:
        >>> planner.density("small.h5").warning[:22]
        'legs leave a node in 7'
    """
    return open_roadmap(roadmap).density()


def verify(roadmap: str | File, sample: int | None = None, *, overrides: Sequence[str] = ()) -> "Verification":
    """Fly the legs of a roadmap file again, and a `sample` of them (None: 200, 0: all) by another integrator.

    If a sample of a roadmap of more than two million edges is asked for, only that is read, and flown by both.
    `overrides`: see `glider_stream.open`.

    Examples:
        >>> planner.verify("small.h5", sample=5).holds
        True
    """
    from .roadmap.verify import verify

    return verify(roadmap, lambda road: open_roadmap(road, overrides).problem, sample)


def bound(
    scenario: str | File | Scenario,
    *,
    overrides: Sequence[str] = (),
    nodes: int | None = None,
    dimensions: int | None = None,
    any_depth: bool = False,
    progress: "Callable[[level_set.Progress], None]" = lambda progress: None,
) -> "Bound":
    """Find the least time that a route of a scenario can take, by a level set, with its error.

    `scenario` may also be the name of a roadmap (.h5) or of a plan (.json): that which it was made with.

    `nodes` along the longest side of the finer grid; in 2 `dimensions`, the mean current of a yo's depths, or 3;
    None chooses 2 for long routes. `any_depth`: in 2 dimensions, the current of whichever depth is best, which is
    a bound where the mean is an estimate.

    Examples:
        >>> bound = planner.bound("small.toml", nodes=21)
        >>> bound.dimensions, bound.least < 486
        (3, True)
    """
    from .evaluation.level_set import bound

    made = is_plan(scenario) or (isinstance(scenario, str | File) and File(scenario).suffix.lower() == ".h5")
    opened = open_either(scenario, overrides) if made else open_scenario(scenario, overrides)
    return bound(opened.problem, dimensions, nodes, progress, any_depth)


def table(roadmap: AnyRoadmap, starts: Sequence[Point], goals: Sequence[Point]) -> Array:
    """Return the costs [s] of the cheapest paths from n points to m others: (n, m), inf where no path exists.

    Points are in the coordinates of the scenario's domain; see `query`.

    Examples:
        >>> planner.table("small.h5", [(-190, 190, 0)], [(100, -100, -75), (0, 0, -150)]).round()
        array([[430., 382.]])
    """
    return open_roadmap(roadmap).table(starts, goals)


def plot(
    roadmap: AnyRoadmap | Scenario,
    path: str | File | Path | None = None,
    output: str | File | None = None,
    depths: Sequence[float] | None = None,
    *,
    chart: bool = False,
    fronts: float | None = None,
    overrides: Sequence[str] = (),
) -> "Figure | None":
    """Draw a path over its roadmap or scenario, or a roadmap; see `OpenedRoadmap.plot`.

    In place of `roadmap` a path file may stand: it is drawn over what it was made with.

    Examples:
        >>> path = planner.query("small.h5")
        >>> figure = planner.plot("small.h5", path, "chart.png", chart=True)
        >>> planner.plot("small.h5", path, "page.html")
    """
    from .plot.draw import check_drawing

    route = roadmap if path is None and is_plan(roadmap) else path
    check_drawing(output, route, depths, chart, fronts)  # before the roadmap is read
    return open_either(roadmap, overrides).plot(route, output, depths, chart=chart, fronts=fronts)


def plot_routes(
    roadmap: AnyRoadmap | Scenario,
    paths: Sequence[str | File] | Mapping[str, Path],
    output: str | File | None = None,
    depth: float | None = None,
    *,
    overrides: Sequence[str] = (),
) -> "Figure":
    """Draw two to four paths of one problem side by side; see `OpenedRoadmap.plot_routes`.

    In place of `roadmap` a scenario may stand, or a path file: what that was made with.

    Examples:
        >>> paths = {"near": planner.query("small.h5", goal=(0, 0, -150)), "far": planner.query("small.h5")}
        >>> figure = planner.plot_routes("small.h5", paths, "routes.png")
    """
    return open_either(roadmap, overrides).plot_routes(paths, output, depth)


def plot_steering(
    scenario: str | File | Scenario,
    start: Point,
    goal: Point,
    output: str | File | None = None,
    *,
    overrides: Sequence[str] = (),
) -> "Figure":
    """Draw how legs are found from one point: its flow map at the goal's depth, and what each method finds.

    Points are in the coordinates of the scenario's domain. The scenario may have any steering method.

    Examples:
        >>> figure = planner.plot_steering("small.toml", (-190, 190, 0), (0, 0, -150), "steering.png")
    """
    from .plot import check_figure, plot_steering, save_figure

    if output is not None:
        check_figure(output)
    resolved = scenario if isinstance(scenario, Scenario) else read_scenario(scenario, overrides)
    problem = resolved.problem()
    ends = [resolved.domain.point(end) for end in (start, goal)]
    for end, name in zip(ends, ("start", "goal"), strict=True):
        problem.check_point(end, name)
    require(
        ends[0][2] != ends[1][2],
        "start and goal lie at the same depth; give another depth, because a leg changes its depth",
    )
    figure = plot_steering(problem, node_positions(problem), ends[0], ends[1])
    if output is not None:
        save_figure(figure, output)
    return figure


def describe(
    currents: str | File | Sequence[str | File],
    at: Sequence["Place"] = (),
    names: "Names | Mapping[str, Any] | None" = None,
) -> "Description":
    """Return what current files hold, how the planner reads them, and the current at places `at`.

    A place is lon, lat [degrees], depth [m] and the time (ISO 8601, UTC), or None if there is only one time.
    `names`: settings for what the files do not hold. InputError if they cannot be used.

    Examples:
        >>> description = planner.describe("currents.nc", at=[(18.5, 38.0, 100.0, None)])
        >>> print(description)  # doctest: +ELLIPSIS
        currents.nc
          18.5, 38, 100 m: +0.07905 m/s east, -0.03942 m/s north; 0.088 m/s toward compass 117 deg
          u           uo (standard_name eastward_sea_water_velocity, m s-1)
        ...
    """
    from .water.describe import describe

    return describe(currents, at, names)


def assimilate(
    forecast: str | File | Sequence[str | File],
    output: str | File | None = None,
    *,
    dives: Sequence[str | File] = (),
    points: Sequence[str | File] = (),
    drifters: Sequence[str | File] = (),
    names: "Names | Mapping[str, Any] | None" = None,
    columns: Mapping[str, str] | None = None,
    scales: Mapping[str, float] | None = None,
    kernel: str = "matern",
    inducing: int | None = None,
    members: int = 0,
    seed: int = 0,
) -> "Corrected":
    """Return a forecast of currents corrected by what vehicles measured, and write it to `output` as NetCDF.

    `dives`, `points`, `drifters`: files; `columns` names columns of CSV files that have other names. `scales` of
    the forecast's error that are known; the others are fitted. `members`: so many currents that may be; they are
    written to a second file, whose name ends in -members.nc. `inducing`: so many measurements stand for all, if
    there are very many.

    Examples:
        >>> header = "start,lon,lat,max_depth,dac_east,dac_north"
        >>> rows = ["2024-11-20T12:00,18.4,38.0,500,0.14,-0.05", "2024-11-20T12:00,18.5,37.95,500,0.13,-0.06"]
        >>> _ = pathlib.Path("measured.csv").write_text("\\n".join([header, *rows]))
        >>> better = planner.assimilate("currents.nc", "better.nc", dives=["measured.csv"])
        >>> better.after < better.before
        True
    """
    from .water.mapping.assimilate import assimilate
    from .water.ocean import read_currents

    some = [forecast] if isinstance(forecast, (str, File)) else list(forecast)
    _check_map(output, members, [*some, *dives, *points, *drifters])
    measured = _measurements(dives, points, drifters, columns)
    _warn_of_corrected(some)
    found = assimilate(read_currents(some, names), measured, scales, kernel=kernel, inducing=inducing, seed=seed)
    _write_map(found, output, members, seed)
    return found


def map_currents(
    lon: Range,
    lat: Range,
    spacing: float,
    output: str | File | None = None,
    *,
    dives: Sequence[str | File] = (),
    points: Sequence[str | File] = (),
    drifters: Sequence[str | File] = (),
    depth: Sequence[float] = (0.0,),
    times: Sequence[str] = (),
    columns: Mapping[str, str] | None = None,
    scales: Mapping[str, float] | None = None,
    kernel: str = "matern",
    inducing: int | None = None,
    members: int = 0,
    seed: int = 0,
) -> "Corrected":
    """Return a map of currents from measurements alone, every `spacing` [m] over `lon`, `lat` [degrees].

    At depths [m] and `times` (ISO 8601, UTC); see `assimilate` for the rest.

    Examples:
        >>> rows = ["lon,lat,u,v", "18.1,38.0,0.1,0.0", "18.2,38.1,0.2,0.1", "18.3,38.0,0.1,0.1"]
        >>> _ = pathlib.Path("points.csv").write_text("\\n".join(rows))
        >>> found = planner.map_currents((18.0, 18.4), (37.9, 38.2), 4000, "map.nc", points=["points.csv"])
        >>> found.file.u.shape
        (1, 1, 10, 10)
    """
    from .water.mapping.mapped import map_currents

    _check_map(output, members, [*dives, *points, *drifters])
    measured = _measurements(dives, points, drifters, columns)
    more: dict[str, Any] = {"kernel": kernel, "inducing": inducing, "seed": seed}
    found = map_currents(measured, lon, lat, spacing, depth, times, scales, **more)
    _write_map(found, output, members, seed)
    return found


def _check_map(output: str | File | None, members: int, inputs: Sequence[str | File]) -> None:
    require(members >= 0, f"`members` must be 0 or more; got {members}")
    require(members == 0 or output is not None, "`members` need an output file; name one")
    if output is not None:
        check_apart(output, inputs)
        require(File(output).suffix.lower() in MAP_ENDS, f"the output {output} must end in .nc: it is NetCDF")
        for file in [output, *([members_file(output)] if members else [])]:
            check_apart(file, inputs)
            check_output(file)


def _warn_of_corrected(files: Sequence[str | File]) -> None:
    """Warn of forecasts that hold measurements already: the same ones must not be counted again."""
    from .water.ocean.opening import opened

    for file in files:
        if File(file).suffix.lower() not in MAP_ENDS:
            continue
        with opened(File(file)) as data:
            if "uo_sd" in data.variables:
                done = f"{file} was corrected by measurements already: give no measurement twice"
                warnings.warn(f"{done}, or correct the first forecast by all of them", InputWarning, stacklevel=3)


def _measurements(
    dives: Sequence[str | File],
    points: Sequence[str | File],
    drifters: Sequence[str | File],
    columns: Mapping[str, str] | None,
) -> "list[Measurements]":
    """Return the measurements in some files."""
    from .water.mapping.observation_files import read_dives, read_drifters, read_points

    kinds = sum(map(bool, (dives, points, drifters)))
    require(kinds > 0, "there are no measurements; give files of dives, points or drifters")
    require(
        kinds == 1 or not columns,
        "columns can be named for one kind of file only; rename those of the others, or leave these files out",
    )
    found: list[Measurements] = [read_dives(dives, columns)] if dives else []
    found += [read_points(file, columns) for file in points]
    return found + [read_drifters(file, columns) for file in drifters]


def _write_map(found: "Corrected", output: str | File | None, members: int, seed: int) -> None:
    """Write a corrected current with its standard deviation, and its members beside."""
    if output is None:
        return
    from .water.ocean.writing import write_currents

    title, comment = found.file.name, f"{found.fit.scales}; {'; '.join(found.notes)}".rstrip("; ")
    write_currents(found.file, output, deviation=found.deviation(), title=title, comment=comment)
    if members:
        drawn = [(member.u, member.v) for member in found.members(members, seed)]
        write_currents(found.file, members_file(output), members=drawn, title=title, comment=comment)


def members_file(output: str | File) -> File:
    """Return the name of the file of members beside an output.

    Examples:
        >>> planner.members_file("better.nc").name
        'better-members.nc'
    """
    return File(output).with_name(f"{File(output).stem}-members.nc")


def calibrate(
    dives: str | File,
    output: str | File | None = None,
    *,
    preset: str = "seaglider",
    columns: Mapping[str, str] | None = None,
) -> "Calibration":
    """Return a preset fitted to the dives of a CSV file; its [glider] section is written to `output`.

    Examples:
        >>> calibration = planner.calibrate("dives.csv", "glider.toml")
        >>> sorted(calibration.parameters)
        ['climb_buoyancy', 'dive_buoyancy']
    """
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
    output: str | File | None = None,
    *,
    against: str | File | None = None,
    runs: int = 5,
    quick: bool = False,
    only: Sequence[str] = (),
    ceiling: str | File | None = None,
    currents: str | File | None = None,
    progress: "Callable[[benchmarks.Figure], None]" = lambda figure: None,
) -> "tuple[benchmarks.Record, list[str]]":
    """Measure this machine: return the record, and what has changed since the record `against`.

    `only`: the parts to measure; if it is empty, all but `large` (a million nodes), and but `file` without a file
    `currents` for the scenario `ionian`. Each figure is measured `runs` times. `quick`: small problems, to check
    that everything runs. `ceiling`: a program that takes turns with the integrator. The record is written to
    `output` as JSON.

    Examples:
        >>> record, moved = planner.bench("record.json", runs=1, quick=True, only=["integrator"])
        >>> [figure.name for figure in record.figures], moved
        (['evaluations_per_s'], [])
    """
    from .evaluation.bench import bench
    from .evaluation.record import read_record, write_record

    if output is not None:
        check_output(output)
    before = None if against is None else read_record(against)
    record = bench(runs=runs, quick=quick, only=only, ceiling=ceiling, currents=currents, progress=progress)
    if output is not None:
        write_record(record.as_dict(), output)
    return record, [] if before is None else record.moved(before)


def suite(
    output: str | File | None = None,
    *,
    ompl: str | File | None = None,
    only: Sequence[str] = (),
    quick: bool = False,
    pairs: int = 20,
    progress: Callable[[str], None] = lambda message: None,
) -> "Report":
    """Return the report on the suite's problems (`only`: some of them), solved by every method and baseline.

    `pairs`: random queries for each. `quick`: a small run. The report is written to `output` as JSON, and a log
    for each problem, which OMPL's tools read, into the folder `ompl`.

    Examples:
        >>> planner.suite(only=["atlantis"])  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        ...
        glider_stream.base.errors.InputError: ...atlantis...
    """
    from .evaluation.record import write_record
    from .evaluation.suite import ompl_log, run_suite

    if output is not None:
        check_output(output)
    if ompl is not None:
        require(File(ompl).is_dir(), f"the folder {ompl} for logs does not exist; make it first")
    report = run_suite(only, quick=quick, pairs=pairs, progress=progress)
    if output is not None:
        write_record(report.as_dict(), output)
    if ompl is not None:
        for name in report.references:
            (File(ompl) / f"{name}.log").write_text(ompl_log(report, name))
    return report


def simulate(
    mission: "str | File | Mission",
    runs: int,
    outputs: Sequence[str | File] = (),
    *,
    overrides: Sequence[str] = (),
    processes: int = 1,
    scheduler: str | None = None,
    restart: bool = False,
    show: tuple[int, str] = (0, "replan"),
    progress: "Callable[[Any], None]" = lambda progress: None,
) -> "Campaign":
    """Fly many runs of a mission (a file, a shipped name or an object), and write them to each of `outputs`.

    An output ends in .json (table and runs), .h5 (tracks), .png, .svg or .pdf (figure), or .html (a page that
    plays the run and policy that `show` names). With an output, runs are kept beside the first one until all are
    done: the same call continues a stopped campaign, unless it must `restart`. Runs are shared by `processes` of
    this machine, or by the workers of a Dask `scheduler`; neither changes a bit. A script that asks for several
    processes needs `if __name__ == "__main__":` around the call.

    Examples:
        >>> campaign = planner.simulate("small-mission.toml", 2)
        >>> [row.arrived.value for row in campaign.rows if row.policy == "replan"]
        [1.0]
    """
    from .mission.campaign import forget
    from .mission.campaign import simulate as fly
    from .mission.settings import Mission, read_mission
    from .simulated import check_outputs, write_campaign

    given = isinstance(mission, Mission)
    require(not (given and overrides), f"overrides are for a mission that is read; got {list(overrides)}")
    resolved = mission if isinstance(mission, Mission) else read_mission(mission, overrides)
    check_outputs(outputs, resolved, runs, show)
    keep = File(outputs[0]) if outputs else None
    job: dict[str, Any] = {"processes": processes, "address": scheduler, "restart": restart, "progress": progress}
    campaign = fly(resolved, runs, keep=keep, **job)
    write_campaign(campaign, outputs, show)
    if keep is not None:
        forget(keep)
    return campaign


def confidence(
    mission: "str | File | Mission",
    routes: Sequence[str | File] = (),
    *,
    members: Sequence[str | File] = (),
    draws: int | None = None,
    first: int = 0,
    best: float | str = 0.9,
    by: float | None = None,
    replanned: bool = False,
    reach: bool = False,
    outputs: Sequence[str | File] = (),
    figure: str | File | None = None,
    overrides: Sequence[str] = (),
    progress: "Callable[[Any], None]" = lambda progress: None,
) -> "tuple[Confidence, list[str]]":
    """Return how often and by when routes arrive in an ensemble of currents, and notes on the files written.

    The vehicle and its errors, its steering and calls, and what counts as arrived are those of a mission. The
    members are those of `members` (one file, or several files), or `draws` of the mission's [forecast_error] from
    number `first` on. Without `routes` (path files) candidates are searched. `best`: 0.9 for the earliest time by
    which 90 % arrive, "mean", or "by" for most arrivals `by` a time [s]. `replanned`: candidates are ways to plan
    anew at each call. `reach`: also where a vehicle can be by then. The chosen route is written to `outputs`.
    `progress` is told of each member that is done.

    Examples:
        >>> answer, _ = planner.confidence("small-mission.toml", draws=2, best="mean")
        >>> answer.best.arrived().value
        1.0
    """
    from .confident import answered

    given = (routes, members, draws, first, best, by, replanned, reach, outputs, figure, overrides, progress)
    return answered(mission, *given)
