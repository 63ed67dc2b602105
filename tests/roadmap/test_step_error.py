"""The step's error: said, refused where it is too large, the same for every part of a build."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import reference
from helpers.small import scenario_file

from glider_stream import planner
from glider_stream.base.errors import InputError
from glider_stream.jobs.build import Job, build_file, merge
from glider_stream.kernels.control import control_of
from glider_stream.kernels.edges import CONNECTED, Edge
from glider_stream.roadmap.builder import build_roadmap
from glider_stream.roadmap.roadmap import EDGE_FIELDS, in_order
from glider_stream.roadmap.shard import Shard
from glider_stream.roadmap.step_error import (
    SAMPLED_LEGS,
    SAMPLED_NODES,
    UNTRIED,
    StepError,
    StepSample,
    sampled_nodes,
    step_error,
    wider_samples,
)
from glider_stream.roadmap.store import read_roadmap
from glider_stream.scenario import read_scenario
from glider_stream.search.query import Planner

FLOW_MAP = ("steering.method=flow-map",)
COARSE = (*FLOW_MAP, "integration.dt=120.0", "integration.steps=6", "integration.tolerance=0.5")


def problem(folder, *overrides):
    return read_scenario(scenario_file(folder), [*overrides]).problem()


def test_a_build_says_how_far_off_its_steps_are(tmp_path):
    said = build_roadmap(problem(tmp_path)).provenance.steps
    assert said.startswith("of 5 s, off by 0.0")
    road = planner.build(scenario_file(tmp_path), tmp_path / "road.h5")
    assert f"steps:  {said}" in str(road)
    assert planner.info(tmp_path / "road.h5").as_dict()["steps"] == said


def test_too_coarse_a_step_is_refused_with_its_error_and_the_cure(tmp_path):
    said = r"`integration.dt` = 120 s is too coarse for this flow: of \d+ legs, the worst ends [\d.]+ m off"
    coarse = problem(tmp_path, *COARSE)
    cure = ", more than the tolerance of 0.5 m; make `integration.dt` smaller"
    with pytest.raises(InputError, match=said + cure):
        build_roadmap(coarse)
    messages = set()
    for shard in (Shard(1, 1), Shard(1, 3), Shard(3, 3)):
        with pytest.raises(InputError, match="too coarse") as refused:
            build_file(coarse, tmp_path / "coarse.h5", job=Job(shard=shard, restart=True))
        messages.add(str(refused.value))
    assert len(messages) == 1
    assert not (tmp_path / "coarse.h5").exists()


def test_parts_and_the_whole_say_the_same(tmp_path):
    good = problem(tmp_path, *FLOW_MAP)
    whole = build_roadmap(good).provenance.steps
    parts = [tmp_path / f"{n}.h5" for n in (1, 2)]
    for n, part in enumerate(parts, 1):
        build_file(good, part, job=Job(shard=Shard(n, 2)), batch_pairs=50)
    merge(parts, tmp_path / "merged.h5")
    assert read_roadmap(tmp_path / "merged.h5").provenance.steps == whole


def test_a_query_refuses_a_roadmap_that_was_built_without_a_look_at_its_steps(tmp_path, monkeypatch):
    coarse = problem(tmp_path, *COARSE)
    with monkeypatch.context() as patch:
        patch.setattr(StepError, "check", lambda self: None)
        unchecked = build_roadmap(coarse)
    older = replace(unchecked, provenance=replace(unchecked.provenance, steps=""))
    with pytest.raises(InputError, match="too coarse for this flow"):
        Planner(older, coarse)
    good = build_roadmap(problem(tmp_path, *FLOW_MAP))
    unsaid = replace(good, provenance=replace(good.provenance, steps=""))
    assert Planner(unsaid, problem(tmp_path, *FLOW_MAP)).query().found


def test_the_error_is_how_far_an_exact_path_ends_from_the_legs_own(tmp_path, monkeypatch):
    coarse = problem(tmp_path, *COARSE)
    monkeypatch.setattr(StepError, "check", lambda self: None)
    road = build_roadmap(coarse)
    few = np.linspace(0, road.target.size - 1, 6).astype(int)
    start = road.position[np.searchsorted(road.indptr, few, side="right") - 1]
    values = np.column_stack([getattr(road, name) for name in EDGE_FIELDS])[few]
    worst = 0.0
    for point, row in zip(start, values, strict=True):
        edge = Edge(CONNECTED, *row)
        control = control_of(edge.speed, edge.glide_angle, edge.heading)
        exact = reference.replay(coarse.evaluator.flow, point, control[:3], edge.time)(edge.time)
        worst = max(worst, math.dist(coarse.evaluator.trace(point, edge, 0.0)[-1, 1:], exact))
    assert step_error(coarse, start, values).off == pytest.approx(worst, rel=0.3)
    assert worst > 0.2


def test_the_sample_is_of_few_nodes_the_last_ones_among_them():
    assert list(sampled_nodes(3)) == [0, 1, 2]
    assert len(sampled_nodes(100_000)) == SAMPLED_NODES
    assert sampled_nodes(100_000)[-1] == 99_999
    assert (np.diff(sampled_nodes(500)) > 0).all()


def test_where_few_legs_leave_the_first_nodes_more_are_asked(tmp_path):
    sparse = problem(tmp_path, "steering.method=surface", "steering.candidates=6", "integration.tolerance=4.0")
    road = build_roadmap(sparse)
    first = sampled_nodes(len(road.position))
    few = int(np.diff(road.indptr)[first].sum())
    tried = int(road.provenance.steps.split("at most of ")[1].split()[0])
    assert few < tried == min(road.target.size, SAMPLED_LEGS)


def test_a_query_flies_what_legs_there_are_where_the_build_had_none_to_fly(tmp_path, monkeypatch):
    coarse = problem(tmp_path, *COARSE)
    with monkeypatch.context() as patch:
        patch.setattr(StepError, "check", lambda self: None)
        patch.setattr(StepSample, "_legs", lambda self, find: in_order([]))
        untried = build_roadmap(coarse)
    assert untried.provenance.steps == f"of 120 s, {UNTRIED}"
    with pytest.raises(InputError, match="too coarse for this flow"):
        Planner(untried, coarse)


def test_samples_grow_to_all_nodes_or_the_most():
    assert [list(nodes) for nodes in wider_samples(3)] == [[0, 1, 2]]
    assert [nodes.size for nodes in wider_samples(20)] == [16, 20]
    assert [nodes.size for nodes in wider_samples(10**6)] == [16, 32, 64, 128]
