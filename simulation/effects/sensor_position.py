"""A sensor that does not sit where the aircraft file says."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["SensorPosition"]


@dataclass(frozen=True, slots=True)
class SensorPosition(Effect):
    """``size`` is how far the inertial sensors (``imu``) or the vanes (``vane``) sit from their stated place along
    a body
    axis (x forward, y right, z down), in m."""

    name: ClassVar[str] = "sensor_position"
    size_min: ClassVar[float] = -100.0
    size_max: ClassVar[float] = 100.0
    size_meaning: ClassVar[str] = "the distance in m"
    targets: ClassVar[tuple[str, ...]] = ("imu_x", "imu_y", "imu_z", "vane_x", "vane_y", "vane_z")

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Added to the sensor's place."""
        parameters[f"{self.target}_m"] += severity
