"""A vane in the aircraft's own upwash or sidewash: it turns further than the flow far ahead does."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, SensorFault

__all__ = ["VaneUpwash"]


@dataclass(frozen=True, slots=True)
class VaneUpwash(Effect):
    """``size`` is the ratio of the vane's angle to the true one, minus 1: of the angle of attack or of the sideslip."""

    name: ClassVar[str] = "vane_upwash"
    size_min: ClassVar[float] = -1.0
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "the ratio of the vane's angle to the true one minus 1"
    targets: ClassVar[tuple[str, ...]] = ("angle_of_attack", "sideslip")

    def sensor_faults(self) -> tuple[SensorFault, ...]:
        """The vane's column, times 1 + severity."""
        return (SensorFault(f"{self.target}_rad", scale=1.0),)
