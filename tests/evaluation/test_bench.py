"""Benchmarks: figures of all parts, records that can be compared, refusals."""

import json
import sys

import pytest
from helpers.ionian import write_ionian
from helpers.small import command, strict_json

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.evaluation import bench
from glider_stream.evaluation.record import Figure, Record, read_record

CEILING = "#!{}\nprint('{}')\n"


def record(**medians):
    """A record of figures that spread by a tenth."""
    figures = (
        Figure(name, "1/s", (0.9 * value, value, 1.1 * value), name != "seconds")
        for name, value in medians.items()
    )
    return Record(tuple(figures), {"date": "now"})


def ceiling_of(tmp_path, **rates):
    """A program that says how fast RK4 can be."""
    ceiling = tmp_path / "ceiling"
    ceiling.write_text(CEILING.format(sys.executable, json.dumps(rates)))
    ceiling.chmod(0o755)
    return ceiling


@pytest.mark.slow
def test_a_record_and_what_has_moved_since(tmp_path, capsys):
    file = tmp_path / "bench.json"
    ceiling = ceiling_of(tmp_path, evaluations_per_s=5e7)
    said = command(
        capsys, *("bench", "--quick", "--runs", 1, "--only", "integrator", "--ceiling", ceiling, "--json", file)
    )
    assert said.code == 0
    read = strict_json(file.read_text())
    figures = {one["name"]: one for one in read["figures"]}
    assert read["quick"] is True
    assert read["evaluations_per_s"] == figures["evaluations_per_s"]["median"] > 1e6
    assert figures["share of the ceiling"]["median"] == pytest.approx(read["evaluations_per_s"] / 5e7)
    for name in figures:
        assert said.out.count(f"  {name} ") == 1
        assert said.err.count(f"bench: {name} ") == 1
    again = command(capsys, "bench", "--quick", "--only", "integrator", "--runs", 1, "--against", file)
    assert again.code == 0
    assert "moved beyond both spreads:\n" in again.out


@pytest.mark.slow
@pytest.mark.wide
def test_all_parts_give_figures(tmp_path, capsys):
    file = tmp_path / "bench.json"
    said = command(capsys, "bench", "--quick", "--runs", 1, "--json", file)
    assert said.code == 0
    figures = {one["name"]: one for one in strict_json(file.read_text())["figures"]}
    assert set(bench.RATED) <= set(figures)
    for part in ("all threads over one: flow map, all", "400 nodes: most memory", "start: --help"):
        assert figures[part]["median"] > 0
    assert figures["400 nodes: edges"]["median"] > 10_000


@pytest.mark.slow
@pytest.mark.wide
def test_files_and_large_roadmaps_give_figures(tmp_path, capsys):
    write_ionian(tmp_path / "currents.nc")
    ceiling = ceiling_of(tmp_path, **{"one time": 2e7, "four times": 1e7})
    parts = [word for part in ("file", "large") for word in ("--only", part)]
    options = ["--currents", tmp_path / "currents.nc", "--ceiling", ceiling, "--json", tmp_path / "bench.json"]
    assert command(capsys, "bench", "--quick", "--runs", 1, *parts, *options).code == 0
    read = strict_json((tmp_path / "bench.json").read_text())
    figures = {one["name"]: one["median"] for one in read["figures"]}
    one_time = "a file's grid, one time: "
    assert figures[one_time + "share of the ceiling"] == figures[one_time + "evaluations, one core"] / 2e7
    assert figures["a file's legs, flow map"] > 0
    assert figures["1,024 nodes, wide: edges"] > 10_000
    for asked in ("build", "query", "verify", "plot", "info"):
        assert figures[f"1,024 nodes, wide: {asked}, whole process"] > 0.1
        assert figures[f"1,024 nodes, wide: {asked}, most memory"] > 50


def test_what_has_moved():
    before = json.loads(json.dumps(record(edges=100.0, pairs=100.0, seconds=1.0, gone=1.0).as_dict()))
    now = record(edges=115.0, pairs=150.0, seconds=2.0, new=1.0)
    assert now.moved(before) == [
        "pairs: 1.50 times 100 1/s, better",
        "seconds: 2.00 times 1 1/s, worse",
    ]
    assert record(edges=100.0).moved(before) == []


@pytest.mark.parametrize("text", ["no JSON", "[]", "{}", '{"figures": [{"name": 1}]}', '{"figures": 3}'])
def test_a_file_that_is_not_a_record_is_refused(tmp_path, text):
    (tmp_path / "old.json").write_text(text)
    with pytest.raises(InputError, match=r"old.json cannot be read: .*; write it with `bench --json`"):
        read_record(tmp_path / "old.json")


def test_refusals_come_before_the_work(tmp_path):
    refused = [
        ({"runs": 0}, "`runs` must be at least 1; got 0"),
        ({"only": ["speed"]}, "the part 'speed' is not known; choose from: integrator"),
        ({"only": ["file"]}, "the part 'file' needs a file of currents; give it with --currents"),
        ({"currents": tmp_path / "none.nc"}, "none.nc does not exist"),
        ({"output": tmp_path / "none/a.json"}, "none does not exist"),
        ({"against": tmp_path / "none.json"}, "none.json cannot be read: no such file"),
        ({"only": ["integrator"], "runs": 1, "ceiling": tmp_path / "none"}, "must be a program that prints JSON"),
    ]
    for options, words in refused:
        with pytest.raises(InputError, match=words):
            planner.bench(options.pop("output", None), **options)
