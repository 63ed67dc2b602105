"""Unusable input: exit code 2, one sentence that names what was given and what to do, no file touched."""

import math
import os
import resource
import subprocess
from pathlib import Path

import h5py
import pytest
from helpers.small import SCENARIO, command, executable, roadmap, scenario_file

from glider_stream.roadmap.store import write_roadmap

OLD = b"what was here before"


@pytest.fixture(scope="module")
def roadmap_bytes(tmp_path_factory):
    path = tmp_path_factory.mktemp("roadmap") / "road.h5"
    write_roadmap(roadmap(), path)
    return path.read_bytes()


@pytest.fixture
def place(tmp_path, monkeypatch, roadmap_bytes):
    """A folder with a scenario, a roadmap, and outputs of an earlier run."""
    scenario_file(tmp_path)
    (tmp_path / "road.h5").write_bytes(roadmap_bytes)
    (tmp_path / "folder").mkdir()
    for name in ("out.h5", "path.json", "figure.png"):
        (tmp_path / name).write_bytes(OLD)
        os.utime(tmp_path / name, ns=(10**18, 10**18))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def everything(folder):
    """All files below a folder: bytes and time of change."""
    return {p: (p.read_bytes(), p.stat().st_mtime_ns) for p in folder.rglob("*") if p.is_file()}


def assert_refused(said, *names):
    code, out, err = said
    assert code == 2, err
    assert out == ""
    assert "Traceback" not in err
    assert err.startswith("glider-stream: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1, err
    for name in names:
        assert name in err


def refused(capsys, folder, arguments, *names):
    before = everything(folder)
    assert_refused(command(capsys, *arguments), *names)
    assert everything(folder) == before


BUILD = ("build", "small.toml", "-o", "out.h5")
QUERY = ("query", "road.h5", "-o", "path.json")

# a part of the scenario, what stands there instead, and what the sentence must name
SCENARIOS = {
    "no TOML": ("[flow]", "[flow", "small.toml", "TOML", "line 1"),
    "a value without quotes": ('"vortices"', "vortices", "small.toml", "TOML", "line 2"),
    "a key twice": ("k = 20", "k = 20\nk = 21", "small.toml", "TOML"),
    "an endless number": ("k = 20", "k = " + "9" * 5000, "small.toml", "TOML"),
    "nested without end": ("k = 20", "k = " + "[" * 5000, "small.toml", "TOML"),
    "unknown section": ("[cost]", "[costs]", "`costs`", "choose from: flow, terrain, glider"),
    "no cost": ('[cost]\nkind = "time"', "", "[cost] is missing; add it"),
    "a value before all sections": ("[flow]", "cost = 3\n[flow]", "small.toml", "TOML"),
    "unknown key": (
        "dt = 5.0",
        "dt = 5.0\nstep = 1",
        "`integration.step`",
        "choose from: dt, steps, tolerance",
    ),
    "unknown key of a vortex": ("y = -30.0", "y = -30.0\nz = 1.0", "vortex.z`", "from: depth, drift, radius"),
    "unknown flow": ('"vortices"', '"whirl"', "'whirl'", "choose from: abc, convection-cells, double-gyre"),
    "a kind that is a number": ('"vortices"', "7", "= 7 is not known", "choose from"),
    "a kind that is a list": ('"nearest"', '["nearest"]', "['nearest']", "choose from"),
    "unknown sampler": ('"grid"', '"gird"', "'gird'", "choose from: grid, halton"),
    "unknown law": ('"nearest"', '"next"', "'next'", "choose from: all, nearest"),
    "unknown method": ('"streamline"', '"steam"', "'steam'", "streamline, surface"),
    "unknown cost": ('"time"', '"money"', "'money'", "choose from"),
    "unknown preset": ('"paper"', '"papier"', "'papier'", "choose from: paper, slocum"),
    "missing key": ("candidates = 24\n", "", "`steering.candidates` is missing", "a whole number"),
    "missing kind": ('kind = "nearest"\n', "", "`neighbours.kind` is missing", "choose from"),
    "missing section": ('[glider]\npreset = "paper"\n', "", "[glider] is missing; add it"),
    "missing goal": ("goal = [160.0, -160.0, 0.0]\n", "", "`query.goal` is missing", "a list of 3"),
    "a text for a number": ("dt = 5.0", 'dt = "5"', "`integration.dt` must be a finite number; got '5'"),
    "a float for a count": ("steps = 125", "steps = 125.0", "must be a whole number; got 125.0"),
    "true for a number": ("dt = 5.0", "dt = true", "`integration.dt` must be a finite number; got True"),
    "true for a count": ("k = 20", "k = true", '`neighbours.k` must be a whole number or "prm*"; got True'),
    "a date for a number": ("dt = 5.0", "dt = 2020-01-01", "`integration.dt` must be a finite number"),
    "a point of two": (
        "[160.0, -160.0, 0.0]",
        "[160.0, -160.0]",
        "`query.goal` must be a list of 3",
        "[160.0, -160.0]",
    ),
    "a number for a list": (
        "shape = [5, 5, 3]",
        "shape = 5",
        "`sampling.shape` must be a list of 3",
        "got 5",
    ),
    "NaN": ("dt = 5.0", "dt = nan", "`integration.dt` must be a finite number; got nan"),
    "infinity": (
        "tolerance = 8.0",
        "tolerance = inf",
        "`integration.tolerance` must be a finite number; got inf",
    ),
    "minus infinity": (
        "x = [-200.0, 200.0]",
        "x = [-inf, 200.0]",
        "`domain.x` must be a finite number; got -inf",
    ),
    "a horizon beyond all": ("dt = 5.0", "dt = 1e8", "`steps` must be at most 1e+09 s", "got 1.25e+10"),
    "a tolerance beyond all": ("tolerance = 8.0", "tolerance = 1e300", "1e+09 m at most; got 1e+300"),
    "a departure beyond all": ("[query]", "[query]\ndeparture = -1e300", "within 1e+09 s of 0; got -1e+300"),
    "a current beyond all": ("speed = 0.4", "speed = 1e300", "at most 100 m/s", "mend [flow]"),
    "a domain beyond all": ("x = [-200.0, 200.0]", "x = [-1e308, 1e308]", "`domain.x` must span 1e+09 at most"),
    "NaN in a vortex": ("x = 20.0", "x = nan", "vortex.x` must be a finite number; got nan"),
    "NaN in the start": ("[-190.0, 190.0, 0.0]", "[nan, 190.0, 0.0]", "`query.start` must be", "got nan"),
    "a number too large for a float": (
        "dt = 5.0",
        "dt = 1" + "0" * 400,
        "`integration.dt` must be a finite number",
    ),
    "a count too large": ("steps = 125", "steps = 1" + "0" * 30, "`integration.steps` must be at most 2^53"),
    "reversed range": ("z = [-150.0, 0.0]", "z = [0.0, -150.0]", "`domain.z` must rise; got [0, -150]"),
    "empty range": ("y = [-200.0, 200.0]", "y = [5.0, 5.0]", "`domain.y` must rise; got [5, 5]"),
    "reversed flow": ("x = [-600.0, 600.0]", "x = [600.0, -600.0]", "`flow.x` must rise; got [600, -600]"),
    "a domain in the air": (
        "z = [-150.0, 0.0]",
        "z = [-150.0, 9.0]",
        "`domain.z` must end at 0 (the surface) or below",
        "got 9",
    ),
    "no candidate": (
        "candidates = 24",
        "candidates = 0",
        "`steering.candidates` must be from 1 to 1,000,000; got 0",
    ),
    "no neighbour": ("k = 20", "k = 0", "`neighbours.k` must be at least 1", "got 0"),
    "less than no neighbour": ("k = 20", "k = -3", "`neighbours.k` must be at least 1", "got -3"),
    "another star": ("k = 20", 'k = "prm"', "`neighbours.k` must be a whole number or \"prm*\"; got 'prm'"),
    "no step": ("steps = 125", "steps = 0", "`integration.steps` must be at least 1; got 0"),
    "time stands still": ("dt = 5.0", "dt = 0.0", "`integration.dt` must be above 0 s; got 0"),
    "time runs back": ("dt = 5.0", "dt = -5.0", "`integration.dt` must be above 0 s; got -5"),
    "no tolerance": ("tolerance = 8.0", "tolerance = 0", "`integration.tolerance` must be above 0 m; got 0"),
    "no node": ("shape = [5, 5, 3]", "shape = [5, 0, 3]", "`sampling.shape` must be at least 1", "[5, 0, 3]"),
    "no radius": ("radius = 150.0", "radius = 0.0", "radius` must be above 0; got 0"),
    "samples nowhere": (
        "sampled = [50.0, 50.0, 50.0]",
        "sampled = [0, 5, 5]",
        "`flow.sampled` must be above 0; got 0",
    ),
    "samples everywhere": (
        "sampled = [50.0, 50.0, 50.0]",
        "sampled = [1e-3, 1e-3, 1e-3]",
        "[0.001, 0.001, 0.001]",
        "widen",
    ),
    "angles too flat": ('"paper"', '"paper"\nangles = [2.0, 45.0]', "`glider.angles`", "got [2.0, 45.0]"),
    "angles too steep": ('"paper"', '"paper"\nangles = [15.0, 95.0]', "`glider.angles`", "got [15.0, 95.0]"),
    "too heavy to climb": ('"paper"', '"paper"\noffset = -0.1', "-0.1 kg", "`glider.offset`"),
    "too light to dive": ('"paper"', '"paper"\noffset = 9.0', "9.0 kg", "`glider.ballast_max`"),
    "no gravity": ('"paper"', '"paper"\ngravity = 0.0', "`glider.gravity` must be greater than 0; got 0.0"),
    "start above the surface": (
        "[-190.0, 190.0, 0.0]",
        "[-190.0, 190.0, 5.0]",
        "[-190, 190, 5]",
        "above the surface",
    ),
    "start outside the flow": (
        "[-190.0, 190.0, 0.0]",
        "[-700.0, 190.0, 0.0]",
        "`query.start` = [-700, 190, 0]",
        "move",
    ),
    "goal outside the flow": (
        "[160.0, -160.0, 0.0]",
        "[160.0, 9e9, 0.0]",
        "`query.goal` = [160, 9e+09, 0]",
        "move",
    ),
    "no water": (SCENARIO[SCENARIO.index("[domain]") :], "", "[domain] is missing; add it"),
}


@pytest.mark.parametrize("case", SCENARIOS)
def test_scenarios(capsys, place, case):
    old, new, *names = SCENARIOS[case]
    assert old in SCENARIO
    (place / "small.toml").write_text(SCENARIO.replace(old, new, 1))
    refused(capsys, place, BUILD, *names)


SETS = {
    "no value": ("neighbours.k", "section.key=value; got 'neighbours.k'"),
    "no section": ("k=5", "section.key=value; got 'k=5'"),
    "no key": ("neighbours.=5", "section.key=value; got 'neighbours.=5'"),
    "nothing": ("", "section.key=value; got ''"),
    "two lines": ("neighbours.k=5\nflow.x=3", "section.key=value; got 'neighbours.k=5\\nflow.x=3'"),
    "a key below a value": ("neighbours.k.l=5", "`k` is not a section; got 'neighbours.k.l=5'"),
    "a key below a list": ("flow.vortex.x=5", "`vortex` is not a section"),
    "an unknown section": ("sea.k=5", "the section `sea` is not known; choose from: flow"),
    "an unknown key": ("neighbours.kk=5", "`neighbours.kk` is not known; choose from: k"),
    "an empty value": ("neighbours.k=", "`neighbours.k` must be", "got ''"),
    "half a list": ("sampling.shape=[5,5", "`sampling.shape` must be a list of 3", "got '[5,5'"),
    "NaN": ("integration.dt=nan", "`integration.dt` must be a finite number; got nan"),
    "a key that goes with another kind": ("neighbours.radius=5", "`neighbours.radius` is not known"),
    "a kind that lacks several keys": (
        "flow.kind=upwelling",
        "`flow.u`, `flow.v`, `flow.w` are missing",
        "in the form --set flow.u=NUMBER --set flow.v=NUMBER --set flow.w=NUMBER",
    ),
    "a kind that lacks its keys": ("sampling.kind=sobol", "`sampling.count`, `sampling.seed` are missing"),
    "a whole section": ("sampling={kind='sobol'}", "section.key=value"),
    "more than any memory": (
        "sampling.shape=[9000000000,90000000,9]",
        "7,290,000,000,000,000,000 nodes",
        "take at most 10,000,000",
    ),
    "a file for a flow that has none": ("flow.file=a.nc", "`flow.file` is not known"),
}


@pytest.mark.parametrize("case", SETS)
def test_overrides(capsys, place, case):
    override, *names = SETS[case]
    refused(capsys, place, (*BUILD, "--set", override), *names)


COMMANDS = {
    "no command": ((), "Missing command", "--help"),
    "unknown command": (("bild",), "'bild'", "--help"),
    "unknown option": ((*BUILD, "--thread", "2"), "--thread", "glider-stream build --help"),
    "an argument too many": ((*BUILD, "more"), "more", "--help"),
    "no scenario": (("build", "-o", "out.h5"), "SCENARIO", "--help"),
    "no output": (("build", "small.toml"), "'-o'", "--help"),
    "missing scenario": (("build", "none.toml", "-o", "out.h5"), "none.toml", "seed-box"),
    "a folder as scenario": (("build", "folder", "-o", "out.h5"), "folder", "seed-box"),
    "a roadmap as scenario": (("build", "road.h5", "-o", "out.h5"), "road.h5 is not UTF-8 text", "save"),
    "a folder as output": (("build", "small.toml", "-o", "folder"), "folder is a folder; name a file"),
    "a missing folder": (("build", "small.toml", "-o", "none/out.h5"), "none does not exist; make it"),
    "a folder where none can write": (
        ("build", "small.toml", "-o", "/proc/out.h5"),
        "/proc/out.h5",
        "name another",
    ),
    "a device as output": (("build", "small.toml", "-o", "/dev/null"), "/dev/null", "name another"),
    "the scenario as output": (
        ("build", "small.toml", "-o", "folder/../small.toml"),
        "is the scenario itself",
    ),
    "no thread": ((*BUILD, "--threads", "0"), "`threads` must be from 1 to", "got 0"),
    "too many threads": ((*BUILD, "--threads", "100000"), "`threads` must be from 1 to", "got 100000"),
    "threads in words": ((*BUILD, "--threads", "two"), "'two'", "--help"),
    "missing roadmap": (("query", "none.h5"), "none.h5 does not exist; build it"),
    "a text as roadmap": (("query", "small.toml"), "small.toml", "build it again"),
    "a folder as roadmap": (("info", "folder", "--json"), "folder", "is a directory"),
    "a start in words": ((*QUERY, "--start", "here"), "--start", "'here'", "100,-50,-20"),
    "a start of two": ((*QUERY, "--start", "1,2"), "--start", "'1,2'", "100,-50,-20"),
    "a start of four": ((*QUERY, "--start", "1,2,-3,4"), "--start", "'1,2,-3,4'", "100,-50,-20"),
    "an empty start": ((*QUERY, "--start", ""), "--start", "''"),
    "a start at NaN": (
        (*QUERY, "--start", "nan,0,0"),
        "`start` must be three finite numbers; got [nan, 0, 0]",
    ),
    "a goal at infinity": (
        (*QUERY, "--goal", "0,inf,0"),
        "`goal` must be three finite numbers; got [0, inf, 0]",
    ),
    "a goal above the surface": ((*QUERY, "--goal", "0,0,20"), "`goal` = [0, 0, 20] lies above the surface"),
    "a start outside the flow": ((*QUERY, "--start", "1e4,0,0"), "`start` = [10000, 0, 0]", "move it"),
    "a goal below the domain": ((*QUERY, "--goal", "0,0,-151"), "below the domain", "z = -150 m", "move it up"),
    "a map in the air": (("plot", "road.h5", "-o", "figure.png", "--depth", "-1"), "0 m to 150 m", "got -1"),
    "a map below all": (("plot", "road.h5", "-o", "figure.png", "--depth", "1e9"), "0 m to 150 m", "got 1e+09"),
    "a map at no depth": (("plot", "road.h5", "-o", "figure.png", "--depth", "nan"), "0 m to 150 m", "got nan"),
    "two maps of a roadmap": (
        ("plot", "road.h5", "-o", "figure.png", "--depth", "0", "--depth", "9"),
        "drawn at one depth; got (0.0, 9.0)",
    ),
    "a figure in no folder": (("plot", "road.h5", "-o", "none/figure.png"), "none does not exist; make it"),
    "unknown ending": (
        ("query", "road.h5", "-o", "path.xyz"),
        "path.xyz must end in one of: .json",
        "'.xyz'",
    ),
    "no ending": (("query", "road.h5", "-o", "path"), "path must end in one of: .json", "'no ending'"),
    "one good output, one bad": ((*QUERY, "-o", "none/path.json"), "none does not exist; make it"),
    "a folder as route": (("query", "road.h5", "-o", "folder.json"), "folder.json is a folder; name a file"),
    "a figure of no kind": (
        ("plot", "road.h5", "-o", "figure.xyz"),
        "figure.xyz must end in one of",
        "'.xyz'",
    ),
    "a path that is none": (
        ("plot", "road.h5", "small.toml", "-o", "figure.png"),
        "small.toml",
        "`query -o`",
    ),
    "a missing path": (("plot", "road.h5", "none.json", "-o", "figure.png"), "none.json", "`query -o`"),
    "a text as currents": (("describe", "text.nc"), "text.nc is not a NetCDF file"),
    "missing currents": (("describe", "none.nc"), "none.nc does not exist"),
}


@pytest.mark.parametrize("case", COMMANDS)
def test_commands(capsys, place, case):
    arguments, *names = COMMANDS[case]
    (place / "folder.json").mkdir()
    (place / "text.nc").write_text("no currents here\n")
    refused(capsys, place, arguments, *names)


PATH = (
    '{"found": true, "cost": 1, "legs": [{"from": [0, 0, 0], "to": [0, 0, -1], "glide_angle_rad": -0.5, '
    '"heading_rad": 0, "speed_mps": 1, "depart_s": 0, "duration_s": %s, "miss_m": 0, "trajectory": %s}]}'
)
ORIGIN = ', "origin": {"departure_s": 0.0, "scenario": ""}}'
PATHS = {
    "no JSON": "no JSON",
    "a list": "[]",
    "no legs": '{"found": false, "travel_time_s": null, "cost": null, "legs": []}',
    "legs of text": '{"found": true, "cost": 1, "legs": ["leg"]}',
    "brackets without end": "[" * 100_000,
    "NaN on the way": PATH % ("NaN", "[[0, 0, 0, 0], [1, 0, 0, -1]]"),
    "infinity on the way": PATH % ("1", "[[0, 0, 0, 0], [1, 0, Infinity, -1]]"),
    "a number beyond all": PATH % ("1" + "0" * 400, "[[0, 0, 0, 0], [1, 0, 0, -1]]"),
    "no way at all": PATH % ("1", "[]"),
    "rows of three": PATH % ("1", "[[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]"),
    "back in time": PATH % ("1", "[[5, 0, 0, 0], [1, 0, 0, -1]]"),
    "no time at all": PATH % ("0", "[[0, 0, 0, 0], [0, 0, 0, -1]]"),
    "another water": PATH.removesuffix("}")
    .replace("[0, 0, 0]", "[0, 9999, 0]")
    .replace("[0, 0, -1]", "[0, 9999, -0.479]")
    % ("1", "[[0, 0, 9999, 0], [1, 0, 9999, -0.479]]")
    + ORIGIN,
    "legs that were not found": PATH.replace("true", "false") % ("1", "[[0, 0, 0, 0], [1, 0, 0, -1]]"),
    "a time below 0": PATH % ("-1", "[[0, 0, 0, 0], [1, 0, 0, -1]]"),
    "a leg from nowhere": '{"found": true, "cost": 1, "legs": [{"from": [1, 2], "to": [1, 2, 3]}]}',
}


@pytest.mark.parametrize("case", PATHS)
def test_path_files(capsys, place, case):
    (place / "bad.json").write_text(PATHS[case])
    what = "leaves the roadmap's water" if case == "another water" else "bad.json"
    cure = "found in" if case == "another water" else "`query -o`"
    refused(capsys, place, ("plot", "road.h5", "bad.json", "-o", "figure.png"), what, cure)


def test_a_text_for_currents_in_a_scenario(capsys, place):
    (place / "text.nc").write_text("no currents here\n")
    sets = [
        "flow.kind=netcdf",
        "flow.file=text.nc",
        "domain.lon=[1,2]",
        "domain.lat=[3,4]",
        "domain.depth=[0,9]",
    ]
    domain = "x = [-200.0, 200.0]\ny = [-200.0, 200.0]\nz = [-150.0, 0.0]\n"
    box = "x = [-600.0, 600.0]\ny = [-600.0, 600.0]\nsampled = [50.0, 50.0, 50.0]\n"
    text = SCENARIO.replace(domain, "").replace(box, "").split("[query]")[0]
    (place / "small.toml").write_text(text)
    overrides = [word for one in sets for word in ("--set", one)]
    refused(capsys, place, (*BUILD, *overrides), "text.nc is not a NetCDF file")


def test_a_scenario_that_is_not_utf8(capsys, place):
    (place / "small.toml").write_bytes(b"# \xff\n" + SCENARIO.encode())
    refused(capsys, place, BUILD, "small.toml is not UTF-8 text", "0xff", "save it")


def test_a_folder_that_may_not_be_written(capsys, place, monkeypatch):
    def deny(*arguments, **options):
        raise PermissionError(13, "Permission denied", str(place))

    monkeypatch.setattr("tempfile.TemporaryFile", deny)
    for arguments in (BUILD, QUERY):
        refused(capsys, place, arguments, arguments[-1], "Permission denied", "name another")


def test_links_that_lead_nowhere(capsys, place):
    (place / "loop").symlink_to("loop")
    refused(capsys, place, ("build", "loop", "-o", "out.h5"), "loop", "seed-box")
    refused(capsys, place, ("build", "small.toml", "-o", "loop"), "loop cannot be written", "name another")
    assert (place / "loop").is_symlink()


@pytest.mark.parametrize("room", [0, 3000, 40_000])
def test_a_full_disk(capsys, place, room):
    command(capsys, *BUILD[:2], "-o", "warm.h5")  # so that Numba has nothing to write
    before = everything(place)
    least, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, most))
    try:
        code, out, err = command(capsys, *BUILD)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (least, most))
    assert (code, out) == (2, "")
    assert "Traceback" not in err
    assert "the output out.h5 cannot be written whole: file too large; make room" in err.splitlines()[-1]
    assert everything(place) == before


# roadmaps


def change(attribute, value):
    def apply(path):
        with h5py.File(path, "r+") as file:
            file.attrs[attribute] = value

    return apply


def without(name):
    def apply(path):
        with h5py.File(path, "r+") as file:
            del file[name]

    return apply


def other_data(name, alter):
    def apply(path):
        with h5py.File(path, "r+") as file:
            data = alter(file[name][()])
            del file[name]
            file[name] = data

    return apply


def flip(name):
    def apply(path):
        with h5py.File(path) as file:
            at = file[name].id.get_chunk_info(0).byte_offset
        parts = bytearray(path.read_bytes())
        parts[at + 17] ^= 4
        path.write_bytes(parts)

    return apply


def cut(path):
    path.write_bytes(path.read_bytes()[:-5000])


def empty(path):
    path.write_bytes(b"")


def of_another_kind(path):
    with h5py.File(path, "w") as file:
        file["temperature"] = [1.0, 2.0]


def change_scenario(old, new):
    def apply(path):
        with h5py.File(path, "r+") as file:
            assert old in file.attrs["scenario"]
            file.attrs["scenario"] = file.attrs["scenario"].replace(old, new, 1)

    return apply


ROADMAPS = {
    "cut short": (cut, "cut short", "build it again"),
    "empty": (empty, "no HDF5 file", "build it again"),
    "of another kind": (of_another_kind, "its format is none", "`build`"),
    "of another format": (change("format", "glider-stream/path"), "'glider-stream/path'", "`build`"),
    "newer": (change("format_version", 3), "format version 3", "reads versions 1 and 2", "update the program"),
    "older": (change("format_version", 0), "format version 0", "reads versions 1 and 2", "build it again"),
    "no version": (change("format_version", "one"), "damaged"),
    "incomplete": (change("complete", False), "incomplete; build it again"),
    "without targets": (without("edges/target"), "no dataset edges/target", "build it again"),
    "without counts": (without("pairs"), "damaged"),
    "too few edges": (
        other_data("edges/miss", lambda data: data[:-1]),
        "do not fit each other",
        "build it again",
    ),
    "NaN for a time": (other_data("edges/time", lambda data: data * math.nan), "edges/time holds NaN"),
    "NaN for a heading": (other_data("edges/heading", lambda data: data * math.nan), "edges/heading holds NaN"),
    "a node nowhere": (other_data("nodes/position", lambda data: data * math.nan), "nodes/position holds NaN"),
    "a speed below 0": (other_data("edges/speed", lambda data: -data), "a speed below 0"),
    "targets twice": (other_data("edges/target", lambda data: data * 0), "targets do not rise"),
    "rows in floats": (other_data("edges/indptr", lambda data: data.astype(float)), "edges/indptr is float64"),
    "complete in words": (change("complete", "yes"), "incomplete; build it again"),
    "edges to nowhere": (
        other_data("edges/target", lambda data: data + 1000),
        "do not fit",
        "build it again",
    ),
    "a cost below 0": (other_data("edges/cost", lambda data: -data), "a cost below 0", "build it again"),
    "a text for times": (other_data("edges/time", lambda data: "soon"), "damaged"),
    **{
        f"a bit of {name}": (flip(name), "a checksum fails", "build it again")
        for name in (
            "nodes/position",
            "edges/indptr",
            "edges/target",
            "edges/time",
            "edges/cost",
            "edges/heading",
        )
    },
}


@pytest.mark.parametrize("arguments", [("info", "road.h5", "--json"), QUERY])
@pytest.mark.parametrize("case", ROADMAPS)
def test_roadmaps(capsys, place, case, arguments):
    spoil, *names = ROADMAPS[case]
    spoil(place / "road.h5")
    refused(capsys, place, arguments, "road.h5", *names)


CHANGED = {
    "another flow": (
        change_scenario("speed = 0.4", "speed = 0.5"),
        "the flow has changed",
        "build the roadmap again",
    ),
    "another text": (change_scenario("[flow]", "[flow"), "scenario is not valid TOML"),
    "another key": (change_scenario("dt =", "step ="), "`integration.step` is not known"),
}


@pytest.mark.parametrize("case", CHANGED)
def test_roadmaps_of_another_problem(capsys, place, case):
    spoil, *names = CHANGED[case]
    spoil(place / "road.h5")
    refused(capsys, place, QUERY, *names)


# through the installed command, as a user sees it


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (("build", "small.toml", "-o", "out.h5", "--set", "steering.candidates=0"), ("got 0",)),
        (("build", "none.toml", "-o", "out.h5"), ("none.toml",)),
        (("query", "cut.h5", "-o", "path.json"), ("cut.h5", "build it again")),
        (("query", "road.h5", "-o", "path.json", "--start", "0,0,20"), ("[0, 0, 20]", "above the surface")),
        (("info", "road.h5", "--jsn"), ("--jsn", "glider-stream info --help")),
    ],
)
def test_in_a_process_of_its_own(place, arguments, names):
    (place / "cut.h5").write_bytes((place / "road.h5").read_bytes()[:9000])
    before = everything(place)
    ended = subprocess.run([executable(), *arguments], capture_output=True, text=True, check=False)
    assert_refused((ended.returncode, ended.stdout, ended.stderr), *names)
    assert everything(place) == before


@pytest.mark.parametrize("threads", ["0", "-2", "two", ""])
def test_an_environment_that_numba_cannot_use(place, threads):
    said = run_with({"NUMBA_NUM_THREADS": threads}, "info", "road.h5")
    assert_refused(said, f"NUMBA_NUM_THREADS must be a whole number above 0; got {threads!r}")


@pytest.mark.slow
def test_standard_output_that_takes_nothing(place):
    with open("/dev/full", "w") as full:
        code, _, err = run_with({}, "info", "road.h5", stdout=full)
    assert_refused((code, "", err), "standard output cannot be used: no space left on device")
    reader, writer = os.pipe()
    os.close(reader)
    assert run_with({}, "info", "road.h5", stdout=writer) == (141, None, "")  # as a shell says of a broken pipe
    os.close(writer)


def run_with(environment, *arguments, stdout=subprocess.PIPE):
    process = subprocess.run(
        [executable(), *arguments],
        stdout=stdout,
        stderr=subprocess.PIPE,
        env={key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"} | environment,
        text=True,
        check=False,
    )
    return process.returncode, process.stdout, process.stderr


def test_there_are_enough_cases():
    assert len(SCENARIOS) + len(SETS) + len(COMMANDS) + len(ROADMAPS) + len(CHANGED) >= 45
    assert Path(executable()).is_file()
