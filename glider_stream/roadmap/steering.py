"""The settings of steering and integration in a scenario: they say how legs are found.

A new method needs one class like these and one row of METHODS; no other code depends on the kind of method.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

from ..base.checks import LONGEST, WIDEST
from ..base.settings import require
from ..kernels import connect, control, motion, refine
from ..kernels.fan import FlowMap
from ..kernels.flow import Flow, OceanGrid

Connector = Callable[..., None]
"""A kernel that tries pairs one by one, such as those of kernels/connect.py."""

MAX_CANDIDATES = 1_000_000
"""The greatest number of candidate controls of a pair."""

FAN, CALM_FAN = (6, 12), (4, 8)
"""The coarsest mesh of a fan. Currents of a file that carry nothing over one of its cells within the horizon
hardly deform a fan, so that there fewer controls suffice."""
MAX_FAN, MAX_GENERATIONS = 1000, 6
"""The greatest number of angles and headings of a fan, and of generations in which its cells are halved."""


@dataclass(frozen=True)
class SurfaceMethod:
    """The paper's baseline: `candidates` controls over the whole control surface are integrated."""

    candidates: int
    counts_steps: ClassVar = True

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

    def in_flow(self, flow: Flow, horizon: float) -> "SurfaceMethod":
        """Return the same method: it has no mesh."""
        return self


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
    def counts_steps(self) -> bool:
        """Whether the closest approach is looked for step by step."""
        return not self.refine

    @property
    def connector(self) -> Connector:
        """The kernel that tries pairs one by one."""
        kernel: Connector = refine.refine_nodes if self.refine else connect.connect_nodes
        return kernel

    def kernel(self) -> control.Steering:
        """Return the same settings in the form that the kernels read."""
        return control.Streamline(self.candidates)

    def in_flow(self, flow: Flow, horizon: float) -> "StreamlineMethod":
        """Return the same method: it has no mesh."""
        return self


@dataclass(frozen=True)
class FlowMapMethod:
    """Exact steering: finds every connection that exists, by the flow map of each source node.

    `fan` = [glide angles, headings] is the coarsest mesh over the controls of a node; by itself FAN, and CALM_FAN
    in calm currents of a file. Its cells are halved once, and up to `generations` times more where they are bent
    or folded, so the result depends little on both settings.
    """

    fan: tuple[int, int] | None = None
    generations: int = 3
    counts_steps: ClassVar = False

    def __post_init__(self) -> None:
        angles, headings = self.fan or FAN
        fits = 2 <= angles <= MAX_FAN and 4 <= headings <= MAX_FAN
        require(fits, f"`steering.fan` must be from [2, 4] to [{MAX_FAN}, {MAX_FAN}]; got {[angles, headings]}")
        fits = 0 <= self.generations <= MAX_GENERATIONS
        require(fits, f"`steering.generations` must be from 0 to {MAX_GENERATIONS}; got {self.generations}")

    @property
    def connector(self) -> None:
        """No kernel tries pairs one by one: all legs of a node are found together, under its fan."""
        return None

    def kernel(self) -> FlowMap:
        """Return the same settings in the form that the kernels read."""
        return FlowMap(*(self.fan or FAN), self.generations)

    def in_flow(self, flow: Flow, horizon: float) -> "FlowMapMethod":
        """Return the same method with the mesh that fits a flow and a horizon [s], if none was chosen."""
        if self.fan is not None:
            return self
        known = flow.extent
        calm = isinstance(flow, OceanGrid) and known.max_speed * horizon < known.length_scale
        return replace(self, fan=CALM_FAN if calm else FAN)


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
