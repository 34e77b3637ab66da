"""Lanes: the places of vehicles in a state whose arrays lead with the vehicle axis, and who comes with how many rows.

A batch of rows has one entry a vehicle, (m, samples, columns), padded to the longest; ``Lanes`` says whose rows these
are and how many of them count. What is not named is left as it is, and no number of one lane enters another: a
vehicle's results do not depend on its company, to the bit.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Lanes", "all_lanes", "padded"]


class Lanes(NamedTuple):
    """Which vehicles of a state, each once.

    Attributes:
        place: (m,) row of each in the state.
        counts: (m,) number of its samples.
    """

    place: NDArray[np.int64]
    counts: NDArray[np.int64]


def all_lanes(vehicles: int, samples: int) -> Lanes:
    """All of a state's vehicles, with so many samples each."""
    return Lanes(np.arange(vehicles), np.full(vehicles, samples))


def padded(places: Sequence[int], rows: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], Lanes]:
    """Rows of vehicles, (samples, columns) each, as one batch."""
    lanes = Lanes(np.array(places, dtype=np.int64), np.array([len(part) for part in rows], dtype=np.int64))
    if len(rows) == 1:
        return rows[0][None], lanes
    values = np.zeros((len(rows), int(lanes.counts.max()), rows[0].shape[1]))
    for into, part in zip(values, rows, strict=True):
        into[: len(part)] = part
    return values, lanes
