"""Points outside the domain: told so, with its bounds, and whether they would lie inside with both swapped."""

import re

import numpy as np
import pytest
from helpers.small import command, roadmap, scenario_file

from glider_stream.base.errors import InputError
from glider_stream.kernels.terrain import OpenWater
from glider_stream.roadmap.builder import node_positions
from glider_stream.roadmap.store import write_roadmap
from glider_stream.scenario import read_scenario, scenario_from_text
from glider_stream.water.domain import BoxDomain, GeographicDomain

IONIAN = GeographicDomain((18.2, 18.85), (37.65, 38.2), (0.0, 600.0))
PACIFIC = GeographicDomain((179.0, -179.0), (-20.0, -18.0), (0.0, 600.0))
BOX = BoxDomain((0.0, 100.0), (300.0, 500.0), (-100.0, 0.0))
SWAPPED = "with longitude and latitude swapped it would lie inside"


@pytest.mark.parametrize(
    ("domain", "place", "words"),
    [
        (IONIAN, (18.5, 38.0), ""),
        (IONIAN, (18.2, 38.2), ""),
        (IONIAN, (18.5 - 360, 38.0), ""),
        (IONIAN, (18.5, 39.0), r"longitude 18.2 to 18.85 and latitude 37.65 to 38.2 degrees; move it inside"),
        (IONIAN, (38.0, 18.5), SWAPPED),
        (PACIFIC, (179.5, -19.0), ""),
        (PACIFIC, (-179.5, -19.0), ""),
        (PACIFIC, (0.0, -19.0), "longitude 179 to -179"),
        (BOX, (50.0, 400.0), ""),
        (BOX, (400.0, 50.0), "with x and y swapped it would lie inside: give X,Y,Z"),
        (BOX, (400.0, 450.0), "x from 0 to 100 m and y from 300 to 500 m; move it inside"),
    ],
)
def test_the_message_on_a_place_outside(domain, place, words):
    said = domain.outside(*place)
    assert bool(said) == bool(words)
    assert words in said


def test_an_impossible_latitude_may_be_a_longitude():
    with pytest.raises(InputError, match=f"-19, 179.5 are not a longitude .*{SWAPPED}"):
        PACIFIC.point((-19.0, 179.5, 0.0))
    with pytest.raises(InputError, match=r"degrees; give LON,LAT,DEPTH$"):
        IONIAN.point((18.0, 95.0, 0.0))


def problem():
    return scenario_from_text(roadmap().provenance.scenario).problem()


def test_a_start_outside_is_told_apart_from_land(tmp_path, capsys):
    write_roadmap(roadmap(), tmp_path / "road.h5")
    said = command(capsys, "query", tmp_path / "road.h5", "--start=-2000,0,0")
    assert said.code == 2
    assert "`start` = [-2000, 0, 0] lies outside the domain, x from -200 to 200 m" in said.err
    evaluator = problem().evaluator
    shallow = evaluator.__class__(**{**vars(evaluator), "terrain": OpenWater(-20.0)})
    here = problem().__class__(**{**vars(problem()), "evaluator": shallow})
    with pytest.raises(InputError, match="lies on land, in a keep-out area or too near the seabed"):
        here.check_point(np.array([0.0, 0.0, -50.0]), "start")
    # beyond the nodes' box, and yet in known water: allowed, as ever
    here.check_point(np.array([230.0, 0.0, -10.0]), "start")


@pytest.mark.parametrize(("start", "inside"), [("38.0,18.5,0", True), ("18.5,39.5,0", False)])
def test_swapped_coordinates_are_recognised_in_a_scenario(tmp_path, start, inside):
    file = scenario_file(
        tmp_path,
        ("x = [-200.0, 200.0]\ny = [-200.0, 200.0]\nz = [-150.0, 0.0]\n",
         "lon = [18.498, 18.502]\nlat = [37.998, 38.002]\ndepth = [0.0, 150.0]\n"),
        ("start = [-190.0, 190.0, 0.0]", f"start = [{start}]"),
        ("goal = [160.0, -160.0, 0.0]", "goal = [18.5, 38.0, 0.0]"),
    )  # fmt: skip
    with pytest.raises(InputError, match=r"lies outside the domain, longitude 18\.498 to 18\.502") as refused:
        node_positions(read_scenario(file).problem())
    assert bool(re.search(SWAPPED, str(refused.value))) == inside
