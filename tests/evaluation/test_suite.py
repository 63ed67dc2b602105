"""The suite: closed forms solved here, reports, the log that OMPL's own reader takes, refusals."""

import json
import math
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from helpers.small import command, strict_json
from scipy.optimize import brentq

from glider_stream import planner
from glider_stream.evaluation import baselines, suite
from glider_stream.scenario import read_scenario

pytestmark = pytest.mark.slow

CLOSED = ("uniform-current", "jet-crossing", "solid-rotation")


def level_and_sink(problem):
    """The glide polar as a table: horizontal and vertical speed [m/s]."""
    polar = problem.evaluator.polar
    angle = np.linspace(polar.shallowest[0], polar.steepest[0], polar.speed.shape[1])
    return polar.speed[0] * np.cos(angle), polar.speed[0] * np.sin(angle)


def one_glide(problem, across):
    """Time [s] of the glide down to the goal that goes across(T) [m] through the water."""
    level, sink = level_and_sink(problem)
    rise = abs(problem.goal[2] - problem.start[2])
    rising = np.argsort(sink)

    def short_of(time):
        return across(time) - np.interp(rise / time, sink[rising], level[rising]) * time

    return brentq(short_of, rise / sink.max() * 1.0001, rise / sink.max() * 4)


def closed_form(name):
    scenario = read_scenario(name)
    problem, flow = scenario.problem(), scenario.flow
    away = (problem.goal - problem.start)[:2]
    if name == "uniform-current":
        return one_glide(problem, lambda time: math.hypot(*(away - time * np.array([flow.u, flow.v]))))
    if name == "jet-crossing":
        # the bow across the jet: what it drifts is where the goal lies
        time = away[1] / level_and_sink(problem)[0].max()
        assert away[0] == pytest.approx(flow.speed * flow.width / level_and_sink(problem)[0].max(), abs=1e-3)
        return time
    # in the frame that turns with the water the goal comes from where it was a turn ago

    def in_turning_frame(time):
        turn = -flow.speed / flow.radius * time
        turned = (
            np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) @ problem.goal[:2]
        )
        return math.hypot(*(turned - problem.start[:2]))

    return one_glide(problem, in_turning_frame)


@pytest.mark.parametrize("name", CLOSED)
def test_references_in_closed_form_are_what_they_say(name):
    known = suite.references()[name]
    assert known.kind == "closed form"
    assert known.seconds == pytest.approx(closed_form(name), abs=0.02)


@pytest.fixture(scope="module")
def report():
    return suite.run_suite(["uniform-current", "trap", "jet-crossing"], quick=True)


def outcome(report, problem, method):
    return next(one for one in report.outcomes if (one.problem, one.method) == (problem, method))


def test_closed_forms_are_met(report):
    for name in ("uniform-current", "jet-crossing"):
        ratio = report.over_reference(outcome(report, name, "flow-map"))
        assert 0.9999 <= ratio <= 1.005


def test_the_turning_water_is_crossed_in_the_least_time():
    found = planner.query(planner.build("solid-rotation")).travel_time
    assert 1.0 <= found / suite.references()["solid-rotation"].seconds <= 1.005


def test_nobody_leaves_the_trap(report):
    assert report.references["trap"].seconds is None
    for method in (*suite.COMPARED, *baselines.BASELINES):
        assert not outcome(report, "trap", method).solved


def test_a_report_says_what_it_found(report):
    read = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert len(read["outcomes"]) == 3 * (len(suite.COMPARED) + len(baselines.BASELINES))
    assert read["outcomes"][0]["over_reference"] == pytest.approx(1.0, abs=0.005)
    for name in ("uniform-current", "trap", "jet-crossing"):
        assert report.completeness[name][1] > 0
        assert report.completeness[name][0] > 0.95
        assert str(report).count(f"\n{name} ") >= 6
    quality = {(row["problem"], row["method"]): row for row in read["quality"]}
    assert quality["uniform-current", "flow-map"]["success"] == 1.0
    assert quality["uniform-current", "flow-map"]["p50"] >= 1.0


def test_every_problem_is_shipped_and_has_a_reference():
    for name, known in suite.references().items():
        assert known.kind in ("closed form", "level set")
        assert known.how
        problem = read_scenario(name)
        assert problem.query is not None


def test_the_log_has_what_the_report_has(report):
    lines = suite.ompl_log(report, "uniform-current").splitlines()
    assert lines[0].startswith("glider-stream version ")
    assert lines[1] == "Experiment uniform-current"
    assert lines.count(".") == len(suite.COMPARED) + len(baselines.BASELINES) + 1
    rows = [line for line in lines if line.endswith("; ")]
    assert len(rows) == len([one for one in report.attempts if one.problem == "uniform-current"])


def test_ompl_reads_the_log(report, tmp_path):
    tools = pytest.importorskip("ompl.tools", reason="OMPL is not installed")
    log, database = tmp_path / "trap.log", tmp_path / "all.db"
    log.write_text(suite.ompl_log(report, "trap"))
    tools.readBenchmarkLog(str(database), [str(log)], False)
    with closing(sqlite3.connect(database)) as rows:
        assert rows.execute("SELECT name, version FROM experiments").fetchall() == [
            ("trap", f"glider-stream {report.made['software_version']}")
        ]
        solved = dict(rows.execute(
            "SELECT p.name, SUM(r.solved) FROM runs r JOIN plannerConfigs p ON p.id = r.plannerid GROUP BY p.name"
        ).fetchall())  # fmt: skip
    mine = [one for one in report.attempts if one.problem == "trap"]
    for method in {one.method for one in mine}:
        found = sum(one.method == method and math.isfinite(one.travel_time) for one in mine)
        assert solved[method.replace(" ", "_")] == found


def test_the_command_line(tmp_path, capsys):
    file = tmp_path / "suite.json"
    said = command(
        capsys, "bench", "--suite", "--quick", "--only", "uniform-current", "--json", file, "--ompl", tmp_path
    )
    assert said.code == 0
    assert strict_json(file.read_text())["quick"] is True
    assert (tmp_path / "uniform-current.log").exists()
    assert "uniform-current" in said.out
    assert "suite: uniform-current" in said.err


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--suite", "--only", "none"), "'none'"),
        (("--suite", "--runs", 3), "--runs"),
        (("--ompl", "."), "--ompl"),
        (("--suite", "--ompl", "no-such-folder"), "no-such-folder"),
    ],
)
def test_refusals(capsys, arguments, named):
    said = command(capsys, "bench", *arguments)
    assert said.code == 2
    assert named in said.err
    assert said.err.count("\n") == 1
