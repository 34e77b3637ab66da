"""What a late source shows for each stamp: the one interpolation by which stated delays are taken out."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["SAME_STAMP_S", "ShownLater", "shown_later"]

Array = NDArray[np.float64]

SAME_STAMP_S = 1e-6
"""The resolution of autopilot stamps: a sum of stamp and delay rounds below it."""


class ShownLater(NamedTuple):
    """Values of a source some time after each stamp, each of shape (n,).

    Attributes:
        values: interpolated or held; meaningless before the first reading and where ``right`` is n.
        right: index of the reading at or after the wanted instant, n where it has not come.
        width_s: time between the readings on both sides, 0 where one is at the instant.
    """

    values: Array
    right: NDArray[np.int64]
    width_s: Array


def shown_later(
    time_s: Array, values: Array, delay_s: float, held: bool, leaping: bool = False
) -> ShownLater:
    """What readings show ``delay_s`` after their stamps.

    Args:
        time_s: rising stamps, (n,), n at least 1.
        values: readings, (n,).
        delay_s: of the source; negative for one that is early.
        held: a reading holds until the next; else the line between them counts.
        leaping: an angle whose line goes the shorter way round.
    """
    wanted = time_s + delay_s
    right = np.searchsorted(time_s, wanted - SAME_STAMP_S, side="left")
    there = np.minimum(right, time_s.size - 1)
    exact = np.abs(time_s[there] - wanted) <= SAME_STAMP_S
    left = np.where(exact, there, np.maximum(there - 1, 0))
    width = time_s[there] - time_s[left]
    if held:
        return ShownLater(values[left], right, width)
    change = values[there] - values[left]
    if leaping:
        change = (change + np.pi) % (2.0 * np.pi) - np.pi
    weight = np.divide(wanted - time_s[left], width, out=np.zeros_like(width), where=width > 0.0)
    return ShownLater(np.where(exact, values[there], values[left] + weight * change), right, width)
