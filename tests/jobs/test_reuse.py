"""A new forecast for the same nodes: what is taken over, and that the result is that of a fresh build."""

from pathlib import Path

import pytest
from helpers.builds import datasets
from helpers.forecasts import SCENARIO, write
from helpers.small import command, scenario_file

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.jobs.reuse import untouched
from glider_stream.scenario import read_scenario

pytestmark = pytest.mark.slow

pytest.importorskip("xarray")

LAWS = {
    "flow map": [],
    "refined": ["steering.method=streamline", "steering.candidates=16", "steering.refine=true"],
    "reachable": ["neighbours.kind=reachable"],
    "radius": ["neighbours.kind=radius", "neighbours.radius=1500.0"],
}


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(SCENARIO)
    write("a.nc")
    return tmp_path


@pytest.mark.parametrize(
    ("law", "change"),
    [
        ("flow map", 0.5),
        pytest.param("reachable", 1.6, marks=pytest.mark.wide),
        pytest.param("radius", 0.5, marks=pytest.mark.wide),
        pytest.param("refined", 0.5, marks=pytest.mark.wide),
        pytest.param("flow map", 1.6, marks=pytest.mark.wide),
    ],
)
def test_a_tenth_of_the_current_changes(place, law, change):
    """A change that leaves the fastest current as it is, and one that does not."""
    planner.build("a.toml", "old.h5", overrides=LAWS[law])
    write("b.nc", change)
    sets = [*LAWS[law], "flow.file=b.nc"]
    planner.build("a.toml", "fresh.h5", overrides=sets)
    before, now = (read_scenario("a.toml", some).problem() for some in (LAWS[law], sets))
    kept = untouched(planner.info("old.h5"), before, now)
    assert (0.67 if change < 1 else 0.3) < kept.mean() < 0.95
    planner.build("a.toml", "new.h5", overrides=sets, base="old.h5")
    assert datasets("new.h5") == datasets("fresh.h5")
    assert planner.info("new.h5").target.size > 100
    assert datasets("new.h5")[0] != datasets("old.h5")[0]


def test_a_seabed_that_rises(place):
    planner.build("a.toml", "old.h5", overrides=["sampling.count=200"])
    write("b.nc", dry=250.0)
    sets = ["sampling.count=200", "flow.file=b.nc"]
    with pytest.raises(InputError, match="differs in nodes, not only in the flow"):
        planner.build("a.toml", "new.h5", overrides=sets, base="old.h5")


def test_nothing_has_changed(place):
    road = planner.build("a.toml", "old.h5")
    problem = read_scenario("a.toml").problem()
    assert untouched(road, problem, problem).all()


def test_what_cannot_be_taken_over(capsys, place):
    scenario_file(place)
    command(capsys, "build", "small.toml", "-o", "small.h5")
    command(capsys, "build", "a.toml", "-o", "old.h5")
    for sets, words in {
        "glider.preset=seaglider": "differs in glider",
        "integration.steps=121": "differs in integration",
        "neighbours.k=13": "differs in neighbours",
        "steering.generations=2": "differs in steering",
        "sampling.count=99": "differs in nodes",
    }.items():
        said = command(capsys, "build", "a.toml", "-o", "new.h5", "--from", "old.h5", "--set", sets)
        assert (said.code, words in said.err) == (2, True), said.err
    said = command(capsys, "build", "a.toml", "-o", "new.h5", "--from", "small.h5")
    assert (said.code, "build without --from" in said.err) == (2, True)
    # an analytic flow reaches everywhere
    sets = ("--set", "flow.sampled=[40.0,40.0,50.0]")
    assert command(capsys, "build", "small.toml", "-o", "new.h5", "--from", "small.h5", *sets).code == 0
    command(capsys, "build", "small.toml", "-o", "fresh.h5", *sets)
    assert datasets("new.h5") == datasets("fresh.h5")
