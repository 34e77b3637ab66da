"""Lift and pitching moment that are curved over the angle of attack, where the aircraft file's are straight."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["IncidenceNonlinearity"]


@dataclass(frozen=True, slots=True)
class IncidenceNonlinearity(Effect):
    """``size`` is the change of slope per rad of angle of attack, relative to the slope itself: at -5 the slope is
    a half
    0.1 rad (6 degrees) above the reference and half as much again 0.1 rad below it.

    The reference is the clean level trim of the flight (``alpha_reference``): value and slope there do not change.
    ``target`` is the lift, the pitching moment, or both (``all``, the default).
    """

    name: ClassVar[str] = "incidence_nonlinearity"
    size_min: ClassVar[float] = -50.0
    size_max: ClassVar[float] = 50.0
    size_meaning: ClassVar[str] = "the relative change of slope per rad"
    targets: ClassVar[tuple[str, ...]] = ("all", "lift", "pitch")
    target_default: ClassVar[str] = "all"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """C_alpha_square = size C_alpha / 2, for d/dalpha (C_alpha alpha + C_alpha_square (alpha - reference)^2)
        = C_alpha (1 + size (alpha - reference))."""
        for target, table in (("lift", "CL"), ("pitch", "Cm")):
            if self.target in ("all", target):
                parameters[f"{table}_alpha_square"] += 0.5 * severity * parameters[f"{table}_alpha"]
