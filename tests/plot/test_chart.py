"""The chart's parts against what they must be: currents, seabed, fronts, degrees, the calls that draw it."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.scenes import arrivals, box_scene, ocean_scene
from helpers.small import command, roadmap
from matplotlib.figure import Figure

from glider_stream import planner, plot
from glider_stream.base.errors import InputError
from glider_stream.kernels.terrain import OpenWater, Seabed
from glider_stream.plot.fronts import front_times
from glider_stream.plot.graticule import draw_graticule, named, round_degrees
from glider_stream.plot.seabed import without_clearance
from glider_stream.plot.water import frame_of
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import scenario_from_text
from glider_stream.search.path import Leg, Path
from glider_stream.search.query import Planner
from glider_stream.water.frame import LocalFrame


@pytest.fixture(scope="module")
def problem():
    return scenario_from_text(roadmap().provenance.scenario).problem()


def test_the_current_along_a_route_is_the_flow_there(problem):
    path = planner.query(roadmap())
    steps = plot.along(path)
    assert len(path.legs) > 2
    rows = [np.concatenate([[leg.depart], leg.trajectory[:, 0]]) for leg in path.legs]
    assert steps.time[0] > 0
    assert steps.time[-1] < path.travel_time == pytest.approx(rows[-1][-1])
    x, y, z = (np.interp(steps.time, path.trajectory[:, 0], path.trajectory[:, k]) for k in (1, 2, 3))
    u, v = plot.sample_field(problem.evaluator.flow, x, y, z, 0.0)
    assert np.hypot(u, v).max() > 0.2
    np.testing.assert_allclose([steps.u, steps.v], [u, v], atol=0.01)
    over = np.hypot(steps.u + steps.through * np.sin(np.radians(steps.heading)),
                    steps.v + steps.through * np.cos(np.radians(steps.heading)))  # fmt: skip
    np.testing.assert_allclose(steps.speed, over, atol=1e-9)


def test_headings_and_currents_are_true_where_the_frame_is_turned():
    """East of the frame's centre, in the north, true north lies to the left of +y."""
    frame = LocalFrame(lon=10.0, lat=60.0)
    at = SimpleNamespace(to_lonlat=lambda p: np.stack(frame.to_lonlat(*p[:, :2].T), axis=-1), departs=None)
    (x,), (y,) = frame.to_local([16.0], [60.0])
    (ex,), (ey,) = frame.to_local([16.01], [60.0])
    east = math.atan2(ey - y, ex - x)
    t = np.linspace(0.0, 1000.0, 21)
    ways = 0.5 * np.array([math.cos(east), math.sin(east)])  # 0.3 through water, 0.2 of current, both eastward
    rows = np.column_stack([t, x + ways[0] * t, y + ways[1] * t, -0.1 * t])
    leg = Leg(rows[0, 1:], rows[-1, 1:], -1e-9, east, 0.3, 0.0, 1000.0, 0.0, rows)
    path = plot.placed(Path(leg.start, leg.end, 1000.0, (leg,)), at)
    steps = plot.along(path)
    assert abs(math.degrees(east)) > 4
    np.testing.assert_allclose(steps.heading, 90.0, atol=0.05)
    np.testing.assert_allclose(steps.course, 90.0, atol=0.05)
    np.testing.assert_allclose(steps.u, 0.2, atol=1e-3)
    np.testing.assert_allclose(steps.v, 0.0, atol=1e-3)
    np.testing.assert_allclose(path.lonlat[0], [16.0, 60.0], atol=1e-9)


def test_seabed_is_found_by_asking():
    terrain = ocean_scene().terrain
    x, y = np.random.default_rng(0).uniform(-30e3, 30e3, (2, 200))
    i, j = (np.rint((side + 30e3) / 2e3).astype(int) for side in (x, y))
    bottom = terrain.bottom[i, j]
    assert (bottom >= 0).any()
    np.testing.assert_allclose(plot.sample_bottom(terrain, x, y), np.minimum(bottom, 0.0), atol=0.02)
    unknown = terrain._replace(ground=np.where(terrain.ground > -1000.0, terrain.ground, -np.inf))
    known = plot.sample_bottom(unknown, x, y)
    np.testing.assert_array_equal(np.isfinite(known), bottom > -1000.0)
    assert np.isneginf(plot.sample_bottom(OpenWater(-np.inf), x, y)).all()
    np.testing.assert_allclose(plot.sample_bottom(OpenWater(-80.0), x, y), -80.0, atol=0.02)
    assert without_clearance(terrain).clearance == 0.0 < terrain.clearance


def test_a_figure_shows_the_seabed_and_not_what_is_closed():
    """Clearance, keep-out and the end of the data close water; none of it is ground."""
    ground, closed = np.array([[-np.inf, -200.0], [-90.0, 5.0]]), np.array([[-550.0, -150.0], [0.0, 0.0]])
    corners = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], indexing="ij"), axis=-1)
    terrain = Seabed(closed, 30.0, corners, 1.0, 1.0, 0.0, 0.0, ground)
    x, y = np.meshgrid([0.0, 1.0], [0.0, 1.0], indexing="ij")
    np.testing.assert_allclose(plot.sample_bottom(terrain, x, y), [[-np.inf, -200.0], [-90.0, 0.0]], atol=0.02)


@pytest.mark.parametrize("start", [None, (13.0, 20.0, -30.0)])
def test_arrivals_are_the_times_of_queries(problem, start):
    search = Planner(roadmap(), problem)
    arrival = search.arrivals(start)
    assert arrival.shape == (len(roadmap().position),)
    assert np.isfinite(arrival).mean() > 0.5
    chosen = range(0, arrival.size, 9)
    paths = search.queries(start, [roadmap().position[n] for n in chosen])
    for n, path in zip(chosen, paths, strict=True):
        # a query also looks at the leg from end to end, which a node's neighbours need not hold
        assert path.travel_time <= arrival[n] + 1e-9
    same = [path.travel_time == pytest.approx(arrival[n]) for n, path in zip(chosen, paths, strict=True)]
    assert np.mean(same) > 0.7


def test_fronts_are_circles_where_time_is_distance():
    side = np.linspace(-1000.0, 1000.0, 41)
    x, y = (a.ravel() for a in np.meshgrid(side, side))
    position = np.concatenate([np.column_stack([x, y, np.full(x.size, z)]) for z in (0.0, -100.0)])
    arrival = np.hypot(position[:, 0], position[:, 1]) * 10.0 + np.where(position[:, 2] < 0, 0.0, 500.0)
    arrival[position[:, 0] > 800] = np.inf
    fronts = plot.fronts_of(position, arrival, OpenWater(-np.inf))
    assert len(fronts.x) == 41 * 37
    np.testing.assert_allclose(fronts.time, np.hypot(fronts.x, fronts.y) * 10.0)  # the earlier of two depths
    ax = Figure().add_subplot()
    problem = SimpleNamespace(lo=position.min(axis=0), hi=position.max(axis=0), to_lonlat=None)
    plot.fronts.draw_fronts(ax, frame_of(problem, position), fronts, 1.0)
    (lines,) = ax.collections
    radii = [np.hypot(*path.vertices.T) for path in lines.get_paths()]
    assert len(radii) == math.floor(math.hypot(1000.0, 1000.0) / 360.0)
    for n, radius in enumerate(radii, 1):
        np.testing.assert_allclose(radius, 360.0 * n, atol=8.0)
    labels = np.array([text.get_position() for text in ax.texts])
    assert len(labels) >= 3
    assert np.abs(labels).max() < 1000.0 - 0.03 * 2000.0  # none over the edge
    apart = np.linalg.norm(labels[:, None] - labels, axis=2)
    assert apart[~np.eye(len(labels), dtype=bool)].min() > 0.07 * 2000.0


def test_fronts_stop_at_the_shore():
    scene = ocean_scene()
    fronts = plot.fronts_of(scene.position, arrivals(scene), scene.terrain)
    corners = np.column_stack([fronts.x, fronts.y])[fronts.triangles]
    bottom = plot.sample_bottom(scene.terrain, *corners.mean(axis=1).T)
    assert len(corners) > 1500
    assert (bottom < 0).all()
    for few in (0, 2):
        reached = np.where(np.arange(len(scene.position)) < few, 1.0, np.inf)
        assert plot.fronts_of(scene.position, reached, scene.terrain).triangles.shape == (0, 3)
    line = np.column_stack([np.arange(5.0), np.arange(5.0), np.zeros(5)])
    assert not plot.fronts_of(line, np.arange(5.0), OpenWater(-np.inf)).triangles.size


@pytest.mark.parametrize("hours", [0.0, -3.0, math.nan, math.inf, 1e-4])
def test_fronts_that_cannot_be_drawn_are_refused(hours):
    fronts = plot.Fronts(np.zeros(1), np.zeros(1), np.array([7200.0]), np.empty((0, 3), np.intp))
    with pytest.raises(InputError, match=re.escape(f"{hours:g}")):
        front_times(fronts, hours)
    np.testing.assert_allclose(front_times(fronts, 0.5), [1800.0, 3600.0, 5400.0, 7200.0])


def test_ticks_stand_where_their_degrees_are():
    frame = LocalFrame(lon=179.9, lat=-40.0)
    problem = SimpleNamespace(
        lo=np.array([-60e3, -50e3, -100.0]),
        hi=np.array([60e3, 50e3, 0.0]),
        to_lonlat=lambda p: np.stack(frame.to_lonlat(*p[:, :2].T), axis=-1),
    )
    box, ax = frame_of(problem, problem.lo[None]), Figure().add_subplot()
    draw_graticule(ax, box)
    for axis, low in ((ax.xaxis, problem.lo[1]), (ax.yaxis, problem.lo[0])):
        ticks = axis.get_ticklocs() * box.unit
        at = (ticks, np.full_like(ticks, low)) if axis is ax.xaxis else (np.full_like(ticks, low), ticks)
        angle = frame.to_lonlat(*at)[axis is ax.yaxis]
        letters = "EW" if axis is ax.xaxis else "NS"
        assert len(ticks) >= 3
        assert [label.get_text() for label in axis.get_ticklabels()] == [
            named(round(a, 4), letters) for a in angle
        ]
    assert "179.5°W" in [label.get_text() for label in ax.get_xticklabels()]  # beyond the date line


def test_names_and_steps_of_degrees():
    said = [named(a, "EW") for a in (0.0, -0.25, 12.5, 180.0, 180.5, -180.5)]
    assert said == ["0°", "0.25°W", "12.5°E", "180°", "179.5°W", "179.5°E"]
    assert round_degrees(18.2, 18.85, 4).tolist() == [18.2, 18.4, 18.6, 18.8]
    assert round_degrees(-170.0, 170.0, 4).size <= 12


def test_a_profile_shows_the_seabed_where_it_is_near():
    scene = ocean_scene()
    raised = np.minimum(scene.terrain.ground, 0.0) * 0.5 - 1.0
    shallow = scene.terrain._replace(bottom=raised, ground=raised, clearance=0.0)
    for terrain, said, ground in ((scene.terrain, "1,4", False), (shallow, "over the seabed", True)):
        figure = plot.plot_chart(scene.flow, terrain, scene.problem, plot.placed(scene.path, scene.problem))
        (ax,) = (ax for ax in figure.findobj(lambda a: hasattr(a, "scatter")) if "(b)" in ax.get_title("left"))
        assert said in ax.get_title("left")
        fills = [one for one in ax.collections if type(one).__name__ == "FillBetweenPolyCollection"]
        assert bool(fills) == ground
        assert figure._suptitle.get_text().endswith("departs 2024-11-20 18:00 UTC, arrives 2024-11-21 14:00 UTC")


def test_a_chart_without_a_leg_or_at_two_depths_is_refused():
    scene = box_scene()
    with pytest.raises(InputError, match="without any"):
        plot.plot_chart(scene.flow, scene.terrain, scene.problem, Path(np.zeros(3), np.ones(3), math.inf, ()))
    with pytest.raises(InputError, match=re.escape("got [0, 100]")):
        plot.plot_chart(scene.flow, scene.terrain, scene.problem, scene.path, [0, 100])


@pytest.mark.slow
def test_charts_from_the_shell(tmp_path, capsys):
    file, path = tmp_path / "small.h5", tmp_path / "path.json"
    write_roadmap(roadmap(), file)
    route = planner.query(file, outputs=[path])
    planner.plot(file, route, tmp_path / "call.png", fronts=0.05)
    for name, options in (("fronts.png", ("--fronts", "0.05")), ("chart.svg", ("--chart", "--depth", "50"))):
        assert command(capsys, "plot", file, path, "-o", tmp_path / name, *options).code == 0
    assert (tmp_path / "call.png").read_bytes() == (tmp_path / "fronts.png").read_bytes()
    for options, said in (
        (("-o", tmp_path / "a.png", "--fronts", "6"), "`fronts` needs a path"),
        (("-o", tmp_path / "a.png", "--chart"), "a chart needs a path"),
        (("-o", tmp_path / "a.html"), "a page needs a path"),
        ((path, "-o", tmp_path / "a.png", "--fronts", "-1"), "got -1"),
        ((path, "-o", tmp_path / "a.html", "--fronts", "nan"), "got nan"),
        ((path, "-o", tmp_path / "none" / "a.html"), "make it first"),
    ):
        refused = command(capsys, "plot", file, *options)
        assert refused.code == 2, options
        assert said in refused.err
        assert refused.err.count("\n") == 1
    assert not list(tmp_path.glob("a.*"))
