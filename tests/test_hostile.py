"""Files that somebody has broken: a right answer or one sentence; never a crash, a hang, or all the memory.

Few examples here; many with `GLIDER_STREAM_EXAMPLES=400 pytest tests/test_hostile.py`.
"""

import json
import os
import resource
import shutil
import signal
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
from helpers.builds import interrupt, problem
from helpers.small import SCENARIO, roadmap, scenario_file
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as some

from glider_stream import planner
from glider_stream.base.errors import InputError, Stopped
from glider_stream.jobs.build import Job, Shard, build_file, merge
from glider_stream.pilot.route_files import read_drawn
from glider_stream.roadmap.store import read_part, read_roadmap, write_roadmap
from glider_stream.scenario import read_scenario
from glider_stream.search.path import load_path
from glider_stream.vehicle.calibration.calibrate import calibrate
from glider_stream.vehicle.calibration.dives import read_dives
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean.bathymetry import read_bathymetry
from glider_stream.water.terrain import read_polygons

pytestmark = pytest.mark.slow

xr = pytest.importorskip("xarray")

EXAMPLES = int(os.environ.get("GLIDER_STREAM_EXAMPLES", "25"))
SECONDS, BYTES = 10, 1_000_000_000
PARTS = [
    b"\x00" * 8,
    b"\xff" * 8,
    b"1e309",
    b"-1",
    b"999999999999",
    b"[" * 200,
    b'"',
    b"\n",
    b"nan",
    b"\x89HDF\r\n\x1a\n",
]


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A good file of each kind, small."""
    place = tmp_path_factory.mktemp("good")
    scenario_file(place)
    write_roadmap(roadmap(), place / "road.h5")
    build_file(problem(place), place / "part.h5", job=Job(shard=Shard(1, 1 + 1)))
    planner.query(place / "road.h5", outputs=[place / "path.json"])
    with pytest.raises(Stopped):
        build_file(problem(place), place / "kept.h5", progress=interrupt, batch_pairs=400)
    axes = {"lon": np.arange(5.0, 6.0, 0.1), "lat": np.arange(40.0, 41.0, 0.1), "depth": [0.0, 10.0, 50.0]}
    shape = [len(axis) for axis in axes.values()][::-1]
    u = 0.1 + 0.05 * np.random.default_rng(0).random(shape)
    dims = ("depth", "lat", "lon")
    data = xr.Dataset({"uo": (dims, u, {"units": "m/s"}), "vo": (dims, u, {"units": "m/s"})}, axes)
    data.to_netcdf(place / "four.nc", engine="h5netcdf")
    data.to_netcdf(place / "three.nc", engine="scipy")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        data.to_zarr(place / "store.zarr")
    height = xr.Dataset(
        {"elevation": (("lat", "lon"), -300 * u[0], {"units": "m"})}, {k: axes[k] for k in ("lon", "lat")}
    )
    height.to_netcdf(place / "chart.nc", engine="scipy")
    ring = [[5.2, 40.2], [5.4, 40.2], [5.4, 40.4], [5.2, 40.2]]
    (place / "zones.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    (place / "dives.csv").write_text("w,u\n0.1,0.2\n0.11,0.21\n0.12,0.19\n0.1,0.22\n")
    (place / "drawn.csv").write_text("lon,lat,depth\n5.1,40.1,0\n5.2,40.2,100\n5.3,40.3,0\n")
    (place / "drawn.gpx").write_text(
        '<gpx><rte><rtept lat="40.1" lon="5.1"/><rtept lat="40.2" lon="5.2"/></rte></gpx>'
    )
    line = "<coordinates>5.1,40.1,0 5.2,40.2,-100</coordinates>"
    (place / "drawn.kml").write_text(f"<kml><Placemark><LineString>{line}</LineString></Placemark></kml>")
    return place


def load_currents(path):
    planner.describe(path, at=[(5.5, 40.5, 5.0, None)])


def load_store(path):
    """One file of a Zarr store is what was broken."""
    store = path.parent / "store.zarr"
    shutil.rmtree(store, ignore_errors=True)
    shutil.copytree(path.parent.parent / "good" / "store.zarr", store)
    files = sorted(file for file in store.rglob("*") if file.is_file())
    shutil.copy(path, files[path.stat().st_size % len(files)])
    planner.describe(store, at=[(5.5, 40.5, 5.0, None)])


def load_journal(path):
    target = path.parent / "road.h5"
    shutil.copy(path, path.parent / "road.h5.journal")
    (path.parent / "small.toml").write_text(SCENARIO)
    try:
        build_file(problem(path.parent), target, batch_pairs=400)
        assert read_roadmap(target).target.tobytes() == roadmap().target.tobytes()
    finally:
        for left in path.parent.glob("road.h5*"):
            left.unlink()


KINDS = {
    "small.toml": lambda path: read_scenario(path).problem(),
    "road.h5": read_roadmap,
    "part.h5": read_part,
    "parts.h5": lambda path: merge([path, path], path.parent / "whole.h5"),
    "path.json": load_path,
    "four.nc": load_currents,
    "three.nc": load_currents,
    "zarr.json": load_store,
    "kept.h5.journal": load_journal,
    "chart.nc": lambda path: read_bathymetry(path, FRAME, (5.2, 5.5), (40.2, 40.5)),
    "zones.geojson": lambda path: read_polygons(path, FRAME),
    "dives.csv": lambda path: calibrate(read_dives(path)),
    "drawn.csv": read_drawn,
    "drawn.gpx": read_drawn,
    "drawn.kml": read_drawn,
}
FRAME = LocalFrame(5.35, 40.35)
SOURCES = {"parts.h5": "part.h5", "zarr.json": "store.zarr/uo/zarr.json"}
CHANGES = some.lists(
    some.tuples(
        some.sampled_from(["flip", "cut", "drop", "splice", "copy", "noise"]),
        some.floats(0, 1),
        some.floats(0, 1),
        some.integers(0, 255),
    ),
    min_size=1,
    max_size=6,
)


def broken(whole, changes):
    """The bytes of a file after some changes."""
    data = bytearray(whole)
    for what, at, share, number in changes:
        place = int(at * max(len(data) - 1, 0))
        length = 1 + int(share * 64)
        if what == "flip" and data:
            data[place] ^= 1 << (number % 8)
        elif what == "cut":
            del data[place:]
        elif what == "drop":
            del data[place : place + length]
        elif what == "splice":
            part = PARTS[number % len(PARTS)]
            data[place : place + (len(part) if number > 127 else 0)] = part
        elif what == "copy":
            start = int(share * len(data))
            data[place : place + 64] = data[start : start + 64]
        else:
            data[place : place + length] = np.random.default_rng(number).bytes(length)
    return bytes(data)


def bounded(read, path):
    """Read in bounded time and memory; whether it was read, or refused in one line."""

    def late(*_):
        raise TimeoutError(f"{path} takes more than {SECONDS} s")

    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS)
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, before[1]))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(path)
    except InputError as error:
        said = str(error)
        assert "\n" not in said
        assert 10 < len(said) < 2000
        return False
    finally:
        signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_AS, before)
    return True


@pytest.mark.parametrize("kind", KINDS)
def test_broken_files(good, tmp_path, kind):
    source = good / SOURCES.get(kind, kind)
    whole = source.read_bytes()
    if kind == "zarr.json":
        shutil.copytree(good / "store.zarr", tmp_path / "good" / "store.zarr")
    place = tmp_path / "broken"
    place.mkdir()
    outcomes = []

    @settings(
        max_examples=EXAMPLES, derandomize=True, deadline=None, database=None,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(CHANGES)
    def each(changes):
        path = place / kind
        path.write_bytes(broken(whole, changes))
        outcomes.append(bounded(KINDS[kind], path))

    each()
    assert len(outcomes) >= EXAMPLES
    assert not all(outcomes)


def claiming(path, name, shape):
    with h5py.File(path, "r+") as file:
        kind, attributes = file[name].dtype, dict(file[name].attrs)
        del file[name]
        made = file.create_dataset(name, shape=shape, dtype=kind, chunks=(32768, *shape[1:]), maxshape=shape)
        made.attrs.update(attributes)


def test_a_header_that_claims_much(good, tmp_path):
    shutil.copy(good / "road.h5", tmp_path / "road.h5")
    claiming(tmp_path / "road.h5", "nodes/position", (10**12, 3))
    with pytest.raises(InputError, match=r"`nodes/position` claims 2\.4e\+13 bytes"):
        bounded_raises(read_roadmap, tmp_path / "road.h5")
    shutil.copy(good / "four.nc", tmp_path / "four.nc")
    with h5py.File(tmp_path / "four.nc", "r+") as file:
        del file["uo"]
        made = file.create_dataset("uo", shape=(10**4, 10**4, 10**4), dtype="f8", chunks=(1, 1000, 1000))
        made.attrs["units"] = "m/s"
    with pytest.raises(InputError, match=r"four\.nc"):
        bounded_raises(load_currents, tmp_path / "four.nc")


def test_a_path_file_that_is_huge(tmp_path):
    with (tmp_path / "path.json").open("wb") as stream:
        stream.truncate(2 * 10**9)
    with pytest.raises(InputError, match="more than a path needs"):
        bounded_raises(load_path, tmp_path / "path.json")


def bounded_raises(read, path):
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, before[1]))
    try:
        read(path)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def test_links_are_not_followed(good, tmp_path):
    shutil.copy(good / "road.h5", tmp_path / "road.h5")
    shutil.copy(good / "road.h5", tmp_path / "other.h5")
    with h5py.File(tmp_path / "road.h5", "r+") as file:
        del file["nodes/position"]
        file["nodes/position"] = h5py.ExternalLink("other.h5", "/nodes/position")
    with pytest.raises(InputError, match=r"links to another file at `position`, but links are not followed"):
        read_roadmap(tmp_path / "road.h5")
    shutil.copy(good / "four.nc", tmp_path / "four.nc")
    (tmp_path / "raw").write_bytes(bytes(3 * 10 * 10 * 8))
    with h5py.File(tmp_path / "four.nc", "r+") as file:
        del file["uo"]
        file.create_dataset("uo", (3, 10, 10), "f8", external=[("raw", 0, 2400)])
    with pytest.raises(InputError, match=r"`uo` in .*four.nc lie in other files, which are not read"):
        load_currents(tmp_path / "four.nc")
    with h5py.File(tmp_path / "four.nc", "r+") as file:
        del file["uo"]
        layout = h5py.VirtualLayout((3, 10, 10), "f8")
        layout[:] = h5py.VirtualSource("other.nc", "uo", (3, 10, 10))
        file.create_virtual_dataset("uo", layout)
    with pytest.raises(InputError, match="which are not read"):
        load_currents(tmp_path / "four.nc")


def test_a_store_that_unpickles_is_refused(good, tmp_path):
    shutil.copytree(good / "store.zarr", tmp_path / "store.zarr")
    [meta] = [
        file
        for file in (tmp_path / "store.zarr").rglob("*")
        if file.parent.name == "uo" and file.suffix == ".json"
    ]
    meta.write_text(meta.read_text().replace('"codecs": [', '"codecs": [{"name": "pickle"}, ', 1))
    with pytest.raises(InputError, match="pickled objects, which are not read"):
        load_currents(tmp_path / "store.zarr")
