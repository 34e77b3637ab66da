"""An airspeed that reads wrong, for the record and for the autopilot alike.

Ice in the pitot tube is such an error that grows: over its ramp the reading falls towards nothing (size -1), and the
autopilot answers with throttle.
"""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters, SensorFault

__all__ = ["AirspeedError"]


@dataclass(frozen=True, slots=True)
class AirspeedError(Effect):
    """``size`` is the ratio of the airspeed's reading to the true airspeed, minus 1."""

    name: ClassVar[str] = "airspeed_error"
    size_min: ClassVar[float] = -1.0
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "the ratio of reading to true airspeed minus 1"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """What the autopilot reads."""
        parameters.scale({"airspeed_reading": 1.0}, severity)

    def sensor_faults(self) -> tuple[SensorFault, ...]:
        """What the record shows."""
        return (SensorFault("airspeed_true_m_s", scale=1.0),)
