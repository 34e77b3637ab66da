"""Downwash that reaches the tail late, where the aircraft file has none or another.

The tail is in the downwash that left the wing l/V earlier (l: tail arm), so while the angle of attack changes its
incidence is larger than the steady one by d(epsilon)/d(alpha) alphadot l/V. A pitch rate changes it by q l/V: the same
but for the factor. So, with the tail's share of the rate terms taken as the whole of it, Cm_alphadot =
d(epsilon)/d(alpha) Cm_q and CL_alphadot = d(epsilon)/d(alpha) CL_q (Etkin and Reid, Dynamics of Flight, section 5.5).
"""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["DownwashLag"]


@dataclass(frozen=True, slots=True)
class DownwashLag(Effect):
    """``size`` is the change of downwash with angle of attack, d(epsilon)/d(alpha), that the file does not have; usual
    values of a whole aircraft are 0.2 to 0.5. Negative where the file has too much."""

    name: ClassVar[str] = "downwash_lag"
    size_min: ClassVar[float] = -1.0
    size_max: ClassVar[float] = 1.0
    size_meaning: ClassVar[str] = "the change of downwash with angle of attack"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Added to the two alphadot terms."""
        parameters.need_one_of(("Cm_q", "CL_q"), self.name)
        for table in ("CL", "Cm"):
            parameters[f"{table}_alphadot"] += severity * parameters[f"{table}_q"]
