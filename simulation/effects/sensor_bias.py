"""A sensor that reads too much or too little by a constant, or drifts there over the ramp."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, SensorFault
from wingwatch.simulation.sensor_errors import READINGS

__all__ = ["SensorBias"]


@dataclass(frozen=True, slots=True)
class SensorBias(Effect):
    """``size`` is what a column reads too much, in its unit."""

    name: ClassVar[str] = "sensor_bias"
    size_min: ClassVar[float] = -10000.0
    size_max: ClassVar[float] = 10000.0
    size_meaning: ClassVar[str] = "the bias in the column's unit"
    targets: ClassVar[tuple[str, ...]] = READINGS

    def sensor_faults(self) -> tuple[SensorFault, ...]:
        """One column, more by the severity."""
        return (SensorFault(self.target, bias=1.0),)
