"""What a check of an aircraft file finds: one value that is unlike an aeroplane's, and what to do about it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

__all__ = ["DEGREES", "FileFinding", "unit_that_fits"]

DEGREES = math.degrees(1.0)
"""Degrees in a radian: the slip that derivatives suffer most."""


@dataclass(frozen=True, slots=True)
class FileFinding:
    """One implausible value of an aircraft file.

    Attributes:
        check: what was looked at, such as ``static_margin``; the same value in every version.
        key: where it stands in the file, such as ``coefficients.Cm.alpha``.
        value: as the file has it, or as it follows from the file.
        unit: SI, empty for a ratio.
        low: smallest usual value; minus infinity where there is none.
        high: largest usual value; infinity where there is none.
        standing: ``warning``: unusual, the file can be used; ``refusal``: no aircraft is so, or nothing can be
            expected of it.
        text: one sentence: the value, what is usual, what to do.
    """

    check: str
    key: str
    value: float
    unit: str
    low: float
    high: float
    standing: Literal["warning", "refusal"]
    text: str

    @classmethod
    def outside(
        cls, check: str, key: str, value: float, usual: tuple[float, float], do: str, unit: str = ""
    ) -> "FileFinding | None":
        """A warning where a value is outside its usual range, None where it is inside."""
        low, high = usual
        if low <= value <= high:
            return None
        shown = f" {unit}" if unit else ""
        bounds = f"{low:.3g} to {high:.3g}"
        if math.isinf(high):
            bounds = f"at least {low:.3g}"
        elif math.isinf(low):
            bounds = f"at most {high:.3g}"
        text = f"{key} is {value:.4g}{shown}, usual is {bounds}{shown}: {do}"
        return cls(check, key, value, unit, low, high, "warning", text)


def unit_that_fits(value: float, usual: tuple[float, float], factors: Mapping[str, float]) -> str | None:
    """The unit whose factor brings a value into its usual range, nearest to the range's middle; None where none does.

    Args:
        value: as the file has it, in SI as it claims.
        usual: the range, both ends of one sign.
        factors: by the unit's name, what one of it is in SI.
    """
    low, high = sorted(abs(x) for x in usual)
    middle = math.sqrt(low * high)
    fits = {
        u: abs(math.log(abs(value) * f / middle)) for u, f in factors.items() if low <= abs(value) * f <= high
    }
    return min(fits, key=fits.__getitem__) if fits else None
