"""A roadmap outlives a move: its files are found again by place, name and content; so are jobs."""

import json
import os
import shutil
from pathlib import Path

import pytest
from helpers.builds import datasets, interrupt
from helpers.forecasts import SCENARIO, write
from helpers.small import command

from glider_stream import planner
from glider_stream.base.errors import InputError, Stopped
from glider_stream.jobs.build import Job, build_file, merge, shard_of
from glider_stream.scenario import read_scenario, scenario_of

pytestmark = pytest.mark.slow

pytest.importorskip("xarray")
QUERY = "\n[query]\nstart = [10.3, 40.3, 0.0]\ngoal = [10.35, 40.35, 0.0]\n"
SMALL = ("sampling.count=60", "neighbours.k=8")


@pytest.fixture
def old(tmp_path):
    """A project: data/a.nc, run/a.toml, run/road.h5."""
    home = tmp_path / "old"
    (home / "data").mkdir(parents=True)
    (home / "run").mkdir()
    write(home / "data/a.nc")
    text = SCENARIO.replace('"a.nc"', '"../data/a.nc"') + QUERY
    (home / "run/a.toml").write_text(text)
    planner.build(home / "run/a.toml", home / "run/road.h5", overrides=SMALL)
    return home


def test_the_whole_project_moves(old, tmp_path):
    said = planner.query(old / "run/road.h5").as_dict()
    old.rename(tmp_path / "new")
    again = planner.query(tmp_path / "new/run/road.h5").as_dict()
    # a plan names the files that it was made with
    assert "new" in again["origin"].pop("roadmap")
    assert again["origin"].pop("scenario") != said["origin"].pop("scenario")
    assert said["origin"].pop("roadmap").startswith(str(old))
    assert again == said
    assert planner.verify(tmp_path / "new/run/road.h5", sample=3).holds


@pytest.mark.parametrize("name", ["a.nc", "renamed.nc"])
def test_currents_beside_the_roadmap(old, tmp_path, name):
    """By their name, and by their content among others."""
    new = tmp_path / "new"
    new.mkdir()
    shutil.move(old / "run/road.h5", new / "road.h5")
    shutil.move(old / "data/a.nc", new / name)
    write(new / "another.nc", 0.5)
    (new / "notes.txt").write_text("nothing")
    road = planner.info(new / "road.h5")
    assert scenario_of(road).flow.file == (str(new / name),)
    assert planner.query(road) is not None


def test_another_forecast_of_the_same_name_is_not_taken(old):
    shutil.move(old / "data/a.nc", old / "run/yesterday.nc")
    write(old / "data/a.nc", 0.5)
    road = planner.info(old / "run/road.h5")
    assert scenario_of(road).flow.file == (str(old / "run/yesterday.nc"),)
    (old / "run/yesterday.nc").unlink()
    with pytest.raises(InputError, match="the flow has changed since the roadmap was built"):
        planner.query(old / "run/road.h5")


def test_currents_are_named(old, tmp_path, capsys):
    away = tmp_path / "far/away.nc"
    away.parent.mkdir()
    shutil.move(old / "data/a.nc", away)
    road = str(old / "run/road.h5")
    for arguments in (
        ["query", road, "--json"],
        ["plot", road, "-o", "x.png"],
        ["verify", road, "--sample", "1"],
    ):
        said = command(capsys, *arguments)
        assert said.code in (1, 2)
        assert "say where it is with --set flow.file=FILE" in said.out + said.err
    sets = ["--set", f"flow.file={away}"]
    assert "no path" in command(capsys, "query", road, *sets).err
    assert command(capsys, "verify", road, "--sample", "1", *sets).code == 0
    said = command(capsys, "query", road, *sets, "--set", "integration.dt=1.0")
    assert said.code == 2
    assert "`--set` names a file of the roadmap's scenario, flow.file; got 'integration.dt=1.0'" in said.err


def test_a_build_goes_on_in_a_renamed_folder(old, tmp_path):
    whole = datasets(old / "run/road.h5")
    problem = read_scenario(old / "run/a.toml", SMALL).problem()
    with pytest.raises(Stopped):
        build_file(problem, old / "run/again.h5", progress=interrupt, batch_pairs=100)
    kept = (old / "run/again.h5.journal").stat().st_size
    old.rename(tmp_path / "new")
    seen = []
    problem = read_scenario(tmp_path / "new/run/a.toml", SMALL).problem()
    build_file(problem, tmp_path / "new/run/again.h5", progress=lambda p: seen.append(p.done), batch_pairs=100)
    assert kept > 1000
    assert seen[0] > 100  # the first batch was there
    assert datasets(tmp_path / "new/run/again.h5") == whole


def test_shards_of_two_folders_merge(old, tmp_path):
    """Equal currents in two node-local folders; other currents are refused."""
    whole = datasets(old / "run/road.h5")
    shutil.copytree(old, tmp_path / "node2")
    for number, home in ((1, old), (2, tmp_path / "node2")):
        problem = read_scenario(home / "run/a.toml", SMALL).problem()
        build_file(problem, tmp_path / f"{number}.h5", job=Job(shard=shard_of(f"{number}/2")))
    merge([tmp_path / "1.h5", tmp_path / "2.h5"], tmp_path / "road.h5")
    assert datasets(tmp_path / "road.h5") == whole
    write(tmp_path / "node2/data/a.nc", 0.5)
    problem = read_scenario(tmp_path / "node2/run/a.toml", SMALL).problem()
    build_file(problem, tmp_path / "2.h5", job=Job(shard=shard_of("2/2")))
    with pytest.raises(InputError, match="flow_sha256 differ"):
        merge([tmp_path / "1.h5", tmp_path / "2.h5"], tmp_path / "road.h5")


def test_what_a_roadmap_keeps_of_its_files(old):
    told = json.loads(planner.info(old / "run/road.h5").provenance.inputs)
    assert told["folder"] == str((old / "run").resolve())
    [one] = told["files"]["flow.file"]
    assert os.path.samefile(one["name"], old / "data/a.nc")
    assert Path(one["name"]).is_absolute()
