"""Turbulence that the flight runs into, on top of what its scenario has from the start."""

import math
from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["TurbulenceOnset"]


@dataclass(frozen=True, slots=True)
class TurbulenceOnset(Effect):
    """``size`` is the root mean square of the vertical gust that begins, in m/s; the other components keep their
    ratio to it. Variances of independent gusts add, so turbulence that is there already grows by the root of the
    sum of squares.
    """

    name: ClassVar[str] = "turbulence"
    size_max: ClassVar[float] = 20.0
    size_meaning: ClassVar[str] = "the root mean square of the vertical gust in m/s"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """The gain of the flight's gust filter; parameters of no flight (a trim, a linearisation) have none."""
        sigma = parameters["gust_sigma"]
        if sigma > 0.0:
            parameters["gust_gain"] = math.hypot(parameters["gust_gain"], severity / sigma)
