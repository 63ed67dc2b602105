"""Properties of any flow: whether it is steady, its digest, its divergence."""

import hashlib
import math

import numpy as np

from ..base.checks import Range
from ..base.settings import require
from ..kernels import flow as kernel
from ..kernels.terrain import Terrain


def is_steady(flow: kernel.Flow) -> bool:
    """Whether the flow is the same at all times."""
    return kernel.cycle(flow) == 0


def require_level(flow: kernel.Flow, what: str) -> None:
    """Raise InputError if a flow has a vertical part; `what` cannot take it, and begins the sentence."""
    require(
        not kernel.rises(flow),
        f"{what} takes no vertical current, and this flow has one, up to {kernel.max_rise(flow):.3g} m/s; "
        "choose a flow without it",
    )


def flow_sha256(flow: kernel.Flow | Terrain) -> str:
    """Return a digest of everything that the kernels can read of a flow or of a terrain."""
    text = hashlib.sha256(type(flow).__name__.encode())
    for name, value in kernel.fields_of(flow).items():
        array = np.ascontiguousarray(value)
        text.update(f"\n{name} {array.dtype} {array.shape}\n".encode() + array.tobytes())
    return text.hexdigest()


def divergence_ratio(flow: kernel.Flow, x: Range, y: Range, z: Range, t: float = 0.0, count: int = 4096) -> float:
    """Return the ratio of rms horizontal divergence to rms vorticity in a box [m].

    The stream value needs a small ratio. The ratio is 0 where the flow has neither, and inf where it has
    divergence but no vorticity.
    """
    step = 1e-3 * min(flow.extent.length_scale, x[1] - x[0], y[1] - y[0])
    share = np.random.default_rng(0).random((3, count))
    lo = np.array([x[0] + step, y[0] + step, z[0]])
    hi = np.array([x[1] - step, y[1] - step, z[1]])
    px, py, pz = lo[:, None] + share * (hi - lo)[:, None]
    when = np.full(count, t)
    by_x = kernel.velocities(flow, px + step, py, pz, when) - kernel.velocities(flow, px - step, py, pz, when)
    by_y = kernel.velocities(flow, px, py + step, pz, when) - kernel.velocities(flow, px, py - step, pz, when)
    divergence = float(np.sqrt(np.mean((by_x[:, 0] + by_y[:, 1]) ** 2)))
    vorticity = float(np.sqrt(np.mean((by_x[:, 1] - by_y[:, 0]) ** 2)))
    if divergence == 0:
        return 0.0
    return divergence / vorticity if vorticity > 0 else math.inf
