"""The first random scenarios of the fuzz keep every promise, and what breaks one is seen."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from glider_stream.scenario import scenario_from_table

pytestmark = pytest.mark.slow

pytest.importorskip("networkx")
FILE = Path(__file__).parents[2] / "benchmarks/fuzz_scenarios.py"
SPEC = importlib.util.spec_from_file_location("fuzz_scenarios", FILE)
fuzz = importlib.util.module_from_spec(SPEC)
with patch.object(sys, "path", [str(FILE.parent), *sys.path]):  # for the scripts beside it
    SPEC.loader.exec_module(fuzz)
PARTS = 5


@pytest.mark.wide
@pytest.mark.parametrize("part", range(PARTS))
def test_the_first_scenarios(part):
    lines = [fuzz.tried(number) for number in range(part, fuzz.COMMON, PARTS)]
    assert [line for line in lines if line["fault"]] == []
    assert sum(not isinstance(line["edges"], str) for line in lines) >= 4


def test_scenarios_are_made_from_their_number_alone():
    assert fuzz.made(7) == fuzz.made(7) != fuzz.made(8)
    tables = [fuzz.made(number) for number in range(fuzz.COMMON)]
    assert {table["sampling"]["kind"] for table in tables} == {"grid", "uniform", "sobol", "halton", "yo"}
    assert {table["neighbours"]["kind"] for table in tables} == {"nearest", "radius", "all", "reachable"}
    assert {table["steering"]["method"] for table in tables} == {"surface", "streamline", "flow-map"}
    assert {table["cost"]["kind"] for table in tables} == {"time", "energy"}
    changing = [
        table for number in range(fuzz.COMMON, 130) if fuzz._changes((table := fuzz.made(number))["flow"])
    ]
    assert {table["flow"]["kind"] for table in changing} == {"tidal-jet", "double-gyre", "vortices"}
    assert (
        {"times" in table["flow"] for table in changing} == {"departures" in t for t in changing} == {True, False}
    )


def test_a_broken_promise_is_seen(tmp_path):
    """Bits that depend on batches, legs that miss, queries that cost too much."""
    number = next(n for n in range(fuzz.COMMON) if not fuzz.tried(n)["fault"] and fuzz.tried(n)["edges"] > 30)
    problem = scenario_from_table(fuzz.made(number), tmp_path).problem()
    fuzz.build_file(problem, tmp_path / "x.h5")
    road = fuzz.read_any_roadmap(tmp_path / "x.h5")
    assert fuzz.flown_wrong(problem, road) == fuzz.asked_wrong(problem, road, number) == ""
    turned = replace(road, heading=road.heading + 0.3)
    assert "misses by" in fuzz.flown_wrong(problem, turned)
    with patch.object(fuzz, "graph_of", lambda p, r, real=fuzz.graph_of: real(p, replace(r, cost=r.cost / 2))):
        assert "networkx finds" in fuzz.asked_wrong(problem, road, number)
    merged = iter(range(10))
    with patch.object(fuzz, "datasets", lambda path: next(merged)):
        assert fuzz.broken(number, tmp_path)[0] == "threads and batches change bits"
    with patch.object(fuzz, "values_of", lambda road: [np.array([np.nan])]):
        assert fuzz.broken(number, tmp_path)[0] == "a value is not finite"
