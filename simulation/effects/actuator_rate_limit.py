"""An actuator that is slower than the aircraft file says, as with a low supply voltage or a stiff linkage."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters
from wingwatch.simulation.layout import SURFACES

__all__ = ["ActuatorRateLimit"]


@dataclass(frozen=True, slots=True)
class ActuatorRateLimit(Effect):
    """``size`` is the rate limit in rad/s; it acts where it is below the actuator's own."""

    name: ClassVar[str] = "actuator_rate_limit"
    size_min: ClassVar[float] = 0.001
    size_max: ClassVar[float] = 100.0
    size_meaning: ClassVar[str] = "the rate limit in rad/s"
    targets: ClassVar[tuple[str, ...]] = SURFACES
    grows: ClassVar[bool] = False

    def apply(self, parameters: Parameters, severity: float) -> None:
        """The lower of the two limits."""
        limit = f"{self.target}_rate_limit"
        parameters[limit] = min(parameters[limit], severity)
