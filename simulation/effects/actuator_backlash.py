"""Play between a servo and its surface that the aircraft file does not have."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters
from wingwatch.simulation.layout import SURFACES

__all__ = ["ActuatorBacklash"]


@dataclass(frozen=True, slots=True)
class ActuatorBacklash(Effect):
    """``size`` is the full width of the play in rad, added to the actuator's own."""

    name: ClassVar[str] = "actuator_backlash"
    size_max: ClassVar[float] = 1.0
    size_meaning: ClassVar[str] = "the full width of the play in rad"
    targets: ClassVar[tuple[str, ...]] = SURFACES

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Added to the surface's backlash."""
        parameters[f"{self.target}_backlash"] += severity
