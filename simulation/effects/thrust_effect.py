"""Thrust that pitches the aircraft: its line passes beside the point where the aircraft file has it."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["ThrustEffect"]


@dataclass(frozen=True, slots=True)
class ThrustEffect(Effect):
    """``size`` is how far the thrust line lies below the file's, in m: a line below the centre of gravity pitches
    the nose
    up by thrust times distance."""

    name: ClassVar[str] = "thrust_effect"
    size_min: ClassVar[float] = -10.0
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "how far the thrust line lies lower, in m"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Added to the thrust line's place."""
        parameters["thrust_line_z_m"] += severity
