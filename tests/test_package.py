"""The package as it is shipped, checked and documented."""

import importlib.metadata
import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from helpers.small import command

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
FENCE = re.compile(r"^```(python|sh|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ELSEWHERE = {"pip", "git", "cd", "copernicusmarine"}
"""Programs whose lines are taken on trust."""


def run(*arguments, **options):
    ended = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, check=False, **{"cwd": ROOT, **options}
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


# what is shipped


def test_every_folder_of_code_is_a_package_that_is_shipped():
    folders = {
        ".".join(Path(folder).relative_to(ROOT).parts)
        for folder, _, names in os.walk(ROOT / "glider_stream", followlinks=True)
        if any(name.endswith((".py", ".toml")) for name in names)
    }
    assert folders == set(PROJECT["tool"]["setuptools"]["packages"])


INSTALLED = """
import importlib.resources, pkgutil
import glider_stream, glider_stream.kernels, glider_stream.plot
for package in (glider_stream, glider_stream.kernels, glider_stream.plot):
    for module in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
        __import__(module.name)
assert importlib.resources.files("glider_stream").joinpath("py.typed").is_file()
assert importlib.resources.files("glider_stream.data").joinpath("seed-box.toml").is_file()
print(*glider_stream.shipped_scenarios())
"""


def test_the_installed_package_is_whole(tmp_path):
    names = run("-P", "-c", INSTALLED, cwd=tmp_path).split()
    assert names == sorted(path.stem for path in (ROOT / "data").glob("*.toml"))


def test_the_installed_metadata():
    said = importlib.metadata.metadata("glider-stream")
    assert said["Version"] == PROJECT["project"]["version"]
    assert said["Requires-Python"] == PROJECT["project"]["requires-python"]
    scripts = importlib.metadata.entry_points(group="console_scripts")
    assert scripts["glider-stream"].value == PROJECT["project"]["scripts"]["glider-stream"]


def test_the_wheel_is_whole(tmp_path):
    """Built without the network where setuptools is at hand, else with what pip fetches for it."""
    copy = tmp_path / "source"
    unneeded = shutil.ignore_patterns(".*", "*.egg-info", "__pycache__", "build")
    shutil.copytree(ROOT, copy, symlinks=True, ignore=unneeded)
    at_hand = [] if importlib.util.find_spec("setuptools") is None else ["--no-build-isolation"]
    run("-m", "pip", "wheel", "-q", "--no-deps", *at_hand, "-w", tmp_path, copy, cwd=tmp_path)
    (wheel,) = tmp_path.glob("*.whl")
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    folders = {"glider_stream/kernels": "kernels", "glider_stream/data": "data"}
    wanted = {f"{inside}/{p.name}" for inside, at in folders.items() for p in (ROOT / at).glob("*.[pt][yo]*")}
    wanted |= {str(p.relative_to(ROOT)) for p in (ROOT / "glider_stream").glob("**/*.py")}
    wanted |= {str(p.relative_to(ROOT)) for p in (ROOT / "glider_stream" / "plot").glob("page*.[hcj]*")}
    assert held == wanted | {"glider_stream/py.typed", "glider_stream/data/references.json"}


# what is checked


def test_ruff():
    run("-m", "ruff", "check", "--output-format=concise", ".")


def test_ruff_format():
    run("-m", "ruff", "format", "--check", ".")


def test_mypy():
    run("-m", "mypy")


# what is documented


def documents():
    return [path for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))) if path.exists()]


def blocks(text):
    """Language and text of each fenced block of code that can be run."""
    return FENCE.findall(text)


def shell_lines(block, language):
    """The commands of a block: continued lines joined; of a console's block only what follows a prompt."""
    lines = block.replace("\\\n", " ").splitlines()
    if language == "console":
        lines = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
    commands = [shlex.split(line, comments=True) for line in lines]
    return [words for words in commands if words]


def targets(makefile):
    """The targets of a Makefile."""
    return set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))


def test_blocks_are_found():
    text = "a\n```python\nx = 1\n```\n```\nno\n```\n"
    text += "```sh\n# why\nglider-stream info a.h5 \\\n  --json # b\n```\n"
    text += "```console\n$ make test\nok\n```\n"
    found = blocks(text)
    assert [language for language, _ in found] == ["python", "sh", "console"]
    assert shell_lines(found[1][1], "sh") == [["glider-stream", "info", "a.h5", "--json"]]
    assert shell_lines(found[2][1], "console") == [["make", "test"]]
    assert targets("a: b\n\tc: d\ntest-all:\nX := 3\n") == {"a", "test-all"}


@pytest.mark.parametrize("document", documents(), ids=lambda path: path.name)
def test_the_documents_run(document, tmp_path, monkeypatch, capsys):
    """All blocks of a document, one after the other, in one folder."""
    monkeypatch.chdir(tmp_path)
    for language, block in blocks(document.read_text()):
        if language == "python":
            exec(compile(block, document.name, "exec"), {"__name__": "__main__"})
            continue
        for program, *arguments in shell_lines(block, language):
            if program == "glider-stream":
                said = command(capsys, *arguments)
                assert said.code == 0, f"{program} {arguments}: {said.err}"
            elif program == "make":
                assert set(arguments) <= targets((ROOT / "Makefile").read_text())
            else:
                assert program in ELSEWHERE, f"nobody checks {program} {arguments}"
