"""The floors of the house: a module imports only from below, the kernels know nothing above themselves."""

import ast
import graphlib
import subprocess
import sys
from pathlib import Path

import glider_stream

PACKAGE = Path(glider_stream.__file__).parent
FLOORS = {
    1: "kernels",
    2: "base",
    3: "water vehicle",
    4: "roadmap",
    5: "scenario search jobs",
    6: "plot pilot evaluation mission",
    7: "opened simulated confident planner cli __main__",
}
FLOOR_OF = {name: floor for floor, names in FLOORS.items() for name in names.split()}
DOORS = {
    ("planner", "opened"),
    ("planner", "simulated"),
    ("planner", "confident"),
    ("cli", "planner"),
    ("cli", "opened"),
    ("__main__", "cli"),
}
"""On their own floor, the command line calls the planner, which opens roadmaps and simulates missions."""


def module_name(path):
    """The name below `glider_stream`; that of a package's `__init__` is the package's."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


# in a checkout the kernels are a link, which rglob does not follow
SOURCES = [*PACKAGE.rglob("*.py"), *(PACKAGE / "kernels").rglob("*.py")]
MODULES = {module_name(path): path for path in SOURCES if path != PACKAGE / "__init__.py"}


def row_of(name):
    """The row of the table that a module belongs to: its package, or itself beside the packages."""
    return name.split(".")[0]


def imported(name, path):
    """Modules of this package that a module imports, anywhere in it; names as in MODULES."""
    here = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            roots = [alias.name for alias in node.names if alias.name.split(".")[0] == "glider_stream"]
            found |= {root.removeprefix("glider_stream").lstrip(".") for root in roots}
        if not isinstance(node, ast.ImportFrom):
            continue
        module = node.module or ""
        if node.level:
            base = [*here[: len(here) - (node.level - 1)], *(module.split(".") if module else [])]
        elif module.split(".")[0] == "glider_stream":
            base = module.split(".")[1:]
        else:
            continue
        for alias in node.names:
            whole = ".".join([*base, alias.name])
            found.add(whole if whole in MODULES else ".".join(base))
    return found - {""}


IMPORTS = {name: imported(name, path) for name, path in MODULES.items()}


def test_every_room_has_a_floor():
    rooms = {row_of(name) for name in MODULES} - {"data"}
    assert rooms == set(FLOOR_OF), f"rooms without a floor, or floors without a room: {rooms ^ set(FLOOR_OF)}"


def test_the_walk_sees_what_is_imported():
    assert {"kernels.flow", "kernels.edges", "base.settings"} <= IMPORTS["roadmap.evaluator"]
    assert "water.frame" in IMPORTS["water.domain"]  # within a function
    assert IMPORTS["kernels.control"] == {"kernels.cache", "kernels.flow", "kernels.stream"}
    assert "planner" in IMPORTS["cli.roadmaps"]
    assert "kernels.cache" in IMPORTS["plot.water"]
    assert sum(map(len, IMPORTS.values())) > 60


def test_rooms_import_only_from_lower_floors():
    for name, others in IMPORTS.items():
        for other in others:
            here, there = row_of(name), row_of(other)
            assert there in FLOOR_OF, f"{name} imports {other}"
            lower = here == there or FLOOR_OF[there] < FLOOR_OF[here] or (here, there) in DOORS
            assert lower, f"{name} imports {other}, which is not on a lower floor"


def test_imports_have_no_circle():
    graphlib.TopologicalSorter(IMPORTS).prepare()


def test_kernels_import_only_relatively_and_only_kernels():
    for name, path in MODULES.items():
        if not name.startswith("kernels"):
            continue
        assert all(other.startswith("kernels.") for other in IMPORTS[name]), name
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom):
                assert node.level <= 1, f"{name} reaches above the kernels"
                assert (node.module or "").split(".")[0] not in (
                    "glider_stream",
                    "kernels",
                ) or node.level == 1
            if isinstance(node, ast.Import):
                roots = {alias.name.split(".")[0] for alias in node.names}
                assert not roots & {"glider_stream", "kernels"}, name


def test_only_the_store_and_what_guards_it_know_h5py():
    for name, path in MODULES.items():
        heavy = {
            alias.name.split(".")[0] if isinstance(node, ast.Import) else (node.module or "").split(".")[0]
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, (ast.Import, ast.ImportFrom)) and not getattr(node, "level", 0)
            for alias in node.names
        }
        assert "h5py" not in heavy or name in ("roadmap.store", "base.untrusted", "mission.tracks"), name


def test_the_command_line_starts_without_anything_heavy():
    program = (
        "import sys, glider_stream.cli; print(sorted({'numpy', 'numba', 'scipy', 'h5py'} & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert out.stdout.strip() == "[]"
