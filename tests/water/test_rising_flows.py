"""Flows with a vertical part: formulas, no divergence, bounds, grids, settings, and what refuses them."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from glider_stream.base.errors import InputError
from glider_stream.evaluation.baselines import straight
from glider_stream.evaluation.level_set import bound
from glider_stream.kernels.flow import (
    Grid,
    Rising,
    RisingGrid,
    RisingOceanGrid,
    current,
    cycle,
    max_rise,
    rises,
    velocity,
)
from glider_stream.scenario import read_scenario
from glider_stream.search.path import Leg, Path, load_path
from glider_stream.water.analytic import Abc, InternalWave, Rolls, Uniform, Upwelling
from glider_stream.water.inspect import is_steady, require_level
from glider_stream.water.sampled import level_part, sample_flow, sampling_error

DEPTHS = (-300.0, 0.0)
SIDES = (-500.0, 500.0)
FLOWS = {
    "upwelling": Upwelling(0.1, 0.2, 0.05, 1e-3, 30.0, x=SIDES),
    "cells": Rolls(w=0.2, width=150.0, depth=300.0, x_centre=20.0),
    "wave": InternalWave(w=0.15, length=400.0, depth=300.0, period=900.0, mode=2),
    "abc": Abc(0.3, 0.2, 0.1, 500.0),
}


def scattered(count=200):
    rng = np.random.default_rng(0)
    lows, highs = [-500.0, -500.0, -300.0, 0.0], [500.0, 500.0, 0.0, 5000.0]
    return rng.uniform(lows, highs, (count, 4))


def test_there_is_a_flow_here_for_every_formula_of_the_kernels():
    kinds = {type(flow.kernel(DEPTHS)) for flow in FLOWS.values()}
    assert kinds == set(Rising.__args__) - {RisingGrid, RisingOceanGrid}


@pytest.mark.parametrize("name", FLOWS)
def test_a_flow_with_a_vertical_part_has_no_divergence_and_keeps_its_bounds(name):
    flow, h = FLOWS[name].kernel(DEPTHS), 0.01
    assert rises(flow)
    fastest = lifted = 0.0
    for x, y, z, t in scattered():
        u, v, w = current(flow, x, y, z, t)
        assert velocity(flow, x, y, z, t) == (u, v)
        fastest, lifted = max(fastest, math.hypot(u, v)), max(lifted, abs(w))
        total = current(flow, x + h, y, z, t)[0] - current(flow, x - h, y, z, t)[0]
        total += current(flow, x, y + h, z, t)[1] - current(flow, x, y - h, z, t)[1]
        total += current(flow, x, y, z + h, t)[2] - current(flow, x, y, z - h, t)[2]
        assert abs(total / (2 * h)) < 1e-9
    assert 0.6 * flow.extent.max_speed < fastest <= flow.extent.max_speed
    assert 0.6 * max_rise(flow) < lifted <= max_rise(flow)


def test_cells_rise_in_the_middle_and_stand_still_at_surface_and_bottom():
    flow = FLOWS["cells"].kernel(DEPTHS)
    assert current(flow, 20.0, 7.0, -150.0, 0.0) == pytest.approx((0.0, 0.0, 0.2), abs=1e-15)
    assert current(flow, 170.0, 7.0, -150.0, 0.0)[2] == pytest.approx(-0.2)
    assert current(flow, 95.0, 7.0, -1e-12, 0.0) == pytest.approx((0.1, 0.0, 0.0), abs=1e-12)
    assert current(flow, 20.0, 7.0, -300.0, 0.0)[2] == pytest.approx(0.0, abs=1e-15)


def test_a_wave_travels():
    flow = FLOWS["wave"].kernel(DEPTHS)
    assert not is_steady(flow)
    assert cycle(flow) == pytest.approx(900.0)
    later = current(flow, 33.0 + 400.0 / 900.0 * 100.0, 0.0, -40.0, 100.0)
    assert later == pytest.approx(current(flow, 33.0, 0.0, -40.0, 0.0), abs=1e-12)
    assert current(flow, 0.0, 0.0, -75.0, 0.0)[2] == pytest.approx(0.15)


def test_a_flow_without_one_has_no_vertical_part():
    flow = Uniform(0.3, -0.2).kernel(DEPTHS)
    assert not rises(flow)
    assert max_rise(flow) == 0.0
    assert current(flow, 1.0, 2.0, -3.0, 4.0) == (0.3, -0.2, 0.0)


def test_a_grid_without_its_vertical_part_has_the_same_u_and_v():
    box = (-400.0, 400.0)
    grid = sample_flow(FLOWS["cells"].kernel(DEPTHS), (40.0, 40.0, 30.0), box, box, DEPTHS)
    level = level_part(grid)
    assert type(level) is Grid
    for x, y, z, _ in np.clip(scattered(40), -380.0, 380.0):
        assert velocity(level, x, y, min(z, 0.0), 0.0) == velocity(grid, x, y, min(z, 0.0), 0.0)
    assert level.level_carry[-1] == pytest.approx(0.1 * 300.0, rel=0.5)
    assert level_part(level) is level
    assert level_part(FLOWS["cells"].kernel(DEPTHS)) is None


def test_a_grid_holds_the_vertical_part_too():
    flow = FLOWS["upwelling"].kernel(DEPTHS)
    grid = sample_flow(flow, (100.0, 100.0, 50.0), SIDES, SIDES, DEPTHS)
    assert isinstance(grid, RisingGrid)
    # linear in each direction, so that a grid is exact
    assert sampling_error(flow, grid, SIDES, SIDES, DEPTHS) < 1e-12
    assert current(grid, 123.0, -45.0, -67.0, 0.0) == pytest.approx(current(flow, 123.0, -45.0, -67.0, 0.0))
    assert max_rise(grid) == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: Upwelling(0.0, 0.0, 0.1, 1e-3), r"flow\.x"),
        (lambda: Rolls(0.1, 0.0, 300.0), r"flow\.width"),
        (lambda: InternalWave(0.1, 300.0, 300.0, 900.0, mode=0), r"flow\.mode.* got 0"),
        (lambda: Abc(0.1, 0.1, 0.1, -3.0), r"flow\.length"),
        (
            lambda: require_level(FLOWS["cells"].kernel(DEPTHS), "a mission"),
            r"a mission takes no vertical.* 0.2 m",
        ),
    ],
)
def test_settings_that_cannot_be_used_are_refused(make, why):
    with pytest.raises(InputError, match=why):
        make()


CELLS = ("flow.kind=convection-cells", "flow.w=0.2", "flow.width=150.0", "flow.depth=300.0")


@pytest.fixture(scope="module")
def problem():
    return read_scenario("seed-box", CELLS).problem()


def test_a_scenario_says_that_its_water_rises_and_what_the_line_foresees(problem):
    rises = "with a vertical current of up to 0.2 m/s"
    assert problem.flow_words.startswith("convection-cells, sampled")
    assert f", {rises}, which the controls of this method do not foresee" in problem.flow_words
    exact = read_scenario("seed-box", [*CELLS, "steering.method=flow-map"]).problem()
    assert rises in exact.flow_words
    assert "foresee" not in exact.flow_words


@pytest.mark.parametrize("what", ["baseline", "2 dimensions"])
def test_what_takes_no_vertical_current_refuses_it(problem, what):
    asked = {
        "baseline": lambda: straight(problem, problem.start, problem.goal),
        "2 dimensions": lambda: bound(problem, 2),
    }
    with pytest.raises(InputError, match="vertical current, and this flow has one"):
        asked[what]()


def test_a_path_file_keeps_how_far_the_water_lifted_the_glider(tmp_path):
    start, end = np.array([0.0, 0.0, -10.0]), np.array([30.0, 0.0, -60.0])
    rows = np.array([[0.0, *start], [100.0, *end]])
    control = -math.asin(0.8), 0.0, 1.0
    leg = Leg(start, end, *control, 0.0, 100.0, 0.0, rows, lifted=30.0)
    path = Path(start, end, 100.0, (leg,))
    (tmp_path / "path.json").write_text(json.dumps(path.as_dict()))
    assert load_path(tmp_path / "path.json").legs[0].lifted == 30.0
    assert "lifted 30.0 m" in str(path)
    still = replace(path, legs=(replace(leg, lifted=0.0),))
    (tmp_path / "path.json").write_text(json.dumps(still.as_dict()))
    with pytest.raises(InputError, match="does not reach its depth in its time"):
        load_path(tmp_path / "path.json")
