"""What is no chance; compiled."""

import math

from wingwatch.kernels.decorators import lean

__all__ = ["CHANCE", "beyond_chance", "chance_of"]

CHANCE = 4.0
"""Standard deviations beyond which a difference is no chance: once in 30,000."""


@lean
def chance_of(freedom):  # type: ignore[no-untyped-def]
    """Sum of squares of so many standard normal numbers that is exceeded by ``CHANCE`` (Wilson and Hilferty 1931)."""
    part = 2.0 / (9.0 * freedom)
    return freedom * (1.0 - part + CHANCE * math.sqrt(part)) ** 3


@lean
def beyond_chance(squares, freedom):  # type: ignore[no-untyped-def]
    """Whether a sum of squares of so many standard normal numbers is so large by no chance."""
    return squares > chance_of(freedom)
