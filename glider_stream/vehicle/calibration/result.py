"""The result of a calibration: the fitted vehicle and its uncertainty."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.terminal import plain
from ...base.toml import to_toml
from ..models import MODELS, Glider
from .dives import Dives

CONFIDENCE = 0.99
"""The uncertainty that is shown holds for this share of further dives."""


@dataclass(frozen=True)
class Parameter:
    """A fitted value with its `unit`, its standard error, and the preset's value."""

    value: float
    error: float
    before: float
    unit: str


@dataclass(frozen=True)
class Calibration:
    """A fitted `glider`; `parameters` by name; the values that were `held`, and why.

    `vertical_off`, `horizontal_off` (n,) [m/s]: errors of the fitted vehicle's speeds at each dive's recorded
    angle; the second is None without a horizontal speed. `vertical_within`, `horizontal_within` [m/s]: a further
    dive lies within them of the vehicle with the probability CONFIDENCE. `outlying`: lines of dives that are far
    off. `flat`: lines of dives that are flatter than the vehicle can glide.
    """

    glider: Glider
    parameters: dict[str, Parameter]
    held: dict[str, str]
    dives: Dives
    vertical_off: Array
    horizontal_off: Array | None
    vertical_within: float
    horizontal_within: float | None
    outlying: tuple[int, ...]
    flat: tuple[int, ...]

    def table(self) -> str:
        """Return the [glider] table of a scenario."""
        kinds = {kind: name for name, kind in MODELS.items()}
        return to_toml({"glider": {"model": kinds[type(self.glider)], **_values(self.glider)}})

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a dictionary for JSON."""
        across = self.horizontal_off
        return {
            "dives": int(self.dives.vertical.size),
            "took": self.dives.took,
            "unused": list(self.dives.unused),
            "loss": "least squares, plain",
            "parameters": {name: asdict(parameter) for name, parameter in self.parameters.items()},
            "held": self.held,
            "vertical_scatter_mps": scatter(self.vertical_off, len(self.parameters)),
            "horizontal_scatter_mps": None if across is None else scatter(across, len(self.parameters)),
            "vertical_within_mps": self.vertical_within,
            "horizontal_within_mps": self.horizontal_within,
            "confidence": CONFIDENCE,
            "outlying_lines": list(self.outlying),
            "flat_lines": list(self.flat),
            "glider": _values(self.glider),
        }

    def __str__(self) -> str:
        took = ", ".join(f"{what} = {plain(column)}" for what, column in self.dives.took.items())
        phases = "" if self.dives.down is not None else "; phases are not known, so a climb mirrors a dive"
        lines = [f"{self.dives.vertical.size} dives, {took}{phases}"]
        if self.dives.unused:
            lines.append(_line("not used", ", ".join(map(plain, self.dives.unused))))
        lines.append(
            _line("fit", "plain least squares; +- is one standard error, with the held values taken as right")
        )
        for name, parameter in self.parameters.items():
            value = f"{parameter.value:.5g} +- {parameter.error:.2g} {parameter.unit}".rstrip()
            lines.append(_line(name, f"{value} (the preset has {parameter.before:.5g})"))
        lines += [_line(name, f"held: {why}") for name, why in self.held.items()]
        for name, off, within in (
            ("vertical", self.vertical_off, self.vertical_within),
            ("horizontal", self.horizontal_off, self.horizontal_within),
        ):
            if off is not None:
                spread, worst = scatter(off, len(self.parameters)), float(np.abs(off).max())
                share = f"{CONFIDENCE:.0%} of further dives within {within:.4f} m/s of the vehicle"
                lines.append(
                    _line(name, f"scatters by {spread:.4f} m/s; {share}; the worst here {worst:.4f} m/s")
                )
        if self.dives.horizontal is not None:
            lines.append(
                _line("beware", "if a flight model made the horizontal speed, the fit returns that model")
            )
        if self.outlying:
            far = ", ".join(map(str, self.outlying))
            lines.append(_line("far off", f"line {far}: check these dives, or leave them out"))
        if self.flat:
            far = ", ".join(map(str, self.flat))
            lines.append(_line("too flat", f"line {far}: the vehicle cannot glide so flat; try another preset"))
        return "\n".join([*lines, f"  {self.glider}"])


def _line(name: str, value: str) -> str:
    return f"  {name:<14} {value}"


def _values(glider: Glider) -> dict[str, Any]:
    return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(glider).items()}


def scatter(off: Array, fitted: int) -> float:
    """Return the standard deviation of errors (n,) after a fit of `fitted` parameters."""
    return float(np.sqrt((off**2).sum() / max(off.size - fitted, 1)))
