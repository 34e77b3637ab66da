"""Loss of rudder effectiveness: every force and moment of the surface shrinks, its travel does not.

The usual form in the fault literature: control derivatives times 1 - lambda (such as Machines 2023, 11(2), 211).
"""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["RudderEffectiveness"]


@dataclass(frozen=True, slots=True)
class RudderEffectiveness(Effect):
    """``size`` is the fraction of the rudder's effect that is lost, 0 to 1."""

    name: ClassVar[str] = "rudder_effectiveness"
    size_max: ClassVar[float] = 1.0
    size_meaning: ClassVar[str] = "the fraction lost"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Each of the surface's coefficients times 1 - severity."""
        parameters.scale(
            {"CD_rudder": -1.0, "CY_rudder": -1.0, "Cl_rudder": -1.0, "Cn_rudder": -1.0}, severity
        )
