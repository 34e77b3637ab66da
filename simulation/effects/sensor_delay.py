"""A sensor whose readings come later than the aircraft file says."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, SensorFault
from wingwatch.simulation.sensor_errors import READINGS

__all__ = ["SensorDelay"]


@dataclass(frozen=True, slots=True)
class SensorDelay(Effect):
    """``size`` is the delay of a column in s, added to the file's."""

    name: ClassVar[str] = "sensor_delay"
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "the delay in s"
    targets: ClassVar[tuple[str, ...]] = READINGS

    def sensor_faults(self) -> tuple[SensorFault, ...]:
        """One column, later by the severity."""
        return (SensorFault(self.target, delay_s=1.0),)
