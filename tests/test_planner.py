"""The planner's calls do what the commands do."""

import json

import numpy as np
import pytest
from helpers.small import command, roadmap, scenario_file

import glider_stream
from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.opened import opening
from glider_stream.roadmap.roadmap import Roadmap
from glider_stream.roadmap.store import read_roadmap, write_roadmap
from glider_stream.scenario import read_scenario

ARRAYS = ("position", "indptr", "target", "time", "cost", "glide_angle", "heading", "speed", "miss")


def assert_same_edges(a, b):
    for name in ARRAYS:
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes()
    assert a.counts == b.counts
    assert a.provenance.scenario == b.provenance.scenario


def test_build_is_the_command(tmp_path, capsys):
    scenario, sets = scenario_file(tmp_path), ("neighbours.k=6",)
    made = planner.build(scenario, tmp_path / "call.h5", threads=1, overrides=sets)
    assert command(capsys, "build", scenario, "-o", tmp_path / "command.h5", "--set", *sets).code == 0
    for file in ("call.h5", "command.h5"):
        assert_same_edges(read_roadmap(tmp_path / file), made)
    assert made.threads == 1


def test_build_takes_a_file_or_an_object_and_needs_no_output(tmp_path):
    file = scenario_file(tmp_path)
    for scenario in (file, str(file), read_scenario(file)):
        assert_same_edges(planner.build(scenario), roadmap())
    assert list(tmp_path.iterdir()) == [file]


def test_overrides_of_an_object_are_refused(tmp_path):
    scenario = read_scenario(scenario_file(tmp_path))
    with pytest.raises(InputError, match=r"overrides are for .* got \['neighbours.k=6'\]"):
        planner.build(scenario, overrides=["neighbours.k=6"])


def test_build_tells_its_progress(tmp_path):
    told = []
    planner.build(scenario_file(tmp_path), progress=told.append)
    assert told[-1].done == told[-1].total == 1540
    assert told[-1].connected == roadmap().target.size


def test_query_is_the_command(tmp_path, capsys):
    file = tmp_path / "small.h5"
    write_roadmap(roadmap(), file)
    call, commanded = tmp_path / "call.json", tmp_path / "command.json"
    for ends in ((), ((-30.0, 20.0, -50.0), (100.0, 20.0, -10.0))):
        words = [f"--{name}={x},{y},{z}" for name, (x, y, z) in zip(("start", "goal"), ends, strict=False)]
        path = planner.query(file, *ends, outputs=[call])
        said = command(capsys, "query", file, *words, "-o", commanded)
        assert said.out == f"{path}\n"
        assert call.read_bytes() == commanded.read_bytes()
        assert json.loads(call.read_text()) == path.as_dict()


def test_info_is_the_command(tmp_path, capsys):
    file = tmp_path / "small.h5"
    write_roadmap(roadmap(), file)
    road = planner.info(file)
    assert isinstance(road, Roadmap)
    assert planner.info(road) is road
    assert command(capsys, "info", file).out == f"{road}\n"
    assert json.loads(command(capsys, "info", file, "--json").out) == road.as_dict()


@pytest.mark.slow
def test_plot_is_the_command(tmp_path, capsys):
    file, path = tmp_path / "small.h5", tmp_path / "path.json"
    write_roadmap(roadmap(), file)
    route = planner.query(file, outputs=[path])
    planner.plot(file, route, tmp_path / "call.png")
    assert command(capsys, "plot", file, path, "-o", tmp_path / "command.png").code == 0
    assert (tmp_path / "call.png").read_bytes() == (tmp_path / "command.png").read_bytes()
    # a path alone knows what it was made with
    assert command(capsys, "plot", path, "-o", tmp_path / "alone.png").code == 0
    assert (tmp_path / "alone.png").read_bytes() == (tmp_path / "call.png").read_bytes()


def test_a_query_in_memory_is_one_from_the_file(tmp_path):
    file = tmp_path / "small.h5"
    write_roadmap(roadmap(), file)
    start, goal = (10.0, 20.0, -30.0), (-99.0, 5.0, -140.0)
    read, held = (planner.query(road, start, goal).as_dict() for road in (file, roadmap()))
    # only a file can be named
    assert (read["origin"].pop("roadmap"), read["origin"].pop("nodes_only")) == (str(file), False)
    assert read == held


def test_outputs_are_checked_before_the_work(tmp_path, monkeypatch):
    def work(*arguments):
        raise AssertionError("work was begun")

    monkeypatch.setattr(planner, "build_roadmap", work)
    monkeypatch.setattr(opening, "opened_roadmap", work)
    with pytest.raises(InputError, match="make it first"):
        planner.build(scenario_file(tmp_path), tmp_path / "none" / "out.h5")
    with pytest.raises(InputError, match="make it first"):
        planner.query(tmp_path / "road.h5", outputs=[tmp_path / "path.json", tmp_path / "none" / "path.json"])
    with pytest.raises(InputError, match="must end in one of"):
        planner.query(tmp_path / "road.h5", outputs=[tmp_path / "path.doc"])


@pytest.mark.parametrize("name", glider_stream.__all__)
def test_the_package_has_what_it_names(name):
    assert name == "__version__" or getattr(glider_stream, name).__name__ == name


def test_the_package_has_nothing_else():
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        glider_stream.nothing  # noqa: B018


def test_points_may_be_lists_or_arrays():
    start, goal = [10.0, 20.0, -30.0], np.array([-99.0, 5.0, -140.0])
    path = planner.query(roadmap(), start, goal)
    assert path.found
    assert path.start.tolist() == start
