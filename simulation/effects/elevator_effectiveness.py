"""Loss of elevator effectiveness: every force and moment of the surface shrinks, its travel does not.

The usual form in the fault literature: control derivatives times 1 - lambda (such as Machines 2023, 11(2), 211).
"""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["ElevatorEffectiveness"]


@dataclass(frozen=True, slots=True)
class ElevatorEffectiveness(Effect):
    """``size`` is the fraction of the elevator's effect that is lost, 0 to 1."""

    name: ClassVar[str] = "elevator_effectiveness"
    size_max: ClassVar[float] = 1.0
    size_meaning: ClassVar[str] = "the fraction lost"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Each of the surface's coefficients times 1 - severity."""
        parameters.scale({"CL_elevator": -1.0, "CD_elevator": -1.0, "Cm_elevator": -1.0}, severity)
