"""A centre of gravity that is not where the aircraft file's coefficients take it.

The aerodynamic forces keep their places, so every moment about the centre of gravity changes: with a shift dx aft,
Cm_alpha by CL_alpha dx/c for small angles. Moments of inertia about the centre of gravity are left as they are: which
masses moved is not said (``mass_inertia`` of a payload says it).
"""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["CgShift"]


@dataclass(frozen=True, slots=True)
class CgShift(Effect):
    """``size`` is the shift in m, aft positive."""

    name: ClassVar[str] = "cg_shift"
    size_min: ClassVar[float] = -10.0
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "the shift in m, aft positive"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """The body x axis points forward, so a shift aft is negative on it."""
        parameters["cg_x_m"] -= severity
