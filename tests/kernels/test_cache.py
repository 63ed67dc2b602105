"""The disk cache: an edit of any kernel file is never answered with old numbers; no edit, no compilation."""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

import glider_stream

KERNELS = Path(glider_stream.__file__).parent / "kernels"
ONE_LEG = """
import json, math, sys, time
sys.path.insert(0, sys.argv[1])
import glider_stream
from glider_stream.kernels.edges import Edge
from glider_stream.kernels.terrain import OpenWater
from glider_stream.roadmap.evaluator import Evaluator
from glider_stream.roadmap.steering import IntegrationSettings, SurfaceMethod
from glider_stream.vehicle.polar import polar
from glider_stream.vehicle.presets import PRESETS
from glider_stream.water.analytic import Uniform
assert glider_stream.__file__.startswith(sys.argv[1])
evaluator = Evaluator(
    Uniform(0.1, 0.2).kernel((-200.0, 0.0)),
    OpenWater(-math.inf),
    polar(PRESETS["paper"]),
    SurfaceMethod(400),
    IntegrationSettings(5.0, 125, 20.0),
)
northward = Edge(0, 100.0, 100.0, -0.5, math.pi / 2, 0.5, 0.0)
began = time.perf_counter()
rows = evaluator.trace([0.0, 0.0, 0.0], northward, 0.0)
print(json.dumps({"seconds": time.perf_counter() - began, "eastward": rows[-1, 1]}))
"""
"""A leg that heads north is carried eastward by the current alone."""
UNIFORM = "    return flow.u, flow.v\n"


@pytest.fixture
def copy(tmp_path):
    """The package in a folder of its own, the kernels as files."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(KERNELS.parent, tmp_path / "glider_stream", symlinks=False, ignore=ignored)
    return tmp_path


def run(folder):
    """One leg, flown in a new process."""
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    program = [sys.executable, "-W", "error", "-c", ONE_LEG, str(folder)]
    out = subprocess.run(program, env=environment, check=True, capture_output=True, text=True, cwd=folder)
    return json.loads(out.stdout)


def cached(folder):
    """Every file of the compiled kernels, with the time of its last change."""
    found = [path for ending in ("*.nbi", "*.nbc") for path in folder.rglob(ending)]
    return {path.relative_to(folder): path.stat().st_mtime_ns for path in found}


@pytest.mark.slow
@pytest.mark.wide
def test_a_new_process_starts_from_disk_and_an_edit_is_never_stale(copy):
    cold = run(copy)
    files = cached(copy)
    assert cold["eastward"] == pytest.approx(10.0, abs=1e-9)
    assert files
    warm = run(copy)
    assert cached(copy) == files
    assert warm["seconds"] < 3.0
    assert warm["seconds"] < 0.5 * cold["seconds"]
    assert warm["eastward"] == cold["eastward"]
    # not the entry point's own file: numba alone would answer from the cache
    source = copy / "glider_stream/kernels/flow.py"
    text = source.read_text()
    assert UNIFORM in text
    source.write_text(text.replace(UNIFORM, "    return 2.0 * flow.u, flow.v\n"))
    edited = run(copy)
    assert edited["eastward"] == pytest.approx(20.0, abs=1e-9)
    assert set(cached(copy)) > set(files)


def digest_of(folder):
    """KERNEL_DIGEST as the copy's own cache module makes it."""
    spec = importlib.util.spec_from_file_location("cache_of_the_copy", folder / "glider_stream/kernels/cache.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.KERNEL_DIGEST


def test_every_kernel_file_is_in_the_digest(copy):
    digests = {digest_of(copy)}
    sources = sorted((copy / "glider_stream/kernels").glob("*.py"))
    assert len(sources) >= 9
    for source in sources:
        text = source.read_text()
        source.write_text(text + "\n")
        digests.add(digest_of(copy))
        source.write_text(text)
    assert len(digests) == 1 + len(sources)
    assert digest_of(copy) in digests
    (copy / "glider_stream/kernels/another.py").write_text("")
    assert digest_of(copy) not in digests


def test_the_digest_is_of_the_text_alone(copy):
    before = digest_of(copy)
    for source in (copy / "glider_stream/kernels").glob("*.py"):
        os.utime(source, (time.time() + 100, time.time() + 100))
    assert digest_of(copy) == before
    assert re.fullmatch("[0-9a-f]{64}", before)


def test_kernels_cache_nothing_but_through_the_digest():
    for source in KERNELS.glob("*.py"):
        if source.name != "cache.py":
            assert "cache=True" not in source.read_text(), source.name
