"""A sensor that reads a multiple of the truth."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, SensorFault
from wingwatch.simulation.sensor_errors import READINGS

__all__ = ["SensorScale"]


@dataclass(frozen=True, slots=True)
class SensorScale(Effect):
    """``size`` is the ratio of reading to truth, minus 1: -1 reads nothing, -2 is a sensor turned around."""

    name: ClassVar[str] = "sensor_scale"
    size_min: ClassVar[float] = -2.0
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "the ratio of reading to truth minus 1"
    targets: ClassVar[tuple[str, ...]] = READINGS

    def sensor_faults(self) -> tuple[SensorFault, ...]:
        """One column, times 1 + severity."""
        return (SensorFault(self.target, scale=1.0),)
