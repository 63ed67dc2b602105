"""Currents with a vertical part: closed forms, landings by DOP853, what never arrives, exact legs."""

import math

import numpy as np
import pytest
from helpers.reference import replay_rising

from glider_stream.kernels.control import DIVE, control_towards
from glider_stream.kernels.edges import STATUS, TIME, Status
from glider_stream.kernels.legs import fly_legs
from glider_stream.kernels.motion import traced
from glider_stream.kernels.place import Place, Velocity
from glider_stream.roadmap.steering import FlowMapMethod, StreamlineMethod, SurfaceMethod
from glider_stream.roadmap.verify import replayed_misses
from glider_stream.water.analytic import InternalWave, Upwelling

DEPTHS = (-300.0, 0.0)
SIDES = (-2000.0, 2000.0)
U, V, W, STRETCH, MIDDLE = 0.1, 0.2, 0.02, -8e-4, 30.0
THROUGH = 0.4, -0.1, -0.3


@pytest.fixture(scope="module")
def stretched():
    """An upwelling that slows towards the surface."""
    return Upwelling(U, V, W, STRETCH, MIDDLE, x=SIDES).kernel(DEPTHS)


@pytest.fixture(scope="module")
def uniform():
    """The same w everywhere."""
    return Upwelling(U, V, 0.05).kernel(DEPTHS)


def flown(flow, starts, throughs, heights, dt=5.0, longest=2000.0):
    """Where and when legs reach heights: rows x, y [m], t [s]."""
    start, through = np.array(starts, float), np.array(throughs, float)
    end, height = np.empty((len(start), 3)), np.array(heights, float)
    guess = (height - start[:, 2]) / through[:, 2]
    fly_legs(flow, start, through, guess, height, longest, dt, end, 0, len(start))
    return end


def test_a_uniform_vertical_current(uniform):
    starts = [[10.0, -20.0, z, 7.0] for z in np.linspace(-5.0, -80.0, 40)]
    end = flown(uniform, starts, [THROUGH] * 40, [-130.0] * 40)
    time = (-130.0 - np.array(starts)[:, 2]) / (THROUGH[2] + 0.05)
    expected = [10.0 + (THROUGH[0] + U) * time, -20.0 + (THROUGH[1] + V) * time, time]
    np.testing.assert_allclose(end, np.transpose(expected), rtol=0, atol=1e-6)


def closed_form(z, height, x, y, through):
    """Place and time of a glide from z to a height where w grows linearly with height."""
    drift = (through[2] + W) / STRETCH
    time = math.log((height + drift) / (z + drift)) / STRETCH
    far = MIDDLE + (through[0] + U) / STRETCH  # x' = u + U - stretch (x - middle)
    return [far + (x - far) * math.exp(-STRETCH * time), y + (through[1] + V) * time, time]


def test_a_vertical_current_that_grows_linearly_with_height(stretched):
    starts = [[10.0, -20.0, -10.0, 0.0], [-90.0, 40.0, -200.0, 55.0], [400.0, 0.0, -150.0, 3.0]]
    throughs = [THROUGH, (-0.3, 0.2, 0.35), (0.1, 0.1, -0.25)]
    heights = [-250.0, -40.0, -150.5]
    found = flown(stretched, starts, throughs, heights)
    expected = [
        closed_form(s[2], height, s[0], s[1], through)
        for s, through, height in zip(starts, throughs, heights, strict=True)
    ]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)
    # the path that is kept ends there too
    rows = traced(stretched, Place(*starts[0]), Velocity(*THROUGH), found[0, 2], 5.0)
    np.testing.assert_allclose(rows[-1, 1:], [*expected[0][:2], -250.0], rtol=0, atol=1e-6)


def test_a_glider_that_the_water_lifts_faster_than_it_sinks_does_not_arrive():
    strong = Upwelling(U, V, 0.31).kernel(DEPTHS)
    slow, fast = flown(strong, [[0.0, 0.0, -50.0, 0.0]] * 2, [THROUGH, (0.4, 0.0, -0.4)], [-100.0] * 2)
    assert np.isnan(slow[:2]).all()
    assert fast[2] == pytest.approx(50.0 / 0.09, abs=1e-6)


def test_the_place_of_a_leg_does_not_depend_on_its_company(stretched):
    starts = [[10.0 * n, -20.0, -10.0 - n, 0.0] for n in range(50)]
    together = flown(stretched, starts, [THROUGH] * 50, [-200.0] * 50)
    alone = np.concatenate([flown(stretched, [start], [THROUGH], [-200.0]) for start in starts])
    np.testing.assert_array_equal(together, alone)


@pytest.mark.wide
def test_landings_in_a_wave_are_those_of_dop853_with_events():
    wave = InternalWave(w=0.15, length=300.0, depth=300.0, period=900.0).kernel(DEPTHS)
    starts = [[x, 0.0, -20.0, 40.0] for x in np.linspace(-150.0, 150.0, 12)]
    found = flown(wave, starts, [THROUGH] * 12, [-240.0] * 12, dt=0.5)
    for start, end in zip(starts, found, strict=True):
        *place, time = replay_rising(wave, start, THROUGH, -240.0, 2500.0)
        np.testing.assert_allclose(end, [*place[:2], time], rtol=0, atol=1e-6)


# exact legs


@pytest.fixture(scope="module")
def judge(evaluator, stretched):
    return evaluator(stretched, lambda candidates: FlowMapMethod())


@pytest.fixture(scope="module")
def position():
    spread = np.random.default_rng(3).uniform(-300, 300, (150, 2))
    return np.column_stack([spread, np.random.default_rng(4).choice([-20.0, -100.0, -250.0], 150)])


def has_leg(judge, start, goal, horizon):
    """Whether the closed form has a control: of those that reach the depth when they should, by angle."""
    way, polar = int(goal[2] > start[2]), judge.polar
    angle = np.linspace(polar.shallowest[way], polar.steepest[way], 4001)
    speed = np.interp(angle, np.linspace(angle[0], angle[-1], polar.speed.shape[1]), polar.speed[way])
    sink = (2 * way - 1) * speed * np.sin(angle)
    drift = (sink + W) / STRETCH
    with np.errstate(invalid="ignore"):
        time = np.log((goal[2] + drift) / (start[2] + drift)) / STRETCH
    grown = np.exp(-STRETCH * time)
    # x(t) = far + (x - far) grown, with far = middle + (u + U) / stretch
    far = (goal[0] - start[0] * grown) / (1 - grown)
    u = (far - MIDDLE) * STRETCH - U
    v = (goal[1] - start[1]) / time - V
    short = np.hypot(u, v) - speed * np.cos(angle)
    fits = (time > 0) & (time < horizon)
    crosses = np.flatnonzero(fits[1:] & fits[:-1] & (np.sign(short[1:]) != np.sign(short[:-1])))
    share = short[crosses] / (short[crosses] - short[crosses + 1])
    return (time[crosses] + share * np.diff(time)[crosses]).min(initial=np.inf)


def test_the_flow_map_finds_every_leg_of_the_closed_form(judge, position):
    source = np.array([5, 60, 110])
    indptr, target, rows = judge.reach(position, 0.0, source, 0)
    found = {}
    for n, node in enumerate(source):
        for k in range(indptr[n], indptr[n + 1]):
            if rows[k, STATUS] == Status.CONNECTED:
                found[node, target[k]] = rows[k, TIME]
    true = {
        (node, other): has_leg(judge, position[node], position[other], 620.0)
        for node in source
        for other in range(150)
        if position[node, 2] != position[other, 2]
    }
    true = {pair: time for pair, time in true.items() if time < np.inf}
    assert len(true) > 150
    assert sum(pair in found for pair in true) >= 0.99 * len(true)
    late = [found[pair] - time for pair, time in true.items() if pair in found]
    # a few millimetres beside the target are 0.05 s where two legs to it are about to become one
    assert np.abs(late).max() < 0.06
    hit = rows[:, STATUS] == Status.CONNECTED
    ends = np.repeat(source, np.diff(indptr))[hit][::9], target[hit][::9], rows[hit][::9, TIME:]
    assert replayed_misses(judge, 0.0, position, *ends).max() < 0.1


def test_a_pair_whose_depth_no_glide_reaches_has_a_status_of_its_own(judge, evaluator):
    held = judge.flow._replace(w=0.9, max_rise=1.2)
    dive, climb = (
        evaluator(held, lambda candidates: FlowMapMethod()).connect_pair([0.0, 0.0, a], [40.0, 0.0, b]).status
        for a, b in ((-50.0, -120.0), (-120.0, -50.0))
    )
    assert dive == Status.CARRIED_AWAY
    assert climb == Status.CONNECTED


@pytest.mark.wide
@pytest.mark.parametrize("method", [StreamlineMethod, SurfaceMethod])
def test_the_paper_s_controls_are_flown_to_their_closest_approach(evaluator, uniform, method):
    line = evaluator(uniform, method, 16 if method is StreamlineMethod else 400, tolerance=20.0)
    start, goal = np.array([0.0, 0.0, -20.0]), np.array([150.0, 200.0, -200.0])
    found = line.connect_pair(start, goal)
    assert found.status == Status.CONNECTED
    rows = line.trace(start, found, 0.0)
    assert np.linalg.norm(rows[-1, 1:] - goal) == pytest.approx(found.miss, abs=1e-9)
    if method is SurfaceMethod:
        return
    # in a uniform current each control is a straight line
    best = np.inf
    for angle, heading in line.control_line(start, goal, 16):
        c = control_towards(line.polar, DIVE, angle, heading)
        over = np.array([c.u + U, c.v + V, c.w + 0.05])
        time = (goal - start) @ over / (over @ over)
        if np.linalg.norm(start + time * over - goal) < 20.0:
            best = min(best, time)
    assert found.time == pytest.approx(best, abs=1e-6)


@pytest.mark.wide
def test_the_paper_s_line_is_a_first_guess_of_exact_legs(evaluator, judge, stretched, position):
    line = evaluator(stretched, lambda candidates: StreamlineMethod(candidates, refine=True), 16)
    source, others = np.array([5]), np.arange(6, 60)
    ends = position, 0.0, source, np.array([0, others.size]), others
    refined, exact = line.connect(*ends), judge.connect(*ends)
    found, true = (rows[:, STATUS] == Status.CONNECTED for rows in (refined, exact))
    assert found.sum() > 0.5 * true.sum() > 5
    # the line may lead to another leg than the earliest
    assert (refined[found & true, TIME] > exact[found & true, TIME] - 0.06).all()
    legs = np.repeat(source, found.sum()), others[found], refined[found][:, TIME:]
    assert replayed_misses(line, 0.0, position, *legs).max() < 0.1
