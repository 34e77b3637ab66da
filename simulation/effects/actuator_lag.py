"""An actuator that follows later than the aircraft file says."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters
from wingwatch.simulation.layout import SURFACES

__all__ = ["ActuatorLag"]


@dataclass(frozen=True, slots=True)
class ActuatorLag(Effect):
    """``size`` is the time constant that is added to the actuator's own, in s.

    The actuator stays of first order: its time constant becomes the sum, which delays slow motions by as much as a
    second lag behind the first would.
    """

    name: ClassVar[str] = "actuator_lag"
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "the added time constant in s"
    targets: ClassVar[tuple[str, ...]] = SURFACES

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Bandwidth is one over the time constant; an ideal actuator has none."""
        bandwidth = f"{self.target}_bandwidth"
        if severity > 0.0:
            parameters[bandwidth] = 1.0 / (1.0 / parameters[bandwidth] + severity)
