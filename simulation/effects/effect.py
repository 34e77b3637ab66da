"""An effect: how far it has grown at a time, and how it scales the aircraft's coefficients."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.simulation.layout import COEFFICIENTS, coefficient_row

__all__ = ["Effect", "coefficients_under", "factor_row"]


@dataclass(frozen=True, slots=True)
class Effect(ABC):
    """Something that scales coefficients: C = (1 + severity factor) C_clean, factor by factor.

    Attributes:
        size: severity once it is fully there (meaning and range: each effect).
        onset_s: when it starts, in the flight's time.
        ramp_s: how long it grows, linearly; 0 for a step.

    Raises:
        ValueError: a size outside the effect's range, or a time that is negative or not finite.
    """

    size: float
    onset_s: float = 0.0
    ramp_s: float = 0.0

    name: ClassVar[str]
    size_max: ClassVar[float]
    size_meaning: ClassVar[str]

    def __post_init__(self) -> None:
        if not 0.0 <= self.size <= self.size_max:
            raise ValueError(
                f"{self.name} has size {self.size}; give {self.size_meaning}, 0 to {self.size_max:g}"
            )
        for what, value in (("start", self.onset_s), ("ramp", self.ramp_s)):
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{self.name} has {what} {value} s; give a number of seconds from 0")

    def severity(self, time_s: float) -> float:
        """How much of it there is at a time: 0 before the onset, ``size`` after the ramp."""
        since = time_s - self.onset_s
        if since < 0.0:
            return 0.0
        return self.size if since >= self.ramp_s else self.size * since / self.ramp_s

    @abstractmethod
    def factors(self) -> Mapping[str, float]:
        """Factor by coefficient (``Cm_elevator``); a coefficient that is not named does not change."""


def factor_row(effect: Effect) -> NDArray[np.float64]:
    """The effect's factors in the order of ``layout.COEFFICIENTS``."""
    factors = effect.factors()
    return np.array([factors.get(name, 0.0) for name in COEFFICIENTS])


def coefficients_under(aircraft: Aircraft, effects: Sequence[Effect], time_s: float) -> NDArray[np.float64]:
    """The aircraft's coefficients at a time under effects, which multiply; shape (len(COEFFICIENTS),)."""
    row = coefficient_row(aircraft)
    for effect in effects:
        row = row * (1.0 + effect.severity(time_s) * factor_row(effect))
    return row
