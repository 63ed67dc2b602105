"""The paper's experiment: its scripts in quick mode, rows that are kept, intervals, random fields."""

import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import bootstrap

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SCRIPTS = ("edges_by_controls", "route_by_controls", "route_by_time")


@pytest.fixture(autouse=True)
def beside_the_scripts(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))


def run(monkeypatch, script, *arguments):
    monkeypatch.setattr(sys, "argv", [script, *map(str, arguments)])
    runpy.run_path(str(BENCHMARKS / f"{script}.py"), run_name="__main__")


@pytest.mark.wide
def test_the_scripts_draw_and_go_on_where_they_were(tmp_path, monkeypatch, capsys):
    record = tmp_path / "rows.jsonl"
    for script in SCRIPTS:
        run(monkeypatch, script, "--quick", "--record", record, "-o", tmp_path / f"{script}.svg")
        assert (tmp_path / f"{script}.svg").stat().st_size > 5000
    rows = [json.loads(line) for line in record.read_text().splitlines()]
    # two fields; three methods of two numbers of controls each, and the flow map
    assert len({(row["seed"], row["method"], row["controls"]) for row in rows}) == len(rows) == 2 * 7
    first = record.read_text()
    record.write_text("".join(line + "\n" for line in first.splitlines()[:10]))
    run(monkeypatch, SCRIPTS[0], "--quick", "--record", record, "-o", tmp_path / "again.svg")
    again = [json.loads(line) for line in record.read_text().splitlines()]
    timeless = [{key: value for key, value in row.items() if key != "wall_s"} for row in rows]
    assert [{key: value for key, value in row.items() if key != "wall_s"} for row in again] == timeless
    edges = {(row["seed"], row["method"], row["controls"]): row["edges"] for row in rows}
    for seed in range(2):
        assert edges[seed, "flow map", None] >= edges[seed, "streamline", 16] > edges[seed, "surface", 16]


@pytest.mark.wide
def test_the_two_cases_are_drawn(tmp_path, monkeypatch, capsys):
    run(monkeypatch, "two_cases", "--quick", "-o", tmp_path)
    for candidates in (16, 54):
        assert (tmp_path / f"seed-box-{candidates}.png").stat().st_size > 20_000


def test_the_interval_is_that_of_the_mean():
    import experiment

    values = np.random.default_rng(3).normal(100.0, 5.0, 400)
    middle, low, high = experiment.mean_and_interval(list(values))
    told = bootstrap((values,), np.mean, confidence_level=0.997, rng=np.random.default_rng(0)).confidence_interval
    assert middle == pytest.approx(values.mean())
    assert (low, high) == (pytest.approx(told.low, abs=0.1), pytest.approx(told.high, abs=0.1))


def test_random_fields_are_as_fast_as_the_seed_box_and_differ():
    import experiment

    speeds = [experiment.problem_of(seed, [3, 3, 2]).evaluator.flow.extent.max_speed for seed in range(3)]
    assert experiment.random_vortices(0) != experiment.random_vortices(1)
    assert speeds == pytest.approx([experiment.FASTEST] * 3, rel=1e-6)
