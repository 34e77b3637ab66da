"""What a cause does to the derivatives: the patterns that the classifier tells apart.

A cause is a direction in the space of derivatives times its size. Causes that act on several modes (icing) have one
size for all of them. The direction is taken at the derivatives expected just before the onset. The vocabulary of
names is shared with diagnosis and simulation; the mathematics is this module's own.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, FlightCondition, ModeStructure, icing_direction
from wingwatch.monitor.estimation.sizes import TYPICAL_CHANGE

__all__ = ["CAUSES", "Cause", "UNEXPLAINED"]

Array = NDArray[np.float64]
Direction = Callable[[ModeStructure, Array, Aircraft, FlightCondition], Array]


@dataclass(frozen=True, slots=True)
class Cause:
    """One hypothesis.

    Attributes:
        name: of the shared vocabulary.
        kind: alert kind.
        size_std: standard deviation of the size expected before anything is seen (half-normal).
        weight: share of the prior probability among causes.
        levels: sizes from which an alert is a warning, and critical.
        direction: change of the concise derivatives (..., k) per unit of size, of the same shape.
        words: what the operator reads, with ``{size}``; advice: what to do.
    """

    name: str
    kind: str
    size_std: float
    weight: float
    levels: tuple[float, float]
    direction: Direction
    words: str
    advice: str

    def level(self, size: float) -> str:
        """``watch``, ``warning`` or ``critical``; ``size`` in the unit of the cause."""
        warning, critical = self.levels
        return "critical" if size >= critical else "warning" if size >= warning else "watch"


def _icing(structure: ModeStructure, concise: Array, aircraft: Aircraft, condition: FlightCondition) -> Array:
    return icing_direction(structure, concise, aircraft, condition)


@cache
def _moved_by(structure: ModeStructure, surface: str) -> NDArray[np.bool_]:
    """Which derivatives are those of a surface, (k,)."""
    return np.array([symbol.endswith(f"_{surface}") for symbol in structure.derivatives])


def _loss_of(surface: str) -> Direction:
    def direction(
        structure: ModeStructure, concise: Array, aircraft: Aircraft, condition: FlightCondition
    ) -> Array:
        return np.where(_moved_by(structure, surface), -concise, 0.0)

    return direction


def _effectiveness(surface: str, symbol: str, advice: str) -> Cause:
    return Cause(
        f"{surface}_effectiveness", "damage", 0.5, 0.15, (0.2, 0.5), _loss_of(symbol),
        f"{surface.capitalize()} has lost {{size}} of its effectiveness", advice,
    )  # fmt: skip


CAUSES: tuple[Cause, ...] = (
    Cause(
        "icing", "icing", 0.2, 0.30, (0.07, 0.2), _icing,
        "Icing of severity {size} (Twin Otter scale)", "Leave the icing layer and keep airspeed up.",
    ),
    _effectiveness("elevator", "eta", "Avoid steep manoeuvres and land as soon as practical."),
    _effectiveness("aileron", "xi", "Keep bank angles small and land as soon as practical."),
    _effectiveness("rudder", "zeta", "Avoid crosswind and land as soon as practical."),
)  # fmt: skip
"""Every cause the first classifier knows. Sizes: severity eta (published values reach 0.3 to 0.4), fraction lost."""

UNEXPLAINED = Cause(
    "unknown", "unexplained", TYPICAL_CHANGE, 0.05, (0.2, 0.5), lambda s, c, a, f: np.zeros_like(c),
    "Derivatives have changed by up to {size} in no known pattern", "Compare with the evidence and inspect.",
)  # fmt: skip
"""Any change of any derivative, by up to about ``size_std`` of its size."""
