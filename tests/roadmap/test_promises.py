"""What roadmaps keep: the same bits however they are cut, one range of headings, their misses, time."""

import math

import numpy as np
import pytest

from glider_stream.kernels.edges import MISS, STATUS, TIME, Status
from glider_stream.roadmap.builder import build_roadmap, find_edges, node_positions
from glider_stream.roadmap.evaluator import Evaluator
from glider_stream.roadmap.roadmap import EDGE_FIELDS, in_order
from glider_stream.roadmap.steering import FlowMapMethod, StreamlineMethod, SurfaceMethod
from glider_stream.roadmap.verify import check_edges
from glider_stream.scenario import scenario_from_text

FLOW_MAP, REFINED = 'method = "flow-map"', 'method = "streamline"\ncandidates = 16\nrefine = true'
LINE, SURFACE = 'method = "streamline"\ncandidates = 16', 'method = "surface"\ncandidates = 64'
FAINT = """\
[flow]
kind = "vortices"
sampled = [400.0, 400.0, 100.0]
[[flow.vortex]]
x = 0.0
y = 0.0
radius = 150.0
speed = 1.608039604149993e-08
[glider]
preset = "paper"
[domain]
x = [-100.0, 100.0]
y = [-100.0, 100.0]
z = [-50.0, 0.0]
[sampling]
kind = "grid"
shape = [7, 8, 4]
[neighbours]
kind = "nearest"
k = 27
[steering]
{method}
[integration]
dt = 5.0
steps = 125
tolerance = 5.0
[cost]
kind = "time"
"""
WESTWARD = """\
kind = "uniform"
u = -0.001
v = 0.0
"""


def problem(method=FLOW_MAP, *changes):
    """A faint current over a regular grid: many controls reach a node at the same time, to the last bits."""
    text = FAINT.format(method=method)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return scenario_from_text(text).problem()


def assert_same(road, other):
    for name in ("indptr", "target", *EDGE_FIELDS):
        assert getattr(other, name).tobytes() == getattr(road, name).tobytes(), name


@pytest.mark.slow
@pytest.mark.parametrize("method", [FLOW_MAP, REFINED], ids=["flow map", "refined"])
def test_ties_are_broken_alike_in_every_batch_thread_and_shard(method):
    tied = problem(method)
    whole = build_roadmap(tied, 2)
    assert whole.target.size > 1500
    for threads, batch in ((1, 1), (2, 1), (1, 700)):
        assert_same(whole, build_roadmap(tied, threads, batch_pairs=batch))
    position = node_positions(tied)
    shards = [find_edges(tied, position, np.arange(n, min(n + 37, len(position)))) for n in range(0, 224, 37)]
    merged = in_order([edges for shard in shards for edges in shard])
    np.testing.assert_array_equal(merged.target, whole.target)
    for n, name in enumerate(EDGE_FIELDS):
        np.testing.assert_array_equal(merged.values[:, n], getattr(whole, name))


@pytest.mark.parametrize("method", [FLOW_MAP, REFINED, LINE, SURFACE])
def test_headings_have_one_range(method):
    vortex = FAINT[FAINT.index('kind = "vortices"') : FAINT.index("[glider]")]
    road = build_roadmap(problem(method, (vortex, WESTWARD + "sampled = [400.0, 400.0, 100.0]\n")))
    assert road.target.size > 100
    assert road.heading.min() >= -math.pi
    assert road.heading.max() < math.pi
    if method is LINE:  # due west on the axis, where atan2 may give either
        assert (road.heading == -math.pi).sum() > 50


@pytest.mark.parametrize("tolerance", [5.0, 0.009, 1e-3, 1e-6])
def test_the_flow_map_misses_by_less_than_the_tolerance(evaluator, sampled, tolerance):
    judge = evaluator(sampled, lambda candidates: FlowMapMethod(), tolerance=tolerance)
    rng = np.random.default_rng(3)
    position = np.column_stack([rng.uniform(-100, 100, (60, 2)), rng.choice([0.0, -60.0, -120.0], 60)])
    _, _, rows = judge.reach(position, 0.0, np.arange(0, 60, 6), 0)
    joined = rows[rows[:, STATUS] == Status.CONNECTED]
    assert len(joined) > 150
    assert joined[:, MISS].max() < min(tolerance, 0.0091)


@pytest.mark.parametrize("method", [SurfaceMethod, StreamlineMethod])
def test_a_leg_takes_time(evaluator, sampled, method):
    # nodes so near that all lie within the tolerance of each other
    rng = np.random.default_rng(4)
    position = np.column_stack([rng.uniform(-6, 6, (30, 2)), rng.choice([0.0, -4.0, -9.0], 30)])
    judge: Evaluator = evaluator(sampled, method, candidates=24, tolerance=25.0)
    target = np.concatenate([np.delete(np.arange(30), n) for n in range(30)])
    rows = judge.connect(position, 0.0, np.arange(30), np.arange(0, 871, 29), target)
    joined = rows[:, STATUS] == Status.CONNECTED
    assert joined.sum() > 100
    assert rows[joined, TIME].min() > 0
    assert (rows[~joined, STATUS] != Status.CONNECTED).all()


def test_a_roadmap_of_near_nodes_is_verified():
    changes = (
        ("[-100.0, 100.0]", "[-8.0, 8.0]"),
        ("z = [-50.0", "z = [-9.0"),
        ("tolerance = 5.0", "tolerance = 25.0"),
    )
    near = problem(SURFACE, *changes)
    road = build_roadmap(near)
    assert road.target.size > 500
    assert check_edges("near", road, near, 20).faults == ()
