"""Cross-coupling of roll and yaw that is not what the aircraft file says."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["RollYawCoupling"]

_CROSS = ("Cl_r", "Cl_rudder", "Cn_p", "Cn_aileron")
"""Roll due to yaw rate and rudder, yaw due to roll rate and aileron; roll due to sideslip is no motion in yaw."""


@dataclass(frozen=True, slots=True)
class RollYawCoupling(Effect):
    """``size`` is the ratio of Cl_r, Cl_rudder, Cn_p and Cn_aileron after to before, minus 1: -1 leaves none."""

    name: ClassVar[str] = "roll_yaw_coupling"
    size_min: ClassVar[float] = -10.0
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "the ratio of the cross terms minus 1"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """The four cross terms alike."""
        parameters.need_one_of(_CROSS, self.name)
        parameters.scale(dict.fromkeys(_CROSS, 1.0), severity)
