"""A mass that is not what the aircraft file says: all of it alike, or a payload that left or came at a place."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wingwatch.simulation.effects.effect import Effect, Parameters
from wingwatch.simulation.effects.mass_change import add_mass

__all__ = ["MassInertia"]

_TENSOR = ("inertia_x", "inertia_y", "inertia_z", "inertia_xz", "inertia_xy", "inertia_yz")
_PAYLOAD = "payload"


@dataclass(frozen=True, slots=True)
class MassInertia(Effect):
    """``size`` is the ratio of mass after to before, minus 1: -0.2 is a fifth less.

    ``all`` (the default): mass and every moment of inertia alike, the centre of gravity stays. ``payload,X,Y,Z``:
    the difference is a point mass X m forward, Y m right of and Z m below the reference point (the clean centre of
    gravity); centre of gravity and inertia follow by the parallel-axis theorem. ``payload`` alone is one at that
    point itself.
    """

    name: ClassVar[str] = "mass_inertia"
    size_min: ClassVar[float] = -0.9
    size_max: ClassVar[float] = 4.0
    size_meaning: ClassVar[str] = "the ratio of mass after to before minus 1"
    targets: ClassVar[tuple[str, ...]] = ("all", _PAYLOAD, f"{_PAYLOAD},X,Y,Z (its place in m)")
    target_default: ClassVar[str] = "all"

    def knows(self, target: str) -> bool:
        """All, payload, or payload at a place."""
        return target == "all" or _place(target) is not None

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Mass, inertia and, for a payload, the centre of gravity."""
        place = _place(self.target)
        if place is not None:
            add_mass(parameters, severity * parameters["mass_kg"], place)
        else:
            parameters.scale(dict.fromkeys(("mass_kg", *_TENSOR), 1.0), severity)


def _place(target: str) -> NDArray[np.float64] | None:
    """Where a payload is, None for a target that names none."""
    word, *numbers = target.split(",")
    if word != _PAYLOAD or len(numbers) not in (0, 3):
        return None
    try:
        place = [float(number) for number in numbers] or [0.0, 0.0, 0.0]
    except ValueError:
        return None
    return np.array(place) if all(map(math.isfinite, place)) else None
