"""What a type checker sees of the package: the types that a user's program gets, none of them `Any`."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import glider_stream

pytestmark = pytest.mark.slow

EXPRESSIONS = {
    "glider_stream.read_roadmap('small.h5')": "glider_stream.roadmap.roadmap.Roadmap",
    "planner.build('seed-box')": "glider_stream.roadmap.roadmap.Roadmap",
    "planner.query('small.h5')": "glider_stream.search.path.Path",
    "planner.query('small.h5').legs[0].depart": "float",
    "planner.table('small.h5', [(0.0, 0.0, 0.0)], [(1.0, 1.0, -1.0)])": "numpy.ndarray[",
}
WRONG = "planner.query('small.h5', wrong=1)"


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """Each line of a user's program, and what mypy says of it."""
    folder = tmp_path_factory.mktemp("user")
    names = [f"glider_stream.{name}" for name in glider_stream.__all__]
    asked = [*names, *EXPRESSIONS]
    lines = ["import glider_stream", "from glider_stream import planner"]
    lines += [*(f"reveal_type({expression})" for expression in asked), WRONG]
    program = folder / "program.py"
    program.write_text("\n".join(lines) + "\n")
    options = "--strict", "--follow-imports=silent", "--cache-dir", str(folder / "cache")
    ended = subprocess.run(
        [sys.executable, "-m", "mypy", *options, str(program)],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env=os.environ | {"MYPYPATH": str(Path(glider_stream.__file__).parents[1])},
    )
    said = re.findall(r"^program.py:(\d+): (.*)$", ended.stdout, re.MULTILINE)
    by_line = {lines[int(number) - 1]: text for number, text in said if " defined in " not in text}
    return {expression: by_line[f"reveal_type({expression})"] for expression in asked} | {WRONG: by_line[WRONG]}


@pytest.mark.parametrize("name", glider_stream.__all__)
def test_every_public_name_has_a_type(seen, name):
    assert 'Revealed type is "' in seen[f"glider_stream.{name}"]
    assert '"Any"' not in seen[f"glider_stream.{name}"]


@pytest.mark.parametrize(("expression", "kind"), EXPRESSIONS.items())
def test_results_have_types(seen, expression, kind):
    assert f'Revealed type is "{kind}' in seen[expression].replace("builtins.", "")


def test_a_wrong_keyword_is_seen(seen):
    assert 'Unexpected keyword argument "wrong"' in seen[WRONG]
