"""A small problem that the tests of scenario, file, query and command line share; the command line itself."""

import json
import math
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from unittest.mock import patch

from glider_stream import planner
from glider_stream.base.compiling import COMPILING
from glider_stream.cli import main

SCENARIO = """\
[flow]
kind = "vortices"
x = [-600.0, 600.0]
y = [-600.0, 600.0]
sampled = [50.0, 50.0, 50.0]

[[flow.vortex]]
x = 20.0
y = -30.0
radius = 150.0
speed = 0.4

[[flow.vortex]]
x = -220.0
y = 200.0
radius = 120.0
speed = -0.3
depth = 60.0
thickness = 200.0

[glider]
preset = "paper"

[domain]
x = [-200.0, 200.0]
y = [-200.0, 200.0]
z = [-150.0, 0.0]

[sampling]
kind = "grid"
shape = [5, 5, 3]

[neighbours]
kind = "nearest"
k = 20

[steering]
method = "streamline"
candidates = 24

[integration]
dt = 5.0
steps = 125
tolerance = 8.0

[cost]
kind = "time"

[query]
start = [-190.0, 190.0, 0.0]
goal = [160.0, -160.0, 0.0]
"""
TOLERANCE = 8.0
K = 20


class Said(NamedTuple):
    """What a command answers."""

    code: int
    out: str
    err: str


def command(capsys, *arguments):
    """Run `glider-stream` with arguments, in this process.

    Whether kernels are compiled in it depends on the tests before, so that line is left out.
    """
    capsys.readouterr()
    with patch.object(sys, "argv", ["glider-stream", *map(str, arguments)]):
        try:
            main()
            code = 0
        except SystemExit as leaving:
            code = leaving.code
    out, err = capsys.readouterr()
    return Said(code, out, err.replace(f"{COMPILING}\n", ""))


def executable():
    """The installed command, as a user runs it."""
    return str(Path(sys.executable).with_name("glider-stream"))


def scenario_file(folder, *changes):
    """The small scenario in a folder, some of its text changed."""
    text = SCENARIO
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = folder / "small.toml"
    file.write_text(text)
    return file


@cache
def roadmap():
    """The small scenario's roadmap, built once."""
    with TemporaryDirectory() as folder:
        return planner.build(scenario_file(Path(folder)))


def strict_json(text):
    """JSON as its standard has it: without NaN and infinities."""

    def refuse(name):
        raise AssertionError(f"{name} is no JSON")

    return json.loads(text, parse_constant=refuse)


def distance(a, b):
    """Between two points [m]."""
    return math.dist(a, b)
