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
from helpers.ionian import write_ionian
from helpers.small import command

import glider_stream
from glider_stream.roadmap.store import VERSION

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
FENCE = re.compile(r"^```(python|sh|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ELSEWHERE = {"pip", "git", "cd", "copernicusmarine", "python3", "."}
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
    assert glider_stream.__version__ == said["Version"] == PROJECT["project"]["version"]
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
    wanted |= {f"glider_stream/data/missions/{p.name}" for p in (ROOT / "data" / "missions").glob("*.toml")}
    wanted |= {str(p.relative_to(ROOT)) for p in (ROOT / "glider_stream").glob("**/*.py")}
    wanted |= {str(p.relative_to(ROOT)) for p in (ROOT / "glider_stream" / "plot").glob("page*.[hcj]*")}
    assert held == wanted | {"glider_stream/py.typed", "glider_stream/data/references.json"}


# what is checked


def test_ruff():
    run("-m", "ruff", "check", "--output-format=concise", ".")


def test_ruff_format():
    run("-m", "ruff", "format", "--check", ".")


def test_ruff_is_pinned_to_what_runs():
    """Another version formats otherwise: the pin, the hooks and the checks must be one."""
    pins = [need for need in PROJECT["project"]["optional-dependencies"]["test"] if need.startswith("ruff")]
    assert pins == [f"ruff=={importlib.metadata.version('ruff')}"]
    hooks = (ROOT / ".pre-commit-config.yaml").read_text()
    assert re.findall(r"entry: python -m (\w+)", hooks) == ["ruff", "ruff", "mypy"]


def test_the_workflow_calls_targets_and_supported_versions():
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text()
    assert set(re.findall(r"run: make (\S+)", workflow)) == {"lint", "types", "docs", "test", "nightly"}
    assert set(re.findall(r"run: make (\S+)", workflow)) <= targets((ROOT / "Makefile").read_text())
    (tested,) = re.findall(r"python: \[(.*)\]", workflow)
    stated = [c.rsplit(" ", 1)[1] for c in PROJECT["project"]["classifiers"] if "Python :: 3." in c]
    assert [version.strip('"') for version in tested.split(", ")] == stated
    assert PROJECT["project"]["requires-python"] == f">={stated[0]}"


# what is documented


def documents():
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text().split()) <= 600


def test_links_lead_to_files():
    for document in (*documents(), ROOT / "CHANGELOG.md"):
        for link in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", document.read_text()):
            if "://" not in link:
                assert (document.parent / link).exists(), f"{document.name}: {link}"


def test_readme_lists_all_documents():
    readme = (ROOT / "README.md").read_text()
    for page in (ROOT / "docs").glob("*.md"):
        assert page.name == "index.md" or f"](docs/{page.name})" in readme, page.name


def test_the_reference_has_all_that_is_public():
    shown = {
        name.rsplit(".", 1)[1] for name in re.findall(r"^::: (\S+)", (ROOT / "docs/api.md").read_text(), re.M)
    }
    assert shown == {"planner", *glider_stream.__all__} - {"__version__"}


def test_the_changelog_names_this_version_and_the_roadmap_format():
    text = (ROOT / "CHANGELOG.md").read_text()
    newest = text.split("\n## ")[1]
    assert newest.startswith(("[Unreleased]", f"[{glider_stream.__version__}]"))
    assert f"Roadmap format {VERSION}." in newest


def test_the_site_is_built_without_a_warning(tmp_path):
    run("-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", tmp_path / "site")
    page = (tmp_path / "site" / "api" / "index.html").read_text()
    for name in ("build", "query", "table", "plot_routes"):
        assert f'id="glider_stream.planner.{name}"' in page
    for name in set(glider_stream.__all__) - {"__version__"}:
        assert re.search(rf'id="glider_stream\.[\w.]*{name}"', page), name


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
    if "currents.nc" in document.read_text():
        write_ionian(tmp_path / "currents.nc")
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
