"""Verification: sound roadmaps pass, each kind of damage is found."""

import math
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from helpers.small import command, scenario_file, strict_json

from glider_stream import planner
from glider_stream.roadmap.verify import SAME, check_edges
from glider_stream.scenario import scenario_from_text


@pytest.fixture(scope="module", params=["streamline", "flow-map"])
def sound(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    overrides = [f"steering.method={request.param}"]
    planner.build(scenario_file(folder), folder / "road.h5", overrides=overrides)
    return folder / "road.h5"


@pytest.fixture
def file(sound, tmp_path):
    return Path(shutil.copy(sound, tmp_path / "road.h5"))


def test_a_sound_roadmap_holds(sound, capsys):
    said = command(capsys, "verify", sound, "--sample", 40, "--json")
    assert said.code == 0
    read = strict_json(said.out)
    assert read["holds"] is True
    assert read["faults"] == []
    assert read["sample"] == 40
    assert 0 < read["difference_m"]["50%"] < read["difference_m"]["100%"] < SAME
    assert len(read["worst"]) == 5


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("time", lambda value: 1.01 * value),
        ("time", lambda value: 1e300),
        ("heading", lambda value: value + math.radians(1)),
        ("glide_angle", lambda value: 0.99 * value),
        ("speed", lambda value: 1.01 * value),
        ("cost", lambda value: value + 1),
        ("miss", lambda value: value + 20),
    ],
)
def test_one_changed_edge_is_found(file, capsys, name, change):
    with h5py.File(file, "r+") as tampered:
        column = tampered[f"edges/{name}"]
        edge = int(np.argmax(tampered["edges/time"][()]))
        column[edge] = change(column[edge])
    said = command(capsys, "verify", file, "--sample", 1)
    assert said.code == 1
    assert "fault: 1 edges" in said.out


def test_a_flipped_bit_is_found_in_any_dataset(file, capsys):
    with h5py.File(file) as whole:
        places = {}
        for group in ("nodes", "edges"):
            for name, dataset in whole[group].items():
                chunk = dataset.id.get_chunk_info(0)
                places[f"{group}/{name}"] = chunk.byte_offset + chunk.size // 2
    content = file.read_bytes()
    for place in places.values():
        damaged = bytearray(content)
        damaged[place] ^= 4
        file.write_bytes(damaged)
        said = command(capsys, "verify", file)
        assert said.code == 1
        assert "fault: " in said.out


def test_a_target_out_of_range_and_a_truncated_row_are_found(file, capsys):
    with h5py.File(file, "r+") as tampered:
        tampered["edges/target"][-1] = 10**6
    assert command(capsys, "verify", file).code == 1
    with h5py.File(file, "r+") as tampered:
        tampered["edges/target"][-1] = 0
        tampered["edges/indptr"][-1] -= 1
    assert command(capsys, "verify", file).code == 1


def test_another_flow_is_found(file, capsys):
    with h5py.File(file, "r+") as tampered:
        text = tampered.attrs["scenario"]
        head, _, rest = text.partition("radius = ")
        tampered.attrs["scenario"] = f"{head}radius = 1{rest}"
    said = command(capsys, "verify", file)
    assert said.code == 1
    assert "the flow has changed" in said.out


def test_the_other_integrator_sees_what_the_same_one_does_not(sound):
    road = planner.info(sound)
    problem = scenario_from_text(road.provenance.scenario).problem()
    assert check_edges("road", road, problem, 0).sample == road.target.size
    again = check_edges("road", road, problem, 30)
    assert again.holds
    assert (again.differences > 0).all()


def test_files_that_are_not_roadmaps(tmp_path, capsys):
    assert command(capsys, "verify", tmp_path / "none.h5").code == 2
    (tmp_path / "text.h5").write_text("no HDF5")
    assert command(capsys, "verify", tmp_path / "text.h5").code == 1
    assert command(capsys, "verify", tmp_path / "text.h5", "--sample", -1).code == 2
