import re
import sys
import tomllib
from itertools import combinations
from pathlib import Path as FilePath
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.scenes import arrivals, box_scene, ocean_scene, zigzag
from helpers.small import SCENARIO
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from glider_stream import plot
from glider_stream.base.errors import InputError
from glider_stream.kernels.flow import velocity
from glider_stream.kernels.terrain import allowed
from glider_stream.roadmap.builder import node_positions
from glider_stream.scenario import scenario_from_table
from glider_stream.search.path import Path

pytestmark = pytest.mark.slow

UNIT = re.compile(r"\((m|km|s|min|h|days|m/s|°|degrees|count)\)")
SIGNATURES = {".png": b"\x89PNG\r\n\x1a\n", ".svg": b"<?xml", ".pdf": b"%PDF-"}


def roadmap_of(scene, reach):
    random, tree, z = np.random.default_rng(2), cKDTree(scene.position), scene.position[:, 2]
    near = [np.sort(tree.query_ball_point(p, reach)) for p in scene.position]
    rows = [[m for m in row if z[m] != z[n] and random.random() < 0.3] for n, row in enumerate(near)]
    source = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    target = np.concatenate(rows).astype(np.int32)
    delta = scene.position[target] - scene.position[source]
    return SimpleNamespace(
        position=scene.position,
        indptr=np.concatenate([[0], np.cumsum([len(row) for row in rows])]),
        target=target,
        time=np.linalg.norm(delta, axis=1) / random.uniform(0.3, 1.5, target.size),
        glide_angle=np.sign(delta[:, 2]) * random.uniform(0.3, 1, target.size),
        heading=np.arctan2(delta[:, 1], delta[:, 0]) + random.normal(0, 0.4, target.size),
        counts={"connected": target.size, "no_hit": 4 * target.size},
    )


def steering_scene():
    problem = scenario_from_table(tomllib.loads(SCENARIO), FilePath()).problem()
    nodes = node_positions(problem)
    return plot.plot_steering(problem, nodes, np.array([-150.0, 40.0, 0.0]), np.array([-40.0, 0.0, -75.0]))


def draw(name):
    if name == "steering":
        return steering_scene()
    scene = ocean_scene() if "ocean" in name else box_scene()
    if "roadmap" in name:
        road = roadmap_of(scene, 12e3 if "ocean" in name else 250.0)
        return plot.plot_roadmap(scene.flow, scene.terrain, scene.problem, road, title="A roadmap")
    if "many" in name:
        depths = [0, *np.tile([300, 50], 60), 0]
        scene.path = zigzag((-450, 450), (450, -450), depths, 5 * 86400.0, 5.0, rows=9)
    if "chart" in name:
        fronts = plot.fronts_of(scene.position, arrivals(scene), scene.terrain)
        path, every = plot.placed(scene.path, scene.problem), 12.0 if "ocean" in name else 0.1
        arguments = (scene.flow, scene.terrain, scene.problem, path)
        return plot.plot_chart(*arguments, fronts=(fronts, every), title="A chart")
    return plot.plot_route(scene.flow, scene.terrain, scene.problem, scene.position, scene.path, title="A route")


FIGURES = [
    "route in a box",
    "route in the ocean",
    "route of many legs",
    "roadmap of a box",
    "roadmap of the ocean",
    "steering",
    "chart in a box",
    "chart of the ocean",
]


@pytest.fixture(scope="module")
def figures():
    return {name: draw(name) for name in FIGURES}


def written(figure):
    """Every text that shows, with its box in pixels."""
    texts = [figure._suptitle]
    for ax in figure.findobj(lambda artist: hasattr(artist, "get_xlabel")):
        axes = [ax.xaxis, ax.yaxis, *([ax.zaxis] if hasattr(ax, "zaxis") else [])]
        texts += [ax.title, ax._left_title, *ax.texts]
        texts += [] if ax.get_legend() is None else ax.get_legend().get_texts()
        texts += [artist.text for artist in ax.artists if hasattr(artist, "labelsep")]
        for axis in axes if ax.axison else []:
            low, high = sorted(axis.get_view_interval())
            texts += [axis.label]
            ticks = [t for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
            texts += [label for t in ticks for label in (t.label1, t.label2)]
    shown = [text for text in texts if text.get_visible() and text.get_text().strip()]
    return [(text.get_text(), text.get_window_extent()) for text in shown]


@pytest.mark.parametrize("name", FIGURES)
def test_no_label_covers_another_or_leaves_the_page(figures, name):
    texts = written(figures[name])
    assert len(texts) > 40
    for text, box in texts:
        page = figures[name].bbox
        assert page.x0 <= box.x0 < box.x1 <= page.x1, text
        assert page.y0 <= box.y0 < box.y1 <= page.y1, text
    for (one, a), (other, b) in combinations(texts, 2):
        # a pixel of shared margin is no collision
        wide, high = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert wide <= 1 or high <= 1, f"{one!r} covers {other!r}"


@pytest.mark.parametrize("name", FIGURES)
def test_axes_say_what_and_in_which_unit(figures, name):
    for ax in figures[name].findobj(Axes):
        if not ax.axison:
            continue
        title = ax.get_title("left")
        for axis in [ax.xaxis, ax.yaxis, *([ax.zaxis] if hasattr(ax, "zaxis") else [])]:
            label, labelled = (
                axis.label.get_text(),
                any(t.label1.get_visible() for t in axis.get_major_ticks()),
            )
            is_bar = ax.get_label() == "<colorbar>"
            assert UNIT.search(label) or (not label and (is_bar or not labelled)), (title, label)
        assert UNIT.search(ax.get_xlabel() + ax.get_ylabel()) or title.startswith("Current")


def titles(figure):
    return [ax.get_title("left") for ax in figure.findobj(Axes)]


def test_panels_and_their_units_fit_the_scale(figures):
    box, ocean = figures["route in a box"], figures["route in the ocean"]
    current = [title for title in titles(box) if "Current" in title]
    assert current == ["(b) Current at 0 m", *(f"Current at {depth} m" for depth in (100, 200, 300))]
    assert "(b) Current at 0 m" in titles(ocean)
    assert ocean._suptitle.get_text().endswith("; currents of 2024-11-20 18:00 UTC")
    labels = [text for text, _ in written(ocean)]
    assert {
        "Longitude (°)",
        "Latitude (°)",
        "Depth (m)",
        "Time since departure (h)",
    } <= set(labels)
    assert "Time since departure (min)" in [text for text, _ in written(box)]
    assert box._suptitle.get_text() == "A route: 9 legs, 25 min"
    for letter in "abcd":
        assert any(title.startswith(f"({letter})") for title in titles(figures["roadmap of a box"]))


def test_land_is_grey_on_the_maps(figures):
    for name, most in (("route in the ocean", 2), ("route in a box", 0)):
        maps = [ax for ax in figures[name].axes if "Current at" in ax.get_title("left")]
        assert all(ax.images[0].get_array().max() == most for ax in maps)
        assert all(np.ma.is_masked(ax.images[1].get_array()) == (most > 0) for ax in maps)


def test_samplers_are_the_kernels():
    for scene in (box_scene(), ocean_scene()):
        low, high = scene.problem.lo, scene.problem.hi
        x, y, z = np.random.default_rng(0).uniform(low, high, (30, 3)).T
        expected = [velocity(scene.flow, *point, 7.0) for point in zip(x, y, z, strict=True)]
        np.testing.assert_allclose(
            np.transpose(plot.sample_field(scene.flow, x, y, z, 7.0)), expected, rtol=1e-12
        )
        wet = [allowed(scene.terrain, *point) for point in zip(x, y, z, strict=True)]
        assert plot.sample_water(scene.terrain, x, y, z).tolist() == wet
        assert np.isnan(plot.sample_field(scene.flow, x + 1e6, y, -5.0, 7.0)).all()


def test_chosen_depths():
    scene = box_scene()
    arguments = (scene.flow, scene.terrain, scene.problem, scene.position, scene.path)
    shown = [t for t in titles(plot.plot_route(*arguments, depths=[150.0])) if "Current at" in t]
    assert shown == ["(b) Current at 150 m"]
    for depths, said in (([], "got 0"), ([1, 2, 3, 4, 5], "got 5"), ([-20.0], "got -20")):
        with pytest.raises(InputError, match=said):
            plot.plot_route(*arguments, depths=depths)


def test_a_path_without_legs_is_refused():
    scene = box_scene()
    nowhere = Path(scene.path.start, scene.path.goal, np.inf, ())
    with pytest.raises(InputError, match="without any"):
        plot.plot_route(scene.flow, scene.terrain, scene.problem, scene.position, nowhere)


def test_a_roadmap_without_edges_is_drawn():
    scene = box_scene()
    empty, nodes = np.empty(0), len(scene.position)
    road = SimpleNamespace(
        position=scene.position,
        indptr=np.zeros(nodes + 1, np.int64),
        target=np.empty(0, np.int32),
        time=empty,
        glide_angle=empty,
        heading=empty,
        counts={"no_hit": 7},
    )
    figure = plot.plot_roadmap(scene.flow, scene.terrain, scene.problem, road)
    assert f"{nodes:,}" in [text for text, _ in written(figure)]


@pytest.mark.parametrize("suffix", SIGNATURES)
def test_same_figure_same_file(tmp_path, suffix):
    figure = Figure(figsize=(4, 3))
    figure.add_subplot(title="a title").scatter([1, 2], [3, 4])
    one, other = tmp_path / f"one{suffix}", tmp_path / f"other{suffix.upper()}"
    for path in (one, other):
        plot.save_figure(figure, path, dpi=60)
    assert one.read_bytes().startswith(SIGNATURES[suffix])
    assert one.read_bytes() == other.read_bytes()
    assert sorted(tmp_path.iterdir()) == sorted([one, other])


def test_same_input_same_file(figures, tmp_path):
    name = "route in a box"
    for n, figure in enumerate((figures[name], draw(name), draw(name), draw(name))):
        plot.save_figure(figure, tmp_path / f"{n}.png", dpi=60)
    first, *others = ((tmp_path / f"{n}.png").read_bytes() for n in range(4))
    same = [other == first for other in others]
    assert all(same)  # no difference of bytes is worth showing


@pytest.mark.parametrize("name", ["route.bmp", "route"])
def test_an_unknown_ending_is_refused(tmp_path, name):
    for refuse in (plot.check_figure, lambda path: plot.save_figure(None, path)):
        with pytest.raises(InputError, match=re.escape(f"{name} must end in one of: .png, .svg, .pdf")):
            refuse(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_failed_save_leaves_the_old_file(tmp_path):
    old = tmp_path / "route.png"
    old.write_text("old")

    def savefig(path, **options):
        path.write_text("half")
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match=r"route\.png cannot be written whole: no space left on device"):
        plot.save_figure(SimpleNamespace(savefig=savefig), old)
    with pytest.raises(InputError, match="got 0"):
        plot.save_figure(SimpleNamespace(savefig=savefig), old, dpi=0)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_a_missing_extra_names_the_cure(monkeypatch):
    monkeypatch.setitem(sys.modules, "cmocean", None)
    with pytest.raises(InputError, match=re.escape("pip install glider-stream[plot]")):
        draw("route in a box")
