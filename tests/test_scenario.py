"""Scenarios: TOML out and back, the shipped ones, overrides, file names."""

import math
import tomllib

import pytest
from helpers.small import SCENARIO, scenario_file

from glider_stream.base.errors import InputError
from glider_stream.base.toml import to_toml
from glider_stream.roadmap.builder import node_positions
from glider_stream.roadmap.neighbours import AllNodes, Nearest, Radius
from glider_stream.roadmap.nodes import GridSampler, SobolSampler
from glider_stream.roadmap.steering import StreamlineMethod, SurfaceMethod
from glider_stream.scenario import read_scenario, scenario_from_text, shipped_scenarios
from glider_stream.water.analytic import Uniform, Vortices
from glider_stream.water.domain import BoxDomain, GeographicDomain

OCEAN = (
    SCENARIO.replace(
        'kind = "vortices"\nx = [-600.0, 600.0]\ny = [-600.0, 600.0]\n', 'kind = "netcdf"\nfile = "a.nc"\n'
    )
    .replace("sampled = [50.0, 50.0, 50.0]\n", "")
    .split("[[flow.vortex]]")[0]
    + "[glider]"
    + SCENARIO.split("[glider]")[1]
)


def test_every_block_becomes_its_object(tmp_path):
    scenario = read_scenario(scenario_file(tmp_path))
    assert scenario.domain == BoxDomain(x=(-200, 200), y=(-200, 200), z=(-150, 0))
    assert isinstance(scenario.flow, Vortices)
    assert [one.speed for one in scenario.flow.vortex] == [0.4, -0.3]
    assert [one.thickness for one in scenario.flow.vortex] == [None, 200.0]
    assert scenario.sampler == GridSampler((5, 5, 3))
    assert scenario.law == Nearest(20)
    assert scenario.method == StreamlineMethod(24)
    assert (scenario.integration.dt, scenario.integration.steps, scenario.integration.tolerance) == (
        5,
        125,
        8,
    )
    assert scenario.query.start == (-190, 190, 0)
    assert scenario.departure == 0


def test_a_scenario_without_query_has_no_ends(tmp_path):
    file = scenario_file(tmp_path, (SCENARIO[SCENARIO.index("[query]") :], ""))
    scenario = read_scenario(file)
    assert scenario.query is None
    problem = scenario.problem()
    assert problem.start is None
    assert len(node_positions(problem)) == 75


@pytest.mark.parametrize("name", shipped_scenarios())
def test_shipped_scenarios_come_back_from_their_text(name):
    overrides = ["flow.file=currents.nc"] if name == "ionian" else []
    scenario = read_scenario(name, overrides)
    assert scenario_from_text(scenario.text) == scenario


def test_all_scenarios_of_the_design_are_shipped():
    assert {"seed-box", "double-gyre", "ionian"} <= set(shipped_scenarios())


def test_the_papers_nodes():
    problem = read_scenario("seed-box").problem()
    nodes = node_positions(problem)
    assert nodes.shape == (1026, 3)
    assert nodes[-2:].tolist() == [[-450, 450, 0], [450, -450, 0]]
    assert sorted(set(nodes[:, 2])) == [-300, -200, -100, 0]
    assert sorted(set(nodes[:-2, 0])) == [-450 + 900 / 16 * (n + 0.5) for n in range(16)]
    assert 1.8 < problem.evaluator.flow.extent.max_speed < 1.95


def test_a_scenario_in_a_folder_of_the_same_name_as_a_shipped_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "seed-box").mkdir()
    assert read_scenario("seed-box").sampler == GridSampler((16, 16, 4))


def test_a_byte_order_mark_is_read_over(tmp_path):
    file = scenario_file(tmp_path)
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
    assert read_scenario(file).law == Nearest(20)


TABLES = [
    {"a": {"x": 1, "y": -2.5, "z": 1e300, "w": 1e-7, "yes": True, "no": False}},
    {"a": {"text": 'quotes " and \\ and \n, \t, \r, \x01, \x7f, ü and 🌊'}},
    {"a": {"list": [1.0, 2.0], "nested": [[1, 2], ["x", "y"]], "empty": []}},
    {"a": {"b": {"c": 1, "d": {"e": "deep"}}, "f": 2}, "g": {"h": [{"i": 1}, {"i": 2, "j": {"k": [3]}}]}},
    {"a": {"far": math.inf, "near": -math.inf}},
]


@pytest.mark.parametrize("table", TABLES)
def test_toml_out_and_back(table):
    assert tomllib.loads(to_toml(table)) == table


def test_the_text_of_a_scenario_is_what_it_was_read_from(tmp_path):
    assert tomllib.loads(read_scenario(scenario_file(tmp_path)).text) == tomllib.loads(SCENARIO)


# overrides


@pytest.mark.parametrize(
    ("override", "found"),
    [
        ("neighbours.k=5", lambda s: s.law == Nearest(5)),
        (' neighbours . k = "prm*" ', lambda s: s.law == Nearest("prm*")),
        ("neighbours.k=prm*", lambda s: s.law == Nearest("prm*")),
        ("glider.preset=slocum", lambda s: s.glider.name == "slocum"),
        ("integration.dt=2.5", lambda s: s.integration.dt == 2.5),
        ("integration.dt=2", lambda s: s.integration.dt == 2.0),
        ("sampling.shape=[2, 3, 4]", lambda s: s.sampler == GridSampler((2, 3, 4))),
        ("domain.z=[-90.0,-10]", lambda s: s.domain.z == (-90, -10)),
        ("query.departure=60", lambda s: s.departure == 60),
        ("flow.vortex=[{x=1,y=2,radius=3,speed=4}]", lambda s: s.flow.vortex[0].radius == 3),
    ],
)
def test_one_override(tmp_path, override, found):
    scenario = read_scenario(scenario_file(tmp_path), [override])
    assert found(scenario)
    assert scenario_from_text(scenario.text) == scenario


def test_the_last_of_two_overrides_holds(tmp_path):
    assert read_scenario(scenario_file(tmp_path), ["neighbours.k=5", "neighbours.k=6"]).law == Nearest(6)


def test_an_override_may_add_a_section(tmp_path):
    file = scenario_file(tmp_path, (SCENARIO[SCENARIO.index("[query]") :], ""))
    scenario = read_scenario(file, ["query.start=[0,0,0]", "query.goal=[9,9,-9]"])
    assert scenario.query.goal == (9, 9, -9)


def test_another_kind_drops_the_keys_that_it_does_not_know(tmp_path):
    file = scenario_file(tmp_path)
    assert read_scenario(file, ["neighbours.kind=all"]).law == AllNodes()
    assert read_scenario("seed-box", ["neighbours.kind=all"]).law == AllNodes()
    assert read_scenario(file, ["neighbours.radius=120", "neighbours.kind=radius"]).law == Radius(120)
    sobol = ["sampling.kind=sobol", "sampling.count=9", "sampling.seed=3"]
    assert read_scenario(file, sobol).sampler == SobolSampler(9, 3)
    flow = read_scenario(file, ["flow.kind=uniform", "flow.u=0.1", "flow.v=0"]).flow
    # what the kinds share stays
    assert flow == Uniform(u=0.1, v=0.0, x=(-600, 600), y=(-600, 600), sampled=(50, 50, 50))
    assert read_scenario(file, ["steering.method=surface"]).method == SurfaceMethod(24)


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["neighbours.kind=all", "neighbours.k=5"], "the key `neighbours.k` is not known"),
        (["neighbours.k=5", "neighbours.kind=all"], "the key `neighbours.k` is not known"),
        (["neighbours.kind=radius"], "`neighbours.radius` is missing"),
        (["neighbours.kind=al"], "'al' is not known; choose from: all, nearest, radius"),
    ],
)
def test_another_kind_does_not_hide_mistakes(tmp_path, overrides, said):
    with pytest.raises(InputError, match=said):
        read_scenario(scenario_file(tmp_path), overrides)


def test_a_misspelt_key_is_not_dropped_with_the_old_kind(tmp_path):
    file = scenario_file(tmp_path, ("k = 20", "k = 20\nkk = 3"))
    with pytest.raises(InputError, match=r"`neighbours.kk` is not known"):
        read_scenario(file, ["neighbours.kind=all"])


# file names


def ocean_file(folder):
    text = OCEAN.replace(
        "x = [-200.0, 200.0]\ny = [-200.0, 200.0]\nz = [-150.0, 0.0]",
        "lon = [1, 2]\nlat = [3, 4]\ndepth = [0, 90]",
    )
    file = folder / "ocean.toml"
    file.write_text(text.split("[query]")[0])
    return file


def test_files_are_relative_to_the_scenario_and_overrides_to_the_working_directory(tmp_path, monkeypatch):
    home, work = tmp_path / "home", tmp_path / "work"
    home.mkdir()
    work.mkdir()
    file = ocean_file(home)
    monkeypatch.chdir(work)
    scenario = read_scenario(file)
    assert isinstance(scenario.domain, GeographicDomain)
    assert scenario.flow.file == (str(home / "a.nc"),)
    assert read_scenario(file, ["flow.file=b.nc"]).flow.file == (str(work / "b.nc"),)
    two = read_scenario(file, ['flow.file=["b.nc", "/c.nc"]']).flow.file
    assert two == (str(work / "b.nc"), "/c.nc")
    # a roadmap carries the names whole: it can be moved
    assert scenario_from_text(scenario.text).flow.file == (str(home / "a.nc"),)


def test_a_number_is_not_a_file_name(tmp_path):
    with pytest.raises(InputError, match=r"`flow.file` must be a text; got 3"):
        read_scenario(ocean_file(tmp_path), ["flow.file=[3]"])


# points of a geographic domain


@pytest.mark.parametrize(
    ("point", "said"),
    [
        ((1.5, 91, 10), "not a longitude and a latitude"),
        ((1.5, math.nan, 10), "not a longitude and a latitude"),
        ((math.nan, 3.5, 10), "not a longitude and a latitude"),
        ((4000, 3.5, 10), "not a longitude and a latitude"),
        ((1.5, 3.5, -10), "at least 0 m, downward; got -10"),
        ((1.5, 3.5, math.nan), "at least 0 m, downward; got nan"),
    ],
)
def test_points_that_are_not_on_earth(point, said):
    domain = GeographicDomain(lon=(1, 2), lat=(3, 4), depth=(0, 90))
    with pytest.raises(InputError, match=said):
        domain.point(point)


def test_a_point_of_a_geographic_domain_lies_in_its_frame():
    domain = GeographicDomain(lon=(1, 2), lat=(3, 4), depth=(0, 90))
    x, y, z = domain.point((1.6, 3.4, 25.0))
    assert z == -25
    assert x == pytest.approx(11_120, rel=0.01)
    assert y == pytest.approx(-11_058, rel=0.01)
