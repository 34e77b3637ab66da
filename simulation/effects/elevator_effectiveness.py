"""Loss of elevator effectiveness: every force and moment of the surface shrinks, its travel does not.

The usual form in the fault literature: control derivatives times 1 - lambda (such as Machines 2023, 11(2), 211).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect

__all__ = ["ElevatorEffectiveness"]


@dataclass(frozen=True, slots=True)
class ElevatorEffectiveness(Effect):
    """``size`` is the fraction of the elevator's effect that is lost, 0 to 1."""

    name: ClassVar[str] = "elevator_effectiveness"
    size_max: ClassVar[float] = 1.0
    size_meaning: ClassVar[str] = "the fraction lost"

    def factors(self) -> Mapping[str, float]:
        """-1 on each of the surface's coefficients."""
        return {"CL_elevator": -1.0, "CD_elevator": -1.0, "Cm_elevator": -1.0}
