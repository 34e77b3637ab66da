"""A control surface that stands beside its command: a bent or badly rigged linkage."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters
from wingwatch.simulation.layout import SURFACES

__all__ = ["SurfaceOffset"]


@dataclass(frozen=True, slots=True)
class SurfaceOffset(Effect):
    """``size`` is the deflection at zero command, in rad; the command does not show it, the measured position does."""

    name: ClassVar[str] = "surface_offset"
    size_min: ClassVar[float] = -1.6
    size_max: ClassVar[float] = 1.6
    size_meaning: ClassVar[str] = "the offset in rad"
    targets: ClassVar[tuple[str, ...]] = SURFACES

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Added to the surface's offset."""
        parameters[f"{self.target}_offset"] += severity
