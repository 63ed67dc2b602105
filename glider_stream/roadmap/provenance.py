"""What made a roadmap, and a check that flow, terrain and glider are still the same."""

import hashlib
import platform
import tomllib
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ..base.arrays import Array
from ..base.settings import require
from ..kernels.cache import KERNEL_DIGEST
from ..vehicle.polar import glider_sha256
from ..water.inspect import flow_sha256
from .inputs import inputs_of, names_of
from .problem import Problem
from .roadmap import Made, Provenance

_version = cache(version)
"""Returns the version of a package; it is cached, because it is read from files."""


def lonlat_of(problem: Problem, position: Array) -> Array | None:
    """Return longitude and latitude (n, 2) [degrees] of nodes (n, 3) [m]; None if not geographic."""
    return None if problem.to_lonlat is None else problem.to_lonlat(position)


def provenance_of(problem: Problem, position: Array, folder: Path | None = None) -> Provenance:
    """Return what makes a roadmap of this problem now, with nodes (n, 3) [m] and a file in `folder`."""
    names = names_of(tomllib.loads(problem.scenario))
    return Provenance(
        scenario=problem.scenario,
        flow=problem.flow_words,
        glider=problem.glider_words,
        scenario_sha256=hashlib.sha256(problem.scenario.encode()).hexdigest(),
        flow_sha256=flow_sha256(problem.evaluator.flow),
        terrain_sha256=flow_sha256(problem.evaluator.terrain),
        glider_sha256=glider_sha256(problem.evaluator.polar),
        nodes_sha256=hashlib.sha256(np.ascontiguousarray(position, "<f8").tobytes()).hexdigest(),
        kernel_digest=KERNEL_DIGEST,
        seed=problem.sampler.seed,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        software_version=_version("glider-stream"),
        cost_unit=problem.evaluator.cost.unit,
        inputs=inputs_of(names, (folder or Path()).absolute()),
        libraries=", ".join(f"{name} {_version(name)}" for name in ("numpy", "numba", "scipy", "h5py")),
        machine=f"{platform.node()}, {platform.machine()}, Python {platform.python_version()}",
    )


def check_unchanged(roadmap: Made, problem: Problem) -> None:
    """Raise InputError unless the roadmap was built with the problem's flow, terrain and glider."""
    made = roadmap.provenance
    for name, digest, now in (
        ("flow", made.flow_sha256, flow_sha256(problem.evaluator.flow)),
        ("terrain", made.terrain_sha256, flow_sha256(problem.evaluator.terrain)),
        ("glider", made.glider_sha256, glider_sha256(problem.evaluator.polar)),
    ):
        require(
            digest in ("", now),  # earlier versions of the program did not store the terrain's digest
            f"the {name} has changed since the roadmap was built (its digest was {digest[:12]}, it is "
            f"{now[:12]} now); build the roadmap again",
        )
