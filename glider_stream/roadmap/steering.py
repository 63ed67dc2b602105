"""The settings of steering and integration in a scenario: they say how legs are found.

A new method needs one class like these and one row of METHODS; no other code depends on the kind of method.
"""

from collections.abc import Callable
from dataclasses import dataclass

from ..base.checks import LONGEST, WIDEST
from ..base.settings import require
from ..kernels import connect, control, motion, refine
from ..kernels.fan import FlowMap

Connector = Callable[..., None]
"""A kernel that tries pairs one by one, such as those of kernels/connect.py."""

MAX_CANDIDATES = 1_000_000
"""The greatest number of candidate controls of a pair."""

MAX_FAN, MAX_GENERATIONS = 1000, 6
"""The greatest number of angles and headings of a fan, and of generations in which its cells are halved."""


@dataclass(frozen=True)
class SurfaceMethod:
    """The paper's baseline: `candidates` controls over the whole control surface are integrated."""

    candidates: int

    def __post_init__(self) -> None:
        _check_candidates(self.candidates)

    @property
    def connector(self) -> Connector:
        """The kernel that tries pairs one by one."""
        kernel: Connector = connect.connect_nodes
        return kernel

    def kernel(self) -> control.Steering:
        """Return the same settings in the form that the kernels read."""
        return control.Surface(self.candidates)


@dataclass(frozen=True)
class StreamlineMethod:
    """The paper's method: controls on the control line.

    With `refine`, the controls that land nearest are first guesses, from which exact legs are found, as with the
    flow map.
    """

    candidates: int
    refine: bool = False

    def __post_init__(self) -> None:
        _check_candidates(self.candidates)

    @property
    def connector(self) -> Connector:
        """The kernel that tries pairs one by one."""
        kernel: Connector = refine.refine_nodes if self.refine else connect.connect_nodes
        return kernel

    def kernel(self) -> control.Steering:
        """Return the same settings in the form that the kernels read."""
        return control.Streamline(self.candidates)


@dataclass(frozen=True)
class FlowMapMethod:
    """Exact steering: finds every connection that exists, by the flow map of each source node.

    `fan` = [glide angles, headings] is the coarsest mesh over the controls of a node. Its cells are halved once,
    and up to `generations` times more where they are bent or folded, so the result depends little on both
    settings.
    """

    fan: tuple[int, int] = (6, 12)
    generations: int = 3

    def __post_init__(self) -> None:
        fits = 2 <= self.fan[0] <= MAX_FAN and 4 <= self.fan[1] <= MAX_FAN
        require(fits, f"`steering.fan` must be from [2, 4] to [{MAX_FAN}, {MAX_FAN}]; got {list(self.fan)}")
        fits = 0 <= self.generations <= MAX_GENERATIONS
        require(fits, f"`steering.generations` must be from 0 to {MAX_GENERATIONS}; got {self.generations}")

    @property
    def connector(self) -> None:
        """No kernel tries pairs one by one: all legs of a node are found together, under its fan."""
        return None

    def kernel(self) -> FlowMap:
        """Return the same settings in the form that the kernels read."""
        return FlowMap(*self.fan, self.generations)


def _check_candidates(candidates: int) -> None:
    fits = 1 <= candidates <= MAX_CANDIDATES
    require(fits, f"`steering.candidates` must be from 1 to {MAX_CANDIDATES:,}; got {candidates}")


Method = SurfaceMethod | StreamlineMethod | FlowMapMethod

METHODS: dict[str, type[Method]] = {
    "streamline": StreamlineMethod,
    "surface": SurfaceMethod,
    "flow-map": FlowMapMethod,
}


@dataclass(frozen=True)
class IntegrationSettings:
    """The horizon has `steps` RK4 steps of `dt` [s]; a miss below `tolerance` [m] is a hit."""

    dt: float
    steps: int
    tolerance: float

    def __post_init__(self) -> None:
        require(self.dt > 0, f"`integration.dt` must be above 0 s; got {self.dt:g}")
        require(self.steps >= 1, f"`integration.steps` must be at least 1; got {self.steps}")
        horizon, most = self.dt * self.steps, f"{LONGEST:g} s, 30 years"
        require(horizon <= LONGEST, f"`integration.dt` times `steps` must be at most {most}; got {horizon:g} s")
        require(self.tolerance > 0, f"`integration.tolerance` must be above 0 m; got {self.tolerance:g}")
        fits = self.tolerance <= WIDEST
        require(fits, f"`integration.tolerance` must be {WIDEST:g} m at most; got {self.tolerance:g}")

    def kernel(self) -> motion.Integration:
        """Return the same settings in the form that the kernels read."""
        return motion.Integration(self.dt, self.steps, self.tolerance)
