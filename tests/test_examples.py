"""The examples in the docstrings of all that is public, run as they stand."""

import doctest
import inspect
import pathlib

import numpy as np
import pytest
from helpers.ionian import write_ionian
from helpers.missions import write_mission
from helpers.small import SCENARIO, roadmap

import glider_stream
from glider_stream import planner
from glider_stream.roadmap.store import write_roadmap

pytestmark = pytest.mark.slow

IN_KERNELS = {"Status"}
"""Their text is part of the key of the kernels' cache: an example there would compile all kernels anew."""
DIVES = """\
vertical,horizontal,phase
-0.125,0.245,dive
0.121,0.250,climb
-0.145,0.246,dive
0.150,0.240,climb
-0.165,0.239,dive
0.160,0.243,climb
-0.105,0.235,dive
0.110,0.240,climb
"""


def public():
    """All that is public, by name: functions of the planner, names at the top, an opened roadmap's methods."""
    found = {
        f"planner.{name}": thing
        for name, thing in vars(planner).items()
        if inspect.isfunction(thing) and thing.__module__ == planner.__name__ and not name.startswith("_")
    }
    found |= {
        name: getattr(glider_stream, name)
        for name in glider_stream.__all__
        if name not in IN_KERNELS and not name.startswith("__")
    }
    opened = glider_stream.OpenedRoadmap
    found |= {
        f"OpenedRoadmap.{name}": method
        for name, method in vars(opened).items()
        if inspect.isfunction(method) and not name.startswith("_") and name != "planner"
    }
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The files that examples read: a small scenario, its roadmap, a current file, dives."""
    made = tmp_path_factory.mktemp("examples")
    (made / "small.toml").write_text(SCENARIO)
    write_roadmap(roadmap(), made / "small.h5")
    write_ionian(made / "currents.nc")
    write_mission(made)
    (made / "dives.csv").write_text(DIVES)
    return made


@pytest.mark.parametrize("name", public())
def test_the_example_runs(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    names = {"glider_stream": glider_stream, "planner": planner, "np": np, "pathlib": pathlib}
    names["road"] = glider_stream.open("small.h5")
    thing = public()[name]
    # a class's own docstring alone: its methods have examples of their own
    example = doctest.DocTestParser().get_doctest(inspect.getdoc(thing) or "", names, name, None, 0)
    assert example.examples, f"{name} has no example"
    said = []
    result = doctest.DocTestRunner(verbose=False).run(example, out=said.append)
    assert result.failed == 0, "".join(said)
