"""What a hostile or mistaken input may cost: refused at once, in one sentence."""

import json
import os
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from helpers.small import command, scenario_file

from glider_stream.base.errors import InputError
from glider_stream.base.untrusted import check_links
from glider_stream.roadmap.nodes import SAMPLERS, GridSampler
from glider_stream.roadmap.store import read_roadmap, write_roadmap
from glider_stream.scenario import read_scenario, scenario_from_text
from glider_stream.vehicle.calibration.dives import read_dives
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import parse_time
from glider_stream.water.terrain import read_polygons

SECONDS = 5.0


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    return tmp_path


@pytest.fixture
def road(place):
    from helpers.small import roadmap

    write_roadmap(roadmap(), "road.h5")
    return place


@pytest.mark.parametrize(
    "line",
    [
        "build pipe.toml -o x.h5",
        "build small.toml -o x.h5 --from pipe.h5",
        "build small.toml -o x.h5 --set flow.kind=netcdf --set flow.file=pipe.nc",
        "info pipe.h5",
        "info road.h5 --diff pipe.h5",
        "query pipe.h5",
        "verify pipe.h5",
        "merge pipe.h5 -o x.h5",
        "plot road.h5 pipe.json -o x.png",
        "describe pipe.nc",
        "describe store.zarr",
        "score road.h5 pipe.csv",
        "lint pipe.ma",
        "calibrate pipe.csv",
        "assimilate pipe.nc --dives pipe.csv -o x.nc",
        "bench --quick --against pipe.json",
    ],
)
@pytest.mark.skipif(os.name == "nt", reason="no named pipes")
def test_a_pipe_is_refused_as_input(road, capsys, line):
    for name in line.split():
        if name.startswith("pipe"):
            os.mkfifo(name)
    Path("store.zarr").mkdir()
    os.mkfifo("store.zarr/zarr.json")
    began = time.monotonic()
    said = command(capsys, *line.split())
    assert said.code in (1, 2), said
    assert "Traceback" not in said.err
    assert time.monotonic() - began < 30.0
    assert not Path("x.h5").exists()


@pytest.mark.parametrize(
    "epoch", ["0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-12:00", "0999-12-31", "9000-01-01"]
)
def test_the_ends_of_the_calendar(epoch):
    with pytest.raises(InputError, match=r"`flow.epoch` must lie in the years 1000 to 8999; got"):
        parse_time(epoch, "`flow.epoch`")


@pytest.mark.slow
def test_a_header_of_many_dots(place, capsys):
    text = Path("small.toml").read_text()
    dots = ".a" * 20_000
    brackets = "\n[glider.a]\nb = " + "[" * 100 + "]" * 100
    for number, more in enumerate((f"\n[flow{dots}]\nx = 1\n", f"\n[a{dots}]\n", brackets)):
        Path("deep.toml").write_text(text + more)
        said = command(capsys, "build", "deep.toml", "-o", "x.h5")
        assert (said.code, said.err.count("\n"), len(said.err) < 500) == (2, 1, True), number
    said = command(capsys, "build", "small.toml", "-o", "x.h5", "--set", f"flow{dots}=1")
    assert (said.code, "more than 20 deep" in said.err) == (2, True)
    with pytest.raises(InputError):
        scenario_from_text(text + f"\n[flow{dots}]\nx = 1\n")


def star(count):
    """A polygon that crosses itself everywhere."""
    angle = np.arange(count) * 2.4
    ring = np.column_stack([10 + np.cos(angle), 40 + np.sin(angle)]).tolist()
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}


@pytest.mark.slow
def test_polygons_are_bounded(place):
    pytest.importorskip("shapely")
    frame = LocalFrame(10.0, 40.0)
    began = time.process_time()
    Path("few.json").write_text(json.dumps(star(20)))
    assert read_polygons("few.json", frame)
    Path("many.json").write_text(json.dumps(star(3000)))
    with pytest.raises(InputError, match="crosses itself, with 3,001 vertices, too many"):
        read_polygons("many.json", frame)
    angle = np.linspace(0, 2 * np.pi, 250_000)
    ring = np.column_stack([10 + np.cos(angle), 40 + np.sin(angle)]).round(7).tolist()
    Path("fine.json").write_text(json.dumps({"type": "Polygon", "coordinates": [[*ring, ring[0]]]}))
    with pytest.raises(InputError, match="a polygon of 250,001 vertices; simplify it"):
        read_polygons("fine.json", frame)
    comb = [[10 + 8 * (n // 2 % 2), 30 + n * 0.001] for n in range(6000)]
    whole = [*comb, [9, 36], [9, 30], comb[0]]
    Path("comb.json").write_text(json.dumps({"type": "Polygon", "coordinates": [whole]}))
    with pytest.raises(InputError, match=r"simplify it|crosses itself"):
        read_polygons("comb.json", frame)
    assert time.process_time() - began < SECONDS


@pytest.mark.parametrize("kind", ["uniform", "sobol", "halton"])
def test_nodes_are_bounded(place, kind):
    with pytest.raises(InputError, match=r"`sampling.count` must be from 1 to 10,000,000; got 10,000,001"):
        SAMPLERS[kind](10_000_001, 1)
    with pytest.raises(InputError, match=r"is 1,000,000,000,000 nodes; take at most 10,000,000"):
        GridSampler((10_000, 10_000, 10_000))
    with pytest.raises(InputError, match="take at most"):
        read_scenario("small.toml", ["sampling.shape=[9000000000,9000000000,9]"])


def test_lists_and_claims_in_a_roadmap(road):
    with h5py.File("road.h5", "r+") as file:
        size = len(file["edges/time"])
        del file["edges/time"]
        lists = file.create_dataset("edges/time", (size,), h5py.vlen_dtype(np.float64))
        lists[0] = np.zeros(1000)
    with pytest.raises(InputError, match=r"`edges/time` in .* holds lists of uneven lengths"):
        read_roadmap("road.h5")
    with h5py.File("road.h5", "r+") as file:
        del file["edges/time"]
        file.create_dataset("edges/time", (10**12,), np.float64, chunks=(10**6,))
    with pytest.raises(InputError, match=r"`edges/time` claims 8e\+12 bytes, which 0 cannot hold"):
        read_roadmap("road.h5")


def test_a_claim_is_held_against_its_own_storage(tmp_path):
    """A large neighbour lends no credit to chunks that were never written."""
    with h5py.File(tmp_path / "x.nc", "w") as file:
        file["much"] = np.random.default_rng(0).random(200_000)
        file.create_dataset("none", (10**8,), np.float32, chunks=(10**6,))
    with pytest.raises(InputError, match=r"`none` claims 4e\+08 bytes, which 0 cannot hold"):
        check_links(tmp_path / "x.nc")


def test_many_columns_are_linear_work(tmp_path, capsys):
    names = [f"c{n}" for n in range(60_000)]
    text = ",".join(["vertical_speed", "pitch", *names]) + "\n" + ",".join(["0.1", "20", *["1"] * 60_000]) + "\n"
    (tmp_path / "wide.csv").write_text(text)
    began = time.process_time()
    assert len(read_dives(tmp_path / "wide.csv").unused) == 60_000
    (tmp_path / "twice.csv").write_text(text.replace("c59999", "c1"))
    with pytest.raises(InputError, match="more than one column `c1`"):
        read_dives(tmp_path / "twice.csv")
    assert time.process_time() - began < SECONDS
