"""What a type checker sees of the package: the types that a user's program gets, none of them `Any`."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import glider_stream

ROOT = Path(__file__).parents[1]
pytestmark = [pytest.mark.slow, pytest.mark.wide]

EXPRESSIONS = {
    "glider_stream.read_roadmap('small.h5')": "glider_stream.roadmap.roadmap.Roadmap",
    "planner.build('seed-box')": "glider_stream.roadmap.roadmap.Roadmap",
    "planner.query('small.h5')": "glider_stream.search.path.Path",
    "planner.query('small.h5').legs[0].depart": "float",
    "planner.table('small.h5', [(0.0, 0.0, 0.0)], [(1.0, 1.0, -1.0)])": "numpy.ndarray[",
}
ASKED = [*(f"glider_stream.{name}" for name in glider_stream.__all__), *EXPRESSIONS]
WRONG = "planner.query('small.h5', wrong=1)"


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """A user's program, and what mypy prints of it and of the package: one run, each reads all imports."""
    lines = ["import glider_stream", "from glider_stream import planner"]
    lines += [*(f"reveal_type({expression})" for expression in ASKED), WRONG]
    program = tmp_path_factory.mktemp("user") / "program.py"
    program.write_text("\n".join(lines) + "\n")
    mypy = [sys.executable, "-m", "mypy", "glider_stream", str(program)]
    return lines, subprocess.run(mypy, capture_output=True, text=True, check=False, cwd=ROOT).stdout


@pytest.fixture(scope="module")
def seen(checked):
    """Each line of the program, and what mypy says of it."""
    lines, printed = checked
    said = re.findall(r"program\.py:(\d+): (.*)$", printed, re.MULTILINE)
    by_line = {lines[int(number) - 1]: text for number, text in said if " defined in " not in text}
    return {expression: by_line[f"reveal_type({expression})"] for expression in ASKED} | {WRONG: by_line[WRONG]}


def test_the_package_has_no_error(checked):
    assert [line for line in checked[1].splitlines() if "program.py:" not in line][:-1] == []
    assert "Found 1 error in 1 file" in checked[1]


@pytest.mark.parametrize("name", glider_stream.__all__)
def test_every_public_name_has_a_type(seen, name):
    assert 'Revealed type is "' in seen[f"glider_stream.{name}"]
    assert '"Any"' not in seen[f"glider_stream.{name}"]


@pytest.mark.parametrize(("expression", "kind"), EXPRESSIONS.items())
def test_results_have_types(seen, expression, kind):
    assert f'Revealed type is "{kind}' in seen[expression].replace("builtins.", "")


def test_a_wrong_keyword_is_seen(seen):
    assert 'Unexpected keyword argument "wrong"' in seen[WRONG]
