"""A pitch damping that is not what the aircraft file says."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["PitchDamping"]


@dataclass(frozen=True, slots=True)
class PitchDamping(Effect):
    """``size`` is the ratio of Cm_q after to before, minus 1: -1 leaves none."""

    name: ClassVar[str] = "pitch_damping"
    size_min: ClassVar[float] = -2.0
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "the ratio of Cm_q minus 1"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Cm_q alone; the lag of the downwash has an effect of its own."""
        parameters.need_one_of(("Cm_q",), self.name)
        parameters.scale({"Cm_q": 1.0}, severity)
