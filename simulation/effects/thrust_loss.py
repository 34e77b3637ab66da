"""Thrust that is missing: an engine failure, a damaged or iced propeller, a weak battery."""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["ThrustLoss"]


@dataclass(frozen=True, slots=True)
class ThrustLoss(Effect):
    """``size`` is the fraction of the thrust that is lost, 0 to 1; 1 is no thrust and no drag of a windmilling
    propeller."""

    name: ClassVar[str] = "thrust_loss"
    size_max: ClassVar[float] = 1.0
    size_meaning: ClassVar[str] = "the fraction lost"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """At every throttle the same share of what it would give."""
        parameters.scale({"thrust_share": -1.0}, severity)
