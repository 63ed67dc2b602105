"""Roadmaps of several departures: their slices, and the file that holds them."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from helpers.slices import DEPARTURES, FEW_NODES, keys, problem, sliced

from glider_stream.base.errors import InputError
from glider_stream.base.threads import threads
from glider_stream.kernels.edges import CONNECTED, STATUS, TIME
from glider_stream.kernels.follow import COARSE_TOLERANCE, LANDING_TOLERANCE
from glider_stream.roadmap.builder import build_roadmap, find_edges, node_positions, nodes_of_batch
from glider_stream.roadmap.compare import difference
from glider_stream.roadmap.follow import FEW, Follower, nodes_near
from glider_stream.roadmap.roadmap import EDGE_FIELDS, in_order
from glider_stream.roadmap.slices import SlicedRoadmap
from glider_stream.roadmap.step_error import StepSample
from glider_stream.roadmap.store import read_any_roadmap, read_roadmap, write_roadmap
from glider_stream.roadmap.verify import check_slices, replayed_misses
from glider_stream.scenario import read_scenario

pytestmark = pytest.mark.slow


def fresh(number):
    """The roadmap of one departure, all legs found by fans."""
    departure = float(sliced().departures[number])
    return build_roadmap(replace(problem(), departure=departure, slices=()))


def test_the_first_slice_is_the_roadmap_of_its_departure():
    found = difference(sliced().at(0), fresh(0))
    assert found.same_edges
    assert found.edges[2] > 500


def shares(follower, source):
    """Of each slice: what share of fans' edges it has, what share fans lack, and how much later [s] each is."""
    for number, found in enumerate(follower.slices(source)):
        departure = follower.problem.departures[number]
        fan = replace(follower.problem, departure=departure, slices=()).legs(follower.position).of(source)
        mine, theirs = rows_and_targets(found), rows_and_targets(fan)
        later = [mine[pair] - theirs[pair] for pair in mine.keys() & theirs.keys()]
        yield len(later) / len(theirs), 1 - len(later) / len(mine), np.array(later)


def test_followed_legs_are_those_that_fans_find():
    """Among nodes that lie near enough to each other; a chain of slices loses few."""
    question = read_scenario("swinging-gyre").problem()
    question = replace(question, slices=tuple(1800.0 * n for n in range(4)))
    position = node_positions(question)
    first, *others = shares(Follower.of(question, position), np.arange(5, len(position), 200))
    assert first[:2] == (1.0, 0.0)
    for share, alone, later in others:
        assert share > 0.98
        assert alone < 0.005
        assert np.median(np.abs(later)) < 0.05
        assert np.quantile(later, 0.97) < 1.0


def test_a_node_of_few_legs_gets_a_fan():
    many = np.diff(sliced().indptr).reshape(-1, 4) >= FEW
    assert 0.1 < many.mean() < 0.9
    mine, theirs = sliced().at(1), fresh(1)
    for node in np.flatnonzero(~many[:, 0]):
        for name in ("target", *EDGE_FIELDS):
            one, other = (
                getattr(road, name)[road.indptr[node] : road.indptr[node + 1]] for road in (mine, theirs)
            )
            assert one.tobytes() == other.tobytes()
    assert not difference(mine, theirs).same_edges


def test_legs_are_followed_alike_in_any_batch():
    question = problem()
    position = sliced().position
    follower = Follower(question, position, nodes_near(position), few=0)
    source = np.arange(0, len(position), 30)
    with threads(2):
        together = list(follower.slices(source))
    with threads(1):
        alone = [list(follower.slices(np.array([node]))) for node in source]
    for number, found in enumerate(together):
        for row, one in enumerate(alone):
            here = slice(found.indptr[row], found.indptr[row + 1])
            assert found.target[here].tolist() == one[number].target.tolist()
            assert found.outcomes[here].tobytes() == one[number].outcomes.tobytes()


def test_every_slice_meets_its_targets():
    road = sliced()
    for number, departure in enumerate(road.departures):
        one = road.at(number)
        some = np.arange(0, one.target.size, 50)
        source = np.repeat(np.arange(len(one.position)), np.diff(one.indptr))[some]
        values = np.column_stack([getattr(one, name)[some] for name in EDGE_FIELDS])
        ends = problem().evaluator, departure, one.position, source, one.target[some].astype(int), values
        assert replayed_misses(*ends).max() < 0.15
        assert one.miss.max() <= COARSE_TOLERANCE * 2 + LANDING_TOLERANCE


def test_neither_threads_nor_batches_change_a_bit():
    question, road = problem(), sliced()
    source = np.arange(0, len(road.position), 31)
    with threads(1):
        alone = in_order([edges for n in source for edges in find_edges(question, road.position, np.array([n]))])
    with threads(2):
        together = in_order(list(find_edges(question, road.position, source[::-1].copy())))
    for name in ("source", "degree", "target", "values", "counts"):
        assert getattr(alone, name).tobytes() == getattr(together, name).tobytes()
    rows = (source[:, None] * 4 + np.arange(4)).ravel()
    assert alone.degree.tolist() == np.diff(road.indptr)[rows].tolist()


def test_times_between_slices_are_near_the_truth():
    road = sliced()
    truth = build_roadmap(replace(problem(), departure=900.0, slices=()))
    early, late = road.at(1), road.at(2)
    both, a, b = np.intersect1d(keys(early), keys(late), return_indices=True)
    _, mine, there = np.intersect1d(both, keys(truth), return_indices=True)
    between = 0.5 * (early.time[a] + late.time[b])[mine]
    assert np.median(np.abs(between / truth.time[there] - 1)) < 0.01


def test_a_law_of_neighbours_keeps_its_pairs():
    question = problem("neighbours.kind=nearest", "neighbours.k=9")
    position = sliced().position
    source = np.arange(5)
    one, *others = Follower(question, position, nodes_near(position), few=0).slices(source)
    for found in others:
        assert found.target.tolist() == one.target.tolist()
        assert np.isfinite(found.outcomes[found.outcomes[:, 0] == 0]).all()
        assert np.isnan(found.outcomes[found.outcomes[:, 0] != 0][:, 1:]).all()


def test_a_limit_keeps_the_fastest():
    question = read_scenario("swinging-gyre", ["neighbours.limit=30"]).problem()
    question = replace(question, slices=(0.0, 900.0, 1800.0))
    position = node_positions(question)
    source = np.arange(5, len(position), 100)
    for found in Follower.of(question, position).slices(source):
        climbs = np.sign(position[found.target, 2] - position[np.repeat(source, np.diff(found.indptr)), 2])
        for row in range(len(source)):
            here = climbs[found.indptr[row] : found.indptr[row + 1]]
            assert max((here > 0).sum(), (here < 0).sum()) <= 30
    for share, _, _ in shares(Follower.of(question, position), source):
        assert share > 0.9


def rows_and_targets(found):
    """The time of each edge, by its row and target."""
    rows = np.repeat(np.arange(len(found.indptr) - 1), np.diff(found.indptr))
    met = found.outcomes[:, STATUS] == CONNECTED
    pairs = zip(rows[met].tolist(), found.target[met].tolist(), strict=True)
    return dict(zip(pairs, found.outcomes[met, TIME], strict=True))


@pytest.mark.wide
def test_other_methods_begin_each_slice_anew():
    line = "steering.method=streamline", "steering.candidates=16"
    question = problem(*line, "neighbours.kind=nearest", "neighbours.k=6")
    source = np.arange(3)
    follower = Follower.of(question, sliced().position)
    for number, found in enumerate(follower.slices(source)):
        one = replace(question, departure=question.departures[number], slices=())
        assert found.outcomes.tobytes() == one.legs(sliced().position).of(source).outcomes.tobytes()


def test_nodes_near_are_on_the_same_depth_and_beside_it():
    position = sliced().position
    near = nodes_near(position)
    assert (position[near[:, :8], 2] == position[:, None, 2]).all()
    assert not (near[:, :8] == np.arange(len(position))[:, None]).any()
    scattered = np.random.default_rng(0).uniform([0, 0, -200], [900, 900, 0], (60, 3))
    assert nodes_near(scattered).shape == (60, 10)
    assert nodes_near(position[:1]).tolist() == [[0] * 10]


def test_a_file_of_several_departures_is_of_version_2(tmp_path):
    write_roadmap(sliced(), tmp_path / "slices.h5")
    with h5py.File(tmp_path / "slices.h5") as file:
        assert file.attrs["format_version"] == 2
        assert file["slices/departure"][()].tolist() == [0.0, 600.0, 1200.0, 1800.0]
        assert file["edges/indptr"].shape == (len(sliced().position) * 4 + 1,)
    back = read_any_roadmap(tmp_path / "slices.h5")
    assert isinstance(back, SlicedRoadmap)
    assert difference(back, sliced()).same_edges
    assert "4 departures" in str(back)
    assert back.as_dict()["departures"] == [0.0, 600.0, 1200.0, 1800.0]
    with pytest.raises(InputError, match="of 4 departures, from 0 s to 1800 s"):
        read_roadmap(tmp_path / "slices.h5")


def test_a_file_of_one_departure_stays_of_version_1(tmp_path):
    write_roadmap(sliced().at(2), tmp_path / "one.h5")
    with h5py.File(tmp_path / "one.h5") as file:
        assert file.attrs["format_version"] == 1
        assert "slices" not in file
    assert difference(read_roadmap(tmp_path / "one.h5"), sliced().at(2)).same_edges
    one = read_scenario(
        "swinging-gyre", [*FEW_NODES, "departures.first=0", "departures.last=0", "departures.every=9"]
    )
    assert one.problem().departures == (0.0,)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda file: file["slices/departure"].__setitem__(1, 0.0), "departures do not rise"),
        (lambda file: file.__delitem__("slices/departure"), "no dataset slices/departure"),
        (lambda file: file["edges/indptr"].resize(9, axis=0), "do not fit each other"),
    ],
)
def test_damaged_slices_are_refused(tmp_path, change, says):
    write_roadmap(sliced(), tmp_path / "slices.h5")
    with h5py.File(tmp_path / "slices.h5", "r+") as file:
        change(file)
    with pytest.raises(InputError, match=says):
        read_any_roadmap(tmp_path / "slices.h5")


def test_verification_looks_at_every_slice():
    good = check_slices("good", sliced(), problem(), 20)
    assert good.holds
    assert good.sample >= 20
    assert good.edges == sliced().target.size
    heading = sliced().heading.copy()
    last = sliced().indptr[-2]  # the first edge of the last slice
    heading[last] += 0.1
    bad = check_slices("bad", replace(sliced(), heading=heading), problem(), 20)
    assert not bad.holds
    assert all(fault.startswith("at departure 1800 s: ") for fault in bad.faults)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (["departures.first=0", "departures.last=-1", "departures.every=10"], "must not be before `first`"),
        (["departures.first=0", "departures.last=10", "departures.every=0"], "must be above 0 s; got 0"),
        (["departures.first=0", "departures.last=1e6", "departures.every=1"], "make it at least 100.01"),
        (
            ["departures.first=5", "departures.last=10", "departures.every=1"],
            "`query.departure` = 0 s lies outside",
        ),
        (["departures.first=0", "departures.last=10"], "every"),
        (["departures.first=0", "departures.last=10", "departures.every=-3"], "must be above 0 s; got -3"),
        (["departures.first=0", "departures.last=10", "departures.every=nan"], "`departures.every` must be"),
        (["departures.first=inf", "departures.last=10", "departures.every=1"], "`departures.first` must be"),
        (["departures.first=0", "departures.last=1e30", "departures.every=1"], "`departures.last` must be"),
        (["departures.first='a'", "departures.last=10", "departures.every=1"], "`departures.first` must be"),
        (["departures.last=10", "departures.every=1"], "first"),
        ([*DEPARTURES[2:], "departures.count=4"], "count"),
        ([*DEPARTURES[2:], "flow.epsilon=0.0"], "this one does not; remove that section"),
    ],
)
def test_departures_that_make_no_sense_are_refused(given, says):
    with pytest.raises(InputError, match=says):
        read_scenario("swinging-gyre", given).problem()


def test_slices_lie_within_the_times_of_the_currents(monkeypatch):
    scenario = read_scenario("swinging-gyre", DEPARTURES)
    waters = scenario._waters

    def ending(*reach):
        flow, terrain, text = waters(*reach)
        return flow._replace(extent=flow.extent._replace(t_lo=-1.0, t_hi=1799.0)), terrain, text

    monkeypatch.setattr(type(scenario), "_waters", lambda self, *reach: ending(*reach))
    with pytest.raises(
        InputError, match=r"`departures\.last` = 1800 s lies outside the times of the flow, -1 to 1799"
    ):
        scenario.problem()


def test_steps_are_looked_at_over_all_the_departures():
    """A flow may be gentle at first: the first, the last and a departure between are sampled."""
    asked = []

    def find(one, nodes):
        asked.append((one.departure, one.slices))
        yield from find_edges(one, sliced().position, nodes)

    made = StepSample(len(sliced().position)).checked(sliced().provenance, problem(), sliced().position, find)
    assert asked == [(0.0, ()), (1200.0, ()), (1800.0, ())]
    assert made.steps == sliced().provenance.steps


def test_the_reader_of_version_1_in_the_documents_refuses_version_2(tmp_path, monkeypatch):
    page = (Path(__file__).parents[2] / "docs/roadmap-format.md").read_text()
    reader = page.split("```python\n")[1].split("```")[0]
    monkeypatch.chdir(tmp_path)
    write_roadmap(sliced(), "seed-box.h5")
    with pytest.raises(AssertionError):
        exec(reader, {})
    write_roadmap(sliced().at(0), "seed-box.h5")
    exec(reader, {})


def test_a_batch_of_many_departures_keeps_the_threads_busy():
    question = problem()
    legs = question.legs(sliced().position)
    with threads(2):
        assert nodes_of_batch(question, legs, 10**5) == 10**5 // legs.pairs_per_node // 4
        assert nodes_of_batch(question, legs, 17 * legs.pairs_per_node) == 17
        assert nodes_of_batch(replace(question, slices=()), legs, 17 * legs.pairs_per_node) == 17


def test_the_last_departure_is_a_slice():
    given = ["departures.first=0", "departures.last=1000", "departures.every=300"]
    assert read_scenario("swinging-gyre", given).problem().departures == (0.0, 300.0, 600.0, 900.0, 1000.0)
