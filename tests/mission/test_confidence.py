"""Routes in an ensemble: what is certain arrives when it should, a choice is honest, and members share work."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.ionian import write_ionian
from helpers.missions import EXACT, mission, runner, write_mission
from helpers.small import command
from scipy.integrate import solve_ivp

from glider_stream.base.errors import InputError
from glider_stream.kernels.edges import Status
from glider_stream.kernels.flow import Extent, RisingOceanGrid, currents, velocities
from glider_stream.mission.assimilating import corrected
from glider_stream.mission.confidence.answer import confidence_of
from glider_stream.mission.confidence.candidates import Search
from glider_stream.mission.confidence.ensemble import _mean, drawn, first_member, from_files
from glider_stream.mission.confidence.judged import Criterion, Flights, best_of, checked, fly, lost_leg, quantile
from glider_stream.mission.confidence.reach import reach_of
from glider_stream.mission.pilot import plan_of
from glider_stream.mission.run import Runner
from glider_stream.mission.settings import read_mission
from glider_stream.mission.vehicle import Vehicle
from glider_stream.search.path import load_path

pytestmark = pytest.mark.slow
LIMIT = 7200.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("confidence")
    write_mission(made)
    return made


@pytest.fixture(scope="module")
def search(folder):
    """Three draws, and the legs in each."""
    return Search(drawn(mission(folder), 3))


# what a choice says


def test_a_new_time_comes_before_the_quantile_as_often_as_it_says():
    """For any n the rank q (n + 1) of n times is passed by a new one with the probability 1 - q at most."""
    random = np.random.default_rng(1)
    for count, q in ((9, 0.9), (30, 0.9), (30, 0.5), (12, 0.8)):
        before = [random.random() <= quantile(random.random(count), q) for _ in range(4000)]
        assert q - 0.02 < np.mean(before) < q + 1 / (count + 1) + 0.02
    assert quantile(np.arange(8.0), 0.9) == math.inf
    assert quantile(np.array([1.0, 2.0, math.inf]), 0.5) == 2.0


def test_criteria_choose_what_they_say():
    certain = np.array([60.0] * 10)
    fast = np.array([30.0] * 8 + [math.inf] * 2)
    times = np.array([certain, fast])
    assert best_of(times, Criterion(1000.0, 0.9)) == 0
    assert best_of(times, Criterion(1000.0, 0.7)) == 1
    assert best_of(times, Criterion(1000.0)) == 0  # 2 of 10 count as 1000 s
    assert best_of(times, Criterion(100.0)) == 1
    assert best_of(times, Criterion(1000.0, by=40.0)) == 1
    assert best_of(times, Criterion(1000.0, by=70.0)) == 0


def test_the_check_is_not_fooled_by_a_choice_among_equals():
    """All candidates are alike, so the best of many looks better than it is; the check says by how much."""
    random = np.random.default_rng(2)
    held = []
    for _ in range(60):
        flights = [
            Flights(SimpleNamespace(member=-1), random.random(30), ("arrived",) * 30, np.zeros(30, bool),
                    np.full(30, -1))
            for _ in range(40)
        ]  # fmt: skip
        held.append(checked(flights, Criterion(LIMIT, 0.9)).value)
        best = min(quantile(each.time, 0.9) for each in flights)
    assert best < 0.85  # what is promised; true is 0.9
    assert 0.7 < np.mean(held) < 0.88
    assert checked(flights[:1], Criterion(LIMIT, 0.99)) is None  # too few members to tell


def test_a_route_is_lost_where_its_track_leaves_it():
    stops = np.array([[10.0, 0.0], [20.0, 0.0], [30.0, 0.0]])
    on = np.array([[t, t, 0.0, -1.0] for t in np.arange(0.0, 31.0)])
    assert lost_leg(on, stops, 2.0) == 2  # all stops passed: what is left is the end
    off = on.copy()
    off[15:, 2] = 50.0
    assert lost_leg(off, stops, 2.0) == 1
    assert lost_leg(on[:5], stops, 2.0) == 0


# ensembles


def test_draws_have_numbers(search, folder):
    alone = next(iter(drawn(mission(folder), 1, 2).each()))
    third = list(search.ensemble.each())[2]
    assert np.array_equal(alone.evaluator.flow.values, third.evaluator.flow.values)


def test_members_share_nodes_and_pairs(search):
    shared = search.shared
    problem = list(search.ensemble.each())[1]
    road = shared.members[1]
    assert road.position is shared.forecast.position
    assert road.target.size == np.isfinite(shared.time[1]).sum() > 0.8 * shared.forecast.target.size
    source = np.repeat(np.arange(len(road.position)), np.diff(road.indptr))
    for n in (0, road.target.size // 2):
        ends = road.position[[source[n], road.target[n]]]
        edge = problem.evaluator.connect_pair(*ends, problem.departure)
        assert edge.status == Status.CONNECTED
        assert edge.time == pytest.approx(road.time[n], rel=1e-9)
    every, some = shared.over(1.0), shared.over(0.5)
    assert every.target.size < some.target.size <= shared.forecast.target.size
    assert every.cost.max() == shared.time[:, np.isfinite(shared.time).all(axis=0)].max()
    fewer = shared.over(1.0, without=np.array([True, False, False]))
    assert fewer.target.size > every.target.size


def test_without_errors_a_route_arrives_when_it_says(folder):
    ensemble = drawn(mission(folder, EXACT), 2)
    answer = confidence_of(ensemble, Criterion(LIMIT, 0.5), reach=True)
    best = answer.best
    assert best.arrived().value == 1.0
    assert best.time == pytest.approx([answer.path.travel_time] * 2, rel=0.01)
    assert best.candidate.name == "fastest in the forecast, as trims"
    names = [each.candidate.name for each in answer.flights]
    assert not [
        name for name in names if name.startswith("fastest in member") and "waypoints" not in name
    ]  # the same orders
    assert set(answer.reach.share) == {0.0, 1.0}  # by that time; members are alike
    assert answer.reach.by == answer.criterion.promised(best.time)


def test_more_places_are_reached_in_a_longer_time(search):
    soon, late = (reach_of(search, by).share for by in (300.0, 900.0))
    assert (soon <= late).all()
    assert soon.sum() < late.sum()
    assert ((soon > 0.0) & (soon < 1.0)).any()


# the command


def test_the_command_chooses_and_looks_at_a_route(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    outputs = ["-o", "route.json", "--figure", "c.png"]
    said = command(
        capsys, "confidence", "small-mission.toml", "--draws", "4", "--best", "80%", *outputs, "--json"
    )
    assert said.code == 0, said.err
    for work in ("legs", "routes", "flights", "tracks"):
        assert f"confidence: {work}: 4 of 4 members" in said.err
    table = json.loads(said.out)
    chosen = next(row for row in table["candidates"] if row["name"] == table["chosen"]["name"])
    assert chosen["arrived_share"][0] == 1.0  # with four members, 80 % is all of them
    assert chosen["arrival_quantiles_s"]["50%"] < table["promised_by_s"] < LIMIT
    assert (folder / "c.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((folder / "route.json").read_text())["confidence"]["members"] == 4
    assert json.loads((folder / "route.json").read_text())["confidence"]["planned_in"] in table["chosen"]["name"]
    assert load_path("route.json").origin is not None
    said = command(
        capsys, "confidence", "small-mission.toml", "route.json", "--draws", "2", "--best", "by", "--by", "0.5"
    )
    assert said.code == 0, said.err
    assert "within 40 m in 100 % (34-100) of 2 members" in said.out
    said = command(capsys, "confidence", "small-mission.toml", "--draws", "2", "--best", "mean", "--replanned")
    assert "orders are planned anew at each call" in said.out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "give the members' files, or the number of draws; not both, not none"),
        (["--draws", "3"], "3 members cannot tell by when 90% arrive; give at least 9"),
        (["--draws", "0"], "`draws` must be from 1"),
        (["--draws", "2", "--best", "soon"], "`mean` or `by`; got 'soon'"),
        (["--draws", "2", "--best", "by"], "need that time"),
        (["--draws", "2", "--best", "by", "--by", "9"], "at most 2 h, the longest time of a run; got 9 h"),
        (["--draws", "2", "--best", "mean", "--by", "1"], "leave one out"),
        (["--draws", "9", "--best", "100%"], "must be between 0 % and 100 %; got 100%"),
        (["--draws", "2", "--best", "mean", "-o", "route.txt"], "route.txt"),
        (["--draws", "2", "--best", "mean", "-o", "route.kml"], "route.kml needs longitude and latitude"),
    ],
)
def test_what_is_wrong_is_refused(folder, capsys, monkeypatch, arguments, sentence):
    monkeypatch.chdir(folder)
    said = command(capsys, "confidence", "small-mission.toml", *arguments)
    assert said.code == 2
    assert sentence in said.err
    assert said.err.count("\n") == 1


# what a pilot learns from dives


def test_dives_correct_the_forecast_where_they_were(folder):
    errors = {"forecast_error.rms_share": 0.5, "forecast_error.length_m": 300.0}
    made = runner(folder, tuple((EXACT | errors).items()))
    office, true = made.office(0), made.worlds.true
    vehicle = Vehicle(true, made.mission.vehicle, made.mission.pilot.rule, made.mission.energy,
                      np.random.default_rng(3), replace_place(true))  # fmt: skip
    orders = plan_of(office.route(vehicle.fix), office).orders
    for _ in range(2):
        orders = vehicle.dive(orders)
    assert len(vehicle.dives) == 2
    better = corrected(office.problem, made.mission, vehicle.fix.dives)
    rows = np.concatenate([phase.rows for phase in vehicle.phases])
    t, x, y, z = (np.ascontiguousarray(column) for column in rows.T)
    truth = velocities(true.evaluator.flow, x, y, z, t)
    before, after = (
        np.sqrt(np.mean((velocities(problem.evaluator.flow, x, y, z, t) - truth) ** 2))
        for problem in (office.problem, better)
    )
    assert after < 0.3 * before
    assert office.after(()) is office


def replace_place(problem):
    from glider_stream.kernels.place import Place

    return Place(*problem.start, problem.departure)


def test_assimilating_is_replanning_until_a_dive_is_made(folder):
    changes = {"pilot.policies": ["replan", "assimilate"], "vehicle.call_failure": 0.0}
    found = Runner(mission(folder, changes)).run(1)
    replan, assimilate = found
    assert assimilate.arrived
    assert assimilate.planned == replan.planned  # the first plan
    assert assimilate.time != replan.time


def test_assimilating_needs_the_forecasts_error(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    text = (folder / "small-mission.toml").read_text()
    block = text[text.index("[forecast_error]") : text.index("[vehicle]")]
    text = text.replace(block, '[truth]\nkind = "uniform"\nu = 0.1\nv = 0.0\n\n')
    text = text.replace('"open-loop", ', '"assimilate", ')
    (folder / "truth.toml").write_text(text)
    said = command(capsys, "simulate", "truth.toml", "--runs", "1")
    assert said.code == 2
    assert "`assimilate` needs [forecast_error]" in said.err


def test_a_touch_of_the_ground_is_told(search):
    flights = Flights(None, np.full(4, np.inf), ("aground",) * 4, np.array([True, True, False, False]),
                      np.full(4, 0))  # fmt: skip
    assert flights.terrain.value == 0.5
    assert replace(flights, touched=np.zeros(4, bool)).terrain.value == 0.0


def test_members_come_from_files_and_the_forecast_is_their_mean(tmp_path):
    import xarray as xr

    write_ionian(tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as data:
        doubled = data.load() * 2.0
        for name in ("uo", "vo"):
            doubled[name].attrs = data[name].attrs
        both = xr.concat([data, doubled], "member")
        both.to_netcdf(tmp_path / "both.nc", engine="h5netcdf")
    made = from_files(read_mission("ionian", first_member([tmp_path / "both.nc"])), [tmp_path / "both.nc"])
    one, two = (problem.evaluator.flow.values for problem in made.each())
    assert two == pytest.approx(2.0 * one, abs=1e-6)
    assert made.forecast.evaluator.flow.values == pytest.approx(1.5 * one, abs=1e-6)
    with pytest.raises(InputError, match=r"a\.nc holds no members: name a file that does, or one file for each"):
        from_files(read_mission("ionian", first_member([tmp_path / "a.nc"])), [tmp_path / "a.nc"])
    low = read_mission("ionian", [*first_member([tmp_path / "both.nc"]), "query.start=[18.3, 38.1, 50.0]"])
    with pytest.raises(InputError, match="begins and ends at the surface; got a start at a depth of 50 m"):
        from_files(low, [tmp_path / "both.nc"])
    doubled.isel(depth=[0, 1, 3, 4]).to_netcdf(tmp_path / "less.nc", engine="h5netcdf")
    files = [tmp_path / "a.nc", tmp_path / "less.nc"]
    read = read_mission("ionian", first_member(files))
    with pytest.raises(InputError, match=r"a\.nc and less\.nc have different points: .*; cut them alike"):
        from_files(read, files)
    doubled.assign_coords(time=doubled.time + np.timedelta64(5, "D")).to_netcdf(
        tmp_path / "later.nc", engine="h5netcdf"
    )
    with pytest.raises(InputError, match=r"a\.nc and later\.nc have different times: .*; cut them alike"):
        from_files(read, [tmp_path / "a.nc", tmp_path / "later.nc"])
    gone = doubled.copy(deep=True)
    for name in ("uo", "vo"):
        gone[name][:] = np.where(gone.longitude > 18.6, np.nan, gone[name])
    gone.to_netcdf(tmp_path / "gone.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"in member gone\.nc, `goal` = .* or leave this member out"):
        from_files(read, [tmp_path / "a.nc", tmp_path / "gone.nc"])
    with pytest.raises(
        InputError, match=r"members a\.nc and a\.nc hold the same currents; leave one of them out"
    ):
        from_files(read, [tmp_path / "a.nc", tmp_path / "a.nc"])


def test_the_mean_of_rising_members_knows_how_fast_it_may_rise():
    extent = Extent(0.0, 1.0, 0.0, 1.0, -math.inf, math.inf, 1.0, 1.0)

    def member(w):
        values, axis = np.zeros((2, 2, 2, 2, 4)), np.zeros(2)
        values[..., 2] = w
        places = np.zeros((2, 2, 2)), 1.0, 1.0
        return RisingOceanGrid(values, axis, axis, 1.0, axis, axis, 1.0, *places, abs(w), extent)

    mean = _mean([member(0.01), member(-0.09)])
    assert np.abs(mean.values[..., 2]).max() == pytest.approx(0.04)
    assert mean.max_rise == 0.09


@pytest.mark.wide
def test_members_of_water_that_rises_are_flown_as_another_integrator_flies_them(folder):
    """In cells, the vehicle without errors: a route's times and ends in each member, by DOP853."""
    cells = ["flow.kind=convection-cells", "flow.w=0.2", "flow.width=300.0", "flow.depth=150.0"]
    ensemble = drawn(mission(folder, EXACT | {"forecast_error.rms_share": 0.3}, cells), 2)
    planned = Search(ensemble).candidates(False)[0]
    flights = fly(ensemble, [planned], tracks=True)[0]
    for problem, time, track in zip(ensemble.each(), flights.time, flights.tracks, strict=True):
        at, now = planned.path.legs[0].start, problem.departure
        for leg in planned.path.legs:
            at, now = by_dop853(problem.evaluator.flow, leg, at, now)
        assert now - problem.departure == pytest.approx(time, abs=0.02)
        np.testing.assert_allclose(track[-1, 1:], at, rtol=0, atol=0.1)


def by_dop853(flow, leg, at, now):
    """Where a leg's glide ends that begins at a place (3,) [m] and a time [s], and when."""
    level = leg.speed * math.cos(leg.glide_angle)
    through = [
        level * math.cos(leg.heading),
        level * math.sin(leg.heading),
        leg.speed * math.sin(leg.glide_angle),
    ]

    def rate(t, place):
        return through + currents(flow, *(np.array([value]) for value in (*place, t)))[0]

    def depth(t, place):
        return place[2] - leg.end[2]

    depth.terminal, depth.direction = True, np.sign(through[2])
    found = solve_ivp(rate, (now, now + 3000.0), at, "DOP853", events=depth, max_step=10.0, rtol=1e-8, atol=1e-8)
    return found.y[:, -1], found.t[-1]
