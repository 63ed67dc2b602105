"""Campaigns: the same bits on any number of processes, killed and continued; the table and the files."""

import contextlib
import json
import math
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from helpers.missions import mission, write_mission
from helpers.small import command

from glider_stream import planner
from glider_stream.base.errors import InputError, Stopped
from glider_stream.jobs.cluster import Cluster
from glider_stream.kernels.terrain import OpenWater
from glider_stream.mission import campaign
from glider_stream.mission.campaign import identity_of, simulate
from glider_stream.mission.run import Runner
from glider_stream.mission.settings import read_mission, shipped_missions
from glider_stream.mission.statistics import median, share
from glider_stream.simulated import write_campaign

pytestmark = pytest.mark.slow
RUNS = 3
FEWER = {"pilot.policies": ["open-loop", "replan", "omniscient"]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("campaign")
    file = write_mission(made)
    policies = '"open-loop", "replan", "straight", "depth-averaged", "omniscient"'
    assert policies in file.read_text()
    file.write_text(file.read_text().replace(policies, '"open-loop", "replan", "omniscient"'))
    return made


def test_a_campaign_is_told_by_what_its_files_hold():
    def water(rise, floor):
        return SimpleNamespace(evaluator=SimpleNamespace(flow=OpenWater(rise), terrain=OpenWater(floor)))

    told = SimpleNamespace(text="the same names of files")
    true, forecast = water(1.0, -300.0), water(2.0, -300.0)
    first = identity_of(told, (true, forecast))
    assert identity_of(told, (water(1.0, -300.0), water(2.0, -300.0))) == first
    assert identity_of(told, (water(1.0, -200.0), forecast)) != first  # other closed water
    assert identity_of(told, (true, water(2.1, -300.0))) != first  # another forecast


def small(folder, changes=()):
    return mission(folder, {**FEWER, **dict(changes)})


@pytest.fixture(scope="module")
def alone(folder):
    return simulate(small(folder), RUNS)


def same(one, other):
    assert len(one.runs) == len(other.runs)
    for a, b in zip(one.runs, other.runs, strict=True):
        for x, y in zip(a, b, strict=True):
            assert (x.policy, x.number, x.ended, x.time, x.energy) == (
                y.policy,
                y.number,
                y.ended,
                y.time,
                y.energy,
            )
            assert np.array_equal(x.track, y.track)
            assert np.array_equal(x.line, y.line)


def test_processes_change_no_bit(folder, alone):
    same(alone, simulate(small(folder), RUNS, processes=2))


@pytest.mark.filterwarnings("ignore")  # what dask says while it ends is its own
def test_a_cluster_changes_no_bit(folder, alone, monkeypatch):
    distributed = pytest.importorskip("distributed")
    with distributed.Client(processes=False, n_workers=1, threads_per_worker=2, dashboard_address=None) as client:
        here = contextlib.nullcontext(Cluster(client, None))
        monkeypatch.setattr(campaign, "scheduler", lambda address: here)
        found = simulate(small(folder), 2, address="tcp://somewhere:8786")
    same(found, type(alone)(alone.mission, alone.runs[:2], alone.forecast))


def test_files_that_change_while_runs_are_flown_are_refused(folder, alone, tmp_path):
    other = replace(alone, waters="of another file")
    with pytest.raises(InputError, match="a worker reads other currents or another terrain"):
        campaign.run_here(campaign.Work(alone.mission, other.waters, {}), 0)
    assert (alone.mission.text, other.waters) not in campaign._RUNNERS
    with pytest.raises(InputError, match="put the old files back and give the same command again"):
        write_campaign(other, [tmp_path / "runs.json"], (0, "replan"))
    write_campaign(alone, [tmp_path / "runs.json"], (0, "replan"))


def test_a_stopped_campaign_goes_on(folder, alone, tmp_path):
    keep = tmp_path / "runs.json"
    seen = []

    def stop(progress):
        seen.append(progress)
        if progress.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(Stopped, match=r"2 of 3 runs are kept in runs.json.journal: give the same command again"):
        simulate(small(folder), RUNS, keep=keep, progress=stop)
    journal = keep.with_name("runs.json.journal")
    with journal.open("r+b") as file:  # a kill in the middle of a write
        file.truncate(journal.stat().st_size - 7)
    seen.clear()
    again = simulate(small(folder), RUNS, keep=keep, progress=seen.append)
    assert [progress.done for progress in seen] == [2, 3]
    same(alone, again)
    with pytest.raises(InputError, match="keeps the progress of another campaign, whose mission, waters differ"):
        simulate(small(folder, {"random.seed": 8}), RUNS, keep=keep)


def test_the_command_writes_all_files(folder, alone, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    names = ["runs.json", "runs.h5", "runs.png", "run.html"]
    outputs = [part for name in names for part in ("-o", name)]
    said = command(capsys, "simulate", "small-mission.toml", "--runs", "3", "--processes", "1", *outputs)
    assert said.code == 0, said.err
    assert "policy" in said.out
    assert "replan" in said.out
    assert not list(folder.glob("*.journal"))
    table = json.loads((folder / "runs.json").read_text())
    assert table == json.loads(json.dumps(alone.as_dict()))
    assert [row["policy"] for row in table["policies"]] == list(alone.mission.pilot.policies)
    assert table["policies"][1]["arrived_share"][0] == 1.0
    with h5py.File(folder / "runs.h5") as file:
        first = file["tracks/indptr"][:]
        rows = np.column_stack([file[f"tracks/{name}"][:] for name in ("time", "x", "y", "z")])
        flat = [outcome for run in alone.runs for outcome in run]
        assert first.size == len(flat) + 1
        for n in (0, 7):
            assert np.array_equal(rows[first[n] : first[n + 1]], flat[n].track)
        assert file["tracks/x"].attrs["units"] == "m"
        ends = [file.attrs["ends"][k] for k in file["outcomes/ended"][:]]
        assert ends == [outcome.ended for outcome in flat]
    assert (folder / "runs.png").read_bytes().startswith(b"\x89PNG")
    page = (folder / "run.html").read_text("utf-8")
    assert "run 0, replan: arrived after" in page
    held = json.loads(page.split('id="data">')[1].split("</script>")[0])
    assert len(held["plans"]) == alone.runs[0][1].plans
    assert {leg["glide"] == 0.0 for leg in held["legs"]} == {True, False}  # glides, and drifts between them
    assert held["legs"][-1]["t"][-1] == pytest.approx(alone.runs[0][1].time, abs=0.1)


def test_the_same_campaign_makes_the_same_bytes(folder, monkeypatch):
    monkeypatch.chdir(folder)
    for name in ("a.h5", "b.h5"):
        planner.simulate("small-mission.toml", 1, [name])
    assert (folder / "a.h5").read_bytes() == (folder / "b.h5").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nowhere.toml", "--runs", "1"], "is neither a file nor a shipped mission"),
        (["small-mission.toml", "--runs", "0"], "`runs` must be from 1"),
        (["small-mission.toml", "--runs", "1", "-o", "runs.txt"], "must end in one of: .json"),
        (["small-mission.toml", "--runs", "1", "-o", "a.html", "--run", "3"], "must be from 0 to 0; got 3"),
        (["small-mission.toml", "--runs", "1", "-o", "a.html", "--policy", "magic"], "must be one of open-loop"),
        (["small-mission.toml", "--runs", "1", "--set", "wind.speed=1"], "names no section of a mission"),
        (["small-mission.toml", "--runs", "1", "--set", "vehicle.colour=1"], "`vehicle.colour` is not known"),
        (
            ["small-mission.toml", "--runs", "1", "--set", "query.goal=[0.0,0.0,-50.0]"],
            "begins and ends at the surface",
        ),
        (["small-mission.toml", "--runs", "1", "--processes", "0"], "`processes` must be from 1"),
        (["ionian", "--runs", "1"], "`flow.file` is missing"),
    ],
)
def test_what_is_wrong_is_refused(folder, capsys, monkeypatch, arguments, sentence):
    monkeypatch.chdir(folder)
    said = command(capsys, "simulate", *arguments)
    assert said.code == 2
    assert sentence in said.err
    assert said.err.count("\n") == 1


def test_shipped_missions_are_whole():
    assert {"box", "gyre", "strait", "tide", "ionian"} <= set(shipped_missions())
    for name in shipped_missions():
        overrides = ["flow.file=currents.nc"] if name == "ionian" else []
        read = read_mission(name, overrides)
        assert read.title == name
        assert read.pilot.policies[-1] == "omniscient"
        assert read.forecast_error.rms_share == 0.3
    Runner(read_mission("box"))  # its water can be read, and its start and goal are at the surface


def test_shares_have_wilson_intervals():
    """Values of Newcombe 1998, Statistics in Medicine 17, table I, method 3."""
    assert share(81, 263).as_list() == pytest.approx([0.3080, 0.2553, 0.3662], abs=5e-5)
    assert share(0, 20).as_list() == pytest.approx([0.0, 0.0, 0.1611], abs=5e-5)
    assert math.isnan(share(0, 0).value)


def test_medians_have_bootstrap_intervals():
    """For normal values the standard error of a median is 1.2533 sigma / sqrt(n)."""
    values = np.random.default_rng(1).normal(10.0, 2.0, 400)
    found = median(values)
    half = 1.96 * 1.2533 * 2.0 / 20.0
    assert found.low < found.value < found.high
    assert found.high - found.low == pytest.approx(2 * half, rel=0.35)
    assert math.isnan(median([]).value)
