"""Routes side by side: what the figure shows of each, and what it refuses."""

from dataclasses import replace

import pytest
from helpers.small import command, roadmap

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.pilot.export import export_path
from glider_stream.roadmap.store import write_roadmap

OTHER = (-100.0, -100.0, 0.0)


@pytest.fixture(scope="module")
def two():
    return {"near": planner.query(roadmap()), "far": planner.query(roadmap(), goal=OTHER)}


def texts(figure):
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    return legend, [text.get_text() for axes in figure.axes for text in axes.texts]


def test_each_route_is_drawn_with_its_legs_and_time(two):
    legend, notes = texts(planner.plot_routes(roadmap(), two))
    assert len({path.travel_time for path in two.values()}) == 2
    for (name, path), label in zip(two.items(), legend, strict=False):
        assert label.startswith(f"{name}: {len(path.legs)} legs, {path.travel_time:,.0f} s")
        assert any(note.startswith(f"{name} arrives\nafter {path.travel_time:,.0f} s") for note in notes)
    assert legend[2:] == ["start", "goal"]


def test_routes_end_where_their_times_say(two):
    figure = planner.plot_routes(roadmap(), two)
    profile = figure.axes[3]
    unit = {"min": 60.0, "s": 1.0}[profile.get_xlabel().split("(")[1].rstrip(")")]
    ends = [max(line.get_xdata()) * unit for line in profile.lines if len(line.get_xdata()) > 2]
    assert ends == pytest.approx([path.travel_time for path in two.values()])


def test_the_command_draws_several_files(two, tmp_path, capsys):
    road, files = tmp_path / "road.h5", []
    write_roadmap(roadmap(), road)
    for name, path in two.items():
        files.append(tmp_path / f"{name}.json")
        export_path(path, files[-1])
    drawn = tmp_path / "routes.png"
    assert command(capsys, "plot", road, *files, "-o", drawn).code == 0
    assert drawn.stat().st_size > 10_000
    refused = command(capsys, "plot", road, *files, "-o", drawn, "--chart")
    assert refused.code == 2
    assert "several routes need one --depth" in refused.err
    refused = command(capsys, "plot", files[0], files[0], "-o", drawn)
    assert refused.code == 2
    assert "each path needs a different name" in refused.err


def test_what_cannot_be_compared_is_refused(two):
    path = two["near"]
    with pytest.raises(InputError, match="shows 2 to 4 routes; got 1"):
        planner.plot_routes(roadmap(), {"near": path})
    with pytest.raises(InputError, match="the path empty has no leg"):
        planner.plot_routes(roadmap(), {**two, "empty": replace(path, legs=())})
    away = replace(path, legs=(replace(path.legs[0], end=path.legs[0].end - [1e6, 0.0, 0.0]),))
    with pytest.raises(InputError, match="the path away leaves the roadmap's water"):
        planner.plot_routes(roadmap(), {**two, "away": away})
    with pytest.raises(InputError, match="`depth` must be from 0 m to 1"):
        planner.plot_routes(roadmap(), two, depth=400.0)
