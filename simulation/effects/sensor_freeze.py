"""A sensor that froze: from the onset on its reading stays what it was, to the bit.

A frozen airspeed, as a blocked pitot tube shows it, is read by the autopilot as well.
"""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, SensorFault
from wingwatch.simulation.sensor_errors import READINGS

__all__ = ["SensorFreeze"]


@dataclass(frozen=True, slots=True)
class SensorFreeze(Effect):
    """``size`` is 1: a reading is frozen or is not."""

    name: ClassVar[str] = "sensor_freeze"
    size_min: ClassVar[float] = 1.0
    size_max: ClassVar[float] = 1.0
    size_meaning: ClassVar[str] = "1, for a reading is frozen or is not"
    targets: ClassVar[tuple[str, ...]] = READINGS
    grows: ClassVar[bool] = False

    def sensor_faults(self) -> tuple[SensorFault, ...]:
        """One column, frozen."""
        return (SensorFault(self.target, frozen=True),)
